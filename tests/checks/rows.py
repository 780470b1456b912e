#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks tables whose rows come from a CSV of docs/data. Every row must equal, cell by cell, a row of a CSV to which
its section links, and be of the condition that its first cell names. Headers tell which tables are of this kind. A kind
that no page has is an error.

Usage: rows.py ROOT               names rows that no linked CSV has
       rows.py --print KIND CSV   the rows of a CSV as a page has them: KIND is one of population, uncertainty, peers
       rows.py --self-test
"""
import csv
import math
import re
import sys
import tempfile
from pathlib import Path

from links import outside_fences

LINK = re.compile(r"\]\(([\w./-]*data/[\w-]+\.csv)\)")


def plain(cell):
    """A cell's text without links and emphasis."""
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", cell).replace("**", "").strip()


def cells_of(line):
    return [plain(cell) for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))]


def pages_of(root):
    """Pages that publish measurements, by their paths below the root."""
    patterns = ("*.md", "docs/*.md", "docs/howto/*.md", "*/README.md", "common/*/README.md")
    return {page.relative_to(root).as_posix(): page for page in sorted({p for g in patterns for p in root.glob(g)})}


def number(row, column):
    return float(row[column]) if row[column] not in ("", "-") else math.nan


def fixed(value, digits, scale=1.0, unit=""):
    return "-" if math.isnan(value) else f"{scale * value:.{digits}f}{unit}"


def views_words(views):
    return "two views" if int(views) == 2 else "one view"


def population_words(row):
    """What the first cell of a row says."""
    xrays, views, preset = row["condition"].split("-")[:3]
    return [{"clean": "clean", "all": "all stresses"}[xrays], views_words(views), preset]


def population_cells(row):
    """A row of af-evaluate population: by TRE, or with one view by mRPD. Tables with both have prefixes."""
    error = "" if "error" in row else "mrpd_" if re.search(r"-1-", row["condition"]) else "tre_"

    def value(column):
        return number(row, error + column)

    starts = int(row["starts"])
    ends_whole = "" if row[f"{error}capture_ended_by"] == "failures" else ">= "
    mean_whole = ">= " if value("patients_capture_lower_bounds") > 0 else ""
    low, high = value("share_with_failures_low"), value("share_with_failures_high")
    return [
        row["patients"],
        f"{row[f'{error}successes']} of {starts}",
        f"{100 * value('rate'):.1f} ({100 * value('bootstrap_low'):.1f} to {100 * value('bootstrap_high'):.1f})",
        f"{row[f'{error}patients_with_failures']}: {100 * low:.1f} to {100 * high:.1f}",
        f"{100 * value('worst_patient_rate'):.1f}",
        f"{100 * value('below_1_mm') / starts:.1f} / {100 * value('below_5_mm') / starts:.1f}",
        f"{ends_whole}{value('capture_mm'):.0f} ({value('capture_bootstrap_low_mm'):.0f} to {value('capture_bootstrap_high_mm'):.0f})",
        f"{mean_whole}{value('patients_capture_mean_mm'):.1f}",
        fixed(number(row, "median_error_mm" if "error" in row else "median_tre_mm"), 2),
    ]


def with_interval(row, column, digits, scale=1.0, unit=""):
    low, high = number(row, f"{column}_low"), number(row, f"{column}_high")
    text = fixed(number(row, column), digits, scale, unit)
    if text == "-" or math.isnan(low) or low == high:
        return text
    return f"{text} ({scale * low:.{digits}f} to {scale * high:.{digits}f})"


def uncertainty_words(row):
    """What the first cell says. When it begins with '...', a row above names the views."""
    measure, _, group = row["measure"].partition(", ")
    presets = row["presets"].split(",")
    every = "all three" if len(presets) == 3 else "both" if len(presets) == 2 else presets[0]
    words = [{"rg": "robust", "gc": "fast", "mi": "paper", "all": every}[measure], f"|{views_words(row['views'])}"]
    groups = {"clean": "clean", "all": "all stresses", "head": "heads", "pelvis": "pelves", "spine": "spines"}
    return words + [groups[group]] if group in groups else words


def uncertainty_cells(row):
    """The cells of a row of jobs/uncertainty.py --csv."""
    return [
        row["cases"],
        with_interval(row, "pose_region", 1, 100.0, " %"),
        fixed(number(row, "sandwich_alone"), 1, 100.0, " %"),
        with_interval(row, "tre_region", 1, 100.0, " %"),
        f"{row['failures']} / {row['successes']}",
        with_interval(row, "roc_area", 3),
        fixed(number(row, "sure_failures"), 1, 100.0, " %"),
    ]


def peers_words(row):
    return []  # the cells themselves name method and DRRs


def peers_cells(row):
    """The cells of a row of jobs/peers.sh. Only the first row of a table gives the unit of 'pays after'."""
    return [
        row["method"].removesuffix("-nelder-mead"),
        {"autodiff": "PyTorch"}.get(row["drrs"], row["drrs"].removesuffix("-nelder-mead")),
        f"{row['successes']} of {row['starts']}",
        fixed(number(row, "median_tre_mm"), 2, unit=" mm"),
        f"{number(row, 'median_seconds'):.2g} s",
        row["pays_after"],
    ]


# For each kind: header cells that no other table has, what the first cell says of a CSV's row, and the cells after it.
KINDS = {
    "population": (("Patients' own, mean, mm", "CTs' own, mean, mm"), population_words, population_cells),
    "uncertainty": (("Failures with 0.9 or more",), uncertainty_words, uncertainty_cells),
    "peers": (("A field pays for itself after",), peers_words, peers_cells),
}


def bare(cells):
    return [cell.replace("`", "").removesuffix(" registrations") for cell in cells]


def sections_of(text):
    """(heading, its lines with their numbers) of a page."""
    heading, lines = "", []
    for line_number, line in enumerate(outside_fences(text), 1):
        title = re.match(r"#{1,6}\s+(.*)", line)
        if title:
            yield heading, lines
            heading, lines = title.group(1), []
        lines.append((line_number, line))
    yield heading, lines


def says(label, words):
    """Whether a first cell names a condition. A word after '|' may be missing when the label begins with '...'."""
    return all(word.lstrip("|") in label or (word[0] == "|" and label.startswith("...")) for word in words)


def rows_of_csv(file, kind):
    """(words, cells) of its rows. A CSV of another kind has none."""
    _, words_of, cells_of_row = KINDS[kind]
    with open(file, newline="", encoding="utf-8") as text:
        try:
            return [(words_of(row), bare(cells_of_row(row))) for row in csv.DictReader(text)]
        except KeyError:
            return []


def rows_without_csv(page):
    """(line, row) of every row of a known kind that is no row of a CSV of its section; and how many rows of each kind there
    are."""
    wrong, counts = [], dict.fromkeys(KINDS, 0)
    for _, lines in sections_of(page.read_text(encoding="utf-8")):
        files = [page.parent / link for _, line in lines for link in LINK.findall(line)]
        kind = None
        for line_number, line in lines:
            if not line.startswith("|"):
                kind = None
                continue
            cells = cells_of(line)
            named = [k for k, (headers, _, _) in KINDS.items() if set(headers) & set(cells)]
            if named:
                kind = named[0]
                known = [row for file in files for row in rows_of_csv(file, kind)]
            elif kind and not re.fullmatch(r":?-+:?", cells[0]):
                counts[kind] += 1
                if not any(bare(cells[1:]) == row and says(cells[0], words) for words, row in known):
                    wrong.append((line_number, line))
    return wrong, counts


def check(root):
    found, checked = 0, dict.fromkeys(KINDS, 0)
    for path, page in pages_of(root).items():
        wrong, counts = rows_without_csv(page)
        for kind, count in counts.items():
            checked[kind] += count
        for line_number, line in wrong:
            print(f"{path}:{line_number}: no linked CSV has this row: {line[:150]}")
        found += len(wrong)
    for kind, count in checked.items():
        if count == 0:
            print(f"no page has a table of {kind}: was its header changed?")
            found += 1
    return found


def self_test():
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.md"
        (Path(folder) / "data").mkdir()
        (Path(folder) / "data" / "some.csv").write_text(
            "case,method,drrs,starts,successes,median_tre_mm,median_seconds,pays_after\n"
            "a,robust,ray casting,40,39,0.1166,0.03432,378\n",
            encoding="utf-8",
        )
        table = (
            "## T\n[data](data/some.csv)\n\n| X | Method | DRRs | Right | TRE | Time | A field pays for itself after |\n"
            "|---|---|---|---|---|---|---|\n| a | `robust` | ray casting | {} of 40 | 0.12 mm | 0.034 s | 378 registrations |\n"
        )
        for right, expected in ((39, 0), (38, 1)):
            page.write_text(table.format(right), encoding="utf-8")
            wrong, counts = rows_without_csv(page)
            assert (len(wrong), counts["peers"]) == (expected, 1), right
    robust = {"measure": "rg, all", "presets": "robust,fast", "views": "1"}
    assert says("one view, `robust`, all stresses", uncertainty_words(robust))
    assert says("... `robust`, all stresses", uncertainty_words(robust))
    for label in ("one view, `fast`, all stresses", "two views, `robust`, all stresses", "one view, `robust`, clean"):
        assert not says(label, uncertainty_words(robust)), label
    swapped = population_words({"condition": "all-2-fast"})
    assert says("all stresses, two views, `fast`", swapped) and not says("all stresses, two views, `robust`", swapped)
    print("ok")


def print_rows(kind, path):
    with open(path, newline="", encoding="utf-8") as file:
        for row in csv.DictReader(file):
            _, words_of, cells_of_row = KINDS[kind]
            print("| " + ", ".join(words_of(row)) + " | " + " | ".join(cells_of_row(row)) + " |")


if __name__ == "__main__":
    if sys.argv[1:] == ["--self-test"]:
        self_test()
    elif len(sys.argv) == 4 and sys.argv[1] == "--print" and sys.argv[2] in KINDS:
        print_rows(*sys.argv[2:])
    elif len(sys.argv) == 2 and Path(sys.argv[1]).is_dir():
        sys.exit(1 if check(Path(sys.argv[1])) else 0)
    else:
        sys.exit(__doc__)
