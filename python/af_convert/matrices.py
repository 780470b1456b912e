# SPDX-License-Identifier: Apache-2.0
"""Projection matrices as text: pixels from room mm, three lines of four numbers per camera or twelve on one line. In files
that this project writes, comments state what a matrix leaves open: # camera, # size_px, # pixel_spacing_mm, #
isocenter_point."""
import numpy as np

from af_programs.errors import FileError, InputError

from .geometry import camera_from_matrix, pinhole_of
from .rig import StatedCamera, StatedRig
from .source import is_number, numbers_of, numbers_text, rows_text, size_of

MOST_MATRICES = 10000


def is_matrix_text(source):
    rows = 0
    for line in source.lines:
        if line.text.startswith("#"):
            continue
        if len(line.words) not in (4, 12) or not all(is_number(word) for word in line.words):
            return False
        rows += len(line.words) // 4
    return rows > 0 and rows % 3 == 0  # four rows are a pose


def read_matrix_text(source, options):
    stated = StatedRig(file=source.name)
    following, rows = {}, []
    for line in source.lines:
        place = source.place(line)
        if line.text.startswith("#"):
            _comment(line, place, following, stated)
            continue
        if len(line.words) not in (4, 12) or (len(line.words) == 12 and rows):
            raise FileError(f"{place}: expected 4 numbers, found '{line.text[:100]}'")
        rows += list(numbers_of(line.words, place).reshape(-1, 4))
        if len(rows) == 3:
            stated.cameras.append(_camera(source, np.array(rows), following, len(stated.cameras) + 1))
            following, rows = {}, []
        if len(stated.cameras) > MOST_MATRICES:
            raise InputError(f"{source.name}: more than {MOST_MATRICES} matrices are too many cameras")
    if rows or not stated.cameras:
        raise FileError(f"{source.name}: truncated: a projection matrix has 3 rows of 4 numbers")
    return stated


def _comment(line, place, following, stated):
    """Takes what "# key numbers" states, for the keys that matter here."""
    words = line.words[1:] if line.words[:1] == ["#"] else line.words
    if len(words) < 2:
        return
    counts = {"size_px": 2, "pixel_spacing_mm": 2, "isocenter_point": 3}
    if words[0] == "camera":
        following["name"] = line.text[line.text.find("camera") + len("camera"):].strip()
    elif words[0] in counts:
        if len(words) - 1 != counts[words[0]]:
            raise FileError(f"{place}: {words[0]}: expected {counts[words[0]]} numbers, found {len(words) - 1}")
        numbers = numbers_of(words[1:], place)
        if words[0] == "isocenter_point":
            stated.isocenter_point = numbers
        elif words[0] == "size_px":
            following["size_px"] = size_of(numbers, f"{place}: size_px")
        elif not numbers.min() > 0:
            raise InputError(f"{place}: pixel_spacing_mm = {line.text}: must be positive")
        else:
            following["pixel_spacing_mm"] = numbers


def _camera(source, matrix, following, number):
    """A camera whose front is still open: only the isocentre shows on which side the object is."""
    axis = matrix[2, :3]
    front = (1 - matrix[2, 3]) / (axis @ axis) * axis if axis @ axis > 0 else np.zeros(3)
    spacing = following.get("pixel_spacing_mm")
    if spacing is None:
        spacing = np.array([1.0, _focal_ratio(matrix)])
    camera = camera_from_matrix(following.get("name") or f"{source.name}, matrix {number}", matrix, spacing,
                                following.get("size_px", [1, 1]), front)
    camera.name = following.get("name", "")
    return StatedCamera(camera, has_name="name" in following, has_size="size_px" in following,
                        has_spacing="pixel_spacing_mm" in following, knows_front=False)


def _focal_ratio(matrix):
    """The ratio of the focal lengths along columns and along rows, both in pixels."""
    with np.errstate(all="ignore"):
        depth = matrix[2, :3] / np.linalg.norm(matrix[2, :3])
        columns, rows = (np.linalg.norm(axis - axis @ depth * depth) for axis in matrix[:2, :3])
        ratio = columns / rows
    return ratio if ratio > 0 and np.isfinite(ratio) else 1.0


def write_matrix_text(rig):
    text = "# Projection matrices: pixels (column, row; integers are centres) from room mm.\n"
    text += f"# isocenter_point {numbers_text(rig.isocenter_point)}\n"
    for camera in rig.cameras:
        k, rotation, translation = pinhole_of(camera)
        text += (f"# camera {camera.name}\n# size_px {camera.size_px[0]} {camera.size_px[1]}\n"
                 f"# pixel_spacing_mm {numbers_text(camera.pixel_spacing_mm)}\n" +
                 rows_text(k @ np.column_stack([rotation, translation])))
    return text
