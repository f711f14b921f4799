"""The figures of a diagnosis: the ladder, the chain of stages, the effect's signature, curves."""

from __future__ import annotations

from matplotlib.figure import Figure

from coupled.display import System
from coupled.gap.findings.diagnosis import Diagnosis
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
CURVES = {"curves.png": draw_curves}  # drawn only if there are any


def draw_diagnosis(diagnosis: Diagnosis, system: System = "si") -> dict[str, Figure]:
    """Draw a diagnosis in the units of a system: the figures by their files' names."""
    view = View(diagnosis, system)
    drawn = FIGURES | (CURVES if diagnosis.curves else {})
    return {name: draw(view) for name, draw in drawn.items()}
