#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# A program must map only the parallel HDF5 library. With ITK's serial HDF5 beside it, it would crash at random.
# Usage: one_hdf5.sh PROGRAM...
set -euo pipefail
parallel_seen=no
for program in "$@"; do
  libraries=$(ldd "$program" | awk '/libhdf5/ {print $1}' | LC_ALL=C sort -u)
  for library in $libraries; do
    case "$library" in
      libhdf5_openmpi*) parallel_seen=yes ;;
      *)
        echo "$program maps $library; all of its HDF5: ${libraries//$'\n'/ }" >&2
        exit 1
        ;;
    esac
  done
done
# Without this, the check could never fail.
[[ "$parallel_seen" == yes ]] || { echo "no program maps libhdf5_openmpi: $*" >&2; exit 1; }
echo "one_hdf5: $# programs map only the parallel HDF5"
