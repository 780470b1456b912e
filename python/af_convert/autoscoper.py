# SPDX-License-Identifier: Apache-2.0
"""Autoscoper's tracking files (.tra). Each frame of the X-ray films has one line with the 16 numbers of room_from_volume,
row by row, in mm. A frame that was not tracked has 16 times NaN."""
import re

import numpy as np

from af_programs.errors import FileError

from .geometry import inverse, rigid, transform
from .rig import require
from .source import numbers_of, numbers_text

_LETTERS = re.compile(r"[0-9+\-.eEnaNA, \t]*")


def ct_from_volume(grid):
    """The centre of voxel (i, j, k) lies at x = (i + 0.5) sx, y = (ny - j - 0.5) sy, z = -(k + 0.5) sz. The origin is the
    lower left corner of the stack's first picture, y points up, and the stack grows along -z."""
    require(np.linalg.det(grid.direction) > 0, "direction of the CT's axes = left-handed: must be right-handed for Autoscoper's "
            "volume frame")
    return transform(grid.direction * [1, -1, -1], grid.point_mm([-0.5, grid.size[1] - 0.5, -0.5]))


def is_autoscoper(source):
    # One line of 16 numbers may also be a plain 4x4 matrix, so the file's name decides.
    return bool(source.lines) and (len(source.lines) > 1 or source.path.suffix == ".tra") and all(
        len(line.words) == 16 and _LETTERS.fullmatch(line.text) for line in source.lines)


def read_autoscoper(source, context):
    volume_from_ct = inverse(ct_from_volume(context.ct_grid(f"{source.name}: an Autoscoper pose is in the CT's voxel frame")))
    poses, untracked = [], []
    for frame, line in enumerate(source.lines, 1):
        place = f"{source.name}: frame {frame}"
        if len(line.words) != 16:
            raise FileError(f"{place}: numbers of room_from_volume: expected 16, found {len(line.words)}")
        if all(word.lower().lstrip("-") == "nan" for word in line.words):
            untracked.append(frame)
            continue
        if any("n" in word.lower() for word in line.words):
            raise FileError(f"{place}: some of its numbers are NaN")
        poses.append((frame, rigid(numbers_of(line.words, place).reshape(4, 4), place) @ volume_from_ct))
    if not untracked:
        return poses, []
    listed = ", ".join(map(str, untracked[:8])) + (f" and {len(untracked) - 8} more" if len(untracked) > 8 else "")
    return poses, [f"{source.name}: {len(untracked)} of {len(source.lines)} frames were not tracked (NaN) and are left out: {listed}"]


def write_autoscoper(poses, context):
    from_volume = ct_from_volume(context.ct_grid("an Autoscoper pose is in the CT's voxel frame"))
    return "".join(numbers_text(pose @ from_volume, ",") + "\n" for pose in poses)
