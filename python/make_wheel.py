# SPDX-License-Identifier: Apache-2.0
"""Packs module, library, af-convert, af-report and the libraries that they need into a wheel.

It runs where the C and C++ runtimes are at least as new as here (libc, libstdc++; the name of the wheel states the libc).
Needs Debian's python3-wheel and patchelf.
"""

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

METADATA = """Metadata-Version: 2.1
Name: attenuation-fields
Version: {version}
Summary: 2D-3D registration with attenuation fields
License: Apache-2.0
Requires-Python: =={python}.*
Requires-Dist: {numpy}
Provides-Extra: programs
Requires-Dist: h5py; extra == "programs"
Requires-Dist: pydicom; extra == "programs"
Requires-Dist: PyYAML; extra == "programs"
Requires-Dist: Jinja2; extra == "programs"
Requires-Dist: matplotlib; extra == "programs"
"""

WHEEL = """Wheel-Version: 1.0
Generator: attenuation_fields
Root-Is-Purelib: false
Tag: {tag}
"""

ENTRY_POINTS = """[console_scripts]
af-convert = af_programs.of_wheel:convert
af-report = af_programs.of_wheel:report
"""

# What every system has, and what must be the same for all of a process.
RUNTIMES = re.compile(r"(ld-linux.*|lib(c|m|dl|pthread|rt|util|resolv|gcc_s|stdc\+\+))\.so\..*")


def output_of(*command: str | Path) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def needed_by(file: Path) -> dict[str, Path]:
    """The libraries that `file` loads, directly or not, and where they are; without the runtimes and our own."""
    found = {}
    for line in output_of("ldd", file).splitlines():
        match = re.match(r"\s*(\S+) => (\S+) \(", line)
        if "not found" in line:
            sys.exit(f"make_wheel.py: {file} needs a library that is not here: {line.strip()}")
        if match and not RUNTIMES.fullmatch(match[1]) and not match[1].startswith("libattenuation_fields."):
            found[match[1]] = Path(match[2])
    return found


def packages_of(libraries: Iterable[Path]) -> dict[Path, str]:
    """The Debian package of each library that is not put there by hand. dpkg knows some of them by their name in /lib, others
    by that in /usr/lib, or by what a link leads to."""
    names = {path: library for library in libraries for path in (f"/usr{library}", str(library), str(library.resolve()))}
    asked = subprocess.run(["dpkg", "-S", *names], capture_output=True, text=True)  # fails for the names it does not know
    found = {}
    for line in asked.stdout.splitlines():
        packages, path = line.split(": ", 1)
        if path in names:
            found[names[path]] = packages.split(",")[0].split(":")[0]
    return found


def carry_libraries(binaries: list[Path], folder: Path, licences: Path) -> None:
    """Copies what the binaries need into `folder`, and makes them load the copies. These get names of their own, so that the
    same library of another module of the process stays another one."""
    needed = {}
    for binary in binaries:
        needed |= needed_by(binary)
    folder.mkdir()
    licences.mkdir()
    packages = packages_of(needed.values())
    new_names = {}
    for name, library in sorted(needed.items()):
        stem, rest = name.split(".so", 1)
        new_names[name] = f"{stem}-{hashlib.sha256(library.read_bytes()).hexdigest()[:8]}.so{rest}"
        shutil.copy(library, folder / new_names[name])
        if package := packages.get(library):
            shutil.copy(f"/usr/share/doc/{package}/copyright", licences / package)
        else:
            print(f"make_wheel.py: {library} belongs to no Debian package; its licence is not listed", file=sys.stderr)
    for file in [*(folder / name for name in new_names.values()), *binaries]:
        wanted = set(output_of("patchelf", "--print-needed", file).split())
        renames = [word for old in sorted(wanted & new_names.keys()) for word in ("--replace-needed", old, new_names[old])]
        is_ours = file in binaries
        path = f"$ORIGIN:$ORIGIN/../{folder.name}" if is_ours else "$ORIGIN"
        # In one call, patchelf 0.14 mixes the new texts up.
        if renames:
            output_of("patchelf", *renames, file)
        if not is_ours:
            output_of("patchelf", "--set-soname", file.name, file)
        output_of("patchelf", "--force-rpath", "--set-rpath", path, file)


def newest_libc(files: list[Path]) -> tuple[int, int]:
    """The newest version of the C library that any of the files asks for."""
    texts = (output_of("objdump", "-T", file) for file in files)
    return max((int(a), int(b)) for text in texts for a, b in re.findall(r"GLIBC_(\d+)\.(\d+)", text))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("build", "install-folder", "library-folder", "version", "numpy", "output"):
        parser.add_argument("--" + name, required=True)
    options = parser.parse_args()
    try:
        import wheel  # noqa: F401
    except ImportError:
        sys.exit("make_wheel.py: python3-wheel is missing (apt-get install python3-wheel)")
    if not shutil.which("patchelf"):
        sys.exit("make_wheel.py: patchelf is missing (apt-get install patchelf)")

    with tempfile.TemporaryDirectory() as scratch:
        prefix = Path(scratch, "prefix")
        for component in ("library", "python"):
            subprocess.run(
                [os.environ.get("AF_CMAKE", "cmake"), "--install", options.build]
                + ["--component", component, "--prefix", str(prefix), "--strip"],
                check=True,
                stdout=subprocess.DEVNULL,
            )
        tree = Path(scratch, "tree")
        package = tree / "attenuation_fields"
        shutil.copytree(prefix / options.install_folder / "attenuation_fields", package)
        # The module asks for this name; the others are links to it.
        major_minor = ".".join(options.version.split(".")[:2])
        library = f"libattenuation_fields.so.{major_minor}"
        shutil.copy(prefix / options.library_folder / library, package / library)
        for modules in ("af_convert", "af_report", "af_programs"):
            shutil.copytree(
                Path(__file__).parent / modules, tree / modules, ignore=shutil.ignore_patterns("__pycache__")
            )
        information = tree / f"attenuation_fields-{options.version}.dist-info"
        information.mkdir()
        shutil.copy(Path(__file__).parents[1] / "LICENSE", information)
        carried = tree / "attenuation_fields.libs"
        binaries = [package / library, *package.glob("_core*.so")]
        carry_libraries(binaries, carried, information / "licenses")
        libc = newest_libc([*binaries, *carried.iterdir()])

        python = "{}{}".format(*sys.version_info[:2])
        tag = f"cp{python}-cp{python}-manylinux_{libc[0]}_{libc[1]}_{os.uname().machine}"
        (information / "METADATA").write_text(
            METADATA.format(
                version=options.version, python="{}.{}".format(*sys.version_info[:2]), numpy=options.numpy
            )
        )
        (information / "WHEEL").write_text(WHEEL.format(tag=tag))
        (information / "entry_points.txt").write_text(ENTRY_POINTS)
        output = Path(options.output)
        output.mkdir(parents=True, exist_ok=True)
        for earlier in output.glob("*.whl"):  # pip install *.whl means one
            earlier.unlink()
        subprocess.run(
            [sys.executable, "-m", "wheel", "pack", str(tree), "--dest-dir", str(output)], check=True
        )


if __name__ == "__main__":
    main()
