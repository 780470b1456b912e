# SPDX-License-Identifier: Apache-2.0
"""The parts of a page. page.html knows how each is written. Texts are escaped unless they are Markup."""
import base64
from dataclasses import dataclass, field

from markupsafe import Markup


@dataclass
class Table:
    """A table that readers may sort by any column. A title that begins with '#' marks a column of numbers, aligned right."""

    titles: list
    rows: list
    caption: str = ""
    kind = "table"

    @property
    def columns(self):
        return [(title.lstrip("#"), "number" if title.startswith("#") else "") for title in self.titles]


@dataclass
class Figure:
    content: bytes
    type: str
    alternative: str
    caption: str
    links: list = field(default_factory=list)
    is_wide: bool = False
    kind = "figure"

    @property
    def source(self):
        return Markup("data:%s;base64,%s") % (self.type, base64.b64encode(self.content).decode())


@dataclass
class Figures:
    figures: list
    kind = "figures"


@dataclass
class Text:
    """A paragraph, or a heading within a section."""

    text: str
    style: str = ""
    kind = "text"


@dataclass
class Items:
    items: list
    kind = "items"


@dataclass
class Terms:
    """(term, what it means) pairs."""

    pairs: list
    kind = "terms"


@dataclass
class Section:
    anchor: str
    title: str
    blocks: list


def heading(text):
    return Text(text, "h3")


def strong(text):
    return Markup("<strong>%s</strong>") % text
