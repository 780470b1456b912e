#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A study on this machine, without Slurm: the commands of jobs/submit.sh, one after the other.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=chain.sh
source "$af_root/jobs/chain.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/run-study.sh STUDY.toml [OPTIONS]        (or jobs/local.sh STUDY.toml [OPTIONS])

Takes every case of a study from its CT to a report: a field for each view, registrations, report.html. It runs the
commands that jobs/submit.sh submits to a cluster, with the options of the same resources file; the numbers of ranks in
that file are for a cluster and are not used here. After a stop (Ctrl-C, kill), run the same command again to continue.

  --output DIR        where everything goes                                                   [./af-run]
  --resources FILE    what the programs are asked for                          [jobs/slurm/resources.sh]
  --ranks N           MPI ranks                                                              [all cores]
  --restart           throw away what earlier runs left unfinished, and do every stage again
  --help
TEXT
}

target="$PWD/af-run" ranks="" restart=no
while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --resources) need_value "$1" $#; resources=$2; shift ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --restart) restart=yes ;;
    --help | -h) usage; exit 0 ;;
    *) take_study "$1" ;;
  esac
  shift
done
open_study
[[ -n "$ranks" ]] || ranks=$(core_count)

read_chain
open_output "$target"
mkdir -p "$output"/{fields,registration}

[[ "$restart" == no ]] || forget_progress

# run_command NAME: runs `command` unless it has been done from the same inputs.
run_command() {
  stage_inputs=$(inputs_of "$bin/af-inspect" "${command[@]}")
  stage "$1" "$(result_of "${command[@]}")" run_ranks "$ranks" "${command[@]}"
}

command=()
for case_name in "${case_names[@]}"; do
  for ((view = 0; view < most_views; ++view)); do
    precompute_command "$case_name" "$view"
    [[ "${command[0]}" != true ]] || continue
    run_command "$(basename "$(result_of "${command[@]}")" .af.h5)"
  done
  evaluate_command "$case_name"
  run_command "registration-$case_name"
done
report_command
"${command[@]}"
