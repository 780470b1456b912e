# shellcheck shell=bash
# SPDX-License-Identifier: Apache-2.0
# Stages of a study. Each is one command, and is repeated only when its inputs have changed. Every script in jobs/ that runs
# several commands sources this file, after lib.sh. jobs/slurm/stage.sbatch sources only this file, because a batch job sees
# no other file of jobs/. It runs its command itself, and calls nothing below `open_output`.

# The inputs of the next stage besides its words. The caller sets them.
stage_inputs=""
# yes: every stage also depends on all stages before it.
stages_are_a_chain=no
# yes: a new build of the programs makes no difference.
stages_of_any_build=no
# yes: a stage whose inputs have changed starts from nothing. no: the program refuses to continue unfinished work with other
# options, and says so.
stages_start_anew=no

# stage_key INPUTS COMMAND...: a hash of a stage's inputs and command.
stage_key() {
  local program=$2
  [[ "$program" != run_ranks ]] || program=$4
  {
    printf '%s\n' "$@"
    [[ "$stages_of_any_build" == yes ]] || sha256sum <"$program"
  } | sha256sum | cut -d ' ' -f 1
}

# is_stage_done STAMP KEY RESULT
is_stage_done() { [[ -f "$1.done" && "$(<"$1.done")" == "$2" && -e "$3" ]]; }

# mark_stage STAMP KEY STATE: STATE is done or started.
mark_stage() {
  printf '%s\n' "$2" >"$1.partial"
  mv "$1.partial" "$1.$3"
}

# value_of OPTION WORDS...: the word after OPTION, if it is there.
value_of() {
  local option=$1
  shift
  while (($# > 1)); do
    if [[ "$1" == "$option" ]]; then
      echo "$2"
      return
    fi
    shift
  done
}

# result_of COMMAND...: the file that exists once the command has done all of its work.
result_of() {
  local output
  output=$(value_of -o "$@")
  [[ " $* " != *" registration "* ]] || output+=/summary.json
  echo "$output"
}

# progress_of COMMAND...: the folder of the command's unfinished work.
progress_of() { echo "$(value_of -o "$@").progress"; }

# bytes_in FOLDER: the total size of all files; 0 when there is none.
bytes_in() { { find "$1" -type f -printf '%s\n' 2>/dev/null || true; } | awk '{sum += $1} END {print sum + 0}'; }

# parts_of PATH: sets parts to the path and, where it is a header, to the voxels beside it.
parts_of() {
  parts=("$1")
  [[ "$1" != *.mhd && "$1" != *.nhdr ]] || parts=("${1%.*}".*)
}

# state_of PATH...: name, size and time of a file (also of the voxels beside a header) or of all files in a folder. For a
# missing file it says that it is missing.
state_of() {
  local path parts
  for path in "$@"; do
    parts_of "$path"
    find -L "${parts[@]}" -type f -printf '%p %s %T@\n' 2>&1 | LC_ALL=C sort || true
  done
}

# read_by LISTED COMMAND...: sets read_paths to the CT, X-rays, masks and rig of the command's case, and to the fields that
# it reads. LISTED is what `af-inspect --list-inputs` prints for the study.
read_by() {
  local listed=$1 case_name name path
  shift
  read_paths=()
  case_name=$(value_of --case "$@")
  while IFS=$'\t' read -r name path; do
    [[ "$name" != "$case_name" ]] || read_paths+=("$path")
  done <<<"$listed"
  while (($# > 1)); do
    [[ "$1" != --field ]] || read_paths+=("${2#*=}")
    shift
  done
}

# inputs_of AF_INSPECT COMMAND...: a hash of the study, and of the states of the other files that the command reads.
inputs_of() {
  local inspect=$1 study listed read_paths
  shift
  study=$(value_of --study "$@")
  listed=$("$inspect" --list-inputs "$study") || return
  read_by "$listed" "$@"
  { sha256sum <"$study" && state_of "${read_paths[@]}"; } | sha256sum
}

# set_launch STAGE: sets launch to the words that start the ranks of a stage in a Slurm job, according to the resources.
# shellcheck disable=SC2034,SC2154  # the caller reads launch, and has read the resources
set_launch() {
  case "$launcher-$1" in
    *-report) launch=() ;;
    srun-*) launch=(srun "${srun_options[@]}" --kill-on-bad-exit=1) ;;
    mpirun-*) launch=(mpirun "${mpirun_options[@]}") ;;
    *)
      echo "resources.sh: launcher = '$launcher' must be srun or mpirun" >&2
      exit 2
      ;;
  esac
}

# open_output DIR: makes the folder, sets output to its full path, and locks other runs out of it.
open_output() {
  mkdir -p "$1/.stages" "$1/logs"
  output="$(cd "$1" && pwd)"
  exec {output_lock}>"$output/.stages/lock"
  flock --nonblock "$output_lock" || die 3 "another run is at work in $output"
  trap 'tell_of_stop $?' EXIT
}

# stage_title: the title of a stage on the screen, if it is not its name. stage_report: lines about what was done, and how
# long it took.
stage_title="" current_stage="" stage_report=()

# tell_of_stop STATUS: says, on exit, that the stage was stopped.
tell_of_stop() {
  if (($1 == 130 || $1 == 143)) && [[ -n "$current_stage" ]]; then
    printf '\nStopped in stage "%s". Run the same command again to go on.\n' "$current_stage" >&2
  fi
}

# forget_stage COMMAND...: removes what another command has made, or begun, where this one's output belongs.
forget_stage() {
  local old
  old=$(value_of -o "$@")
  [[ -z "$old" ]] || rm -rf "$old" "$old.progress" "$old.partial"
}

# run_logged LOG COMMAND...: runs the command. Its output goes to LOG, below the command, and indented to the screen.
run_logged() {
  local log=$1
  shift
  { printf '# ' && printf '%q ' "$@" && printf '\n'; } >"$log"
  "$@" </dev/null 2>&1 | tee -a "$log" | sed -u 's/^/        /'
  return "${PIPESTATUS[0]}"
}

# stage NAME RESULT COMMAND...: runs a command unless it made RESULT before with the same words and the same stage_inputs.
# An interrupted stage keeps its output, from which the program continues.
stage() {
  local title=${stage_title:-$1} name=${1//[\/ ]/-} result=$2 start=$SECONDS status=0 key
  shift 2
  local stamp="$output/.stages/$name" log="$output/logs/$name.log"
  key=$(stage_key "$stage_inputs" "$@")
  [[ "$stages_are_a_chain" == no ]] || stage_inputs=$key
  if is_stage_done "$stamp" "$key" "$result"; then
    say "$title: done before"
    return
  fi
  rm -f "$stamp.done"
  if [[ "$stages_start_anew" == yes && "$(cat "$stamp.started" 2>/dev/null)" != "$key" ]]; then
    forget_stage "$@"
  fi
  mark_stage "$stamp" "$key" started
  current_stage=$title
  say "$title"
  run_logged "$log" "$@" || status=$?
  end_stage "$status" "$@"
  [[ -e "$result" ]] || die 6 "$title ended without its output $result; its log is $log"
  mark_stage "$stamp" "$key" "done"
  current_stage=""
  say "        $(duration $((SECONDS - start)))"
  stage_report+=("$(printf '  %-76s %s' "$title" "$(duration $((SECONDS - start)))")")
}

# end_stage STATUS COMMAND...: ends the script, unless the command has done its work.
end_stage() {
  local status=$1 program=$2
  shift
  [[ "$program" != run_ranks ]] || program=$3
  if ((status == 7)) && [[ "$(basename "$program")" == af-register ]]; then
    say "        Nothing was found; the results say why: $(value_of -o "$@")"
  elif ((status == 75)); then
    die 75 "$current_stage was stopped with its progress saved: run the same command again"
  elif ((status != 0)); then
    die "$status" "$current_stage failed with exit code $status; its log is $log"
  fi
}
