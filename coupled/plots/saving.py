"""Writing a figure: its formats, and the same bytes for the same figure."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from coupled.errors import InputError
from coupled.files import write_whole

FORMATS = (".png", ".pdf", ".svg")


def check_format(path: Path) -> None:
    """Refuse a figure's path whose extension names no format."""
    if path.suffix.lower() not in FORMATS:
        raise InputError(path, "", f"a figure ends in {', '.join(FORMATS)}")


def save(figure: Figure, path: Path) -> None:
    """Write a figure, whole; the same figure gives the same bytes."""
    check_format(path)
    FigureCanvasAgg(figure)
    kind = path.suffix.lower()[1:]
    no_date: dict[str, Any] = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind, {})
    with rc_context({"svg.hashsalt": "coupled"}):
        write_whole(path, lambda part: figure.savefig(part, dpi=130, format=kind, metadata=no_date))


def svg_text(figure: Figure) -> str:
    """Return a figure as SVG, its letters as outlines: it looks alike wherever it is shown."""
    FigureCanvasSVG(figure)
    made = StringIO()
    with rc_context({"svg.hashsalt": "coupled", "svg.fonttype": "path"}):
        figure.savefig(made, format="svg", metadata={"Date": None})
    return made.getvalue()
