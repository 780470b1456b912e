# SPDX-License-Identifier: Apache-2.0
"""The values in TOML texts, by key."""
import math
import tomllib

import numpy as np

from af_programs.errors import FileError, InputError, shown

MOST_BYTES = 4 << 20
REQUIRED = object()


def parse_toml(source):
    try:
        return tomllib.loads(source.limited_text(MOST_BYTES).replace("\r\n", "\n"))
    except (tomllib.TOMLDecodeError, RecursionError, ValueError, OverflowError) as error:
        raise FileError(f"{source.name}: is not valid TOML: {shown(str(error), 200)}") from error


class Table:
    """A table whose keys are taken one by one. refuse_unknown() names those that were not taken."""

    def __init__(self, values, place):
        self.values, self.place, self.known = values, place, set()

    def __contains__(self, key):
        return key in self.values

    def fail(self, key, constraint):
        value = f" = {shown(str(self.values[key]))}" if key in self.values else ""
        raise InputError(f"{self.place}{key}{value}: {constraint}")

    def get(self, key, default=REQUIRED):
        self.known.add(key)
        if key not in self.values:
            if default is REQUIRED:
                raise InputError(f"{self.place}{key} is missing")
            return default
        return self.values[key]

    def text(self, key, default=REQUIRED):
        value = self.get(key, default)
        if key in self and not isinstance(value, str):
            self.fail(key, "must be a text")
        return value

    def number(self, key, default=REQUIRED):
        value = self.get(key, default)
        return self._number(key, value) if key in self else value

    def _number(self, key, value):
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            self.fail(key, "must be a number")
        try:
            value = float(value)
        except OverflowError:
            value = math.inf
        if not math.isfinite(value):
            self.fail(key, "must be finite")
        return value

    def integer(self, key, low, high, default=REQUIRED):
        value = self.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
            self.fail(key, f"must be a whole number between {low} and {high}")
        return value

    def vector(self, key, counts, default=REQUIRED):
        """A list of numbers. `counts` holds the permitted lengths."""
        value = self.get(key, default)
        if key not in self:
            return value
        counts = counts if isinstance(counts, tuple) else (counts,)
        if not isinstance(value, list) or len(value) not in counts:
            self.fail(key, "must be a list of " + " or ".join(map(str, counts)) + " numbers")
        return np.array([self._number(key, number) for number in value])

    def matrix(self, key, rows, columns, default=REQUIRED):
        """Lists of numbers. If `rows` is None, there may be any number of rows, but at least one."""
        value = self.get(key, default)
        if key not in self:
            return value
        if (not isinstance(value, list) or not value or (rows is not None and len(value) != rows) or
                not all(isinstance(row, list) and len(row) == columns for row in value)):
            self.fail(key, f"must be {rows or 'lists'} rows of {columns} numbers")
        return np.array([[self._number(key, number) for number in row] for row in value])

    def tables(self, key):
        value = self.get(key)
        if not isinstance(value, list) or not value or not all(isinstance(one, dict) for one in value):
            self.fail(key, f"must be tables [[{key}]]")
        return [Table(one, f"{self.place}{key}[{i}].") for i, one in enumerate(value)]

    def unknown(self):
        return [shown(key) for key in self.values if key not in self.known]

    def refuse_unknown(self):
        for key in self.unknown():
            raise InputError(f"{self.place}{key}: is no known key")
