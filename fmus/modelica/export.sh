#!/bin/sh
# OpenModelica: export TunableRoom.fmu (FMI 2.0, Model Exchange) and the tool's own simulation of the check.
#
#     sh export.sh [FOLDER]       # default: build, beside this script
#
# Model Exchange leaves the solver to the importer: our farm and fmpy both use CVODE.
set -eu
here=$(cd "$(dirname "$0")" && pwd)
build=${1:-"$here/build"}

fail() {
    echo "FAILED: $1" >&2
    exit 1
}

command -v omc >/dev/null 2>&1 || fail "no omc on the PATH; install OpenModelica 1.26 or use the Dockerfile beside this script"
omc --version
mkdir -p "$build"
cd "$build"
rm -f TunableRoom.fmu Verification_res.csv export.log
echo "packageFile := \"$here/ZeroshotRoom/package.mo\";" >settings.mos
status=0
omc "$here/export.mos" >export.log 2>&1 || status=$?
cat export.log
[ "$status" -eq 0 ] || fail "omc ended with code $status; the message stands above and in $build/export.log"
# an interpreter that meets a slip in the script says so and goes on
if grep -q "FAILED" export.log; then fail "see $build/export.log"; fi
[ -s TunableRoom.fmu ] || fail "omc wrote no TunableRoom.fmu; see $build/export.log"
[ -s Verification_res.csv ] || fail "omc wrote no Verification_res.csv; see $build/export.log"
grep -q "^exported" export.log || fail "the script did not reach its end; see $build/export.log"
echo "$build/TunableRoom.fmu"
echo "next: python fmus/modelica/verify.py $build/TunableRoom.fmu --tool $build/Verification_res.csv --write $build/system.toml"
