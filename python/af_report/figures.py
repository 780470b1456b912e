# SPDX-License-Identifier: Apache-2.0
"""The figures of runs: each function returns a matplotlib figure, and the columns and rows from which it is drawn."""
import io
import math
import zlib

from .files import csv_text, write_file
from .numbers import as_number
from .runs import field_name, is_papers_setting, method_name

# Colours that people with any form of colour blindness tell apart (Okabe and Ito 2008).
BLUE, VERMILION, GREEN, PURPLE, SKY, ORANGE = COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
INK, QUIET, GRID = "#1F2933", "#5B6B7D", "#D8DEE6"
LOWEST_MM, HIGHEST_MM = 0.01, 100.0
MOST_DOTS = 4000

STYLE = {
    "svg.hashsalt": "af-report", "svg.fonttype": "none", "font.family": "DejaVu Sans", "font.size": 11,
    "axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": INK, "axes.labelcolor": INK,
    "axes.grid": True, "axes.axisbelow": True, "grid.color": GRID, "xtick.color": INK, "ytick.color": INK,
    "axes.titlesize": 12, "text.color": INK, "legend.frameon": False, "text.parse_math": False}


def new_figure(title="", size=None, rows=1, columns=1):
    """A new figure. Without a size it has one panel with fixed margins, wide enough for 0.01, which saves the layout's time."""
    # The import takes longer than most pages, so only figures pay for it.
    import matplotlib
    from matplotlib.figure import Figure
    matplotlib.rcParams.update(STYLE)
    figure = Figure(figsize=size or (6.4, 4.2), layout="constrained" if size else None)
    axes = figure.subplots(rows, columns, squeeze=False)
    if not size:
        figure.subplots_adjust(left=0.106, bottom=0.115, right=0.978, top=0.917)
    if title:
        figure.suptitle(title, fontsize=12)
    return figure, axes.ravel()


def svg_of(figure):
    """The bytes, drawn only once; savefig() draws twice."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    buffer = io.BytesIO()
    FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def png_of(figure):
    """The bytes, with 200 pixels per inch."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    buffer = io.BytesIO()
    figure.dpi = 200
    FigureCanvasAgg(figure).print_png(buffer, metadata={"Software": None}, pil_kwargs={"compress_level": 1})
    return buffer.getvalue()


def save(drawn, path):
    """PATH.svg, PATH.png at twice the size and, where there are rows, PATH.csv."""
    figure, columns, rows = drawn
    write_file(f"{path}.png", png_of(figure))
    # Drawing the PNG has laid the figure out already.
    figure.set_layout_engine("none")
    write_file(f"{path}.svg", svg_of(figure))
    if columns:
        write_file(f"{path}.csv", csv_text(columns, rows))


def ticks_at(axis, values):
    """Shows only these ticks, with their numbers as they stand."""
    from matplotlib.ticker import FixedLocator
    axis.set_major_locator(FixedLocator(values))
    axis.set_ticks([], minor=True)
    axis.set_major_formatter("{x:g}")


def millimetres(axis, highest=HIGHEST_MM):
    """A logarithmic axis of errors that begins at 0.01 mm."""
    ticks_at(axis, [tick for power in range(-2, 4) for tick in (10.0**power, 2 * 10.0**power, 5 * 10.0**power) if tick <= highest])


def line_at(axes, value, text, horizontal=True):
    """A dashed limit with its name."""
    if horizontal:
        axes.axhline(value, color=QUIET, linestyle="--", linewidth=1)
        axes.annotate(text, (0.995, value), xycoords=("axes fraction", "data"), ha="right", va="bottom", color=QUIET, fontsize=9)
    else:
        axes.axvline(value, color=QUIET, linestyle="--", linewidth=1)
        axes.annotate(text, (value, 0.985), xycoords=("data", "axes fraction"), ha="right", va="top", rotation=90,
                      color=QUIET, fontsize=9)


def success_rates(groups, error="TRE"):
    """Success per interval of initial TRE with Wilson intervals (Fig. 16). `groups`: (label, intervals of a summary)."""
    figure, (axes,) = new_figure("Success against initial error")
    rows = []
    for place, (label, intervals) in enumerate(groups):
        shown = [entry for entry in intervals if entry["starts"] > 0]
        rows += [[label, *(entry[key] for key in ("low_mm", "high_mm", "starts", "successes", "rate", "wilson_low", "wilson_high"))]
                 for entry in shown]
        width = intervals[0]["high_mm"] if intervals else 1
        x = [(entry["low_mm"] + entry["high_mm"]) / 2 + 0.12 * width * (place - (len(groups) - 1) / 2) for entry in shown]
        y = [100 * entry["rate"] for entry in shown]
        spread = [[max(0, 100 * (entry["rate"] - entry["wilson_low"])) for entry in shown],
                  [max(0, 100 * (entry["wilson_high"] - entry["rate"])) for entry in shown]]
        axes.errorbar(x, y, yerr=spread, fmt="o:", markersize=5, capsize=3, color=COLORS[place % 6], label=label)
        axes.set_xlim(0, max(axes.get_xlim()[1] if place else 0, intervals[-1]["high_mm"] if intervals else 1))
    line_at(axes, 95, "95")
    axes.set(xlabel="initial TRE (mm)", ylabel=f"success by {error} (% of starts)", ylim=(0, 103))
    axes.legend(loc="lower left")
    return figure, ["group", "low_mm", "high_mm", "starts", "successes", "rate", "wilson_low", "wilson_high"], rows


def tre_histogram(groups, success_mm, error="TRE"):
    """Share of each group's starts against their error, with eight bars per factor of ten. The last bar holds all larger
    errors and the ends without a pose (Fig. 15)."""
    figure, (axes,) = new_figure("Error after registration")
    edges = [LOWEST_MM * 10 ** (step / 8) for step in range(33)]
    rows = []
    for place, (label, starts) in enumerate(groups):
        counts = [0] * len(edges)
        for start in starts:
            end = start["error_mm"]
            step = 8 * math.log10(max(end, LOWEST_MM) / LOWEST_MM) if end < HIGHEST_MM else 32
            counts[min(32, int(step + 1e-9))] += 1
        ends = [*edges, 10 * HIGHEST_MM]
        for count, low, high in zip(counts, ends, ends[1:]):
            rows.append([label, f"{0 if low == LOWEST_MM else low:.4g}", f"{high:.4g}" if low < HIGHEST_MM else "inf", count,
                         count / max(1, len(starts))])
        shares = [100 * count / max(1, len(starts)) for count in counts]
        left = [low * 10 ** (place / 8 / len(groups)) for low in edges]
        widths = [low * (10 ** (0.92 / 8 / len(groups)) - 1) for low in left]
        # One outline, because a patch per bar would take half the drawing's time.
        axes.fill_between([x for low, width in zip(left, widths) for x in (low, low, low + width, low + width)],
                          [y for share in shares for y in (0, share, share, 0)], color=COLORS[place % 6], linewidth=0, label=label)
    axes.set_xscale("log")
    axes.set_xlim(LOWEST_MM, HIGHEST_MM * 10 ** (1 / 8))
    millimetres(axes.xaxis, HIGHEST_MM / 2)
    axes.grid(axis="x", visible=False)
    line_at(axes, success_mm, f"success: below {success_mm:g} mm", horizontal=False)
    axes.set(xlabel=f"{error} (mm); at the right edge: 100 mm and more, no pose", ylabel="share of starts (%)")
    axes.set_ylim(0)
    axes.legend(loc="upper left")
    return figure, ["group", "low_mm", "high_mm", "starts", "share"], rows


def in_part(groups):
    """Every n-th start, as more dots would show nothing more, and the words for it in a title."""
    stride = max(1, math.ceil(max((len(starts) for _, starts in groups), default=0) / MOST_DOTS))
    return [(label, starts[::stride]) for label, starts in groups], "" if stride == 1 else f", one start in {stride}"


def tre_scatter(groups, largest_mm, success_mm, error="TRE"):
    """Initial TRE against the final error, one dot per start."""
    groups, part = in_part(groups)
    figure, (axes,) = new_figure("Error before and after registration" + part)
    rows = []
    for place, (label, starts) in enumerate(groups):
        rows += [[label, start["initial_tre_mm"], start["error_mm"]] for start in starts]
        ended = [start for start in starts if math.isfinite(start["error_mm"])]
        axes.scatter([start["initial_tre_mm"] for start in ended], [max(LOWEST_MM, start["error_mm"]) for start in ended], s=14,
                     marker="o^sDv<"[place % 6], color=COLORS[place % 6], label=label)
    axes.set_yscale("log")
    axes.set(xlabel="initial TRE (mm)", ylabel=f"final {error} (mm)", xlim=(0, largest_mm))
    axes.set_ylim(LOWEST_MM, max(HIGHEST_MM, axes.get_ylim()[1]))
    millimetres(axes.yaxis, axes.get_ylim()[1])
    steps = [largest_mm * step / 200 for step in range(1, 201)]
    axes.plot(steps, steps, ":", color=QUIET, linewidth=1)
    axes.annotate("no change", (steps[-1], steps[-1]), ha="right", va="bottom", color=QUIET, fontsize=9)
    line_at(axes, success_mm, "success below")
    axes.legend(loc="upper left")
    return figure, ["group", "initial_tre_mm", "error_mm"], rows


def confidence(groups, success_mm, error="TRE"):
    """Stated confidence against the error. The confidence is 0 where there is no end."""
    groups, part = in_part(groups)
    figure, (axes,) = new_figure("Stated confidence against the error" + part)
    rows, lowest = [], 1e-3
    for place, (label, starts) in enumerate(groups):
        judged = [start for start in starts if math.isfinite(start.get("confidence", math.nan)) and math.isfinite(start["error_mm"])]
        rows += [[label, start["confidence"], start["error_mm"]] for start in judged]
        for found, name in ((True, label), (False, f"{label}: not found")):
            shown = [start for start in judged if (start.get("verdict") != "not found" and start["confidence"] > 0) == found]
            if shown or found:
                axes.scatter([min(1 - lowest, max(lowest, start["confidence"])) if start["confidence"] > 0 else lowest / 3 for start in shown],
                             [max(LOWEST_MM, start["error_mm"]) for start in shown], s=18, label=name,
                             marker="o^sDv<"[place % 6] if found else "x", color=COLORS[place % 6])
    axes.set_xscale("logit")
    axes.set_yscale("log")
    axes.set_xlim(lowest / 5, 1 - lowest / 2)
    ticks = {lowest / 3: "0", lowest: "≤ 0.001", 0.01: "0.01", 0.1: "0.1", 0.5: "0.5", 0.9: "0.9", 0.99: "0.99", 1 - lowest: "≥ 0.999"}
    axes.set_xticks(list(ticks), list(ticks.values()), fontsize=9)
    axes.set_xticks([], minor=True)
    axes.set_ylim(LOWEST_MM, max(HIGHEST_MM, axes.get_ylim()[1]))
    millimetres(axes.yaxis, axes.get_ylim()[1])
    axes.set(xlabel="confidence that the end is right", ylabel=f"final {error} (mm)")
    line_at(axes, success_mm, f"right: below {success_mm:g} mm")
    axes.legend(loc="upper left")
    return figure, ["group", "confidence", "error_mm"], rows


def quantile(values, share):
    values = sorted(values)
    place = share * (len(values) - 1)
    low = math.floor(place)
    return values[low] + (place - low) * (values[min(low + 1, len(values) - 1)] - values[low])


def psnr_boxes(groups, has_papers_levels=False):
    """Box plots (Fig. 8): quartiles and median, whiskers from the 5th to the 95th percentile, every pose as a dot."""
    groups = [(label, [value for value in values if math.isfinite(value)]) for label, values in groups]
    figure, (axes,) = new_figure("DRR quality: field against ray casting", (max(4.6, 2.4 + 1.7 * len(groups)), 4.2))
    for place, (label, values) in enumerate(groups, 1):
        spots = [place + (zlib.crc32(f"{label} {index}".encode()) / 2**32 - 0.5) * 0.26 for index in range(len(values))]
        axes.scatter(spots, values, s=6, color=SKY)
        if values:
            low, q1, median, q3, high = (quantile(values, share) for share in (0.05, 0.25, 0.5, 0.75, 0.95))
            axes.bxp([{"med": median, "q1": q1, "q3": q3, "whislo": low, "whishi": high}], [place], widths=0.42,
                     showfliers=False, boxprops={"color": BLUE, "linewidth": 2}, whiskerprops={"color": BLUE},
                     capprops={"color": BLUE}, medianprops={"color": VERMILION, "linewidth": 3})
    everything = [value for _, values in groups for value in values]
    levels = {43: "43: paper's medians", 40: "40: almost all above", 36: "36: very few below"} if has_papers_levels else {40: "40", 36: "36"}
    for level, text in levels.items():
        axes.axhline(level, color=QUIET, linestyle="--", linewidth=1)
        axes.annotate(text, (1.01, level), xycoords=("axes fraction", "data"), va="center", color=QUIET, fontsize=9)
    axes.set(ylabel="PSNR (dB)", xlim=(0.4, len(groups) + 0.6), ylim=(min([35, *everything]) - 1, max([45, *everything]) + 1))
    axes.set_xticks(range(1, len(groups) + 1), [label for label, _ in groups])
    axes.grid(axis="x", visible=False)
    return figure, ["group", "psnr_db"], [[label, value] for label, values in groups for value in values]


def psnr_of_rows(rows, label):
    groups = {}
    for row in rows:
        name = f"{row.text('case')} {row.text('camera')}" if "case" in row else label
        groups.setdefault(name, []).append(row.number("psnr_db"))
    return list(groups.items()) or [(label, [])]


def loss_split(run):
    rows = list(run.rows("loss-split-poses.csv"))
    labels = [(f"{part['name']}_psnr_db", part["label"]) for part in run.summary["loss_split"]["parts"]]
    return psnr_boxes([(label, [row.number(column) for row in rows]) for column, label in labels])


def similarity_curves(run):
    """Similarity along each pose parameter about the gold pose (Fig. 14)."""
    figure, panels = new_figure("Similarity about the gold pose", (9, 5.6), 2, 3)
    curves, peaks = {}, {}
    for row in run.rows("similarity-curves.csv"):
        x, y = curves.setdefault((row.text("parameter"), row.text("unit"), row.text("renderer")), ([], []))
        x.append(row.number("offset"))
        y.append(row.number("similarity"))
    for row in run.rows("maxima.csv"):
        peaks[row.text("parameter"), row.text("renderer")] = row.number("offset_of_maximum"), row.number("similarity_at_maximum")
    axes_of = dict(zip(("tx", "ty", "tz", "rx", "ry", "rz"), panels))
    colors = {}
    for (parameter, unit, renderer), (x, y) in curves.items():
        axes, color = axes_of[parameter], colors.setdefault(renderer, COLORS[len(colors) % 6])
        axes.plot(x, y, color=color, label=method_name(renderer))
        axes.plot(*peaks[parameter, renderer], "o", color=color, markersize=6, fillstyle="full" if renderer == "field" else "none")
        axes.axvline(0, color=QUIET, linestyle="--", linewidth=1)
        axes.set_xlabel(f"{parameter} ({unit})")
    values = [value for _, y in curves.values() for value in y if math.isfinite(value)] or [0, 1]
    margin = 0.05 * (max(values) - min(values)) or 1
    for place, axes in enumerate(panels):
        axes.set_ylim(min(values) - margin, max(values) + 2 * margin)
        if place % 3 == 0:
            axes.set_ylabel(f"similarity ({run.summary['similarity']})")
    panels[2].legend(loc="upper right", fontsize=9)
    return figure, None, None


def field_parameters(run):
    """PSNR against each parameter of a field; the first setting is the one that all sweeps share (Fig. 10)."""
    figure, panels = new_figure("DRR quality against the field's parameters", (7.6, 6), 2, 2)
    settings = run.summary["settings"]
    labels = {"uv_nodes": "(u,v) nodes per side", "st_nodes": "(s,t) nodes per side", "codewords": "codewords",
              "training_fraction": "share of tiles for training"}
    for axes, (key, label) in zip(panels, labels.items()):
        base = settings[0]
        shown = sorted((setting for setting in settings if setting is base or setting[key] != base[key]), key=lambda each: each[key])
        x = [setting[key] for setting in shown]
        low, middle, high = ([as_number(setting["psnr_db"][part]) for setting in shown] for part in ("q1", "median", "q3"))
        spread = [[m - q for m, q in zip(middle, low)], [q - m for m, q in zip(middle, high)]]
        axes.errorbar(x, middle, yerr=spread, fmt="o:", capsize=3, color=BLUE)
        axes.plot([base[key]], [base["psnr_db"]["median"]], "o", color=VERMILION, markersize=8)
        axes.set_xscale("log")
        axes.set_xticks([], minor=True)
        axes.set_xticks(x, [f"{value:g}" for value in x])
        axes.set(xlabel=label, ylabel="PSNR (dB)")
    everything = [as_number(setting["psnr_db"][part]) for setting in settings for part in ("q1", "q3")]
    for axes in panels:
        axes.set_ylim(math.floor(min(everything)), math.ceil(max(everything)))
    return figure, None, None


def groups_of(run):
    """(label in figures, starts) for each method."""
    renderers = [renderer["renderer"] for renderer in run.summary["renderers"]]
    return [(method_name(name), [start for start in run.starts if start["renderer"] == name]) for name in renderers]


def figures_of(run):
    """The figures of a run by name, as functions without arguments."""
    summary = run.summary
    if run.kind == "registration":
        success_mm = float(summary["success_tre_mm"])
        intervals = [(method_name(entry["renderer"]), entry["intervals"]) for entry in summary["renderers"]]
        figures = {"success-rate": lambda: success_rates(intervals, run.error),
                   "tre-histogram": lambda: tre_histogram(groups_of(run), success_mm, run.error),
                   "tre-scatter": lambda: tre_scatter(groups_of(run), intervals[0][1][-1]["high_mm"], success_mm, run.error)}
        if any(math.isfinite(start.get("confidence", math.nan)) for start in run.starts):
            figures["confidence"] = lambda: confidence(groups_of(run), success_mm, run.error)
        return figures
    if run.kind == "image-quality":
        figures = {"psnr": lambda: psnr_boxes(psnr_of_rows(run.rows("image-quality.csv"), field_name(run)), is_papers_setting(run))}
        return {**figures, "loss-split": lambda: loss_split(run)} if "loss_split" in summary else figures
    makers = {"similarity-curves": similarity_curves, "field-parameters": field_parameters}
    return {run.kind: lambda: makers[run.kind](run)} if run.kind in makers else {}
