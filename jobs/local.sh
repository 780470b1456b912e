#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Does the whole job on one machine: packages, build, and a study from a CT to a report.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/local.sh [OPTIONS]
       jobs/local.sh STUDY.toml [OPTIONS]    a study of yours: see jobs/run-study.sh --help

Installs what is missing, builds programs and Python module, and takes a CT through the whole pipeline: a
simulated X-ray pair, one attenuation field per camera, image quality of the fields, registrations by the
presets paper and robust, report.html. Stages that are finished and whose inputs did not change are
skipped. So the same command goes on after an interruption.

  --output DIR              where everything goes                                        [./af-study]
  --ct PATH                 your CT: DICOM folder, NIfTI, MetaImage or NRRD      [a patient's skull CT]
  --series UID              DICOM series, when the folder of --ct holds several
  --phantom spine           a built-in phantom instead of a CT
  --paper                   the paper's full range of translations (100 mm instead of 30 mm),
                            100 compared poses and 10 ray-cast starts per interval
  --starts-per-interval N   field registrations in each of the eight intervals of start error            [30]
  --raycast-starts N        how many of them, in each of the first two intervals, are repeated by ray casting
                            (with --paper by both presets, else by robust alone: by paper each takes a minute)
                                                                                            [2, --paper: 10]
  --pose-count N            random poses whose DRRs are compared with ray casting, per field
                                                                                          [30, --paper: 100]
  --ranks N                 MPI ranks                                                     [all cores]
  --seed N                  of everything random                                                  [1]
  --skip-packages           do not look for missing packages
  --skip-build              use the programs as they are
  --force                   do every stage again
  --help
TEXT
}

# --- options -----------------------------------------------------------------------------------------------------

if [[ "${1:-}" == *.toml ]]; then
  exec "$af_root/jobs/run-study.sh" "$@"
fi
output="$PWD/af-study"
ct="" phantom="" preset=quick ranks="" seed=1 force=no skip_build=no skip_packages=no
starts_per_interval="" raycast_starts="" pose_count=""
series_option=()

while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; output=$2; shift ;;
    --ct) need_value "$1" $#; ct=$2; shift ;;
    --series) need_value "$1" $#; series_option=(--series "$2"); shift ;;
    --phantom) need_value "$1" $#; phantom=$2; shift ;;
    --paper) preset=paper ;;
    --starts-per-interval) need_value "$1" $#; need_count "$1" "$2"; starts_per_interval=$2; shift ;;
    --raycast-starts) need_value "$1" $#; need_count "$1" "$2"; raycast_starts=$2; shift ;;
    --pose-count) need_value "$1" $#; need_count "$1" "$2"; pose_count=$2; shift ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --seed) need_value "$1" $#; need_seed "$1" "$2"; seed=$2; shift ;;
    --skip-packages) skip_packages=yes ;;
    --skip-build) skip_build=yes ;;
    --force) force=yes ;;
    --help | -h) usage; exit 0 ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done
[[ -z "$ct" || -z "$phantom" ]] || die 2 "--ct and --phantom exclude each other"
((${#series_option[@]} == 0)) || [[ -n "$ct" ]] || die 2 "--series needs --ct"
[[ -z "$ct" || -e "$ct" ]] || die 4 "--ct $ct: no such file or folder"
if [[ -e "$output" && ! -d "$output" ]]; then
  die 3 "--output $output exists and is not a folder"
fi
if [[ -d "$output" && ! -d "$output/.stages" && -n "$(ls -A "$output")" ]]; then
  die 3 "--output $output holds files that are not of a study of this script; choose another folder"
fi
[[ -n "$ranks" ]] || ranks=$(core_count)
cores=$(core_count)

# The quick preset has the paper's resolutions, a smaller range of translations and fewer comparisons.
field_options=(--uv-nodes 64 --st-nodes 256 --codewords 16384 --training-fraction 0.1 --max-rotation-deg 10)
if [[ "$preset" == paper ]]; then
  field_options+=(--max-translation-mm 100)
  : "${starts_per_interval:=30}" "${raycast_starts:=10}" "${pose_count:=100}"
else
  field_options+=(--max-translation-mm 30)
  : "${starts_per_interval:=30}" "${raycast_starts:=2}" "${pose_count:=30}"
fi
((raycast_starts <= starts_per_interval)) ||
  die 2 "--raycast-starts = $raycast_starts must not exceed --starts-per-interval = $starts_per_interval"

# --- stages ------------------------------------------------------------------------------------------------------

stage_names=() stage_titles=() stage_seconds=()
plan_stage() {
  stage_names+=("$1")
  stage_seconds+=("$2")
  stage_titles+=("$3")
}

# parallel_seconds SECONDS_ON_ONE_CORE: expected time on the ranks that have a core of their own.
parallel_seconds() {
  local useful=$((ranks < cores ? ranks : cores))
  echo $((($1 + useful - 1) / useful))
}

print_plan() {
  local total=0 i packages="none missing" build="none"
  if [[ "$skip_packages" == no ]] && ! "$af_root/jobs/install-packages.sh" --check >/dev/null 2>&1; then
    packages="some are missing: about 3 min"
  fi
  if [[ "$skip_build" == no && -f "$af_root/CMakeLists.txt" ]]; then
    build="seconds, up to 5 min from nothing"
  fi
  say "Study in $output"
  say "  CT: ${ct:-phantom $phantom}${default_ct_note}; $preset preset, $ranks rank(s) on $cores core(s), seed $seed"
  say "What will be done, and how long it may take (estimates, made on two cores of a virtual machine):"
  printf '      %-76s %s\n' "Install packages" "$packages" "Build" "$build"
  for ((i = 0; i < ${#stage_names[@]}; ++i)); do
    printf '  %2d  %-76s %s\n' $((i + 1)) "${stage_titles[i]}" "$(duration "${stage_seconds[i]}")"
    total=$((total + stage_seconds[i]))
  done
  say "  After the build about $(duration "$total")."
}

# next_stage RESULT COMMAND...: runs the next planned stage.
stage_number=0 stages_are_a_chain=yes stages_start_anew=yes
next_stage() {
  local name=${stage_names[stage_number]}
  stage_title="[$((stage_number + 1))/${#stage_names[@]}] ${stage_titles[stage_number]}"
  stage_number=$((stage_number + 1))
  stage "$name" "$@"
}

# --- the plan ----------------------------------------------------------------------------------------------------

open_output "$output"
if [[ "$force" == yes ]]; then
  rm -f "$output"/.stages/*.done "$output"/.stages/*.started
fi
default_ct_note=""
if [[ -z "$ct" && -z "$phantom" ]]; then
  ct="$output/skull.mhd"
  default_ct_note=" (a patient's skull, from Debian's invesalius-examples)"
  plan_stage ct 1 "Unpack the default CT"
elif [[ -n "$ct" ]]; then
  ct="$(realpath "$ct")"
  # The CT's file decides whether the study starts anew.
  stage_inputs=$(find "$ct" -type f -printf '%P %s %T@\n' | LC_ALL=C sort | sha256sum)
fi
field_seconds=12
[[ "$preset" == quick ]] || field_seconds=20
plan_stage simulate 5 "Simulate the X-ray pair and its study"
plan_stage field-A "$(parallel_seconds $field_seconds)" "Precompute the field of camera A"
plan_stage field-B "$(parallel_seconds $field_seconds)" "Precompute the field of camera B"
compare_seconds=$(parallel_seconds $((pose_count / 3 + 4)))
plan_stage image-quality-A "$compare_seconds" "Compare $pose_count DRRs of field A with ray casting"
plan_stage image-quality-B "$compare_seconds" "Compare $pose_count DRRs of field B with ray casting"
# Seconds of a registration on one core: 0.1 (paper) or 0.03 with fields, 40 (paper) or 5 by ray casting.
field_starts=$((8 * starts_per_interval)) cast_starts=$((2 * raycast_starts))
paper_casts="" paper_cast_seconds=0 paper_renderer=(--renderer field)
if [[ "$preset" == paper ]]; then
  paper_casts=", $cast_starts of them also by ray casting"
  paper_cast_seconds=$((cast_starts * 40))
  paper_renderer=(--renderer both --raycast-starts-per-interval "$raycast_starts" --raycast-intervals 2)
fi
plan_stage registration-paper "$(parallel_seconds $((field_starts / 8 + paper_cast_seconds + 2)))" \
  "Register $field_starts starts by preset paper$paper_casts"
plan_stage registration-robust "$(parallel_seconds $((field_starts / 30 + cast_starts * 5 + 2)))" \
  "Register the same starts by preset robust, $cast_starts of them also by ray casting"
plan_stage overlay 5 "Register one start and draw its overlays"
plan_stage report 5 "Write the report"
print_plan

# --- packages and build ------------------------------------------------------------------------------------------

if [[ "$skip_packages" == no ]]; then
  "$af_root/jobs/install-packages.sh" || die 1 "packages are missing (see above); --skip-packages goes on without them"
fi
if [[ -f "$af_root/CMakeLists.txt" && "$skip_build" == no ]]; then
  say "Building the programs and the Python module in build/release ..."
  build_start=$SECONDS
  mkdir -p "$af_root/build"
  build_preset release "$af_root/build/release.log" "${af_programs[@]}" python-module
  say "        $(duration $((SECONDS - build_start)))"
fi
bin=$(program_folder)
need_programs "$bin" "${af_programs[@]}"

# --- the study --------------------------------------------------------------------------------------------------

study_start=$SECONDS

if [[ -n "$default_ct_note" ]]; then
  next_stage "$ct" "$af_root/jobs/default-ct.sh" "$ct"
fi
study="$output/study/study.toml"
if [[ -n "$phantom" ]]; then
  next_stage "$study" "$bin/af-simulate" --phantom "$phantom" --rig treatment-room --seed "$seed" --force \
    -o "$output/study"
else
  next_stage "$study" "$bin/af-simulate" --ct "$ct" "${series_option[@]}" --rig treatment-room --seed "$seed" --force \
    -o "$output/study"
fi
[[ -z "$phantom" ]] || ct="$output/study/ct.nii.gz"
case_name=$(sed -n 's/^ *name *= *"\(.*\)" *$/\1/p' "$study" | head -n 1)
for camera in A B; do
  next_stage "$output/$camera.af.h5" run_ranks "$ranks" "$bin/af-precompute" --study "$study" --case "$case_name" \
    --camera "$camera" "${series_option[@]}" "${field_options[@]}" --seed "$seed" -o "$output/$camera.af.h5"
done
fields=(--field "A=$output/A.af.h5" --field "B=$output/B.af.h5")
for camera in A B; do
  next_stage "$output/image-quality-$camera/summary.json" run_ranks "$ranks" "$bin/af-evaluate" image-quality \
    --field "$output/$camera.af.h5" --ct "$ct" "${series_option[@]}" --pose-count "$pose_count" --seed "$seed" \
    -o "$output/image-quality-$camera"
done
registration=(run_ranks "$ranks" "$bin/af-evaluate" registration --study "$study" "${series_option[@]}" "${fields[@]}"
  --starts-per-interval "$starts_per_interval" --seed "$seed")
next_stage "$output/registration-paper/summary.json" "${registration[@]}" --preset paper "${paper_renderer[@]}" \
  -o "$output/registration-paper"
next_stage "$output/registration-robust/summary.json" "${registration[@]}" --preset robust --renderer both \
  --raycast-starts-per-interval "$raycast_starts" --raycast-intervals 2 -o "$output/registration-robust"
next_stage "$output/overlay/result.json" "$bin/af-register" --study "$study" --case "$case_name" "${series_option[@]}" \
  "${fields[@]}" --preset robust --start-rotation-deg 2,-2,2 --start-translation-mm 3,3,-3 -o "$output/overlay"
next_stage "$output/report.html" "$bin/af-evaluate" report -o "$output/report.html" "$output"

say ""
if ((${#stage_report[@]} > 0)); then
  say "Done in $(duration $((SECONDS - study_start))):"
  printf '%s\n' "${stage_report[@]}"
fi
say "Report: $output/report.html"
say "To use the programs in this shell: export PATH=$(printf '%q' "$bin"):\$PATH"
python_folder="$af_root/build/release/python"
if [[ -e "$python_folder" ]]; then
  say "To use the Python module, too:     export PYTHONPATH=$(printf '%q' "$python_folder")   # for /usr/bin/python3"
fi
