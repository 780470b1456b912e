# SPDX-License-Identifier: Apache-2.0
"""Errors that the library raises on purpose, with the text that the programs print."""


class Error(Exception):
    """Base of all. `exit_code` is the one with which a program ends on this error."""

    exit_code: int = 6


class InputError(Error, ValueError):
    """Readable but unacceptable input: the text names field, value and constraint."""

    exit_code = 3


class FileError(Error, OSError):
    """A file cannot be parsed, is truncated, fails its checksum or belongs to another CT."""

    exit_code = 4


class NumericError(Error, ArithmeticError):
    """Numerics failed."""

    exit_code = 5
