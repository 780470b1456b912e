#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whether verdicts and predicted errors are true. Compares them with the truth for the registrations of population
studies (jobs/population.sh), counted by X-ray pair (a case of one variant, with its views and preset). Prints the
verdicts of right and of wrong ends, with moved bones apart from rigid patients, and how often the predicted TRE holds.
Needs nothing but Python."""
import argparse
import math
import pathlib
import statistics
import sys

from uncertainty import cells_of, finished_tables, number_of, refuse, succeeded

COLUMNS = ["case", "tre_mm", "mrpd_mm", "verdict", "predicted_tre_95_mm"]


class End:
    """The facts about one registration that are needed here."""

    def __init__(self, views, cells):
        self.verdict = cells["verdict"]
        self.tre_mm = number_of(cells, "tre_mm")
        self.is_right = succeeded(cells, views)
        self.bound_mm = number_of(cells, "predicted_tre_95_mm")


def pairs_of(path, views):
    """The ends of every case of a table of registrations."""
    pairs = {}
    for cells in cells_of(path, COLUMNS):
        pairs.setdefault(cells["case"], []).append(End(views, cells))
    return list(pairs.values())


def conditions_of(folders):
    """The X-ray pairs of every condition (VARIANT-VIEWS-PRESET) of all folders."""
    found = {}
    for folder in folders:
        names = sorted({run.name for kind in ("runs", "slurm") for run in folder.glob(f"{kind}/*-[12]-*")})
        if not names:
            refuse(folder, "holds no registrations of jobs/population.sh")
        for name in names:
            views = int(name.split("-")[1])
            for path in finished_tables(folder, name):
                found.setdefault(name, []).extend(pairs_of(path, views))
    return found


def wilson(count, total):
    """The 95 % interval of a share (Wilson 1927), in percent."""
    z = 1.959964
    center = (count + z * z / 2) / (total + z * z)
    half = z / (total + z * z) * math.sqrt(count * (total - count) / total + z * z / 4)
    return f"{100 * max(0.0, center - half):.0f} to {100 * min(1.0, center + half):.0f}"


def share_text(count, total):
    return f"{count} of {total}: {100 * count / total:.1f} % ({wilson(count, total)})" if total else "none"


def verdict_line(name, pairs):
    ends = [end for pair in pairs for end in pair]
    right = [end for end in ends if end.is_right]
    wrong = [end for end in ends if not end.is_right]

    def count(chosen, verdict):
        return sum(end.verdict == verdict for end in chosen)

    pairs_found = sum(any(end.verdict == "found" for end in pair) for pair in pairs)
    pairs_wrong = sum(any(end.verdict == "found" and not end.is_right for end in pair) for pair in pairs)
    cells = [name, len(pairs), len(ends), share_text(count(right, "found"), len(right)), count(right, "doubtful"),
             count(right, "not found"), count(wrong, "found"), count(wrong, "doubtful"), count(wrong, "not found"),
             pairs_found, pairs_wrong]
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


def bound_line(name, pairs):
    """A line over pairs. A pair counts by the median of its right ends with a bound, as most of them lie together."""
    known = []
    for pair in pairs:
        ends = [end for end in pair if end.is_right and not math.isnan(end.bound_mm)]
        if ends:
            known.append((statistics.median(e.tre_mm for e in ends), statistics.median(e.bound_mm for e in ends)))
    if not known:
        return f"| {name} | 0 | | | | |"
    tre = statistics.median(error for error, _ in known)
    bound = statistics.median(limit for _, limit in known)
    holds = sum(error <= limit for error, limit in known)
    ratio = statistics.median(limit / error for error, limit in known)
    return f"| {name} | {len(known)} | {share_text(holds, len(known))} | {tre:.3f} | {bound:.3f} | {ratio:.1f} |"


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, epilog="Exit codes: 0 done, 2 wrong options, 4 registrations that are missing or damaged.")
    parser.add_argument("population", nargs="+", type=pathlib.Path, help="output folders of jobs/population.sh")
    conditions = conditions_of(parser.parse_args().population)
    rigid = {name: pairs for name, pairs in conditions.items() if not name.startswith("moved")}
    print("| Verdicts | X-ray pairs | Registrations | Right ends found | ... doubtful | ... not found | Wrong ends found "
          "| ... doubtful | ... not found | Pairs with an end found | ... wrong |")
    print("|" + "---|" * 11)
    for name, pairs in conditions.items():
        print(verdict_line(name, pairs))
    print("\n| Predicted TRE, 95 % | X-ray pairs | Holds | Median TRE, mm | Median bound, mm | Median ratio |")
    print("|" + "---|" * 6)
    for name, pairs in rigid.items():
        print(bound_line(name, pairs))
    if len(rigid) > 1:
        print(bound_line("all", [pair for pairs in rigid.values() for pair in pairs]))


if __name__ == "__main__":
    sys.exit(main())
