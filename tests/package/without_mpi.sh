#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A build without MPI: nothing of it maps MPI, its ranks are processes, and it gives the bits of build/release.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/../../jobs/lib.sh"

usage() {
  cat <<'TEXT'
Usage: tests/package/without_mpi.sh

Builds the preset serial and the tests of ranks in it, runs these as one to four processes, makes a field, a pose and a
Python look-up with it and with build/release, which must stand, and compares. Some ten minutes on two cores.
TEXT
}

case "${1:-}" in
  "") ;;
  --help | -h) usage; exit 0 ;;
  *) die 2 "unknown argument '$1' (try --help)" ;;
esac
release="$af_root/build/release" serial="$af_root/build/serial"
[[ -x "$release/bin/af-precompute" ]] || die 1 "build/release is not built (cmake --preset release)"
tests=(parallel_test run_folder_test resumable_items_test shared_inputs_test field_file_test atlas_file_test field_build_test
  register_mpi_tests run_test)
programs=(precompute drr simulate scan register evaluate inspect)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

say "building"
cmake -S "$af_root" --preset serial -DAF_BUILD_TESTS=ON >"$work/log"
cmake --build "$serial" --parallel "$(build_job_count)" \
  --target "${programs[@]/#/af-}" attenuation_fields python-module "${tests[@]}" >>"$work/log" || { tail -n 40 "$work/log"; exit 1; }

say "libraries"
for file in "${programs[@]/#/$serial/bin/af-}" "$serial"/lib/libattenuation_fields.so "$serial"/python/attenuation_fields/_core*.so; do
  mapped=$(ldd "$file")
  [[ "$mapped" != *libmpi* && "$mapped" != *openmpi* ]] || die 1 "$file maps MPI: $mapped"
  [[ "$mapped" != *'not found'* ]] || die 1 "$file: $mapped"
done

say "tests of ranks"
"$serial/tests/run_test" >"$work/log" || { tail -n 40 "$work/log"; exit 1; }
for test in "${tests[@]/run_test/}"; do
  for processes in 1 2 3 4; do
    [[ -z "$test" ]] || "$serial/tests/$test" --processes "$processes" >"$work/log" 2>&1 ||
      { tail -n 40 "$work/log"; die 1 "$test --processes $processes failed"; }
  done
done

say "bits"
cd "$work"
"$release/bin/af-simulate" --phantom spine --phantom-voxel-mm 2 --rig c-arm-12in -o study >"$work/log" 2>&1
# field OUTPUT WORDS...: the payload's hash of a field that these words make.
field() {
  "${@:2}" --study study/study.toml --camera AP --uv-nodes 12 --st-nodes 96 --codewords 256 -o "$1" >"$1.log" 2>&1 ||
    { cat "$1.log" >&2; return 1; }
  "$release/bin/af-inspect" --json "$1" | /usr/bin/python3 -c 'import json, sys; print(json.load(sys.stdin)[0]["facts"]["payload_sha256"])'
}
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
expected=$(field mpi.h5 mpirun -n 2 --oversubscribe "$release/bin/af-precompute")
for processes in 1 3; do
  found=$(field "serial-$processes.h5" "$serial/bin/af-precompute" --processes "$processes")
  [[ "$found" == "$expected" ]] || die 1 "the field of $processes processes has hash $found, the one of MPI $expected"
done
for build in "$release" "$serial"; do
  "$build/bin/af-register" --study study/study.toml --renderer raycast --start-rotation-deg 1,-1,1 -o "$(basename "$build")" \
    >"$work/log" 2>&1
  PYTHONPATH="$build/python" /usr/bin/python3 -c 'import sys, attenuation_fields as af
sys.stdout.buffer.write(af.Field.open("mpi.h5").drr(rotation_deg=(1, 0, 0)).tobytes())' >"$(basename "$build").drr"
done
cmp release/pose.toml serial/pose.toml
cmp release.drr serial.drr

say "without_mpi.sh: passed at $(git -C "$af_root" rev-parse --short=11 HEAD), $(date --utc --iso-8601)"
