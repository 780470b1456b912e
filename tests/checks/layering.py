#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares every #include with what the CMakeLists.txt of its folder links, and the table of ARCHITECTURE.md with the tree.

Usage: layering.py ROOT          one line per violation, exit code 1
       layering.py --graph ROOT  the includes between folders, for Graphviz (dot -Tsvg)
       layering.py --table ROOT  the folders with their lines, for ARCHITECTURE.md
       layering.py --self-test   plants violations in a scratch tree and checks that each is found

CMakeLists.txt lists the folders lowest first. A source may include its own folder and those that its library USES, and
the header of a watched library only where its folder links that library. What is named and never included is an error, too.
"""
import collections
import pathlib
import re
import sys
import tempfile

WATCHED = {  # header: the library as CMake knows it
    r"mpi\.h$": "MPI::MPI_C",
    r"(hdf5|H5\w*)\.h$": "PkgConfig::hdf5",
    r"(itk|vnl)": "${ITK_LIBRARIES}",
    r"gdcm": "gdcmMSFF",
    r"CLI/": "CLI11::CLI11",
    r"nlopt": "PkgConfig::nlopt",
    r"boost/": "Boost::headers",
    r"openssl/": "OpenSSL::Crypto",
    r"cairo": "PkgConfig::cairo",
    r"toml\+\+/": "PkgConfig::tomlplusplus",
    r"nlohmann/": "nlohmann_json::nlohmann_json",
    r"zlib\.h$": "ZLIB::ZLIB",
    r"png\.h$": "PNG::PNG",
    r"tiffio\.h$": "TIFF::TIFF",
    r"(pybind11/|Python\.h$|numpy/)": "pybind11",
}
# Only these folders may print; a library never does.
TERMINAL = re.compile(r"(iostream|cstdio|print)$")
PRINTS = {"common/cli", "common/ranks", "precompute", "register", "evaluate", "evaluate/image_quality", "evaluate/registration",
          "evaluate/report", "evaluate/scan", "evaluate/simulate", "evaluate/sweeps", "tools/drr", "tools/inspect"}
# What the folders may include that are no library of the programs.
DOORS = {
    "library/attenuation_fields": (set(), set()),  # the public headers: nothing but the standard library
    "library": ({"common/", "register", "register/", "evaluate/statistics", "library/attenuation_fields"}, set()),
    "python/bindings": ({"library/attenuation_fields"}, {"pybind11"}),
}
MAX_SHARE = 0.15  # of all lines, in one folder
KEYWORDS = {"SOURCES", "USES", "PUBLIC", "PRIVATE", "LIBS", "QUICK", "PROGRAM"}


def folder_of_target(target):
    """af_evaluate_image_quality: evaluate/image_quality; af_ct: common/ct."""
    name = target.removeprefix("af_")
    for top in ("precompute", "register", "evaluate", "tools"):
        if name == top:
            return top
        if name.startswith(top + "_"):
            return top + "/" + name[len(top) + 1 :]
    return "common/" + name


class Folder:
    """What a folder's CMakeLists.txt lets its sources include."""

    def __init__(self, text):
        self.uses, self.libraries = set(), set()
        for arguments in re.findall(r"\b(?:af_add_library|af_add_program|target_link_libraries)\(([^)]*)\)", text):
            keyword, words = "", arguments.split()
            for word in words[1:]:
                if word in KEYWORDS:
                    keyword = word
                elif keyword in ("USES", "LIBS") and word.startswith("af_"):
                    self.uses.add(folder_of_target(word))
                elif keyword in ("PUBLIC", "PRIVATE"):
                    self.libraries.add(word)
        if "common/cli" in self.uses:
            self.libraries.add("CLI11::CLI11")


def listed_folders(root):
    text = (root / "CMakeLists.txt").read_text()
    found = re.search(r"foreach\(\s*folder\s([^)]*)\)", text)
    return found.group(1).split() if found else []


def sources_of(root):
    for top in ("common", "precompute", "register", "evaluate", "tools", "library", "python"):
        for path in sorted((root / top).rglob("*")):
            if path.suffix in (".h", ".cpp"):
                yield path


class Tree:
    """Reads a tree and collects its violations."""

    def __init__(self, root):
        self.root = root
        self.violations = []
        self.lines = collections.Counter()
        self.includes = collections.defaultdict(set)  # folder: folders
        self.linked = collections.defaultdict(set)  # folder: watched libraries
        self.folders = {}
        for place, folder in enumerate(listed := listed_folders(root)):
            cmake = root / folder / "CMakeLists.txt"
            if not cmake.is_file():
                self.report("CMakeLists.txt", f"lists {folder}, which has no CMakeLists.txt")
                continue
            self.folders[folder] = Folder(cmake.read_text())
            # A program states its own library in the LIBS of the same folder.
            self.folders[folder].uses.discard(folder)
            for used in self.folders[folder].uses - set(listed[:place]):
                self.report(f"{folder}/CMakeLists.txt", f"uses {used}, which does not stand above it in the list of CMakeLists.txt")
        self.source_count = 0
        for source in sources_of(root):
            self.read(source)
        self.check_what_is_named()
        self.check_table()

    def report(self, where, what):
        self.violations.append(f"{where}: {what}")

    def folder_of_include(self, name, folder):
        if "/" not in name:
            return folder
        parent = name.rpartition("/")[0]
        if parent == "attenuation_fields":
            return "library/attenuation_fields"
        return parent if (self.root / parent).is_dir() else "common/" + parent

    def may_include(self, folder, included):
        if folder in DOORS:
            return any(included == door or (door.endswith("/") and included.startswith(door)) for door in DOORS[folder][0])
        return included in self.folders[folder].uses

    def read(self, source):
        folder = str(source.parent.relative_to(self.root))
        path = source.relative_to(self.root)
        self.source_count += 1
        if folder not in self.folders and folder not in DOORS:
            self.report(f"{path}:0", "its folder does not stand in the list of CMakeLists.txt")
            return
        libraries = DOORS[folder][1] if folder in DOORS else self.folders[folder].libraries
        for number, line in enumerate(source.read_text().splitlines(), 1):
            self.lines[folder] += 1
            include = re.match(r'\s*#\s*include\s*([<"])([^">]+)', line)
            if not include:
                continue
            where, (bracket, name) = f"{path}:{number}", include.groups()
            watched = next((library for header, library in WATCHED.items() if re.match(header, name)), None)
            if watched:
                self.linked[folder].add(watched)
                if watched not in libraries:
                    self.report(where, f"includes {name}, but {folder} does not link {watched}")
            elif TERMINAL.match(name):
                if folder not in PRINTS:
                    self.report(where, f"includes {name}, but {folder} may not print")
            elif bracket == '"':
                included = self.folder_of_include(name, folder)
                if name == "ranks/mpi_handle.h" and folder != "common/ranks" and "MPI::MPI_C" not in libraries:
                    self.report(where, "includes the raw MPI handle")
                if included != folder:
                    self.includes[folder].add(included)
                    if not self.may_include(folder, included):
                        self.report(where, f'includes "{name}", but {folder} does not use {included}')

    def check_what_is_named(self):
        for folder, rules in self.folders.items():
            if folder not in self.lines:
                self.report("CMakeLists.txt", f"lists {folder}, which holds no sources")
            for used in sorted(rules.uses - self.includes[folder]):
                if used in self.folders and used != "common/cli":
                    self.report(f"{folder}/CMakeLists.txt", f"uses {used}, which it never includes")
            for library in sorted(rules.libraries & set(WATCHED.values()) - self.linked[folder] - {"CLI11::CLI11"}):
                self.report(f"{folder}/CMakeLists.txt", f"links {library}, which it never includes")
        all_lines = sum(self.lines.values())
        for folder, lines in self.lines.items():
            if self.source_count >= 100 and lines > MAX_SHARE * all_lines:
                self.report(folder, f"holds more than {100 * MAX_SHARE:.0f} % of the code")

    def table(self):
        """Rows of ARCHITECTURE.md: a folder and its lines, rounded to hundreds."""
        return [(folder, max(100, round(self.lines[folder], -2))) for folder in [*self.folders, *DOORS] if folder in self.lines]

    def check_table(self):
        stated = {}
        for folder, lines in re.findall(r"^\| `([\w/]+)` \|.*\| (\d+) \|$", (self.root / "ARCHITECTURE.md").read_text(), re.M):
            stated[folder] = int(lines)
        for folder, lines in self.table():
            if folder not in stated:
                self.report("ARCHITECTURE.md", f"has no row for {folder}")
            elif abs(stated.pop(folder) - lines) > max(100, lines // 10):
                self.report("ARCHITECTURE.md", f"the row of {folder} is no longer right: it has {lines} lines")
        for folder in stated:
            self.report("ARCHITECTURE.md", f"has a row for {folder}, which holds no sources")

    def graph(self):
        print("digraph folders {\n  rankdir = BT;\n  node [shape = box];")
        for folder, others in sorted(self.includes.items()):
            for other in sorted(others):
                print(f'  "{folder}" -> "{other}";')
        print("}")


SCRATCH = {
    "ARCHITECTURE.md": "| `common/base` | errors | 100 |\n| `common/geometry` | cameras | 100 |\n| `common/ranks` | MPI | 100 |\n"
    "| `common/field` | fields | 100 |\n| `register/method` | searches | 100 |\n",
    "CMakeLists.txt": "foreach(\n  folder\n  common/base common/geometry common/ranks\n  common/field register/method)\n",
    "common/base/CMakeLists.txt": "af_add_library(\n  af_base\n  SOURCES error.cpp)\n",
    "common/geometry/CMakeLists.txt": "af_add_library(af_geometry SOURCES ray.cpp USES af_base)\n",
    "common/ranks/CMakeLists.txt": "af_add_library(af_ranks SOURCES communicator.cpp USES af_base PRIVATE MPI::MPI_C)\n",
    "common/field/CMakeLists.txt": "af_add_library(af_field SOURCES f.cpp USES af_ranks PRIVATE MPI::MPI_C PkgConfig::hdf5)\n",
    "register/method/CMakeLists.txt": "af_add_library(af_register_method SOURCES registration.cpp USES af_geometry)\n",
    "common/base/error.h": "#include <string>\n",
    "common/geometry/ray.h": '#include "base/error.h"\n',
    "common/ranks/communicator.cpp": '#include <mpi.h>\n#include "base/error.h"\n',
    "common/field/field_reading.cpp": '#include <hdf5.h>\n#include "ranks/mpi_handle.h"\n#include <mpi.h>\n',
    "register/method/registration.cpp": '#include "geometry/ray.h"\n',
}
PLANTED = [  # what, file, its text (None: without it), how a message begins
    ("a folder that is not used", "common/geometry/slab.h", '#include "ranks/communicator.h"\n', "common/geometry/slab.h:1: "),
    ("the same by its long name", "common/geometry/slab.h", '#include "common/ranks/communicator.h"\n', "common/geometry/slab.h:1: "),
    ("a part of a program uses its top", "register/method/judge.cpp", '#include "register/main.h"\n', "register/method/judge.cpp:1: "),
    ("numerics use MPI", "common/geometry/slab.h", "\n#include <mpi.h>\n", "common/geometry/slab.h:2: "),
    ("numerics use HDF5", "common/geometry/slab.h", '#  include "hdf5.h"\n', "common/geometry/slab.h:1: "),
    ("numerics use ITK", "common/geometry/slab.h", "#include <itkImage.h>\n", "common/geometry/slab.h:1: "),
    ("numerics use Python", "common/geometry/slab.h", "#include <pybind11/pybind11.h>\n", "common/geometry/slab.h:1: "),
    ("bindings that pass the library by", "python/bindings/module.cpp", '#include "geometry/ray.h"\n', "python/bindings/module.cpp:1: "),
    ("a public header that includes ours", "library/attenuation_fields/ct.h", '#include "base/error.h"\n', "library/attenuation_fields/ct.h:1: "),
    ("a library prints", "common/geometry/slab.h", "#include <iostream>\n", "common/geometry/slab.h:1: "),
    ("the raw MPI handle", "register/method/judge.h", '#include "ranks/mpi_handle.h"\n', "register/method/judge.h:1: "),
    ("a folder that is not listed", "common/volume/ct.h", "#include <string>\n", "common/volume/ct.h:0: "),
    ("a listed folder without sources", "register/method/registration.cpp", None, "CMakeLists.txt: "),
    ("a folder that is used and not included", "common/geometry/ray.h", "#include <string>\n", "common/geometry/CMakeLists.txt: "),
    ("a library that is linked and not included", "common/ranks/communicator.cpp", '#include "base/error.h"\n', "common/ranks/CMakeLists.txt: "),
    ("a circle", "common/base/CMakeLists.txt", "af_add_library(af_base SOURCES error.cpp USES af_geometry)\n", "common/base/CMakeLists.txt: "),
    ("a table with other lines", "common/geometry/long.h", "\n" * 400, "ARCHITECTURE.md: "),
    ("a table without a folder", "ARCHITECTURE.md", "| `common/base` | errors | 100 |\n", "ARCHITECTURE.md: "),
]


def violations_of(files):
    with tempfile.TemporaryDirectory() as name:
        for path, text in files.items():
            if text is not None:
                target = pathlib.Path(name) / path
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_text(text)
        return Tree(pathlib.Path(name)).violations


def self_test():
    if clean := violations_of(SCRATCH):
        sys.exit(f"self-test: a clean tree is refused: {clean}")
    for what, path, text, begins in PLANTED:
        found = violations_of({**SCRATCH, path: text})
        if not any(violation.startswith(begins) for violation in found):
            sys.exit(f"self-test: NOT found: {what}: no message begins with {begins!r}: {found}")
    print(f"self-test: {len(PLANTED)} planted violations found, clean tree accepted")


def main():
    options, arguments = [a for a in sys.argv[1:] if a.startswith("--")], [a for a in sys.argv[1:] if not a.startswith("--")]
    if options == ["--self-test"]:
        return self_test()
    if len(arguments) != 1 or options not in ([], ["--graph"], ["--table"]):
        sys.exit(__doc__)
    tree = Tree(pathlib.Path(arguments[0]).resolve())
    if not tree.source_count:
        sys.exit(f"layering: no sources below {arguments[0]}")
    if options == ["--graph"]:
        return tree.graph()
    if options == ["--table"]:
        return print("\n".join(f"| `{folder}` | | {lines} |" for folder, lines in tree.table()))
    print("\n".join(tree.violations + [f"layering: {tree.source_count} files in {len(tree.lines)} folders, {len(tree.violations)} violations"]))
    sys.exit(1 if tree.violations else 0)


if __name__ == "__main__":
    main()
