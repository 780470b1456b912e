# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# What a stage of a chain was finished from, so that it is done again when that has changed. Sourced by
# jobs/run-study.sh and jobs/slurm/stage.sbatch, alone: a batch job sees no other file of jobs/.

# value_of OPTION WORDS...: the word after OPTION, if it is there.
value_of() {
  local option=$1
  shift
  while (($# > 1)); do
    if [[ "$1" == "$option" ]]; then
      echo "$2"
      return
    fi
    shift
  done
}

# result_of COMMAND...: the file that exists when the command has done all of its work.
result_of() {
  local output
  output=$(value_of -o "$@")
  [[ " $* " != *" registration "* ]] || output+=/summary.json
  echo "$output"
}

# progress_of COMMAND...: the folder of its unfinished work.
progress_of() { echo "$(value_of -o "$@").progress"; }

# bytes_in FOLDER: the size of all files together; 0 when there is none.
bytes_in() { { find "$1" -type f -printf '%s\n' 2>/dev/null || true; } | awk '{sum += $1} END {print sum + 0}'; }

# state_of PATH...: name, size and time of a file (also of the voxels beside a header) or of all files of a folder; for
# a missing file, that it is missing.
state_of() {
  local path paths
  for path in "$@"; do
    paths=("$path")
    [[ "$path" != *.mhd && "$path" != *.nhdr ]] || paths=("${path%.*}".*)
    find -L "${paths[@]}" -type f -printf '%p %s %T@\n' 2>&1 | LC_ALL=C sort || true
  done
}

# inputs_of AF_INSPECT COMMAND...: a hash of the study, of the state of its case's CT, X-rays, masks and rig, and of the
# fields that the command reads.
inputs_of() {
  local inspect=$1 study case_name lines name path paths=()
  shift
  study=$(value_of --study "$@")
  case_name=$(value_of --case "$@")
  lines=$("$inspect" --list-inputs "$study") || return
  while IFS=$'\t' read -r name path; do
    [[ "$name" != "$case_name" ]] || paths+=("$path")
  done <<<"$lines"
  while (($# > 1)); do
    [[ "$1" != --field ]] || paths+=("${2#*=}")
    shift
  done
  { sha256sum <"$study" && state_of "${paths[@]}"; } | sha256sum
}
