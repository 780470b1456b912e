#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes a study of four simulated patients: a patient's skull CT and three phantoms.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/four-patients.sh [OPTIONS]

Simulates X-rays, fiducials and true poses of four patients in the treatment room and writes one study.toml with four
cases: skull (the default CT), spine, pelvis and head (phantoms). Needs the programs in build/release/bin (or installed).

  --output DIR     where everything goes                                                   [./four-patients]
  --ct NAME=PATH   one more patient: a CT file or DICOM folder, such as thorax=thorax.nii.gz; may be repeated
  --patients LIST  comma separated: of the four only these                        [skull,spine,pelvis,head]
  --metal          phantoms with implants: screws and rods, a hip prosthesis, fillings and a plate
  --seed N         of true poses, noise and detections                                                   [1]
  --help
TEXT
}

target="$PWD/four-patients" patients=skull,spine,pelvis,head seed=1
metal_option=() cts=()
while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --ct) need_value "$1" $#; need_ct "$1" "$2"; cts+=("$named_ct"); shift ;;
    --patients) need_value "$1" $#; patients=$2; shift ;;
    --metal) metal_option=(--metal) ;;
    --seed) need_value "$1" $#; need_seed "$1" "$2"; seed=$2; shift ;;
    --help | -h) usage; exit 0 ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done

bin=$(program_folder)
need_programs "$bin" af-simulate af-evaluate
open_output "$target"
studies=()
# simulate NAME OPTIONS...
simulate() {
  local name=$1
  shift
  stage "simulate-$name" "$output/$name/study.toml" \
    "$bin/af-simulate" "$@" --case "$name" --rig treatment-room --seed "$seed" \
    --force -o "$output/$name"
  studies+=("$output/$name/study.toml")
}

IFS=, read -r -a chosen <<<"$patients"
for patient in "${chosen[@]}"; do
  case "$patient" in
    skull)
      stage skull-ct "$output/skull.mhd" "$af_root/jobs/default-ct.sh" "$output/skull.mhd"
      simulate skull --ct "$output/skull.mhd"
      ;;
    spine | pelvis | head) simulate "$patient" --phantom "$patient" "${metal_option[@]}" ;;
    *) die 2 "--patients = '$patients' must name some of skull, spine, pelvis, head" ;;
  esac
done
for ct in "${cts[@]}"; do
  simulate "${ct%%=*}" --ct "${ct#*=}"
done
stage join "$output/study.toml" "$bin/af-evaluate" join-studies "${studies[@]}" -o "$output/study.toml"
say "Study: $output/study.toml"
