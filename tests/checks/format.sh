#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every C++ source is formatted as .clang-format says. Usage: format.sh ROOT
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "$0")/source_files.sh"
root=$1
command -v clang-format-14 >/dev/null || skip_or_fail clang-format-14
mapfile -d '' -t files < <(list_sources "$root" '*.h' '*.cpp')
((${#files[@]} > 0)) || { echo "no sources found below $root" >&2; exit 1; }
(cd "$root" && clang-format-14 --dry-run -Werror "${files[@]}")
echo "format: ${#files[@]} files are formatted"
