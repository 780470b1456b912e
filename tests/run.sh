#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds what is needed and runs the tests.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/../jobs/lib.sh"

usage() {
  cat <<'TEXT'
Usage: tests/run.sh [--fast] [--sanitize] [--sanitize-threads] [--skip-packages] [--help] [-- CTEST-OPTIONS...]

Installs missing packages, builds everything in build/release and runs all tests with CTest, MPI tests on 1, 2, 3 and 4
ranks. The last lines are CTest's summary; the exit code is 0 only when every test passed.

  --fast            within three minutes after a change to one file: without real CTs (label physics), programs that run for long,
                    unit tests of more than three seconds, and MPI on more than two ranks (label long)
  --sanitize        in build/sanitize, with the address and undefined-behaviour sanitizers; about an hour
  --sanitize-threads  in build/sanitize-threads, with the thread sanitizer, without the physics tests; takes long
  --skip-packages   do not look for missing packages
  -- ...            passed on to ctest, for example: -- -R RayCaster
TEXT
}

preset=release skip_packages=no
ctest_options=()
while (($# > 0)); do
  case "$1" in
    --fast) ctest_options+=(--label-exclude 'physics|long') ;;
    --sanitize) preset=sanitize ;;
    --sanitize-threads) preset=sanitize-threads ;;
    --skip-packages) skip_packages=yes ;;
    --help | -h) usage; exit 0 ;;
    --)
      shift
      ctest_options+=("$@")
      break
      ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done

if [[ "$skip_packages" == no ]]; then
  "$af_root/jobs/install-packages.sh" || die 1 "packages are missing (see above)"
fi
say "Building build/$preset (about 10 minutes from nothing on two cores) ..."
mkdir -p "$af_root/build"
build_start=$SECONDS
build_preset "$preset" "$af_root/build/$preset.log"
say "        $(duration $((SECONDS - build_start)))"

# In a chroot without /sys, hwloc complains on standard error of every program, which the tests read.
export HWLOC_HIDE_ERRORS="${HWLOC_HIDE_ERRORS:-2}"
# Jobs of Open MPI 4.1 that run side by side share a folder, which is named after the machine without its domain. A job that
# ends removes an empty folder, even while another job is starting.
machine=$(uname -n)
(umask 077 && mkdir -p "${TMPDIR:-/tmp}/ompi.${machine%%.*}.$(id -u)/keep")
# A rank that waits would spin on a processor that another test needs.
export OMPI_MCA_mpi_yield_when_idle=1
if [[ "$preset" == sanitize ]]; then
  export LSAN_OPTIONS="suppressions=$af_root/tests/support/lsan.supp:print_suppressions=0"
  export ASAN_OPTIONS="fast_unwind_on_malloc=0" UBSAN_OPTIONS="print_stacktrace=1"
  # The checks of the tree run no compiled program.
  ctest_options+=(--label-exclude checks)
fi
if [[ "$preset" == sanitize-threads ]]; then
  # Open MPI and HDF5 are not compiled for the sanitizer, so it ignores what they do by themselves. Physics tests have no
  # threads.
  export TSAN_OPTIONS="halt_on_error=1:ignore_noninstrumented_modules=1"
  ctest_options+=(--label-exclude 'checks|physics')
fi
cd "$af_root/build/$preset"
# One test more than there are processors, because the longest tests mostly wait for programs to start and stop.
exec ctest --output-on-failure --no-tests=error --parallel "$(($(core_count) + 1))" "${ctest_options[@]}"
