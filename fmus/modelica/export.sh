#!/bin/sh
# OpenModelica: export the three rooms (FMI 2.0, Model Exchange) and the tool's own simulation of the check.
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
made="TunableRoom.fmu Verification_res.csv TunableRoomWeatherFile.fmu OriginalExample.fmu"
rm -f $made export.log
echo "packageFile := \"$here/ZeroshotRoom/package.mo\";" >settings.mos
status=0
omc "$here/export.mos" >export.log 2>&1 || status=$?
cat export.log
[ "$status" -eq 0 ] || fail "omc ended with code $status; the message stands above and in $build/export.log"
# an interpreter that meets a slip in the script says so and goes on
if grep -q "FAILED" export.log; then fail "see $build/export.log"; fi
for file in $made; do [ -s "$file" ] || fail "omc wrote no $file; see $build/export.log"; done
grep -q "^exported" export.log || fail "the script did not reach its end; see $build/export.log"
for file in $made; do echo "$build/$file"; done
echo "next: python fmus/modelica/verify.py $build/TunableRoom.fmu --tool $build/Verification_res.csv --write $build/system.toml"
