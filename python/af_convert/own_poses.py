# SPDX-License-Identifier: Apache-2.0
"""The project's own formats of a pose: room_from_ct as JSON, TOML, plain numbers and CSV."""
import csv
import json

import numpy as np

from af_programs.errors import FileError, InputError, shown

from .geometry import rigid, rotation_zyx, transform
from .rig import require, unread_note
from .source import is_number, lines_of, number_of, number_text, numbers_of, rows_text, toml_numbers
from .toml_table import Table, parse_toml

KEY = "room_from_ct"
PARAMETERS = ["rx_deg", "ry_deg", "rz_deg", "tx_mm", "ty_mm", "tz_mm"]


def is_json(source):
    return source.text.lstrip().startswith("{")


def read_json(source, context):
    try:
        values = json.loads(source.text)
    except (ValueError, RecursionError) as error:
        raise FileError(f"{source.name}: is not JSON: {shown(str(error), 100)}") from error
    require(KEY in values, f'{source.name}: has no "{KEY}"')
    pose = Table(values, f"{source.name}: ").matrix(KEY, 4, 4)
    # A result.json states its format, so a file without one is not this project's.
    unread = [] if "format" in values else [shown(key) for key in values if key != KEY]
    return [(1, rigid(pose, f"{source.name}: {KEY}"))], unread_note(source, unread)


def is_toml(source):
    return source.has_line(KEY) or (source.path.suffix == ".toml" and bool(source.text))


def read_toml(source, context):
    table = Table(parse_toml(source), f"{source.name}: ")
    pose = rigid(table.matrix(KEY, 4, 4), f"{source.name}: {KEY}")
    return [(1, pose)], unread_note(source, table.unknown())


def write_toml(poses, context):
    return f"{KEY} = [\n" + "".join(f"  {toml_numbers(row)},\n" for row in poses[0]) + "]\n"


def _uncommented(source):
    return [word for line in source.lines for part in lines_of(line.text.partition("#")[0]) for word in part.words]


def is_plain(source):
    words = _uncommented(source)
    return bool(words) and is_number(words[0])


def read_plain(source, context):
    """Numbers row by row. A # begins a comment, up to the end of its line."""
    words = _uncommented(source)
    if len(words) != 16:
        raise FileError(f"{source.name}: pose: expected 16 numbers of {KEY}, row by row, found {len(words)}")
    return [(1, rigid(numbers_of(words, source.name).reshape(4, 4), source.name))], []


def write_plain(poses, context):
    return rows_text(poses[0])


def _matrix_columns(rows):
    return [f"m{row}{column}" for row in range(rows) for column in range(4)]


def is_csv(source):
    header = source.text.partition("\n")[0]
    return "rx_deg" in header or "m00" in header


def _records(source):
    """The header, and (line, fields) below it. If the header has semicolons and no comma, semicolons separate the fields
    and numbers may have a decimal comma, because spreadsheets in some countries write so."""
    text = source.text
    header = text.partition("\n")[0]
    has_semicolons = ";" in header and "," not in header
    reader = csv.reader(text.splitlines(), delimiter=";" if has_semicolons else ",", strict=True)
    records = []
    try:
        for fields in reader:
            if any(field.strip() for field in fields):
                fields = [field.strip() for field in fields]
                records.append((reader.line_num, [field.replace(",", ".") for field in fields] if has_semicolons else fields))
    except csv.Error as error:
        raise FileError(f"{source.name}:{reader.line_num}: broken CSV: {error}") from error
    columns = records[0][1]
    for column in columns:
        if columns.count(column) > 1:
            raise FileError(f"{source.name}:1: column '{shown(column)}' is there twice")
    for line, fields in records[1:]:
        if len(fields) != len(columns):
            raise FileError(f"{source.name}:{line}: fields: expected {len(columns)}, found {len(fields)}")
    return columns, records[1:]


def read_csv(source, context):
    columns, records = _records(source)
    require(records, f"{source.name}: has no poses below its header")
    # A matrix needs no frame, so it is preferred where a file has both.
    rows = next((rows for rows in (4, 3) if set(_matrix_columns(rows)) <= set(columns)), 0)
    read = _matrix_columns(rows) if rows else PARAMETERS
    missing = ", ".join(column for column in read if column not in columns)
    require(not missing, f"{source.name}:1: has no column {missing} (wanted: {', '.join(PARAMETERS)}, or m00 ... m23)")
    frame = None if rows else context.frame(f"{source.name}: rx_deg ... tz_mm are relative to a nominal pose")
    at = [columns.index(column) for column in read]
    index = columns.index("start_index") if "start_index" in columns else None
    poses = []
    for number, (line, fields) in enumerate(records, 1):
        place = f"{source.name}:{line}"
        values = []
        for i in at:
            try:
                values.append(number_of(fields[i], f"{place}: {columns[i]}"))
            except InputError as error:
                raise FileError(str(error)) from error
        pose = transform(np.eye(3), np.zeros(3))
        if rows:
            pose[:rows] = np.reshape(values, (rows, 4))
        else:
            pose = frame.pose(values)
        if index is not None:
            number = number_of(fields[index], f"{place}: start_index") + 1
            require(number == int(number) >= 1, f"{place}: start_index = {fields[index]}: must be a whole number, at least 0")
        poses.append((int(number), rigid(pose, place)))
    used = read + (["start_index"] if index is not None else [])
    return poses, unread_note(source, [shown(column) for column in columns if column not in used])


def write_csv(poses, context, numbers):
    """Adds start_index if rows or frames of the file had no pose, so that the others keep their places."""
    is_whole = numbers == list(range(1, len(numbers) + 1))
    text = ",".join(([] if is_whole else ["start_index"]) + _matrix_columns(3)) + "\n"
    for number, pose in zip(numbers, poses):
        cells = [number_text(value) for value in pose[:3].ravel()]
        text += ",".join(([] if is_whole else [str(number - 1)]) + cells) + "\n"
    return text


class Frame:
    """The origin of six numbers: R0, c and r in x_room = r + t + Rz Ry Rx R0 (x - c)."""

    def __init__(self, nominal, center_ct_mm):
        self.rotation, self.center = nominal[:3, :3], np.asarray(center_ct_mm)
        self.room = (nominal @ np.append(self.center, 1))[:3]

    def pose(self, values):
        rotation = rotation_zyx(np.radians(values[:3])) @ self.rotation
        return transform(rotation, self.room + values[3:] - rotation @ self.center)
