#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the commands of a page, to show that a reader can.

Usage: page_commands.py --run PAGE PROGRAMS [DATA] runs all ```sh and ```python blocks of a page in one scratch folder
       page_commands.py --data DATA PROGRAMS      makes the small data of all pages once, in a new folder DATA
       page_commands.py --check ROOT              blocks of every page are of a known kind, those that are not run say
                                                  why, and name options that our programs have
       page_commands.py --pages ROOT              prints the pages that have ```sh blocks

A block marked ```sh is run, from the top of the page to its end, with small data of the names that our pages use
(small_data.py); on such a page a ```python block, too. A block marked ```console shows commands that are not run; the
line behind it begins with "*Not run by the tests:" and gives the reason. So may the line behind a ```python block.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
SKIPPED = {".git", "build"}
KINDS = {"", "sh", "console", "toml", "text", "python", "cpp", "cmake", "json", "csv", "xml", "latex"}
EXCUSE = "*Not run by the tests:"


def blocks_of(page):
    """(kind, number of the first line, text, the first line that is not empty after it) of each fenced block."""
    lines = page.read_text(encoding="utf-8").splitlines()
    blocks, begin, kind = [], None, ""
    for number, line in enumerate(lines):
        if begin is None and line.startswith("```"):
            begin, kind = number + 1, line[3:].strip()
        elif begin is not None and line.startswith("```"):
            behind = next((text for text in lines[number + 1 :] if text.strip()), "")
            blocks.append((kind, begin + 1, "\n".join(lines[begin:number]), behind))
            begin = None
    if begin is not None:
        sys.exit(f"{page}:{begin}: a block without an end")
    return blocks


def pages_below(root):
    return sorted(p for p in root.rglob("*.md") if not SKIPPED & set(p.relative_to(root).parts))


def known_options(root):
    """The options of each program, from docs/reference, which another test compares with the programs."""
    options = {}
    for page in (root / "docs" / "reference").glob("af-*.md"):
        rows = [line for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("| `-")]
        options[page.stem] = {name for row in rows for name in re.findall(r"`(--?[a-z][a-z-]*)`", row.split("|")[1])}
    return options


def unknown_options(text, options):
    """Options in commands of our programs that the programs do not have."""
    for command in re.split(r"[|;&\n]+", re.sub(r"#.*", "", text.replace("\\\n", " "))):
        program = re.search(r"\baf-[a-z]+\b", command)
        if program and program.group() in options:
            for name in re.findall(r"(?<=\s)--[a-z][a-z_-]*", command[program.end() :]):
                if name.replace("_", "-") not in options[program.group()]:
                    yield f"{program.group()} {name}"


def check(root):
    problems, options = [], known_options(root)
    for page in pages_below(root):
        for kind, number, text, behind in blocks_of(page):
            where = f"{page.relative_to(root)}:{number}"
            if kind not in KINDS:
                problems.append(f"{where}: a block of the unknown kind '{kind}'")
            if kind == "console" and not behind.startswith(EXCUSE):
                problems.append(f"{where}: nothing says why this block is not run ('{EXCUSE} ...*' behind it)")
            if kind in ("console", "sh"):
                problems += [f"{where}: there is no {name}" for name in unknown_options(text, options)]
    for problem in problems:
        print(problem, file=sys.stderr)
    if problems:
        sys.exit(f"pages: {len(problems)} problems")
    print(f"pages: {len(pages_below(root))} pages say which commands are run")


def script_of(page):
    parts = ["set -euo pipefail"]
    for kind, number, text, behind in blocks_of(page):
        if kind == "python" and not behind.startswith(EXCUSE):
            text = f"/usr/bin/python3 -W error - <<'END OF PYTHON'\n{text}\nEND OF PYTHON"
        elif kind != "sh":
            continue
        parts.append(f"echo '--- {page.name}:{number}'\n{text}")
    return "\n".join(parts) + "\n"


def environment_of(programs):
    environment = dict(os.environ)
    environment["PATH"] = f"{programs}:{environment['PATH']}"
    environment["PYTHONPATH"] = str(programs.parent / "python")
    environment["OMPI_ALLOW_RUN_AS_ROOT"] = environment["OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"] = "1"
    environment["OMPI_MCA_rmaps_base_oversubscribe"] = "1"
    return environment


def make_data(folder, programs):
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return subprocess.run([HERE / "small_data.py", folder], check=False, env=environment_of(programs)).returncode


def run(page, programs, data=None):
    root, environment = HERE.parent.parent, environment_of(programs)
    with tempfile.TemporaryDirectory(prefix="page ") as folder:
        if data:
            shutil.copytree(data, folder, dirs_exist_ok=True)
        for name in ("jobs", "tests", "docs", "common", "examples"):
            (Path(folder) / name).symlink_to(root / name)
        script = script_of(page)
        wanted = [word for word in ("cam01.txt", "results/") if f" {word}" in script]
        subprocess.run([HERE / "small_data.py", folder, *wanted], check=True, env=environment, cwd=folder)
        return subprocess.run(["bash", "-c", script], check=False, env=environment, cwd=folder).returncode


def main():
    arguments = sys.argv[1:]
    if len(arguments) in (3, 4) and arguments[0] == "--run":
        return run(Path(arguments[1]), Path(arguments[2]).resolve(), *arguments[3:])
    if len(arguments) == 3 and arguments[0] == "--data":
        return make_data(Path(arguments[1]).resolve(), Path(arguments[2]).resolve())
    if len(arguments) == 2 and arguments[0] == "--check":
        return check(Path(arguments[1]))
    if len(arguments) == 2 and arguments[0] == "--pages":
        for page in pages_below(Path(arguments[1])):
            if any(kind == "sh" for kind, *_ in blocks_of(page)):
                print(page.relative_to(arguments[1]))
        return 0
    sys.exit(__doc__)


if __name__ == "__main__":
    sys.exit(main())
