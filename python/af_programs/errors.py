# SPDX-License-Identifier: Apache-2.0
"""What ends a program with one line, and its exit code."""


class ProgramError(Exception):
    exit_code = 6


class InputError(ProgramError):
    """Readable, unacceptable."""
    exit_code = 3


class FileError(ProgramError):
    """Unreadable, damaged, or a file of another kind."""
    exit_code = 4


def shown(text, most=60):
    """The beginning of a text of a file, printable."""
    text = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return "".join(c if c.isprintable() else "?" for c in text[:most])
