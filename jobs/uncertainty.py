#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whether registrations know their own errors. Fits the constants of register/verdict/calibration.cpp to the
registrations of population studies (jobs/population.sh, jobs/bones.sh), whose truth is known. It fits them to the
patients of odd numbers, and prints how well they do on the others. With --folds it fits them to all drawn patients, and
judges each by constants from patients of other folds. Patients that were not drawn have no number, and are never
fitted. Needs nothing but Python."""
import argparse
import csv
import hashlib
import math
import os
import pathlib
import random
import re
import sys

# The measures that the presets end with.
MEASURE_OF = {"robust": "rg", "fast": "gc", "paper": "mi", "bone": "gc in silhouettes"}
REGION_95 = 12.591587243743977  # chi-square, six degrees of freedom
SUCCESS_MM = 2.5
NEAR_MM, FAR_MM = 0.1, 20.0
LEAST_SHARE = 0.05
LEAST_EXCESS = 0.02


# The columns that are read from a table of registrations.
COLUMNS = ["case", "tre_mm", "mrpd_mm", "judge_fine_mean", "judge_excess", "covariance_inflation", "tre_inflation", "squared_distance",
           "sandwich_tre_mm", "predicted_tre_95_mm", "confidence"]


def number_of(cells, name):
    return float(cells[name]) if cells[name] not in ("", "nan") else math.nan


def succeeded(cells, views):
    """Whether a start succeeded, by the TRE, or with one view by the mRPD, because one view shows no depth."""
    return number_of(cells, "tre_mm" if views > 1 else "mrpd_mm") < SUCCESS_MM


class Row:
    """The facts about one registration that are needed here."""

    def __init__(self, measure, variant, views, cells):
        def number(name):
            return number_of(cells, name)

        self.measure = measure
        self.variant = variant
        self.views = views
        self.case = f"{cells['case']} {variant}"
        self.patient = re.sub(r"-p\d+$", "", cells["case"])
        drawn = re.fullmatch(r"(?:spine|pelvis|head|bone)-(\d{3,})-p\d+", cells["case"])
        self.number = int(drawn[1]) if drawn else None
        self.is_for_fit = drawn is not None and self.number % 2 == 1
        self.half = "real" if drawn is None else "odd" if self.is_for_fit else "even"
        self.tre = number("tre_mm")
        self.is_success = succeeded(cells, views)
        self.fine_mean = number("judge_fine_mean")
        self.excess = number("judge_excess")
        inflation = number("covariance_inflation")
        self.distance = number("squared_distance") * inflation  # by the sandwich estimate alone
        tre_inflation = number("tre_inflation")
        scale = 1.0 / math.sqrt(tre_inflation) if tre_inflation > 0 else math.nan
        self.tre_rms = number("sandwich_tre_mm")
        self.tre_95 = number("predicted_tre_95_mm") * scale
        self.has_pose = not math.isnan(self.fine_mean)
        self.has_confidence = self.has_pose and not math.isnan(self.excess)
        self.stated_inflation = inflation
        self.stated_tre_inflation = tre_inflation
        self.stated_confidence = number("confidence")
        self.inflation = self.tre_inflation = 1.0
        self.confidence = 0.0

    def kind(self):
        """The kind of patient: the name without its number."""
        return re.sub(r"-\d+$", "", self.patient)

    def shortfall(self):
        """How far the logarithm of the share that the pose explains is below that of EXPLAINED_SHARE."""
        return max(0.0, math.log(EXPLAINED_SHARE / min(max(self.fine_mean, LEAST_SHARE), 1.0)))

    def features(self):
        """The features as in success_confidence(). The distance between a portfolio's ends is not one of them: if no
        portfolio fails, it would stand for success."""
        in_silhouettes = self.measure == MEASURE_OF["bone"]
        if self.views == 1 and not in_silhouettes:
            return [1.0, self.excess, math.log(max(self.excess / max(self.fine_mean, LEAST_SHARE), LEAST_EXCESS))]
        tre = FAR_MM if math.isnan(self.tre_rms) else min(max(self.tre_rms, NEAR_MM), FAR_MM)
        excess = math.log(max(self.excess, LEAST_EXCESS)) if in_silhouettes else self.excess
        return [1.0, excess, math.log(tre)]


def weighted_quantile(values, weights, share):
    pairs = sorted(zip(values, weights))
    total, seen = sum(weights), 0.0
    for value, weight in pairs:
        seen += weight
        if seen >= share * total:
            return value
    return pairs[-1][0]


# As in calibration.cpp.
EXPLAINED_SHARE = 0.65
# The values that fit_inflation() tries. They limit what so few cases may say.
GROWTHS = [0.05 * i for i in range(161)]


def case_weights(rows):
    """Weights by which every case counts the same, because starts of one case mostly end at one pose."""
    counts = {}
    for row in rows:
        counts[row.case] = counts.get(row.case, 0) + 1
    return [1.0 / counts[row.case] for row in rows]


def fit_inflation(rows, squares, least):
    """Fits by quantile regression (Koenker and Bassett 1978), so that 95 % of the registrations lie inside. It
    regresses the logarithms of `squares`, which 95 % should not exceed by the sandwich estimate alone, on the shortfall
    of what the pose explains."""
    y = [math.log(max(square, 1e-6)) for square in squares]
    x = [row.shortfall() for row in rows]
    weights = case_weights(rows)
    best = None
    for growth in GROWTHS:
        rest = [b - growth * a for a, b in zip(x, y)]
        at_once = max(least, weighted_quantile(rest, weights, 0.95))
        loss = sum(w * ((0.95 if r > at_once else -0.05) * (r - at_once)) for r, w in zip(rest, weights))
        if best is None or loss < best[0]:
            best = (loss, at_once, growth)
    return best[1:]


def inflation_of(row, constants):
    at_once, growth = constants
    return math.exp(at_once + growth * row.shortfall())


def constants_text(constants):
    return "{" + ", ".join(f"{number:.2f}" for number in constants) + "}"


def names_of(measures, views):
    """The names of constants in calibration.cpp: the kind of their rows, and the confidence."""
    if measures == [MEASURE_OF["bone"]]:
        return "Silhouettes", "kInSilhouettes"
    return ("OneView", "kOneView") if views == 1 else ("Views", "kOverRegions")


def solve(matrix, right):
    n = len(right)
    a = [row[:] + [value] for row, value in zip(matrix, right)]
    for i in range(n):
        pivot = max(range(i, n), key=lambda r: abs(a[r][i]))
        a[i], a[pivot] = a[pivot], a[i]
        for r in range(i + 1, n):
            factor = a[r][i] / a[i][i]
            for c in range(i, n + 1):
                a[r][c] -= factor * a[i][c]
    x = [0.0] * n
    for i in reversed(range(n)):
        x[i] = (a[i][n] - sum(a[i][c] * x[c] for c in range(i + 1, n))) / a[i][i]
    return x


def probability(coefficients, features):
    logit = sum(c * f for c, f in zip(coefficients, features))
    return 1.0 / (1.0 + math.exp(-max(-60.0, min(60.0, logit))))


def fit_confidence(rows, ridge=0.05):
    """Logistic regression by Newton's steps. A small ridge keeps it finite if a line separates the groups."""
    n = len(rows[0].features())
    coefficients = [0.0] * n
    for _ in range(60):
        gradient = [-ridge * c if i else 0.0 for i, c in enumerate(coefficients)]
        hessian = [[ridge if i == j and i else 1e-9 * (i == j) for j in range(n)] for i in range(n)]
        for row in rows:
            f = row.features()
            p = probability(coefficients, f)
            for i in range(n):
                gradient[i] += (float(row.is_success) - p) * f[i]
                for j in range(n):
                    hessian[i][j] += p * (1.0 - p) * f[i] * f[j]
        step = solve(hessian, gradient)
        scale = min(1.0, 5.0 / max(1e-12, max(abs(s) for s in step)))
        coefficients = [c + scale * s for c, s in zip(coefficients, step)]
    return coefficients


def roc_area(groups, times=None):
    """Area under the ROC curve. `groups`, of rising confidence, hold the patients of the successes and of the failures that
    share it. `times` says how often each patient counts."""

    def count(patients):
        return len(patients) if times is None else sum(times[patient] for patient in patients)

    wins = successes = failures = 0.0
    for of_successes, of_failures in groups:
        won, lost = count(of_successes), count(of_failures)
        wins += won * (failures + 0.5 * lost)
        successes += won
        failures += lost
    return wins / (successes * failures) if successes and failures else math.nan


def roc_interval(rows):
    """roc_area() and its 95 % interval by percentile bootstrap over patients. Draws without failures or without successes
    do not count."""
    by_confidence = {}
    for row in rows:
        by_confidence.setdefault(row.confidence, ([], []))[0 if row.is_success else 1].append(row.patient)
    groups = [by_confidence[confidence] for confidence in sorted(by_confidence)]
    patients = sorted({row.patient for row in rows})
    generator = random.Random(1)
    areas = []
    for _ in range(400 if len(patients) > 1 else 0):
        times = dict.fromkeys(patients, 0)
        for patient in generator.choices(patients, k=len(patients)):
            times[patient] += 1
        areas.append(roc_area(groups, times))
    areas = [area for area in areas if not math.isnan(area)]
    alike = [1.0] * len(areas)
    low, high = [weighted_quantile(areas, alike, level) if areas else math.nan for level in (0.025, 0.975)]
    return roc_area(groups), low, high


def share(values):
    values = list(values)
    return sum(values) / len(values) if values else math.nan


def coverage(rows, holds):
    weights = case_weights(rows)
    return sum(w for row, w in zip(rows, weights) if holds(row)) / sum(weights) if rows else math.nan


def coverage_interval(rows, holds, draws=2000):
    """The 95 % interval of coverage(), by percentile bootstrap over patients."""
    patients = {}
    for row, weight in zip(rows, case_weights(rows)):
        inside, total = patients.get(row.patient, (0.0, 0.0))
        patients[row.patient] = (inside + weight * holds(row), total + weight)
    sums = list(patients.values())
    if len(sums) < 2:
        return math.nan, math.nan
    generator = random.Random(1)
    shares = []
    for _ in range(draws):
        drawn = generator.choices(sums, k=len(sums))
        shares.append(sum(inside for inside, _ in drawn) / sum(total for _, total in drawn))
    alike = [1.0] * draws
    return weighted_quantile(shares, alike, 0.025), weighted_quantile(shares, alike, 0.975)


def summary(label, half, rows):
    known = [row for row in rows if row.is_success and not math.isnan(row.distance)]
    confident = [row for row in rows if row.has_confidence]
    successes = [row.confidence for row in confident if row.is_success]
    failures = [row.confidence for row in confident if not row.is_success]

    def in_region(row):
        return row.distance <= REGION_95 * row.inflation

    def in_tre(row):
        return row.tre <= row.tre_95 * math.sqrt(row.tre_inflation)

    region_low, region_high = coverage_interval(known, in_region)
    tre_low, tre_high = coverage_interval(known, in_tre)
    area, area_low, area_high = roc_interval(confident)
    return {
        "measure": label,
        "half": half,
        "cases": len({row.case for row in known}),
        "successes": len(successes),
        "failures": len(failures),
        "pose_region": coverage(known, in_region),
        "pose_region_low": region_low,
        "pose_region_high": region_high,
        "tre_region": coverage(known, in_tre),
        "tre_region_low": tre_low,
        "tre_region_high": tre_high,
        "sandwich_alone": coverage(known, lambda r: r.distance <= REGION_95),
        "roc_area": area,
        "roc_area_low": area_low,
        "roc_area_high": area_high,
        "sure_failures": share(v >= 0.9 for v in failures),
        "sure_successes": share(v >= 0.9 for v in successes),
    }


def reliability(rows):
    """Lines that say how many registrations within bounds of confidence succeeded. A true probability foretells their share."""
    bounds = [0.0, 0.1, 0.5, 0.9, 0.99, 1.0]
    lines = []
    for low, high in zip(bounds, bounds[1:]):
        within = [r for r in rows if r.has_confidence and low <= r.confidence < high + (high == 1.0)]
        if within:
            mean = share(r.confidence for r in within)
            succeeded = share(float(r.is_success) for r in within)
            lines.append(f"confidence {low} to {high}  ends {len(within)}  mean {mean:.3f}  succeeded {succeeded:.3f}")
    return lines


def fitted_constants(rows, measures, which="drawn, in the other folds"):
    """The constants that fit these rows: by measure for the covariance and for TREs, and those of the confidence."""
    inflations = {}
    for measure in measures:
        fitted = [r for r in rows if r.measure == measure and r.is_success and not math.isnan(r.distance)]
        if not fitted:
            refuse(measure, f"no registration of a patient to fit ({which}) succeeded and says how far it may be off; --judge fits nothing")
        # The inflation is never below the sandwich estimate itself, which holds if the pose explains the X-rays. A TRE adds
        # up what all six directions do, so its prediction may be too large.
        pose = fit_inflation(fitted, [row.distance / REGION_95 for row in fitted], 0.0)
        tre = fit_inflation(fitted, [(row.tre / row.tre_95) ** 2 for row in fitted], -math.inf)
        inflations[measure] = (pose, tre)
    return inflations, fit_confidence([row for row in rows if row.has_confidence])


def print_constants(constants, views):
    """Prints the constants as lines of calibration.cpp."""
    inflations, coefficients = constants
    evidence, confidence = names_of(list(inflations), views)
    for measure, (pose, tre) in inflations.items():
        name = measure.removesuffix(" in silhouettes")
        print(f'    InflationRow{{"{name}", Evidence::{evidence}, {constants_text(pose)}, {constants_text(tre)}}},')
    print(f"constexpr Confidence {confidence}{constants_text(coefficients)};")


def foretell(rows, constants):
    inflations, coefficients = constants
    for row in rows:
        pose, tre = inflations[row.measure]
        if row.has_pose:
            row.inflation = inflation_of(row, pose)
            row.tre_inflation = inflation_of(row, tre)
        # A failed search has no end, whatever the constants.
        if row.has_confidence and row.stated_confidence != 0.0:
            row.confidence = probability(coefficients, row.features())


def fit_to_odd_half(rows, measures):
    constants = fitted_constants([row for row in rows if row.is_for_fit], measures, "of odd number")
    print_constants(constants, rows[0].views)
    foretell(rows, constants)


def folds_of(kinds, folds):
    """The fold of every patient. `kinds` gives their kinds."""
    ranks, fold_of = {}, {}
    for patient in sorted(kinds):
        ranks[kinds[patient]] = ranks.get(kinds[patient], -1) + 1
        fold_of[patient] = ranks[kinds[patient]] % folds
    return fold_of


def cross_validate(rows, measures, folds):
    """Prints the constants that fit all drawn patients. Each patient is predicted by the constants of the other folds;
    every fold has as many patients of every kind. Patients that were not drawn are predicted by the constants of all."""
    drawn = [row for row in rows if row.number is not None]
    constants = fitted_constants(drawn, measures)
    print_constants(constants, rows[0].views)
    foretell([row for row in rows if row.number is None], constants)
    fold_of = folds_of({row.patient: row.kind() for row in drawn}, folds)
    for fold in range(folds):
        mine = [row for row in drawn if fold_of[row.patient] == fold]
        if mine:
            foretell(mine, fitted_constants([row for row in drawn if fold_of[row.patient] != fold], measures))
    for row in rows:
        row.is_for_fit = False


def take_as_stated(rows):
    for row in rows:
        row.is_for_fit = False
        row.inflation, row.tre_inflation = row.stated_inflation, row.stated_tre_inflation
        row.confidence = row.stated_confidence


def fold_count(text):
    count = int(text) if text.isdecimal() else 0
    if count < 2:
        raise argparse.ArgumentTypeError(f"'{text}': must be a whole number of at least 2")
    return count


def options():
    parser = argparse.ArgumentParser(
        description=__doc__, epilog="Exit codes: 0 done, 2 wrong options, 4 registrations that are missing, damaged or without predictions, or none to fit."
    )
    parser.add_argument("population", nargs="+", type=pathlib.Path, help="output folders of jobs/population.sh or jobs/bones.sh")
    parser.add_argument("--presets", default="robust,fast", help="comma separated [%(default)s]")
    parser.add_argument("--variants", default="clean,all", help="comma separated, as in the population [%(default)s]")
    parser.add_argument("--views", type=int, choices=(1, 2), default=2, help="of the registrations; one view has constants of its own [%(default)s]")
    how = parser.add_mutually_exclusive_group()
    how.add_argument("--judge", action="store_true", help="fit nothing: judge all patients by what the programs foretold")
    how.add_argument("--folds", type=fold_count, metavar="K",
                     help="fit to all drawn patients, and judge each by what the patients of the other K - 1 folds give")
    parser.add_argument("--csv", metavar="FILE", help="the table, as CSV")
    parser.add_argument("--commit", metavar="HASH",
                        help="last columns of it: the commit of the programs, and 16 digits of the SHA-256 of all tables read")
    chosen = parser.parse_args()
    chosen.presets = list(dict.fromkeys(chosen.presets.split(",")))
    chosen.variants = list(dict.fromkeys(chosen.variants.split(",")))
    for preset in chosen.presets:
        if preset not in MEASURE_OF:
            parser.error(f"--presets names '{preset}': must be some of {', '.join(MEASURE_OF)}")
    if "bone" in chosen.presets and len(chosen.presets) > 1:
        parser.error(f"--presets = '{','.join(chosen.presets)}': values within silhouettes have constants of their own, give bone alone")
    return chosen


def refuse(what, why):
    print(f"error: {what}: {why}", file=sys.stderr)
    sys.exit(4)


def cells_of(path, columns):
    """The lines of a table of registrations, as dictionaries. Refuses truncated tables and those that lack a column."""
    with open(path, newline="", encoding="utf-8") as file:
        table = csv.DictReader(file)
        missing = [column for column in columns if column not in (table.fieldnames or [])]
        if missing:
            refuse(path, f"has no column '{missing[0]}': made with --no-uncertainty, or no table of registrations")
        lines = []
        for cells in table:
            if any(cells[column] is None for column in columns):
                refuse(path, f"line {table.line_num} is cut off")
            lines.append(cells)
    if not lines:
        refuse(path, "holds no registration")
    return lines


def rows_of(path, measure, variant, views):
    return [Row(measure, variant, views, cells) for cells in cells_of(path, COLUMNS)]


def finished_tables(population, condition):
    """The tables of finished runs, on one machine and on a cluster."""
    runs = [*population.glob(f"runs/{condition}/*"), *population.glob(f"slurm/{condition}/registration/*")]
    return [run / "registrations.csv" for run in sorted(runs) if (run / "summary.json").exists()]


def rows_of_populations(chosen):
    """All registrations in all folders, and the SHA-256 of their tables. A patient may be in only one folder."""
    rows, seen, digest = [], {}, hashlib.sha256()
    for preset in chosen.presets:
        for variant in chosen.variants:
            condition = f"{variant}-{chosen.views}-{preset}"
            for folder in chosen.population:
                tables = finished_tables(folder, condition)
                if not tables:
                    refuse(folder, f"holds no finished run of {condition} of jobs/population.sh or jobs/bones.sh")
                for path in tables:
                    run = f"{condition}/{path.parent.name}"
                    if run in seen:
                        refuse(path, f"{seen[run]} has the same patient, too")
                    seen[run] = path
                    rows += rows_of(path, MEASURE_OF[preset], variant, chosen.views)
                    digest.update(path.read_bytes())
    return rows, digest.hexdigest()


def tables_of(rows, measures, halves):
    """How well predictions hold, for every half and measure. For the judged half also for every variant of X-rays, every
    measure on each, and every kind of patient."""
    table = [
        summary(label, half, [r for r in rows if r.is_for_fit == is_for_fit and label in ("all", r.measure)])
        for half, is_for_fit in halves.items()
        for label in measures + ["all"]
    ]
    judged = [row for row in rows if not row.is_for_fit]
    for variant in dict.fromkeys(row.variant for row in rows):
        for label in measures + ["all"]:
            mine = [r for r in judged if r.variant == variant and label in ("all", r.measure)]
            table.append(summary(f"{label}, {variant}", list(halves)[-1], mine))
    for kind in dict.fromkeys(row.kind() for row in judged):
        table.append(summary("all, " + kind, list(halves)[-1], [r for r in judged if r.kind() == kind]))
    return table


def tables_of_halves(rows, measures):
    """The same for the stated predictions, for each half alone and every kind of patient in it."""
    table = []
    for half in dict.fromkeys(row.half for row in rows):
        mine = [row for row in rows if row.half == half]
        for label in measures + ["all"]:
            table.append(summary(label, f"{half}, as stated", [r for r in mine if label in ("all", r.measure)]))
        for kind in dict.fromkeys(row.kind() for row in mine) if half != "real" else ():
            table.append(summary("all, " + kind, f"{half}, as stated", [r for r in mine if r.kind() == kind]))
    return table


def write_csv(path, table, origin):
    """Writes the table. `origin` holds the last cells of every row."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*table[0], *origin], lineterminator="\n")
        writer.writeheader()
        for entry in table:
            cells = {k: f"{v:.4f}" if isinstance(v, float) else v for k, v in entry.items()}
            writer.writerow({**cells, **origin})


def main():
    chosen = options()
    if chosen.csv and not os.access(pathlib.Path(chosen.csv).parent, os.W_OK):
        refuse(chosen.csv, "its folder is missing or cannot be written to")
    rows, digest = rows_of_populations(chosen)
    measures = list(dict.fromkeys(row.measure for row in rows))
    if chosen.judge:
        take_as_stated(rows)
        halves = {"all, as stated": False}
    elif chosen.folds:
        cross_validate(rows, measures, chosen.folds)
        halves = {f"all, {chosen.folds} folds": False}
    else:
        fit_to_odd_half(rows, measures)
        halves = {"odd, fitted": True, "even, judged": False}
    table = tables_of(rows, measures, halves)
    if chosen.judge:
        table += tables_of_halves(rows, measures)
    print()
    for entry in table:
        print("  ".join(f"{k} {v:.3f}" if isinstance(v, float) else f"{k} {v}" for k, v in entry.items()))
    for measure in measures + ["all"]:
        print(f"\n{list(halves)[-1]}: {measure}")
        print("\n".join(reliability([r for r in rows if not r.is_for_fit and measure in ("all", r.measure)])))
    if chosen.csv:
        origin = {"commit": chosen.commit, "source_sha256": digest[:16]} if chosen.commit else {}
        write_csv(chosen.csv, table, origin)


if __name__ == "__main__":
    main()
