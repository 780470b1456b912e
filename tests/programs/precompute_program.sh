#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Runs af-precompute as a person would: exit codes, dry run, stop and resume, the same payload on other ranks and widths.
#
#   precompute_program.sh AF_PRECOMPUTE MPIEXEC SECTION [sanitized]
#
# SECTION: refusals, spacing, ranks, budget, memory, corrections or stops, a function below.
# sanitized: the program was compiled with a sanitizer, which takes memory and time of its own. Its memory is not judged,
# its limit is larger, and it runs on at most 4 ranks.
set -euo pipefail

# shellcheck source=tests/programs/body_ct.sh
. "$(dirname "$0")/body_ct.sh"

program=$1
mpiexec=$2
section=$3
sanitized=${4:-}
rank_counts=(2 3 4 8)
memory_limit=120
if [[ -n $sanitized ]]; then
  rank_counts=(2 3 4)
  memory_limit=300
fi
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cd "$scratch"

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

make_ct >ct.mha

# expect CODE PATTERN ARGUMENTS...: exit code and a text on standard error; nothing may be left behind.
expect() {
  local code=$1 pattern=$2 found=0
  shift 2
  "$program" "$@" >out 2>err || found=$?
  [[ $found == "$code" ]] || fail "$* gave $found instead of $code: $(cat err)"
  grep -q -- "$pattern" err || fail "$* did not say '$pattern': $(cat err)"
  [[ -z $(find . -name 'refused.h5*') ]] || fail "$* left $(find . -name 'refused.h5*')"
}
common=(--ct ct.mha --rig c-arm-12in --camera AP --max-translation-mm 30 --uv-nodes 9 --st-nodes 61 --codewords 200 --training-fraction 0.5)

# refuse CODE PATTERN OPTION VALUE...: expect with the common options, one of them replaced or added, and an output name.
refuse() {
  local code=$1 pattern=$2 option=$3 i kept=()
  shift 2
  for ((i = 0; i < ${#common[@]}; i += 2)); do
    [[ ${common[i]} == "$option" ]] || kept+=("${common[@]:i:2}")
  done
  expect "$code" "$pattern" "${kept[@]}" "$@"
}
hash_of() { sed -n 's/.*sha256 //p' "$1"; }
planes() { sed -n 's/.*(s,t) plane .* mm, \([0-9]*\) x [0-9]* nodes, \([0-9.]*\) x \([0-9.]*\) mm apart.*/\1 \2\n\1 \3/p' "$1"; }
# same_hash RANKS EXPECTED OPTIONS...
same_hash() {
  local ranks=$1 expected=$2
  shift 2
  "$mpiexec" -n "$ranks" "$program" "$@" -o ranks.h5 >ranks.txt 2>ranks.err ||
    fail "$ranks ranks: $(cat ranks.err)"
  [[ $(hash_of ranks.txt) == "$expected" ]] || fail "another payload on $ranks ranks: $*"
  [[ ! -e ranks.h5.progress && ! -e ranks.h5.partial ]] || fail 'work files are left'
}

refusals() {
  expect 2 "unknown option '--no-such-option'" --no-such-option
  expect 2 'excludes' --study s.toml "${common[@]}"
  expect 2 '-o FIELD.h5' "${common[@]}"
  expect 2 'AP, LAT' --ct ct.mha --rig c-arm-12in -o refused.h5
  expect 2 'name a CT' -o refused.h5
  refuse 3 'codewords = 65537' --codewords 65537 -o refused.h5
  refuse 3 'uv_nodes = 1' --uv-nodes 1 -o refused.h5
  refuse 3 'slabs = 0' --slabs 0 -o refused.h5
  refuse 3 'slabs = 60: must be' --slabs 60 -o refused.h5
  refuse 3 'caster = bilinear' --caster bilinear -o refused.h5
  refuse 3 'training_fraction' --training-fraction 0 -o refused.h5
  refuse 3 'more codewords than training tiles' --codewords 60000 --no-checkpoint -o refused.h5
  refuse 3 'max_rotation_deg' --max-rotation-deg 80 -o refused.h5
  refuse 3 "the rig has only: AP, LAT" --camera PA -o refused.h5
  refuse 3 'memory_limit' --memory-limit 10kb -o refused.h5
  refuse 4 'missing.mha' --ct missing.mha -o refused.h5
  head -c 900 ct.mha >cut.mha
  refuse 4 'cut.mha' --ct cut.mha -o refused.h5
  expect 4 'ct.mha' "${common[@]}" -o ct.mha/refused.h5 --no-checkpoint
  expect 4 'is a folder' "${common[@]}" -o .

  "$program" "${common[@]}" --dry-run >dry-run.txt
  for word in 'plane' 'units' 'per rank' 'payload' 'file' 'time' 'Your range uses'; do
    grep -q "$word" dry-run.txt || fail "the dry run says nothing of '$word'"
  done
  [[ -z $(find . -name '*.h5*') ]] || fail 'the dry run wrote a file'
}

# With a spacing, a field has the design's nodes, or just as many more as it takes to stand no farther apart on any (s,t)
# plane.
spacing() {
  spaced=("${common[@]:0:8}" --uv-nodes 9 --codewords 200 --training-fraction 0.5)
  expect 2 'excludes' "${spaced[@]}" --st-nodes 64 --st-spacing-mm 4 -o refused.h5
  expect 2 'excludes' "${spaced[@]}" --max-field-size 1MB --st-spacing-mm 4 -o refused.h5
  expect 3 'st_spacing_mm: a probe' "${spaced[@]}" --preset compact --st-spacing-mm 4 -o refused.h5
  expect 3 'st_spacing_mm = 0: must be' "${spaced[@]}" --st-spacing-mm 0 -o refused.h5
  expect 2 "st-spacing-mm: 'nan'" "${spaced[@]}" --st-spacing-mm nan -o refused.h5
  expect 3 'st-spacing-mm = 0.01: an (s,t) plane is .* has 4096 nodes at most' "${spaced[@]}" --st-spacing-mm 0.01 -o refused.h5
  least=$(sed -n 's/.* at most, \([0-9.]*\) mm apart.*/\1/p' err)
  "$program" "${spaced[@]}" --st-spacing-mm "$least" --dry-run >out 2>err || fail "the spacing that the error names is refused: $(cat err)"
  for caster in shear-warp trilinear; do
    for slabs in 1 3; do
      options=("${spaced[@]}" --caster "$caster" --slabs "$slabs")
      "$program" "${options[@]}" --st-spacing-mm 1.2 --dry-run >spaced-dry.txt 2>/dev/null
      nodes=$(planes spaced-dry.txt | awk 'NR == 1 { print $1 } $2 > 1.2 { exit 1 }') || fail "too far apart: $(cat spaced-dry.txt)"
      ((nodes > 256 && nodes % 32 == 0)) || fail "$nodes nodes at most 1.2 mm apart: $(cat spaced-dry.txt)"
      "$program" "${options[@]}" --st-nodes $((nodes - 32)) --dry-run >fewer-dry.txt
      planes fewer-dry.txt | awk '$2 > 1.2 { found = 1 } END { exit !found }' || fail "fewer than $nodes would do: $(cat fewer-dry.txt)"
      "$mpiexec" -n 2 "$program" "${options[@]}" --st-spacing-mm 1.2 -o spaced.h5 >spaced.txt 2>spaced.err
      grep -q "at most 1.2 mm apart: $nodes along" spaced.err || fail "it did not say how many nodes that takes: $(cat spaced.err)"
      "$program" "${options[@]}" --st-nodes "$nodes" -o counted.h5 >counted.txt 2>/dev/null
      [[ -n $(hash_of spaced.txt) && $(hash_of spaced.txt) == "$(hash_of counted.txt)" ]] ||
        fail "$caster, $slabs slabs: a spacing gives another field than its $nodes nodes"
    done
  done
  "$program" "${spaced[@]}" --st-spacing-mm 50 --dry-run >out 2>/dev/null
  grep -q '256 x 256 nodes' out || fail "a wide spacing took nodes away: $(cat out)"
}

# Half of all combinations, in which every number of ranks meets every size, caster and number of slabs, and every pair of
# these.
ranks() {
  hashes=()
  # Each of the eight designs meets one rank count and one vector width, in an order that ties neither to a size, a caster
  # or a number of slabs.
  local turn=0 sizes caster slabs bits
  for sizes in '9 61' '8 64'; do
    for caster in shear-warp trilinear; do
      for slabs in 1 8; do
        options=("${common[@]:0:8}" --uv-nodes "${sizes% *}" --st-nodes "${sizes#* }" "${common[@]:12}" --caster "$caster" --slabs "$slabs")
        "$program" "${options[@]}" -o one.h5 >one.txt 2>/dev/null
        expected=$(hash_of one.txt)
        [[ ${#expected} == 64 ]] || fail "no payload hash: $(cat one.txt)"
        hashes+=("$expected")
        bits=$((128 << (turn + turn / 2 + turn / 4) % 2))
        if ((bits == 128)) || grep -q avx2 /proc/cpuinfo; then
          AF_VECTOR_BITS=$bits "$program" "${options[@]}" -o bits.h5 >bits.txt 2>/dev/null
          [[ $(hash_of bits.txt) == "$expected" ]] || fail "another payload with $bits-bit vectors: ${options[*]}"
        fi
        same_hash "${rank_counts[(turn + turn / 4) % ${#rank_counts[@]}]}" "$expected" "${options[@]}"
        turn=$((turn + 1))
      done
    done
  done
  # Where the (s,t) plane stands is an option; camera names may be typed in any case.
  for plane in centre centroid; do
    "$program" "${common[@]}" --center-ct-mm 0,8,0 --st-plane "$plane" -o plane.h5 >"$plane.txt" 2>/dev/null
  done
  [[ $(hash_of centre.txt) != "$(hash_of centroid.txt)" ]] || fail '--st-plane makes no difference'
  "$program" --ct ct.mha --rig c-arm-12in --camera ap "${common[@]:6}" --st-plane centre -o plane.h5 >plane.txt 2>/dev/null
  [[ $(hash_of plane.txt) == "${hashes[0]}" ]] || fail '--camera ap or --st-plane centre gives another field'

  [[ $(printf '%s\n' "${hashes[@]}" | sort -u | wc -l) == 8 ]] || fail 'sizes, casters or slabs make no difference'
}

# With a budget, a probe chooses the design: the same on any number of ranks and in a dry run, and near the size asked for.
# What the user states stays.
budget() {
  budget=("${common[@]:0:8}" --max-field-size 1500kB --slabs 2)
  "$program" "${budget[@]}" -o budget.h5 >budget.txt 2>budget.err || fail "a budget: $(cat budget.err)"
  grep -q 'chosen .*: 2 slabs, ' budget.err || fail "it does not say what it chose: $(cat budget.err)"
  bytes=$(stat -c %s budget.h5)
  ((bytes <= 1650000)) || fail "$bytes bytes are more than 10 % beyond the size asked for"
  for ranks in "${rank_counts[@]}"; do same_hash "$ranks" "$(hash_of budget.txt)" "${budget[@]}"; done
  "$program" "${budget[@]}" --dry-run >dry.txt 2>dry.err || fail "a dry run with a budget: $(cat dry.err)"
  [[ $(grep chosen dry.err) == "$(grep chosen budget.err)" ]] || fail 'a dry run chooses another design'
}

# The memory limit holds a fraction of 200 MB of tiles. Tiles that are read back or cast again give the same payload as
# tiles that are kept, and no rank exceeds the limit.
memory() {
  large=(--ct ct.mha --rig c-arm-12in --camera AP --max-translation-mm 5 --uv-nodes 48 --st-nodes 900 --codewords 500)
  large+=(--max-training-tiles 50000)
  "$program" "${large[@]}" --memory-limit 4GB -o kept.h5 >kept.txt 2>kept.err
  grep -q 'all .* kept in memory' kept.err || fail "tiles were not kept: $(cat kept.err)"
  for overflow in 'read back\|cast again' 'cast again'; do
    [[ $overflow == read* ]] && without=() || without=(--no-checkpoint)
    "$program" "${large[@]}" --memory-limit "${memory_limit}MB" "${without[@]}" -o bound.h5 >bound.txt 2>bound.err ||
      fail "a limit on memory: $(cat bound.err)"
    grep -q "the others are \($overflow\)" bound.err || fail "not $overflow: $(cat bound.err)"
    [[ $(hash_of bound.txt) == "$(hash_of kept.txt)" ]] || fail 'another payload under a limit on memory'
    peak=$(sed -n 's/.*peak memory \([0-9]*\)[.0-9]* MB of one rank.*/\1/p' bound.err)
    [[ -n $peak && ($peak -lt $memory_limit || -n $sanitized) ]] || fail "a rank took ${peak:-?} MB of $memory_limit MB"
  done
}

# A run that was refused after casting does not hinder one with better options, which uses its units or replaces them.
corrections() {
  for better in '9 61 200' '8 64 100'; do
    read -r uv st codewords <<<"$better"
    refuse 3 'more codewords than training tiles' --codewords 60000 -o corrected.h5
    [[ -e corrected.h5.progress ]] || fail 'the cast units of refused codewords are not kept'
    "$program" "${common[@]:0:8}" --uv-nodes "$uv" --st-nodes "$st" --codewords "$codewords" -o corrected.h5 >corrected.txt 2>err ||
      fail "better options after refused ones: $(cat err)"
    [[ ! -e corrected.h5.progress ]] || fail 'the progress folder is left'
  done
}

# A slow run (fine steps) is stopped by SIGUSR1 on two ranks, and resumed on one. Another sampling in between is refused.
stops() {
  slow=(--ct ct.mha --rig c-arm-12in --camera AP --uv-nodes 25 --st-nodes 161 --codewords 200)
  slow+=(--max-translation-mm 30 --caster trilinear --step-mm 0.05)
  "$mpiexec" -n 2 "$program" "${slow[@]}" -o slow.h5 >slow.txt 2>slow.err &
  job=$!
  for ((i = 0; i < 600; ++i)); do
    [[ -n $(find . -path './slow.h5.progress/*.records' -size +0) ]] && break
    sleep 0.1
  done
  kill -USR1 "$job"
  code=0
  wait "$job" || code=$?
  [[ $code == 75 ]] || fail "SIGUSR1 gave $code instead of 75: $(cat slow.err)"
  [[ ! -e slow.h5 ]] || fail 'an unfinished field has its name'
  expect 3 'step_mm = 0.5: the unfinished work was begun with 0.05' "${slow[@]:0:10}" --max-translation-mm 30 \
    --caster trilinear --step-mm 0.5 -o slow.h5
  expect 3 "caster = \"shear-warp\": the unfinished work was begun with \"trilinear\"" "${slow[@]:0:10}" \
    --max-translation-mm 30 --caster shear-warp --step-mm 0.05 -o slow.h5
  expect 3 'slabs = 2: the unfinished work was begun with 1' "${slow[@]}" --slabs 2 -o slow.h5
  LC_ALL=C sed 's/^Offset = -46 /Offset = -39 /' ct.mha >moved.mha
  expect 3 "CT 'ct' = .* 7 mm off: the unfinished work was begun with" --ct moved.mha "${slow[@]:2}" -o slow.h5
  # Another format may keep fewer digits of the CT's place, and so of its centre.
  LC_ALL=C sed 's/^Offset = -46 /Offset = -46.0004 /' ct.mha >same.mha
  expect 3 'slabs = 2: the unfinished work was begun with 1' --ct same.mha "${slow[@]:2}" --slabs 2 -o slow.h5
  ! grep -q "CT 'ct'\\|ct_mm" err || fail "the same CT is refused: $(cat err)"
  "$program" "${slow[@]}" -o slow.h5 >slow.txt 2>slow.err
  grep -q 'resumed' slow.err || fail "nothing was resumed: $(cat slow.err)"
  "$program" "${slow[@]}" -o again.h5 --no-checkpoint >again.txt 2>/dev/null
  [[ $(hash_of slow.txt) == "$(hash_of again.txt)" ]] || fail 'the resumed field differs'
  [[ ! -e slow.h5.progress ]] || fail 'the progress folder is left'
}

"$section"
