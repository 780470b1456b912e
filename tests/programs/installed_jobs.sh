# SPDX-License-Identifier: Apache-2.0
# shellcheck shell=bash
# For tests of jobs, to be sourced.

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

# enter_installed ROOT FOLDER_OF_PROGRAMS: enters a scratch folder, removed in the end, where jobs and programs lie below
# prefix/ as installed, so that the jobs find these programs, whatever they were built as.
enter_installed() {
  scratch=$(mktemp -d)
  trap 'rm -rf "$scratch"' EXIT
  cd "$scratch" || exit
  mkdir -p prefix/libexec/attenuation-fields
  cp -r "$1/jobs" prefix/libexec/attenuation-fields/
  ln -s "$2" prefix/bin
}
