#!/bin/sh
# The library knows nothing of DDS, threads, signals or terminals, and never ends the process.
# Usage: test_purity.sh SOURCE_DIRECTORY
cd "$1/src" || exit 1
[ -f base/status.c ] || { echo "no library in $1/src"; exit 1; }
found=$(grep -rnE --include='*.c' --include='*.h' \
  '#include *[<"](dds/|ddsc/|pthread\.h|threads\.h|signal\.h)|(^|[^a-z_])(printf|fprintf|vprintf|vfprintf|puts|fputs|putchar|perror|exit|_exit|abort|getenv|signal|sigaction)\(' \
  . | grep -vE ':[0-9]+: *(//|\*|/\*)')
if [ -n "$found" ]; then
  echo "the library must not use these:"
  echo "$found"
  exit 1
fi

# CHOLMOD's supernodal module is GPL: src/part is for plantbus-part, its tests and its measurement only.
cd "$1" || exit 1
found=$(grep -rlE --include='CMakeLists.txt' --include='*.cmake' --include='*.c' --include='*.h' \
  'plantbus_part|[Cc][Hh][Oo][Ll][Mm][Oo][Dd]' src server idl clients tests bench |
  grep -vE '^(src|clients|tests)/part/|^bench/(reduction|bench_reduction)')
if [ -n "$found" ]; then
  echo "only plantbus-part may link CHOLMOD (GPL):"
  echo "$found"
  exit 1
fi
