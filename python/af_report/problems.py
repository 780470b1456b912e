# SPDX-License-Identifier: Apache-2.0
"""Errors that end the program with one line and a code (0 done, 2 usage, 3 unacceptable, 4 unreadable)."""


class ReportError(Exception):
    code = 6


class Unacceptable(ReportError):
    """Input that can be read and is not what is needed."""

    code = 3


class Unreadable(ReportError):
    """A file that is missing, damaged or not of this kind."""

    code = 4
