# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# Simulated studies of one anatomy, clean and under stress, shared by the scripts that compare methods or fields on
# them. Sourced after stages.sh, never run; the caller sets bin, output, seed and roi_px.
# shellcheck disable=SC2154

# stress_of VARIANT: the value of af-simulate --stress; nothing for clean.
stress_of() {
  case "$1" in
    clean) ;;
    all) echo all ;;
    stressed) echo rods,fiducials,heel,noise,degraded-ct ;;
    moving) echo rods,fiducials,heel,noise,degraded-ct,motion ;;
    *) echo "${1//+/,}" ;;
  esac
}

# make_study NAME-VARIANT KIND SOURCE STRESS: makes a simulated case whose regions of --roi-px are centred on the detectors.
make_study() {
  local name=$1 kind=$2 source=$3 stress=$4 study="$output/studies/$1/study.toml" corner=$(((512 - roi_px) / 2))
  "$bin/af-simulate" "--$kind" "$source" --case "${name%%-*}" --rig treatment-room --seed "$seed" --no-fiducials \
    --roi-px "$roi_px" "$roi_px" ${stress:+--stress "$stress"} --force -o "$output/studies/$name" &&
    # af-simulate enlarges regions until they hold the target box.
    sed -i "s/^roi_px.*/roi_px = [$corner, $corner, $roi_px, $roi_px]/" "$study"
}
