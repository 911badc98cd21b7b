#!/bin/sh
# Installs what plantbus needs from Debian's packages, and only what is missing.
# Usage: scripts/install.sh        (as root, or with sudo at hand)
set -eu

packages="build-essential cmake ninja-build pkg-config
  cyclonedds-dev cyclonedds-tools libcjson-dev libmatio-dev libopenblas-dev liblapack-dev
  libsuitesparse-dev liblz4-dev libzstd-dev libssl-dev libsystemd-dev libcmocka-dev gnuplot-nox fonts-dejavu-core
  iproute2 valgrind libfaketime"

missing=""
for package in $packages; do
  status=$(dpkg-query -W -f '${db:Status-Abbrev}' "$package" 2>/dev/null || true)
  case "$status" in ii*) ;; *) missing="$missing $package" ;; esac
done
[ -n "$missing" ] || exit 0

as_root=""
if [ "$(id -u)" -ne 0 ]; then
  as_root=sudo
  command -v sudo >/dev/null || {
    echo "install.sh: these packages are missing and only root can install them:$missing" >&2
    exit 1
  }
fi
echo "installing:$missing"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
# An old list of packages may name versions that are gone: try again with a fresh one.
install() {
  DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y --no-install-recommends $missing
}
if ! { $as_root apt-get update && install; } >"$log" 2>&1; then
  cat "$log" >&2
  echo "install.sh: the packages could not be installed:$missing" >&2
  exit 1
fi
