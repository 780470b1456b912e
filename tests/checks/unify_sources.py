#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes few translation units of many for clang-tidy, which parses a header once per unit, and ITK's for seconds.

Usage: unify_sources.py COMPILE_COMMANDS ROOT PATTERN OUTPUT_FOLDER

Reads a database of single sources and writes OUTPUT_FOLDER/compile_commands.json, whose units include the sources of a
target that match PATTERN (relative to ROOT), at most eight each. The static analyser looks into included sources only
where the unit's name begins with UnifiedSource (clang's AnalysisManager::isInCodeFile). Kernels, which are compiled once
per vector width, are units of their own and appear once. Prints the number of sources.
"""
import json
import pathlib
import re
import sys

SOURCES_PER_UNIT = 8


def units_of(database, root, pattern):
    """Lists (entry, sources): a command of the database and the sources that are checked with it."""
    targets = {}
    seen = set()
    for entry in database:
        source = entry["file"]
        name = str(pathlib.Path(source).relative_to(root)) if source.startswith(str(root)) else source
        if source in seen or name.startswith("build/") or not re.search(pattern, name):
            continue
        seen.add(source)
        target = source if name.endswith("_kernel.cpp") else re.search(r"-o (\S+\.dir)/", entry["command"]).group(1)
        targets.setdefault(target, []).append(entry)
    for entries in targets.values():
        for first in range(0, len(entries), SOURCES_PER_UNIT):
            some = entries[first : first + SOURCES_PER_UNIT]
            yield some[0], [entry["file"] for entry in some]


def main():
    database_path, root, pattern, folder = sys.argv[1:]
    folder = pathlib.Path(folder).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("UnifiedSource*.cpp"):
        old.unlink()
    unified = []
    count = 0
    for number, (entry, sources) in enumerate(units_of(json.loads(pathlib.Path(database_path).read_text()), pathlib.Path(root), pattern)):
        kind = "Kernel" if sources[0].endswith("_kernel.cpp") else ""
        unit = folder / f"UnifiedSource{kind}{number}.cpp"
        unit.write_text("".join(f'#include "{source}"  // NOLINT(bugprone-suspicious-include)\n' for source in sources))
        unified.append({**entry, "file": str(unit), "command": entry["command"].replace(entry["file"], str(unit))})
        count += len(sources)
    (folder / "compile_commands.json").write_text(json.dumps(unified, indent=1))
    print(count)


if __name__ == "__main__":
    main()
