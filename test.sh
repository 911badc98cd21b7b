#!/bin/sh
# Installs what is missing, builds, and runs every test, then the library's and the daemon's tests again
# under AddressSanitizer and UndefinedBehaviorSanitizer.
# Usage: ./test.sh [--release-only]
set -eu
cd "$(dirname "$0")"

scripts/install.sh
cmake --preset release >/dev/null
cmake --build --preset release
ctest --preset release -j2

[ "${1:-}" = --release-only ] && exit 0
cmake --preset sanitize >/dev/null
cmake --build --preset sanitize
ctest --preset sanitize -j2
