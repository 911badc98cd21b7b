#!/bin/sh
# Soaks a daemon: four clients that are killed and stopped at random, joints that change between springs and
# elements every second, requests of all kinds and hostile ones. Builds nothing: uses build/bin, build/tests.
# Usage: tests/soak.sh [--build DIR] [--seed N] MINUTES
set -eu
top=$(cd "$(dirname "$0")/.." && pwd)
build=$top/build
seed=
usage() {
  echo "usage: tests/soak.sh [--build DIR] [--seed N] MINUTES" >&2
  exit 2
}
while [ $# -gt 1 ]; do
  case $1 in
    --build) build=$2; shift 2 ;;
    --seed) seed=$2; shift 2 ;;
    *) usage ;;
  esac
done
[ $# -eq 1 ] || usage
seconds=$(awk -v m="$1" 'BEGIN { if (m + 0 <= 0) exit 1; print m * 60 }') || usage
for program in bin/plantbusd tests/soak_plants tests/soak_client tests/soak_driver; do
  [ -x "$build/$program" ] || { echo "soak: $build/$program is not built" >&2; exit 1; }
done

work=$(mktemp -d "${TMPDIR:-/tmp}/plantbus-soak-XXXXXX")
driver=
# The driver ends what it started; should it be killed, its children go with it.
finish() {
  code=$?
  [ -z "$driver" ] || { kill "$driver" 2>/dev/null && wait "$driver" || :; }
  rm -rf "$work"
  exit $code
}
trap finish EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

# A sanitizer keeps what was freed, to find later uses of it: little, so that growth is seen.
export ASAN_OPTIONS="${ASAN_OPTIONS:+$ASAN_OPTIONS:}quarantine_size_mb=8"
"$build/tests/soak_plants" "$top/config/plants/nano-hexapod.json" "$work"
"$build/tests/soak_driver" --bin "$build/bin" --client "$build/tests/soak_client" --directory "$work" \
  --seconds "$seconds" ${seed:+--seed "$seed"} --must-configure &
driver=$!
code=0
wait "$driver" || code=$?
driver=
sed 's/^/soak: /' "$work/clients.out" | grep 'client: ' || :
if grep -E 'Sanitizer|runtime error:' "$work/daemon.err" "$work/clients.out"; then
  echo "soak: A SANITIZER REPORTED"
  code=1
fi
if [ "$code" -ne 0 ]; then
  echo "soak: failed; the end of what the daemon and the clients said:"
  tail -n 20 "$work/daemon.out" "$work/daemon.err" "$work/clients.out"
else
  echo "soak: passed"
fi
exit "$code"
