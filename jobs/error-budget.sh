#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Measures what each part of the chain from CT to pose adds to the error of a registration. It changes one thing after the
# other, and registers from the same starts after every change.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/error-budget.sh [OPTIONS] [-- METHOD OPTIONS OF af-evaluate]

Simulates three X-ray pairs of one CT at one pose (ideal; with the tube's spectrum; with everything), builds three fields
per camera, draws starts, registers seven times from these and prints the error budget; then four times more with DRRs of the tube's
spectrum (docs/spectra.md) and prints a second one. What is finished is kept.

  --output DIR              where everything goes                                            [./error-budget]
  --ct PATH                 the CT                                                   [a patient's skull CT]
  --starts-per-interval N   in each of --intervals intervals of 2 mm                                     [6]
  --intervals N                                                                                          [4]
  --fine-step-mm X          step of ray casting where casting must add nothing                        [0.25]
  --ranks N                 MPI ranks                                                           [all cores]
  --seed N                  of everything random                                                         [1]
  --tube-kvp KV             of the X-rays                                                              [100]
  --aluminium-mm X          their filter                                                                 [3]
  --spectra-only            without the first budget: what DRRs of the tube's spectrum do
  --quick                   small fields, 2 starts, coarse steps: to see whether it works
  --help

The method is a pyramid of gradient correlation by Gauss-Newton that ends on the pixels of the X-rays themselves, unless
METHOD OPTIONS name another, such as `-- --preset paper`.
TEXT
}

tube_kvp=100 aluminium_mm=3 spectra_only=no
output="$PWD/error-budget" ct="" starts_per_interval=6 intervals=4 fine_step_mm=0.25 seed=1
ranks=$(core_count)
field_size=(--uv-nodes 64 --st-nodes 256) codewords=16384 most_codewords=65536
method=(--chain "gc gauss-newton level=2 pixels=8 roi=2 final=0.2; gc gauss-newton level=1 pixels=4 final=0.1; gc gauss-newton pixels=2 step=2 final=0.01")

while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; output=$2; shift ;;
    --ct) need_value "$1" $#; ct=$2; shift ;;
    --starts-per-interval) need_value "$1" $#; starts_per_interval=$2; shift ;;
    --intervals) need_value "$1" $#; intervals=$2; shift ;;
    --fine-step-mm) need_value "$1" $#; fine_step_mm=$2; shift ;;
    --ranks | -n) need_value "$1" $#; ranks=$2; shift ;;
    --seed) need_value "$1" $#; seed=$2; shift ;;
    --tube-kvp) need_value "$1" $#; tube_kvp=$2; shift ;;
    --aluminium-mm) need_value "$1" $#; aluminium_mm=$2; shift ;;
    --spectra-only) spectra_only=yes ;;
    --quick)
      starts_per_interval=1 intervals=2 fine_step_mm=2 codewords=512 most_codewords=1024
      field_size=(--uv-nodes 16 --st-nodes 64)
      ;;
    --help | -h) usage; exit 0 ;;
    --) shift; method=("$@"); break ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done

bin=$(program_folder)
need_programs "$bin" af-simulate af-precompute af-evaluate
open_output "$output"
mkdir -p "$output/studies" "$output/fields" "$output/runs"
stages_are_a_chain=yes stages_of_any_build=yes

if [[ -z "$ct" ]]; then
  ct="$output/skull.mhd"
  stage skull.mhd "$ct" "$af_root/jobs/default-ct.sh" "$ct"
fi

# --- the same patient, pose and cameras in three pairs of X-rays ---------------------------------------------------

simulate() {
  local name=$1
  shift
  stage "studies/$name" "$output/studies/$name/study.toml" \
    "$bin/af-simulate" --ct "$ct" --case patient --seed "$seed" --force -o "$output/studies/$name" "$@"
}
nothing=(--no-fiducials --scatter-to-primary 0 --photons-per-pixel 0 --blur-sigma-px 0 --bits 0)
simulate ideal "${nothing[@]}" --tube-kvp 0
tube=(--tube-kvp "$tube_kvp" --aluminium-mm "$aluminium_mm")
simulate spectrum "${nothing[@]}" "${tube[@]}"
simulate xrays "${tube[@]}"

# --- three fields per camera: by the reference caster, by shear-warp, and as they are shipped -----------------------

field_options=() material=""
field() {
  local name=$1 camera path
  shift
  field_options=()
  for camera in A B; do
    path="fields/$name-$camera$material.af.h5"
    stage "$path" "$output/$path" run_ranks "$ranks" \
      "$bin/af-precompute" --study "$output/studies/xrays/study.toml" --camera "$camera" \
      --max-rotation-deg 10 --max-translation-mm 30 "${field_size[@]}" --seed "$seed" "$@" \
      -o "$output/$path"
    field_options+=(--field "$camera=$output/$path")
  done
}

# --- registrations from the same starts ----------------------------------------------------------------------------

starts=()
register() {
  local name=$1 study=$2
  shift 2
  stage "runs/$name" "$output/runs/$name/summary.json" run_ranks "$ranks" "$bin/af-evaluate" registration \
    --study "$output/studies/$study/study.toml" --gold study "${method[@]}" --no-uncertainty \
    --intervals "$intervals" --starts-per-interval "$starts_per_interval" --seed "$seed" "${starts[@]}" "$@" -o "$output/runs/$name"
}

field shipped --codewords "$codewords"
stage runs/starts "$output/runs/starts/starts.csv" \
  "$bin/af-evaluate" registration --study "$output/studies/xrays/study.toml" --gold study \
  "${field_options[@]}" --intervals "$intervals" --starts-per-interval "$starts_per_interval" --seed "$seed" \
  --starts-only -o "$output/runs/starts"
starts=(--starts-from "$output/runs/starts/starts.csv")
register field-shipped xrays "${field_options[@]}"
shipped=("${field_options[@]}")
if [[ "$spectra_only" == no ]]; then
  field shear-warp --codewords "$most_codewords"
  register field-shear-warp xrays "${field_options[@]}"
  field trilinear --codewords "$most_codewords" --caster trilinear
  register field-trilinear xrays "${field_options[@]}"
  register raycast xrays --renderer raycast
fi
register raycast-fine xrays --renderer raycast --step-mm "$fine_step_mm"
register raycast-spectrum spectrum --renderer raycast --step-mm "$fine_step_mm"
register raycast-ideal ideal --renderer raycast --step-mm "$fine_step_mm"

if [[ "$spectra_only" == no ]]; then
  "$bin/af-evaluate" error-budget \
    --step "method alone: ray casting every $fine_step_mm mm, ideal X-rays=$output/runs/raycast-ideal" \
    --step "HU model: the tube's spectrum=$output/runs/raycast-spectrum" \
    --step "X-rays: scatter, noise, blur, grey levels, pins=$output/runs/raycast-fine" \
    --step "casting: every 1 mm=$output/runs/raycast" \
    --step "interpolation: field of the reference caster, $most_codewords codewords=$output/runs/field-trilinear" \
    --step "casting of fields: shear-warp=$output/runs/field-shear-warp" \
    --step "quantisation: $codewords codewords=$output/runs/field-shipped" \
    -o "$output/budget"
fi

# --- DRRs of the tube's spectrum -----------------------------------------------------------------------------------

material=.bone field shipped --material bone --codewords "$codewords"
register tube-spectrum spectrum --renderer raycast --step-mm "$fine_step_mm" "${tube[@]}"
register tube-wrong spectrum --renderer raycast --step-mm "$fine_step_mm" --tube-kvp $((tube_kvp - 20)) \
  --aluminium-mm "$aluminium_mm"
register tube-fine xrays --renderer raycast --step-mm "$fine_step_mm" "${tube[@]}"
register tube-shipped xrays "${shipped[@]}" "${tube[@]}"

"$bin/af-evaluate" error-budget \
  --step "method alone: ray casting every $fine_step_mm mm, ideal X-rays=$output/runs/raycast-ideal" \
  --step "X-rays of the tube's spectrum, DRRs of one energy=$output/runs/raycast-spectrum" \
  --step "DRRs of a tube of $((tube_kvp - 20)) instead of $tube_kvp kV=$output/runs/tube-wrong" \
  --step "DRRs of the tube's spectrum=$output/runs/tube-spectrum" \
  --step "X-rays: scatter, noise, blur, grey levels, pins=$output/runs/tube-fine" \
  --step "DRRs of one energy again=$output/runs/raycast-fine" \
  --step "looked up: fields as shipped, one energy=$output/runs/field-shipped" \
  --step "looked up: fields of two materials, the tube's spectrum=$output/runs/tube-shipped" \
  -o "$output/spectra"
