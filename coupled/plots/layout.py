"""The layout of a figure for print: which panels, overlaid or side by side, and the size."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.text import Text

from coupled.errors import InputError, nearest
from coupled.units import INCH_m

_INCHES = {"cm": 0.01 / INCH_m, "mm": 0.001 / INCH_m, "in": 1.0}
_LEAST_in, _MOST_in = 1.0, 100.0
_PRINT_dpi = 300
_LARGEST_pt, _SMALLEST_pt, _LETTER = 7.5, 6.0, 0.53  # mean width of a letter over its size
_PAD_in = 0.02
_POINTS_per_inch = 72.0
_THINNEST_pt = 0.6  # least line width
_SIZE = re.compile(r"\s*([0-9.]+)\s*[x×]\s*([0-9.]+)\s*(cm|mm|in)\s*")


@dataclass(frozen=True)
class Layout:
    """The selected panels of a figure (empty: all), whether cases are overlaid, and the size.

    `size_in` is width and height in inches, or None for a size that fits the panels.
    """

    panels: tuple[str, ...] = ()
    overlay: bool = False
    size_in: tuple[float, float] | None = None

    def chosen(self, there: Iterable[str]) -> list[str]:
        """Return the selected panels, or all. Raises InputError for an unknown panel."""
        known = list(there)
        for name in self.panels:
            if name not in known:
                raise InputError("--panels", name, f"no such panel; {nearest(name, known)}")
        return list(dict.fromkeys(self.panels)) or known

    def size(self, width_in: float, height_in: float) -> tuple[float, float]:
        """Return the requested size in inches, or else the default given."""
        return self.size_in or (width_in, height_in)


def layout_of(panels: str = "", overlay: bool = False, size: str = "") -> Layout:
    """Return a layout from text: `panels` separated by commas, `size` as 8.5x6cm.

    Raises InputError for a size without a unit or outside the limits.
    """
    names = tuple(word.strip() for word in panels.split(",") if word.strip())
    if not size:
        return Layout(names, overlay)
    found = _SIZE.fullmatch(size)
    try:
        sides = [float(found[i]) * _INCHES[found[3]] for i in (1, 2)] if found else []
    except ValueError:
        sides = []
    if not sides:
        problem = f"{size!r} is no size; give width x height with cm, mm or in, as 8.5x6cm"
        raise InputError("--size", "", problem)
    if not all(_LEAST_in <= side <= _MOST_in for side in sides):
        raise InputError("--size", "", f"{size} is not within {_LEAST_in:g} to {_MOST_in:g} in")
    return Layout(names, overlay, (sides[0], sides[1]))


def for_print(figure: Figure, layout: Layout) -> Figure:
    """Set fonts and lines for the requested size; without a size the figure stays unchanged.

    Fonts have 6 to 7.5 points, PNG files 300 dots per inch.
    """
    if layout.size_in is None:
        return figure
    figure.set_dpi(_PRINT_dpi)
    width, height = layout.size_in
    scale = min(1.0, math.sqrt(width * height / 40.0))  # relative to 8 by 5 inches
    for text in figure.findobj(Text):
        assert isinstance(text, Text)
        text.set_fontsize(min(_LARGEST_pt, max(_SMALLEST_pt, scale * float(text.get_fontsize()))))
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            size = min(_LARGEST_pt, max(_SMALLEST_pt, 10.0 * scale))
            axis.set_tick_params(labelsize=size, pad=2.0, length=2.0)
            axis.labelpad = 1.0
    for line in figure.findobj(Line2D):
        assert isinstance(line, Line2D)
        line.set_linewidth(max(_THINNEST_pt, scale * line.get_linewidth()))
        line.set_markersize(scale * line.get_markersize())
    for axes in figure.axes:
        _break_labels(axes, width, height)
    engine = figure.get_layout_engine()
    if isinstance(engine, ConstrainedLayoutEngine):
        engine.set(w_pad=_PAD_in, h_pad=_PAD_in)
    title = figure.get_suptitle()
    if title:
        figure.suptitle(_wrap_lines(title.split("\n"), width, _SMALLEST_pt), fontsize=_SMALLEST_pt)
    for legend in list(figure.legends):
        _fit(figure, legend, width)
    return figure


def _break_labels(axes: Axes, width_in: float, height_in: float) -> None:
    """Wrap the title and labels of axes that are longer than the axes."""
    place = axes.get_subplotspec()
    if place is None:
        return
    rows, columns = place.get_gridspec().nrows, place.get_gridspec().ncols
    across = (width_in - 0.3) / columns - 0.25  # without labels and ticks
    up = (height_in - 0.6) / rows - 0.3
    for text, room in ((axes.title, across), (axes.xaxis.label, across), (axes.yaxis.label, up)):
        words = [text.get_text().replace("\n", " ")] if text.get_text() else []
        text.set_text(_wrap_lines(words, max(room, 0.4), float(text.get_fontsize())))
        text.set_linespacing(1.0)


def _wrap_lines(lines: Sequence[str], width_in: float, size_pt: float) -> str:
    """Return lines, wrapped to the width of a figure."""
    letters = max(5, int(width_in * _POINTS_per_inch / (_LETTER * size_pt)))
    return "\n".join(part for line in lines for part in textwrap.wrap(line, letters))


def _fit(figure: Figure, legend: Legend, width_in: float) -> None:
    """Move the legend below the figure, with as many columns as its width has room for."""
    labels = [text.get_text() for text in legend.get_texts()]
    if not labels:
        return
    handles, title = list(legend.legend_handles), legend.get_title().get_text()
    legend.remove()
    each_pt = (max(map(len, labels)) * _LETTER + 4.5) * _SMALLEST_pt  # with its handle
    columns = max(1, min(len(labels), int(width_in * _POINTS_per_inch / each_pt)))
    figure.legend(
        [handle for handle in handles if handle is not None],
        labels,
        loc="outside lower center",
        ncols=columns,
        fontsize=_SMALLEST_pt,
        title=title or None,
        title_fontsize=_SMALLEST_pt,
        frameon=False,
        handlelength=1.8,
        borderpad=0.1,
        labelspacing=0.2,
        columnspacing=1.0,
    )
