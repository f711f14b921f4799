"""A report as data, and as one HTML file: verdict, tables, figures, and what made it.

The file stands alone: figures are inline SVG, nothing is loaded from anywhere, and a policy in its
head forbids it. The same results give the same bytes. It prints on A4 and on Letter.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import ClassVar

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from coupled.errors import printable
from coupled.reports.inline import inline_svg
from coupled.tables.table import Table, Tone

_MINUS = re.compile(r"(?<![\w.)-])-(?=\d)")
_UNIT = re.compile(r"(?<=\d) (?=(%|N|m|mm|cm|s|ms|Hz|kPa|Pa|V|kt|lb|in|ft|°)\b|%|°)")


@dataclass(frozen=True)
class Drawing:
    """A figure as matplotlib's SVG, with what it shows."""

    kind: ClassVar[str] = "drawing"
    svg: str
    caption: str


@dataclass(frozen=True)
class Text:
    """Sentences, a paragraph each."""

    kind: ClassVar[str] = "text"
    lines: tuple[str, ...]


Block = Table | Drawing | Text


@dataclass(frozen=True)
class Section:
    """A part of a report under a head; `own_page`: it begins a page when printed."""

    head: str
    blocks: tuple[Block, ...]
    own_page: bool = False


@dataclass(frozen=True)
class Verdict:
    """What a reader is to take away, in a sentence, and what qualifies it."""

    text: str
    tone: Tone = "plain"
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class InputFile:
    """A file that went in: its name, its hash, and its text where people read it."""

    name: str
    sha256: str
    text: str = ""


@dataclass(frozen=True)
class Made:
    """What made a report: the command, the versions of what ran, and the files that went in."""

    command: str
    versions: tuple[tuple[str, str], ...]
    inputs: tuple[InputFile, ...]


@dataclass(frozen=True)
class Cover:
    """The first page of a document that is filed: what it is of, in rows of name and value."""

    rows: tuple[tuple[str, str], ...]
    signatures: tuple[str, ...] = ()


@dataclass(frozen=True)
class Report:
    """A command's result for people: `kind` is what was done, `title` of what."""

    kind: str
    title: str
    verdict: Verdict
    sections: tuple[Section, ...]
    settings: tuple[tuple[str, str], ...]
    made: Made
    cover: Cover | None = None


def render(report: Report) -> str:
    """Return a report as one HTML file."""
    sections = [(section, list(_blocks(report, section))) for section in report.sections]
    return _templates().get_template("report.html").render(report=report, sections=sections) + "\n"


def render_part(report: Report, most: int) -> str:
    """Return a report's verdict and its first `most` sections as a part of another page.

    Its styles act within it only. Its figures' ids are of their content: several parts on one page
    do not share them.
    """
    text = "".join(b.svg for s in report.sections for b in s.blocks if isinstance(b, Drawing))
    prefix = f"c{hashlib.sha256(text.encode()).hexdigest()[:12]}"
    sections = [(s, list(_blocks(report, s, prefix))) for s in report.sections[:most]]
    return _templates().get_template("part.html").render(report=report, sections=sections) + "\n"


def _blocks(
    report: Report, section: Section, prefix: str = ""
) -> Iterator[tuple[Block, int, Markup]]:
    """Yield a section's blocks; with each figure its number in the report, and its SVG."""
    drawings = [b for s in report.sections for b in s.blocks if isinstance(b, Drawing)]
    for block in section.blocks:
        if isinstance(block, Drawing):
            number = next(i for i, one in enumerate(drawings, 1) if one is block)
            yield block, number, Markup(inline_svg(block.svg, f"{prefix}f{number}-", block.caption))
        else:
            yield block, 0, Markup()


def typeset(text: str) -> str:
    """Return text with a true minus before numbers, and no line's end between number and unit."""
    return _UNIT.sub("\u00a0", _MINUS.sub("−", text))


def _shown(value: object) -> object:
    """Return what a template shows: a user's text without what a browser would act on.

    Control characters, and marks that turn the direction of writing, become `?`.
    """
    return printable(value) if type(value) is str else value


@cache
def _templates() -> Environment:
    environment = Environment(
        loader=PackageLoader("coupled.reports", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_shown,
    )
    # Markup, so that `_shown` leaves its spaces that do not break.
    environment.filters["typeset"] = lambda text: escape(typeset(printable(text)))
    return environment
