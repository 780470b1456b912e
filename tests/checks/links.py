#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks that every relative link of every Markdown page below ROOT leads to an existing file and heading, and that
docs/data/README.md names every table in its folder.

Usage: links.py ROOT
       links.py --self-test
"""
import re
import sys
import tempfile
from pathlib import Path

SKIPPED = {".git", "build", "node_modules"}
LINK = re.compile(r"!?\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^()\s]+)(?:\s+\"[^\"]*\")?\)")
HTML_LINK = re.compile(r"(?:href|src)=\"([^\"]+)\"")


def outside_fences(text):
    """The lines of the text, with those of fenced blocks emptied, so that line numbers stay."""
    lines, fence = [], None
    for line in text.splitlines():
        mark = re.match(r"\s*(```+|~~~+)", line)
        if fence is None and mark:
            fence = mark.group(1)
        elif fence is not None and line.strip().startswith(fence):
            fence = None
        elif fence is None:
            lines.append(line)
            continue
        lines.append("")
    return lines


def without_code(text):
    """The lines outside fenced blocks, without `code`. Line numbers stay."""
    return [re.sub(r"`[^`]*`", "", line) for line in outside_fences(text)]


def slug(heading):
    """The anchor that Git hosts give a heading."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading.strip().lower())
    return re.sub(r"[^\w\- ]", "", text.replace("`", "")).replace(" ", "-")


def anchors(page):
    found, counts = set(), {}
    text = page.read_text(encoding="utf-8")
    in_code = False
    for line in text.splitlines():
        if re.match(r"\s*(```|~~~)", line):
            in_code = not in_code
        heading = None if in_code else re.match(r"#{1,6}\s+(.*?)\s*#*$", line)
        if heading:
            name = slug(heading.group(1))
            count = counts.get(name, 0)
            counts[name] = count + 1
            found.add(name if count == 0 else f"{name}-{count}")
    found.update(re.findall(r"<a (?:id|name)=\"([^\"]+)\"", text))
    return found


def pages_below(root):
    return sorted(p for p in root.rglob("*.md") if not SKIPPED & set(p.relative_to(root).parts[:-1]))


def problem_of(target, page, root):
    if re.match(r"[a-z][a-z0-9+.-]*:", target):
        return None
    path, _, anchor = target.partition("#")
    file = page if path == "" else (page.parent / path).resolve()
    if path.startswith("/") or root.resolve() not in [file, *file.parents]:
        return "leads out of the tree"
    if not file.exists():
        return "there is no such file"
    if anchor and file.suffix == ".md" and anchor not in anchors(file):
        return "there is no such heading"
    return None


def dead_links(root):
    found = []
    for page in pages_below(root):
        for number, line in enumerate(without_code(page.read_text(encoding="utf-8")), 1):
            for target in LINK.findall(line) + HTML_LINK.findall(line):
                problem = problem_of(target, page.resolve(), root)
                if problem:
                    found.append(f"{page.relative_to(root)}:{number}: {target}: {problem}")
    return found


def unlisted_tables(root):
    folder = root / "docs" / "data"
    index = folder / "README.md"
    listed = index.read_text(encoding="utf-8") if index.exists() else ""
    return [f"{table.relative_to(root)}: {index.relative_to(root)} does not name it"
            for table in sorted(folder.glob("*.csv")) if f"`{table.name}`" not in listed]


def self_test():
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        (root / "other.md").write_text("# One `two`, three\n## Again\n## Again\n")
        (root / "page.md").write_text(
            "[a](other.md) [b](other.md#one-two-three) [c](other.md#again-1) [d](https://x.y) `[e](no.md)`\n"
            "```\n[f](no.md)\n```\n[g](no.md) ![h](other.md#nothing)\n[i](../out.md)\n"
        )
        expected = ["page.md:5: no.md: there is no such file",
                    "page.md:5: other.md#nothing: there is no such heading",
                    "page.md:6: ../out.md: leads out of the tree"]
        found = dead_links(root)
        if found != expected:
            sys.exit(f"links.py: the self-test found {found}")
        data = root / "docs" / "data"
        data.mkdir(parents=True)
        for name in ("listed.csv", "forgotten.csv"):
            (data / name).write_text("a\n")
        (data / "README.md").write_text("`listed.csv`\n")
        found = unlisted_tables(root)
        if found != ["docs/data/forgotten.csv: docs/data/README.md does not name it"]:
            sys.exit(f"links.py: the self-test found {found}")
    print("links: the self-test passes")


def main():
    if sys.argv[1:] == ["--self-test"]:
        return self_test()
    if len(sys.argv) != 2 or not Path(sys.argv[1]).is_dir():
        sys.exit(__doc__)
    root = Path(sys.argv[1])
    dead, unlisted = dead_links(root), unlisted_tables(root)
    for line in dead + unlisted:
        print(line, file=sys.stderr)
    if dead or unlisted:
        sys.exit(f"links: {len(dead)} dead links, {len(unlisted)} tables that are not listed")
    print(f"links: all links of {len(pages_below(root))} pages lead somewhere")
    return None


if __name__ == "__main__":
    main()
