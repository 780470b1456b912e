# SPDX-License-Identifier: Apache-2.0
"""MayaCam files, with one camera each. They come from the calibration of biplane videoradiography (XROMM, XMALab) for
Autoscoper. Neither kind states its unit of length or the pixels' spacing."""
import math

import numpy as np

from af_programs.errors import FileError, InputError, shown

from .geometry import angles_zyx, camera_from_pinhole, pinhole_of, rotation_zyx
from .rig import one_camera
from .source import is_number, line_numbers, numbers_text, rows_text, size_of


def is_mayacam2(source):
    return bool(source.lines) and source.lines[0].text == "image size"


def read_mayacam2(source, options):
    """(column, row, 1) ~ K (R x + t), as in OpenCV: row 0 is on top, and integers are pixel centres."""
    lines = list(source.lines)

    def take(title, rows, columns):
        at = next((i for i, line in enumerate(lines) if line.text == title), None)
        if at is None:
            raise FileError(f"{source.name}: the line '{title}' is missing")
        if len(lines) <= at + rows:
            raise FileError(f"{source.name}: truncated: '{title}' needs {rows} lines of numbers")
        matrix = np.array([line_numbers(source, line, columns) for line in lines[at + 1:at + 1 + rows]])
        del lines[at:at + 1 + rows]
        return matrix
    size = size_of(take("image size", 1, 2)[0], f"{source.name}: image size")
    k, rotation, translation = take("camera matrix", 3, 3), take("rotation", 3, 3), take("translation", 3, 1)[:, 0]
    if lines:
        raise InputError(f"{source.place(lines[0])}: line = '{shown(lines[0].text)}': is not known in a MayaCam 2 file")
    return one_camera(source, camera_from_pinhole(source.name, k, rotation, translation, 1.0, size), has_spacing=False)


def write_mayacam2(rig):
    camera = rig.cameras[0]
    k, rotation, translation = pinhole_of(camera)
    return (f"image size\n{camera.size_px[0]},{camera.size_px[1]}\n\ncamera matrix\n{rows_text(k, ',')}\nrotation\n"
            f"{rows_text(rotation, ',')}\ntranslation\n{rows_text(translation[:, None], ',')}")


def is_mayacam1(source):
    return len(source.lines) == 5 and all(
        len(line.words) == 3 and "," in line.text and all(is_number(word) for word in line.words) for line in source.lines)


def read_mayacam1(source, options):
    """Line 1 is the source. Line 2 has degrees about the camera's own axes x, y, z; it is turned about z first, then y,
    then x. It looks along -z, and y is up. Line 3 is the place of the film in Maya. Line 4 has u0 and v0 (pixels from 1, v0
    from the lowest row upwards) and the focal length in pixels, of either sign. Line 5 is the film's scale in columns and
    rows; 0 means 1024."""
    if len(source.lines) != 5:
        raise FileError(f"{source.name}: lines: expected 5 lines of 3 numbers, found {len(source.lines)}")
    place, angles, _, middle, film = (line_numbers(source, line, 3) for line in source.lines)
    size = size_of(np.where(film[1:] == 0, 1024, film[1:]), source.place(source.lines[4]))
    focal = abs(middle[2])
    k = np.array([[focal, 0, middle[0] - 1], [0, focal, size[1] - middle[1]], [0, 0, 1]])
    rotation = rotation_zyx(np.radians(angles)).T * np.array([[1], [-1], [-1]])
    return one_camera(source, camera_from_pinhole(source.name, k, rotation, -rotation @ place, 1.0, size), has_spacing=False)


def write_mayacam1(rig):
    camera = rig.cameras[0]
    scale, row_spacing = camera.pixel_spacing_mm
    if camera.is_mirrored or abs(scale - row_spacing) > 1e-9 * scale:
        raise InputError(f"camera '{camera.name}': MayaCam 1 cannot state a mirrored camera or pixels that are not square")
    k, rotation, _ = pinhole_of(camera)
    columns, rows = camera.size_px
    u0, v0 = k[0, 2] + 1, rows - k[1, 2]
    angles = [math.degrees(angle) for angle in angles_zyx(rotation.T * np.array([1, -1, -1]))]
    lines = [camera.source_point, angles, [scale * (0.5 * columns - u0), scale * (0.5 * rows - v0), -scale * k[0, 0]],
             [u0, v0, -k[0, 0]]]
    return "".join(numbers_text(line, ",") + "\n" for line in lines) + f"{numbers_text([scale])},{columns},{rows}\n"
