# SPDX-License-Identifier: Apache-2.0
"""The page's sections on fields, similarity curves and error budgets."""
import math

from markupsafe import Markup

from .blocks import Figure, Figures, Section, Table, Text, heading
from .figures import psnr_boxes, psnr_of_rows, svg_of
from .numbers import as_number, percent, three, time, whole
from .pictures import picture, run_figure
from .runs import field_name, is_papers_setting, method_name

MEGABYTE = 1e6


def error_budget(runs):
    blocks = []
    for run in runs:
        steps, gold = run.summary["steps"], run.summary.get("gold")
        rows = [[step["label"], f"{whole(step['successes'])} of {whole(step['starts'])}", three(step["shift_mm"]),
                 *(three(step[key]) for key in ("shift_standard_error_mm", "bias_mm", "scatter_mm", "tre_mm"))] for step in steps]
        blocks += [heading(f"Case {run.summary['case']}"), Text(
            "A chain of runs from the same starts, each different from the one before in one thing, over the "
            f"{whole(run.summary['common_starts'])} starts from which every run succeeded."),
            Table(["Run: what is different from the one before", "#Succeeded", "#Moves the mean end by (mm)", "#± standard error", "#Bias (mm)",
                   "#Scatter (mm)", "#TRE (mm)"], rows,
                  "Mean TREs between poses. Bias: of the mean end from the gold pose; scatter: of an end from the mean end")]
        if gold:
            own = gold["uncertainty"]
            blocks.append(Text(f"A gold pose by fiducials would itself lie {three(own['mean_tre_mm'])} mm off on average (95th percentile "
                               f"{three(own['p95_tre_mm'])} mm), by Monte Carlo on the fiducials' residuals; this one lies "
                               f"{three(gold.get('stated_to_fiducials_mm'))} mm from the stated pose."))
    return Section("error-budget", "Error budget", blocks)


def similarity(runs):
    blocks = []
    for run in runs:
        rows = []
        for renderer in run.summary["renderers"]:
            for peak in renderer["maxima"]:
                width = f"{three(peak['width'])} {peak['unit']}" if peak["width"] is not None else "wider than shown"
                rows.append([peak["parameter"], method_name(renderer["renderer"]),
                             f"{'beyond ' if peak['is_at_edge'] else ''}{three(peak['offset'])} {peak['unit']}", width,
                             three(peak["width_mm_at_target"])])
        broadest = " ".join(f"With {method_name(renderer['renderer'])} " + (f"the broadest rotation is {renderer['broadest_rotation']}."
                            if renderer["broadest_rotation"] else "no rotation stands out as broadest.") for renderer in run.summary["renderers"])
        blocks += [heading(f"Case {run.summary['case']}"), Figures([run_figure(
            run, "similarity-curves", "Similarity along each pose parameter", Markup(
                "<b>Similarity about the gold pose</b> (the paper's Fig. 14): one parameter at a time; the marks are the maxima."), True)]),
            Table(["Parameter", "Method", "#Maximum at", "#Width", "#Width at the target (mm)"], rows,
                  "Where the similarity is highest, relative to the gold pose, and how broad it is at half height above the lowest value of "
                  "all six curves"),
            Text(broadest + " The paper finds the rotation about the patient's cranial-caudal axis, rz in this project's room frame, "
                 "typically the broadest.")]
    return Section("similarity", "Shape of the similarity", blocks)


def nodes_text(field):
    slabs = "" if field["slabs"] == 1 else f" × {whole(field['slabs'])} slabs"
    return ", ".join("×".join(map(whole, field[key])) for key in ("uv_nodes", "st_nodes")) + slabs


def range_text(field):
    """Two numbers, or the bounds of a box that two numbers cannot state."""
    if str(field.get("range", "+-")).startswith("+-"):
        return f"±{three(field['max_rotation_deg'])}°, ±{three(field['max_translation_mm'])} mm"
    return field["range"]


def quality_table(runs):
    rows = []
    for run in runs:
        summary, field, psnr = run.summary, run.summary["field"], run.summary["psnr_db"]
        rows.append([field_name(run), nodes_text(field), whole(field["codewords"]), three(field["file_bytes"] / MEGABYTE), range_text(field),
                     whole(summary["compared"]), three(psnr["median"]), three(psnr["p5"]), three(psnr["min"]),
                     percent(summary["share_above_40_db"]), percent(summary["share_below_36_db"]),
                     time(summary["seconds_per_drr_field"]["median"]), time(summary["seconds_per_drr_raycast"]["median"])])
    # The paper's numbers would mislead beside fields of another range or camera.
    if all(map(is_papers_setting, runs)):
        rows.append(["Paper, 2005", "64×64, 256×256", "16384", "32", "±10°, ±100 mm", "100", "> 43", "", "", "almost all", "very few", "50 ms",
                     "1.5 s"])
    return Table(["Field", "Nodes (u,v), (s,t)", "#Codewords", "#File (MB)", "#Range", "#Poses", "#Median", "#5th percentile", "#Minimum",
                  "#Above 40 dB", "#Below 36 dB", "#Field, per DRR", "#Ray cast, per DRR"], rows,
                 "PSNR in dB against ray casting; times are medians of whole-detector DRRs on one core of this computer")


def image_quality(runs):
    caption = Markup("<b>PSNR at random poses</b> (the paper's Fig. 8). Box: quartiles and median; whiskers: 5th and 95th percentile; dots: "
                     "every pose.")
    if len(runs) == 1:
        box = run_figure(runs[0], "psnr", "Box plots of PSNR", caption)
    else:
        groups = [group for run in runs for group in psnr_of_rows(run.rows("image-quality.csv"), field_name(run))]
        box = Figure(svg_of(psnr_boxes(groups, all(map(is_papers_setting, runs)))[0]), "image/svg+xml", "Box plots of PSNR", caption,
                     is_wide=len(runs) > 3)
    pairs, losses = [], []
    for run in runs:
        for entry in run.summary["pictures"]:
            pairs.append(picture(run, entry["file"], "field and ray cast side by side", Markup("<b>%s, the %s pair.</b> PSNR %s dB.") % (
                field_name(run), entry["which"], three(entry["psnr_db"])), is_wide=True))
        split = run.summary.get("loss_split")
        if split:
            rows = [[part["label"], three(part["psnr_db"]["median"]), percent(part["share_of_total"])] for part in split["parts"]]
            losses += [Figures([run_figure(run, "loss-split", "Box plots of PSNR by lossy step", Markup(
                "<b>Where quality is lost, %s</b>, over %s poses.") % (field_name(run), whole(split["poses"])))]),
                Table(["Lossy step", "#Median PSNR (dB)", "#Share of the error"], rows,
                      "Interpolation in one plane alone, in both, quantisation alone, and all of it; shares are of the field's mean square "
                      "error and need not add up to 100 %, since errors of steps add or cancel")]
    if losses:
        losses.insert(0, heading("Loss by interpolation and by quantisation"))
    return Section("image-quality", "Image quality of the fields", [
        Text("Images looked up in the compressed fields, compared with ray casting through the CT at random poses of the fields' whole "
             "motion range."), Figures([box]), quality_table(runs), Figures(pairs), *losses])


def field_parameters(runs):
    blocks = []
    for run in runs:
        rows = []
        for setting in run.summary["settings"]:
            psnr, uncompressed, payload = setting["psnr_db"], setting["uncompressed_bytes"], setting["payload_bytes"]
            rows.append([whole(setting["uv_nodes"]), whole(setting["st_nodes"]), whole(setting["codewords"]), whole(setting["training_fraction"]),
                         three(psnr["median"]), f"{three(psnr['q1'])}–{three(psnr['q3'])}", three(psnr["min"]), three(uncompressed / MEGABYTE),
                         three(payload / MEGABYTE), three(uncompressed / payload), three(setting["creation_seconds"]),
                         whole(setting["creation_ranks"])])
        blocks += [heading(f"Camera {run.summary['camera']}"), Figures([run_figure(
            run, "field-parameters", "PSNR against each field parameter", Markup(
                "<b>Image quality against the field's parameters</b> (the paper's Fig. 10): medians and quartiles over %s random poses; the "
                "setting that all panels share is set off.") % whole(run.summary["poses"]), True)])]
        images = run.summary.get("difference_images")
        if images:
            levels = ", ".join(three(image["psnr_db"]) for image in images["images"])
            blocks.append(Figures([picture(run, images["file"], "a field DRR and difference images", Markup(
                "<b>What a PSNR looks like</b> (the paper's Fig. 9): field less ray cast at %s dB, %s, all at one pose and in one window.") % (
                    levels, images["target"]), is_wide=True)]))
        blocks.append(Table(["#(u,v) nodes", "#(s,t) nodes", "#Codewords", "#Training share", "#PSNR median (dB)", "#Quartiles", "#Lowest",
                             "#Uncompressed (MB)", "#Payload (MB)", "#Compression", "#Creation (s)", "#Ranks"], rows,
                            "Every setting (the paper's Table I): the first is the one that all sweeps share; compression is that of the payload"))
    return Section("field-parameters", "What a field costs and gives", blocks)


def quality_sentence(runs):
    medians = [as_number(run.summary["psnr_db"]["median"]) for run in runs]
    if len(runs) > 4:
        known = [value for value in medians if math.isfinite(value)]
        found = f"{three(min(known, default=None))} to {three(max(known, default=None))} dB over {len(runs)} fields"
    else:
        found = ", ".join(f"{three(value)} dB ({field_name(run)})" for run, value in zip(runs, medians))
    return f"The fields' images agree with ray casting to a median PSNR of {found}."
