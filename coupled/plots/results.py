"""The figure of a sweep: its indices, its boundaries, or the figures that it kept."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from coupled.campaign.sweep import SweepResult
from coupled.display import System
from coupled.plots.campaign import draw_sweep
from coupled.plots.saving import with_note
from coupled.plots.sensitivity import draw_sensitivity
from coupled.plots.survival import draw_survival


def draw_result(found: SweepResult, system: System = "si") -> Figure:
    """Draw what a sweep asks for, its figures in the units of a system."""
    asked, said = found.plan.sweep, " ".join(found.remarks)
    if found.indices:
        return with_note(draw_sensitivity(found.indices), said)
    if found.limits:
        drawn = draw_survival(asked.name, found.numeric_keys[0], found.limits)
        return with_note(drawn, said)
    title = f"{asked.name}: flights of {Path(asked.run).stem}"
    return draw_sweep(found.table, found.plan.keys, asked.keep, title, found.remarks, system)
