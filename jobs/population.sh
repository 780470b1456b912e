#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Registration of many different patients: success with intervals over patients, on clean X-rays and under all stresses.
set -euo pipefail
# shellcheck source-path=SCRIPTDIR
source "$(dirname "${BASH_SOURCE[0]}")/lib.sh"
# shellcheck source=stages.sh
source "$af_root/jobs/stages.sh"
# shellcheck source=anatomies.sh
source "$af_root/jobs/anatomies.sh"

usage() {
  cat <<'TEXT'
Usage: jobs/population.sh [OPTIONS]

Draws patients (af-simulate --phantom KIND --anatomy-seed N; kinds in turn), takes X-rays of each at several true poses with
noise of their own, clean and under all stresses, builds one pair of fields per patient and CT, registers from the same
starts with every preset, with two views and with one, some by ray casting, and writes population.md, CSVs and figures with
intervals over patients. Patients of odd numbers are the half to tune on, those of even numbers the half to judge on.
One patient is finished before the next, and the tables are made of those that are finished; after a stop, run the same
command again, also with more patients. Needs the programs in build/release/bin (or installed).

  --output DIR            where everything goes                                                       [./population]
  --patients N            drawn patients                                                                        [60]
  --first N               number of the first one                                                                [1]
  --kinds LIST            comma separated, in turn                                                [spine,pelvis,head]
  --ct NAME=PATH          one more patient: a real CT; may be repeated
  --poses N               true poses, each with noise and stresses of its own, per patient                       [3]
  --variants LIST         clean, all, or names that af-simulate --stress takes, joined by +. moved, moved+all and so
                          on: a bone has moved against the rest in the X-rays (af-simulate --moved-bone); with one of
                          these the patient's bones are the targets of all variants, in turn              [clean,all]
  --presets LIST          comma separated                                                       [robust,fast,paper]
  --views LIST            2, 1 or both                                                                         [2,1]
  --intervals N           intervals of initial TRE of 2 mm, from 0                                              [15]
  --starts N              starts in each of them per true pose                                                   [1]
  --raycast-patients N    of the first N patients, on clean X-rays, also by ray casting with robust:            [12]
  --raycast-intervals N   ... one start in each of the first N intervals                                         [4]
  --simulate OPTIONS      options of af-simulate, in one word                                                 [none]
  --field OPTIONS         options of af-precompute, in one word                                  [--preset standard]
  --registration OPTIONS  options of af-evaluate registration, in one word                                    [none]
  --max-rotation-deg X    range of the fields, degrees                                                          [20]
  --max-translation-mm X  range of the fields, mm                                                               [40]
  --quick                 6 patients, 2 poses, ray casting of 1 patient
  --slurm                 make the studies here, then submit fields and registrations of every condition to Slurm by
                          jobs/submit.sh; run with --tables when all have ended
  --resources FILE        with --slurm: ranks, memory, time limits                       [jobs/slurm/resources.sh]
  --dry-run               with --slurm: print the chains, submit nothing
  --tables                only make the tables of what is finished
  --ranks N               MPI ranks of fields and registrations                                           [all cores]
  --seed N                of true poses, noise and starts                                                        [1]
  --help
TEXT
}

# A moved bone changes only the X-rays. The CT and the fields are those of the variant without it.
ct_variant_of() { case "$1" in moved) echo clean ;; moved+*) echo "${1#moved+}" ;; *) echo "$1" ;; esac }

# --- options -----------------------------------------------------------------------------------------------------

target="$PWD/population" patients=60 first=1 kinds=spine,pelvis,head poses=3 variants=clean,all presets=robust,fast,paper
views=2,1 intervals=15 starts=1 raycast_patients=12 raycast_intervals=4 field_words="--preset standard"
max_rotation_deg=20 max_translation_mm=40 ranks=$(core_count) seed=1 mode=local resources="$af_root/jobs/slurm/resources.sh"
simulate_words="" registration_words="" cts=() dry_run_option=()
while (($# > 0)); do
  case "$1" in
    --output | -o) need_value "$1" $#; target=$2; shift ;;
    --patients) need_value "$1" $#; need_seed "$1" "$2"; patients=$2; shift ;;
    --first) need_value "$1" $#; need_count "$1" "$2"; first=$2; shift ;;
    --kinds) need_value "$1" $#; kinds=$2; shift ;;
    --ct) need_value "$1" $#; need_ct "$1" "$2"; cts+=("$named_ct"); shift ;;
    --poses) need_value "$1" $#; need_count "$1" "$2"; poses=$2; shift ;;
    --variants) need_value "$1" $#; variants=$2; shift ;;
    --presets) need_value "$1" $#; presets=$2; shift ;;
    --views) need_value "$1" $#; views=$2; shift ;;
    --intervals) need_value "$1" $#; need_count "$1" "$2"; intervals=$2; shift ;;
    --starts) need_value "$1" $#; need_count "$1" "$2"; starts=$2; shift ;;
    --raycast-patients) need_value "$1" $#; need_seed "$1" "$2"; raycast_patients=$2; shift ;;
    --raycast-intervals) need_value "$1" $#; need_count "$1" "$2"; raycast_intervals=$2; shift ;;
    --simulate) need_value "$1" $#; simulate_words=$2; shift ;;
    --field) need_value "$1" $#; field_words=$2; shift ;;
    --registration) need_value "$1" $#; registration_words=$2; shift ;;
    --max-rotation-deg) need_value "$1" $#; max_rotation_deg=$2; shift ;;
    --max-translation-mm) need_value "$1" $#; max_translation_mm=$2; shift ;;
    --quick) patients=6 poses=2 raycast_patients=1 raycast_intervals=2 ;;
    --slurm) mode=slurm ;;
    --resources) need_value "$1" $#; resources=$(realpath "$2"); shift ;;
    --dry-run) dry_run_option=(--dry-run) ;;
    --tables) mode=tables ;;
    --ranks | -n) need_value "$1" $#; need_count "$1" "$2"; ranks=$2; shift ;;
    --seed) need_value "$1" $#; need_seed "$1" "$2"; seed=$2; shift ;;
    --help | -h) usage; exit 0 ;;
    *) die 2 "unknown option '$1' (try --help)" ;;
  esac
  shift
done
IFS=, read -r -a kind_list <<<"$kinds"
IFS=, read -r -a variant_list <<<"$variants"
IFS=, read -r -a preset_list <<<"$presets"
IFS=, read -r -a view_list <<<"$views"
has_moved_bones=no
for ((i = 0; i < ${#variant_list[@]}; ++i)); do
  [[ "${variant_list[i]}" == moved* ]] || continue
  has_moved_bones=yes
  [[ " ${variant_list[*]:0:i} " == *" $(ct_variant_of "${variant_list[i]}") "* ]] ||
    die 2 "--variants = '$variants': ${variant_list[i]} needs $(ct_variant_of "${variant_list[i]}") before it, whose CT and fields it shares"
done
read -r -a simulate_options <<<"$simulate_words"
read -r -a field_options <<<"$field_words"
read -r -a registration_options <<<"$registration_words"
for count in "${view_list[@]}"; do
  [[ "$count" == [12] ]] || die 2 "--views = '$views' must name 2, 1 or both"
done
for kind in "${kind_list[@]}"; do
  [[ "$kind" =~ ^(spine|pelvis|head)$ ]] || die 2 "--kinds = '$kinds' must name some of spine, pelvis, head"
done
[[ $has_moved_bones == no ]] || ((${#cts[@]} == 0)) || die 2 "--variants = '$variants': a bone moves in drawn patients, not in a --ct"

bin=$(program_folder)
need_programs "$bin" af-simulate af-precompute af-evaluate af-inspect
open_output "$target"
mkdir -p "$output"/{studies,fields,starts,runs}
# A new build of the programs does not invalidate what was measured; population.md names the commit.
stages_of_any_build=yes

# --- one patient -------------------------------------------------------------------------------------------------

# bone_option PATIENT VARIANT: the option that makes a bone of the patient the target, and moves it.
bone_option() {
  local number=$((10#${1##*-})) bones option=--target-bone
  case "$1" in
    spine-*) bones=(T9 T10 T11 T12 L1 L2 L3) ;;
    pelvis-*) bones=(left-femur right-femur) ;;
    head-*) bones=(jaw) ;;
  esac
  [[ "$2" != moved* ]] || option=--moved-bone
  printf '%s\n' "$option" "${bones[$((number / ${#kind_list[@]} % ${#bones[@]}))]}"
}

# make_session PATIENT SOURCE VARIANT POSE: makes X-rays of a patient at one true pose. One planning CT serves all poses, so
# those after the first refer to the first one's. That matters if the CT is degraded by noise of its own.
make_session() {
  local patient=$1 source=$2 variant=$3 pose=$4 name="$1-$3-p$4" ct_variant stress words bone=()
  IFS=$'\t' read -r -a words <<<"$source"
  ct_variant=$(ct_variant_of "$variant")
  stress=$(stress_of "$ct_variant")
  [[ $has_moved_bones == no ]] || readarray -t bone < <(bone_option "$patient" "$variant")
  "$bin/af-simulate" "${words[@]}" "${bone[@]}" --case "$patient-p$pose" --rig treatment-room \
    --seed "$((seed * 1000 + pose))" --no-fiducials ${stress:+--stress "$stress"} "${simulate_options[@]}" --force \
    -o "$output/studies/$name" || return
  [[ "$name" != "$patient-$ct_variant-p1" ]] || return 0
  [[ ! -f "$output/studies/$name/ct.nii.gz" ]] || rm "$output/studies/$name/ct.nii.gz"
  sed -i "s|^ct = \"ct.nii.gz\"|ct = \"../$patient-$ct_variant-p1/ct.nii.gz\"|" "$output/studies/$name/study.toml"
}

# one_view STUDY OUTPUT: writes the study with only the first view of every case.
one_view() { awk '/^\[\[case\]\]/ { views = 0 } /^\[\[case.view\]\]/ { ++views } views < 2' "$1" >"$2"; }

# sessions PATIENT SOURCE VARIANT: makes studies of all true poses, with two views and with one, and sets study.
sessions() {
  local patient=$1 variant=$3 pose studies=()
  study="$output/studies/$patient-$variant-2.toml"
  for ((pose = 1; pose <= poses; ++pose)); do
    stage "study $patient-$variant-p$pose" "$output/studies/$patient-$variant-p$pose/study.toml" \
      make_session "$1" "$2" "$variant" "$pose"
    studies+=("$output/studies/$patient-$variant-p$pose/study.toml")
  done
  stage "join $patient-$variant" "$study" "$bin/af-evaluate" join-studies "${studies[@]}" \
    --fields "$output/fields/$patient-$(ct_variant_of "$variant")-{camera}.af.h5" -o "$study"
  one_view "$study" "${study%-2.toml}-1.toml"
}

# register FOLDER STUDY OPTIONS...
register() {
  local folder=$1 study=$2
  shift 2
  stage "$folder" "$output/runs/$folder/summary.json" run_ranks "$ranks" "$bin/af-evaluate" registration \
    --study "$study" --gold study --intervals "$intervals" --starts-per-interval "$starts" --seed "$seed" \
    --start-rule within-range --no-pictures "${registration_options[@]}" "$@" -o "$output/runs/$folder"
}

# study_patient NAME SOURCE: runs every condition for one patient.
study_patient() {
  local patient=$1 variant ct_variant camera count preset study
  stage_inputs="$2, seed $seed, $poses poses, $simulate_words, $field_words, $max_rotation_deg deg, $max_translation_mm mm: "
  for variant in "${variant_list[@]}"; do
    sessions "$patient" "$2" "$variant"
    ct_variant=$(ct_variant_of "$variant")
    for camera in A B; do
      stage "field $patient-$ct_variant-$camera" "$output/fields/$patient-$ct_variant-$camera.af.h5" run_ranks "$ranks" \
        "$bin/af-precompute" --study "$output/studies/$patient-$ct_variant-p1/study.toml" --camera "$camera" \
        "${field_options[@]}" --max-rotation-deg "$max_rotation_deg" --max-translation-mm "$max_translation_mm" \
        --seed "$seed" -o "$output/fields/$patient-$ct_variant-$camera.af.h5"
    done
    for count in "${view_list[@]}"; do
      for preset in "${preset_list[@]}"; do
        register "$variant-$count-$preset/$patient" "${study%-2.toml}-$count.toml" --preset "$preset"
      done
    done
  done
  if ((done_patients < raycast_patients)) && [[ ",$variants," == *,clean,* ]]; then
    register "clean-2-robust-by-both/$patient" "$output/studies/$patient-clean-2.toml" --preset robust --renderer both \
      --raycast-intervals "$raycast_intervals" --raycast-starts-per-interval 1 --step-mm 0.5 --no-uncertainty
  fi
  done_patients=$((done_patients + 1))
}

# --- on a cluster ------------------------------------------------------------------------------------------------

# all_patients FUNCTION [ARGUMENT]: calls FUNCTION NAME SOURCE [ARGUMENT] for every patient, with number and kind set.
all_patients() {
  local number kind ct
  for ((number = first; number < first + patients; ++number)); do
    kind=${kind_list[$(((number - 1) % ${#kind_list[@]}))]}
    "$1" "$(printf '%s-%03d' "$kind" "$number")" $'--phantom\t'"$kind"$'\t--anatomy-seed\t'"$number" "${@:2}"
  done
  for ct in "${cts[@]}"; do
    "$1" "${ct%%=*}" $'--ct\t'"${ct#*=}" "${@:2}"
  done
}

# gather NAME SOURCE VARIANT: adds one more patient to the studies for a cluster.
gather() {
  stage_inputs="$2"
  sessions "$1" "$2" "$3"
  gathered+=("$output/studies/$1-$3-2.toml")
}

# submit_conditions: submits one chain of jobs per variant, number of views and preset, each by jobs/submit.sh. A chain
# builds a field per case and camera.
submit_conditions() {
  local variant count preset condition gathered
  for variant in "${variant_list[@]}"; do
    gathered=()
    all_patients gather "$variant"
    stage_inputs="${gathered[*]}"
    stage "join $variant" "$output/$variant-2.toml" "$bin/af-evaluate" join-studies "${gathered[@]}" -o "$output/$variant-2.toml"
    # submit.sh says which fields there are.
    sed -i '/^field = /d' "$output/$variant-2.toml"
    one_view "$output/$variant-2.toml" "$output/$variant-1.toml"
    for count in "${view_list[@]}"; do
      for preset in "${preset_list[@]}"; do
        condition="$variant-$count-$preset"
        {
          cat "$resources"
          printf 'precompute_options=('
          printf '%q ' "${field_options[@]}" --max-rotation-deg "$max_rotation_deg" --max-translation-mm "$max_translation_mm"
          printf ')\nevaluate_options=('
          printf '%q ' --preset "$preset" --gold study --intervals "$intervals" --starts-per-interval "$starts" \
            --seed "$seed" --start-rule within-range --no-pictures "${registration_options[@]}"
          printf ')\n'
        } >"$output/$condition-resources.sh"
        "$af_root/jobs/submit.sh" "$output/$variant-$count.toml" --resources "$output/$condition-resources.sh" \
          --output "$output/slurm/$condition" "${dry_run_option[@]}"
      done
    done
  done
}

# --- tables ------------------------------------------------------------------------------------------------------

# make_tables: makes the tables, from the patients that are finished.
make_tables() {
  local conditions=() folder
  for folder in "$output"/runs/*/ "$output"/slurm/*/registration/; do
    compgen -G "$folder*/summary.json" >/dev/null || continue
    conditions+=(--condition "$(basename "${folder%registration/}")=$folder")
  done
  ((${#conditions[@]} > 0)) || die 4 "$output: no registrations are finished yet"
  "$bin/af-evaluate" population "${conditions[@]}" --seed "$seed" -o "$output/tables"
}

done_patients=0
case "$mode" in
  local)
    all_patients study_patient
    make_tables
    ;;
  slurm) submit_conditions ;;
  tables) make_tables ;;
esac
