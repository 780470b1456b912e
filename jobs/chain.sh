# shellcheck shell=bash disable=SC2034,SC2154  # variables pass between this file and its caller
# SPDX-License-Identifier: Apache-2.0
# The stages of a study's chain: a field for every view, the registrations of every case, a report. jobs/submit.sh (on
# Slurm) and jobs/run-study.sh (on this machine, and for jobs/Snakefile) source this file, so that all run the same
# commands. The caller has sourced lib.sh and sets output, and maybe resources.

study="" resources="$af_root/jobs/slurm/resources.sh"

# take_study WORD: takes WORD as the study, or refuses it as an unknown option.
take_study() {
  [[ "$1" != -* ]] || die 2 "unknown option '$1' (try --help)"
  [[ -z "$study" ]] || die 2 "one study at a time: '$study' and '$1' were given"
  study=$1
}

# open_study: checks the study and the resources, and reads the resources.
open_study() {
  [[ -n "$study" ]] || die 2 "which study? Give a study.toml (try --help)"
  [[ -f "$study" ]] || die 4 "$study: no such file"
  [[ -f "$resources" ]] || die 4 "--resources $resources: no such file"
  study=$(realpath "$study")
  bin=$(program_folder)
  need_programs "$bin" af-precompute af-evaluate af-inspect
  # shellcheck source=slurm/resources.sh
  source "$resources"
}

declare -A cameras_of=()
case_names=() most_views=0

# read_chain: reads the cases and cameras of the study, and reports what is wrong with it.
read_chain() {
  local views case_name camera gold view_count
  # There is one line per view: case, camera, where the gold pose is from.
  views=$("$bin/af-inspect" --list-views "$study")
  while IFS=$'\t' read -r case_name camera gold; do
    # The evaluation would refuse the case, but only once its fields are made.
    [[ "$gold" != none ]] ||
      die 3 "$study: case '$case_name' has neither three fiducials that two views show nor gold_room_from_ct: state either, or register it with af-register, which needs neither"
    [[ -v cameras_of["$case_name"] ]] || case_names+=("$case_name")
    cameras_of[$case_name]+="$camera"$'\n'
  done <<<"$views"
  for case_name in "${case_names[@]}"; do
    view_count=$(grep -c . <<<"${cameras_of[$case_name]}")
    ((view_count <= most_views)) || most_views=$view_count
  done
}

# forget_progress: removes what earlier runs of this chain left unfinished in `output`, so that every stage is done
# again.
forget_progress() {
  rm -rf "$output"/.stages/*.done "$output"/fields/*.progress "$output"/registration/*.progress
}

# Each of these sets `command`. precompute_command CASE VIEW: for the camera of the case's VIEW-th view; `true` when the
# case has fewer views.
precompute_command() {
  local case_name=$1 view=$2 camera
  camera=$(sed -n "$((view + 1))p" <<<"${cameras_of[$case_name]}")
  command=(true)
  [[ -n "$camera" ]] || return 0
  command=("$bin/af-precompute" --study "$study" --case "$case_name" --camera "$camera"
    "${precompute_options[@]}" -o "$output/fields/$case_name-$camera.af.h5")
}

evaluate_command() {
  local case_name=$1 camera fields=()
  while IFS= read -r camera; do
    fields+=(--field "$camera=$output/fields/$case_name-$camera.af.h5")
  done <<<"${cameras_of[$case_name]%$'\n'}"
  command=("$bin/af-evaluate" registration --study "$study" --case "$case_name" "${fields[@]}"
    "${evaluate_options[@]}" -o "$output/registration/$case_name")
}

report_command() { command=("$bin/af-evaluate" report -o "$output/report.html" "$output/registration"); }

# each_stage FUNCTION: calls FUNCTION KIND NAME for every stage, after those whose results it reads, with its command in
# `command`.
each_stage() {
  local case_name view command
  for case_name in "${case_names[@]}"; do
    for ((view = 0; view < most_views; ++view)); do
      precompute_command "$case_name" "$view"
      [[ "${command[0]}" != true ]] || continue
      "$1" precompute "$(basename "$(result_of "${command[@]}")" .af.h5)"
    done
    evaluate_command "$case_name"
    "$1" evaluate "$case_name"
  done
  report_command
  "$1" report report
}
