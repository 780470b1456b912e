#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Tests the stage engine of jobs/: what is done again, and what a failure says. Usage: stages.sh ROOT
set -euo pipefail
root=$(cd "$1" && pwd)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"

fail() {
  echo "stages: $*" >&2
  cat out.txt >&2
  exit 1
}

# program NAME EXIT_CODE: a program that writes its words to what stands after -o, and counts its runs there.
program() {
  cat >"$1" <<TEXT
#!/bin/sh
echo run >>runs
while [ \$# -gt 1 ]; do
  [ "\$1" != -o ] || echo "\$*" >>"\$2"
  shift
done
exit $2
TEXT
  chmod +x "$1"
}

# study EXIT_CODE TEXT: runs a script of these stages, as those of jobs/ do.
study() {
  local expected=$1 status=0
  {
    printf 'set -euo pipefail\nsource "%s/jobs/lib.sh"\nsource "%s/jobs/stages.sh"\nopen_output out\n' "$root" "$root"
    printf '%s\n' "$2"
  } >study.sh
  bash study.sh >out.txt 2>&1 || status=$?
  ((status == expected)) || fail "exit code $status instead of $expected of: $2"
}
runs_are() { (($(wc -l <runs) == $1)) || fail "$(wc -l <runs) runs instead of $1"; }
says() { grep -Fq "$1" out.txt || fail "does not say: $1"; }

program ./tool 0
study 0 'stage "a/b c" one ./tool -o one'
says 'a/b c'
runs_are 1
[[ -f out/logs/a-b-c.log && -f out/.stages/a-b-c.done ]] || fail "no log or stamp of the stage"
study 0 'stage "a/b c" one ./tool -o one'
says 'done before'
runs_are 1
study 0 'stage "a/b c" one ./tool --fast -o one'
runs_are 2
study 0 'stage_inputs=other; stage "a/b c" one ./tool --fast -o one'
runs_are 3
rm one
study 0 'stage_inputs=other; stage "a/b c" one ./tool --fast -o one'
runs_are 4

# Another build of the program counts, unless it must not.
echo '# changed' >>tool
study 0 'stage_inputs=other; stage "a/b c" one ./tool --fast -o one'
runs_are 5
study 0 'stages_of_any_build=yes; stage build two ./tool -o two'
echo '# changed again' >>tool
study 0 'stages_of_any_build=yes; stage build two ./tool -o two'
says 'done before'
runs_are 6

# In a chain, a stage is done again when an earlier one has changed.
study 0 'stages_are_a_chain=yes; stage first a ./tool -o a; stage second b ./tool -o b'
runs_are 8
study 0 'stages_are_a_chain=yes; stage first a ./tool --fast -o a; stage second b ./tool -o b'
runs_are 10

# Work that was begun with other options stays, or is thrown away.
mkdir three.progress
study 0 'stage third three run_ranks 1 ./tool -o three'
[[ -d three.progress ]] || fail "unfinished work is gone"
study 0 'stages_start_anew=yes; stage third three run_ranks 1 ./tool --fast -o three'
[[ ! -d three.progress && $(wc -l <three) == 1 ]] || fail "what other options have made is still there"
runs_are 12

# Failures end the script and leave the stage to be done.
program ./broken 5
study 5 'stage fourth four ./broken -o four; echo not reached'
says 'fourth failed with exit code 5; its log is'
! grep -q 'not reached' out.txt || fail "the script went on after a failure"
program ./stopped 75
study 75 'stage fourth four ./stopped -o four'
says 'fourth was stopped with its progress saved: run the same command again'
study 6 'stage fourth elsewhere ./tool -o four'
says 'fourth ended without its output elsewhere'
program ./af-register 7
study 0 'stage fifth five ./af-register -o five'
says 'Nothing was found'
program ./other 7
study 7 'stage sixth six ./other -o six'

# Only one run at a time may use a folder.
study 3 'bash study.sh'
says 'another run is at work in'
echo "stages: all as it should be"
