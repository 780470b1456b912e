#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# jobs/Snakefile as a person would use it: a study of two cases, stopped by Ctrl-C amid registrations and started again,
# gives what jobs/run-study.sh gives. Also what it asks a cluster for, and what it refuses. Fields are too coarse for the
# success rates to mean anything.
#
#   snakemake_program.sh ROOT FOLDER_OF_PROGRAMS
set -euo pipefail
root=$1
programs=$2
command -v snakemake >/dev/null || { echo "skipped: snakemake is not installed (jobs/install-packages.sh --with-slurm)"; exit 77; }
# shellcheck source=installed_jobs.sh
source "$(dirname "${BASH_SOURCE[0]}")/installed_jobs.sh"
enter_installed "$root" "$programs"
jobs=$scratch/prefix/libexec/attenuation-fields/jobs

for seed in 1 2; do
  prefix/bin/af-simulate --phantom spine --case "patient-$seed" --seed "$seed" -o "patient-$seed" >out 2>err || fail "af-simulate: $(cat out err)"
done
prefix/bin/af-evaluate join-studies patient-1/study.toml patient-2/study.toml -o study.toml >out 2>err || fail "join-studies: $(cat out err)"
# A registration must last long enough to be stopped after its first rows.
cat >resources.sh <<'TEXT'
slurm_options=(--partition=long)
launcher=srun
srun_options=(--mpi=pmix)
precompute_ranks=2 precompute_memory=2G precompute_time=1-02:03:30
evaluate_ranks=3 evaluate_memory=512 evaluate_time=90
report_memory=2048K report_time=5:30
stop_seconds=60
precompute_options=(--max-rotation-deg 10 --max-translation-mm 30 --slabs 1 --uv-nodes 7 --st-nodes 61 --codewords 64)
evaluate_options=(--preset paper --intervals 4 --starts-per-interval 8 --no-pictures)
TEXT

study=(study=study.toml resources=resources.sh)
# Without job control, a shell and what it starts may ignore Ctrl-C.
by_snakemake() { env --default-signal=INT snakemake --snakefile "$jobs/Snakefile" --cores 2 "$@"; }
# refuse PATTERN WORD...: Snakemake with these words.
refuse() {
  local pattern=$1
  shift
  ! by_snakemake --dry-run "$@" >out 2>&1 || fail "$* was not refused"
  grep -q -- "$pattern" out || fail "$* did not say '$pattern': $(cat out)"
}
refuse 'which study' --config output=refused
refuse 'missing.toml: no such file' --config study=missing.toml output=refused
# Before a field is made: the evaluation needs a gold pose.
grep -v -e gold_room_from_ct -e fiducials study.toml >without-gold.toml
no_gold="case 'patient-1' has neither three fiducials that two views show nor gold_room_from_ct: state either"
refuse "$no_gold" --config study=without-gold.toml output=refused
for script in run-study.sh submit.sh; do
  words=(without-gold.toml --output refused) refused=0
  [[ "$script" != submit.sh ]] || words+=(--dry-run)
  "$jobs/$script" "${words[@]}" >out 2>&1 || refused=$?
  if ((refused != 3)) || ! grep -q "$no_gold" out; then
    fail "$script did not refuse a study without a gold pose: $(cat out)"
  fi
done
[[ ! -e refused ]] || fail "a refused study left $(find refused)"

# --cores limits threads to two, but a cluster is asked for three ranks.
by_snakemake --dry-run --config output='by snakemake' "${study[@]}" >out 2>&1 || fail "--dry-run: $(cat out)"
[[ ! -e 'by snakemake' ]] || fail "a dry run left $(find 'by snakemake')"
# asks RULE NUMBER WORD...: NUMBER jobs of the rule are to run, and each asks for these words.
asks() {
  local rule=$1 number=$2 asked word
  shift 2
  asked=$(sed -n "/^rule $rule:/,/^\$/p" out)
  for word in "$@"; do
    (($(grep -cE -- "[ ,]$word(,|\$| )" <<<"$asked") == number)) || fail "not $number jobs of $rule ask for $word: $(cat out)"
  done
}
asks precompute 4 'threads: 2' tasks=2 mem_mb=4096 mem_mb_per_cpu=2048 runtime=1564 'slurm_extra=--partition=long --signal=TERM@60'
asks evaluate 2 'threads: 2' tasks=3 mem_mb=1024 mem_mb_per_cpu=512 runtime=90 'mpi=srun --mpi=pmix --kill-on-bad-exit=1'
asks report 1 tasks=1 mem_mb=2 runtime=6

# A terminal's Ctrl-C reaches Snakemake, mpirun and its ranks alike. Here a process group (set -m) gets it after the first
# rows.
set -m
by_snakemake --config output='by snakemake' "${study[@]}" >out 2>&1 &
group=$!
set +m
until grep -qs . 'by snakemake'/registration/*.progress/*.records; do
  kill -0 "$group" 2>/dev/null || fail "Snakemake ended before a registration could be stopped: $(cat out)"
  sleep 0.05
done
kill -INT -- "-$group"
! wait "$group" || fail "Snakemake had done all before it was stopped"
[[ ! -e 'by snakemake/report.html' ]] || fail "there is a report of a stopped study"
stat --format '%n %y' 'by snakemake'/fields/*.af.h5 >made-before

by_snakemake --config output='by snakemake' "${study[@]}" >out 2>&1 || fail "Snakemake after a stop: $(cat out 'by snakemake'/logs/*)"
[[ -s 'by snakemake/report.html' ]] || fail "no report: $(cat out)"
grep -q 'goes on after' 'by snakemake'/logs/registration-patient-?.log || fail "no registration went on after the stop"
! stat --format '%n %y' 'by snakemake'/fields/*.af.h5 | grep -Fxvf - made-before || fail "a field was made twice"
by_snakemake --config output='by snakemake' "${study[@]}" >out 2>&1 || fail "the same command again: $(cat out)"
grep -q 'Nothing to be done' out || fail "a finished stage ran again: $(cat out)"

"$jobs/run-study.sh" study.toml --resources resources.sh --output by-script --ranks 2 >out 2>err || fail "run-study.sh: $(cat out err)"
# Rows without their last column, the seconds.
rows_of() { sed 's/,[^,]*$//' "$1"/registration/patient-*/registrations.csv; }
payloads_of() { prefix/bin/af-inspect --json "$1"/fields/*.af.h5 | grep payload_sha256; }
(($(rows_of by-script | wc -l) == 66 && $(payloads_of by-script | wc -l) == 4)) || fail "not two cases of 32 starts and a header, and four fields"
[[ "$(rows_of 'by snakemake')" == "$(rows_of by-script)" ]] || fail "the rows differ: $(diff <(rows_of 'by snakemake') <(rows_of by-script))"
[[ "$(payloads_of 'by snakemake')" == "$(payloads_of by-script)" ]] || fail "the fields differ"
