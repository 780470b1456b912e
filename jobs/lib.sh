# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# Shared by the scripts of jobs/, tests/ and .ci/: messages, building, ranks. Sourced, never run; the caller has set
# `set -euo pipefail`.

# The repository (or, installed, the folder that holds jobs/).
af_root="$(cd -P "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"

# shellcheck disable=SC2034  # for the scripts that source this file
af_programs=(af-precompute af-drr af-simulate af-scan af-register af-evaluate af-inspect)

say() { printf '%s\n' "$*"; }

die() {
  local code=$1
  shift
  printf '%s: %s\n' "$(basename "$0")" "$*" >&2
  exit "$code"
}

# 75 -> "1 min 15 s"
duration() {
  local seconds=$1
  if ((seconds < 60)); then
    printf '%d s' "$seconds"
  elif ((seconds < 3600)); then
    printf '%d min %02d s' $((seconds / 60)) $((seconds % 60))
  else
    printf '%d h %02d min' $((seconds / 3600)) $((seconds % 3600 / 60))
  fi
}

core_count() { nproc 2>/dev/null || echo 1; }

# The folder of the programs: the repository's release build or, installed, PREFIX/bin beside
# PREFIX/share/attenuation-fields/jobs.
program_folder() {
  if [[ -f "$af_root/CMakeLists.txt" ]]; then
    echo "$af_root/build/release/bin"
  else
    (cd "$af_root/../../bin" && pwd)
  fi
}

# need_programs FOLDER PROGRAM...: ends the script when one is missing.
need_programs() {
  local folder=$1 program
  shift
  for program in "$@"; do
    [[ -x "$folder/$program" ]] ||
      die 1 "$folder/$program is missing: build it first (cmake --preset release && cmake --build build/release)"
  done
}

# One compiler per core, but no more than memory allows: the ITK and CLI11 files need up to about 1.5 GB each.
build_job_count() {
  local cores memory_kb
  cores=$(core_count)
  memory_kb=$(awk '/^MemAvailable:/ {print $2}' /proc/meminfo 2>/dev/null || echo 4000000)
  local by_memory=$((memory_kb / 1500000))
  ((by_memory >= 1)) || by_memory=1
  echo $((cores < by_memory ? cores : by_memory))
}

# build_preset PRESET LOG [TARGET...]: configures (when needed) and builds build/PRESET; all targets when none is named.
build_preset() {
  local preset=$1 log=$2
  shift 2
  local folder="$af_root/build/$preset" cache="$af_root/build/$preset/CMakeCache.txt"
  if [[ -f "$cache" ]] && ! grep -Fxq "CMAKE_HOME_DIRECTORY:INTERNAL=$af_root" "$cache"; then
    say "  build/$preset was made for another place of this tree: starting it anew"
    rm -rf "$folder"
  fi
  mkdir -p "$folder"
  local launcher=()
  if command -v ccache >/dev/null; then
    # Without this, ccache does not cache precompiled headers.
    launcher=("-DCMAKE_CXX_COMPILER_LAUNCHER=env;CCACHE_SLOPPINESS=${CCACHE_SLOPPINESS:+$CCACHE_SLOPPINESS,}pch_defines,time_macros;ccache")
  fi
  if ! (cd "$af_root" && { [[ -f "$folder/build.ninja" ]] || cmake --preset "$preset" "${launcher[@]}"; } &&
    cmake --build "$folder" --parallel "$(build_job_count)" ${1+--target "$@"}) 2>&1 |
    tee "$log" | awk '/^\[[0-9]+\/[0-9]+\]/ && ++steps % 40 == 0 {print "        " $1; fflush()}'; then
    tail -n 40 "$log" >&2
    die 1 "the build failed; the whole log is $log"
  fi
}

# run_ranks RANKS COMMAND...: the program's ranks on this machine.
run_ranks() {
  local ranks=$1
  shift
  if ((ranks == 1)); then "$@"; else "$@" --processes "$ranks"; fi
}

# Checks of scripts' options: need_value OPTION ARGUMENTS_LEFT, need_count OPTION VALUE.
need_value() { (($2 >= 2)) || die 2 "option $1 needs a value (try --help)"; }
need_count() { [[ "$2" =~ ^[1-9][0-9]{0,6}$ ]] || die 2 "$1 = '$2' must be a whole number from 1 to 9999999"; }
need_seed() { [[ "$2" =~ ^[0-9]{1,18}$ ]] || die 2 "$1 = '$2' must be a whole number"; }

# need_ct OPTION NAME=PATH: sets named_ct to the same with the full path. Names become parts of file names, where hyphens
# separate them from other parts.
need_ct() {
  [[ "$2" =~ ^[A-Za-z0-9_]+=.+$ ]] || die 2 "$1 = '$2' must be NAME=PATH, with letters, digits and _ in NAME"
  [[ -e "${2#*=}" ]] || die 4 "$1 ${2#*=}: no such file or folder"
  # shellcheck disable=SC2034  # for the scripts that source this file
  named_ct="${2%%=*}=$(realpath "${2#*=}")"
}
