# SPDX-License-Identifier: Apache-2.0
"""Figures and pictures of runs, as parts of the page."""
from markupsafe import Markup

from .blocks import Figure, Figures, Items, Text, heading
from .figures import figures_of, svg_of
from .numbers import three, whole
from .runs import method_name

PICTURE_CAPTION = Markup("<b>Case %s, the %s result, view %s%s.</b> By %s, start %s, from %s mm TRE to %s mm %s.")


def run_figure(run, name, alternative, caption, is_wide=False):
    """The figure beside the run's numbers if it shows these numbers. Otherwise it is drawn anew."""
    svg, summary = run.folder / f"{name}.svg", run.folder / "summary.json"
    is_there = svg.is_file() and svg.stat().st_mtime >= summary.stat().st_mtime
    content = run.picture(f"{name}.svg") if is_there else svg_of(figures_of(run)[name]()[0])
    links = [(kind.upper(), run.link(f"{name}.{kind}")) for kind in ("png", "csv") if (run.folder / f"{name}.{kind}").is_file()]
    return Figure(content, "image/svg+xml", alternative, caption, links, is_wide)


def picture(run, name, alternative, caption, links=(), is_wide=False):
    return Figure(run.picture(name), "image/png", alternative, caption, list(links), is_wide)


def pictures(run):
    """X-rays and regions, the best, median and worst end of each case before and after, and whether a study fits together."""
    shown, setting, facts = [], [], {}
    for entry in run.summary["pictures"]:
        which, case = entry["which"], entry["case"]
        if which == "setting":
            facts[case] = [("Look: ", text) for text in entry.get("telltales", [])] + [("", text) for text in entry.get("facts", [])]
            setting.append(picture(run, entry["file"], "X-ray and DRRs before the registration, or the room", f"Case {case}, {entry.get('shows', '')}",
                                   is_wide=True))
        elif which == "xrays":
            caption = Markup("<b>Case %s.</b> The X-rays and, framed, the regions that are compared.") % case
            shown.append((case, "", False, picture(run, entry["file"], "X-rays of the case", caption, is_wide=True)))
        else:
            has_outlines = entry.get("shows") == "outlines"
            links = [("for Slicer", run.link(entry["slicer"]))] if entry.get("slicer") else []
            caption = PICTURE_CAPTION % (case, which, entry["camera"], ", before and after" if has_outlines else "",
                                         method_name(entry["renderer"]), whole(entry["start_index"]), three(entry["initial_tre_mm"]),
                                         three(entry["error_mm"]), entry["error"])
            shown.append((case, which, not has_outlines, picture(run, entry["file"], f"{which} registration", caption, links)))
    blocks = []
    if shown:
        note = " Small bright bars are the steel fiducials, which the CT lacks." if run.summary.get("simulation") else ""
        # The X-rays come first in each case, and the outlines first for each end.
        order = list(dict.fromkeys(case for case, *_ in shown)), ["", "best", "median", "worst"]
        shown.sort(key=lambda entry: (order[0].index(entry[0]), order[1].index(entry[1]), entry[2]))
        blocks += [heading("What it looks like"), Text(
            "Before and after: the outlines of the DRR at the start and at the found pose, over the X-ray. Then the X-ray, the DRR at the "
            "found pose, both as a checkerboard, and their difference; what attenuates more is brighter." + note),
            Figures([figure for *_, figure in shown])]
    if setting:
        blocks += [heading("Whether the study fits together"), Text(
            "X-rays as they are, DRRs at the nominal pose and, where there are landmarks, at theirs, with the patient's directions at "
            "the edges; the room with sources, detectors and the CT's box. Nothing is flipped or scaled.")]
        for case, texts in facts.items():
            blocks.append(Items([Markup("Case %s: <b>%s</b>%s") % (case, before, text) for before, text in texts]))
        blocks.append(Figures(setting))
    return blocks
