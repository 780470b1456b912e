#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Puts what our pages name into a folder: ct.nii.gz, rig.toml, study.toml, A.mha and B.mha.

Usage: small_data.py FOLDER

The CT is a head-like phantom of 48 x 48 x 48 voxels; its X-rays are simulated by af-simulate, which must be on the PATH, for
two cameras of 96 x 96 pixels.
"""
import gzip
import shutil
import struct
import subprocess
import sys
from pathlib import Path

SIDE, SPACING_MM = 48, 4.0
# Centre and half axes in mm, and HU: skull, brain, and what breaks its symmetry.
ELLIPSOIDS = [((0, 0, 0), (70, 82, 85), 1100), ((0, 0, 0), (63, 75, 78), 40), ((25, -20, 20), (14, 10, 12), 700),
              ((-30, 15, -25), (10, 18, 9), 900), ((10, 35, -40), (20, 8, 8), 500), ((-15, -40, 35), (8, 8, 20), 800)]


def voxels():
    middle = (SIDE - 1) / 2
    for k in range(SIDE):
        for j in range(SIDE):
            for i in range(SIDE):
                value = -1000
                for center, half, hu in ELLIPSOIDS:
                    # NIfTI counts in RAS, the ellipsoids in LPS.
                    point = [(middle - i) * SPACING_MM, (middle - j) * SPACING_MM, (k - middle) * SPACING_MM]
                    if sum(((p - c) / h) ** 2 for p, c, h in zip(point, center, half)) <= 1:
                        value = hu
                yield value


def write_nifti(path):
    origin = -(SIDE - 1) / 2 * SPACING_MM
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, SIDE, SIDE, SIDE, 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 4, 16)  # int16
    struct.pack_into("<8f", header, 76, 1, SPACING_MM, SPACING_MM, SPACING_MM, 0, 0, 0, 0)
    struct.pack_into("<f", header, 108, 352)
    struct.pack_into("<f", header, 112, 1)
    header[123] = 2  # mm
    struct.pack_into("<2h", header, 252, 0, 1)  # the rows of the matrix count
    for row in range(3):
        values = [0.0, 0.0, 0.0, origin]
        values[row] = SPACING_MM
        struct.pack_into("<4f", header, 280 + 16 * row, *values)
    header[344:348] = b"n+1\0"
    with gzip.open(path, "wb", compresslevel=1) as file:
        file.write(header)
        file.write(struct.pack(f"<{SIDE ** 3}h", *voxels()))


RIG = """isocenter_point = [0, 0, 0]
[[camera]]
name = "A"
source_point = [0, -1000, 0]
detector_origin_point = [-190, 500, 190]
column_direction = [1, 0, 0]
row_direction = [0, 0, -1]
pixel_spacing_mm = [4, 4]
size_px = [96, 96]
[[camera]]
name = "B"
source_point = [-1000, 0, 0]
detector_origin_point = [500, 190, 190]
column_direction = [0, -1, 0]
row_direction = [0, 0, -1]
pixel_spacing_mm = [4, 4]
size_px = [96, 96]
"""


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    folder = Path(sys.argv[1])
    write_nifti(folder / "ct.nii.gz")
    (folder / "rig.toml").write_text(RIG)
    simulate = ["af-simulate", "--ct", "ct.nii.gz", "--rig", "rig.toml", "--seed", "1", "--center-ct-mm", "0,0,0", "--target-side-mm", "60",
                "--case", "patient-01", "--copy-ct", "-o", "simulated"]
    run = subprocess.run(simulate, cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode != 0:
        sys.exit(f"{' '.join(simulate)}: {run.stdout}{run.stderr}")
    for file in (folder / "simulated").iterdir():
        if file.name not in ("ct.nii.gz", "rig.toml"):
            shutil.move(file, folder / file.name)


if __name__ == "__main__":
    main()
