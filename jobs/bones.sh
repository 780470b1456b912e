#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Registers single bones among others, drawn at random (bone_scenes.py), with --preset bone. It measures success, and how
# well registration knows its errors.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/bones.sh [OPTIONS]

Draws bones (a shaft, a head, a process, a notch; shapes, densities and poses differ), makes a CT of each alone and two X-rays that
also show other bones and soft tissue, registers from starts about the true pose by ray casting with --preset bone, and writes
population.md, CSVs and figures with intervals over bones. After a stop, run the same command again. Then, for predicted errors:
jobs/uncertainty.py DIR --presets bone --variants clean. Needs the programs in build/release/bin (or installed), and python3-numpy.

  --output DIR         where everything goes                                                        [./bones]
  --bones N            how many                                                                          [40]
  --first N            number, and seed, of the first one                                                 [1]
  --intervals N        intervals of initial TRE of 2 mm, from 0                                          [15]
  --python PROGRAM     a Python with numpy                                                 [/usr/bin/python3]
  --ranks N            MPI ranks of registrations                                                 [all cores]
  --seed N             of starts                                                                          [1]
  --help
TEXT
}

target="$PWD/bones" bones=40 first=1 intervals=15 python=/usr/bin/python3 ranks=$(core_count) seed=1
while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --bones) need_value "$1" $#; need_count "$1" "$2"; bones=$2; shift ;;
    --first) need_value "$1" $#; need_count "$1" "$2"; first=$2; shift ;;
    --intervals) need_value "$1" $#; need_count "$1" "$2"; intervals=$2; shift ;;
    --python) need_value "$1" $#; python=$2; shift ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --seed) need_value "$1" $#; need_seed "$1" "$2"; seed=$2; shift ;;
    --help | -h) usage; exit 0 ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done

bin=$(program_folder)
need_programs "$bin" af-drr af-evaluate
"$python" -c "import numpy" 2>/dev/null || die 1 "$python has no numpy: jobs/install-packages.sh installs it"
open_output "$target"
mkdir -p "$output"/{studies,runs}
# shellcheck disable=SC2034  # for stage()
stages_of_any_build=yes stage_inputs=$(sha256sum <"$af_root/jobs/bone_scenes.py")

# make_scene NAME SEED: makes a scene, after removing what an interrupted run left of it.
make_scene() {
  rm -rf "$output/studies/$1"
  "$python" "$af_root/jobs/bone_scenes.py" --seed "$2" --case "$1-p1" --af-drr "$bin/af-drr" -o "$output/studies/$1"
}

for ((number = first; number < first + bones; ++number)); do
  name=$(printf 'bone-%03d' "$number")
  stage "scene $name" "$output/studies/$name/study.toml" make_scene "$name" "$number"
  stage "clean-2-bone/$name" "$output/runs/clean-2-bone/$name/summary.json" run_ranks "$ranks" "$bin/af-evaluate" registration \
    --study "$output/studies/$name/study.toml" --gold study --renderer raycast --preset bone --intervals "$intervals" \
    --starts-per-interval 1 --seed "$seed" --no-pictures -o "$output/runs/clean-2-bone/$name"
done
"$bin/af-evaluate" population --condition "clean-2-bone=$output/runs/clean-2-bone" --seed "$seed" -o "$output/tables"
