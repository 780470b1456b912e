#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Registers real X-rays whose true pose is known: views of a circular cone-beam scan against a CT that is reconstructed from
# its other views.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/real-xrays.sh FOLDER [OPTIONS]

FOLDER holds the images of a circular cone-beam scan. Finds the scan's true geometry from its even views, reconstructs a
CT from them, takes odd views as X-rays, in pairs about 90 degrees apart and alone, builds a field for each X-ray,
registers from starts up to 30 mm from the true pose, drawn within the range of the fields, with every preset, by fields
and by ray casting. All but paper register again by fields with a finish by ray casting (--correct), beside ray casting
with the finish's steps (0.25 mm instead of 1). Writes methods.md, finishes.md, distances.md and report.html. After a
stop, run the same command again to continue. Needs the programs in build/release/bin (or installed).

  --scan FILE               geometry of the scan: af-inspect --template scan prints one to fill in        [FOLDER/scan.toml]
  --output DIR              where everything goes                                                      [./real-xrays]
  --pairs N                 pairs of X-rays; the first of each is a case of one view, too                         [5]
  --presets LIST            comma separated                                                       [robust,fast,paper]
  --starts-per-interval N   starts in each interval of 2 mm                                                       [8]
  --intervals N             intervals of 2 mm, from 0                                                            [15]
  --raycast-starts N        of each interval's starts, so many also by ray casting, with both steps; 0: no ray casting, and
                            no finish                                                                            [1]
  --calibration OPTIONS     options of af-scan, in one word, e.g. "--as-stated" for a calibrated scanner
  --field OPTIONS           options of af-precompute, in one word, for the fields of all presets [--preset standard; robust, which
                            is compared with ray casting, has --codewords 65536 and (s,t) nodes at most half a voxel apart, too,
                            but never closer than 0.1 mm: 20 times as large for the cylinder of docs/real-xrays.md]
  --max-rotation-deg X      range of the fields, degrees                                                         [16]
  --max-translation-mm X    range of the fields, mm                                                              [40]
  --quick                   2 pairs, 1 start in each of 15 intervals, ray casting from 4 starts per case and preset
  --ranks N                 MPI ranks of fields and registrations                                         [all cores]
  --seed N                  of nominal poses and starts                                                           [1]
  --help
TEXT
}

folder="" scan="" target="$PWD/real-xrays" pairs=5 presets=robust,fast,paper starts=8 intervals=15 raycast_starts=1
raycast_intervals=15 scan_words="" max_rotation_deg=16 max_translation_mm=40 ranks=$(core_count) seed=1
field_words="--preset standard" states_fields=no
while (($# > 0)); do
  case "$1" in
    --scan) need_value "$1" $#; scan=$2; shift ;;
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --pairs) need_value "$1" $#; need_count "$1" "$2"; pairs=$2; shift ;;
    --presets) need_value "$1" $#; presets=$2; shift ;;
    --starts-per-interval) need_value "$1" $#; need_count "$1" "$2"; starts=$2; shift ;;
    --intervals) need_value "$1" $#; need_count "$1" "$2"; intervals=$2; shift ;;
    --raycast-starts) need_value "$1" $#; need_seed "$1" "$2"; raycast_starts=$2; shift ;;
    --calibration) need_value "$1" $#; scan_words=$2; shift ;;
    --field) need_value "$1" $#; field_words=$2 states_fields=yes; shift ;;
    --max-rotation-deg) need_value "$1" $#; max_rotation_deg=$2; shift ;;
    --max-translation-mm) need_value "$1" $#; max_translation_mm=$2; shift ;;
    --quick) pairs=2 starts=1 raycast_starts=1 raycast_intervals=4 ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --seed) need_value "$1" $#; need_seed "$1" "$2"; seed=$2; shift ;;
    --help | -h) usage; exit 0 ;;
    -*) die 2 "unknown option '$1' (try --help)" ;;
    *) [[ -z "$folder" ]] || die 2 "one scan at a time: '$folder' and '$1' were given"; folder=$1 ;;
  esac
  shift
done
[[ -n "$folder" ]] || die 2 "which scan? Give the folder of its images (try --help)"
[[ -d "$folder" ]] || die 4 "$folder: no such folder"
if [[ -z "$scan" ]]; then
  scan="$folder/scan.toml"
  # The scan in the documentation comes without a file of ours.
  cylinder="$af_root/docs/data/cbct-cylinder.toml"
  [[ -f "$scan" || ! -f "$folder/Projection359.png" || ! -f "$cylinder" ]] || scan=$cylinder
  [[ -f "$scan" ]] || die 4 "$scan: no such file; give --scan FILE (af-inspect --template scan prints one to fill in)"
fi
[[ -f "$scan" ]] || die 4 "--scan $scan: no such file"
folder=$(realpath "$folder") scan=$(realpath "$scan")
((raycast_intervals <= intervals)) || raycast_intervals=$intervals
IFS=, read -r -a preset_list <<<"$presets"
read -r -a field_options <<<"$field_words"
read -r -a scan_options <<<"$scan_words"

bin=$(program_folder)
need_programs "$bin" af-scan af-precompute af-evaluate af-inspect
open_output "$target"
mkdir -p "$output/fields" "$output/starts" "$output/runs" "$output/finishes"

# --- the scan ----------------------------------------------------------------------------------------------------

say "Geometry of the scan: $scan"
# Lists of angles and of files are beside the scan's file.
lists=$(sed -nE "s/^[[:space:]]*(angles|files)_file[[:space:]]*=[[:space:]]*[\"']([^\"']*)[\"'].*/\2/p" "$scan")
stage_inputs="$(sha256sum <"$scan") $(state_of "$folder")"
while IFS= read -r list; do
  # af-scan reports a missing list.
  if [[ -n "$list" && -f "$(dirname "$scan")/$list" ]]; then stage_inputs+=" $(sha256sum <"$(dirname "$scan")/$list")"; fi
done <<<"$lists"
study="$output/study/study.toml"
stage "scan" "$study" "$bin/af-scan" --scan "$scan" --folder "$folder" --pairs "$pairs" --seed "$seed" --enlarge-small \
  "${scan_options[@]}" --force -o "$output/study"
water=$(sed -n 's/^water_mu_per_mm = //p' "$output/study/calibration.toml")
[[ -n "$water" ]] || die 6 "$output/study/calibration.toml has no water_mu_per_mm"
robust_field_words=$field_words
if [[ "$states_fields" == no ]]; then
  # With nodes a voxel apart, look-up loses what is finer than two voxels, and ends elsewhere than ray casting.
  half_voxel=$(awk '/^ct_voxel_mm = / { printf "%.4f", $3 < 0.2 ? 0.1 : $3 / 2 }' "$output/study/calibration.toml")
  [[ -n "$half_voxel" ]] || die 6 "$output/study/calibration.toml has no ct_voxel_mm"
  robust_field_words+=" --codewords 65536 --st-spacing-mm $half_voxel"
fi
stage_inputs="$(sha256sum <"$study") $(sha256sum <"$output/study/calibration.toml")"

# --- fields, starts, registrations -------------------------------------------------------------------------------

read -r -a robust_field_options <<<"$robust_field_words"
declare -A cameras_of=()
case_names=()
views=$("$bin/af-inspect" --list-views "$study")
while IFS=$'\t' read -r case_name camera _; do
  [[ -v cameras_of["$case_name"] ]] || case_names+=("$case_name")
  cameras_of[$case_name]+="$camera "
done <<<"$views"

# field_of PRESET CASE CAMERA: the field's file. A single view has its pair's nominal pose, and therefore its field.
field_of() {
  local kind=""
  [[ "$1" != robust || "$robust_field_words" == "$field_words" ]] || kind=-robust
  echo "$output/fields/pair-${2#*-}-$3$kind.af.h5"
}

declare -A is_made=()
for case_name in "${case_names[@]}"; do
  [[ "$case_name" == pair-* ]] || continue
  for camera in ${cameras_of[$case_name]}; do
    for preset in "${preset_list[@]}"; do
      file=$(field_of "$preset" "$case_name" "$camera")
      [[ ! -v is_made["$file"] ]] || continue
      is_made[$file]=yes
      options=("${field_options[@]}")
      [[ "$preset" != robust ]] || options=("${robust_field_options[@]}")
      stage "field $(basename "$file" .af.h5)" "$file" run_ranks "$ranks" \
        "$bin/af-precompute" --study "$study" --case "$case_name" --camera "$camera" "${options[@]}" \
        --max-rotation-deg "$max_rotation_deg" --max-translation-mm "$max_translation_mm" --water-mu-per-mm "$water" \
        --seed "$seed" -o "$file"
    done
  done
done

# register FOLDER FILE CASE OPTIONS...: FILE is what it writes last.
register() {
  local result=$1 last=$2 case_name=$3
  shift 3
  stage "$result" "$output/$result/$last" run_ranks "$ranks" \
    "$bin/af-evaluate" registration --study "$study" --case "$case_name" --gold study --water-mu-per-mm "$water" \
    --intervals "$intervals" --seed "$seed" -o "$output/$result" "$@"
}

# fields_of PRESET CASE: sets of_case to the options that name its fields.
fields_of() {
  local camera
  of_case=()
  for camera in ${cameras_of[$2]}; do of_case+=(--field "$camera=$(field_of "$1" "$2" "$camera")"); done
}

run_folders=() finish_folders=()
for case_name in "${case_names[@]}"; do
  fields_of "${preset_list[0]}" "$case_name"
  register "starts/$case_name" starts.csv "$case_name" "${of_case[@]}" --starts-per-interval "$starts" \
    --start-rule within-range --starts-only
  from=(--starts-from "$output/starts/$case_name/starts.csv" --starts-per-interval "$starts")
  for preset in "${preset_list[@]}"; do
    fields_of "$preset" "$case_name"
    both=(--renderer field)
    if ((raycast_starts > 0)); then
      both=(--renderer both --raycast-intervals "$raycast_intervals" --raycast-starts-per-interval "$raycast_starts")
    fi
    register "runs/$case_name-$preset" summary.json "$case_name" "${of_case[@]}" "${from[@]}" --preset "$preset" "${both[@]}"
    run_folders+=("$output/runs/$case_name-$preset")
    if ((raycast_starts > 0)) && [[ "$preset" != paper ]]; then
      register "finishes/$case_name-$preset-corrected" summary.json "$case_name" "${of_case[@]}" "${from[@]}" \
        --preset "$preset" --correct --correct-step-mm 0.25 "${both[@]}"
      finish_folders+=("$output/finishes/$case_name-$preset-corrected")
    fi
  done
done

# --- tables, report ----------------------------------------------------------------------------------------------

"$bin/af-evaluate" compare "${run_folders[@]}" -o "$output/methods.md"
say "Table: $output/methods.md"
if ((${#finish_folders[@]} > 0)); then
  "$bin/af-evaluate" compare "${finish_folders[@]}" -o "$output/finishes.md"
  "$bin/af-evaluate" compare "${run_folders[@]}" "${finish_folders[@]}" --pose-distances -o "$output/distances.md"
  say "Tables: $output/finishes.md, $output/distances.md"
fi
"$bin/af-evaluate" report -o "$output/report.html" "$output/runs"
grep -E '^(enlarged|(gold|stated)_residual|(stated_)?source_to_detector_mm|largest_masked_share)' "$output/study/calibration.toml" | sed 's/^/  /'
awk '/^Warning/ && !seen[$0]++ { print "  " $0 }' "$output/logs/scan.log"
say "Report: $output/report.html; pictures of the X-rays: $output/study/view-*.png"
