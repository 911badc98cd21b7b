#!/bin/sh
# Installs what is missing, builds, and runs every test, then all of them again under AddressSanitizer and
# UndefinedBehaviorSanitizer, and the step thread under ThreadSanitizer.
# Usage: ./test.sh [--release-only]
set -eu
cd "$(dirname "$0")"

scripts/install.sh
# Three at a time on two processors: many wait for an outage, a guard or a deadline.
cmake --preset release >/dev/null
cmake --build --preset release
ctest --preset release -j3

[ "${1:-}" = --release-only ] && exit 0
cmake --preset sanitize >/dev/null
cmake --build --preset sanitize
ctest --preset sanitize -j3

# The middleware cannot be watched so; the rings and the step thread need none of it.
cmake --preset threads >/dev/null
cmake --build --preset threads
ctest --preset threads
