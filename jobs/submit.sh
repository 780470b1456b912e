#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs a study on a Slurm cluster: fields, registrations and report as a chain of jobs.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=chain.sh
source "$af_root/jobs/chain.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/submit.sh STUDY.toml [OPTIONS]

Submits a chain of Slurm jobs and returns: one array per camera with one MPI job per case that computes its field, an
array over the cases that registers them, each as soon as its own fields are there, and a report when all have ended. A
job that Slurm stops (time limit, pre-emption) saves what is finished and is queued again. Run the same command again to
submit the same chain; work that the same commands finished is not done twice.

  --output DIR        where everything goes; must be seen by all nodes                        [./af-run]
  --resources FILE    ranks, memory, time limits, partition, programs' options   [jobs/slurm/resources.sh]
  --status            what each task of the chain in DIR is at, and nothing else; needs no study
  --restart           throw away what earlier chains left unfinished there, and do every stage again
  --dry-run           print the chain and its commands, submit nothing
  --help
TEXT
}

# --- options -----------------------------------------------------------------------------------------------------

output="$PWD/af-run" dry_run=no restart=no status=no
while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; output=$2; shift ;;
    --resources) need_value "$1" $#; resources=$2; shift ;;
    --restart) restart=yes ;;
    --status) status=yes ;;
    --dry-run) dry_run=yes ;;
    --help | -h) usage; exit 0 ;;
    *) take_study "$1" ;;
  esac
  shift
done

# ask_queue: sets queue, a line "JOB_TASK STATE" for each task that the user has in Slurm.
ask_queue() {
  queue=$(squeue --me --array --noheader --format '%F_%K %T') || die 1 "squeue does not say what is queued (see above)"
}

# task_state STAGE TASK JOB: the state of one array task, in a word or two.
task_state() {
  local stage=$1 task=$2 job=$3 log="$output/logs/$1-$2.log" state
  state=$(sed -n "s/^${job}_$task //p" <<<"$queue")
  if [[ -n "$state" ]]; then
    echo "${state,,}"
  elif [[ -f "$output/.stages/$stage-$task.done" || ("$stage" == report && -f "$output/report.html") ]]; then
    echo "done"
  elif [[ -s "$log" ]]; then
    echo "ended: $(tail -n 1 "$log" | cut -c 1-80)"
  else
    echo "not begun"
  fi
}

# print_status: a line for each task, with stage, case, state, how often it was queued again, and its log.
print_status() {
  local stage job line task case_name restarts
  [[ -f "$output/jobs/submitted" ]] || die 4 "$output/jobs/submitted: no such file: no chain was submitted there"
  ask_queue
  while read -r job stage; do
    task=0
    while IFS= read -r line; do
      case_name=$(sed -n 's/.* --case \([^ ]*\).*/\1/p' <<<"$line")
      restarts=$(grep -c '^[-0-9]* [:0-9]* job .* restart [1-9]' "$output/logs/$stage-$task.log" 2>/dev/null || true)
      [[ "$line" == "true "* ]] ||
        printf '%-14s %-20s %-12s %s\n' "$stage" "${case_name:--}" "$(task_state "$stage" "$task" "$job")" \
          "queued again ${restarts:-0} times, logs/$stage-$task.log"
      task=$((task + 1))
    done <"$output/jobs/$stage.commands"
  done <"$output/jobs/submitted"
}

if [[ "$status" == yes ]]; then
  output=$(realpath -m "$output")
  print_status
  exit 0
fi
open_study
[[ "$dry_run" == yes ]] || command -v sbatch >/dev/null || die 1 "sbatch is missing: this is no Slurm cluster (jobs/local.sh STUDY.toml needs none)"

read_chain

# --- the chain ---------------------------------------------------------------------------------------------------

# submit STAGE COMMANDS RANKS MEMORY TIME [DEPENDENCY]: submits one array task per line of COMMANDS, and sets job_id.
submit() {
  local stage=$1 commands=$2 ranks=$3 memory=$4 time=$5 dependency=${6:-}
  local command=(sbatch --parsable "--job-name=af-$stage" "--ntasks=$ranks" "--mem-per-cpu=$memory" "--time=$time"
    "--signal=B:TERM@$stop_seconds" --requeue --open-mode=append "--output=$output/logs/$stage-%a.log"
    "--array=0-$(($(wc -l <<<"$commands") - 1))" "${slurm_options[@]}")
  [[ -z "$dependency" ]] || command+=("--dependency=$dependency" --kill-on-invalid-dep=yes)
  command+=("$af_root/jobs/slurm/stage.sbatch" "$output" "$stage")
  if [[ "$dry_run" == yes ]]; then
    job_id="JOB_OF_$stage"
    say "${command[*]}"
    say "    ${commands//$'\n'/$'\n'    }"
    return
  fi
  printf '%s\n' "$commands" >"$output/jobs/$stage.commands"
  job_id=$("${command[@]}") || die 1 "sbatch refused stage '$stage' (see above); the stages before it are submitted"
  job_id=${job_id%%;*}
  echo "$job_id $stage" >>"$output/jobs/submitted"
  say "$stage: job $job_id"
}

# typed FUNCTION [ARGUMENT...]: prints the command that FUNCTION sets, as a user would type it.
typed() {
  local command=()
  "$@"
  printf '%q ' "${command[@]}"
  printf '\n'
}

# lines FUNCTION [ARGUMENT]: prints the commands of FUNCTION CASE [ARGUMENT] for all cases.
lines() {
  local case_name
  for case_name in "${case_names[@]}"; do
    typed "$1" "$case_name" "${@:2}"
  done
}

# jobs_of_output: the jobs of this folder that Slurm still has.
jobs_of_output() { cut -d _ -f 1 <<<"$queue" | sort -u | grep -Fx -f <(cut -d ' ' -f 1 "$output/jobs/submitted") || true; }

output=$(realpath -m "$output")
if [[ "$dry_run" == no ]]; then
  mkdir -p "$output"/{fields,registration,logs,jobs,.stages}
  if [[ -f "$output/jobs/submitted" ]]; then
    ask_queue
    queued=$(jobs_of_output)
  fi
  [[ -z "${queued:-}" ]] || die 3 "$output: an earlier chain is still in the queue: wait for it, or: scancel ${queued//$'\n'/ }"
  rm -f "$output"/.stages/*.fruitless "$output/jobs/submitted"
  [[ "$restart" == no ]] || forget_progress
  cp "$resources" "$output/jobs/resources.sh"
  cp "$af_root/jobs/stages.sh" "$output/jobs/stages.sh"
fi

# A case waits only for its own fields: aftercorr means the task of the same number.
after_fields=""
for ((view = 0; view < most_views; ++view)); do
  submit "precompute-$((view + 1))" "$(lines precompute_command "$view")" "$precompute_ranks" "$precompute_memory" "$precompute_time"
  after_fields+="${after_fields:+,}aftercorr:$job_id"
done
submit evaluate "$(lines evaluate_command)" "$evaluate_ranks" "$evaluate_memory" "$evaluate_time" "$after_fields"
# The report shows what there is even when a case failed, and says which cases it has.
submit report "$(typed report_command)" 1 "$report_memory" \
  "$report_time" "afterany:$job_id"
[[ "$dry_run" == yes ]] || say "Watch: squeue --me; or: jobs/submit.sh --status --output $(printf '%q' "$output"); logs: $output/logs; at the end: $output/report.html"
