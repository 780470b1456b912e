#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Installs the library into a scratch prefix, builds tests/library/example against that alone, and compares its DRR with
# af-drr's, byte by byte. Usage: installed_example.sh CMAKE COMPILER BUILD STUDY
set -euo pipefail
cmake=$1 compiler=$2 build=$3 study=$4
source_folder=$(cd "$(dirname "$0")/example" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch" || true' EXIT

for component in library development; do
  "$cmake" --install "$build" --prefix "$scratch/prefix" --component "$component" >/dev/null
done
headers=$(cd "$scratch/prefix/include" && find . -type f | LC_ALL=C sort)
if grep -v '^\./attenuation_fields/' <<<"$headers"; then
  echo "installed_example: headers outside of include/attenuation_fields are installed (above)" >&2
  exit 1
fi
# Users' compilers read these headers, so they must not include another library's.
if grep -rnE '#include[ ]*[<"](Eigen|hdf5|mpi|itk|gdcm|nlohmann|toml|CLI)' "$scratch/prefix/include"; then
  echo "installed_example: a public header includes another library's (above)" >&2
  exit 1
fi
# Builds a copy, so that the example finds nothing of the project beside it.
cp -r "$source_folder" "$scratch/project"
"$cmake" -S "$scratch/project" -B "$scratch/build" -DCMAKE_PREFIX_PATH="$scratch/prefix" -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_CXX_COMPILER="$compiler" -DCMAKE_CXX_FLAGS="-Wall -Wextra -Wpedantic -Wconversion -Werror" >/dev/null
"$cmake" --build "$scratch/build" >/dev/null
"$scratch/build/example" "$study/AP.af.h5" "$scratch/example.f32"

# The pixels are at the end of af-drr's file.
bytes=$(stat -c %s "$scratch/example.f32")
((bytes > 0)) || { echo "installed_example: no pixels" >&2; exit 1; }
tail -c "$bytes" "$study/field.mha" >"$scratch/program.f32"
cmp "$scratch/example.f32" "$scratch/program.f32"

# Errors keep their type across the border between library and program.
status=0
"$scratch/build/example" "$study/study.toml" "$scratch/none.f32" 2>"$scratch/error.txt" || status=$?
if ((status != 4)) || ! grep -q 'study.toml: is not an HDF5 file' "$scratch/error.txt"; then
  echo "installed_example: exit code $status with: $(cat "$scratch/error.txt")" >&2
  exit 1
fi
echo "installed_example: $bytes bytes are those of af-drr"
