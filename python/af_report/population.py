# SPDX-License-Identifier: Apache-2.0
"""The figures of a study of many patients, from the tables that af-evaluate population writes."""
import re

from .figures import BLUE, COLORS, SKY, VERMILION, new_figure
from .files import rows_of


def is_drawn(condition):
    """Conditions with several renderers are not drawn: their names end in ", RENDERER"."""
    return ", " not in condition


def success(folder):
    """Success against the initial error: a panel per variant and number of views, a line per preset."""
    panels = {}
    for row in rows_of(folder / "intervals.csv"):
        condition = row.text("condition")
        if is_drawn(condition):
            name, _, preset = condition.rpartition("-")
            panels.setdefault(name or condition, {}).setdefault(preset, []).append(row)
    if not panels:
        return None
    rows = (len(panels) + 1) // 2
    figure, all_axes = new_figure("", (9, 3.2 * rows), rows, 2)
    for axes in all_axes[len(panels):]:
        axes.remove()
    for axes, (panel, presets) in zip(all_axes, panels.items()):
        for place, (preset, entries) in enumerate(presets.items()):
            shown = [row for row in entries if row.number("starts") > 0]
            x = [(row.number("low_mm") + row.number("high_mm")) / 2 + 0.25 * (place - 1) for row in shown]
            y = [100 * row.number("successes") / row.number("starts") for row in shown]
            spread = [[max(0, value - 100 * row.number("bootstrap_low")) for value, row in zip(y, shown)],
                      [max(0, 100 * row.number("bootstrap_high") - value) for value, row in zip(y, shown)]]
            axes.errorbar(x, y, yerr=spread, fmt="o-", markersize=4, capsize=2, color=COLORS[place % 6], label=preset)
        views = " view" if panel.endswith("-1") else " views" if panel.endswith("-2") else ""
        error = " or ".join(sorted({row.text("error") for entries in presets.values() for row in entries}))
        axes.set(title=f"{panel}{views}, by {error}", xlabel="initial TRE (mm)", ylabel="success (%)", ylim=(0, 103),
                 xlim=(0, max(row.number("high_mm") for entries in presets.values() for row in entries)))
        axes.legend(loc="lower left", fontsize=9)
    return figure, None, None


def capture_ranges(folder):
    """Every patient's own capture range: a row per condition, a mark per patient, the mean with its interval."""
    means = [row for row in rows_of(folder / "population.csv") if row.text("group") == "all" and is_drawn(row.text("condition"))]
    if not means:
        return None
    names = [row.text("condition") for row in means]
    figure, (axes,) = new_figure("Capture range of every patient (van de Kraats)", (9, 1.6 + 0.45 * len(names)))
    marks, equals = {"odd": ([], []), "even": ([], [])}, {}
    for row in rows_of(folder / "patients.csv"):
        condition = row.text("condition")
        if condition not in names:
            continue
        range_mm = row.number("capture_mm")
        before = equals[condition, range_mm] = equals.get((condition, range_mm), -1) + 1
        number = re.search(r"(\d+)$", row.text("patient"))
        x, y = marks["odd" if number and int(number[1]) % 2 else "even"]
        # Patients of equal range are stacked in columns of three, within the interval that ended the range.
        x.append(range_mm + min(1.6, 0.3 * (before // 3)))
        y.append(-names.index(condition) + 0.12 * (before % 3))
    for half, color, label in (("odd", SKY, "odd patients"), ("even", BLUE, "even and real patients")):
        if marks[half][0]:
            axes.scatter(*marks[half], s=16, color=color, label=label)
    for place, row in enumerate(means):
        middle, low, high = (row.number(f"patients_capture_{part}_mm") for part in ("mean", "bootstrap_low", "bootstrap_high"))
        spread = [[max(0, middle - low)], [max(0, high - middle)]] if low == low and high == high else None
        axes.errorbar([middle], [-place - 0.2], xerr=spread, fmt="s", capsize=3, color=VERMILION,
                      label=None if place else "mean, 95 % over patients")
    axes.set_yticks([-place for place in range(len(names))], names)
    axes.set(xlabel="capture range (mm of initial TRE)", ylim=(-len(names) + 0.4, 0.6))
    axes.set_xlim(-1, None)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.25), ncols=3, fontsize=9)
    return figure, None, None
