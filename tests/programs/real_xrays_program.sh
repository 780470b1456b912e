#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# jobs/real-xrays.sh as a person would use it with a scan of his own: a simulated one of few small views, from its images
# to the report; the same command again; a scan file whose lists changed; and what it refuses.
#
#   real_xrays_program.sh ROOT FOLDER_OF_PROGRAMS
set -euo pipefail
root=$1
programs=$2
# shellcheck source=installed_jobs.sh
source "$(dirname "${BASH_SOURCE[0]}")/installed_jobs.sh"
enter_installed "$root" "$programs"

cat >rig.toml <<'TOML'
isocenter_point = [0.0, 0.0, 0.0]
[[camera]]
name = "scanner"
source_point = [0.0, -500.0, 0.0]
detector_origin_point = [-190.0, 400.0, 158.0]
column_direction = [1.0, 0.0, 0.0]
row_direction = [0.0, 0.0, -1.0]
pixel_spacing_mm = [4.0, 4.0]
size_px = [96, 80]
TOML
prefix/bin/af-simulate --phantom head --rig rig.toml --cone-beam 72 --no-fiducials --bits 16 --open-beam-level 40000 -o scan \
  >out 2>err || fail "af-simulate: $(cat err)"

job() {
  prefix/libexec/attenuation-fields/jobs/real-xrays.sh "$@" --output study --pairs 1 --presets fast,paper --intervals 4 \
    --starts-per-interval 1 --raycast-starts 0 --ranks 2 --field '--slabs 1 --uv-nodes 12 --st-nodes 97 --codewords 512' \
    --calibration '--rounds 1 --search-px 48 --working-px 96 --tilt-deg 0' >out 2>err
}
job scan || fail "real-xrays.sh: $(cat out err)"
grep -q 'Geometry of the scan: .*scan/scan.toml' out || fail "it did not say which geometry it took: $(cat out)"
grep -q '^  source_to_detector_mm = 900' out || fail "a stated distance was not kept: $(cat out)"
# With two views of 4 mm pixels, every start up to 8 mm ends right.
grep -q '^| pair-01-fast | .* | 100 \[51, 100\] / - / - | 4 / 0 / 0 |' study/methods.md || fail "not all starts ended right: $(cat study/methods.md)"
[[ -s study/report.html ]] || fail "no report"
[[ $(grep -c '^field ' out) == 2 ]] || fail "two presets share the fields of two cameras: $(cat out)"

job scan || fail "the same command again: $(cat out err)"
! grep -q ' min \| s$' out || fail "a finished stage ran again: $(cat out)"

# Without --field, robust has its own fields, with (s,t) nodes at most half a voxel of this scan's CT apart. They take
# minutes, so here they are only planned.
rm prefix/bin
mkdir prefix/bin
ln -s "$programs"/af-* prefix/bin/
rm prefix/bin/af-precompute
cat >prefix/bin/af-precompute <<SH
#!/bin/sh
echo "\$*" >"$scratch/asked"
"$programs/af-precompute" "\$@" --dry-run >"$scratch/planned" 2>&1
exit 9
SH
chmod +x prefix/bin/af-precompute
! prefix/libexec/attenuation-fields/jobs/real-xrays.sh scan --output study --pairs 1 --presets robust --ranks 1 \
  --calibration '--rounds 1 --search-px 48 --working-px 96 --tilt-deg 0' >out 2>err || fail "a field was not missed"
ln -sf "$programs/af-precompute" prefix/bin/af-precompute
half=$(awk '/^ct_voxel_mm/ { printf "%.4f", $3 / 2 }' study/study/calibration.toml)
grep -q -- "--preset standard --codewords 65536 --st-spacing-mm $half .*-robust.af.h5" asked || fail "robust's fields: $(cat asked)"
grep -q '(s,t) nodes at most .* along each side' planned || fail "robust's fields cannot be planned: $(cat planned)"

# The same views, from lists beside a scan file elsewhere. A changed list is a changed scan.
mkdir lists
for view in {0..71}; do
  printf 'view-%04d.mha\n' "$view" >>lists/files.txt
  echo "$((5 * view))" >>lists/angles.txt
done
sed -e '/^view_count\|^first_angle_deg\|^step_deg/d' -e 's/^files = .*/files_file = "files.txt"/' scan/scan.toml >lists/scan.toml
echo 'angles_file = "angles.txt"' >>lists/scan.toml
job scan --scan lists/scan.toml || fail "lists of files and angles: $(cat out err)"
sed -i 's/^/  /' lists/angles.txt
job scan --scan lists/scan.toml || fail "a changed list of angles: $(cat out err)"
grep -q '^scan$' out || fail "the scan was not read again with other angles: $(cat out)"

mkdir empty
found=0
job empty || found=$?
[[ $found == 4 ]] || fail "a folder without scan.toml gave $found"
grep -q 'af-inspect --template scan' err || fail "it did not say how to write scan.toml: $(cat err)"
