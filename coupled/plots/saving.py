"""Writing a figure: its formats and reproducible bytes."""

from __future__ import annotations

import textwrap
from functools import lru_cache
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.category import StrCategoryLocator
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, fontManager, get_font
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator

from coupled.errors import InputError, printable
from coupled.files import write_whole

_NOTED = 10  # font size of a title with a note
_LETTERS_per_inch = 10.0  # of a note
_DOTS_per_inch = 130
FORMATS = (".png", ".pdf", ".svg")
BOX = "□"  # replaces a character that no font has
# Common system fonts with the letters that matplotlib's own font lacks.
OTHER_FONTS = (
    *("Noto Sans CJK JP", "Noto Sans CJK SC", "Source Han Sans", "WenQuanYi Zen Hei", "IPAGothic"),
    *("Hiragino Sans", "PingFang SC", "Microsoft YaHei", "Yu Gothic", "MS Gothic", "Malgun Gothic"),
    *("Noto Sans Devanagari", "Noto Sans Thai", "Noto Sans", "Arial Unicode MS"),
)


def check_format(path: Path) -> None:
    """Refuse the path of a figure whose extension is not a known format."""
    if path.suffix.lower() not in FORMATS:
        raise InputError(path, "", f"a figure ends in {', '.join(FORMATS)}")


def make_drawable(figure: Figure) -> None:
    """Replace the characters of a figure's texts that cannot be drawn.

    Control characters become `?`. A letter that the font lacks is drawn in an installed font of
    `OTHER_FONTS`, or else as an empty box.
    """
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        word, fonts = _drawable(text.get_text(), text.get_fontproperties())
        if word != text.get_text():
            text.set_text(word)
        if fonts:
            text.set_fontfamily(fonts)
    for axis in (one for axes in figure.axes for one in (axes.xaxis, axes.yaxis)):
        if not isinstance(axis.get_major_locator(), (FixedLocator, StrCategoryLocator)):
            continue  # numbers, which any font has
        places = axis.get_ticklocs()
        words = axis.get_major_formatter().format_ticks(places.tolist())
        found = [_drawable(str(word), FontProperties()) for word in words]
        if [word for word, _ in found] != words:
            axis.set_ticks(places, labels=[word for word, _ in found])
        if fonts := max((fonts for _, fonts in found), key=len, default=[]):
            axis.set_tick_params(labelfontfamily=fonts)


def _drawable(word: str, font: FontProperties) -> tuple[str, list[str]]:
    """Return a text that can be drawn, and the additional fonts that it needs."""
    plain = printable(word)
    if plain.isascii():
        return plain, []
    lacking = {c for c in plain if c not in "\n\t"} - _letters(fontManager.findfont(font))
    if not lacking:
        return plain, []
    installed = {entry.name: entry.fname for entry in fontManager.ttflist}
    fonts = []
    for name in OTHER_FONTS:
        if name in installed and lacking & _letters(installed[name]):
            fonts.append(name)
            lacking -= _letters(installed[name])
    boxed = "".join(BOX if c in lacking else c for c in plain)
    return boxed, [*font.get_family(), *fonts] if fonts else []


@lru_cache(maxsize=16)
def _letters(file: str) -> frozenset[str]:
    """Return the characters of a font."""
    return frozenset(map(chr, get_font(file).get_charmap()))


def with_note(figure: Figure, note: str) -> Figure:
    """Return a figure with a line of text below its title; unchanged for an empty text."""
    if note:
        width = round(_LETTERS_per_inch * figure.get_size_inches()[0])
        lines = [figure.get_suptitle(), *textwrap.wrap(note, width)]
        figure.suptitle("\n".join(filter(None, lines)), fontsize=_NOTED)
    return figure


def save(figure: Figure, path: Path, note: str = "") -> None:
    """Write a figure atomically; the same figure gives the same bytes on the same machine.

    `note` is a line below the title. Letters in a PDF stay text.
    """
    check_format(path)
    with_note(figure, note)
    make_drawable(figure)
    FigureCanvasAgg(figure)
    kind = path.suffix.lower()[1:]
    no_date: dict[str, Any] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind, {})
    with rc_context({"svg.hashsalt": "coupled", "pdf.fonttype": 42}):
        # Into memory first: on a full disk matplotlib raises many kinds of exceptions.
        drawn = BytesIO()
        figure.savefig(
            drawn, dpi=max(_DOTS_per_inch, figure.get_dpi()), format=kind, metadata=no_date
        )
    write_whole(path, lambda part: part.write_bytes(drawn.getvalue()))


def svg_text(figure: Figure) -> str:
    """Return a figure as SVG with letters as outlines, so that it does not depend on fonts.

    A shaded mesh is a raster image: as outlines it would take some 10 MB.
    """
    for mesh in figure.findobj(QuadMesh):
        mesh.set_rasterized(True)
    FigureCanvasSVG(figure)
    make_drawable(figure)
    made = StringIO()
    with rc_context({"svg.hashsalt": "coupled", "svg.fonttype": "path"}):
        figure.savefig(made, format="svg", metadata={"Date": None})
    return made.getvalue()
