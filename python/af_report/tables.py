# SPDX-License-Identifier: Apache-2.0
"""Markdown versions of the tables that af-evaluate writes."""
import json
import math
from pathlib import Path

from af_programs.errors import FileError

from .files import rows_of
from .numbers import as_number


def fixed(value, decimals):
    value = as_number(value)
    return f"{value:.{decimals}f}" if math.isfinite(value) else "-"


def markdown(titles, rows):
    lines = [titles, ["---"] * len(titles), *rows]
    return "".join(f"| {' | '.join(str(cell).replace('|', '/') for cell in line)} |\n" if line is not lines[1] else "|" + "---|" * len(titles) + "\n"
                   for line in lines)


def per_cent(share, decimals=None):
    """A share in per cent. Rounding to whole per cents must not hide a failure."""
    share = 100 * as_number(share)
    if not math.isfinite(share):
        return "-"
    return f"{share:.{decimals if decimals is not None else 1 if 99.5 <= share < 100 else 0}f}"


# --- af-evaluate compare ---------------------------------------------------------------------------------------------

BANDS = ("0_8", "8_16", "16_30")


def band_text(row, band, with_interval=True):
    starts = row.number(f"starts_{band}_mm")
    if not starts:
        return "-"
    text = per_cent(row.number(f"successes_{band}_mm") / starts)
    low, high = (row.number(f"wilson_{end}_{band}_mm") for end in ("low", "high"))
    return text + (f" [{per_cent(low, 0)}, {per_cent(high, 0)}]" if with_interval else "")


def methods_markdown(rows):
    lines = []
    for row in rows:
        lines.append([row.text("run"), row.text("case"), row.text("method"), row.text("renderer"), " / ".join(band_text(row, band) for band in BANDS),
                      " / ".join(row.text(f"starts_{band}_mm") for band in BANDS),
                      " / ".join(fixed(row.number(f"rotation_share_{band}_mm"), 2) for band in BANDS), row.text("capture_range_mm"),
                      row.text("gross_failures"),
                      f"{row.text('error')} {fixed(row.number('mean_error_mm'), 3)}, {fixed(row.number('median_error_mm'), 3)}",
                      f"{fixed(row.number('median_depth_mm'), 2)}, {fixed(row.number('p95_depth_mm'), 2)}",
                      f"{fixed(row.number('rotation_bias_deg'), 3)}, {fixed(row.number('translation_bias_mm'), 3)}",
                      fixed(row.number("median_drr_count"), 0), fixed(row.number("median_seconds"), 4)])
    return markdown(["Run", "Case", "Method", "Renderer", "Success % [95 % interval], starts 0-8 / 8-16 / 16-30 mm", "of starts",
                     "of whose size is rotation", "Capture range, mm", "Gross failures", "Error of successes, mm: mean, median",
                     "Depth off, one view, mm: median, 95th percentile", "Bias, deg and mm", "DRRs", "Seconds"], lines)


def crossed(keys, cells):
    """A table from cells (keys of a line, column, text)."""
    columns = sorted({column for _, column, _ in cells})
    lines = {}
    for line, column, text in cells:
        lines.setdefault(line, {})[column] = text
    return columns, markdown([*keys, *columns], [[*line, *(lines[line].get(column, "") for column in columns)] for line in sorted(lines)])


def screen_markdown(rows):
    """Measures against optimisers, with the success of the first two bands and the median error."""
    return crossed(["Case", "Renderer", "Preset", "Measure"], [
        ((row.text("case"), row.text("renderer"), row.text("preset"), row.text("similarity")), row.text("optimizer"),
         f"{band_text(row, BANDS[0], False)} / {band_text(row, BANDS[1], False)}, {fixed(row.number('median_error_mm'), 3)}") for row in rows])[1]


def studies_markdown(rows):
    """A line per study and a column per method, if runs are named STUDY-PRESET... Empty with fewer than two studies."""
    cells = []
    for row in rows:
        end = row.text("run").rfind("-" + row.text("preset")) if row.text("preset") else -1
        if end >= 0:
            cells.append(((row.text("run")[:end], row.text("renderer")), row.text("run")[end + 1:],
                          f"{' / '.join(band_text(row, band, False) for band in BANDS)}, {fixed(row.number('median_error_mm'), 3)}, "
                          f"{fixed(1000 * row.number('median_seconds'), 1)}"))
    columns, text = crossed(["Study", "Renderer"], cells)
    return text if len(columns) > 1 else ""


def pairs_markdown(rows):
    """Field against ray casting from the same starts."""
    lines = []
    for row in rows:
        three = lambda name: fixed(row.number(name), 3)  # noqa: E731, B023
        over = (f"{three('mean_distance_mm')} [{three('bootstrap_low_mm')}, {three('bootstrap_high_mm')}], Student "
                f"[{three('student_low_mm')}, {three('student_high_mm')}]")
        lines.append([row.text("run"), row.text("common_starts"),
                      f"{row.text('successes_field')}, {row.text('successes_raycast')}; {row.text('mcnemar_p')}",
                      row.text("pairs"), row.text("patients"), over, f"{three('p95_distance_mm')}, {three('max_distance_mm')}",
                      f"{row.text('margin_mm')} mm: {row.text('claim')}", three("error_difference_mm"),
                      f"{fixed(row.number('median_seconds_field'), 4)}, {fixed(row.number('median_seconds_raycast'), 2)}"])
    return markdown(["Run", "Common starts", "Successes: field, ray casting; McNemar's p", "Pairs", "Patients",
                     "End poses apart, mm: mean over patients [95 % intervals]", "of pairs: 95th percentile, largest", "Equivalent within",
                     "Error, field less ray casting, mm", "Seconds"], lines) if lines else ""


def distances_markdown(rows):
    def three(row, unit):
        return ", ".join(fixed(row.number(f"{part}_{unit}"), 4) for part in ("median", "p95", "max"))

    lines = [[row.text("case"), f"{row.text('run_a')} {row.text('renderer_a')}", f"{row.text('run_b')} {row.text('renderer_b')}",
              row.text("starts"), three(row, "distance_mm"), three(row, "rotation_deg")] for row in rows]
    return markdown(["Case", "End poses of", "and of", "Starts", "Distance, mm: median, 95th percentile, maximum", "Rotation, deg: the same"],
                    lines) if lines else ""


def patients_markdown(rows):
    def interval(row, kind):
        low, high = (fixed(row.number(f"{kind}_{end}_mm"), 4) for end in ("low", "high"))
        return "-" if low == "-" else f"[{low}, {high}]"

    lines = [[f"{row.text('run_a')} {row.text('renderer_a')}", f"{row.text('run_b')} {row.text('renderer_b')}", row.text("patients"),
              row.text("starts"), f"{fixed(row.number('mean_distance_mm'), 4)} {interval(row, 'bootstrap')}, {interval(row, 'student')}",
              f"within {row.text('margin_mm')} mm: {row.text('claim')}"] for row in rows]
    return markdown(["End poses of", "and of", "Patients", "Starts", "Distance, mm: mean over patients [95 % by bootstrap], Student's",
                     "Equivalent"], lines) if lines else ""


def comparison(path, is_screen):
    """NAME.csv and the tables of pairs beside it."""
    rows = list(rows_of(path))
    parts = [screen_markdown(rows)] if is_screen else [methods_markdown(rows), studies_markdown(rows)]
    for end, make in (("pairs", pairs_markdown), ("pose-distances", distances_markdown), ("pose-distances-over-patients", patients_markdown)):
        beside = path.with_name(f"{path.stem}-{end}.csv")
        if beside.is_file():
            parts.append(make(list(rows_of(beside))))
    return "\n".join(part for part in parts if part)


# --- af-evaluate held-out ---------------------------------------------------------------------------------------------


def held_out(path, _):
    groups, smoothing = {}, "-"
    for row in rows_of(path):
        groups.setdefault((row.text("case"), row.text("prediction")), []).append((row.number("psnr_db"), row.number("smoothed_psnr_db")))
        smoothing = row.text("smoothing_px")

    def mean_and_least(values):
        return f"{fixed(sum(values) / len(values), 2)} ({fixed(min(values), 2)})"

    return markdown(["Case", "Prediction", "Views", "PSNR, mean (least) dB", f"smoothed by {smoothing} px"], [
        [*key, len(pairs), *(mean_and_least(values) for values in zip(*pairs))] for key, pairs in groups.items()])


# --- af-evaluate population --------------------------------------------------------------------------------------------


def is_kind(group):
    return group not in ("all", "odd", "even", "real")


def population_markdown(rows):
    lines = []
    for row in rows:
        if is_kind(row.text("group")):
            continue
        text, number = row.text, row.number
        starts = number("starts")
        own, low, high = (fixed(number(f"patients_capture_{name}"), 1) for name in ("mean_mm", "bootstrap_low_mm", "bootstrap_high_mm"))
        whole = ">= " if text("capture_ended_by") == "last interval" else ""
        lines.append([text("condition"), text("group"), f"{text('patients')}, {text('patients_with_failures')}", text("starts"), text("error"),
                      per_cent(number("rate"), 1), *(f"{per_cent(number(f'{kind}_low'), 1)} to {per_cent(number(f'{kind}_high'), 1)}"
                                                     for kind in ("bootstrap", "student")),
                      " / ".join(per_cent(number(f"below_{limit}_mm") / starts, 1) for limit in (1, 5)),
                      whole + fixed(number("capture_mm"), 1),
                      f"{'>= ' if number('patients_capture_lower_bounds') > 0 else ''}{own} ({low} to {high})",
                      fixed(number("median_error_mm"), 2), f"{fixed(number('median_depth_mm'), 1)}, {fixed(number('p95_depth_mm'), 1)}",
                      fixed(number("median_seconds"), 3)])
    return markdown(["Condition", "Group", "Patients, of whom lost a start", "Starts", "Error", "Success, %", "Bootstrap", "Student's",
                     "Below 1 / 5 mm, %", "Capture range of all, mm", "Patients' own, mean, mm", "Median error, mm",
                     "Depth off, one view, mm: median, 95th percentile", "Seconds"], lines)


def kinds_markdown(rows):
    """A column per kind of patient, in the order of the rows."""
    kinds = list(dict.fromkeys(row.text("group") for row in rows if is_kind(row.text("group")) or row.text("group") == "real"))
    conditions = list(dict.fromkeys(row.text("condition") for row in rows))
    cells = {(row.text("condition"), row.text("group")): f"{per_cent(row.number('rate'), 1)}, {fixed(row.number('capture_mm'), 1)}" for row in rows}
    return markdown(["Condition", *kinds], [[condition, *(cells.get((condition, kind), "-") for kind in kinds)] for condition in conditions])


def population(folder):
    rows = list(rows_of(folder / "population.csv"))
    commits = sorted({row.text("commit") for row in rows})
    limit = next((f"{row.number('success_mm'):g}" for row in rows), "-")
    return (f"Success is an error below {limit} mm: TRE, with one view mRPD, whose depth is a column of its own.\n\n{population_markdown(rows)}\n"
            "Kinds of patients: success, %, capture range of all starts, mm:\n\n"
            f"{kinds_markdown(rows)}\nCommits of the programs: {', '.join(commits)}."
            f"{' Conditions are of different programs.' if len(commits) > 1 else ''}\n")


# --- af-evaluate error-budget ----------------------------------------------------------------------------------------


def error_budget(summary):
    lines = []
    for step in summary["steps"]:
        moved = f"{fixed(step['shift_mm'], 3)} +- {fixed(step['shift_standard_error_mm'], 3)}" if step["shift_mm"] is not None else ""
        lines.append([step["label"], f"{step['successes']} of {step['starts']}", moved,
                      *(fixed(step[name], 3) for name in ("bias_mm", "scatter_mm", "tre_mm"))])
    gold = summary.get("gold")
    if gold:
        lines.append(["gold standard by fiducials, by itself", "", f"{fixed(gold['uncertainty']['mean_tre_mm'], 3)} expected, "
                      f"{fixed(gold.get('stated_to_fiducials_mm'), 3)} from the stated pose", "", "", ""])
    return (markdown(["Run", "Succeeded", "Moves the mean end by, mm", "Bias, mm", "Scatter, mm", "TRE, mm"], lines) +
            f"\nOver the {summary['common_starts']} starts from which every run succeeded.\n")


def budget_of(path):
    try:
        return error_budget(json.loads(Path(path).read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileError(f"{path}: {error!r}") from None
