#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Prints mean line integrals of a noisy CT for several --air-below-hu, for the table of docs/cts.md.

Usage: ct_noise_bias.py BIN_FOLDER, such as build/release/bin. Takes about a minute.

The CT is 220 x 220 x 48 mm of air with two upright cylinders of 35 mm radius, water (0 HU) and lung (-850 HU), and
normal noise on every voxel. Means are over 8 mm x 16 mm about the rays through water, lung and the air between."""
import array
import pathlib
import random
import struct
import subprocess
import sys
import tempfile

SIZE = (110, 110, 24)
SPACING_MM = 2.0
PX_PER_MM = 1020 / 650 / 1.190625  # of c-arm-12in, at the isocentre


def hounsfield():
    for _ in range(SIZE[2]):
        for j in range(SIZE[1]):
            for i in range(SIZE[0]):
                x = (i - (SIZE[0] - 1) / 2) * SPACING_MM
                y = (j - (SIZE[1] - 1) / 2) * SPACING_MM
                yield 0 if (x + 40) ** 2 + y * y < 35**2 else -850 if (x - 40) ** 2 + y * y < 35**2 else -1000


def write_ct(path, sigma_hu):
    values = array.array("h", (round(hu + random.gauss(0, sigma_hu)) for hu in hounsfield()))
    origin = " ".join(str(-(n - 1) / 2 * SPACING_MM) for n in SIZE)
    head = (
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n"
        f"ElementSpacing = {SPACING_MM} {SPACING_MM} {SPACING_MM}\nOffset = {origin}\n"
        f"TransformMatrix = 1 0 0 0 1 0 0 0 1\nDimSize = {SIZE[0]} {SIZE[1]} {SIZE[2]}\n"
        "ElementType = MET_SHORT\nElementDataFile = LOCAL\n"
    )
    path.write_bytes(head.encode() + values.tobytes())


def drr(binaries, ct, cut_hu):
    out = ct.with_name("drr.mha")
    command = [binaries / "af-drr", "--ct", ct, "--rig", "c-arm-12in", "--camera", "AP"]
    subprocess.run([*command, "--air-below-hu", str(cut_hu), "-o", out], check=True, capture_output=True)
    data = out.read_bytes()
    return struct.unpack_from("<65536f", data, data.index(b"LOCAL") + 6)


def mean(pixels, x_mm):
    first, last = (int(127.5 + (x_mm + side) * PX_PER_MM) for side in (-4, 4))
    values = [pixels[row * 256 + column] for row in range(118, 139) for column in range(first, last)]
    return sum(values) / len(values)


def main():
    random.seed(1)
    with tempfile.TemporaryDirectory() as folder:
        ct = pathlib.Path(folder) / "ct.mha"
        print("noise_hu,air_below_hu,water,lung,air")
        for sigma_hu in (0, 20, 50, 100):
            write_ct(ct, sigma_hu)
            for cut_hu in (-1000, -900, -800, -500):
                pixels = drr(pathlib.Path(sys.argv[1]), ct, cut_hu)
                print(sigma_hu, cut_hu, *(f"{mean(pixels, x):.3f}" for x in (-40, 40, 0)), sep=",", flush=True)


if __name__ == "__main__":
    main()
