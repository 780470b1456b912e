# SPDX-License-Identifier: Apache-2.0
"""What ends af-convert, with its exit code."""


class ConvertError(Exception):
    exit_code = 6


class InputError(ConvertError):
    """Readable, unacceptable."""
    exit_code = 3


class FileError(ConvertError):
    """Unreadable, damaged, or a file of another kind."""
    exit_code = 4


def shown(text, most=60):
    """The beginning of a text of a file, printable."""
    text = text.encode("utf-8", "backslashreplace").decode("utf-8")
    return "".join(c if c.isprintable() else "?" for c in text[:most])
