#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A build without MPI, whose ranks are processes, or one with MPICH: it maps no other MPI and gives the bits of build/release.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/../../jobs/lib.sh"

usage() {
  cat <<'TEXT'
Usage: tests/package/other_ranks.sh serial|mpich

Builds that preset and the tests of ranks in it, runs these on one to four ranks, makes a field, a pose and a Python
look-up with it and with build/release, which must stand, and compares. Some ten minutes on two cores; a rank of MPICH
that waits keeps its processor busy, so three and four ranks take longer there.
TEXT
}

case "${1:-}" in
  serial) foreign='libmpi|openmpi' ;;
  mpich) foreign='libmpi\.so|openmpi' ;;
  --help | -h) usage; exit 0 ;;
  *) usage >&2; exit 2 ;;
esac
preset=$1 release="$af_root/build/release" build="$af_root/build/$1"
[[ -x "$release/bin/af-precompute" ]] || die 1 "build/release is not built (cmake --preset release)"
tests=(parallel_test run_folder_test resumable_items_test shared_inputs_test field_file_test atlas_file_test field_build_test
  register_mpi_tests run_test)
programs=(precompute drr simulate scan register evaluate inspect)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

say "building"
cmake -S "$af_root" --preset "$preset" -DAF_BUILD_TESTS=ON >"$work/log"
cmake --build "$build" --parallel "$(build_job_count)" \
  --target "${programs[@]/#/af-}" attenuation_fields python-module "${tests[@]}" >>"$work/log" || { tail -n 40 "$work/log"; exit 1; }

say "libraries"
for file in "${programs[@]/#/$build/bin/af-}" "$build"/lib/libattenuation_fields.so "$build"/python/attenuation_fields/_core*.so; do
  mapped=$(ldd "$file")
  [[ ! "$mapped" =~ $foreign ]] || die 1 "$file maps another MPI: $mapped"
  [[ "$mapped" != *'not found'* ]] || die 1 "$file: $mapped"
done

say "tests of ranks"
"$build/tests/run_test" >"$work/log" || { tail -n 40 "$work/log"; exit 1; }
for test in "${tests[@]/run_test/}"; do
  for ranks in 1 2 3 4; do
    [[ -z "$test" ]] || "$build/tests/mpiexec" -n "$ranks" "$build/tests/$test" >"$work/log" 2>&1 ||
      { tail -n 40 "$work/log"; die 1 "$test on $ranks ranks failed"; }
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
expected=$(field release.h5 "$release/tests/mpiexec" -n 2 "$release/bin/af-precompute")
for ranks in 1 3; do
  found=$(field "$preset-$ranks.h5" "$build/tests/mpiexec" -n "$ranks" "$build/bin/af-precompute")
  [[ "$found" == "$expected" ]] || die 1 "the field of $ranks ranks has hash $found, the one of build/release $expected"
done
for one in "$release" "$build"; do
  "$one/bin/af-register" --study study/study.toml --renderer raycast --start-rotation-deg 1,-1,1 -o "$(basename "$one")" \
    >"$work/log" 2>&1
  PYTHONPATH="$one/python" /usr/bin/python3 -c 'import sys, attenuation_fields as af
sys.stdout.buffer.write(af.Field.open("release.h5").drr(rotation_deg=(1, 0, 0)).tobytes())' >"$(basename "$one").drr"
done
cmp release/pose.toml "$preset/pose.toml"
cmp release.drr "$preset.drr"

say "other_ranks.sh $preset: passed at $(git -C "$af_root" rev-parse --short=11 HEAD), $(date --utc --iso-8601)"
