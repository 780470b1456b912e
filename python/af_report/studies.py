# SPDX-License-Identifier: Apache-2.0
"""Figures and tables for jobs/rate-against-truth.sh and bench-scaling."""
from .figures import BLUE, COLORS, GREEN, INK, PURPLE, QUIET, VERMILION, new_figure, save, ticks_at
from .files import rows_of
from .tables import markdown


def scaling(path, _):
    """Draws the modelled seconds of af-precompute against ranks, per phase."""
    figure, (axes,) = new_figure("Modelled seconds of af-precompute", (8.6, 4.2))
    rows = list(rows_of(path))
    for field, column, color, style, label in (
            ("large", "total", INK, "-", "128x128 x 1024x1024: total"), ("large", "cast", BLUE, "-", "casting"),
            ("large", "train", VERMILION, "-", "training"), ("large", "encode", GREEN, "-", "encoding"),
            ("large", "write", PURPLE, "-", "writing"), ("measured", "total", QUIET, "--", "64x64 x 256x256: total")):
        shown = [row for row in rows if row.text("field") == field and row.number(column) > 0]
        axes.plot([row.number("ranks") for row in shown], [row.number(column) for row in shown], style, color=color, linewidth=2, label=label)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set(xlabel="ranks", ylabel="seconds")
    ticks_at(axes.xaxis, (1, 4, 16, 64, 256, 1024, 4096))
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5))
    save((figure, None, None), path.with_suffix(""))
    return ""


def panel(axes, rows, column, title):
    """Joins designs whose names are budgets, such as 2MB. A square is paper, a diamond standard, a circle any other."""
    shown = sorted((row for row in rows if row.number(column) > 0), key=lambda row: row.number("mb_per_camera"))
    for place, anatomy in enumerate(sorted({row.text("anatomy") for row in rows})):
        color = COLORS[place % 6]
        for kind, style in (("budget", "o-"), ("standard", "D"), ("paper", "s"), ("other", "o")):
            points = [row for row in shown if row.text("anatomy") == anatomy and kind_of(row.text("design")) == kind]
            if points or kind == "standard":
                axes.plot([row.number("mb_per_camera") for row in points], [row.number(column) for row in points], style, color=color,
                          markersize=4 if kind == "budget" else 7, fillstyle="none" if kind in ("paper", "other") else "full",
                          label=anatomy if kind == "standard" else None)
    axes.set_xscale("log", base=2)
    axes.set(title=title, xlabel="MB per camera")
    ticks_at(axes.xaxis, (0.25, 0.5, 1, 2, 4, 8, 16, 32))
    axes.legend(fontsize=8)


def kind_of(design):
    return "budget" if design.endswith("MB") else design if design in ("paper", "standard") else "other"


def rate_tables(rows):
    """Tables with a line per design and a column per anatomy, for each kind of X-rays."""
    text = ""
    for title, columns in (("MB per camera, dB, mm", ("mb_per_camera", "psnr_db", "median_distance_mm")),
                           ("ms of a DRR, of a registration by field, by ray casting", ("drr_ms", "registration_ms", "raycast_ms"))):
        for group in dict.fromkeys((row.text("variant"), row.text("views")) for row in rows):
            of_group = [row for row in rows if (row.text("variant"), row.text("views")) == group]
            anatomies = list(dict.fromkeys(row.text("anatomy") for row in rows))
            cells = {(row.text("design"), row.text("anatomy")): ", ".join(row.text(column) for column in columns) for row in of_group}
            views = "two views" if group[1] == "2" else "one view"
            text += markdown([f"{group[0]}, {views}: {title}", *anatomies], [
                [design, *(cells.get((design, anatomy), "") for anatomy in anatomies)]
                for design in dict.fromkeys(row.text("design") for row in of_group)]) + "\n"
    return text


def rates(path, _):
    """Draws rate.svg (quality and times) and distance.svg (from ray casting's end) against the bytes of a field."""
    rows = list(rows_of(path))

    def rows_with(variant, views):
        return [row for row in rows if row.text("variant") == variant and row.text("views") == views]

    figure, panels = new_figure("", (11, 7), 2, 2)
    panel(panels[0], rows_with("clean", "2"), "psnr_db", "PSNR, dB, clean")
    panel(panels[1], rows_with("clean", "2"), "drr_ms", "DRR, ms, clean")
    for axes, variant in zip(panels[2:], ("clean", "stressed")):
        panel(axes, rows_with(variant, "2"), "registration_ms", f"registration, ms: {variant}, two views")
    for axes in panels[1:]:
        axes.set_yscale("log", base=2)
        axes.yaxis.set_major_formatter("{x:g}")
    save((figure, None, None), path.parent / "rate")
    figure, panels = new_figure("", (11, 7), 2, 2)
    for axes, (views, variant) in zip(panels, ((views, variant) for views in "21" for variant in ("clean", "stressed"))):
        panel(axes, rows_with(variant, views), "median_distance_mm", f"from ray casting's end, mm: {variant}, views: {views}")
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter("{x:g}")
    save((figure, None, None), path.parent / "distance")
    return rate_tables(rows)
