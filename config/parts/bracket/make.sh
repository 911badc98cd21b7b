#!/bin/sh
# From a drawing to an element by gmsh and CalculiX: bracket.geo → mesh → K and M → bracket.mat.
# Usage: config/parts/bracket/make.sh DIRECTORY     (plantbus-part on the PATH or in $PLANTBUS_BIN)
set -eu
here=$(cd "$(dirname "$0")" && pwd)
part=${PLANTBUS_BIN:+$PLANTBUS_BIN/}plantbus-part
[ $# -eq 1 ] || { echo "usage: make.sh DIRECTORY" >&2; exit 2; }
mkdir -p "$1"
cd "$1"

gmsh -3 -format inp -o mesh.inp "$here/bracket.geo" >gmsh.log

# gmsh also writes the triangles of the named surfaces; CalculiX is to see the solid only. Their nodes stay
# behind as node sets, which the frames take.
awk '/^\*/ { keep = !/CPS6/ } keep' mesh.inp >solid.inp
cp "$here/bracket.inp" .
ccx bracket >ccx.log

"$part" reduce bracket.sti bracket.mas --nodes solid.inp --units mm-N-t --sets solid.inp \
  --frame 'floor={"origin": [28, 10, 3], "set": "floor"}' \
  --frame 'wall={"origin": [3, 10, 30], "set": "wall"}' \
  --modes 12 -o bracket.mat
