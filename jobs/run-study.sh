#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs a study on this machine, without Slurm: the commands of jobs/submit.sh, one after the other.
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
  --list-stages       run nothing; print a line for each stage, for workflow engines such as jobs/Snakefile. Tabs
                      separate ranks, memory of a rank, time limit, launcher of the ranks in a Slurm job, further options
                      of that job, command, result, and every file on which the result depends
  --help
TEXT
}

target="$PWD/af-run" ranks="" restart=no list=no
while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --resources) need_value "$1" $#; resources=$2; shift ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --restart) restart=yes ;;
    --list-stages) list=yes ;;
    --help | -h) usage; exit 0 ;;
    *) take_study "$1" ;;
  esac
  shift
done
open_study
[[ -n "$ranks" ]] || ranks=$(core_count)

read_chain

quoted() { (($# == 0)) || printf '%q ' "$@"; }

# list_stage KIND NAME: the line of a stage. Its words are quoted for the shell if there are several.
list_stage() {
  local ranks=${1}_ranks memory=${1}_memory time=${1}_time result launch=() read_paths=() path parts
  result=$(result_of "${command[@]}")
  set_launch "$1"
  local line=("${!ranks:-1}" "${!memory}" "${!time}" "$(quoted "${launch[@]}")"
    "$(quoted "${slurm_options[@]}" "--signal=TERM@$stop_seconds")" "$(quoted "${command[@]}")" "$result" "${command[0]}")
  case "$1" in
    report) line+=("${summaries[@]}") ;;
    evaluate) summaries+=("$result") ;;&
    *)
      line+=("$study")
      read_by "$listed_inputs" "${command[@]}"
      ;;
  esac
  for path in "${read_paths[@]}"; do
    parts_of "$path"
    line+=("${parts[@]}")
  done
  local IFS=$'\t'
  printf '%s\n' "${line[*]}"
}

if [[ "$list" == yes ]]; then
  output=$(realpath -m "$target")
  listed_inputs=$("$bin/af-inspect" --list-inputs "$study")
  summaries=()
  each_stage list_stage
  exit
fi
open_output "$target"
mkdir -p "$output"/{fields,registration}

[[ "$restart" == no ]] || forget_progress

# run_stage KIND NAME: runs `command` unless it has been done with the same inputs. The report is always made anew, because
# that is quick.
run_stage() {
  local name=$2
  case "$1" in
    evaluate) name=registration-$2 ;;
    report)
      "${command[@]}"
      return
      ;;
  esac
  stage_inputs=$(inputs_of "$bin/af-inspect" "${command[@]}")
  stage "$name" "$(result_of "${command[@]}")" run_ranks "$ranks" "${command[@]}"
}
each_stage run_stage
