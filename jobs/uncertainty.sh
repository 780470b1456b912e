#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Whether registrations know their own errors: the patients of a population study, on one half of whom the constants of
# register/uncertainty/calibration.cpp are fitted, to be judged on the other.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/uncertainty.sh POPULATION... [OPTIONS]

Registers the patients of finished runs of jobs/population.sh (their output folders, with studies and fields) once more,
from two views, this time with the errors that registrations foretell of themselves; fits the predictions on patients of
odd numbers and judges them on the others: uncertainty.csv and, on the screen, the constants. After a stop, run the same
command again to continue. Needs the programs in build/release/bin (or installed).

  --output DIR     where everything goes                                                             [./uncertainty]
  --variants LIST  comma separated, as in the population                                                 [clean,all]
  --presets LIST   comma separated                                                               [robust,fast,paper]
  --starts N       of each patient, one in each interval of 2 mm from 0                                         [15]
  --judge          fit nothing: judge all patients by what the programs foretell
  --ranks N        MPI ranks of registrations                                                            [all cores]
  --help
TEXT
}

target="$PWD/uncertainty" variants=clean,all presets=robust,fast,paper starts=15 ranks=$(core_count) populations=() judge_option=()
while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --variants) need_value "$1" $#; variants=$2; shift ;;
    --presets) need_value "$1" $#; presets=$2; shift ;;
    --starts) need_value "$1" $#; need_count "$1" "$2"; starts=$2; shift ;;
    --judge) judge_option=(--judge) ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --help | -h) usage; exit 0 ;;
    -*) die 2 "unknown option '$1' (try --help)" ;;
    *)
      [[ -d "$1/studies" ]] || die 4 "$1/studies: no such folder: $1 is no output of jobs/population.sh"
      populations+=("$(realpath "$1")")
      ;;
  esac
  shift
done
((${#populations[@]} > 0)) || die 2 "which population? Give an output folder of jobs/population.sh (try --help)"
IFS=, read -r -a variant_list <<<"$variants"
IFS=, read -r -a preset_list <<<"$presets"

bin=$(program_folder)
need_programs "$bin" af-evaluate
open_output "$target"
mkdir -p "$output/runs"

# The measures that the presets end with.
declare -A measure_of=([robust]=rg [fast]=gc [paper]=mi)
declare -A made=()
tables=()
for preset in "${preset_list[@]}"; do
  [[ -v measure_of["$preset"] ]] || die 2 "--presets = '$presets' must name some of robust, fast, paper"
  for variant in "${variant_list[@]}"; do
    for population in "${populations[@]}"; do
      for study in "$population/studies"/*-"$variant"-2.toml; do
        [[ -f "$study" ]] || die 4 "$study: no such study: the population has no X-rays '$variant' from two views"
        patient=$(basename "$study" "-$variant-2.toml")
        run="$output/runs/$variant-$preset/$patient"
        [[ ! -v made["$run"] ]] || die 2 "$study: another of the populations has a patient '$patient', too"
        made[$run]=yes
        stage_inputs="$(state_of "$study")"
        stage "$variant-$preset-$patient" "$run/summary.json" run_ranks "$ranks" "$bin/af-evaluate" registration \
          --study "$study" --gold study --preset "$preset" --start-rule within-range --intervals "$starts" \
          --starts-per-interval 1 --no-pictures -o "$run"
        tables+=("${measure_of[$preset]}:$variant=$run/registrations.csv")
      done
    done
  done
done
python3 "$af_root/jobs/fit-uncertainty.py" "${tables[@]}" "${judge_option[@]}" --csv "$output/uncertainty.csv" | tee "$output/constants.txt"
say "Table: $output/uncertainty.csv"
