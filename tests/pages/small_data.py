#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Puts what our pages name into a folder: ct.nii.gz, rig.toml, study.toml, A.mha and B.mha.

Usage: small_data.py FOLDER

They are the study that af-simulate, which must be on the PATH, makes of its phantom of a spine, for the cameras of the
shipped C-arm, here called A and B.
"""
import shutil
import subprocess
import sys
from pathlib import Path


def output_of(*command, folder):
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        sys.exit(f"{' '.join(command)}: {run.stdout}{run.stderr}")
    return run.stdout


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = Path(sys.argv[1])
    rig = output_of("af-inspect", "--template", "rig", folder=folder)
    (folder / "rig.toml").write_text(rig.replace('"AP"', '"A"').replace('"LAT"', '"B"'))
    output_of("af-simulate", "--phantom", "spine", "--rig", "rig.toml", "--seed", "1", "--case", "patient-01", "-o", "made",
              folder=folder)
    for file in (folder / "made").iterdir():
        if file.name != "rig.toml":
            shutil.move(file, folder / file.name)
    shutil.rmtree(folder / "made")


if __name__ == "__main__":
    main()
