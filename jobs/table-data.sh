#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Writes the tables of pages as small CSVs, from a folder of paper-experiments.sh, population.sh or peers.sh.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/table-data.sh DIR [OUT]

Writes the tables behind docs/paper-experiments.md from the runs in DIR (jobs/paper-experiments.sh), those behind
docs/population.md from the tables in DIR (jobs/population.sh), or that of docs/peers.md (jobs/peers.sh), to OUT [docs/data], as
CSVs of some kilobytes. Every row ends with the commit of the programs and the SHA-256 of the file in DIR that it was taken from.
TEXT
}

if (($# < 1 || $# > 2)) || [[ "$1" == --help || "$1" == -h ]]; then
  usage
  [[ "${1:-}" == --help || "${1:-}" == -h ]] && exit 0
  exit 2
fi
runs="$1/runs"
out="${2:-$af_root/docs/data}"
[[ -d "$runs" || -f "$1/tables/population.csv" || -f "$1/peers.csv" ]] || die 4 "$1: holds no folder runs/ of jobs/paper-experiments.sh, nor tables/ of jobs/population.sh, nor peers.csv of jobs/peers.sh"
commit=$(git -C "$af_root" rev-parse --short=12 HEAD)
mkdir -p "$out"

# add NAME FILE [KEY VALUE]: appends FILE to OUT/NAME.csv, with KEY as the first column, when given.
add() {
  local target="$out/$1.csv" file="$2" key="${3:-}" value="${4:-}" sum header last
  sum=$(sha256sum "$file" | cut -c1-16)
  # Tables of a population already say which programs made their runs.
  if [[ "$(head -n 1 "$file")" == *,commit ]]; then
    header="$(head -n 1 "$file"),source_sha256" last="$sum"
  else
    header="$(head -n 1 "$file"),commit,source_sha256" last="$commit,$sum"
  fi
  [[ -z "$key" ]] || header="$key,$header"
  if [[ ! -f "$target" ]]; then
    printf '%s\n' "$header" >"$target"
  fi
  [[ "$(head -n 1 "$target")" == "$header" ]] || die 3 "$file: has other columns than $target"
  tail -n +2 "$file" | awk -v first="${value:+$value,}" -v last=",$last" '{print first $0 last}' >>"$target"
}

if [[ -f "$1/peers.csv" ]]; then
  rm -f "$out/peers.csv"
  add peers "$1/peers.csv"
  exit
fi
if [[ -f "$1/tables/population.csv" ]]; then
  rm -f "$out"/population{,-patients,-intervals}.csv
  add population "$1/tables/population.csv"
  add population-patients "$1/tables/patients.csv"
  add population-intervals "$1/tables/intervals.csv"
  wc -c "$out"/population*.csv
  exit
fi

rm -f "$out"/paper-{table-1,fig-8,loss-split,fig-14,table-2,fig-16,fig-16-starts}.csv
add paper-table-1 "$runs/field-parameters/field-parameters.csv"
for folder in "$runs"/image-quality/*/; do
  name=$(basename "$folder")
  add paper-fig-8 "$folder/image-quality.csv" field "$name"
  add paper-loss-split "$folder/loss-split-poses.csv" field "$name"
done
for folder in "$runs"/similarity-*/; do
  add paper-fig-14 "$folder/maxima.csv" case "$(basename "$folder" | sed 's/^similarity-//')"
done
add paper-table-2 "$runs/registration/cases.csv"
add paper-fig-16 "$runs/registration/success-rate.csv"
add paper-fig-16-starts "$runs/registration/starts-per-interval.csv"
wc -c "$out"/paper-*.csv
