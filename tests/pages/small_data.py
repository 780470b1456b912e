#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Puts the files that our pages name into a folder: ct.nii.gz, rig.toml, study.toml, A.mha and B.mha.

Usage: small_data.py FOLDER [cam01.txt] [results/]

af-simulate, which must be on the PATH, makes them from its phantom of a spine, for the cameras of the shipped C-arm,
here called A and B. Existing files stay. On demand there are also the cameras as MayaCam's files cam01.txt and
cam02.txt, and the results of a registration of the study.
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


def make_study(folder):
    rig = output_of("af-inspect", "--template", "rig", folder=folder)
    (folder / "rig.toml").write_text(rig.replace('"AP"', '"A"').replace('"LAT"', '"B"'))
    output_of("af-simulate", "--phantom", "spine", "--rig", "rig.toml", "--seed", "1", "--case", "patient-01", "-o", "made",
              folder=folder)
    for file in (folder / "made").iterdir():
        if file.name != "rig.toml":
            shutil.move(file, folder / file.name)
    shutil.rmtree(folder / "made")


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    folder, wanted = Path(sys.argv[1]), sys.argv[2:]
    if not (folder / "study.toml").exists():
        make_study(folder)
    if "cam01.txt" in wanted:
        output_of("af-convert", "rig.toml", "--to", "mayacam2", "-o", "cam.txt", folder=folder)
        for name, number in (("A", "01"), ("B", "02")):
            (folder / f"cam-{name}.txt").rename(folder / f"cam{number}.txt")
    if "results/" in wanted:
        output_of("af-register", "--study", "study.toml", "--renderer", "raycast", "--preset", "fast", "-o", "results",
                  folder=folder)


if __name__ == "__main__":
    main()
