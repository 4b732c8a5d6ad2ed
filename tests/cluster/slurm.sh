#!/bin/sh
# A real Slurm of one node on this machine, for tests: munged, slurmctld and slurmd on localhost.
#
#     tests/cluster/slurm.sh start [FOLDER]      as root; installs Debian's slurm-wlm and munge if they are missing
#     tests/cluster/slurm.sh stop [FOLDER]
#
# Then, with SLURM_CONF as it prints: pytest tests/cluster
set -eu
folder="${2:-/tmp/zeroshot-slurm-node}"
conf="$folder/slurm.conf"

stop() {
    for name in slurmd slurmctld munged; do
        if [ -f "$folder/$name.pid" ]; then
            kill "$(cat "$folder/$name.pid")" 2>/dev/null || true
        fi
    done
}

case "${1:-}" in
stop)
    stop
    exit 0
    ;;
start) ;;
*)
    sed -n '2,8p' "$0"
    exit 2
    ;;
esac

[ "$(id -u)" = 0 ] || { echo "slurm.sh: must be root, to start munged and slurmd" >&2; exit 1; }
if ! command -v slurmctld >/dev/null || ! command -v munged >/dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends slurm-wlm munge
fi

mkdir -p "$folder/spool" "$folder/state"
chmod 755 "$folder"
host=$(hostname -s)
cores=$(nproc)
memory=$(awk '/MemTotal/ {print int($2 / 1024 * 0.9)}' /proc/meminfo)
cat > "$conf" <<CONF
ClusterName=zeroshot
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CredType=cred/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
SlurmdSpoolDir=$folder/spool
StateSaveLocation=$folder/state
SlurmctldLogFile=$folder/slurmctld.log
SlurmdLogFile=$folder/slurmd.log
SlurmctldPort=17817
SlurmdPort=17818
ReturnToService=2
MailProg=/bin/true
NodeName=$host NodeAddr=127.0.0.1 CPUs=$cores RealMemory=$memory State=UNKNOWN
PartitionName=local Nodes=$host Default=YES MaxTime=INFINITE State=UP
CONF

if [ ! -s /etc/munge/munge.key ]; then
    mkdir -p /etc/munge
    dd if=/dev/urandom of=/etc/munge/munge.key bs=1 count=1024 2>/dev/null
fi
chown -R munge:munge /etc/munge
chmod 700 /etc/munge
chmod 400 /etc/munge/munge.key
mkdir -p "$folder/munge"
chown munge:munge "$folder/munge"
chmod 755 "$folder/munge"
runuser -u munge -- munged --force --socket="$folder/munge/socket" --pid-file="$folder/munge/munged.pid" \
    --log-file="$folder/munge/munged.log" --seed-file="$folder/munge/munged.seed"
ln -sf "$folder/munge/munged.pid" "$folder/munged.pid"

SLURM_CONF="$conf"
export SLURM_CONF
slurmctld -f "$conf"
slurmd -f "$conf" -N "$host"
waited=0
until sinfo -h -o %T 2>/dev/null | grep -q idle; do
    waited=$((waited + 1))
    if [ "$waited" -gt 30 ]; then
        echo "slurm.sh: the node did not become idle; see $folder/*.log" >&2
        exit 1
    fi
    sleep 1
done
sinfo >&2
echo "export SLURM_CONF=$conf"
