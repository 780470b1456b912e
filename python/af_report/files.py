# SPDX-License-Identifier: Apache-2.0
"""Reads tables with their line numbers, and writes files that appear only when whole."""
import csv
import io
import math
import os

from af_programs.errors import FileError


class Row(dict):
    """A line of a CSV that knows its file and line number."""

    where = ""

    def text(self, column):
        if column not in self:
            raise FileError(f"{self.where}: column {column} is missing")
        return self[column]

    def number(self, column):
        """NaN where the cell is empty or says nan."""
        text = self.text(column)
        try:
            return float(text) if text else math.nan
        except ValueError:
            raise FileError(f"{self.where}: {column} = '{text}': must be a number") from None


def rows_of(path):
    """The rows of a CSV one by one. Raises FileError for a missing file, a truncated line or no header."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            reader = csv.reader(file, strict=True)
            header = next(reader, None)
            if not header:
                raise FileError(f"{path}: has no line of column names")
            for cells in reader:
                if len(cells) != len(header):
                    raise FileError(f"{path}:{reader.line_num}: has {len(cells)} cells, the header {len(header)}")
                row = Row(zip(header, cells))
                row.where = f"{path}:{reader.line_num}"
                yield row
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{path}: is no CSV: {error}") from None


def columns_of(path):
    try:
        with open(path, encoding="utf-8", newline="") as file:
            return next(csv.reader(file), [])
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"{path}: {error}") from None


def write_file(path, content):
    """Writes text or bytes, under another name until they are whole."""
    partial = f"{path}.partial"
    try:
        with open(partial, "wb") as file:
            file.write(content.encode("utf-8") if isinstance(content, str) else content)
        os.replace(partial, path)
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}") from None


def csv_text(columns, rows):
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([columns, *rows])
    return text.getvalue()
