#!/bin/sh
# Measures everything in bench/ and writes docs/performance.md, with the machine named. The machine
# should have nothing else to do.
# Usage: ./bench.sh [--quick]     quick: short measurements, written to build/bench/quick/
# Exit codes: 0 every goal on a ratio is met, 1 one is missed or a measurement failed, 2 usage.
set -eu
cd "$(dirname "$0")"

quick=""
case "${1:-}" in
"") ;;
--quick) quick=--quick ;;
*)
  echo "usage: ./bench.sh [--quick]" >&2
  exit 2
  ;;
esac

scripts/install.sh
cmake --preset release >/dev/null
cmake --build --preset release --target bench

results=build/bench/results
document=docs/performance.md
plots=docs/images
if [ -n "$quick" ]; then
  results=build/bench/quick
  document=$results/performance.md
  plots=$results/images
fi
mkdir -p "$results" "$plots"
rm -f "$results"/*.json

failed=0
for name in step bus realtime compile frf reduction identify; do
  program=build/bench/bench_$name
  [ -x "$program" ] || continue
  echo
  "$program" $quick --plots "$plots" -o "$results/$name.json" || failed=1
done
set --
for name in step bus realtime compile frf reduction identify; do
  [ ! -f "$results/$name.json" ] || set -- "$@" "$results/$name.json"
done
[ $# -gt 0 ] || { echo "bench.sh: nothing was measured" >&2; exit 1; }
build/bench/bench_document bench/notes.md "$document" "$@"
echo
echo "written: $document"
exit $failed
