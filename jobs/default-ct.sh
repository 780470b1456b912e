#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Unpacks the default CT, a patient's skull, from Debian's package invesalius-examples into a MetaImage.
#
# The InVesalius project is a gzip tar: main.plist names the voxel file (int16 HU, shape z y x) and the spacing (x y z,
# mm), but no orientation. The rows of this CT run from posterior to anterior and its slices from feet to head, so the
# second axis runs against LPS: direction diag(1, -1, 1). Left and right are not recorded in the project and may be
# mirrored. The volume is centred on the origin.
set -euo pipefail

usage() {
  cat <<'TEXT'
Usage: jobs/default-ct.sh OUTPUT.mhd [PROJECT.inv3]

Writes OUTPUT.mhd and, beside it, OUTPUT.raw from an InVesalius project; without PROJECT.inv3 the skull CT of the Debian
package invesalius-examples.
TEXT
}

# plist_values KEY: the numbers of the <array> (or the text of the scalar) that follows <key>KEY</key>.
plist_values() {
  awk -v key="$1" '
    index($0, "<key>" key "</key>") { wanted = 1; next }
    wanted {
      line = $0
      gsub(/<[^>]*>|[ \t\r]/, "", line)
      if (line != "") printf "%s ", line
      if ($0 !~ /<array>|<integer>|<real>/ || $0 ~ /<string>/) exit
    }' "$plist"
}

if [[ "${1:-}" == --help || "${1:-}" == -h ]]; then
  usage
  exit 0
fi
if (($# < 1 || $# > 2)) || [[ "$1" != *.mhd ]]; then
  usage >&2
  exit 2
fi
output=$1
project=${2:-/usr/share/doc/invesalius-examples/examples/Cranium.inv3}
if [[ ! -f "$project" ]]; then
  echo "default-ct.sh: $project is missing; jobs/install-packages.sh installs it (package invesalius-examples)" >&2
  exit 4
fi

mkdir -p "$(dirname "$output")"
work=$(mktemp -d "$output.XXXXXX.partial")
trap 'rm -rf "$work"' EXIT
if ! tar --extract --gzip --file "$project" --directory "$work" --strip-components 1 --wildcards '*/main.plist' '*/matrix.dat'; then
  echo "default-ct.sh: $project is not an InVesalius project (gzip tar with main.plist and matrix.dat)" >&2
  exit 4
fi
plist="$work/main.plist"
read -r slices rows columns <<<"$(plist_values shape)"
read -r spacing_x spacing_y spacing_z <<<"$(plist_values spacing)"
expected_bytes=$((slices * rows * columns * 2))
found_bytes=$(stat --format %s "$work/matrix.dat")
if ((expected_bytes == 0 || expected_bytes != found_bytes)); then
  echo "default-ct.sh: $project: matrix.dat: expected $expected_bytes bytes for ${columns}x${rows}x${slices} int16, found $found_bytes" >&2
  exit 4
fi

awk -v nx="$columns" -v ny="$rows" -v nz="$slices" -v sx="$spacing_x" -v sy="$spacing_y" -v sz="$spacing_z" \
  -v data="$(basename "${output%.mhd}.raw")" 'BEGIN {
    print "ObjectType = Image"
    print "NDims = 3"
    print "BinaryData = True"
    print "BinaryDataByteOrderMSB = False"
    print "CompressedData = False"
    print "TransformMatrix = 1 0 0 0 -1 0 0 0 1"
    printf "Offset = %.10g %.10g %.10g\n", -(nx - 1) * sx / 2, (ny - 1) * sy / 2, -(nz - 1) * sz / 2
    print "CenterOfRotation = 0 0 0"
    printf "ElementSpacing = %.10g %.10g %.10g\n", sx, sy, sz
    printf "DimSize = %d %d %d\n", nx, ny, nz
    print "ElementType = MET_SHORT"
    print "ElementDataFile = " data
  }' >"$work/header.mhd"
chmod 0644 "$work/matrix.dat" # the archive stores it writable for everyone
mv "$work/matrix.dat" "${output%.mhd}.raw"
mv "$work/header.mhd" "$output"
echo "$output: ${columns} x ${rows} x ${slices} voxels of $spacing_x x $spacing_y x $spacing_z mm"
