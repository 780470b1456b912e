# SPDX-License-Identifier: Apache-2.0
"""The table of jobs/peers.sh, from the runs in its folder:

    python3 evaluate/peers/peer_table.py FOLDER KIND OUT.csv
"""
import csv
import math
import pathlib
import statistics
import sys

SUCCESS_TRE_MM = 2.5
METHODS = ("robust", "fast", "paper", "autodiff", "plastimatch-nelder-mead")


def numbers(rows, column):
    return [float(row[column]) for row in rows if row[column] not in ("", "nan", "inf")]


def field_seconds(folder, case):
    """Of both fields; NaN when they were made by another run."""
    files = list((folder / "fields").glob(f"{case}-*.af.h5.seconds"))
    return sum(float(file.read_text()) for file in files) if len(files) == 2 else math.nan


def given_starts(folder, case, method):
    """Indices of the starts that a peer was given; none says: all, as our own methods are."""
    poses = folder / "poses" / f"{case}-{method}.csv"
    if not poses.exists():
        return None
    with open(poses, newline="", encoding="utf-8") as file:
        return {int(row["start_index"]) for row in csv.DictReader(file)}


def entries_of(folder, case, method):
    path = folder / "runs" / f"{case}-{method}" / "registrations.csv"
    if not path.exists():
        return []
    with open(path, newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    given = given_starts(folder, case, method)
    entries = []
    for renderer in dict.fromkeys(row["renderer"] for row in rows):
        # A start without a pose stays in the denominator, unless the peer was not given it.
        mine = [row for row in rows if row["renderer"] == renderer and (given is None or int(row["start_index"]) in given)]
        tres = [tre for tre in numbers(mine, "tre_mm") if tre < SUCCESS_TRE_MM]
        seconds = numbers(mine, "seconds")
        entries.append(
            {
                "case": case,
                "method": method,
                "drrs": {"field": "field", "raycast": "ray casting"}.get(renderer, renderer),
                "starts": len(mine),
                "successes": len(tres),
                "median_tre_mm": statistics.median(tres) if tres else math.nan,
                "median_seconds": statistics.median(seconds) if seconds else math.nan,
                "precompute_seconds": field_seconds(folder, case) if renderer == "field" else 0.0,
            }
        )
    return entries


def main():
    folder, kind, out = pathlib.Path(sys.argv[1]), sys.argv[2], sys.argv[3]
    table = []
    for variant in ("clean", "stressed"):
        case = f"{kind}-{variant}"
        mine = [entry for method in METHODS for entry in entries_of(folder, case, method)]
        fields = next((e for e in mine if e["method"] == "robust" and e["drrs"] == "field"), None)
        for entry in mine:
            # After so many registrations the fields, and robust's registrations by them, have taken less time.
            gain = entry["median_seconds"] - fields["median_seconds"] if fields else math.nan
            entry["pays_after"] = (
                math.ceil(fields["precompute_seconds"] / gain)
                if entry["drrs"] != "field" and gain > 0 and not math.isnan(fields["precompute_seconds"])
                else ""
            )
        table += mine
    if not table:
        sys.exit(f"{folder}: no runs")
    with open(out, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(table[0]), lineterminator="\n")
        writer.writeheader()
        for entry in table:
            writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in entry.items()})
            print("  ".join(f"{v:.3g}" if isinstance(v, float) else str(v) for v in entry.values()))


if __name__ == "__main__":
    main()
