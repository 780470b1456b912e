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
of_ct 3 '--resample' 'missing slice, advice' missing-slice
row 3 'raw_slope_per_mm' 'raw values without a slope' "${precompute[@]}" --ct valid/ct.nii.gz --rig valid/rig.toml --camera AP --values raw
row 3 'label_hu = 3' 'label without HU' "${precompute[@]}" --ct valid/ct.nii.gz --rig valid/rig.toml --camera AP \
  --values labels --label-hu 3
row 3 'HU must be within 1e6' 'HU taken for attenuation' "${precompute[@]}" --ct valid/ct.nii.gz --rig valid/rig.toml --camera AP --values mu
of_study 3 'ct_values' 'CT of unknown values' "$(edited study.toml 's/^ct = .*/&\nct_values = "grey"/')"
of_study 3 'must be true or false' 'switch that is a text' "$(edited study.toml 's/^ct = .*/&\nct_resample = "yes"/')"
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
of_ct 4 'CompressedDataSize' 'compressed without its length' no-compressed-size.mha
of_ct 4 'CompressedDataSize' 'compressed, wrong length' wrong-compressed-size.mha
of_ct 3 'spacing = (1, 1e+300, 1) mm: must be 0.01 to 100 mm' 'spacing of 1e300 mm' huge-spacing.mha
of_ct 3 'origin = (0, 1e+300, 0) mm' 'origin at 1e300 mm' huge-offset.mha
of_ct 3 'HU must be within 1e6' 'HU of 1e30' huge-hu.mha

printf -- '--- no file ---\n'
# These would be waited for, or never end. Each command must end by itself long before the limit.
mkfifo pipe
ln -s loop loop
long_name=$(printf 'x%.0s' {1..303})
in_time() { timeout 60 "$@"; }
drr=(in_time "$bin/af-drr" -o out/drr.mha)
drr_of_ct=("${drr[@]}" --ct valid/ct.nii.gz --rig valid/rig.toml --camera AP)
register_one=(in_time "$bin/af-register" --study valid/study.toml --renderer raycast -o out/result)
# not_a_file PART PATH: PATH as each kind of input; every message says PART.
not_a_file() {
  local part=$1 path=$2
  row 4 "$part" "$path as ct" "${drr[@]}" --ct "$path" --rig valid/rig.toml --camera AP
  row 4 "$part" "$path as rig" "${drr[@]}" --ct valid/ct.nii.gz --rig "$path" --camera AP
  row 4 "$part" "$path as field" "${drr[@]}" --field "$path"
  row 4 "$part" "$path as pose" "${drr_of_ct[@]}" --pose "$path"
  row 4 "$part" "$path as poses" "${drr_of_ct[@]}" --poses "$path"
  row 4 "$part" "$path as nominal pose" in_time "${precompute[@]}" --ct valid/ct.nii.gz --rig valid/rig.toml \
    --camera AP --nominal-pose "$path"
  row 4 "$part" "$path as study" in_time "$bin/af-register" --study "$path" --renderer raycast -o out/result
  row 4 "$part" "$path as study of poses" in_time "${precompute[@]}" --study "$path" --camera AP
  row 4 "$part" "$path as start pose" "${register_one[@]}" --start-pose "$path"
  row 4 "$part" "$path as starts" "${register_one[@]}" --starts "$path"
  row 4 "$part" "$path as X-ray" in_time "$bin/af-register" --renderer raycast -o out/result \
    --study "$(edited study.toml "0,/^xray = .*/s//xray = \"..\\/$path\"/")"
}
not_a_file 'is a pipe' pipe
not_a_file 'Too many levels of symbolic links' loop
not_a_file 'File name too long' "$long_name"
row 4 'is a device' 'endless device as rig' "${drr[@]}" --ct valid/ct.nii.gz --rig /dev/zero --camera AP
row 4 'is a folder' 'folder as rig' "${drr[@]}" --ct valid/ct.nii.gz --rig empty --camera AP
row 4 'is a folder' 'folder as poses' "${drr_of_ct[@]}" --poses empty
row 4 'is no regular file' 'pipe to inspect' in_time "$bin/af-inspect" pipe

printf -- '--- rig ---\n'
of_rig 3 'column_direction' 'axis not unit' "$(edited rig.toml '0,/^column_direction = .*/s//column_direction = [1.1, 0, 0]/')"
of_rig 3 'row_direction' 'axes not orthogonal' "$(edited rig.toml '0,/^row_direction = .*/s//row_direction = [0.6, 0, -0.8]/')"
of_rig 3 'AP' 'duplicate camera names' "$(edited rig.toml 's/"LAT"/"AP"/')"
of_rig 3 'source_point' 'source on the detector plane' "$(edited rig.toml '0,/^source_point = .*/s//source_point = [0, 350, 0]/')"
of_rig 3 'its detector misses the CT' 'detector beside the CT' "$(edited rig.toml '0,/^detector_origin_point = .*/s//detector_origin_point = [0, 350, 1500]/')"
of_rig 3 'pixel_spacing' 'unknown key (typo)' "$(edited rig.toml '0,/^pixel_spacing_mm/s//pixel_spacing/')"
of_rig 3 'source_point' 'source at 1e300 mm' "$(edited rig.toml '0,/^source_point = .*/s//source_point = [0, 1e300, 0]/')"
of_rig 3 'pixel_spacing_mm' 'pixels of 1e300 mm' "$(edited rig.toml '0,/^pixel_spacing_mm = .*/s//pixel_spacing_mm = [1e300, 3]/')"
of_rig 4 'c-arm-9in' 'unknown shipped rig' c-arm-9in
# For cameras of other programs the message names af-convert and the command.
printf 'image size\n64,48\n' >'cam 1.txt'
of_rig 3 "af-convert 'cam 1.txt' -o rig.toml" 'MayaCam' 'cam 1.txt'
of_rig 3 "af-convert 'cam 1.txt' valid/rig.toml -o rig.toml" 'several files' 'cam 1.txt,valid/rig.toml'
printf '<RTKThreeDCircularGeometry><Projection>' >cut.xml
of_rig 3 'af-convert cut.xml -o rig.toml' 'RTK geometry' cut.xml
of_rig 3 'af-convert AP.af.h5 -o rig.toml' 'a field as a rig' AP.af.h5
printf '1 0 0 5\n0 1 0 6\n0 0 1 7\n' >bare-matrix.txt
of_rig 3 "'# isocenter_point X Y Z'" 'a matrix that states nothing else' bare-matrix.txt
matrix=$'# isocenter_point 0 0 0\n# camera AP\n# size_px 64 48\n# pixel_spacing_mm 3 3\n'
printf '%sinf 0 0 5\n0 1 0 6\n0 0 1 7\n' "$matrix" >inf-matrix.txt
of_rig 3 'projection_matrix' 'matrix with inf' inf-matrix.txt
for numbers in '1, 2, 3' '[0.1]' '-500, 0, 0, 0' 'nan, 0, 0, 0' '0, 0, 0, 0, 0, -500, 0, 0' '1e300, 0, 0, 0'; do
  of_rig 3 'distortion' "distortion $numbers" "$(edited rig.toml "0,/^size_px = .*/s//&\ndistortion = [$numbers]/")"
done
of_rig 4 'edited-rig.toml' 'not TOML' "$(edited rig.toml '1s/^.*$/= 3/')"
row 3 "valid/study.toml: --camera = OB: must be one that case 'ellipsoids' has: AP, LAT" 'camera that the case does not have' \
  "${precompute[@]}" --study valid/study.toml --camera OB
of_design() { row "$1" "$2" "$3" "${precompute[@]}" --study valid/study.toml --camera AP "${@:4}"; }
of_design 3 'max_field_bytes = 0: must be at least 1' 'no size' --max-field-size 0
of_design 2 '--max-field-size' 'size below nothing' --max-field-size=-5MB
of_design 2 '--max-field-size' 'size that is no number' --max-field-size much
of_design 2 '--max-field-size' 'size of an unknown unit' --max-field-size 8XB
of_design 2 '--max-field-size' 'size beyond all numbers' --max-field-size 99999999999GB
of_design 2 '--max-field-size' 'empty size' --max-field-size ''
of_design 3 'target_psnr_db = 1000: must be between 10 and 90' 'PSNR beyond 16 bits' --target-psnr-db 1000
of_design 2 'must be a finite number' 'PSNR that is no number' --target-psnr-db nan
of_design 3 'max_drr_ms = -1: must be above 0' 'DRR in less than no time' --max-drr-ms -1
of_design 3 'no field meets the limits: at least 89 dB' 'PSNR that no design gives' --target-psnr-db 89
of_design 3 'no field meets the limits: at most 0.001 MB; the smallest file' 'size that no field has' --max-field-size 1kB
of_design 3 '; the fastest DRR: ' 'time that no DRR keeps' --max-drr-ms 0.000001
of_design 3 "preset = 'nonsense': must be one of paper" 'unknown preset' --preset nonsense
of_design 2 '--preset excludes' 'preset and budget' --preset paper --max-field-size 8MB
of_design 3 'look_up = nearest: must be linear or cubic' 'look-up that no field is for' --look-up nearest
of_design 3 'tile_filter = neighbors: must be none or neighbours' 'tile filter of another spelling' --tile-filter neighbors
of_design 3 'uv_samples = pont: must be point or least-squares' 'samples that no caster makes' --uv-samples pont
of_design 3 'tile_coding = mean: must be plain or mean-removed' 'tile coding that there is not' --tile-coding mean
of_projections() { row "$1" "$2" "$3" "${precompute[@]}" --study valid/study.toml --camera AP --projections "${@:4}"; }
of_projections 4 'nowhere.toml' 'projections that are not there' nowhere.toml
of_projections 3 'must be at least 3' 'projections of two views' valid/study.toml
of_projections 3 'projections: must not be given with material' 'projections for a field of bone' valid/study.toml --material bone
row 2 '--projections' 'case of no projections' "${precompute[@]}" --study valid/study.toml --camera AP --projections-case x
row 3 "XY" 'unknown camera' "${precompute[@]}" --study valid/study.toml --camera XY

printf -- '--- study ---\n'
of_study 3 'nominal_room_from_ct' 'pose not rigid' "$(edited study.toml 's/^nominal_room_from_ct = .*/nominal_room_from_ct = [[1,0,0,0],[0,2,0,0],[0,0,1,0],[0,0,0,1]]/')"
of_study 3 'roi_px' 'ROI off the detector' "$(edited study.toml '0,/^roi_px = .*/s//roi_px = [40, 40, 20, 20]/')"
of_study 3 'target_box_ct_mm' 'target box to 1e308' "$(edited study.toml 's/^target_box_ct_mm = .*/target_box_ct_mm = [[-1e308,0,0],[1,1,1]]/')"
of_study 3 'each within +-1e+06' 'pose 1e300 mm away' "$(edited study.toml 's/^nominal_room_from_ct = .*/nominal_room_from_ct = [[1,0,0,1e300],[0,1,0,0],[0,0,1,0],[0,0,0,1]]/')"
row 3 'must vary' 'ROI of one pixel at the corner, kept' "$bin/af-register" --renderer raycast --region study -o out/result \
  --study "$(edited study.toml 's/^roi_px = .*/roi_px = [47, 47, 1, 1]/')"
of_study 3 'roi_px' 'ROI of huge numbers' "$(edited study.toml '0,/^roi_px = .*/s//roi_px = [2147483647, 0, 2147483647, 1]/')"
of_study 3 'collinear' 'collinear fiducials' "$(edited study.toml 's/^name = .*/&\nfiducials_ct_mm = [[0,0,0],[1,1,1],[2,2,2],[3,3,3]]/; s/^roi_px = .*/&\nfiducials_px = [[10,10],[20,20],[30,30],[40,41]]/')"
# marked KEY-OF-THE-CASE KEYS-OF-ITS-VIEWS: the valid study with points that somebody marked.
marked() { edited study.toml "s/^name = .*/&\n$1/; s/^roi_px = .*/&\n$2/"; }
of_study 3 'fiducials_px' 'fiducial of three numbers' "$(marked 'fiducials_ct_mm = [[0,0,0],[9,1,1],[2,8,2]]' 'fiducials_px = [[1,2],[],[3,4,5]]')"
of_study 3 'must lie on the detector' 'landmark off the detector' "$(marked 'landmarks_ct_mm = [[0,0,0],[9,1,1],[2,8,2]]' 'landmarks_px = [[1,2],[],[1e300,4]]')"
of_study 3 'has 2 entries' 'fewer landmarks than are marked in the CT' "$(marked 'landmarks_ct_mm = [[0,0,0],[9,1,1],[2,8,2]]' 'landmarks_px = [[1,2],[3,4]]')"
of_study 3 'must be a list of' 'landmarks that are no points' "$(marked 'landmarks_ct_mm = [[0,0,0],[9,1,1],[2,8,2]]' 'landmarks_px = [[1,2],["a",4],[inf,3]]')"
of_study 3 'landmarks_ct_mm' 'landmark in the CT at 1e300 mm' "$(marked 'landmarks_ct_mm = [[0,0,0],[9,1,1],[2,8,1e300]]' 'landmarks_px = [[1,2],[3,4],[5,6]]')"
row 3 '--search-rotation-deg' 'search of negative angles' "$bin/af-register" --renderer raycast -o out/result --start search \
  --search-rotation-deg 5,-1,5 --study valid/study.toml
row 3 'must be left out' 'search of all rotations within some' "$bin/af-register" --renderer raycast -o out/result --start search \
  --search-orientations any --search-rotation-deg 5,5,5 --study valid/study.toml
row 3 'without --start search' 'options of a search without one' "$bin/af-register" --renderer raycast -o out/result \
  --search-modes 3 --study valid/study.toml
row 2 'search-orientations' 'search of unknown orientations' "$bin/af-register" --renderer raycast -o out/result --start search \
  --search-orientations upright --study valid/study.toml
row 3 'landmarks' 'start from landmarks that no view shows' "$bin/af-register" --renderer raycast -o out/result --start landmarks \
  --study "$(marked 'landmarks_ct_mm = [[0,0,0],[9,1,1],[2,8,2]]' 'landmarks_px = [[],[],[]]')"
of_study 4 'gone.mha' 'X-ray missing' "$(edited study.toml '0,/^xray = .*/s//xray = "gone.mha"/')"
of_study 4 'edited-study.toml' 'not TOML' "$(edited study.toml '1s/^.*$/rig = /')"
# of_xray CODE PART WHAT FILE KEYS: the valid study with another first X-ray, and keys beside it.
of_xray() { of_study "$1" "$2" "$3" "$(edited study.toml "0,/^xray = .*/s//xray = \"..\/$4\"\n$5/; 0,/^xray_domain = .*/s//xray_domain = \"intensity\"/")"; }
of_xray 3 'say which frame' 'X-ray of several frames' frames.dcm ''
of_xray 3 'must be 1 to 2' 'frame that is not there' frames.dcm 'xray_frame = 3'
of_xray 3 'pixel_spacing_mm of camera' "X-ray of another detector's pixels" other-spacing.dcm ''
of_xray 3 'PixelIntensityRelationship' 'logarithms as intensities' logarithms.dcm ''
of_xray 3 'must be grey' 'X-ray in colour' colour.dcm ''
of_xray 4 'pixel data' 'frames that are not there' promises-frames.dcm 'xray_frame = 1'
for kind in jpeg rle; do
  of_xray 4 'compressed pixels are corrupt' "$kind frame that its decoder does not survive" "damaged-$kind.dcm" ''
done
of_study 3 'must be a positive number or one of percentile' 'unknown air level' "$(edited study.toml '0,/^xray_domain = .*/s//xray_domain = "intensity"\nair_level = "sky"/')"
of_study 3 'which gives it for every pixel' 'air level beside a flat field' "$(edited study.toml '0,/^xray_domain = .*/s//xray_domain = "intensity"\nair_level = 5.0\nflat = "f.mha"/')"
of_study 3 'xray_frame' 'frame of a MetaImage' "$(edited study.toml '0,/^xray_domain = .*/s//&\nxray_frame = 2/')"
row 3 'nobody' 'unknown case' "$bin/af-register" --study valid/study.toml --case nobody --renderer raycast -o out/result

printf -- '--- options ---\n'
of_option 2 '--no-such-option' 'unknown option' --no-such-option 1
row 2 '--output' 'missing option' "$bin/af-register" --study valid/study.toml
row 2 "did you mean '--study'?" 'mistyped option' "$bin/af-register" --studdy valid/study.toml -o out/r
row 2 "did you mean 'registration'?" 'mistyped sub-command' "$bin/af-evaluate" regstration --study valid/study.toml -o out/r
of_option 3 'uv' 'nodes < 2' --uv-nodes 1
of_option 3 'codewords' 'codewords > 65536' --codewords 70000
of_option 3 'codewords' 'codewords > training tiles' --codewords 60000
of_option 3 'max_rotation_deg' 'rotation range too large' --max-rotation-deg 85
of_option 2 'rx=5:-5' 'bounds of a range that descend' --rotation-range-deg rx=5:-5
of_option 2 'the axes are tx' 'range of an axis that there is not' --translation-range-mm rx=5
of_option 4 'does not exist' 'poses to cover that are missing' --cover none.csv
of_option 3 'max_translation_mm' 'source inside the CT within the range' --max-translation-mm 640
row 2 'must be a finite number' 'centre that is no number' "${precompute[@]}" --ct valid/ct.nii.gz --rig valid/rig.toml \
  --camera AP --center-ct-mm nan,0,0
row 0 'constant: the CT is out of view' 'PNG of a DRR that shows nothing' "$bin/af-drr" -o nothing.png \
  --ct valid/ct.nii.gz --rig valid/rig.toml --camera AP --translation-mm 500,0,0
row 3 "translation" 'DRR 1e308 mm away' "${drr_of_ct[@]}" --translation-mm 1e308,0,0
row 3 "translation" 'start 1e308 mm away' "${register_one[@]}" --start-translation-mm 1e308,0,0
of_option 3 'memory' 'memory limit' --memory-limit 1kb
of_option 2 '--memory-limit' 'negative memory limit' --memory-limit -5
of_option 2 '--memory-limit' 'memory limit of 2^64 and more' --memory-limit 99999999999999999999
of_option 2 '--seed' 'negative seed' --seed -1
of_option 2 '--seed' 'seed beyond 64 bits' --seed 18446744073709551616
of_option 2 '--uv-nodes' 'number with rubbish behind it' --uv-nodes 6x
of_option 2 '--uv-nodes' 'octal number' --uv-nodes 010
of_option 2 '--max-training-tiles' 'hexadecimal number' --max-training-tiles 0x1000
of_option 2 '--max-rotation-deg' 'NaN' --max-rotation-deg nan
of_option 2 '--max-translation-mm' 'infinity' --max-translation-mm inf
of_option 2 '--max-hours' 'infinite time' --max-hours inf
row 2 '--camera' 'empty text' "${precompute[@]}" --study valid/study.toml --camera ''

printf -- '--- field ---\n'
register=("$bin/af-register" --study valid/study.toml -o out/result)
row 4 'other.af.h5' 'field of another CT' "${register[@]}" --field AP=other.af.h5 --field LAT=other-LAT.af.h5
sed 's/^ct = .*/&\nct_values = "raw"\nct_raw_slope_per_mm = 0.00003\nct_raw_offset_per_mm = 0.02/' valid/study.toml >valid/raw.toml
row 4 'read with mu = 3e-05 * value + 0.02 per mm' 'field of a CT that is read otherwise' "$bin/af-register" \
  --study valid/raw.toml -o out/result --field AP=AP.af.h5 --field LAT=LAT.af.h5
row 2 '--body-only' 'reading of a CT beside a study' "$bin/af-drr" --study valid/study.toml --camera AP --body-only -o out/drr.mha
row 3 'is a study' 'reading of a CT to inspect a study' "$bin/af-inspect" valid/study.toml --body-only
row 4 'LAT.af.h5' 'field of another camera' "${register[@]}" --field AP=LAT.af.h5 --field LAT=AP.af.h5
head -c 20000 AP.af.h5 >cut.af.h5
row 4 'cut.af.h5' 'truncated field' "$bin/af-drr" --field cut.af.h5 -o out/drr.mha
# Damages the codewords. The field is so large that it consists mostly of them, and HDF5 leaves less room between their
# chunks than this overwrites.
mapfile -t larger < <(small --uv-nodes 24 --st-nodes 96 --codewords 256)
"$bin/af-precompute" "${larger[@]}" --study valid/study.toml --camera AP -o larger.af.h5 >message.txt 2>&1
bytes=$(stat --format %s larger.af.h5)
for percent in 40 50 60 70 80; do
  cp larger.af.h5 spoilt.af.h5
  printf 'spoilt %.0s' {1..300} | dd of=spoilt.af.h5 bs=1 seek=$((bytes * percent / 100)) conv=notrunc status=none
  row 4 'spoilt.af.h5' "2100 bytes spoilt at $percent % of a field" "$bin/af-drr" --field spoilt.af.h5 -o out/drr.mha
done
: >empty.af.h5
row 4 'empty.af.h5' 'empty field' "$bin/af-drr" --field empty.af.h5 -o out/drr.mha
row 4 'valid/study.toml' 'a study given as a field' "$bin/af-drr" --field valid/study.toml -o out/drr.mha
row 3 'outside' 'DRR of a pose outside the field' "$bin/af-drr" --field AP.af.h5 --translation-mm 80,0,0 -o out/drr.mha

printf -- '--- output ---\n'
new_field=("$bin/af-precompute" "${small[@]}")
of_valid_ct=(--ct valid/ct.nii.gz --rig valid/rig.toml --camera AP)
mkfifo pipe.mha f.partial g.io-test
ln -s nowhere dangling
row 4 'out/no-folder' 'output folder that does not exist' "$bin/af-drr" --field AP.af.h5 -o out/no-folder/drr.mha
row 3 'drr.jpg' 'format that cannot hold a DRR' "$bin/af-drr" --field AP.af.h5 -o out/drr.jpg

row 4 'exists and is not a regular file' 'a DRR into a pipe' "$bin/af-drr" --field AP.af.h5 -o pipe.mha
row 4 'exists and is not a regular file' 'a field into a pipe' "${new_field[@]}" "${of_valid_ct[@]}" -o pipe.mha
row 4 'exists and is not a regular file' 'a pipe has the name of the unfinished field' "${new_field[@]}" "${of_valid_ct[@]}" -o f
row 4 'exists and is not a regular file' 'a pipe has the name of the test file' "${new_field[@]}" "${of_valid_ct[@]}" -o g
row 4 'is a link to' 'a link that leads nowhere' "${new_field[@]}" "${of_valid_ct[@]}" -o dangling
row 4 'is not a folder' 'results of registration into a pipe' "$bin/af-register" --study valid/study.toml --renderer raycast -o pipe.mha
row 4 'is not a folder' 'results of registration into a file' "$bin/af-register" --study valid/study.toml --renderer raycast -o AP.af.h5
row 4 'is not a folder' 'results of evaluation into a pipe' "$bin/af-evaluate" registration --study valid/study.toml -o pipe.mha
row 3 'is the name of a file' 'a study into a pipe' "$bin/af-simulate" --phantom spine -o pipe.mha
awk 'BEGIN { print "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm"; for (i = 0; i < 40; ++i) print "1,1,1,0,0,0" }' >forty.csv
limited() { (
  ulimit -f "$1"
  shift
  "$@"
); }
# MPI itself needs files of a few megabytes.
row 4 'cannot be written' 'DRRs that the disk cannot hold' limited 6000 "$bin/af-drr" --ct valid/ct.nii.gz --rig c-arm-12in --camera AP --poses forty.csv -o out/drrs.mha
# Standard output may be a terminal or a file that takes no more.
full() { "$@" >/dev/full; }
row 4 'standard output: cannot be written' 'a report onto a full disk' full "$bin/af-inspect" AP.af.h5
row 4 'standard output: cannot be written' 'JSON onto a full disk' full "$bin/af-inspect" --json AP.af.h5
row 4 'standard output: cannot be written' 'a template onto a full disk' full "$bin/af-inspect" --template study
row 4 'standard output: cannot be written' 'help onto a full disk' full "$bin/af-drr" --help
row 4 'standard output: cannot be written' 'a version onto a full disk' full "$bin/af-register" --version
awk 'BEGIN { print "rx_deg,ry_deg,rz_deg,tx_mm,ty_mm,tz_mm"; for (i = 0; i < 400000; ++i) print "1,1,1,0,0,0" }' >poses.csv
row 3 'must fit' 'more DRRs than the machine can hold' "$bin/af-drr" --field AP.af.h5 --rig c-arm-12in --camera AP --poses poses.csv -o out/drrs.mha
row 3 'must fit' 'more poses than the machine can hold' "$bin/af-evaluate" image-quality --field AP.af.h5 --ct valid/ct.nii.gz --pose-count 2000000000 -o out

printf -- '--- scans ---\n'
cat >valid/scan.toml <<'TEXT'
source_to_axis_mm = 300.0
axis_to_detector_mm = 150.0
pixel_spacing_mm = [0.4, 0.4]
size_px = [64, 64]
rotation_axis = "rows"
view_count = 36
step_deg = 10.0
files = "p{}.png"
xray_domain = "intensity"
TEXT
of_scan() { row "$1" "$2" "$3" "$bin/af-scan" --scan "$4" -o out/study; }
of_scan 4 'p35.png' 'a scan without images' valid/scan.toml
of_scan 3 'size_px is missing' 'a scan without its size' "$(edited scan.toml '/^size_px/d')"
of_scan 3 'must go all the way round' 'a scan of half a circle' "$(edited scan.toml 's/^step_deg.*/step_deg = 5.0/')"
of_scan 3 'source_to_axis_mm' 'a source at 1e300 mm' "$(edited scan.toml 's/^source_to_axis_mm.*/source_to_axis_mm = 1e300/')"
of_scan 3 'must contain {} once' 'a file pattern with half an index' "$(edited scan.toml 's/p[{][}]/p{/')"
of_scan 4 'valid/p.png' 'a stack of views that is not there' "$(edited scan.toml 's/p[{][}]/p/')"
of_scan 4 'edited-scan.toml' 'a scan that is not TOML' "$(edited scan.toml '1s/^.*$/= 3/')"

printf -- '--- poses of other programs ---\n'
printf '%s\n' '1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1' >one.txt
row 3 'af-convert one.txt --ct valid/ct.nii.gz -o poses.csv' 'a pose of 16 numbers' "${drr_of_ct[@]}" --pose one.txt
row 3 'af-convert one.txt --study valid/study.toml --case ellipsoids -o poses.csv' 'a start of 16 numbers' \
  "${register_one[@]}" --start-pose one.txt
row 3 'af-convert cut.xml -o converted.toml' 'RTK geometry for af-inspect' "$bin/af-inspect" cut.xml
printf '%s\n' '#Insight' 'Transform: Euler3DTransform_double_3_3' 'Parameters: 1 2 3 4 5' 'FixedParameters: 0 0 0' >five.tfm
row 4 'number of Parameters' 'Euler transform of five numbers' "${drr_of_ct[@]}" --pose five.tfm

printf -- '--- outputs that are inputs ---\n'
ln valid/ct.nii.gz hard.nii.gz
ln -s valid/rig.toml soft.toml
mkdir -p raw again.partial
cp valid/ct.nii.gz again.partial
printf '%s\n' 'ObjectType = Image' 'NDims = 3' 'DimSize = 4 4 4' 'ElementSpacing = 1 1 1' 'ElementType = MET_SHORT' \
  'ElementDataFile = voxels.raw' >raw/ct.mhd
head -c 128 /dev/zero >raw/voxels.raw
head -n 3 forty.csv >few.csv
ln few.csv few.mha
sums=$(find . -type f -not -name message.txt -not -path "./out*" -print0 | sort -z | xargs -0 sha256sum)
row 3 'would replace the input' "a field instead of its CT" "${new_field[@]}" "${of_valid_ct[@]}" -o valid/ct.nii.gz
row 3 'would replace the input' "a field instead of its CT, by another link" "${new_field[@]}" "${of_valid_ct[@]}" -o hard.nii.gz
row 3 'would replace the input' "a field instead of its study" "${new_field[@]}" --study valid/study.toml --camera AP -o valid/study.toml
row 3 'would replace the input' "a field instead of its rig, by a link" "${new_field[@]}" --study valid/study.toml --camera AP -o soft.toml
row 3 'would replace the input' "a field instead of a CT's raw voxels" "${new_field[@]}" --ct raw/ct.mhd --rig c-arm-12in --camera AP -o raw/voxels.raw
row 3 'would replace the input' "a field instead of a slice" "${new_field[@]}" --ct two-series --rig c-arm-12in --camera AP -o "$(find two-series -type f | head -n 1)"
row 3 'would replace the input' 'a DRR instead of the CT' "$bin/af-drr" --ct valid/ct.nii.gz --rig valid/rig.toml --camera AP -o hard.nii.gz
row 3 'would replace the input' 'a DRR instead of the poses' "$bin/af-drr" --field AP.af.h5 --poses few.csv -o few.mha
row 3 'would replace the input' 'a study instead of the one of its CT' "$bin/af-simulate" --ct valid/ct.nii.gz --force -o valid
row 3 'would replace the input' 'a study instead of the DICOM folder' "$bin/af-simulate" --ct two-series --force -o two-series
row 3 'would replace the input' 'a study whose unfinished folder holds the CT' "$bin/af-simulate" --ct again.partial/ct.nii.gz -o again
row 3 'would replace the input' 'a joined study instead of a part' "$bin/af-evaluate" join-studies valid/study.toml -o valid/study.toml
sha256sum --quiet --check <<<"$sums" || failures=$((failures + 1))

echo "$rows cases, $failures failures"
((failures == 0))
