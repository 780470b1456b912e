#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs the benchmarks with little work, and checks that every section writes what the report needs. The programs themselves
# fail when fast and plain searches differ or casters see different images. Usage: quick_test.sh BUILD-FOLDER CT
set -euo pipefail
programs=$1 ct=$2
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
"$(dirname "$0")/run.sh" --quick --programs "$programs" --ct "$ct" --out "$scratch/out" >"$scratch/log" 2>&1 || {
  cat "$scratch/log" >&2
  exit 1
}
for section in machine casting encoding fields efficiency memory quality drr-look-up drr-standard ranks-2 ranks-4; do
  grep -q "^    \"$section\": {" "$scratch/out/benchmark.json" || { echo "benchmark.json lacks section $section" >&2; exit 1; }
done
if [[ -x "$programs/benchmark/bench-python" ]]; then
  grep -q '^    "python": {' "$scratch/out/benchmark.json" || { echo "benchmark.json lacks section python" >&2; exit 1; }
fi
for table in 'Casting' 'Encoding' 'One DRR of the paper' 'One DRR of the default field' 'Whole fields' 'Seconds per phase' 'Machine'; do
  grep -q "^## $table" "$scratch/out/benchmark.md" || { echo "benchmark.md lacks the table $table" >&2; exit 1; }
done
grep -q '^drr-standard,"TwoPassAfDrr, decoded, cubic-sum",median us per DRR,' "$scratch/out/benchmark.csv" || { echo "benchmark.csv lacks the default field's DRR" >&2; exit 1; }
echo "all sections and tables are there"
