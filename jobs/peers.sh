#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Compares registrations by other programs' DRRs and by automatic differentiation with ours, from the same starts.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"
# shellcheck source=anatomies.sh
source "$af_root/jobs/anatomies.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/peers.sh [OPTIONS]

Simulates a phantom's X-rays, clean and stressed, and registers them from the same starts: by fields and by ray casting
(presets), by automatic differentiation in PyTorch (evaluate/peers/autodiff_registration.py) and by plastimatch's DRRs
with af-register's nelder-mead (evaluate/peers/plastimatch_registration.py). Says what Debian's elastix answers to its
ray-casting interpolator. Writes peers.csv. After a stop, run the same command again to continue. Needs the programs in
build/release/bin; peers that are not installed (jobs/install-packages.sh --with-peers) are left out, and it says so.

  --output DIR             where everything goes                                                             [./peers]
  --kind KIND              phantom: spine, pelvis or head                                                      [spine]
  --anatomy-seed N         a drawn patient of this kind (af-simulate); 0: the typical adult                         [0]
  --starts-per-interval N  starts in each of the intervals of 2 mm                                                 [5]
  --intervals N            from 0 mm                                                                               [8]
  --autodiff-starts N      of these, evenly, for automatic differentiation; 0: all                                 [0]
  --plastimatch-starts N   of these, evenly, for plastimatch; 0: all                                              [10]
  --python PROGRAM         a Python with numpy, nlopt and torch                                     [/usr/bin/python3]
  --seed N                 of the true pose, noise and starts                                                      [1]
  --help
TEXT
}

target="$PWD/peers" kind=spine anatomy_seed=0 starts=5 intervals=8 autodiff_starts=0 plastimatch_starts=10 python=/usr/bin/python3 seed=1
while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --kind) need_value "$1" $#; kind=$2; shift ;;
    --anatomy-seed) need_value "$1" $#; need_seed "$1" "$2"; anatomy_seed=$2; shift ;;
    --starts-per-interval) need_value "$1" $#; need_count "$1" "$2"; starts=$2; shift ;;
    --intervals) need_value "$1" $#; need_count "$1" "$2"; intervals=$2; shift ;;
    --autodiff-starts) need_value "$1" $#; need_seed "$1" "$2"; autodiff_starts=$2; shift ;;
    --plastimatch-starts) need_value "$1" $#; need_seed "$1" "$2"; plastimatch_starts=$2; shift ;;
    --python) need_value "$1" $#; python=$2; shift ;;
    --seed) need_value "$1" $#; need_seed "$1" "$2"; seed=$2; shift ;;
    --help | -h) usage; exit 0 ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done

bin=$(program_folder)
need_programs "$bin" af-simulate af-precompute af-evaluate
[[ -d "$af_root/evaluate/peers" ]] || die 1 "the peers are in the sources only: run the script there"
open_output "$target"
mkdir -p "$output/fields" "$output/starts" "$output/runs" "$output/poses"

# --- elastix: whether it has what 2D-3D registration needs ---------------------------------------------------------

if command -v elastix >/dev/null; then
  "$af_root/evaluate/peers/try-elastix.sh" "$output/elastix" | tee "$output/elastix.txt"
else
  say "elastix: not installed" | tee "$output/elastix.txt"
fi

# has_python MODULES: whether the chosen Python imports them.
has_python() { "$python" -c "import $1" 2>/dev/null; }

# field CASE CAMERA: makes a field. If it is made now, its time is written beside it.
field() {
  local file="$output/fields/$1-$2.af.h5" begin=$EPOCHREALTIME
  touch "$output/.stages/before"
  stage "field-$1-$2" "$file" "$bin/af-precompute" --study "$output/studies/$1/study.toml" --camera "$2" \
    --max-rotation-deg 15 --max-translation-mm 30 -o "$file"
  [[ ! "$file" -nt "$output/.stages/before" ]] ||
    awk -v a="$begin" -v b="$EPOCHREALTIME" 'BEGIN {print b - a}' >"$file.seconds"
}

# evaluate NAME CASE OPTIONS...
evaluate() {
  local name=$1 case_name=$2
  shift 2
  stage "$name" "$output/runs/$name/summary.json" "$bin/af-evaluate" registration \
    --study "$output/studies/$case_name/study.toml" --starts-from "$output/starts/$case_name/starts.csv" \
    --intervals "$intervals" --seed "$seed" -o "$output/runs/$name" "$@"
}

# peer NAME CASE SCRIPT STARTS: finds poses by another program, and judges them by our errors.
peer() {
  local name=$1 case_name=$2 script=$3 most=$4 poses="$output/poses/$2-$1.csv"
  stage "$case_name-$name-poses" "$poses" "$python" "$af_root/evaluate/peers/$script" \
    --study "$output/studies/$case_name/study.toml" --case "$kind" --starts "$output/starts/$case_name/starts.csv" \
    --most "$most" -o "$poses"
  local stage_inputs
  # shellcheck disable=SC2034  # for stage()
  stage_inputs="$(state_of "$poses")"
  evaluate "$case_name-$name" "$case_name" --poses-from "$poses" --method-name "$name"
}

patient=()
((anatomy_seed == 0)) || patient=(--anatomy-seed "$anatomy_seed")
# The peers' poses depend on these besides the words of their commands.
# shellcheck disable=SC2034  # for stage()
stage_inputs="seed $seed, $starts in each of $intervals, $(cat "$af_root"/evaluate/peers/*.py | sha256sum)"
for variant in clean stressed; do
  case_name="$kind-$variant" stress=$(stress_of "$variant")
  stage "simulate-$case_name" "$output/studies/$case_name/study.toml" "$bin/af-simulate" --phantom "$kind" \
    --phantom-voxel-mm 2 --rig c-arm-12in --case "$kind" --seed "$seed" --no-fiducials ${stress:+--stress "$stress"} \
    --force "${patient[@]}" -o "$output/studies/$case_name"
  of_case=()
  for camera in AP LAT; do
    field "$case_name" "$camera"
    of_case+=(--field "$camera=$output/fields/$case_name-$camera.af.h5")
  done
  stage "starts-$case_name" "$output/starts/$case_name/starts.csv" "$bin/af-evaluate" registration \
    --study "$output/studies/$case_name/study.toml" "${of_case[@]}" --start-rule within-range --intervals "$intervals" \
    --starts-per-interval "$starts" --seed "$seed" --starts-only -o "$output/starts/$case_name"
  for preset in robust fast; do
    evaluate "$case_name-$preset" "$case_name" "${of_case[@]}" --preset "$preset" --renderer both --no-uncertainty
  done
  # Hundreds of poses per start take minutes each by ray casting.
  evaluate "$case_name-paper" "$case_name" "${of_case[@]}" --preset paper --no-uncertainty
  if has_python numpy,torch; then
    peer autodiff "$case_name" autodiff_registration.py "$autodiff_starts"
  else
    say "automatic differentiation: left out, $python has no torch"
  fi
  if command -v plastimatch >/dev/null && has_python numpy,nlopt; then
    peer plastimatch-nelder-mead "$case_name" plastimatch_registration.py "$plastimatch_starts"
  else
    say "plastimatch: left out, it or python3-nlopt is not installed"
  fi
done

python3 "$af_root/evaluate/peers/peer_table.py" "$output" "$kind" "$output/peers.csv"
say "Table: $output/peers.csv"
