# SPDX-License-Identifier: Apache-2.0
"""A file as the formats see it, and the numbers in it."""
import functools
import math
import pathlib
import re

import numpy as np

from af_programs.errors import FileError, InputError, shown

HEAD_BYTES = 4096
MOST_TEXT_BYTES = 8 << 20
_NUMBER = re.compile(r"[-+]?(?:(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|nan|inf(?:inity)?)", re.ASCII | re.IGNORECASE)
_SEPARATORS = re.compile(r"[ \t\r\n,;\[\]]+")
_LINE_END = re.compile(r"\r\n|\r|\n")


class Line:
    """A line that is not empty: its number from 1, its text, and its words between blanks, commas, semicolons, brackets."""

    def __init__(self, number, text):
        self.number, self.text = number, text

    @functools.cached_property
    def words(self):
        return [word for word in _SEPARATORS.split(self.text) if word]


class Source:
    """A file: its first bytes, and all of it as text where it is text ("" otherwise)."""

    def __init__(self, path):
        self.path = pathlib.Path(path)
        self.name = str(path)
        try:
            with open(path, "rb") as file:
                self.head = file.read(HEAD_BYTES)
                is_text = bool(self.head) and all(byte >= 32 or byte in b"\r\n\t" for byte in self.head)
                self.bytes = self.head + file.read(MOST_TEXT_BYTES) if is_text else self.head
        except OSError as error:
            raise FileError(f"{self.name}: cannot be read: {error.strerror}") from error
        if not self.bytes.strip():
            raise FileError(f"{self.name}: is empty")
        if is_text and len(self.bytes) > MOST_TEXT_BYTES:
            raise InputError(f"{self.name}: is a text of more than {MOST_TEXT_BYTES >> 20} MiB: no cameras, no poses")
        self.text = self.bytes.removeprefix(b"\xef\xbb\xbf").decode("utf-8", "surrogateescape") if is_text else ""
        self.lines = lines_of(self.text)

    def limited_text(self, most_bytes):
        """The text, if it is short enough for parsers whose time grows fast."""
        if len(self.text) > most_bytes:
            raise InputError(f"{self.name}: has {len(self.text)} characters, more than {most_bytes} of a file of this kind")
        return self.text

    def place(self, line):
        return f"{self.name}:{line.number}"

    def has_line(self, start):
        return any(line.text.startswith(start) for line in self.lines)


def lines_of(text):
    lines = []
    for number, part in enumerate(_LINE_END.split(text), 1):
        if part := part.strip(" \t"):
            lines.append(Line(number, part))
    return lines


def is_number(word):
    return _NUMBER.fullmatch(word) is not None


def number_of(word, place):
    """A finite number."""
    if not is_number(word):
        raise FileError(f"{place}: '{shown(word, 40)}' is no number")
    value = float(word)
    if not math.isfinite(value):
        raise InputError(f"{place} = {shown(word, 40)}: must be finite")
    return value


def numbers_of(words, place):
    return np.array([number_of(word, place) for word in words])


def line_numbers(source, line, count):
    """Exactly `count` numbers from a line."""
    if len(line.words) != count:
        raise FileError(f"{source.place(line)}: expected {count} numbers, found '{shown(line.text, 100)}'")
    return numbers_of(line.words, source.place(line))


def size_of(numbers, place):
    """The columns and rows of images."""
    for number in numbers:
        if not (1 <= number <= 32768) or number != math.floor(number):
            raise InputError(f"{place} = {number}: the image's size must be a whole number between 1 and 32768")
    return np.array([int(number) for number in numbers])


def number_text(value):
    """The shortest text that is read back to the last bit."""
    return repr(float(value) + 0.0)


def numbers_text(values, between=" "):
    return between.join(number_text(value) for value in np.ravel(values))


def rows_text(matrix, between=" "):
    return "".join(numbers_text(row, between) + "\n" for row in np.atleast_2d(matrix))


def toml_numbers(values):
    return "[" + numbers_text(values, ", ") + "]"


def toml_text(text):
    escaped = "".join("\\" + c if c in '"\\' else c if ord(c) >= 32 and ord(c) != 127 else f"\\u{ord(c):04X}" for c in text)
    return f'"{escaped}"'
