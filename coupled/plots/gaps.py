"""The figures of a diagnosis: ladder, stages, signatures and curves."""

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
CURVES = "curves.png"  # drawn only if the diagnosis has curves


def draw_parts(diagnosis: Diagnosis, system: System = "si") -> dict[str, dict[str, Figure]]:
    """Return the figures of each part with a gap, or of all parts if none has one, by file name."""

    def drawn(part: PartDiagnosis) -> dict[str, Figure]:
        figures = FIGURES | ({CURVES: draw_curves} if part.curves else {})
        return {name: draw(View(part, system)) for name, draw in figures.items()}

    return {part.control: drawn(part) for part in shown_parts(diagnosis)}


def draw_diagnosis(diagnosis: Diagnosis, system: System = "si") -> dict[str, Figure]:
    """Draw a diagnosis in the units of `system`: the figures by file name.

    With several controls the names begin with the part: `column-ladder.png`, `airframe-stages.png`.
    """
    several = len(diagnosis.parts) > 1
    return {
        figure_file(name, part if several else ""): figure
        for part, drawn in draw_parts(diagnosis, system).items()
        for name, figure in drawn.items()
    }


def figure_files(parts: Iterable[str]) -> list[str]:
    """Return the file names that the figures of parts can have; the only part is ""."""
    return [figure_file(name, part) for part in parts for name in (*FIGURES, CURVES)]


def figure_file(name: str, part: str) -> str:
    """Return the file name of a figure of a part."""
    return f"{part}-{name}" if part else name


def shown_parts(diagnosis: Diagnosis) -> list[PartDiagnosis]:
    """Return the parts of a diagnosis that have a gap, or all parts if none has one."""
    parts = [part for part in diagnosis.parts if part.verdict != "no_gap"]
    return parts or list(diagnosis.parts)
