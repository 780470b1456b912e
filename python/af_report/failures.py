# SPDX-License-Identifier: Apache-2.0
"""Failed starts: the course of each search, and the command that repeats it alone."""
import math
import shlex

from markupsafe import Markup

from .blocks import Table, Text
from .files import rows_of
from .numbers import counted, three, whole
from .runs import file_name_part, method_name

MOST_FAILURES = 60


def spark(points, success_mm):
    """TRE along a search as a small line. A dashed line shows the limit of success, unless one view hides it."""
    width, height = 150, 40
    top, poses = max([2 * (success_mm or 0), *(tre for _, tre in points)]), max(1, points[-1][0])
    y = lambda tre: f"{height - 2 - (height - 4) * tre / top:.1f}"  # noqa: E731
    line = " ".join(f"{width * tried / poses:.1f},{y(tre)}" for tried, tre in points)
    text = f"TRE from {three(points[0][1])} to {three(points[-1][1])} mm over {whole(poses)} poses"
    limit = Markup('<line x1="0" x2="%d" y1="%s" y2="%s"/>') % (width, y(success_mm), y(success_mm)) if success_mm else ""
    return Markup('<svg class="spark" viewBox="0 0 %d %d" role="img" aria-label="%s"><title>%s</title>%s<polyline points="%s"/></svg>') % (
        width, height, text, text, limit, line)


def start_name(start):
    return f"{file_name_part(start['case'])}-{file_name_part(start['renderer'])}-{start['start_index']}"


def trace_cell(run, start, success_mm):
    name = f"traces/{start_name(start)}.csv"
    path = run.path(name)
    if not path.is_file():
        return "–"
    steps = [(row.number("poses_tried"), row.number("tre_mm")) for row in rows_of(path)]
    points = [(0, start["initial_tre_mm"]), *(step for step in steps if math.isfinite(sum(step)))]
    return Markup('%s <a href="%s">trace</a>') % (spark(points, success_mm), run.link(name))


def repeat_command(summary, start):
    """The command that registers one start alone. Empty for another program's poses."""
    repeat = summary.get("repeat")
    if not repeat:
        return ""
    # Ray casting beside fields is blurred like their levels, so it is repeated beside them.
    renderer = "both" if start["renderer"] == "raycast" and repeat["renderer"] == "both" else start["renderer"]
    return (f"{repeat['command']} --case {shlex.quote(start['case'])} --renderer {shlex.quote(renderer)} --only-start {start['start_index']} "
            f"--output {shlex.quote(repeat['output'] + '/' + start_name(start))}")


def failures(run):
    # With one view the TREs of searches do not measure success.
    success_mm, rows, count = None if run.has_one_view else float(run.summary["success_tre_mm"]), [], 0
    for start in run.starts:
        if start["success"] == "1":
            continue
        count += 1
        if count > MOST_FAILURES:
            continue
        command = repeat_command(run.summary, start)
        again = Markup('<details><summary>command</summary><pre class="command">%s</pre></details>') % command if command else "–"
        rows.append([start["case"], method_name(start["renderer"]), start["start_index"], three(start["initial_tre_mm"]),
                     three(start["error_mm"]), start["error"] or start["stop_reason"], trace_cell(run, start, success_mm), again])
    if not count:
        return [Text("No registration failed.")]
    text = Markup("All %s in every rate above.") % counted(count, "failure counts", "failures count")
    if count > MOST_FAILURES:
        text += Markup(' The first %s are listed; <a href="%s">registrations.csv</a> has all.') % (MOST_FAILURES, run.link("registrations.csv"))
    return [Text(text), Table(["Case", "Method", "#Start", "#Initial TRE (mm)", f"#Final {run.error} (mm)", "Stopped because",
                               "TRE along the search", "Repeat it alone"], rows,
                              "Failed starts: TRE against the poses tried" + (f", the dashed line at {three(success_mm)} mm" if success_mm else ""))]
