#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Every table of measured numbers on a page has them as CSV: in a file of docs/data to which the text around the table,
or the page before its first section, links, or else cell by cell in docs/data/tables/PAGE.csv, with the commit that
published each row.

Usage: tables.py ROOT             says which tables have none, or another value than their copy
       tables.py ROOT --write     brings docs/data/tables up to date
       tables.py --self-test
"""
import csv
import io
import re
import subprocess
import sys
import tempfile
from pathlib import Path

from links import outside_fences

COLUMNS = ["table", "row_number", "row", "column", "value", "commit"]
# A table with fewer cells that begin with a number is no table of measurements.
FEWEST_NUMBERS = 6
LINK_TO_CSV = re.compile(r"\]\([\w./-]*data/[\w-]+\.csv\)")
# Numbers that were chosen, not measured: page and heading.
CHOSEN = {
    ("jobs/README.md", "The paper's experiments"),
    ("jobs/README.md", "The quick preset and the paper's"),
    ("jobs/README.md", "When jobs die"),
}


class Table:
    """A table of a page: its section's heading, with a number from the second one on, and its rows."""

    def __init__(self, name, first_line, lines):
        self.name = name
        self.first_line = first_line  # of the rows, from 1
        self.header, self.rows = lines[0], lines[2:]

    def cells(self):
        """(row's number, row, column, value) of every cell that is not empty."""
        for number, row in enumerate(self.rows, 1):
            for column, value in zip(self.header[1:], row[1:]):
                if value:
                    yield number, row[0], column, value

    def is_measured(self):
        return sum(bool(re.match(r"\W*\d", value)) for _, _, _, value in self.cells()) >= FEWEST_NUMBERS

    def published(self):
        """The rows of its copy, without commits."""
        return [[self.name, str(number), row, column, value] for number, row, column, value in self.cells()]


def plain(cell):
    """A cell's text without links and emphasis."""
    return re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", cell).replace("**", "").strip()


def cells_of(line):
    return [plain(cell) for cell in re.split(r"(?<!\\)\|", line.strip().strip("|"))]


def blocks_of(page):
    """The page in turn: ("heading", text), ("table", line's number, lines' cells), ("text", whether it links to a CSV)."""
    blocks, rows = [], []
    for number, line in enumerate(outside_fences(page.read_text(encoding="utf-8")) + [""], 1):
        if re.match(r" {0,3}\|", line):
            rows.append(cells_of(line))
            continue
        if len(rows) > 2 and re.fullmatch(r":?-+:?", rows[1][0]):
            blocks.append(("table", number - len(rows), rows))
        rows = []
        title = re.match(r"#{2,6}\s+(.*)", line)
        if title:
            blocks.append(("heading", plain(title.group(1)).replace("`", "")))
        elif blocks and blocks[-1][0] == "text":
            blocks[-1] = ("text", blocks[-1][1] or bool(LINK_TO_CSV.search(line)))
        else:
            blocks.append(("text", bool(LINK_TO_CSV.search(line))))
    return blocks


def tables_without_csv(path, page):
    """The measured tables of a page that no link beside them, or at the page's beginning, leads to a CSV."""
    blocks, heading, counts, found = blocks_of(page), "", {}, []
    if blocks and blocks[0] == ("text", True):
        return []
    for i, block in enumerate(blocks):
        if block[0] == "heading":
            heading = block[1]
        elif block[0] == "table":
            counts[heading] = counts.get(heading, 0) + 1
            name = heading if counts[heading] == 1 else f"{heading} ({counts[heading]})"
            table = Table(name, block[1] + 2, block[2])
            has_csv = ("text", True) in (blocks[i - 1], blocks[i + 1])
            if table.is_measured() and not has_csv and (path, heading) not in CHOSEN:
                found.append(table)
    return found


def pages_of(root):
    """Pages that publish measurements, by their paths below the root."""
    patterns = ("*.md", "docs/*.md", "docs/howto/*.md", "*/README.md", "common/*/README.md")
    return {page.relative_to(root).as_posix(): page for page in sorted({p for g in patterns for p in root.glob(g)})}


def copies_of(root):
    return root / "docs" / "data" / "tables"


def copy_of(root, path):
    name = path.removesuffix(".md").removesuffix("/README").removeprefix("docs/")
    return copies_of(root) / f"{name.replace('/', '-')}.csv"


def rows_of(file):
    if not file.exists():
        return []
    return list(csv.reader(io.StringIO(file.read_text(encoding="utf-8"))))[1:]


def git(root, *words):
    done = subprocess.run(["git", "-C", str(root), *words], check=False, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"tables: git {words[0]}: {done.stderr.strip()}")
    return done.stdout.split()


def commit_of(root, path, line):
    """That which wrote the line, through moves within its commit; of a line that is in none yet, the last one."""
    if path in git(root, "ls-files", "--", path):
        commit = git(root, "blame", "-w", "-C", "-C", "--abbrev=11", "-s", "-L", f"{line},{line}", "--", path)[0]
        if set(commit) != {"0"}:
            return commit.lstrip("^")[:12]
    return git(root, "rev-parse", "--short=12", "HEAD")[0]


def write(root):
    wanted = {}
    for path, page in pages_of(root).items():
        file = copy_of(root, path)
        known = {tuple(row[:-1]): row[-1] for row in rows_of(file)}
        for table in tables_without_csv(path, page):
            for row in table.published():
                commit = known.get(tuple(row)) or commit_of(root, path, table.first_line + int(row[1]) - 1)
                wanted.setdefault(file, [COLUMNS]).append([*row, commit])
    copies_of(root).mkdir(parents=True, exist_ok=True)
    for file in set(copies_of(root).glob("*.csv")) - set(wanted):
        file.unlink()
    for file, lines in wanted.items():
        with file.open("w", newline="", encoding="utf-8") as out:
            csv.writer(out, lineterminator="\n").writerows(lines)


def problems_of_page(root, path, page):
    found, file = [], copy_of(root, path)
    tables, stored = tables_without_csv(path, page), rows_of(file)
    for table in tables:
        place = f"{path}:{table.first_line - 2}"
        mine = [row[:-1] for row in stored if row[0] == table.name]
        if any(len(row) != len(table.header) for row in table.rows):
            found.append(f"{place}: a row has more or fewer cells than the table has columns")
        elif not mine:
            found.append(f"{place}: no CSV holds the numbers of this table")
        elif mine != table.published():
            found.append(f"{place}: {file.relative_to(root)} has other numbers")
    if {row[0] for row in stored} - {table.name for table in tables}:
        found.append(f"{file.relative_to(root)}: has a table that {path} has not, or has with a CSV of its own")
    if any(not re.fullmatch(r"[0-9a-f]{7,12}", row[-1]) for row in stored):
        found.append(f"{file.relative_to(root)}: a row has no commit")
    return found


def problems(root):
    pages = pages_of(root)
    found = [problem for path, page in pages.items() for problem in problems_of_page(root, path, page)]
    files = {copy_of(root, path) for path in pages}
    return found + [f"{file.relative_to(root)}: there is no such page"
                    for file in sorted(copies_of(root).glob("*.csv")) if file not in files]


def self_test():
    numbers = "| | a | b |\n|---|---|---|\n| x | 1 | 2 |\n| y | >3 | 4 |\n| z | **5** | [6](no.md) |\n"
    values = ((1, "x", "a", "1"), (1, "x", "b", "2"), (2, "y", "a", ">3"), (2, "y", "b", "4"), (3, "z", "a", "5"), (3, "z", "b", "6"))
    copy = "".join(f"Two,{line},{row},{column},{value},c0ffee0\n" for line, row, column, value in values)
    fenced = "```\n[data](data/one.csv)\n```\n"
    cases = [
        ("", ["docs/page.md:15: no CSV holds the numbers of this table"]),
        (copy, []),
        (copy.replace(",6,", ",7,"), ["docs/page.md:15: docs/data/tables/page.csv has other numbers"]),
        (copy.replace("c0ffee0", ""), ["docs/data/tables/page.csv: a row has no commit"]),
        (copy + copy.replace("Two", "Old"), ["docs/data/tables/page.csv: has a table that docs/page.md has not, or has with a CSV of its own"]),
    ]
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        copies_of(root).mkdir(parents=True)
        page = root / "docs" / "page.md"
        page.write_text(f"# Page\n## One\n[data](data/one.csv)\n\n{numbers}\n## Two\n{fenced}{numbers}\n| | a |\n|---|---|\n| x | 1 |\n")
        for text, expected in cases:
            (copies_of(root) / "page.csv").write_text(",".join(COLUMNS) + "\n" + text)
            if problems(root) != expected:
                sys.exit(f"tables.py: the self-test found {problems(root)} instead of {expected}")
        for words in (("init", "-q"), ("add", "-A"), ("-c", "user.name=a", "-c", "user.email=a@b", "commit", "-qm", "a")):
            git(root, *words)
        page.write_text(page.read_text().replace("| 2 |", "| 8 |"))
        (copies_of(root) / "gone.csv").write_text("a\n")
        write(root)
        if problems(root) or (copies_of(root) / "gone.csv").exists():
            sys.exit(f"tables.py: after writing, the self-test found {problems(root)}")
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
