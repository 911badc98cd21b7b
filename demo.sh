#!/bin/sh
# Installs what is missing, builds, and shows two acts on the bus of this host: the APA300ML bench (2-DoF
# actuator, 5 kg) identified and damped by integral force feedback, then a hexapod whose struts and joints
# are all finite elements, identified. Plots and data are left in out/.
# Usage: ./demo.sh [--plant FILE]     one act with this plant
#        ./demo.sh --parts            the three shipped parts built from nothing, beside their published values
set -eu
cd "$(dirname "$0")"

usage() {
  echo "usage: ./demo.sh [--plant FILE | --parts]" >&2
  exit 2
}

plant=""
parts=""
while [ $# -gt 0 ]; do
  case "$1" in
  --plant)
    [ $# -ge 2 ] || { echo "demo.sh: --plant needs a file" >&2; exit 2; }
    plant=$2
    shift 2
    ;;
  --parts)
    parts=yes
    shift
    ;;
  *) usage ;;
  esac
done
[ -z "$plant" ] || [ -z "$parts" ] || usage
[ -z "$plant" ] || [ -r "$plant" ] || { echo "demo.sh: cannot read $plant" >&2; exit 1; }

scripts/install.sh
[ -f build/build.ninja ] || cmake --preset release >/dev/null
# What is shown, and no tests.
tools="plantbusd plantbus-model plantbus-identify plantbus-iff"
[ -z "$parts" ] || tools=plantbus-part
# shellcheck disable=SC2086  # one argument for each tool
cmake --build --preset release --target $tools
mkdir -p out

if [ -n "$parts" ]; then
  for part in apa300ml apa95ml flexible-joint; do
    echo
    build/bin/plantbus-part build config/parts/$part.json -o out/$part.mat --picture out/$part.png
  done
  echo
  echo "== the neck of the flexible joint: axial against bending stiffness"
  build/bin/plantbus-part build config/parts/flexible-joint.json --mesh 0.75 \
    --sweep /dimensions/neck=0.15e-3,0.25e-3,0.35e-3,0.5e-3 --plot out/flexible-joint-neck.png
  echo
  echo "elements, pictures of the meshes and the plot of the sweep are in out/"
  exit 0
fi

# Lockstep is a ping-pong: on one processor neither side waits for another one to wake up, which on an idle
# virtual machine takes longer than the step.
cpu=$(taskset -cp $$ | sed 's/.*: *\([0-9]*\).*/\1/')
on_one() { taskset -c "$cpu" "$@"; }

# A domain of its own, so that another plant on this host is not in the way.
domain=$((100 + $$ % 100))
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

serve() {
  echo
  taskset -c "$cpu" build/bin/plantbusd --plant "$1" --domain $domain >out/plantbusd.log &
  daemon=$!
  until grep -qs ready out/plantbusd.log; do
    kill -0 "$daemon" 2>/dev/null || { daemon=""; echo "demo.sh: the daemon did not start" >&2; exit 1; }
    sleep 0.1
  done
  cat out/plantbusd.log
  echo
}

# Identification and integral force feedback, step by step over the bus.
identify_and_damp() {
  serve "$1"
  echo "== identification: band-limited noise over the bus, repeated so that nothing leaks"
  input=$(build/bin/plantbus-model info --json "$1" | sed -n 's/.*"inputs": *\["\([^"]*\)".*/\1/p')
  on_one build/bin/plantbus-identify --domain $domain --excitation periodic-noise --band 1,500 \
    --resolution 0.25 --input "$input" --plot --output-dir out
  echo
  echo "== integral force feedback, at the gain with the most damping"
  on_one build/bin/plantbus-iff --domain $domain --gain auto --plot --output-dir out
  echo
  stop
}

identify_and_damp "${plant:-config/plants/apa300ml-bench.json}"

# A thousand states: blocks of steps, since nobody else takes part.
if [ -z "$plant" ]; then
  echo "== second act: a hexapod of six amplified actuators and twelve flexible joints, all finite elements"
  mkdir -p out/hexapod
  serve config/plants/nano-hexapod-elements.json
  on_one build/bin/plantbus-identify --domain $domain --blocks --excitation periodic-noise \
    --input Va1 --output Vs1,dL1 --band 10,500 --resolution 0.5 --plot --output-dir out/hexapod
  echo
  stop
fi
echo "plots and data are in out/:"
ls out
