# SPDX-License-Identifier: Apache-2.0
"""The page's section on registrations."""
import math

from markupsafe import Markup

from .blocks import Figure, Figures, Items, Section, Table, Text, heading, strong
from .failures import failures
from .figures import figures_of, success_rates, svg_of
from .numbers import as_number, capture, counted, milliseconds, percent, rate, three, time, whole
from .pictures import pictures, run_figure
from .runs import method_name

MOST_CURVES = 6


def method_text(run, renderer):
    """attenuation fields, robust: ncc, gc, rg; only the name for another program's poses."""
    name, method = renderer["renderer"], run.summary["method"]
    if name not in ("field", "raycast"):
        return name
    parts = [method["preset"], method["similarity"], method["optimizer"], "corrected" if method.get("corrected") else ""]
    return f"{method_name(name)}: {'; '.join(part for part in parts if part)}"


def depth_text(depth):
    """Median and 95th percentile of one view's error in depth. A dash where there is none."""
    return f"{three(depth['median'])}, {three(depth['p95'])}" if depth["count"] else "–"


def confidence_text(renderer):
    """Right and wrong ends with a confidence of 0.9 or more."""
    stated = (renderer.get("uncertainty") or {}).get("confidence") or {}
    for level in stated.get("at_least", []):
        if level["confidence"] == 0.9:
            wrong = f", wrong {percent(level['share_of_failures'])}" if stated["failures"] else ""
            return f"right {percent(level['share_of_successes'])}{wrong}"
    return "–"


def own_captures(renderer):
    """The mean, smallest and largest of the patients' own capture ranges, and intervals of the mean."""
    own = renderer["over_cases"]["capture_range_mm"]
    if own["cases"] < 2:
        return capture(renderer["capture_range"])
    text = f"{'at least ' if own['at_least'] else ''}{three(own['mean_mm'])} mm ({three(own['min_mm'])} to {three(own['max_mm'])}"
    if own["low"] is not None:
        text += f"; over patients {three(own['low'])}–{three(own['high'])}"
    if own["student_low"] is not None:
        text += f", Student {three(own['student_low'])}–{three(own['student_high'])}"
    return text + ")"


def overview(runs):
    """Every run and method, the default method first."""
    rows = []
    for run in runs:
        for renderer in run.summary["renderers"]:
            link = Markup('<a href="#%s">%s</a>') % (run.anchor, run.name)
            name = method_text(run, renderer)
            rows.append([link, Markup("%s <b>(default)</b>") % name if run.is_default(renderer) else name, whole(renderer["starts"]),
                         rate(renderer), renderer["error"], three(renderer["error_of_successes_mm"]["mean"]),
                         three(renderer["error_of_all_mm"]["median"]), three(renderer["error_of_all_mm"]["p95"]),
                         depth_text(renderer["depth_of_all_mm"]), milliseconds(renderer["seconds"]["median"]),
                         confidence_text(renderer), whole(renderer["gross_failures"]["successes"]), own_captures(renderer)])
    return Table(["Run", "Method", "#Starts", "#Success (95 % interval)", "by", "#Mean error of successes (mm)", "#Median of all (mm)",
                  "#95th percentile (mm)", "#Depth off: median, 95th percentile (mm)", "#Median ms", "Confidence ≥ 0.9", "#Gross failures",
                  "Capture range"], rows,
                 "Every run and method; a click on a title sorts. Errors are TREs, with one view mRPDs, whose depth is a column of its own")


def tiles(run):
    """Success, error, time and confidence of the first method."""
    first = run.summary["renderers"][0]
    error, depth = first["error"], first["depth_of_successes_mm"]
    who = method_name(first["renderer"])
    gold = first["gold_uncertainty_mm"]
    confident, _, wrong = confidence_text(first).removeprefix("right ").partition(", ")
    own = "" if gold is None else f"the gold standard by itself: {three(gold)} mm"
    return [(percent(first["rate"]), f"of {whole(first['starts'])} starts succeed" + (f" by {error}" if run.has_one_view else ""),
             f"{run.name}: {who}"),
            (f"{three(first['error_of_successes_mm']['mean'])} mm", f"mean {error} of successes",
             f"depth off by {three(depth['median'])} mm (median), {three(depth['p95'])} mm (95th percentile)" if depth["count"] else own),
            (f"{milliseconds(first['seconds']['median'])} ms", "per registration", f"{who}, median"),
            (confident, "of right ends state a confidence ≥ 0.9", wrong)]


def findings(run):
    """How far off the first method's starts may be, and how long the others take."""
    first, paired = run.summary["renderers"][0], run.summary["field_against_raycast"]
    items = [f"Capture range with {method_name(first['renderer'])}: "
             f"{capture(first['capture_range'])}."]
    if run.has_one_view:
        items[0] += " With one view, successes are by their reprojection distance (mRPD), which leaves out the depth."
    if paired and paired["median_seconds"][0]:
        field, cast = paired["median_seconds"]
        items.append(f"From the {counted(paired['common_starts'], 'start', 'starts')} given to both, a registration took {time(field)} with "
                     f"fields and {time(cast)} with ray casting (medians): {three(cast / field)} times as long, on this computer.")
    return items


def draws_text(rule):
    if rule == "within-range":
        return ("Starts were drawn inside the fields' motion range, so that turns that do not fit are missing: the share of rotation "
                "says what is left of the half that it makes up near the pose")
    if rule == "given":
        return "The starts were given by a table"
    if rule == "search":
        return "Each case looked for its starts itself: its initial error is that of the nominal pose, which it did not use"
    return ("Draws outside the fields' motion range were refused and drawn again; where many were, rotation makes up less of the "
            "starts than the half that it does without refusals")


def draws_of(cases, place):
    """How the starts of an interval were drawn over all cases, as far as that is known."""
    def known(key):
        values = [as_number(case[key][place]) for case in cases if place < len(case[key])]
        return [value for value in values if math.isfinite(value)]

    draws, refused, shares = (known(key) for key in ("draws_per_interval", "inadmissible_draws_per_interval", "rotation_share_per_interval"))
    text = f"{whole(sum(refused))} of {whole(sum(draws))} ({percent(sum(refused) / sum(draws))})" if sum(draws) else "–"
    return [text, three(sum(shares) / len(shares)) if shares else "–"]


def bar(share):
    return Markup('<span class="bar" style="--share:%s"></span>') % round(100 * as_number(share), 1)


def success_table(summary):
    rows = []
    for place, first in enumerate(summary["renderers"][0]["intervals"]):
        for renderer in summary["renderers"]:
            entry = renderer["intervals"][place]
            shown = Markup("%s%s") % (bar(entry["rate"]), rate(entry)) if entry["starts"] else "–"
            rows.append([f"{whole(first['low_mm'])}–{whole(first['high_mm'])}", method_name(renderer["renderer"]), whole(entry["starts"]),
                         whole(entry["successes"]), shown, *draws_of(summary["cases"], place)])
    return Table(["Initial TRE (mm)", "Method", "#Starts", "#Succeeded", "Rate (95 % interval)", "#Draws refused", "#Share of rotation"],
                 rows, f"Success per interval of initial error, with Wilson intervals. {draws_text(summary['start_rule'])}")


def capture_table(renderers):
    rows = []
    for renderer in renderers:
        found, pooled = renderer["capture_range"], renderer["over_cases"]["pooled_capture_range_mm"]
        together = capture(found)
        if pooled["low"] is not None:
            together += f" ({three(pooled['low'])}–{three(pooled['high'])})"
        end = (found or {}).get("end_interval")
        ended = "–" if not end else f"{whole(end['low_mm'])}–{whole(end['high_mm'])} mm: " + (
            f"{whole(end['successes'])} of {whole(end['starts'])}" if end["starts"] else "no starts")
        rows.append([method_name(renderer["renderer"]), own_captures(renderer), together, ended, capture(renderer["cumulative_capture_range"])])
    return Table(["Method", "Patients' own ranges: mean (smallest to largest; 95 %)", "All starts together (95 % over patients)", "Ended by", "Cumulative"],
                 rows,
                 "Capture range: the first interval of initial error with a success below 95 % ends it (van de Kraats et al. 2005). "
                 "Cumulative: the largest initial error with 95 % success up to it, where close starts make up for far ones")


def error_table(renderers):
    rows = []
    for renderer in renderers:
        everything, good = renderer["error_of_all_mm"], renderer["error_of_successes_mm"]
        tre = renderer["tre_of_all_mm"]
        rows.append([method_name(renderer["renderer"]), whole(renderer["starts"]), renderer["error"], three(everything["median"]),
                     f"{three(everything['q1'])}–{three(everything['q3'])}", three(everything["p95"]),
                     f"{three(good['mean'])} ± {three(good['sd'])}", depth_text(renderer["depth_of_all_mm"]),
                     f"{three(tre['median'])}, {three(tre['p95'])}", three(renderer["tre_mm"]["max"]), whole(renderer["without_pose"]),
                     three(renderer["stated_pose_tre_of_successes_mm"]["mean"]), three(renderer["gold_uncertainty_mm"])])
    return Table(["Method", "#Starts", "Error", "#Median", "#Quartiles", "#95th percentile", "#Mean ± SD of successes",
                  "#Depth off: median, 95th percentile", "#TRE: median, 95th percentile", "#Largest TRE with a pose", "#No pose",
                  "#TRE of successes against stated pose", "#Gold standard by itself"], rows,
                 "Errors in mm, TRE or with one view mRPD, over all registrations, one without a pose counting as infinitely far, and over "
                 "successes; how far one view's depth is off")


def threshold_table(renderers):
    rows = []
    for place, threshold in enumerate(renderers[0]["thresholds"]):
        for renderer in renderers:
            rows.append([f"{whole(threshold['threshold_mm'])} mm", method_name(renderer["renderer"]), rate(renderer["thresholds"][place])])
    rows += [["gross failures: 10 mm or more, or no pose", method_name(renderer["renderer"]), rate(renderer["gross_failures"])]
             for renderer in renderers]
    return Table(["Error below", "Method", "#Share (95 % interval)"], rows,
                 f"Share of all starts below other thresholds, by {renderers[0]['error']}")


def other_errors_table(renderers):
    rows = []
    for renderer in renderers:
        errors, bias = renderer["errors_of_successes"], renderer["bias"]
        rows.append([method_name(renderer["renderer"]),
                     *(three(errors[name]["mean"]) for name in ("mrpd_mm", "projection_detector_mm", "projection_isocenter_mm",
                                                                "rotation_error_deg", "translation_error_mm")),
                     *(", ".join(three(bias[name]["mean"]) for name in names)
                       for names in (("rx_deg", "ry_deg", "rz_deg"), ("tx_mm", "ty_mm", "tz_mm")))])
    return Table(["Method", "#mRPD (mm)", "#On the detector (mm)", "#In the isocentre plane (mm)", "#Rotation, geodesic (deg)",
                  "#Translation (mm)", "#Bias rx, ry, rz (deg)", "#Bias tx, ty, tz (mm)"], rows,
                 "Other errors of successes (means), and the mean signed error of each parameter")


def confidence_table(renderers):
    rows = []
    for renderer in renderers:
        stated = renderer.get("uncertainty")
        if not stated or not stated.get("confidence"):
            continue
        found = stated["confidence"]
        for level in found["at_least"]:
            rows.append([method_name(renderer["renderer"]), whole(level["confidence"]), percent(level["share_of_successes"]),
                         percent(level["share_of_failures"]), three(found["roc_area"]), rate(stated["tre_region_95"]),
                         rate(stated["pose_region_95"])])
    return Table(["Method", "#Confidence at least", "#Of right ends", "#Of wrong ends", "#ROC area", "#Cases with a TRE below its stated 95 %",
                  "#Cases with the pose inside its stated 95 % region"], rows, "What registrations say of their own ends") if rows else None


def verdict_table(renderers):
    rows = []
    for renderer in renderers:
        counts = (renderer.get("uncertainty") or {}).get("verdicts")
        for verdict in ("found", "doubtful", "not found") if counts else ():
            rows.append([method_name(renderer["renderer"]), verdict, *(whole(counts[verdict][end]) for end in ("right", "wrong"))])
    return Table(["Method", "Verdict", "#Right ends", "#Wrong ends"], rows, "What the verdicts say of right and of wrong ends") if rows else None


def over_patients(renderers):
    texts = []
    for renderer in renderers:
        found = renderer["over_cases"]["rate"]
        if found["low"] is None:
            continue
        text = Markup("%s (%s): resampling the %s patients gives a 95 %% interval of %s to %s for the success rate.") % (
            strong("Over patients"), method_name(renderer["renderer"]), whole(found["cases"]), percent(found["low"]), percent(found["high"]))
        if found["is_optimistic"]:
            text += Markup(" %s: it holds the truth less often than it says.") % strong("With so few patients this interval is too narrow")
            if found.get("student_low") is not None:
                text += f" Student's interval of the patients' own rates is {percent(found['student_low'])} to {percent(found['student_high'])}."
        texts.append(Text(text))
    return texts or [Text("One patient says nothing about others: there is no interval over patients.")]


def p_text(p):
    return "p < 0.001" if as_number(p) < 0.001 else f"p = {three(p)}"


def paired_text(paired):
    if not paired:
        return None
    ends, test = paired.get("end_distance_mm"), paired.get("test")
    too_few = f"fewer than {paired['pairs_needed']} pairs: no test"
    text = Markup("%s, the %s given to both: %s and %s successes%s.") % (
        strong("Field against ray casting"), counted(paired["common_starts"], "start", "starts"), *map(whole, paired["successes"]),
        f" ({too_few})" if paired["mcnemar_p"] is None else f" (McNemar {p_text(paired['mcnemar_p'])})")
    if ends:
        over = ends["over_cases"]
        text += f" Where both succeeded their end poses lie {three(over['mean'])} mm apart (mean over the target and over "
        text += counted(over["cases"], "patient", "patients")
        if over["low"] is not None:
            text += f"; 95 % over patients {three(over['low'])} to {three(over['high'])} mm by bootstrap"
        if over["student_low"] is not None:
            text += f", {three(over['student_low'])} to {three(over['student_high'])} mm by Student's"
        text += f"; 95th percentile of starts {three(ends['pairs']['p95'])}, largest {three(ends['pairs']['max'])} mm)."
        if ends["is_equivalent"] is None:
            text += Markup(" %s: that needs %s patients.") % (strong("Nothing is claimed about equivalence"), whole(ends["cases_needed"]))
        else:
            margin = three(ends["margin_mm"])
            text += (f" Over patients the two are equivalent within {margin} mm, and succeed alike: " if ends["is_equivalent"] else
                     f" Equivalence within {margin} mm is not shown over patients: ") + f"one-sided Student's test {p_text(ends['p'])}."
    differs = f" Over these starts the error differs by {three(paired['mean_difference_mm'])} mm on average"
    if test:
        text += (f"{differs} (90 % interval "
                 f"{three(test['low_90_mm'])} to {three(test['high_90_mm'])} mm; paired t-test {p_text(test['t_test_p'])}, Wilcoxon's "
                 f"signed-rank test {p_text(test['signed_rank_p'])}). These tests take starts for independent, which those of one patient "
                 "are not, and errors in opposite directions cancel in them: they show no equivalence.")
    elif paired["pairs"]:
        text += f"{differs}; {too_few}."
    return Text(text)


def case_table(renderers):
    rows = [[entry["case"], method_name(renderer["renderer"]), whole(entry["starts"]), rate(entry), capture(entry["capture_range"]),
             entry["error"], three(entry["error_of_successes_mm"]["mean"]), depth_text(entry["depth_of_all_mm"]),
             three(entry["gold_uncertainty_mm"]), milliseconds(entry["seconds"]["median"]), three(entry["evaluations"]["median"])]
            for renderer in renderers for entry in renderer["cases"]]
    return Table(["Case", "Method", "#Starts", "#Success (95 % interval)", "#Capture range", "by", "#Mean error of successes (mm)",
                  "#Depth off: median, 95th percentile (mm)", "#Gold standard by itself (mm)", "#Median ms", "#Median evaluations"], rows,
                 "Per case: a patient, or one of a patient's poses (the paper's Table II)")


def gold_table(cases):
    rows = []
    for case in cases:
        gold = case["gold"]
        own = gold.get("uncertainty") or {}
        rows.append([case["case"], "fiducials" if gold["source"] == "fiducials" else "the study's stated pose",
                     len(gold.get("residuals_mm", [])), three(gold.get("fre_mm")), three(max(gold.get("ray_gaps_mm") or [None], key=as_number)),
                     three(gold.get("leave_one_out_rms_mm")), f"{three(own.get('mean_tre_mm'))}, {three(own.get('p95_tre_mm'))}",
                     three(gold.get("stated_to_fiducials_mm")), whole(case["draws"]), whole(case["inadmissible_draws"]),
                     whole(case["draws_beyond_last_interval"])])
    return Table(["Case", "Gold pose from", "#Fiducials", "#FRE (mm)", "#Largest ray gap (mm)", "#Leave-one-out (mm)",
                  "#Own TRE: mean, 95th percentile (mm)", "#Stated pose to fiducials (mm)", "#Draws", "#of these outside the fields' range",
                  "#beyond the last interval"], rows, "Gold standard and starts")


def reason_table(renderers):
    rows = [[reason, method_name(renderer["renderer"]), whole(count)] for renderer in renderers
            for reason, count in sorted(renderer["failures_by_reason"].items())]
    return Table(["Reason", "Method", "#Failures"], rows, "Why registrations failed") if rows else None


def section(run, title):
    summary, renderers = run.summary, run.summary["renderers"]
    alone = "only_start" in summary
    limit = three(summary["success_tre_mm"])
    blocks = [Text("One start of another run, repeated alone." if alone else "Starts are poses about the gold pose at stated initial target "
                   "registration errors (TRE), the same for every method.")]
    problems = [*summary["row_problems"], *summary["warnings"]]
    if problems:
        blocks += [Text("What to mind:"), Items(problems)]
    drawn = [run_figure(run, "success-rate", "Success rate per interval of initial error", Markup(
        "<b>Success against initial error</b> (the paper's Fig. 16). Dots: share of starts that end below %s mm %s; bars: 95 %% Wilson "
        "intervals; dashed: 95 %%.") % (limit, run.error)),
        run_figure(run, "tre-scatter", "Initial against final error", Markup(
            "<b>Where registrations started and ended</b>, one mark each; of very many only a part, as the title says.")),
        run_figure(run, "tre-histogram", "Histogram of the error after registration", Markup(
            "<b>Error after registration</b> (the paper's Fig. 15); the last bar holds ends beyond 100 mm and those without a pose."))]
    if "confidence" in figures_of(run):
        drawn.append(run_figure(run, "confidence", "Stated confidence against the error", Markup(
            "<b>Verdict and confidence against the error.</b> Right ends belong to the lower right; crosses are ends that the verdict calls "
            "not found.")))
    blocks += [Figures(drawn), success_table(summary), capture_table(renderers), error_table(renderers), threshold_table(renderers)]
    if run.has_one_view:
        blocks.append(Text(Markup("%s A single view hardly shows the depth along its rays, so a TRE says little; the reprojection distance "
                                  "(mRPD) measures what the view can show.") % strong("One view.")))
    blocks += [verdict_table(renderers), confidence_table(renderers), other_errors_table(renderers), *over_patients(renderers),
               paired_text(summary["field_against_raycast"]), case_table(renderers), gold_table(summary["cases"]), heading("Failures"),
               reason_table(renderers), *failures(run), *pictures(run)]
    return Section(run.anchor, title, [block for block in blocks if block])


def comparison(runs):
    """The first methods of several runs in one figure, if they divide initial TRE alike."""
    groups = [(run.name, run.summary["renderers"][0]["intervals"]) for run in runs]
    if len(runs) < 2 or any([entry["high_mm"] for entry in group] != [entry["high_mm"] for entry in groups[0][1]] for _, group in groups):
        return None
    which = f"the first {MOST_CURVES} runs" if len(groups) > MOST_CURVES else "each run"
    error = " or ".join(sorted({run.error for run in runs[:MOST_CURVES]}))
    return Figure(svg_of(success_rates(groups[:MOST_CURVES], error)[0]), "image/svg+xml", "Success rate of every run per interval of initial error",
                  Markup("<b>Success against initial error</b>, the first method of %s; bars: 95 %% Wilson intervals.") % which)
