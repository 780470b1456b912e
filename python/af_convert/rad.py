# SPDX-License-Identifier: Apache-2.0
"""The .rad text beside a raw projection that xReg takes: size, pixel spacing, where the source is, and TPosition. TPosition
takes the detector's frame to the world (mm). That frame has its origin at the centre of pixel (0, 0), x along columns, y
along rows and z to the source."""
import numpy as np

from af_programs.errors import FileError, shown

from .geometry import Camera, rigid, transform
from .rig import one_camera, require, unread_note
from .source import line_numbers, lines_of, numbers_of, numbers_text, rows_text, size_of

SIZE, STEP, SOURCE, POSITION = "Size[pixels]:", "Step[mm]:", "SourcePosition[mm]:", "TPosition:"
KEYS = (SIZE, STEP, SOURCE, POSITION, "DataType:")


def is_rad(source):
    return source.has_line(SOURCE) and source.has_line(POSITION)


def read_rad(source, options):
    def index_of(key):
        found = [i for i, line in enumerate(source.lines) if line.text.startswith(key)]
        if len(found) != 1:
            raise FileError(f"{source.name}: '{key}' is {'there twice' if found else 'missing'}")
        return found[0]

    def numbers(key, count):
        line = source.lines[index_of(key)]
        words = [word for part in lines_of(line.text[len(key):]) for word in part.words]
        if len(words) != count:
            raise FileError(f"{source.place(line)}: expected {count} numbers, found '{shown(line.text)}'")
        return numbers_of(words, source.place(line))
    first = index_of(POSITION) + 1
    if first + 4 > len(source.lines):
        raise FileError(f"{source.name}: truncated: TPosition has four lines")
    matrix = rigid([line_numbers(source, line, 4) for line in source.lines[first:first + 4]], f"{source.name}: TPosition")
    camera = Camera("", numbers(SOURCE, 3), matrix[:3, 3], matrix[:3, 0], matrix[:3, 1], numbers(STEP, 2),
                    size_of(numbers(SIZE, 2), f"{source.name}: Size"))
    require((camera.source_point - camera.detector_origin_point) @ matrix[:3, 2] > 0,
            f"{source.name}: the z axis of TPosition must point from the detector to the source")
    stated = one_camera(source, camera)
    others = source.lines[:first] + source.lines[first + 4:]
    stated.notes += unread_note(source, [shown(line.text.partition(":")[0]) for line in others if not line.text.startswith(KEYS)])
    return stated


def write_rad(rig):
    camera = rig.cameras[0]
    require(camera.is_mirrored, f"camera '{camera.name}': a .rad file states mirrored cameras only: its z axis, columns x rows, "
            "points to the source")
    matrix = transform(np.column_stack([camera.column_direction, camera.row_direction, -camera.beam_direction]),
                       camera.detector_origin_point)
    return (f"{SIZE} {camera.size_px[0]} {camera.size_px[1]}\n{STEP} {numbers_text(camera.pixel_spacing_mm)}\nDataType: float\n"
            f"{SOURCE} {numbers_text(camera.source_point)}\n{POSITION}\n{rows_text(matrix)}")
