#!/bin/sh
# Installs what is missing, builds, serves the APA300ML bench (2-DoF actuator, 5 kg) on the bus of this
# host, identifies it, damps it by integral force feedback, and leaves plots and data in out/.
# Usage: ./demo.sh [--plant FILE]
set -eu
cd "$(dirname "$0")"

plant=config/plants/apa300ml-bench.json
while [ $# -gt 0 ]; do
  case "$1" in
  --plant)
    [ $# -ge 2 ] || { echo "demo.sh: --plant needs a file" >&2; exit 2; }
    plant=$2
    shift 2
    ;;
  *)
    echo "usage: ./demo.sh [--plant FILE]" >&2
    exit 2
    ;;
  esac
done
[ -r "$plant" ] || { echo "demo.sh: cannot read $plant" >&2; exit 1; }

scripts/install.sh
[ -f build/build.ninja ] || cmake --preset release >/dev/null
cmake --build --preset release

# Lockstep is a ping-pong: on one processor neither side waits for another one to wake up, which on an idle
# virtual machine takes longer than the step.
cpu=$(taskset -cp $$ | sed 's/.*: *\([0-9]*\).*/\1/')
on_one() { taskset -c "$cpu" "$@"; }

# A domain of its own, so that another plant on this host is not in the way.
domain=$((100 + $$ % 100))
mkdir -p out
daemon=""
stop() {
  [ -z "$daemon" ] || kill "$daemon" 2>/dev/null || true
  [ -z "$daemon" ] || wait "$daemon" 2>/dev/null || true
  daemon=""
}
trap stop EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
trap 'exit 129' HUP
trap 'exit 141' PIPE

echo
taskset -c "$cpu" build/bin/plantbusd --plant "$plant" --domain $domain >out/plantbusd.log &
daemon=$!
until grep -qs ready out/plantbusd.log; do
  kill -0 "$daemon" 2>/dev/null || { daemon=""; echo "demo.sh: the daemon did not start" >&2; exit 1; }
  sleep 0.1
done
cat out/plantbusd.log
echo
echo "== identification: band-limited noise over the bus, repeated so that nothing leaks"
input=$(build/bin/plantbus-model info --json "$plant" | sed -n 's/.*"inputs": *\["\([^"]*\)".*/\1/p')
on_one build/bin/plantbus-identify --domain $domain --excitation periodic-noise --band 1,500 \
  --resolution 0.25 --input "$input" --plot -o out
echo
echo "== integral force feedback, at the gain with the most damping"
on_one build/bin/plantbus-iff --domain $domain --gain auto --plot -o out
echo
stop
echo "plots and data are in out/:"
ls out
