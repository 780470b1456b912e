#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Compares the bytes of fields with the PSNR of their DRRs, and with the distance of their registrations from ray casting's.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"
# shellcheck source=anatomies.sh
source "$af_root/jobs/anatomies.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/rate-against-truth.sh [OPTIONS]

Simulates studies, builds fields of several designs, compares their DRRs with ray casting, and registers from the same
starts by each field and by ray casting. Writes rate-against-truth.csv, tables (.md) and curves (rate and distance, PNG
and SVG) of all that is finished in DIR, also by commands with other options. What is finished is kept, so the same
command continues after a stop; to do a part again, remove its folder or file below fields/, quality/, runs/ or
lattice/.

  --output DIR              where everything goes                                     [./rate-against-truth]
  --anatomies LIST          comma separated: skull (the default CT), or phantoms: spine, pelvis, head
                                                                                    [skull,spine,pelvis,head]
  --ct NAME=PATH            one more anatomy: a CT file or DICOM folder; may be repeated
  --variants LIST           comma separated: clean, stressed (rods,fiducials,heel,noise,degraded-ct), or
                            names that af-simulate --stress takes, joined by +               [clean,stressed]
  --views LIST              comma separated: 2, 1 (camera A alone)                                      [2,1]
  --design NAME=OPTIONS     a design: options of af-precompute; may be repeated
                            [the presets paper, standard, compact and fine, and budgets of 2, 4 and 8 MB]
  --lattice LIST            comma separated: anatomies whose clean pair also tells, for the first three designs,
                            whether poses lean towards nodes (af-evaluate lattice-errors); none: no one    [skull,head]
  --preset NAME             of registration; it should end at level 0                                [robust]
  --starts N                starts, one in each interval of 2 mm from 0                                   [8]
  --poses N                 DRRs of camera A that are compared with ray casting                           [8]
  --max-rotation-deg X      range of the fields, degrees                                                 [10]
  --max-translation-mm X    range of the fields, mm                                                      [30]
  --ranks N                 MPI ranks of fields and registrations                                 [all cores]
  --seed N                  of everything random                                                          [1]
  --help
TEXT
}

# --- options -----------------------------------------------------------------------------------------------------

output="$PWD/rate-against-truth" anatomies=skull,spine,pelvis,head variants=clean,stressed views=2,1 preset=robust lattice=skull,head
starts_count=8 poses=8 max_rotation_deg=10 max_translation_mm=30 seed=1
# shellcheck disable=SC2034  # for make_study
roi_px=200
cts=() designs=()
ranks=$(core_count)

while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; output=$2; shift ;;
    --anatomies) need_value "$1" $#; anatomies=$2; shift ;;
    --ct) need_value "$1" $#; need_ct "$1" "$2"; cts+=("$named_ct"); shift ;;
    --variants) need_value "$1" $#; variants=$2; shift ;;
    --views) need_value "$1" $#; views=$2; shift ;;
    --design)
      need_value "$1" $#
      [[ "$2" =~ ^[A-Za-z0-9._-]+=.+$ && "$2" != raycast=* ]] || die 2 "--design = '$2' must be NAME=OPTIONS, not raycast"
      designs+=("$2")
      shift
      ;;
    --lattice) need_value "$1" $#; lattice=$2; shift ;;
    --preset) need_value "$1" $#; preset=$2; shift ;;
    --starts) need_value "$1" $#; need_count "$1" "$2"; starts_count=$2; shift ;;
    --poses) need_value "$1" $#; need_count "$1" "$2"; poses=$2; shift ;;
    --max-rotation-deg) need_value "$1" $#; max_rotation_deg=$2; shift ;;
    --max-translation-mm) need_value "$1" $#; max_translation_mm=$2; shift ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --seed) need_value "$1" $#; need_seed "$1" "$2"; seed=$2; shift ;;
    --help | -h) usage; exit 0 ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done
((${#designs[@]} > 0)) || designs=(paper="--preset paper" standard="--preset standard" 2MB="--max-field-size 2MB"
  4MB="--max-field-size 4MB" 8MB="--max-field-size 8MB" compact="--preset compact" fine="--preset fine")
IFS=, read -r -a anatomy_list <<<"$anatomies"
IFS=, read -r -a variant_list <<<"$variants"
IFS=, read -r -a view_list <<<"$views"
for count in "${view_list[@]}"; do
  [[ "$count" == [12] ]] || die 2 "--views = '$views' must name 2, 1 or both"
done

# --- stages ------------------------------------------------------------------------------------------------------

bin=$(program_folder)
need_programs "$bin" af-simulate af-precompute af-evaluate af-report
open_output "$output"
mkdir -p "$output"/{studies,fields,quality,starts,runs,lattice}
# A new build does not invalidate what was measured, so that a change of one program repeats only its part.
stages_of_any_build=yes

# cameras_of VIEWS
cameras_of() { if (($1 == 2)); then echo A B; else echo A; fi; }

# source_of ANATOMY: sets kind, and source, from which it is simulated.
source_of() {
  local ct
  for ct in "${cts[@]}"; do
    if [[ "${ct%%=*}" == "$1" ]]; then
      kind=ct source=${ct#*=}
      return
    fi
  done
  case "$1" in
    skull)
      kind=ct source="$output/skull.mhd"
      stage "the default CT" "$source" "$af_root/jobs/default-ct.sh" "$source"
      ;;
    spine | pelvis | head) kind=phantom source=$1 ;;
    *) die 2 "--anatomies = '$anatomies' must name some of skull, spine, pelvis, head" ;;
  esac
}

# one_view STUDY OUTPUT: writes the study with only its first view. Its files stay where they are.
one_view() { awk '/^\[\[case.view\]\]/ { ++views } views < 2' "$1" >"$2"; }

# fields_of NAME-VARIANT DESIGN VIEWS: makes the missing fields, and sets field_options.
fields_of() {
  local name=$1 design=${2%%=*} camera field options
  read -r -a options <<<"${2#*=}"
  field_options=()
  for camera in $(cameras_of "$3"); do
    field="$output/fields/$name-$design-$camera.af.h5"
    stage "field $name-$design-$camera" "$field" run_ranks "$ranks" \
      "$bin/af-precompute" --study "$output/studies/$name/study.toml" --camera "$camera" "${options[@]}" \
      --max-rotation-deg "$max_rotation_deg" --max-translation-mm "$max_translation_mm" --seed "$seed" -o "$field"
    field_options+=(--field "$camera=$field")
  done
}

# register FOLDER STUDY OPTIONS...
register() {
  local folder=$1 study=$2
  shift 2
  stage "$folder" "$output/$folder/summary.json" run_ranks "$ranks" "$bin/af-evaluate" registration --study "$study" \
    --gold study --preset "$preset" --no-uncertainty --intervals "$starts_count" --starts-per-interval 1 \
    --seed "$seed" "$@" -o "$output/$folder"
}

# ct_of STUDY: the CT that it names.
ct_of() {
  local ct
  ct=$(sed -n 's/^ct = "\(.*\)"$/\1/p' "$1")
  [[ "$ct" == /* ]] || ct="$(dirname "$1")/$ct"
  echo "$ct"
}

# lattice_errors NAME-VARIANT: measures lattice errors by the first three designs.
lattice_errors() {
  local name=$1 design
  for design in "${designs[@]:0:3}"; do
    fields_of "$name" "$design" 2
    stage "lattice $name-${design%%=*}" "$output/lattice/$name-${design%%=*}.md" "$bin/af-evaluate" lattice-errors \
      --study "$output/studies/$name/study.toml" --gold study --preset "$preset" "${field_options[@]}" \
      -o "$output/lattice/$name-${design%%=*}.md"
  done
}

# condition ANATOMY VARIANT VIEWS: registers one X-ray or a pair by every design, and by ray casting.
condition() {
  local anatomy=$1 variant=$2 count=$3 name="$1-$2" study design starts
  local kind="" source=""
  stage_inputs=""
  source_of "$anatomy"
  stage_inputs="$kind $source"
  study="$output/studies/$name/study.toml"
  stage "study $name" "$study" make_study "$name" "$kind" "$source" "$(stress_of "$variant")"
  one_view "$study" "$output/studies/$name/one-view.toml"
  # Starts lie within the range of camera A's fields, which all cameras have, so they are the same for any number of views.
  fields_of "$name" "${designs[0]}" 1
  starts="$output/starts/$name/starts.csv"
  stage "starts of $name" "$starts" "$bin/af-evaluate" registration --study "$output/studies/$name/one-view.toml" \
    "${field_options[@]}" --gold study --intervals "$starts_count" --starts-per-interval 1 --seed "$seed" --starts-only \
    -o "$output/starts/$name"
  ((count == 2)) || study="$output/studies/$name/one-view.toml"
  register "runs/$name-$count/raycast" "$study" --starts-from "$starts" --renderer raycast
  for design in "${designs[@]}"; do
    fields_of "$name" "$design" "$count"
    design=${design%%=*}
    stage "quality $name-$design" "$output/quality/$name-$design/summary.json" run_ranks "$ranks" \
      "$bin/af-evaluate" image-quality --field "$output/fields/$name-$design-A.af.h5" --ct "$(ct_of "$output/studies/$name/study.toml")" \
      --pose-count "$poses" --seed "$seed" -o "$output/quality/$name-$design"
    register "runs/$name-$count/$design" "$study" "${field_options[@]}" --starts-from "$starts"
  done
  [[ "$variant-$count" != clean-2 || ",$lattice," != *",$anatomy,"* ]] || lattice_errors "$name"
  "$bin/af-evaluate" compare "$output/runs/$name-$count" --pose-distances -o "$output/runs/$name-$count/ends.md" >"$output/logs/compare.log"
}

# --- tables and curves --------------------------------------------------------------------------------------------

# json_number FILE REGEX: the number that the parenthesis of an extended regular expression captures in the file without
# white space.
json_number() {
  local text
  text=$(tr -d ' \n' <"$1")
  [[ "$text" =~ $2 ]] || die 6 "$1 holds nothing like $2"
  echo "${BASH_REMATCH[1]}"
}

# median_milliseconds METHODS_CSV RUN: the median time of a registration. The last column of the table is in seconds.
median_milliseconds() { awk -F, -v run="$2" '$1 == run { printf "%.4g", 1000 * $NF }' "$1"; }

# distances_to_raycast CSV DESIGN: the number of starts, and the median, 95th percentile and maximum of distances.
distances_to_raycast() {
  awk -F, -v design="$2" 'NR == 1 { for (i = 1; i <= NF; ++i) at[$i] = i }
    ($2 == design && $4 == "raycast") || ($4 == design && $2 == "raycast") {
      printf "%d,%.4f,%.4f,%.4f", $at["starts"], $at["median_distance_mm"], $at["p95_distance_mm"], $at["max_distance_mm"] }' "$1"
}

# row RUN: the row for one design's registrations. RUN is runs/ANATOMY-VARIANT-VIEWS/DESIGN.
row() {
  local run=$1 design name anatomy variant count ends camera bytes=0 key quality
  design=$(basename "$run") name=$(basename "$(dirname "$run")")
  anatomy=${name%%-*} count=${name##*-} variant=${name#*-}
  variant=${variant%-*}
  ends="$(dirname "$run")/ends" quality="$output/quality/$anatomy-$variant-$design/summary.json"
  for camera in $(cameras_of "$count"); do
    bytes=$((bytes + $(stat --format %s "$output/fields/$anatomy-$variant-$design-$camera.af.h5")))
  done
  printf '%s,%s,%s,%s,' "$anatomy" "$variant" "$count" "$design"
  for key in slabs uv_nodes st_nodes codewords; do
    printf '%s,' "$(json_number "$quality" "\"$key\":\[?([0-9]+)")"
  done
  printf '%.2f,%.2f,%.2f,%s,%s,%s\n' "$(awk -v bytes="$bytes" -v count="$count" 'BEGIN { print bytes / count / 1e6 }')" \
    "$(json_number "$quality" '"psnr_db":\{[^}]*"median":([-0-9.e+]+)')" \
    "$(json_number "$quality" '"seconds_per_drr_field":\{[^}]*"min":([-0-9.e+]+)' | awk '{ print 1000 * $1 }')" \
    "$(median_milliseconds "$ends.csv" "$design")" "$(median_milliseconds "$ends.csv" raycast)" \
    "$(distances_to_raycast "$ends-pose-distances.csv" "$design")"
}

# all_rows: a row per design and finished X-ray or pair. Two views come before one; then anatomy and size decide.
all_rows() {
  local ends run
  for ends in "$output"/runs/*/ends.csv; do
    for run in "${ends%/ends.csv}"/*/summary.json; do
      [[ "$run" == */raycast/* ]] || row "${run%/summary.json}"
    done
  done | sort -t, -k3,3nr -k2,2 -k1,1 -k9,9g
}

# --- everything --------------------------------------------------------------------------------------------------

for ct in "${cts[@]}"; do
  anatomy_list+=("${ct%%=*}")
done
for count in "${view_list[@]}"; do
  for variant in "${variant_list[@]}"; do
    for anatomy in "${anatomy_list[@]}"; do
      condition "$anatomy" "$variant" "$count"
    done
  done
done

csv="$output/rate-against-truth.csv"
{
  echo "anatomy,variant,views,design,slabs,uv_nodes,st_nodes,codewords,mb_per_camera,psnr_db,drr_ms,registration_ms,raycast_ms,starts,median_distance_mm,p95_distance_mm,max_distance_mm"
  all_rows
} >"$csv"
"$bin/af-report" "$csv" >"$output/logs/report.log"
say "Tables: ${csv%.csv}.md, $csv; curves: $output/rate.png, $output/distance.png, and SVG"
