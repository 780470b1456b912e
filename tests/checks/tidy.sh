#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# clang-tidy over the first-party sources of a build (tests left out), as .clang-tidy says; any finding fails.
# Minutes, so it is not a CTest entry. Usage, after cmake --preset dev: tidy.sh build/dev [PATH-PATTERN]
# (A release build compiles several sources at once and does not name them.)
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "$0")/source_files.sh"
command -v clang-tidy-14 >/dev/null || skip_or_fail clang-tidy-14
build=$(cd "$1" && pwd)
pattern=${2:-^(common|precompute|register|evaluate)/}
database="$build/compile_commands.json"
[[ -f "$database" ]] || { echo "$database is missing: configure first" >&2; exit 4; }
root=$(sed -n 's/^CMAKE_HOME_DIRECTORY:INTERNAL=//p' "$build/CMakeCache.txt")
# Kernels appear once per vector width; each file is checked once.
mapfile -t files < <(sed -n 's/^ *"file": "\(.*\)",\{0,1\}$/\1/p' "$database" | LC_ALL=C sort -u |
  sed -n "s|^$root/||p" | grep -E "$pattern" | grep -v '^build/')
((${#files[@]} > 0)) || { echo "no sources match $pattern in $database: use that of build/dev" >&2; exit 1; }
cd "$root"
# Inner loops index images of less than 2^31 pixels by int, and leave registers uninitialised that they fill at once.
of_kernels=-bugprone-implicit-widening-of-multiplication-result,-bugprone-easily-swappable-parameters
of_kernels+=,-cppcoreguidelines-pro-type-member-init,-clang-analyzer-optin.performance.Padding
tidy() {
  local kind=$1
  shift
  xargs -0 -r -n 1 -P "$(nproc)" clang-tidy-14 --quiet --warnings-as-errors='*' -p "$build" "$@" \
    --extra-arg=-include --extra-arg="$root/tests/checks/itk_for_clang.h" < <(
      printf '%s\n' "${files[@]}" | grep "$kind" '_kernel\.cpp$' | tr '\n' '\0')
}
tidy -vE
tidy -E --checks="$of_kernels"
echo "tidy: ${#files[@]} files are clean"
