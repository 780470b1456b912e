#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Every struct of options that a program takes must be listed in tests/unit/described_options_test.cpp.
# Usage: options.sh ROOT
set -euo pipefail
cd "$1"
mapfile -t structs < <(grep -rhoP '\bvoid run_\w+\(const (\w+::)*\K\w+Options(?=& options,)' --include='*.cpp' common evaluate precompute register | sort -u)
((${#structs[@]} > 10)) || { echo "options: only ${#structs[@]} structs of options found" >&2; exit 1; }
failed=no
for struct in "${structs[@]}"; do
  if ! grep -qP "\\b${struct}[,>]" tests/unit/described_options_test.cpp; then
    echo "options: AllOptions of tests/unit/described_options_test.cpp lacks $struct" >&2
    failed=yes
  fi
done
[[ "$failed" == no ]] || exit 1
echo "options: ${#structs[@]} structs are tested"
