# SPDX-License-Identifier: Apache-2.0
"""This project's rig.toml."""
import numpy as np

from af_programs.errors import InputError

from .geometry import Camera, camera_from_matrix, camera_problems, with_clean_axes
from .rig import StatedCamera, StatedRig, name_problem
from .source import toml_numbers, toml_text
from .toml_table import Table, parse_toml

GEOMETRY = ("source_point", "detector_origin_point", "column_direction", "row_direction")


def is_rig_toml(source):
    return source.has_line("[[camera]]") and not source.has_line("[[case]]")


def read_rig_toml(source, options):
    table = Table(parse_toml(source), f"{source.name}: ")
    stated = StatedRig(isocenter_point=table.vector("isocenter_point", 3), file=source.name)
    for camera in table.tables("camera"):
        stated.cameras.append(StatedCamera(_camera(camera, stated.isocenter_point), has_name=True))
    table.refuse_unknown()
    return stated


def _camera(table, isocenter):
    name, spacing = table.text("name"), table.vector("pixel_spacing_mm", 2)
    if problem := name_problem(name):
        table.fail("name", problem)
    size = table.get("size_px")
    if not isinstance(size, list) or len(size) != 2 or not all(type(side) is int and 0 < side <= 32768 for side in size):
        table.fail("size_px", "must be two whole numbers between 1 and 32768")
    if not spacing.min() > 0:
        table.fail("pixel_spacing_mm", "must be positive")
    distortion = np.zeros(8)
    if "distortion" in table:
        numbers = table.vector("distortion", (4, 5, 8))
        distortion[:len(numbers)] = numbers
    if "projection_matrix" in table:
        for key in GEOMETRY:
            if key in table:
                table.fail(key, "must not be given together with projection_matrix, which already fixes it")
        camera = camera_from_matrix(name, table.matrix("projection_matrix", 3, 4), spacing, size, isocenter)
    else:
        camera = Camera(name, *(table.vector(key, 3) for key in GEOMETRY), spacing, np.array(size))
    camera.distortion = distortion
    table.refuse_unknown()
    for problem in camera_problems(camera):
        raise InputError(f"{table.place}{problem}")
    return with_clean_axes(camera)


def write_rig_toml(rig):
    text = f"isocenter_point = {toml_numbers(rig.isocenter_point)}\n"
    for camera in rig.cameras:
        text += f"\n[[camera]]\nname = {toml_text(camera.name)}\n"
        text += "".join(f"{key} = {toml_numbers(getattr(camera, key))}\n" for key in (*GEOMETRY, "pixel_spacing_mm"))
        text += f"size_px = [{camera.size_px[0]}, {camera.size_px[1]}]\n"
        if camera.distortion.any():
            text += f"distortion = {toml_numbers(camera.distortion[:8 if camera.distortion[5:].any() else 5])}\n"
    return text
