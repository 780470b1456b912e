#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Makes the tables and figures of Russakoff et al. 2005, each by one command.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/paper-experiments.sh [OPTIONS] [EXPERIMENT...]

Makes the paper's tables and figures on simulated patients, one EXPERIMENT each, or all of them:

  table-1     memory, creation time and compression of fields over their resolutions
  fig-8       PSNR of field DRRs, box plots per patient and camera, the worst pairs side by side
  fig-9       difference images at about 36, 40 and 44 dB in one window
  fig-10      PSNR against each of the four field parameters
  loss-split  PSNR lost to interpolation over (u,v), over (s,t), and to quantisation
  fig-14      similarity along each pose parameter, field and ray casting, with a table of the maxima
  fig-15      histogram of TRE           (fig-15, table-2 and fig-16 are one study, made once)
  table-2     TRE per patient
  fig-16      success against initial TRE

First it makes what an experiment needs: patients (jobs/four-patients.sh) and fields. What is finished is kept, so the
same command continues after a stop. DIR/paper/ holds every result under the paper's name (fig-8.svg, .png, .csv, ...);
DIR/report.html shows all of them. Needs the programs in build/release/bin (or installed).

  --preset NAME    laptop: fields of 30 mm, 10 poses, one field's parameters, two ray-cast registrations per patient;
                   cluster: the paper's numbers, fields of 100 mm, 100 poses, the parameters of all fields,
                   every registration also by ray casting;
                   check: tiny, to see whether everything works                                        [laptop]
  --output DIR     where everything goes                                               [./paper-experiments]
  --ct NAME=PATH   one more patient: a CT file or DICOM folder; may be repeated
  --patients LIST  comma separated: of the four only these                        [skull,spine,pelvis,head]
  --ranks N        MPI ranks                                                                      [all cores]
  --seed N         of everything random                                                                   [1]
  --help

On two cores of a virtual machine the laptop preset takes 4 min 31 s, its 960 registrations by fields 44 s of it.
TEXT
}

# --- options -----------------------------------------------------------------------------------------------------

all_experiments=(table-1 fig-8 fig-9 fig-10 loss-split fig-14 fig-15 table-2 fig-16)
experiments=() target="$PWD/paper-experiments" preset=laptop ranks="" seed=1 patient_options=()
while (($# > 0)); do
  case "$1" in
    --preset) need_value "$1" $#; preset=$2; shift ;;
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --ct | --patients) need_value "$1" $#; patient_options+=("$1" "$2"); shift ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --seed) need_value "$1" $#; need_seed "$1" "$2"; seed=$2; shift ;;
    --help | -h) usage; exit 0 ;;
    -*) die 2 "unknown option '$1' (try --help)" ;;
    *)
      [[ " ${all_experiments[*]} " == *" $1 "* ]] || die 2 "unknown experiment '$1' (try --help)"
      experiments+=("$1")
      ;;
  esac
  shift
done
((${#experiments[@]} > 0)) || experiments=("${all_experiments[@]}")
[[ -n "$ranks" ]] || ranks=$(core_count)

# The settings of a preset; the fields have the paper's resolutions.
field_size=(--uv-nodes 64 --st-nodes 256 --codewords 16384 --training-fraction 0.1)
starts_per_interval=30
case "$preset" in
  laptop)
    range=(--max-rotation-deg 10 --max-translation-mm 30)
    poses=(--pose-count 20 --split-loss-poses 4)
    sweep=(--camera A --pose-count 10 --uv-nodes "16,32,64" --st-nodes "64,128,256" --codewords "1024,4096,16384"
      --training-fraction "0.01,0.1")
    curves=(--half-width-mm 5 --half-width-deg 5 --curve-step-mm 0.5 --curve-step-deg 0.5)
    raycast=(--raycast-starts-per-interval 1 --raycast-intervals 2)
    ;;
  check)
    field_size=(--uv-nodes 16 --st-nodes 64 --codewords 256 --training-fraction 0.5)
    range=(--max-rotation-deg 8 --max-translation-mm 20)
    poses=(--pose-count 2 --split-loss-poses 1)
    sweep=(--camera A --pose-count 2 --base-uv-nodes 16 --base-st-nodes 64 --base-codewords 256 --uv-nodes "8,16"
      --st-nodes "32,64" --codewords "64,256" --training-fraction "0.1,0.2")
    curves=(--half-width-mm 1 --half-width-deg 1 --curve-step-mm 1 --curve-step-deg 1)
    raycast=(--raycast-starts-per-interval 1 --raycast-intervals 1)
    starts_per_interval=1
    ;;
  cluster)
    range=(--max-rotation-deg 10 --max-translation-mm 100)
    poses=(--pose-count 100 --split-loss-poses 100)
    sweep=(--pose-count 100 --uv-nodes "16,32,64,128" --st-nodes "64,128,256,512"
      --codewords "256,1024,4096,16384,65536" --training-fraction "0.01,0.05,0.1,0.2")
    curves=(--half-width-mm 10 --half-width-deg 10 --curve-step-mm 0.1 --curve-step-deg 0.1)
    raycast=()
    ;;
  *) die 2 "--preset = '$preset' must be laptop, cluster or check" ;;
esac

# --- what several experiments need -------------------------------------------------------------------------------

bin=$(program_folder)
need_programs "$bin" af-precompute af-evaluate
open_output "$target"
mkdir -p "$output/fields" "$output/runs" "$output/paper"

# Every case with each of its cameras: lines "skull A".
views() {
  awk -F '"' '/^name *=/ {name = $2} /^camera *=/ {print name, $2}' "$output/patients/study.toml"
}

make_patients() {
  [[ -z "${have_patients:-}" ]] || return 0
  have_patients=yes
  say "Patients"
  "$af_root/jobs/four-patients.sh" --output "$output/patients" --seed "$seed" "${patient_options[@]}" | sed -u 's/^/    /'
  stage_inputs=$(cat "$output/patients/.stages"/*.done)
}

make_fields() {
  local case_name camera field
  [[ -z "${have_fields:-}" ]] || return 0
  have_fields=yes
  make_patients
  while read -r case_name camera; do
    field="$output/fields/$case_name-$camera.af.h5"
    stage "field-$case_name-$camera" "$field" run_ranks "$ranks" \
      "$bin/af-precompute" --study "$output/patients/study.toml" \
      --case "$case_name" --camera "$camera" "${range[@]}" "${field_size[@]}" --seed "$seed" -o "$field"
  done < <(views)
  stage study "$output/study.toml" "$bin/af-evaluate" join-studies "$output/patients/study.toml" \
    --fields 'fields/{case}-{camera}.af.h5' -o "$output/study.toml"
}

# publish NAME RUN FILE...: copies results of runs/RUN to paper/NAME.EXTENSION.
publish() {
  local name=$1 run=$2 file
  shift 2
  for file in "$@"; do
    cp "$output/runs/$run/$file" "$output/paper/$name.${file##*.}"
    say "  paper/$name.${file##*.}"
  done
}

# --- the experiments ---------------------------------------------------------------------------------------------

# Table I, Figs. 9 and 10. The cluster preset pools the fields of all patients, as the paper does.
make_sweep() {
  local first_case="" options=("${sweep[@]}")
  make_patients
  if [[ " ${sweep[*]} " == *" --camera "* ]]; then
    first_case=$(views | sed -n '1s/ .*//p')
    options+=(--case "$first_case")
  fi
  stage field-parameters "$output/runs/field-parameters/summary.json" run_ranks "$ranks" \
    "$bin/af-evaluate" field-parameters --study "$output/patients/study.toml" "${range[@]}" "${options[@]}" \
    --fields "$output/sweep-fields-$preset" --seed "$seed" \
    -o "$output/runs/field-parameters"
}

make_image_quality() {
  make_fields
  stage image-quality "$output/runs/image-quality/worst-pairs.png" run_ranks "$ranks" "$bin/af-evaluate" image-quality \
    --study "$output/study.toml" "${poses[@]}" --seed "$seed" -o "$output/runs/image-quality"
}

make_curves() {
  local case_name
  make_fields
  while read -r case_name; do
    stage "similarity-$case_name" "$output/runs/similarity-$case_name/summary.json" run_ranks "$ranks" \
      "$bin/af-evaluate" similarity-curves --study "$output/study.toml" --case "$case_name" \
      --preset paper --renderer both "${curves[@]}" \
      -o "$output/runs/similarity-$case_name"
    publish "fig-14-$case_name" "similarity-$case_name" similarity-curves.svg similarity-curves.png similarity-curves.csv
    cp "$output/runs/similarity-$case_name/maxima.csv" "$output/paper/fig-14-$case_name-maxima.csv"
  done < <(views | cut -d ' ' -f 1 | uniq)
}

# The paper's protocol: starts in eight intervals of initial TRE, 30 each, for every patient.
make_registrations() {
  make_fields
  stage registration "$output/runs/registration/summary.json" run_ranks "$ranks" "$bin/af-evaluate" registration \
    --study "$output/study.toml" --preset paper --renderer both --no-uncertainty --starts-per-interval "$starts_per_interval" --intervals 8 "${raycast[@]}" \
    --seed "$seed" -o "$output/runs/registration"
}

for experiment in "${experiments[@]}"; do
  say "== $experiment"
  case "$experiment" in
    table-1) make_sweep; publish table-1 field-parameters field-parameters.csv ;;
    fig-9) make_sweep; publish fig-9 field-parameters difference-images.png difference-images.csv ;;
    fig-10)
      make_sweep
      publish fig-10 field-parameters field-parameters.svg field-parameters.png field-parameters-poses.csv
      ;;
    fig-8)
      make_image_quality
      publish fig-8 image-quality psnr.svg psnr.png image-quality.csv
      publish fig-8-worst-pairs image-quality worst-pairs.png
      ;;
    loss-split)
      make_image_quality
      while read -r case_name camera; do
        publish "loss-split-$case_name-$camera" "image-quality/$case_name-$camera" loss-split.svg loss-split.png loss-split-poses.csv
      done < <(views)
      ;;
    fig-14) make_curves ;;
    fig-15) make_registrations; publish fig-15 registration tre-histogram.svg tre-histogram.png registrations.csv ;;
    table-2) make_registrations; publish table-2 registration cases.csv ;;
    fig-16)
      make_registrations
      publish fig-16 registration success-rate.svg success-rate.png registrations.csv
      cp "$output/runs/registration/starts-per-interval.csv" "$output/paper/fig-16-starts.csv"
      ;;
  esac
done
"$bin/af-evaluate" report "$output/runs" -o "$output/report.html"
