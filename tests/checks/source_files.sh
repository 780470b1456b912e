# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# list_sources ROOT PATTERN...: the project's own files, NUL-separated: tracked and new files where git is at hand,
# otherwise (a tarball) everything but build folders and outputs.
list_sources() {
  local root=$1
  shift
  (
    cd "$root" || exit
    if git rev-parse --is-inside-work-tree >/dev/null 2>&1 && [[ "$(git rev-parse --show-toplevel)" == "$(pwd -P)" ]]; then
      git ls-files -z --cached --others --exclude-standard -- "$@"
    else
      local tests=() pattern
      for pattern in "$@"; do
        tests+=(-o -name "$pattern")
      done
      find . \( -name .git -o -name build -o -name 'af-study*' -o -name '*.progress' \) -prune -o \
        -type f \( "${tests[@]:1}" \) -printf '%P\0'
    fi
  )
}

# skip_or_fail TOOL: a check whose tool is absent is skipped (77), except in CI (AF_REQUIRE_TOOLS=1).
skip_or_fail() {
  if [[ "${AF_REQUIRE_TOOLS:-0}" == 1 ]]; then
    echo "$1 is missing (jobs/install-packages.sh --with-lint installs it)" >&2
    exit 1
  fi
  echo "skipped: $1 is not installed (jobs/install-packages.sh --with-lint installs it)"
  exit 77
}
