#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Builds the benchmarks and runs them on one CT: one JSON file, one page of tables and one list of numbers.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/../../jobs/lib.sh"

all_sections=(machine casting encoding fields drr-look-up drr-standard efficiency memory quality ranks python)

usage() {
  cat <<TEXT
Usage: tests/benchmark/run.sh [--ct FILE] [--rig RIG] [--camera NAME] [--out DIR] [--only SECTION]... [--quick]
                              [--skip-build]

Measures casting, encoding, look-up and whole fields on this machine, which should do nothing else meanwhile, and writes
DIR/benchmark.json, DIR/benchmark.md (tables) and DIR/benchmark.csv (their numbers). What is compared alternates within
one run of one program; medians of several rounds are shown. Takes about ten minutes on two cores, half as long again
for a CT of 512x512x275 voxels.

  --ct FILE       the CT [the default study's skull]
  --rig, --camera the cameras and which of them [c-arm-12in, AP]
  --out DIR       where results go [af-benchmark]; sections that are there and not run again are kept
  --only SECTION  run this section only; may be given several times. Sections: ${all_sections[*]}
  --quick         little work each: shows that everything works, not how fast
  --skip-build    take the programs of build/release as they are

plastimatch and Faiss are compared with when installed: jobs/install-packages.sh --with-benchmarks.
TEXT
}

ct='' rig=c-arm-12in camera=AP out=af-benchmark skip_build=no programs="$af_root/build/release"
quick=() sections=()
arguments=$*
while (($# > 0)); do
  case "$1" in
    --ct | --rig | --camera | --out | --only | --programs)
      (($# > 1)) || die 2 "$1 needs a value"
      case "$1" in
        --ct) ct=$2 ;;
        --rig) rig=$2 ;;
        --camera) camera=$2 ;;
        --out) out=$2 ;;
        --only) sections+=("$2") ;;
        --programs) programs=$2 skip_build=yes ;;
      esac
      shift
      ;;
    --quick) quick=(--quick) ;;
    --skip-build) skip_build=yes ;;
    --help | -h) usage; exit 0 ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done
((${#sections[@]} > 0)) || sections=("${all_sections[@]}")
for section in "${sections[@]}"; do
  [[ " ${all_sections[*]} " == *" $section "* ]] || die 2 "unknown section '$section' (try --help)"
done

if [[ "$skip_build" == no ]]; then
  say "Building ..."
  mkdir -p "$programs"
  (cd "$af_root" && cmake --preset release -DAF_BUILD_BENCHMARKS=ON) >"$programs/benchmark-configure.log" 2>&1 ||
    die 1 "configuring failed; see $programs/benchmark-configure.log"
  build_preset release "$af_root/build/benchmark.log" af-precompute af-evaluate af-inspect \
    bench-machine bench-casting bench-encoding bench-drr-look-up bench-fields bench-ranks
  # The module may be left out of a build.
  if grep -q '^AF_BUILD_PYTHON:BOOL=ON' "$programs/CMakeCache.txt"; then
    build_preset release "$af_root/build/benchmark.log" bench-python
  fi
fi
mkdir -p "$out/sections" "$out/work"
if [[ -z "$ct" ]]; then
  ct="$out/work/skull.mhd"
  [[ -f "$ct" ]] || "$af_root/jobs/default-ct.sh" "$ct"
fi
[[ -e "$ct" ]] || die 4 "$ct does not exist"

# One BLAS thread, because all numbers are per core.
export OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1
# Debian's OpenBLAS takes AVX2 kernels on processors newer than itself. Faiss must get the best ones.
unset OPENBLAS_CORETYPE OPENBLAS_L2_SIZE
if grep -q avx512vl /proc/cpuinfo 2>/dev/null; then
  export OPENBLAS_CORETYPE=SkylakeX
fi
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
bench="$programs/benchmark"
of_case=(--ct "$ct" --rig "$rig" --camera "$camera" "${quick[@]}")
field_program=("$bench/bench-fields" "${of_case[@]}" --programs "$programs/bin" --work "$out/work")

run_section() {
  local section=$1 json="$out/sections/$1.json"
  case "$section" in
    machine) "$bench/bench-machine" "${quick[@]}" -o "$json" ;;
    casting) "$bench/bench-casting" "${of_case[@]}" "${small_field[@]}" --work "$out/work" -o "$json" ;;
    encoding) "$bench/bench-encoding" "${of_case[@]}" "${small_field[@]}" -o "$json" ;;
    fields | efficiency | memory | quality) "${field_program[@]}" --part "$section" -o "$json" ;;
    drr-look-up | drr-standard)
      local field="$out/work/paper.af.h5"
      [[ "$section" == drr-look-up ]] || field="$out/work/standard.af.h5"
      [[ -f "$field" ]] || die 1 "$section needs the field that section 'fields' makes: run that first"
      "$bench/bench-drr-look-up" "${of_case[@]}" --field "$field" --work "$out/work" --section "$section" -o "$json"
      ;;
    python)
      [[ -f "$out/work/paper.af.h5" ]] || die 1 "python needs the field that section 'fields' makes: run that first"
      if [[ -x "$bench/bench-python" ]]; then
        PYTHONPATH="$programs/python" "$bench/bench-python" --field "$out/work/paper.af.h5" "${quick[@]}" -o "$json"
      else
        say "        left out: no Python module is built"
      fi
      ;;
    ranks)
      local ranks
      for ranks in 2 4; do
        OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 mpirun -n "$ranks" --oversubscribe --bind-to none \
          "$bench/bench-ranks" "${quick[@]}" --work "$out/work" -o "$out/sections/ranks-$ranks.json"
      done
      ;;
  esac
}

AF_BENCHMARK_COMMIT=$(git -C "$af_root" describe --always --dirty 2>/dev/null || echo unknown)
export AF_BENCHMARK_COMMIT
small_field=()
((${#quick[@]} == 0)) || small_field=(--uv-nodes 8 --st-nodes 64 --rounds 1)
for section in "${sections[@]}"; do
  start=$SECONDS
  say "$section ..."
  run_section "$section"
  say "        $(duration $((SECONDS - start)))"
done
"$af_root/tests/benchmark/report.py" "$out" "$AF_BENCHMARK_COMMIT" "tests/benchmark/run.sh $arguments"
