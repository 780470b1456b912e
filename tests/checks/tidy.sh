#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs clang-tidy over our sources (without tests), as .clang-tidy says. Any finding fails. It takes forty minutes on two
# cores, so it is no CTest entry. Usage: tidy.sh [PATH-PATTERN]
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "$0")/source_files.sh"
command -v clang-tidy-14 >/dev/null || skip_or_fail clang-tidy-14
root=$(cd "$(dirname "$0")/../.." && pwd)
pattern=${1:-^(common|precompute|register|evaluate|tools|library)/}
build="$root/build/tidy"
cd "$root"
cmake --preset dev -B "$build" >/dev/null
sources=$(python3 tests/checks/unify_sources.py "$build/compile_commands.json" "$root" "$pattern" "$build/unified")
((sources > 0)) || { echo "no sources match $pattern" >&2; exit 1; }
# Kernels may do what the other sources may not. Their inner loops index images of less than 2^31 pixels by int, and leave
# registers uninitialised that they fill at once.
of_kernels=-bugprone-implicit-widening-of-multiplication-result,-bugprone-easily-swappable-parameters
of_kernels+=,-cppcoreguidelines-pro-type-member-init,-clang-analyzer-optin.performance.Padding
# tidy UNIT-PATTERN OPTIONS...: checks the units whose name matches. An empty list is no error.
tidy() {
  local units=$1
  shift
  find "$build/unified" -regextype egrep -regex ".*/$units" -print0 |
    xargs -0 -r -n 1 -P "$(nproc)" clang-tidy-14 --quiet --warnings-as-errors='*' -p "$build/unified" "$@" \
      --extra-arg=-include --extra-arg="$root/tests/checks/itk_for_clang.h"
}
tidy 'UnifiedSource[0-9]+\.cpp'
tidy 'UnifiedSourceKernel[0-9]+\.cpp' --checks="$of_kernels"
echo "tidy: $sources sources are clean"
