#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs jobs/submit.sh on a real Slurm of one node: a study of two patients from CT to report. It runs once undisturbed. It
# runs again while Slurm's TERM stops a field and a case's registrations, which are queued again and finished. Both runs
# must give the same, and so must jobs/Snakefile on the same Slurm, with one of its jobs stopped.
# Usage: chain_test.sh [SCRATCH_FOLDER]. Needs root, the release build and jobs/install-packages.sh --with-slurm.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/../../jobs/lib.sh"

scratch=${1:-$(mktemp -d)}
mkdir -p "$scratch"
slurm="$af_root/tests/slurm/one-node-slurm.sh"
bin=$(program_folder)
need_programs "$bin" af-simulate af-evaluate af-inspect af-precompute
command -v snakemake >/dev/null || die 1 "snakemake is missing: jobs/install-packages.sh --with-slurm"

finish() {
  local status=$?
  "$slurm" stop "$scratch/slurm" || true
  # A folder that cannot be removed must not change the exit code.
  if ((status != 0)) || ! rm -rf "$scratch"; then
    say "What is left for a look: $scratch"
  fi
  exit "$status"
}
trap finish EXIT
"$slurm" start "$scratch/slurm"
export SLURM_CONF=$scratch/slurm/slurm.conf OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1

fail() {
  squeue || true
  tail -n 8 "$scratch"/run-*/logs/*.log || true
  die 1 "$*"
}

# wait_until WHAT COMMAND...: waits, long enough for a machine that is busy with other work.
wait_until() {
  local deadline=$((SECONDS + 1200)) what=$1
  shift
  until "$@"; do
    ((SECONDS < deadline)) || fail "waited too long for $what"
    sleep 0.3
  done
}

# Without PMI each task would take itself for the whole job. A single task needs no PMI.
refused=0
srun -n 2 --mpi=none "$bin/af-inspect" c-arm-12in >"$scratch/without-pmi.log" 2>&1 || refused=$?
if ((refused != 2)) || ! grep -q 'SLURM_STEP_NUM_TASKS=2' "$scratch/without-pmi.log"; then
  fail "two tasks without PMI were not refused"
fi
srun -n 1 --mpi=none "$bin/af-inspect" c-arm-12in >"$scratch/one-task.log" || fail "one task without PMI does not run"

# The two patients are the spine phantom at two poses.
for seed in 1 2; do
  "$bin/af-simulate" --phantom spine --case "patient-$seed" --seed "$seed" -o "$scratch/patient-$seed" >"$scratch/simulate.log"
done
"$bin/af-evaluate" join-studies "$scratch/patient-1/study.toml" "$scratch/patient-2/study.toml" -o "$scratch/study.toml"

# The work lasts some seconds, so that it is under way when it is stopped.
cat >"$scratch/resources.sh" <<TEXT
slurm_options=()
launcher=${LAUNCHER:-srun}
srun_options=(--mpi=pmix)
mpirun_options=(--oversubscribe)
precompute_ranks=2 precompute_memory=100M precompute_time=00:10:00
evaluate_ranks=2 evaluate_memory=100M evaluate_time=00:10:00
report_memory=100M report_time=00:05:00
stop_seconds=5
most_requeues=3 most_fruitless=3
precompute_options=(--max-rotation-deg 10 --max-translation-mm 30 --uv-nodes 30 --st-nodes 96 --codewords 2048 --caster trilinear)
evaluate_options=(--preset paper --starts-per-interval 8)
TEXT

# Slurm may fail to launch a step while srun still ends with 0. The first evaluation meets that here.
mkdir "$scratch/bin"
cat >"$scratch/bin/srun" <<TEXT
#!/usr/bin/env bash
if [[ "\$*" == *" registration "* ]] && mkdir "$scratch/lost-step" 2>/dev/null; then
  echo "srun: error: task 0 launch failed: Unspecified error" >&2
  exit 0
fi
exec "$(command -v srun)" "\$@"
TEXT
chmod +x "$scratch/bin/srun"
export PATH=$scratch/bin:$PATH

# submit RUN: submits the chain, output in RUN.
submit() { "$af_root/jobs/submit.sh" "$scratch/study.toml" --resources "$scratch/resources.sh" --output "$1"; }

queue_is_empty() {
  local queue
  queue=$(squeue --noheader) && [[ -z "$queue" ]]
}

# One empty answer is no proof: a controller has given one while jobs ran.
no_jobs_left() { queue_is_empty && sleep 2 && queue_is_empty; }

# Rows without their last column, the seconds.
rows_of() { sed 's/,[^,]*$//' "$1"/registration/patient-*/registrations.csv; }
payloads_of() { "$bin/af-inspect" --json "$1"/fields/*.af.h5 | grep payload_sha256; }

undisturbed=$scratch/run-undisturbed disturbed=$scratch/run-disturbed
submit "$undisturbed"
wait_until "the undisturbed chain" no_jobs_left
[[ -s "$undisturbed/report.html" ]] || fail "no report.html after the undisturbed chain"
if [[ "${LAUNCHER:-srun}" == srun ]]; then
  grep -q 'had not started the program (attempt 1 of 3)' "$undisturbed"/logs/evaluate-?.log ||
    fail "a step that was not launched went unseen"
fi

# stop_job NAME PROGRESS: sends TERM to the batch script once PROGRESS exists.
stop_job() {
  local name=$1 progress=$2 job
  wait_until "$progress" test -e "$progress"
  job=$(squeue --noheader --name "$name" --states RUNNING --format %A | head -n 1)
  [[ -n "$job" ]] || fail "$name ended before it could be stopped"
  scancel --signal=TERM --batch "$job"
  wait_until "the stop of $name" grep -q 'exit code 75' "$disturbed/logs/${name#af-}-0.log"
}

status_of() { "$af_root/jobs/submit.sh" --status --output "$disturbed"; }
submit "$disturbed"
(($(status_of | wc -l) == 7)) || fail "--status does not list seven tasks"
refused=0
submit "$disturbed" >"$scratch/second.log" 2>&1 || refused=$?
if ((refused != 3)) || ! grep -q 'still in the queue' "$scratch/second.log"; then
  fail "a second chain in the same folder was not refused"
fi
stop_job af-precompute-1 "$disturbed/fields/patient-1-A.af.h5.progress/units.0000-000000.records"
stop_job af-evaluate "$disturbed/registration/patient-1.progress/patient-1-field.0000-000000.records"
wait_until "the disturbed chain" no_jobs_left
[[ -s "$disturbed/report.html" ]] || fail "no report.html after the disturbed chain"
(($(status_of | grep -c ' done ') == 7)) || fail "--status does not say that all is done"
for stage in precompute-1 evaluate; do
  grep -q 'restart 1' "$disturbed/logs/$stage-0.log" || fail "$stage was not queued again"
done
[[ "$(payloads_of "$disturbed")" == "$(payloads_of "$undisturbed")" ]] || fail "the fields differ"
[[ "$(rows_of "$disturbed")" == "$(rows_of "$undisturbed")" ]] || fail "the rows differ"

# While squeue does not answer, nobody knows whether the chain still runs.
refused=0
mkdir "$scratch/broken"
printf '#!/bin/sh\nexit 1\n' >"$scratch/broken/squeue"
chmod +x "$scratch/broken/squeue"
PATH=$scratch/broken:$PATH submit "$disturbed" >"$scratch/third.log" 2>&1 || refused=$?
if ((refused != 1)) || ! grep -q 'squeue does not say what is queued' "$scratch/third.log"; then
  fail "a second chain was not refused while squeue does not answer"
fi

# When the chain runs again, nothing is left to do.
submit "$disturbed"
wait_until "the chain that was done before" no_jobs_left
[[ "$(grep -l 'done before' "$disturbed"/logs/*.log | wc -l)" == 6 ]] || fail "something was done twice"

# A job that its owner cancels does not come back. The next chain continues from what it had finished.
rm "$disturbed/registration/patient-2/summary.json"
submit "$disturbed"
rows=$disturbed/registration/patient-2.progress/patient-2-field.0000-000000.records
wait_until "$rows" test -s "$rows"
scancel --name af-evaluate
scancel --name af-report
wait_until "the end of what was cancelled" no_jobs_left
sleep 3
no_jobs_left || fail "a cancelled job was queued again"
[[ ! -e "$disturbed/registration/patient-2/summary.json" ]] || fail "the cancelled job had ended before"
submit "$disturbed"
wait_until "the chain after a cancelled one" no_jobs_left
grep -q 'goes on after' "$disturbed/logs/evaluate-1.log" || fail "nothing of the cancelled job was taken over"
[[ "$(rows_of "$disturbed")" == "$(rows_of "$undisturbed")" ]] || fail "the rows differ after the cancelled job"

# Snakemake must give the same. The job that runs when the first rows appear gets the TERM that Slurm sends before a time
# limit, and is submitted again.
by_snakemake=$scratch/run-snakemake
mkdir -p "$scratch/profile" "$by_snakemake/logs"
cat >"$scratch/profile/config.yaml" <<TEXT
slurm: true
jobs: 4
restart-times: 3
max-status-checks-per-second: 1
TEXT
(cd "$scratch" && USER=$(id -un) exec snakemake --snakefile "$af_root/jobs/Snakefile" --profile "$scratch/profile" \
  --config study=study.toml resources=resources.sh output="$by_snakemake") >"$by_snakemake/logs/snakemake.log" 2>&1 &
snakemake=$!
if [[ "${LAUNCHER:-srun}" == srun ]]; then
  rows=$by_snakemake/registration/patient-1.progress/patient-1-field.0000-000000.records
  wait_until "$rows" test -s "$rows"
  scancel --signal=TERM --state=RUNNING --user="$(id -un)"
fi
wait "$snakemake" || fail "snakemake ended with $?"
[[ -s "$by_snakemake/report.html" ]] || fail "no report.html of Snakemake's run"
if [[ "${LAUNCHER:-srun}" == srun ]]; then
  grep -q 'goes on after' "$by_snakemake/logs/registration-patient-1.log" || fail "Snakemake's job did not go on after its stop"
fi
[[ "$(payloads_of "$by_snakemake")" == "$(payloads_of "$undisturbed")" ]] || fail "the fields of Snakemake's run differ"
[[ "$(rows_of "$by_snakemake")" == "$(rows_of "$undisturbed")" ]] || fail "the rows of Snakemake's run differ"

# A run without Slurm must give the same, too.
local_run=$scratch/run-local
"$af_root/jobs/local.sh" "$scratch/study.toml" --resources "$scratch/resources.sh" --output "$local_run" --ranks 2
[[ -s "$local_run/report.html" ]] || fail "no report.html of the local run"
[[ "$(payloads_of "$local_run")" == "$(payloads_of "$undisturbed")" ]] || fail "the fields of the local run differ"
[[ "$(rows_of "$local_run")" == "$(rows_of "$undisturbed")" ]] || fail "the rows of the local run differ"
say "chain_test: a stopped chain gave the same fields and rows as an undisturbed one, as Snakemake, and as jobs/local.sh"
