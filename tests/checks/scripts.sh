#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every shell script passes shellcheck and stops at errors. Usage: scripts.sh ROOT
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "$0")/source_files.sh"
root=$1
command -v shellcheck >/dev/null || skip_or_fail shellcheck
mapfile -d '' -t files < <(list_sources "$root" '*.sh')
files+=(.ci/run)
cd "$root"
shellcheck --external-sources --source-path=SCRIPTDIR "${files[@]}"
for file in "${files[@]}"; do
  if [[ "$(head -c 2 "$file")" == '#!' ]]; then
    grep -Eq '^set -euo pipefail' "$file" || { echo "$file: no 'set -euo pipefail'" >&2; exit 1; }
    [[ -x "$file" ]] || { echo "$file: not executable" >&2; exit 1; }
  fi
done
echo "scripts: ${#files[@]} scripts are clean"
