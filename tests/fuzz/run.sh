#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the fuzzers with Clang and runs them, one after the other.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/../../jobs/lib.sh"

usage() {
  cat <<'TEXT'
Usage: tests/fuzz/run.sh [--seconds N] [--output FOLDER] [--no-build] [--help] [NAME...]

Runs libFuzzer on our readers: rig, study, scan, csv, pose, found_poses, image, dicom, dicom_xray, dicom_ct, inspect, journal, rows,
field_values, field_file, shards, or those named. Needs clang-14. Corpora grow in FOLDER/NAME/corpus, the log is FOLDER/NAME/log, inputs that are findings are
FOLDER/NAME/crash-*, oom-* or timeout-*. Exit code 1 when there was a finding.

  --seconds N      for each reader (default: 1200)
  --output FOLDER  default: build/fuzz/findings
  --no-build       build/fuzz is up to date
TEXT
}

seconds=1200 output=$af_root/build/fuzz/findings build=yes
names=()
while (($# > 0)); do
  case "$1" in
    --seconds) seconds=$2; shift ;;
    --output) output=$2; shift ;;
    --no-build) build=no ;;
    --help | -h) usage; exit 0 ;;
    -*) die 2 "unknown option '$1' (try --help)" ;;
    *) names+=("$1") ;;
  esac
  shift
done
((${#names[@]} > 0)) || names=(rig study scan csv pose found_poses image dicom dicom_xray dicom_ct inspect journal rows field_values field_file shards)

binaries=$af_root/build/fuzz/tests/fuzz
if [[ "$build" == yes ]]; then
  (cd "$af_root" && cmake --preset fuzz && cmake --build build/fuzz --target make_fuzz_seeds "${names[@]/#/fuzz_}") ||
    die 1 "the fuzzers do not build"
fi
mkdir -p "$output"
output=$(cd "$output" && pwd)
"$binaries/make_fuzz_seeds" "$af_root/tests/fuzz/findings" "$output/seeds"

# Each fuzzer is one process without mpirun, and keeps its files in memory. An allocation of a hostile size is a finding.
export OMPI_MCA_ess_singleton_isolated=1 OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
export TMPDIR=${TMPDIR:-/dev/shm}
status=0
for name in "${names[@]}"; do
  mkdir -p "$output/$name/corpus"
  cd "$output/$name"
  leaks=1 most_mb=256 is_null=0
  # Open MPI and HDF5 keep memory until the end, and HDF5 loses some on damaged files. It also asks for as much memory as
  # they state (terabytes) before it looks at the file's size. The sanitizer refuses that.
  case $name in
    field_file | shards) leaks=0 ;;
    pose | found_poses) leaks=0 most_mb=100000000 is_null=1 ;;
  esac
  ASAN_OPTIONS=quarantine_size_mb=16:malloc_context_size=4:detect_leaks=$leaks:allocator_may_return_null=$is_null "$binaries/fuzz_$name" -max_total_time="$seconds" -timeout="${AF_FUZZ_TIMEOUT:-30}" -rss_limit_mb=1024 -malloc_limit_mb="$most_mb" -detect_leaks=$leaks \
    -print_final_stats=1 corpus "$output/seeds/$name" >log 2>&1 || status=1
  printf '%-13s %12s runs, coverage %s -> %s edges, %s inputs kept, %s findings\n' "$name" \
    "$(sed -n 's/^stat::number_of_executed_units: *//p' log)" \
    "$(sed -n 's/.*INITED cov: \([0-9]*\).*/\1/p' log | head -n 1)" \
    "$(sed -n 's/.* cov: \([0-9]*\) .*/\1/p' log | tail -n 1)" \
    "$(find corpus -type f | wc -l)" "$(find . -maxdepth 1 -regextype posix-extended -regex './(crash|oom|timeout|leak)-.*' -type f | wc -l)"
done
exit $status
