#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Every table of measured numbers on a page has them as CSV: in a file of docs/data that its section, or the page before
its first section, links to, or else cell by cell in docs/data/tables/PAGE.csv, with the commit that published each.

Usage: tables.py ROOT             says which tables have none, or another value
       tables.py ROOT --write     brings docs/data/tables up to date; commits are those of `git blame`
       tables.py --self-test
"""
import csv
import io
import re
import subprocess
import sys
import tempfile
from pathlib import Path

COLUMNS = ["table", "line", "row", "column", "value", "commit"]
# A table with fewer cells that begin with a number is no table of measurements.
FEWEST_NUMBERS = 6
# Numbers that were chosen, not measured: page and heading.
CHOSEN = {
    ("jobs/README.md", "The paper's experiments"),
    ("jobs/README.md", "The quick preset and the paper's"),
    ("jobs/README.md", "When jobs die"),
}


class Table:
    """A table of a page: its section's heading, with a number from the second one on, and its lines."""

    def __init__(self, name, first_line, lines):
        self.name = name
        self.first_line = first_line  # of its rows, from 1
        self.header, self.rows = lines[0], lines[2:]

    def cells(self):
        """(row's number, row, column, value) of every cell that is not empty."""
        columns = self.header[1:]
        for number, row in enumerate(self.rows, 1):
            for column, value in zip(columns, row[1:]):
                if value:
                    yield number, row[0], column, value

    def is_measured(self):
        return sum(bool(re.match(r"[\s<~+-]*\d", value)) for _, _, _, value in self.cells()) >= FEWEST_NUMBERS


def plain(cell):
    """A cell's text without links and emphasis."""
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", cell).replace("**", "").strip()


def cells_of(line):
    return [plain(cell) for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))]


def tables_without_csv(path, page):
    """The measured tables of a page whose section and page's beginning link to no CSV."""
    tables, heading, lines, fence, counts = [], "", [], False, {}
    has_csv = {"": False}
    text = page.read_text(encoding="utf-8").splitlines() + [""]
    for number, line in enumerate(text, 1):
        if re.match(r"\s*(```|~~~)", line):
            fence = not fence
        title = None if fence else re.match(r"#{2,6}\s+(.*)", line)
        if title:
            heading = plain(title.group(1)).replace("`", "")
        has_csv[heading] = has_csv.get(heading, False) or bool(re.search(r"\]\([\w./-]*data/[\w-]+\.csv\)", line))
        if line.startswith("|") and not fence:
            lines.append(cells_of(line))
            continue
        if len(lines) > 2 and re.fullmatch(r":?-+:?", lines[1][0]):
            counts[heading] = counts.get(heading, 0) + 1
            name = heading if counts[heading] == 1 else f"{heading} ({counts[heading]})"
            tables.append((heading, Table(name, number - len(lines) + 2, lines)))
        lines = []
    if has_csv[""]:
        return []
    return [
        table
        for heading, table in tables
        if table.is_measured() and not has_csv[heading] and (path, heading) not in CHOSEN
    ]


def pages_of(root):
    """Pages that publish measurements, by their paths below the root."""
    pages = [*root.glob("*.md"), *root.glob("docs/*.md"), *root.glob("docs/howto/*.md"), *root.glob("*/README.md")]
    return {page.relative_to(root).as_posix(): page for page in sorted({*pages, *root.glob("common/*/README.md")})}


def csv_of(root, path):
    name = path.removesuffix(".md").removesuffix("/README").removeprefix("docs/")
    return root / "docs" / "data" / "tables" / f"{name.replace('/', '-')}.csv"


def published(tables):
    """The rows of a page's CSV, without commits."""
    return [
        [table.name, str(number), row, column, value]
        for table in tables
        for number, row, column, value in table.cells()
    ]


def rows_of(file):
    if not file.exists():
        return []
    return list(csv.reader(io.StringIO(file.read_text(encoding="utf-8"))))[1:]


def commit_of(root, path, line):
    """That which wrote the line, through moves of lines within its commit."""
    command = ["git", "-C", str(root), "blame", "-w", "-C", "-C", "--abbrev=11", "-s", "-L", f"{line},{line}", "--", path]
    words = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()
    return words[0].lstrip("^")[:12]


def write(root):
    for path, page in pages_of(root).items():
        tables, file = tables_without_csv(path, page), csv_of(root, path)
        if not tables:
            file.unlink(missing_ok=True)
            continue
        known = {tuple(row[:-1]): row[-1] for row in rows_of(file)}
        lines = []
        for table in tables:
            commits = {}
            for row in published([table]):
                line = table.first_line + int(row[1]) - 1
                if line not in commits:
                    commits[line] = known.get(tuple(row)) or commit_of(root, path, line)
                lines.append([*row, known.get(tuple(row), commits[line])])
        file.parent.mkdir(parents=True, exist_ok=True)
        with file.open("w", newline="", encoding="utf-8") as out:
            csv.writer(out, lineterminator="\n").writerows([COLUMNS, *lines])


def problems(root):
    found, expected = [], set()
    for path, page in pages_of(root).items():
        tables, file = tables_without_csv(path, page), csv_of(root, path)
        if not tables:
            continue
        expected.add(file)
        stored = [row[:-1] for row in rows_of(file)]
        names = {row[0] for row in stored}
        for table in tables:
            if table.name not in names:
                found.append(f"{path}:{table.first_line - 2}: no CSV holds the numbers of this table")
            elif published([table]) != [row for row in stored if row[0] == table.name]:
                found.append(f"{path}:{table.first_line - 2}: {file.relative_to(root)} has other numbers")
        if any(not row[-1] for row in rows_of(file)):
            found.append(f"{file.relative_to(root)}: a row has no commit")
    for file in sorted((root / "docs" / "data" / "tables").glob("*.csv")):
        if file not in expected:
            found.append(f"{file.relative_to(root)}: no page has these tables")
    return found


def self_test():
    numbers = "| | a | b |\n|---|---|---|\n| x | 1 | 2 |\n| y | 3 | 4 |\n| z | **5** | [6](no.md) |\n"
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "docs" / "data" / "tables").mkdir(parents=True)
        page = root / "docs" / "page.md"
        page.write_text(f"# Page\n## One\n[data](data/one.csv)\n\n{numbers}\n## Two\n{numbers}\n| | a |\n|---|---|\n| x | 1 |\n")
        stored = root / "docs" / "data" / "tables" / "page.csv"
        none = ["docs/page.md:12: no CSV holds the numbers of this table"]
        good = "table,line,row,column,value,commit\n" + "".join(
            f"Two,{line},{row},{column},{value},c0\n"
            for line, row, column, value in (
                (1, "x", "a", 1), (1, "x", "b", 2), (2, "y", "a", 3), (2, "y", "b", 4), (3, "z", "a", 5), (3, "z", "b", 6))
        )
        other = ["docs/page.md:12: docs/data/tables/page.csv has other numbers"]
        for text, expected in (("", none), (good, []), (good.replace(",6,", ",7,"), other)):
            stored.write_text(text)
            if problems(root) != expected:
                sys.exit(f"tables.py: the self-test found {problems(root)}")
    print("tables: the self-test passes")


def main():
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    if len(sys.argv) not in (2, 3) or not Path(sys.argv[1]).is_dir() or sys.argv[2:] not in ([], ["--write"]):
        sys.exit(__doc__)
    root = Path(sys.argv[1])
    if len(sys.argv) == 3:
        write(root)
    found = problems(root)
    for line in found:
        print(line, file=sys.stderr)
    if found:
        sys.exit(f"tables: {len(found)} problems; tables.py ROOT --write copies numbers that have no CSV of their own")
    print("tables: every table of measured numbers has a CSV")
    return None


if __name__ == "__main__":
    main()
