#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Whether registrations know their own errors: simulated cases of known truth, on one half of which the constants of
# register/uncertainty/calibration.cpp are fitted, to be judged on the other.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/uncertainty.sh [OPTIONS]

Simulates cases of three phantoms, each with another true pose and noise, clean, under stress and with moved anatomy,
registers them with every preset, and fits and judges the predictions of error: uncertainty.csv and, on the screen, the
constants. Cases of odd seeds are fitted, those of even seeds are judged. After a stop, run the same command again to
continue. Needs the programs in build/release/bin (or installed).

  --output DIR    where everything goes                                                              [./uncertainty]
  --seeds N       cases of each phantom and variant                                                             [14]
  --kinds LIST    phantoms, comma separated                                                      [spine,pelvis,head]
  --presets LIST  comma separated                                                                [robust,fast,paper]
  --starts N      of each case, one in each interval of 2 mm from 0                                             [15]
  --ranks N       MPI ranks of registrations                                                             [all cores]
  --help
TEXT
}

target="$PWD/uncertainty" seeds=14 kinds=spine,pelvis,head presets=robust,fast,paper starts=15 ranks=$(core_count)
while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --seeds) need_value "$1" $#; need_count "$1" "$2"; seeds=$2; shift ;;
    --kinds) need_value "$1" $#; kinds=$2; shift ;;
    --presets) need_value "$1" $#; presets=$2; shift ;;
    --starts) need_value "$1" $#; need_count "$1" "$2"; starts=$2; shift ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --help | -h) usage; exit 0 ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done
IFS=, read -r -a kind_list <<<"$kinds"
IFS=, read -r -a preset_list <<<"$presets"

bin=$(program_folder)
need_programs "$bin" af-simulate af-precompute af-evaluate
open_output "$target"
mkdir -p "$output/fields" "$output/runs"

# All of one phantom's cases have one CT and one nominal pose, so they share its fields.
declare -A stress_of=([clean]="" [stressed]="rods,fiducials,heel,noise" [moving]="rods,heel,noise,scatter,motion")
read -r -a field_options <<<"--uv-nodes 12 --st-nodes 256 --slabs 4 --codewords 8192 --max-rotation-deg 18 --max-translation-mm 45"

for kind in "${kind_list[@]}"; do
  studies=() stage_inputs=""
  for ((seed = 1; seed <= seeds; ++seed)); do
    for variant in clean stressed moving; do
      name="$kind-$variant-$seed" stress=${stress_of[$variant]}
      stage "simulate-$name" "$output/studies/$name/study.toml" "$bin/af-simulate" --phantom "$kind" \
        --phantom-voxel-mm 2 --rig c-arm-12in --seed "$seed" --no-fiducials ${stress:+--stress "$stress"} --force \
        -o "$output/studies/$name"
      # The name is a key of the draws: with one name, the variants of a seed have one true pose.
      sed -i "s/^name = .*/name = \"$name\"/" "$output/studies/$name/study.toml"
      studies+=("$output/studies/$name/study.toml")
    done
  done
  for camera in AP LAT; do
    stage "field-$kind-$camera" "$output/fields/$kind-$camera.af.h5" "$bin/af-precompute" --study "${studies[0]}" \
      --camera "$camera" "${field_options[@]}" -o "$output/fields/$kind-$camera.af.h5"
  done
  stage_inputs="$seeds seeds"
  stage "join-$kind" "$output/$kind.toml" "$bin/af-evaluate" join-studies "${studies[@]}" \
    --fields "fields/$kind-{camera}.af.h5" -o "$output/$kind.toml"
done

stage_inputs="$seeds seeds"
declare -A measure_of=([robust]=rg [fast]=gc [paper]=mi)
tables=()
for preset in "${preset_list[@]}"; do
  for kind in "${kind_list[@]}"; do
    stage "register-$kind-$preset" "$output/runs/$kind-$preset/summary.json" run_ranks "$ranks" \
      "$bin/af-evaluate" registration --study "$output/$kind.toml" --preset "$preset" --start-rule within-range \
      --intervals "$starts" --starts-per-interval 1 -o "$output/runs/$kind-$preset"
    tables+=("${measure_of[$preset]:-$preset}=$output/runs/$kind-$preset/registrations.csv")
  done
done
python3 "$af_root/jobs/fit-uncertainty.py" "${tables[@]}" --csv "$output/uncertainty.csv" | tee "$output/constants.txt"
say "Table: $output/uncertainty.csv"
