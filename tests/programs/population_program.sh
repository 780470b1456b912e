#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# jobs/population.sh and af-evaluate population as a person would use them: one small patient, the same command again, its
# tables alone, chains for Slurm, and what they refuse. Fields are too coarse for the success rates to mean anything.
#
#   population_program.sh ROOT FOLDER_OF_PROGRAMS
set -euo pipefail
root=$1
programs=$2
# shellcheck source=installed_jobs.sh
source "$(dirname "${BASH_SOURCE[0]}")/installed_jobs.sh"
enter_installed "$root" "$programs"

small=(--patients 1 --kinds spine --poses 1 --starts 1 --intervals 2 --presets fast --variants clean --raycast-patients 0 --ranks 2)
small+=(--field '--slabs 1 --uv-nodes 7 --st-nodes 61 --codewords 64')
population() { prefix/libexec/attenuation-fields/jobs/population.sh --output pop "${small[@]}" "$@" >out 2>err; }
# refuse CODE PATTERN COMMAND...
refuse() {
  local code=$1 pattern=$2 found=0
  shift 2
  "$@" >out 2>err || found=$?
  [[ $found == "$code" ]] || fail "$* gave $found instead of $code: $(cat err)"
  grep -q -- "$pattern" err || fail "$* did not say '$pattern': $(cat err)"
}

refuse 2 "'3' must name 2, 1 or both" population --views 3
refuse 2 'must name some of spine, pelvis, head' population --kinds leg
refuse 4 'no registrations are finished yet' population --tables
refuse 2 'moved+all needs all before it' population --variants moved+all,all
refuse 2 'a bone moves in drawn patients, not in a --ct' population --variants clean,moved --ct one="$root/README.md"

population || fail "population.sh: $(cat out err)"
tables=pop/tables
# Two starts of one patient, with two views and with one.
for condition in clean-1-fast clean-2-fast; do
  grep -q "^$condition,all,1,2," "$tables/population.csv" || fail "no row of $condition: $(cat $tables/population.csv)"
  grep -q "^| $condition | all | 1, [01] | 2 |" "$tables/population.md" || fail "no line of $condition: $(cat $tables/population.md)"
  grep -q "^$condition,spine-001,2," "$tables/patients.csv" || fail "no row of the patient: $(cat $tables/patients.csv)"
done

cp "$tables/population.csv" first.csv
population || fail "the same command again: $(cat out err)"
! grep -q ' min \| s$' out || fail "a finished stage ran again: $(cat out)"
population --tables || fail "--tables: $(cat out err)"
cmp first.csv "$tables/population.csv"

population --slurm --dry-run || fail "--slurm --dry-run: $(cat out err)"
for condition in clean-1-fast clean-2-fast; do
  grep -q "slurm/$condition" out || fail "no chain of $condition: $(cat out)"
done
grep -q sbatch out || fail "no command of Slurm: $(cat out)"

uncertainty=(prefix/libexec/attenuation-fields/jobs/uncertainty.py --presets fast --variants clean)
"${uncertainty[@]}" pop --judge --csv uncertainty.csv >out 2>err || fail "uncertainty.py: $(cat out err)"
# gc, all, both of clean X-rays, and all of spines; then gc, all and spines of odd numbers.
[[ $(wc -l <uncertainty.csv) == 9 ]] || fail "uncertainty.py wrote $(cat uncertainty.csv)"
grep -q '^gc,"all, as stated",' uncertainty.csv || fail "uncertainty.py wrote $(cat uncertainty.csv)"
# Fields are too coarse for a success, which a fit needs, so one is written by hand. What the programs state is what the
# script would state by their constants.
cp -r pop right
awk -F, -v OFS=, 'NR == 1 { for (i = 1; i <= NF; ++i) if ($i == "tre_mm") tre = i } NR == 2 { $tre = 0.5 } 1' \
  pop/runs/clean-2-fast/spine-001/registrations.csv >right/runs/clean-2-fast/spine-001/registrations.csv
"${uncertainty[@]}" right >fitted 2>err || fail "uncertainty.py: $(cat err)"
grep -q '^constexpr Confidence kOverRegions{' fitted || fail "uncertainty.py fitted $(cat fitted)"
# With folds, the first patient's constants predict the second. A patient alone leaves nothing to fit.
sed 's/^spine-001/spine-002/' right/runs/clean-2-fast/spine-001/registrations.csv >second.csv
cp -r right two-patients
cp -r two-patients/runs/clean-2-fast/spine-001 two-patients/runs/clean-2-fast/spine-002
cp second.csv two-patients/runs/clean-2-fast/spine-002/registrations.csv
"${uncertainty[@]}" two-patients --folds 2 >fitted 2>err || fail "uncertainty.py --folds: $(cat err)"
grep -q '^constexpr Confidence kOverRegions{' fitted || fail "uncertainty.py --folds fitted $(cat fitted)"
grep -q '^measure gc  half all, 2 folds  cases 2 ' fitted || fail "uncertainty.py --folds judged $(cat fitted)"
refuse 4 'in the other folds' "${uncertainty[@]}" right --folds 2
refuse 2 'must be a whole number of at least 2' "${uncertainty[@]}" right --folds 1
prefix/libexec/attenuation-fields/jobs/bones.sh --output bones --bones 1 --intervals 3 --ranks 2 >out 2>err || fail "bones.sh: $(cat out err)"
grep -q '^clean-2-bone,all,1,3,' bones/tables/population.csv || fail "bones.sh wrote $(cat bones/tables/population.csv)"
prefix/libexec/attenuation-fields/jobs/uncertainty.py bones --presets bone --variants clean >fitted 2>err || fail "uncertainty.py: $(cat err)"
for line in '    InflationRow{"gc", Evidence::Silhouettes, ' 'constexpr Confidence kInSilhouettes{'; do
  grep -q "^$line" fitted || fail "uncertainty.py fitted $(cat fitted)"
done
mkdir one-view
cp -r pop/runs one-view
awk -F, -v OFS=, 'NR == 1 { for (i = 1; i <= NF; ++i) if ($i == "mrpd_mm") mrpd = i } NR == 2 { $mrpd = 0.5 } 1' \
  pop/runs/clean-1-fast/spine-001/registrations.csv >one-view/runs/clean-1-fast/spine-001/registrations.csv
"${uncertainty[@]}" one-view --views 1 >fitted 2>err || fail "uncertainty.py of one view: $(cat err)"
for line in '    InflationRow{"gc", Evidence::OneView, ' 'constexpr Confidence kOneView{'; do
  grep -q "^$line" fitted || fail "uncertainty.py of one view fitted $(cat fitted)"
done
python3 - "$root/register/verdict/calibration.cpp" kOverRegions pop/runs/clean-2-fast/spine-001/registrations.csv \
  kOneView pop/runs/clean-1-fast/spine-001/registrations.csv \
  kInSilhouettes bones/runs/clean-2-bone/bone-001/registrations.csv <<'PYTHON' || fail "uncertainty.py differs from calibration.cpp"
import csv, re, sys
sys.path.insert(0, "prefix/libexec/attenuation-fields/jobs")
import uncertainty
text = open(sys.argv[1], encoding="utf-8").read()
for name, path in zip(sys.argv[2::2], sys.argv[3::2]):
    constants = [float(number) for number in re.search(name + r"\{([-0-9., ]+)\};", text)[1].split(",")]
    measure = "gc in silhouettes" if name == "kInSilhouettes" else "gc"
    views = 1 if name == "kOneView" else 2
    rows = [uncertainty.Row(measure, "clean", views, cells) for cells in csv.DictReader(open(path, encoding="utf-8"))]
    stated = [row for row in rows if row.has_confidence and row.stated_confidence != 0.0]
    assert stated, "no row states a confidence"
    for row in stated:
        expected = uncertainty.probability(constants, row.features())
        # A target that agrees doubles the odds.
        doubled = 2 * expected / (1 + expected)
        assert min(abs(row.stated_confidence - e) for e in (expected, doubled)) < 1e-9, (row.case, row.stated_confidence, expected)
PYTHON
refuse 2 "must be some of robust, fast, paper, bone" "${uncertainty[@]}" --presets leg pop
refuse 2 "give bone alone" "${uncertainty[@]}" --presets bone,fast pop
"${uncertainty[@]}" pop --judge --views 1 >out 2>err || fail "uncertainty.py of one view: $(cat out err)"
grep -q '^measure gc  half all, as stated' out || fail "uncertainty.py of one view wrote $(cat out)"
refuse 4 'holds no finished run of clean-2-fast' "${uncertainty[@]}" missing
refuse 4 'has the same patient, too' "${uncertainty[@]}" pop pop
refuse 4 'its folder is missing' "${uncertainty[@]}" pop --judge --csv nowhere/uncertainty.csv
# Refuses damaged tables, and patients of even numbers alone, which are never fitted.
for damage in 's/,squared_distance//' '2s/,.*//' "2,\$d" 's/^spine-001/spine-002/'; do
  rm -rf damaged
  cp -r pop damaged
  sed -i "$damage" damaged/runs/clean-2-fast/spine-001/registrations.csv
  refuse 4 'squared_distance\|is cut off\|holds no registration\|of a patient to fit' "${uncertainty[@]}" damaged
done

# Verdicts of a pair with a right and a wrong end, both found, and a bound that the right one keeps.
verdicts=(prefix/libexec/attenuation-fields/jobs/verdicts.py)
cp -r right judged
awk -F, -v OFS=, 'NR == 1 { for (i = 1; i <= NF; ++i) at[$i] = i }
  NR > 1 { $at["verdict"] = "found"; $at["predicted_tre_95_mm"] = 0.6 } NR == 3 { $at["tre_mm"] = 9 } 1' \
  right/runs/clean-2-fast/spine-001/registrations.csv >judged/runs/clean-2-fast/spine-001/registrations.csv
"${verdicts[@]}" judged >out 2>err || fail "verdicts.py: $(cat err)"
grep -q '^| clean-2-fast | 1 | 2 | 1 of 1: 100.0 % (21 to 100) | 0 | 0 | 1 | 0 | 0 | 1 | 1 |$' out || fail "verdicts.py wrote $(cat out)"
grep -q '^| clean-2-fast | 1 | 1 of 1: 100.0 % (21 to 100) | 0.500 | 0.600 | 1.2 |$' out || fail "verdicts.py wrote $(cat out)"
refuse 4 'holds no registrations' "${verdicts[@]}" missing
sed -i 's/,verdict,/,judgement,/' judged/runs/clean-2-fast/spine-001/registrations.csv
refuse 4 "has no column 'verdict'" "${verdicts[@]}" judged

evaluate=("$programs/af-evaluate" population -o refused)
refuse 2 'condition' "${evaluate[@]}"
refuse 3 'NAME=FOLDER' "${evaluate[@]}" --condition pop
mkdir empty
refuse 3 'holds no finished run' "${evaluate[@]}" --condition clean-2-fast=empty
refuse 4 'is not a folder of results' "${evaluate[@]}" --condition clean-2-fast=missing
mkdir twice
cp -r pop/runs/clean-2-fast twice/first
cp -r pop/runs/clean-2-fast twice/copy
cp -r pop/runs/clean-2-fast damaged-summary
sed -i 's/"program_commit": "[^"]*"/"program_commit": 5/' damaged-summary/spine-001/summary.json
refuse 4 'program_commit, a text' "${evaluate[@]}" --condition clean-2-fast=damaged-summary
refuse 3 'must not have case spine-001-p1, which .* has, too' "${evaluate[@]}" --condition clean-2-fast=twice
[[ ! -e refused ]] || fail "a refused table left $(find refused)"
