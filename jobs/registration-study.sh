#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Compares registration methods, on clean and on hard X-rays, in one table.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"
# shellcheck source=anatomies.sh
source "$af_root/jobs/anatomies.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/registration-study.sh [OPTIONS]

Simulates one study per anatomy and variant, builds the fields, draws one table of starts per anatomy, registers from
these same starts with every method, and writes methods.md and methods.csv: success for starts 0-8, 8-16 and 16-30 mm
from the true pose, TRE of successes, bias, DRRs, seconds. What is finished is kept, so the same command continues after
a stop, and a method that is added or changed costs only itself. Needs the programs in build/release/bin (or installed).

  --output DIR              where everything goes                                     [./registration-study]
  --ct NAME=PATH            an anatomy: a CT file or DICOM folder; may be repeated
  --phantom NAME            an anatomy: a built-in phantom; may be repeated    [the default skull CT alone]
  --variants LIST           comma separated: clean, stressed (rods,fiducials,heel,noise,degraded-ct),
                            moving (the same and motion), scatter, calibration, or any names that
                            af-simulate --stress takes, joined by +                [clean,stressed,scatter]
  --methods LIST            comma separated, each PRESET[:SIMILARITY[:OPTIMIZER]] or a --chain's    [paper]
                            NAME
  --chain NAME=TEXT         a method of one's own, TEXT as af-evaluate's --chain; the same NAME again
                            makes a portfolio
  --renderer NAME           field, raycast or both                                                  [field]
  --screen                  first, on the first anatomy, clean: every measure with every optimiser that can
                            use it, from 10 starts in each interval up to 16 mm; a table of its own
  --pairs NAME=N            on anatomy NAME, clean: the first N starts in each interval up to 16 mm also by
                            ray casting, for a table of field against ray casting; may be repeated
  --pair-methods LIST       methods of these pairs                                         [those of --methods]
  --roi-px N                side of the regions of interest, detector pixels                         [200]
  --starts-per-interval N   starts in each interval of 2 mm                                            [30]
  --intervals N             intervals of 2 mm, from 0                                                  [15]
  --max-rotation-deg X      range of the fields, degrees                                               [12]
  --max-translation-mm X    range of the fields, mm                                                    [40]
  --quick                   2 starts in each of 8 intervals and small fields: to see whether it works
  --ranks N                 MPI ranks of fields and registrations                               [all cores]
  --seed N                  of everything random                                                        [1]
  --help
TEXT
}

# --- options -----------------------------------------------------------------------------------------------------

output="$PWD/registration-study"
anatomies=() variants=clean,stressed,scatter methods=paper renderer=field
starts_per_interval=30 intervals=15 roi_px=200 with_screen=0 pair_methods="" max_rotation_deg=12 max_translation_mm=40 seed=1
declare -A pairs=() chains=()
field_size=(--uv-nodes 64 --st-nodes 256 --codewords 16384)
ranks=$(core_count)

need_number() { [[ "$2" =~ ^[0-9]+([.][0-9]+)?$ ]] || die 2 "$1 = '$2' must be a number"; }

while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; output=$2; shift ;;
    --ct) need_value "$1" $#; need_ct "$1" "$2"; anatomies+=("${named_ct/=/=ct=}"); shift ;;
    --phantom) need_value "$1" $#; anatomies+=("$2=phantom=$2"); shift ;;
    --variants) need_value "$1" $#; variants=$2; shift ;;
    --methods) need_value "$1" $#; methods=$2; shift ;;
    --chain)
      need_value "$1" $#
      [[ "$2" =~ ^[A-Za-z0-9._-]+=.+$ ]] || die 2 "--chain = '$2' must be NAME=TEXT"
      chains[${2%%=*}]+="${2#*=}"$'\n'
      shift
      ;;
    --screen) with_screen=1 ;;
    --pairs)
      need_value "$1" $#
      [[ "$2" =~ ^[A-Za-z0-9._-]+=[1-9][0-9]*$ ]] || die 2 "--pairs = '$2' must be NAME=N"
      pairs[${2%%=*}]=${2#*=}
      shift
      ;;
    --pair-methods) need_value "$1" $#; pair_methods=$2; shift ;;
    --roi-px) need_value "$1" $#; need_count "$1" "$2"; roi_px=$2; shift ;;
    --renderer) need_value "$1" $#; renderer=$2; shift ;;
    --starts-per-interval) need_value "$1" $#; need_count "$1" "$2"; starts_per_interval=$2; shift ;;
    --intervals) need_value "$1" $#; need_count "$1" "$2"; intervals=$2; shift ;;
    --max-rotation-deg) need_value "$1" $#; need_number "$1" "$2"; max_rotation_deg=$2; shift ;;
    --max-translation-mm) need_value "$1" $#; need_number "$1" "$2"; max_translation_mm=$2; shift ;;
    --quick) starts_per_interval=2 intervals=8 field_size=(--uv-nodes 24 --st-nodes 128 --codewords 2048) ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --seed) need_value "$1" $#; need_seed "$1" "$2"; seed=$2; shift ;;
    --help | -h) usage; exit 0 ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done

# --- stages ------------------------------------------------------------------------------------------------------

bin=$(program_folder)
need_programs "$bin" af-simulate af-precompute af-evaluate af-register

open_output "$output"
# A method that is added or changed, together with the program, repeats only its own runs.
stages_of_any_build=yes

# build_fields NAME STUDY: builds one field per camera, NAME/A.af.h5 and NAME/B.af.h5.
build_fields() {
  local name=$1 study=$2 camera
  for camera in A B; do
    stage "field $camera of $name" "$output/fields/$name/$camera.af.h5" run_ranks "$ranks" \
      "$bin/af-precompute" --study "$study" --camera "$camera" --max-rotation-deg "$max_rotation_deg" \
      --max-translation-mm "$max_translation_mm" "${field_size[@]}" --seed "$seed" -o "$output/fields/$name/$camera.af.h5"
  done
}

if ((${#anatomies[@]} == 0)); then
  stage "the default CT" "$output/skull.mhd" "$af_root/jobs/default-ct.sh" "$output/skull.mhd"
  anatomies=("skull=ct=$output/skull.mhd")
fi
mkdir -p "$output/studies" "$output/fields" "$output/starts" "$output/runs" "$output/screen" "$output/pairs"
IFS=, read -r -a variant_list <<<"$variants"
IFS=, read -r -a method_list <<<"$methods"
IFS=, read -r -a pair_method_list <<<"${pair_methods:-$methods}"

# method_options METHOD: sets method_options to the options for af-evaluate, and method_text to the chains that they mean.
method_options() {
  local preset similarity optimizer text
  method_options=()
  if [[ -n "${chains[$1]:-}" ]]; then
    while IFS= read -r text; do
      method_options+=(--chain "$text")
    done <<<"${chains[$1]%$'\n'}"
  else
    IFS=: read -r preset similarity optimizer <<<"$1"
    method_options=(--preset "$preset" ${similarity:+--similarity "$similarity"} ${optimizer:+--optimizer "$optimizer"})
  fi
  method_text="$("$bin/af-evaluate" method "${method_options[@]}")"
}

# register FOLDER METHOD OPTIONS...: registers the current study, unless a method with the same chains has done so with the
# same options.
register() {
  local folder=$1 method=$2 inputs=$stage_inputs
  shift 2
  method_options "$method"
  stage_inputs="$inputs$method_text"
  stage "$folder" "$output/$folder/summary.json" run_ranks "$ranks" \
    "$bin/af-evaluate" registration --study "$study" "${field_options[@]}" --gold study \
    "${method_options[@]}" --no-uncertainty --seed "$seed" -o "$output/$folder" "$@"
  stage_inputs=$inputs
}

# Every measure is combined with every optimiser that can use it. Local ones that need only values run in the paper's two
# passes. Those that need derivatives, bobyqa for comparison and the costly cma-es run on the pyramid of `fast`. Pattern
# intensity takes seconds per registration, so it runs only as in the paper.
screen_methods() {
  local optimizer needs similarity gradient equations
  while IFS=$'\t' read -r optimizer needs _; do
    while IFS=$'\t' read -r similarity gradient equations _; do
      case "$similarity:$optimizer:$needs" in
        pi:best-neighbor:*) echo "paper:$similarity:$optimizer" ;;
        pi:*) ;;
        *:cma-es:*) echo "fast:$similarity:$optimizer" ;;
        *:bobyqa:*) printf '%s\n' "paper:$similarity:$optimizer" "fast:$similarity:$optimizer" ;;
        *:-) echo "paper:$similarity:$optimizer" ;;
        "$similarity:$optimizer:$gradient" | "$similarity:$optimizer:$equations") echo "fast:$similarity:$optimizer" ;;
      esac
    done < <("$bin/af-register" --list measures)
  done < <("$bin/af-register" --list optimizers)
}

# This is for the clean study.
screen() {
  local method
  stage "starts of the screen" "$output/starts/screen/starts.csv" \
    "$bin/af-evaluate" registration --study "$study" "${field_options[@]}" --gold study \
    --intervals 8 --starts-per-interval 10 --seed "$seed" --starts-only -o "$output/starts/screen"
  for method in $(screen_methods); do
    register "screen/${method//:/-}" "$method" --intervals 8 --starts-per-interval 10 \
      --starts-from "$output/starts/screen/starts.csv"
    screen_folders+=("$output/screen/${method//:/-}")
  done
}

run_folders=() screen_folders=() pair_folders=()
for anatomy in "${anatomies[@]}"; do
  IFS='=' read -r name kind source <<<"$anatomy"
  stage_inputs="$kind $source, ${field_size[*]}, $max_rotation_deg deg, $max_translation_mm mm, $roi_px px: "
  starts=""
  for variant in clean "${variant_list[@]/#clean/}"; do
    [[ -n "$variant" ]] || continue
    stress=$(stress_of "$variant")
    study="$output/studies/$name-$variant/study.toml"
    stage "study $name-$variant" "$study" make_study "$name-$variant" "$kind" "$source" "$stress"
    # Only a degraded CT and a wrong rig need fields of their own.
    fields="$name-clean"
    [[ ! ",$stress," =~ ,(degraded-ct|calibration), ]] || fields="$name-$variant"
    build_fields "$fields" "$output/studies/$fields/study.toml"
    field_options=(--field "A=$output/fields/$fields/A.af.h5" --field "B=$output/fields/$fields/B.af.h5")
    if [[ -z "$starts" ]]; then
      starts="$output/starts/$name/starts.csv"
      stage "starts of $name" "$starts" \
        "$bin/af-evaluate" registration --study "$study" "${field_options[@]}" --gold study \
        --intervals "$intervals" --starts-per-interval "$starts_per_interval" --seed "$seed" --starts-only \
        -o "$output/starts/$name"
    fi
    start_options=(--intervals "$intervals" --starts-per-interval "$starts_per_interval" --starts-from "$starts")
    if [[ "$variant" == clean ]]; then
      if ((with_screen && ${#screen_folders[@]} == 0)); then
        screen
      fi
      if [[ -n "${pairs[$name]:-}" ]]; then
        for method in "${pair_method_list[@]}"; do
          register "pairs/$name-${method//:/-}" "$method" "${start_options[@]}" --renderer both --raycast-intervals 8 \
            --raycast-starts-per-interval "${pairs[$name]}"
          pair_folders+=("$output/pairs/$name-${method//:/-}")
        done
      fi
    fi
    # The clean study is always made, for its fields and starts, but registered only when asked for.
    [[ ",$variants," == *",$variant,"* ]] || continue
    [[ "$renderer" != raycast ]] || field_options=()
    for method in "${method_list[@]}"; do
      register "runs/$name-$variant-${method//:/-}" "$method" "${start_options[@]}" --renderer "$renderer"
      run_folders+=("$output/runs/$name-$variant-${method//:/-}")
    done
  done
done
((${#run_folders[@]} > 0)) || die 2 "--variants = '$variants' and --methods = '$methods' name nothing to do"
"$bin/af-evaluate" compare "${run_folders[@]}" -o "$output/methods.md"
say "Table: $output/methods.md, $output/methods.csv"
if ((${#screen_folders[@]} > 0)); then
  "$bin/af-evaluate" compare --screen "${screen_folders[@]}" -o "$output/screen.md"
  say "Table: $output/screen.md, $output/screen.csv"
fi
if ((${#pair_folders[@]} > 0)); then
  "$bin/af-evaluate" compare "${pair_folders[@]}" -o "$output/pairs.md"
  say "Table: $output/pairs.md, $output/pairs.csv"
fi
