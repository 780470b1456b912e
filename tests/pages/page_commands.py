#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the commands of a page, to show that a reader can.

Usage: page_commands.py --run PAGE PROGRAMS [DATA] runs all ```sh and ```python blocks of a page in one scratch folder
       page_commands.py --data DATA PROGRAMS      makes the small data of all pages once, in a new folder DATA
       page_commands.py --check ROOT              blocks of every page are of a known kind, name options that our
                                                  programs have, and not_run.toml gives reasons for those not run
       page_commands.py --pages ROOT              prints the pages that have ```sh blocks

A block marked ```sh is run, from the top of the page to its end, with small data of the names that our pages use
(small_data.py); on such a page a ```python block, too. A block marked ```console shows commands that are not run, and
not_run.toml says why. A ```python block that stands there is not run either.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
SKIPPED = {".git", "build"}
KINDS = {"", "sh", "console", "toml", "text", "python", "cpp", "cmake", "json", "csv", "xml", "latex"}
NOT_RUN = tomllib.loads((HERE / "not_run.toml").read_text(encoding="utf-8"))


def blocks_of(page):
    """(kind, number of the first line, text) of each fenced block."""
    lines = page.read_text(encoding="utf-8").splitlines()
    blocks, begin, kind = [], None, ""
    for number, line in enumerate(lines):
        if begin is None and line.startswith("```"):
            begin, kind = number + 1, line[3:].strip()
        elif begin is not None and line.startswith("```"):
            blocks.append((kind, begin + 1, "\n".join(lines[begin:number])))
            begin = None
    if begin is not None:
        sys.exit(f"{page}:{begin}: a block without an end")
    return blocks


def entry_of(page, kind, text):
    """Where a block of a page (below the root) stands in not_run.toml, if it does."""
    first = next((line.strip() for line in text.splitlines() if line.strip() and not line.strip().startswith("#")), "")
    beginnings = [begin for begin in NOT_RUN.get(page.as_posix(), {}) if first.startswith(begin)]
    return max(beginnings, key=len, default=None) if kind in ("console", "python") else None


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
    unused = {(page, begin) for page, entries in NOT_RUN.items() for begin in entries}
    for page in pages_below(root):
        for kind, number, text in blocks_of(page):
            where = f"{page.relative_to(root)}:{number}"
            entry = entry_of(page.relative_to(root), kind, text)
            unused.discard((page.relative_to(root).as_posix(), entry))
            if kind not in KINDS:
                problems.append(f"{where}: a block of the unknown kind '{kind}'")
            if kind == "console" and entry is None:
                problems.append(f"{where}: tests/pages/not_run.toml does not say why this block is not run")
            if kind in ("console", "sh"):
                problems += [f"{where}: there is no {name}" for name in unknown_options(text, options)]
    problems += [f"tests/pages/not_run.toml: {page} has no block that begins with '{begin}'" for page, begin in unused]
    for problem in sorted(problems):
        print(problem, file=sys.stderr)
    if problems:
        sys.exit(f"pages: {len(problems)} problems")
    print(f"pages: of {len(pages_below(root))} pages, all commands but {sum(map(len, NOT_RUN.values()))} blocks are run")


def script_of(page):
    parts = ["set -euo pipefail"]
    below_root = page.resolve().relative_to(HERE.parent.parent)
    for kind, number, text in blocks_of(page):
        if kind == "python" and entry_of(below_root, kind, text) is None:
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
