"""The figures of a diagnosis: the ladder, the chain of stages, the effect's signature, curves."""

from __future__ import annotations

from collections.abc import Iterable

from matplotlib.figure import Figure

from coupled.display import System
from coupled.gap.findings.diagnosis import Diagnosis, PartDiagnosis
from coupled.plots.chain import draw_stages
from coupled.plots.curves import draw_curves
from coupled.plots.gapview import View
from coupled.plots.ladder import draw_ladder
from coupled.plots.signatures import draw_signature

FIGURES = {
    "ladder.png": draw_ladder,
    "stages.png": draw_stages,
    "signature.png": draw_signature,
}
CURVES = "curves.png"  # drawn only if there are any


def drawn_parts(diagnosis: Diagnosis, system: System = "si") -> dict[str, dict[str, Figure]]:
    """Draw the parts with a gap, or all if none has one: figures by their names, by part."""

    def drawn(part: PartDiagnosis) -> dict[str, Figure]:
        figures = FIGURES | ({CURVES: draw_curves} if part.curves else {})
        return {name: draw(View(part, system)) for name, draw in figures.items()}

    return {part.control: drawn(part) for part in shown_parts(diagnosis)}


def draw_diagnosis(diagnosis: Diagnosis, system: System = "si") -> dict[str, Figure]:
    """Draw a diagnosis in the units of a system: the figures by their files' names.

    Of several controls the names start with the part: `column-ladder.png`, `airframe-stages.png`.
    """
    several = len(diagnosis.parts) > 1
    return {
        file_of(name, part if several else ""): figure
        for part, drawn in drawn_parts(diagnosis, system).items()
        for name, figure in drawn.items()
    }


def figure_files(parts: Iterable[str]) -> list[str]:
    """Return the names of the files that figures of parts may have, "" for the only one."""
    return [file_of(name, part) for part in parts for name in (*FIGURES, CURVES)]


def file_of(name: str, part: str) -> str:
    """Return the name of the file of a part's figure."""
    return f"{part}-{name}" if part else name


def shown_parts(diagnosis: Diagnosis) -> list[PartDiagnosis]:
    """Return the parts of a diagnosis that have a gap, or all if none has one."""
    parts = [part for part in diagnosis.parts if part.verdict != "no_gap"]
    return parts or list(diagnosis.parts)
