# shellcheck shell=bash disable=SC2034,SC2154  # variables pass between this file and its caller
# SPDX-License-Identifier: Apache-2.0
# What a study's chain consists of: a field for every view, the registrations of every case, a report. Sourced by
# jobs/submit.sh (on Slurm) and jobs/run-study.sh (on this machine), so that both run the same commands. The caller has
# sourced lib.sh and a resources file, and has set study, output and bin.

declare -A cameras_of=()
case_names=() most_views=0

# read_chain: cases and cameras of the study; says what is wrong with it, if anything.
read_chain() {
  local views case_name camera view_count
  # One line per view: case, camera.
  views=$("$bin/af-inspect" --list-views "$study")
  while IFS=$'\t' read -r case_name camera; do
    [[ -v cameras_of["$case_name"] ]] || case_names+=("$case_name")
    cameras_of[$case_name]+="$camera"$'\n'
  done <<<"$views"
  for case_name in "${case_names[@]}"; do
    view_count=$(grep -c . <<<"${cameras_of[$case_name]}")
    ((view_count <= most_views)) || most_views=$view_count
  done
}

# Each of these sets `command`. precompute_command CASE VIEW: of the VIEW-th camera, `true` when the case has not so many.
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
