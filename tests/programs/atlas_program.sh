#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes and uses atlases as a person would: exit codes, dry run, the same payload on 1 to 4 ranks and after kills, and what
# af-inspect and af-drr make of one.
#
#   atlas_program.sh FOLDER_OF_PROGRAMS MPIEXEC
set -euo pipefail
# shellcheck source=tests/programs/body_ct.sh
. "$(dirname "$0")/body_ct.sh"

programs=$1
mpiexec=$2
program=$programs/af-precompute
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"
make_ct >ct.mha

fail() {
  echo "FAILED: $*" >&2
  exit 1
}
hash_of() { sed -n 's/.*sha256 //p' "$1"; }

common=(--ct ct.mha --rig c-arm-12in --camera AP --max-rotation-deg 10 --max-translation-mm 10 --slabs 2 --uv-nodes 7)
common+=(--st-nodes 61 --codewords 200)
orbit=("${common[@]}" --orbit 'axis=z,from=-40,to=20')

# refuse CODE PATTERN OPTION...: with the common options.
refuse() {
  local code=$1 pattern=$2 found=0
  shift 2
  "$program" "${common[@]}" "$@" -o refused.h5 >out 2>err || found=$?
  [[ $found == "$code" ]] || fail "$* gave $found instead of $code: $(cat err)"
  grep -q -- "$pattern" err || fail "$* did not say '$pattern': $(cat err)"
  [[ -z $(find . -name 'refused.h5*') ]] || fail "$* left $(find . -name 'refused.h5*')"
}
refuse 2 'the axis is x, y or z' --orbit axis=q,from=0,to=10
refuse 2 "'to' is missing" --orbit axis=z,from=0
refuse 2 "'to' is below 'from'" --orbit axis=z,from=10,to=0
refuse 2 'excludes' --orbit axis=z,from=0,to=10 --orbit-cameras c-arm-12in
refuse 2 'members are by-source or by-pose' --orbit axis=z,from=0,to=10,members=10
refuse 3 'at most 64' --orbit axis=z,from=-90,to=90,step=1
refuse 4 'missing.toml' --orbit-cameras missing.toml

"$program" "${orbit[@]}" --dry-run >dry.txt
grep -q '4 fields: AP_z-40, AP_z-20, AP_z0, AP_z20; each' dry.txt || fail "the dry run does not name the fields: $(cat dry.txt)"
stored_rays() { sed -n 's/^ *rays *\([0-9.]*\) million stored.*/\1/p' "$1"; }
"$program" "${common[@]}" --orbit axis=z,from=-40,to=20,members=by-pose --dry-run >pose.txt
awk -v a="$(stored_rays dry.txt)" -v b="$(stored_rays pose.txt)" 'BEGIN { exit !(a > 0 && a < b) }' ||
  fail "members by source store no fewer rays: $(stored_rays dry.txt) and $(stored_rays pose.txt)"

# The same payload on any number of ranks, for either caster.
for caster in shear-warp trilinear; do
  "$program" "${orbit[@]}" --caster "$caster" -o one.h5 >one.txt 2>one.err || fail "one rank: $(cat one.err)"
  expected=$(hash_of one.txt)
  [[ ${#expected} == 64 ]] || fail "no payload hash: $(cat one.txt)"
  for ranks in 2 3 4; do
    "$mpiexec" -n "$ranks" "$program" "${orbit[@]}" --caster "$caster" -o ranks.h5 >ranks.txt 2>ranks.err ||
      fail "$ranks ranks: $(cat ranks.err)"
    [[ $(hash_of ranks.txt) == "$expected" ]] || fail "another payload on $ranks ranks with $caster"
  done
done

# A run is killed while it casts, and continued on another number of ranks. Another orbit in between is refused.
slow=("${orbit[@]}" --caster trilinear --step-mm 0.02)
"$mpiexec" -n 2 "$program" "${slow[@]}" -o slow.h5 >slow.txt 2>slow.err &
job=$!
for ((i = 0; i < 600; ++i)); do
  [[ -n $(find . -path './slow.h5.progress/*.records' -size +0) ]] && break
  sleep 0.05
done
kill -KILL "$job" 2>/dev/null || fail "it ended before it could be killed: $(cat slow.err)"
wait "$job" 2>/dev/null || true
[[ ! -e slow.h5 ]] || fail 'an unfinished atlas has its name'
for ((i = 0; i < 100; ++i)); do
  code=0
  "$program" "${common[@]}" --caster trilinear --step-mm 0.02 --orbit axis=z,from=-40,to=21 -o slow.h5 >out 2>err || code=$?
  # The ranks of a killed launcher hold the folder until they notice.
  [[ $code == 3 ]] && grep -q 'orbit = .*the unfinished work was begun with' err && break
  sleep 0.2
done
grep -q 'orbit = .*the unfinished work was begun with' err || fail "another orbit: $code $(cat err)"
"$program" "${slow[@]}" -o slow.h5 >slow.txt 2>slow.err || fail "resumed: $(cat slow.err)"
grep -q 'resumed' slow.err || fail "nothing was resumed: $(cat slow.err)"
"$program" "${slow[@]}" -o whole.h5 --no-checkpoint >whole.txt 2>/dev/null
[[ $(hash_of slow.txt) == "$(hash_of whole.txt)" ]] || fail 'the resumed atlas differs'

# af-inspect says what an atlas is and what it covers.
"$programs/af-inspect" one.h5 >inspect.txt || fail 'af-inspect refuses an atlas'
for word in 'one.h5: atlas' 'AP_z-40' "covers 100 % of camera AP's rays within 10"; do
  grep -q -- "$word" inspect.txt || fail "af-inspect says nothing of '$word': $(cat inspect.txt)"
done

# No single field of this range holds these poses. A camera at -40 degrees sees what a CT turned by 40 degrees shows.
drr=("$programs/af-drr" --field one.h5)
for angle in 40 12 0 -20; do
  "${drr[@]}" --rotation-deg "0,0,$angle" -o "at$angle.mha" >/dev/null || fail "af-drr at $angle degrees"
done
code=0
"${drr[@]}" --rotation-deg 0,0,65 -o outside.mha >out 2>err || code=$?
[[ $code == 3 ]] || fail "a pose beyond the orbit: $code $(cat err)"
grep -q 'outside the field' err || fail "a pose beyond the orbit: $(cat err)"

# An atlas of one camera is the field of that camera, and a list of cameras holds each.
"$program" "${common[@]}" -o field.h5 >field.txt 2>/dev/null
"$program" "${common[@]}" --orbit-cameras c-arm-12in -o both.h5 >both.txt 2>both.err || fail "a list: $(cat both.err)"
"$programs/af-drr" --field both.h5 --rig c-arm-12in --camera LAT -o lateral.mha >/dev/null || fail 'the second camera of a list'
"$programs/af-inspect" --template rig | sed '/^\[\[camera/,$ { /"LAT"/,$ d }' | sed '$ d' >one.toml
"$program" "${common[@]}" --orbit-cameras one.toml -o single.h5 >single.txt 2>single.err || fail "one camera: $(cat single.err)"
for file in field single; do
  "$programs/af-drr" --field "$file.h5" --rotation-deg 3,-4,5 --translation-mm 1,2,3 -o "$file.mha" >/dev/null
done
cmp field.mha single.mha || fail 'an atlas of one camera gives other DRRs than its field'

# Registers through an atlas of several slabs, with cameras that stand between its members. It must come as near to the true
# pose as through each camera's own field: a sixth of the 3-mm voxels.
turned_camera() {
  awk -v name="$1" -v degrees="$2" 'BEGIN {
    a = degrees * atan2(0, -1) / 180; c = cos(a); s = sin(a); x = -151.8046875; y = 370
    printf "[[camera]]\nname = \"%s\"\nsource_point = [%.17g, %.17g, 0.0]\n", name, 650 * s, -650 * c
    printf "detector_origin_point = [%.17g, %.17g, 151.8046875]\n", x * c - y * s, x * s + y * c
    printf "column_direction = [%.17g, %.17g, 0.0]\nrow_direction = [0.0, 0.0, -1.0]\n", c, s
    printf "pixel_spacing_mm = [1.190625, 1.190625]\nsize_px = [256, 256]\n" }'
}
{
  echo 'isocenter_point = [0.0, 0.0, 0.0]'
  turned_camera A -30
  turned_camera B 12
} >turned.toml
"$programs/af-simulate" --phantom head --phantom-voxel-mm 3 --rig turned.toml --case head --no-fiducials --seed 3 \
  --max-offset-rotation-deg 3 --max-offset-translation-mm 4 -o head >/dev/null 2>err || fail "a study: $(cat err)"
design=(--max-rotation-deg 10 --max-translation-mm 20 --slabs 2 --uv-nodes 12 --st-nodes 128 --codewords 2000 --look-up cubic)
"$program" --ct head/ct.nii.gz --center-ct-mm 0 -14 -14 --rig c-arm-12in --camera AP --orbit axis=z,from=-40,to=20 \
  "${design[@]}" -o head.h5 >/dev/null 2>err || fail "an atlas of the head: $(cat err)"
for camera in A B; do
  "$program" --study head/study.toml --case head --camera "$camera" "${design[@]}" -o "own-$camera.h5" >/dev/null 2>err ||
    fail "camera $camera's own field: $(cat err)"
done
# all_end_right NAME FIELD_OF_A FIELD_OF_B
all_end_right() {
  "$programs/af-evaluate" registration --study head/study.toml --gold study --field "A=$2" --field "B=$3" --intervals 5 \
    --starts-per-interval 2 --preset robust --success-tre-mm 0.5 --no-uncertainty -o "$1" >out 2>&1 || fail "$1: $(cat out)"
  grep -q '10 of 10 starts succeeded' out || fail "$1: $(cat out)"
}
all_end_right by-own-fields own-A.h5 own-B.h5
all_end_right by-atlas head.h5 head.h5
grep -q 'field A: atlas of 4 fields.*level 0 is looked up by cubic-sum' out || fail "not by the atlas's look-up: $(cat out)"
echo 'atlases: exit codes, dry run, resume, payload, coverage, DRRs and registrations are as promised'
