#!/bin/sh
# An authority of its own for one farm, and a certificate for each of its three roles, for compose.tls.yaml.
#
#     sh docker/certificates.sh FOLDER [DAYS]      # needs openssl; 365 days by default
#
# Leaves ca.pem and ROLE.pem, ROLE.key for scheduler, worker and client. The authority's own key is thrown away: whoever
# has a certificate of this authority may run code on the farm, and nobody is to make further ones. To renew, run it again.
set -eu
folder=${1:?usage: certificates.sh FOLDER [DAYS]}
days=${2:-365}
command -v openssl >/dev/null || { echo "certificates.sh: no openssl on the PATH; expected OpenSSL 1.1.1 or later" >&2; exit 1; }

umask 077
mkdir -p "$folder"
chmod 700 "$folder"
authority=$(mktemp -d)
trap 'code=$?; [ "$code" = 0 ] || cat "$authority/log" >&2; rm -rf "$authority"; exit "$code"' EXIT

openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -sha256 -days "$days" \
    -subj "/CN=zeroshot farm" -keyout "$authority/ca.key" -out "$authority/ca.pem" \
    -addext "basicConstraints=critical,CA:TRUE,pathlen:0" -addext "keyUsage=critical,keyCertSign,cRLSign" 2>>"$authority/log"

for role in scheduler worker client; do
    openssl req -new -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -sha256 \
        -subj "/CN=$role" -keyout "$authority/$role.key" -out "$authority/$role.csr" 2>>"$authority/log"
    # every part of a Dask cluster both listens and connects
    printf '%s\n' "basicConstraints=critical,CA:FALSE" "keyUsage=critical,digitalSignature" \
        "extendedKeyUsage=serverAuth,clientAuth" "subjectAltName=DNS:$role" >"$authority/$role.ext"
    openssl x509 -req -in "$authority/$role.csr" -CA "$authority/ca.pem" -CAkey "$authority/ca.key" -CAcreateserial \
        -sha256 -days "$days" -extfile "$authority/$role.ext" -out "$authority/$role.pem" 2>>"$authority/log"
    openssl verify -CAfile "$authority/ca.pem" "$authority/$role.pem" >>"$authority/log" 2>&1
    mv -f "$authority/$role.key" "$authority/$role.pem" "$folder/"
done
mv -f "$authority/ca.pem" "$folder/ca.pem"
# Docker hands these files over as they are, and the containers' user must read them; the folder keeps others out
chmod 444 "$folder"/*.pem "$folder"/*.key
echo "$folder: certificates for scheduler, worker and client, valid for $days days"
