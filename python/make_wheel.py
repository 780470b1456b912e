# SPDX-License-Identifier: Apache-2.0
"""Packs the installed component `python` and the library into a wheel, with Debian's python3-wheel."""

import argparse
import os
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from pathlib import Path

METADATA = """Metadata-Version: 2.1
Name: attenuation-fields
Version: {version}
Summary: 2D-3D registration with attenuation fields
License: Apache-2.0
Requires-Python: =={python}.*
Requires-Dist: numpy
"""

WHEEL = """Wheel-Version: 1.0
Generator: attenuation_fields
Root-Is-Purelib: false
Tag: {tag}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("build", "install-folder", "library-folder", "version", "output"):
        parser.add_argument("--" + name, required=True)
    options = parser.parse_args()
    try:
        import wheel  # noqa: F401
    except ImportError:
        sys.exit("make_wheel.py: python3-wheel is missing (apt-get install python3-wheel)")

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
        python = "{}{}".format(*sys.version_info[:2])
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        tag = f"cp{python}-cp{python}-{platform}"
        information = tree / f"attenuation_fields-{options.version}.dist-info"
        information.mkdir()
        (information / "METADATA").write_text(
            METADATA.format(version=options.version, python="{}.{}".format(*sys.version_info[:2]))
        )
        (information / "WHEEL").write_text(WHEEL.format(tag=tag))
        output = Path(options.output)
        output.mkdir(parents=True, exist_ok=True)
        for earlier in output.glob("*.whl"):  # pip install *.whl means one
            earlier.unlink()
        subprocess.run(
            [sys.executable, "-m", "wheel", "pack", str(tree), "--dest-dir", str(output)], check=True
        )


if __name__ == "__main__":
    main()
