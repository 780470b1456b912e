#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs the programs on bad input and prints a table: exit code, message, case. A row fails when the code is not the
# contract's, the message lacks what it must name, or anything is left in the output folder.
# Usage: bad_inputs.sh BIN-FOLDER MAKE-BAD-INPUTS
set -euo pipefail
bin=$1
make_inputs=$2
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_hwloc_base_binding_policy=none
"$make_inputs" "$work"
cd "$work"
mkdir out

rows=0 failures=0
# row CODE MESSAGE-PART CASE COMMAND...: outputs of the command must go below out/.
row() {
  local expected=$1 part=$2 name=$3 status=0 verdict="" message left
  shift 3
  "$@" >message.txt 2>&1 || status=$?
  ((status == expected)) || verdict=" <-- expected exit code $expected"
  grep -Fq -- "$part" message.txt || verdict="$verdict <-- message lacks '$part'"
  # Finished units may stay: other options can use them.
  left=$(find out -mindepth 1 -not -path '*.progress*')
  [[ -z "$left" ]] || verdict="$verdict <-- left behind: ${left//$'\n'/ }"
  message=$(grep -Fm 1 -- "$part" message.txt || head -n 1 message.txt)
  printf '%-4s %-44s %s%s\n' "$status" "$name" "$(cut -c 1-150 <<<"$message")" "$verdict"
  rows=$((rows + 1))
  if [[ -n "$verdict" ]]; then
    failures=$((failures + 1))
    sed 's/^/       | /' message.txt
  fi
  rm -rf out
  mkdir out
}

# edited FILE SED-SCRIPT: a copy of a valid/ file with one thing changed, beside it; prints its path.
edited() {
  local copy="valid/edited-$1"
  sed -E "$2" "valid/$1" >"$copy"
  if cmp -s "$copy" "valid/$1"; then
    echo "bad_inputs.sh: '$2' changes nothing in $1" >&2
    exit 1
  fi
  echo "$copy"
}

# small [OPTION VALUE]...: options of a small field; later values replace earlier ones.
small() {
  local -A options=([--max-rotation-deg]=5 [--max-translation-mm]=5 [--uv-nodes]=6 [--st-nodes]=24 [--codewords]=16)
  while (($# > 0)); do
    options[$1]=$2
    shift 2
  done
  local name
  for name in "${!options[@]}"; do
    printf '%s=%s\n' "$name" "${options[$name]}"
  done
}
mapfile -t small < <(small)
precompute=("$bin/af-precompute" "${small[@]}" -o out/f.af.h5)
of_ct() { row "$1" "$2" "$3" "${precompute[@]}" --ct "$4" --rig c-arm-12in --camera AP; }
of_study() { row "$1" "$2" "$3" "$bin/af-register" --study "$4" --renderer raycast -o out/result; }
of_rig() { row "$1" "$2" "$3" "${precompute[@]}" --ct valid/ct.nii.gz --rig "$4" --camera AP; }
of_option() {
  local code=$1 part=$2 name=$3 options
  shift 3
  mapfile -t options < <(small "$@")
  row "$code" "$part" "$name" "$bin/af-precompute" "${options[@]}" -o out/f.af.h5 --study valid/study.toml --camera AP
}

"$bin/af-precompute" "${small[@]}" --study valid/study.toml --camera AP -o AP.af.h5 >message.txt 2>&1
"$bin/af-precompute" "${small[@]}" --study valid/study.toml --camera LAT -o LAT.af.h5 >message.txt 2>&1
"$bin/af-precompute" "${small[@]}" --ct other.nii.gz --rig valid/rig.toml --camera AP -o other.af.h5 >message.txt 2>&1
"$bin/af-precompute" "${small[@]}" --ct other.nii.gz --rig valid/rig.toml --camera LAT -o other-LAT.af.h5 >message.txt 2>&1

printf '%-4s %-44s %s\n' code case message
printf -- '--- CT ---\n'
of_ct 3 '--series' 'several series in a folder' two-series
of_ct 3 "Modality = 'MR'" 'another modality' mr
of_ct 3 'GantryDetectorTilt = 12.5' 'gantry tilt' tilted
of_ct 3 'a slice is missing' 'missing slice' missing-slice
of_ct 3 'not evenly spaced' 'uneven slices' uneven
of_ct 3 'nan.mha' 'NaN voxel' nan.mha
of_ct 3 'all-air.mha' 'all air' all-air.mha
of_ct 3 'four-d.mha' '4-D' four-d.mha
echo 'this is no image' >text.nii.gz
of_ct 4 'text.nii.gz' 'no image' text.nii.gz
head -c $(($(stat --format %s valid/ct.nii.gz) * 9 / 10)) valid/ct.nii.gz >cut.nii.gz
of_ct 4 'cut.nii.gz' 'truncated' cut.nii.gz
of_ct 4 'nowhere.mha' 'missing file' nowhere.mha
mkdir empty
of_ct 4 'empty' 'folder without DICOM' empty
gzip --decompress --stdout valid/ct.nii.gz >metres.nii
printf '\001' | dd of=metres.nii bs=1 seek=123 conv=notrunc status=none
of_ct 3 'metres.nii' 'NIfTI in metres' metres.nii

printf -- '--- rig ---\n'
of_rig 3 'column_direction' 'axis not unit' "$(edited rig.toml '0,/^column_direction = .*/s//column_direction = [1.1, 0, 0]/')"
of_rig 3 'row_direction' 'axes not orthogonal' "$(edited rig.toml '0,/^row_direction = .*/s//row_direction = [0.6, 0, -0.8]/')"
of_rig 3 'AP' 'duplicate camera names' "$(edited rig.toml 's/"LAT"/"AP"/')"
of_rig 3 'source_point' 'source on the detector plane' "$(edited rig.toml '0,/^source_point = .*/s//source_point = [0, 350, 0]/')"
of_rig 3 'its detector misses the CT' 'detector beside the CT' "$(edited rig.toml '0,/^detector_origin_point = .*/s//detector_origin_point = [0, 350, 9000]/')"
of_rig 3 'pixel_spacing' 'unknown key (typo)' "$(edited rig.toml '0,/^pixel_spacing_mm/s//pixel_spacing/')"
of_rig 4 'c-arm-9in' 'unknown shipped rig' c-arm-9in
of_rig 4 'edited-rig.toml' 'not TOML' "$(edited rig.toml '1s/^.*$/= 3/')"
row 3 "XY" 'unknown camera' "${precompute[@]}" --study valid/study.toml --camera XY

printf -- '--- study ---\n'
of_study 3 'nominal_room_from_ct' 'pose not rigid' "$(edited study.toml 's/^nominal_room_from_ct = .*/nominal_room_from_ct = [[1,0,0,0],[0,2,0,0],[0,0,1,0],[0,0,0,1]]/')"
of_study 3 'roi_px' 'ROI off the detector' "$(edited study.toml '0,/^roi_px = .*/s//roi_px = [40, 40, 20, 20]/')"
of_study 3 'collinear' 'collinear fiducials' "$(edited study.toml 's/^name = .*/&\nfiducials_ct_mm = [[0,0,0],[1,1,1],[2,2,2],[3,3,3]]/; s/^roi_px = .*/&\nfiducials_px = [[10,10],[20,20],[30,30],[40,41]]/')"
of_study 4 'gone.mha' 'X-ray missing' "$(edited study.toml '0,/^xray = .*/s//xray = "gone.mha"/')"
of_study 4 'edited-study.toml' 'not TOML' "$(edited study.toml '1s/^.*$/rig = /')"
row 3 'nobody' 'unknown case' "$bin/af-register" --study valid/study.toml --case nobody --renderer raycast -o out/result

printf -- '--- options ---\n'
of_option 2 '--no-such-option' 'unknown option' --no-such-option 1
row 2 '--output' 'missing option' "$bin/af-register" --study valid/study.toml
of_option 3 'uv' 'nodes < 2' --uv-nodes 1
of_option 3 'codewords' 'codewords > 65536' --codewords 70000
of_option 3 'codewords' 'codewords > training tiles' --codewords 60000
of_option 3 'max_rotation_deg' 'rotation range too large' --max-rotation-deg 85
of_option 3 'max_translation_mm' 'source inside the CT within the range' --max-translation-mm 640
of_option 3 'memory' 'memory limit' --memory-limit 1kb

printf -- '--- field ---\n'
register=("$bin/af-register" --study valid/study.toml -o out/result)
row 4 'other.af.h5' 'field of another CT' "${register[@]}" --field AP=other.af.h5 --field LAT=other-LAT.af.h5
row 4 'LAT.af.h5' 'field of another camera' "${register[@]}" --field AP=LAT.af.h5 --field LAT=AP.af.h5
head -c 20000 AP.af.h5 >cut.af.h5
row 4 'cut.af.h5' 'truncated field' "$bin/af-drr" --field cut.af.h5 -o out/drr.mha
for percent in 20 30 40 60 80; do
  cp AP.af.h5 spoilt.af.h5
  printf 'spoilt spoilt spoilt' |
    dd of=spoilt.af.h5 bs=1 seek=$(($(stat --format %s AP.af.h5) * percent / 100)) conv=notrunc status=none
  row 4 'spoilt.af.h5' "20 bytes spoilt at $percent % of a field" "$bin/af-drr" --field spoilt.af.h5 -o out/drr.mha
done
: >empty.af.h5
row 4 'empty.af.h5' 'empty field' "$bin/af-drr" --field empty.af.h5 -o out/drr.mha
row 4 'valid/study.toml' 'a study given as a field' "$bin/af-drr" --field valid/study.toml -o out/drr.mha
row 3 'outside' 'DRR of a pose outside the field' "$bin/af-drr" --field AP.af.h5 --translation-mm 80,0,0 -o out/drr.mha

printf -- '--- output ---\n'
row 4 'out/no-folder' 'output folder that does not exist' "$bin/af-drr" --field AP.af.h5 -o out/no-folder/drr.mha
row 3 'drr.jpg' 'format that cannot hold a DRR' "$bin/af-drr" --field AP.af.h5 -o out/drr.jpg

echo "$rows cases, $failures failures"
((failures == 0))
