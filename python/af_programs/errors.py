# SPDX-License-Identifier: Apache-2.0
"""Errors that end a program with one line, and their exit codes."""


class ProgramError(Exception):
    exit_code = 6


class InputError(ProgramError):
    """Readable, unacceptable."""
    exit_code = 3


class FileError(ProgramError):
    """The file is unreadable, damaged or of another kind."""
    exit_code = 4


def shown(text, most=60):
    """The beginning of a text from a file, made printable."""
    text = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return "".join(c if c.isprintable() else "?" for c in text[:most])
