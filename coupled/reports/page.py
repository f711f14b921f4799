"""A report as data, and as one HTML file: verdict, tables, figures, and provenance.

The file is self-contained: figures are inline SVG, nothing is loaded, and a content security policy
forbids it. The same results give the same bytes. It prints on A4 and on Letter.
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
    """A figure as matplotlib's SVG, with a caption."""

    kind: ClassVar[str] = "drawing"
    svg: str
    caption: str


@dataclass(frozen=True)
class Text:
    """Sentences, one paragraph each."""

    kind: ClassVar[str] = "text"
    lines: tuple[str, ...]


Block = Table | Drawing | Text


@dataclass(frozen=True)
class Section:
    """A section of a report with a heading; `own_page` starts a new page in print."""

    head: str
    blocks: tuple[Block, ...]
    own_page: bool = False


@dataclass(frozen=True)
class Verdict:
    """The main result in one sentence, and remarks on it."""

    text: str
    tone: Tone = "plain"
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class InputFile:
    """An input file: its name, its hash, and its text if it is a text file."""

    name: str
    sha256: str
    text: str = ""


@dataclass(frozen=True)
class Provenance:
    """The provenance of a report: the command, software versions, and input files."""

    command: str
    versions: tuple[tuple[str, str], ...]
    inputs: tuple[InputFile, ...]


@dataclass(frozen=True)
class Cover:
    """The cover of a document: its subject, in rows of name and value."""

    rows: tuple[tuple[str, str], ...]
    signatures: tuple[str, ...] = ()


@dataclass(frozen=True)
class Report:
    """The report of a command; `kind` is the kind of analysis, `title` its subject."""

    kind: str
    title: str
    verdict: Verdict
    sections: tuple[Section, ...]
    settings: tuple[tuple[str, str], ...]
    made: Provenance
    cover: Cover | None = None


def render(report: Report) -> str:
    """Return a report as one HTML file."""
    sections = [(section, list(_blocks(report, section))) for section in report.sections]
    return _templates().get_template("report.html").render(report=report, sections=sections) + "\n"


def render_part(report: Report, most: int) -> str:
    """Return the verdict and the first `most` sections of a report as a part of another page.

    The styles apply within the part only. The ids of figures are hashes of their content, so that
    several parts on one page do not share ids.
    """
    text = "".join(b.svg for s in report.sections for b in s.blocks if isinstance(b, Drawing))
    prefix = f"c{hashlib.sha256(text.encode()).hexdigest()[:12]}"
    sections = [(s, list(_blocks(report, s, prefix))) for s in report.sections[:most]]
    return _templates().get_template("part.html").render(report=report, sections=sections) + "\n"


def _blocks(
    report: Report, section: Section, prefix: str = ""
) -> Iterator[tuple[Block, int, Markup]]:
    """Yield the blocks of a section, with the number and the SVG of each figure."""
    drawings = [b for s in report.sections for b in s.blocks if isinstance(b, Drawing)]
    for block in section.blocks:
        if isinstance(block, Drawing):
            number = next(i for i, one in enumerate(drawings, 1) if one is block)
            yield block, number, Markup(inline_svg(block.svg, f"{prefix}f{number}-", block.caption))
        else:
            yield block, 0, Markup()


def typeset(text: str) -> str:
    """Return text with minus signs before numbers, and no line break between number and unit."""
    return _UNIT.sub("\u00a0", _MINUS.sub("−", text))


def _shown(value: object) -> object:
    """Return a value as a template shows it, without characters that a browser would interpret.

    Control characters, and characters that change the direction of writing, become `?`.
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
    # Markup, so that `_shown` keeps its non-breaking spaces.
    environment.filters["typeset"] = lambda text: escape(typeset(printable(text)))
    return environment
