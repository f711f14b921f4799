"""The figure of a sweep: Sobol indices, stability boundaries, or figures of merit."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from coupled.campaign.sweep import SweepResult
from coupled.campaign.sweepfile import SweepFile
from coupled.display import System
from coupled.errors import InputError
from coupled.plots.campaign import draw_sweep
from coupled.plots.layout import Layout, for_print
from coupled.plots.saving import with_note
from coupled.plots.sensitivity import draw_sensitivity
from coupled.plots.survival import draw_survival

_USUAL = Layout()


def draw_result(found: SweepResult, system: System = "si", layout: Layout = _USUAL) -> Figure:
    """Draw the result of a sweep, in the units of `system`.

    Raises InputError if `layout` names panels of indices or boundaries.
    """
    asked, said = found.plan.sweep, " ".join(found.remarks)
    check_layout(asked, layout)
    if found.indices or found.limits:
        if found.indices:
            drawn = draw_sensitivity(found.indices)
        else:
            drawn = draw_survival(asked.name, found.numeric_keys[0], found.limits)
        if layout.size_in is not None:
            drawn.set_size_inches(*layout.size_in)
        return for_print(with_note(drawn, said), layout)
    title = f"{asked.name}: flights of {Path(asked.run).stem}"
    rows, keys = found.table, found.plan.keys
    return draw_sweep(rows, keys, asked.keep, title, found.remarks, system, layout)


def check_layout(asked: SweepFile, layout: Layout) -> None:
    """Refuse panels that the figure of a sweep does not have, before the sweep is flown."""
    if asked.method == "sensitivity" or asked.survive:
        if layout.panels or layout.overlay:
            key = "--panels" if layout.panels else "--overlay"
            problem = "is for figures of a sweep; this one draws its indices or boundaries"
            raise InputError(key, "", problem)
        return
    layout.chosen(asked.keep)
