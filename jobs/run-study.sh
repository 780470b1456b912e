#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A study on this machine, without Slurm: the commands of jobs/submit.sh, one after the other.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=chain.sh
source "$af_root/jobs/chain.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/run-study.sh STUDY.toml [OPTIONS]        (or jobs/local.sh STUDY.toml [OPTIONS])

Takes every case of a study from its CT to a report: a field for each view, registrations, report.html. The same
commands as jobs/submit.sh submits to a cluster, with the options of the same resources file; its numbers of ranks are
those of a cluster and not used here. Stopped (Ctrl-C, kill), it goes on when the same command is run again.

  --output DIR        where everything goes                                                   [./af-run]
  --resources FILE    what the programs are asked for                          [jobs/slurm/resources.sh]
  --ranks N           MPI ranks                                                              [all cores]
  --help
TEXT
}

target="$PWD/af-run" ranks=""
while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --resources) need_value "$1" $#; resources=$2; shift ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
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

# result_of COMMAND...: what stands behind its -o.
result_of() {
  while [[ "$1" != -o ]]; do shift; done
  echo "$2"
}

# What a stage reads beside its command line; the programs themselves check CTs and X-rays when they go on.
once_inputs=$(sha256sum <"$study")
command=()
for case_name in "${case_names[@]}"; do
  for ((view = 0; view < most_views; ++view)); do
    precompute_command "$case_name" "$view"
    [[ "${command[0]}" != true ]] || continue
    field=$(result_of "${command[@]}")
    once "$(basename "$field" .af.h5)" "$field" run_ranks "$ranks" "${command[@]}"
  done
  evaluate_command "$case_name"
  once "registration-$case_name" "$(result_of "${command[@]}")/summary.json" run_ranks "$ranks" "${command[@]}"
done
report_command
"${command[@]}"
