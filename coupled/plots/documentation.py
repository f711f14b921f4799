"""Figures of a calibration and of a force documentation, in SI with a second scale in US units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from coupled.calibration.qualification import Issue, Kind
from coupled.display import System, in_system
from coupled.files import write_whole
from coupled.plots.checks import draw_releases, draw_static_checks
from coupled.plots.cover import draw_check_table, draw_cover
from coupled.plots.pages import (
    BLUE,
    GRAY,
    GREEN,
    ORANGE,
    deflection_shown,
    leg_names,
    panels,
    pressure,
    title,
    with_legend,
)
from coupled.plots.readings import draw_readings
from coupled.plots.saving import save
from coupled.record.channels import ControlName
from coupled.rig.guesses import guess_note
from coupled.units import POUND_N, INCH_m

if TYPE_CHECKING:
    from coupled.calibration.documentation import Documentation
    from coupled.calibration.result import CalibrationResult


def _add_pounds_axis(axes: Any) -> None:
    """Add an axis in pounds on the right of an axis in newtons."""
    other = axes.secondary_yaxis("right", functions=(lambda x: x / POUND_N, lambda x: x * POUND_N))
    other.set_ylabel("lb", fontsize=8)
    other.tick_params(labelsize=7)


def _add_inches_axis(axes: Any) -> None:
    """Add an axis in inches above an axis in centimetres."""
    factor = 100.0 * INCH_m
    other = axes.secondary_xaxis("top", functions=(lambda x: x / factor, lambda x: x * factor))
    other.set_xlabel("in", fontsize=8)
    other.tick_params(labelsize=7)


def draw_forces(found: Documentation, system: System = "si") -> Figure:
    """Draw force against true deflection at each q̄, for a sweep in both directions."""
    shown, newtons = deflection_shown(found.control, system), in_system("N", system)
    factor = shown.factor
    figure, grid = panels(1, len(found.conditions), 3.5)
    for axes, condition in zip(grid[0], found.conditions, strict=True):
        sweeps = (
            ("uncompensated", condition.uncompensated, ORANGE, 1.3),
            ("compensated", condition.compensated, GREEN, 1.3),
        )
        for name, response, color, width in sweeps:
            x = factor * response.deflection
            axes.plot(
                x, newtons.factor * response.hand_force, color=color, linewidth=width, label=name
            )
        for leg, name in zip(condition.specified, leg_names(condition), strict=True):
            x, style = factor * leg.deflection, {"color": GRAY, "linewidth": 4.5, "zorder": 1}
            marks = {"linestyle": "", "marker": "o"} if leg.read else {}
            axes.plot(x, newtons.factor * leg.force, label=name or None, **style, **marks)
        axes.set_title(pressure(condition.pressure_Pa, system), fontsize=10)
        axes.set_xlabel(shown.labelled("true deflection δ"))
        axes.grid(alpha=0.25)
        if system == "si":
            _add_pounds_axis(axes)
        if shown.unit == "cm":
            _add_inches_axis(axes)
    grid[0, 0].set_ylabel(newtons.labelled("force at the grip F"))
    figure.suptitle(title(found, "force against deflection, slow sweep both ways"), fontsize=12)
    with_legend(figure, grid[0, 0], 3)
    return figure


def draw_deflections(found: Documentation, system: System = "si") -> Figure:
    """Draw computed against true deflection, and the error of the host's estimate."""
    shown = deflection_shown(found.control, system)
    factor = shown.factor
    control = found.rig.controls[found.control]
    figure, grid = panels(1, 2, 3.7)
    left, right = grid[0]
    for condition, color in zip(found.conditions, cycle((BLUE, ORANGE, GREEN)), strict=False):
        bent = condition.compensated
        name = pressure(condition.pressure_Pa, system)
        left.plot(
            factor * bent.deflection, factor * bent.computed, color=color, linewidth=1.3, label=name
        )
        sweeps = ((condition.uncompensated, "solid", "δ̂ = δc"), (bent, "dashed", "δ̂ = δc + K̂·F"))
        for response, style, estimate in sweeps:
            lacks = 100.0 * (response.deflection - response.estimate) / control.travel
            right.plot(
                factor * response.deflection,
                lacks,
                color=color,
                linestyle=style,
                linewidth=1.3,
                label=f"{estimate}, {name}",
            )
    ends = factor * np.array([-control.push, control.pull])
    left.plot(ends, ends, color=GRAY, linewidth=4.0, zorder=0, label="δc = δ")
    left.set_ylabel(shown.labelled("computed deflection δc"))
    right.set_ylabel("δ − δ̂, % of travel")
    for axes in (left, right):
        axes.set_xlabel(shown.labelled("true deflection δ"))
        axes.grid(alpha=0.25)
    handles, labels = (
        [*some, *others]
        for some, others in zip(
            *(a.get_legend_handles_labels() for a in (left, right)), strict=True
        )
    )
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    figure.suptitle(title(found, "true against computed deflection"), fontsize=12)
    return figure


def save_pages(figures: Sequence[Figure], path: Path) -> None:
    """Write figures as the pages of one PDF, atomically and with reproducible bytes."""

    def write(part: Path) -> None:
        with PdfPages(part, metadata={"CreationDate": None}) as pages:
            for figure in figures:
                pages.savefig(figure)

    write_whole(path, write)


def draw_pages(
    documents: Sequence[Documentation],
    fits: Mapping[ControlName, tuple[CalibrationResult, str] | None],
    issue: Issue,
    folder: Path,
    pdf: Path,
    system: System = "si",
) -> list[Path]:
    """Draw the pages of each control as PNG files; the PDF begins with a cover and the checks."""
    pages: dict[Path, Figure] = {}
    numbers: dict[tuple[ControlName, Kind], int] = {}
    for found in documents:
        drawn = {
            "forces": draw_forces(found, system),
            "deflections": draw_deflections(found, system),
            "static": draw_static_checks(found, system),
            "release": draw_releases(found, system),
        }
        fit = fits.get(found.control)
        if fit is not None:
            drawn["readings"] = draw_readings(*fit, system)
        order = {name: number for number, name in enumerate(drawn, len(pages) + 1)}
        numbers[found.control, "static"] = order["static"]
        numbers[found.control, "release"] = order["release"]
        pages |= {folder / f"{found.control}-{name}.png": page for name, page in drawn.items()}
    for number, (path, page) in enumerate(pages.items(), 1):
        page.suptitle(f"Figure {number}. {page.get_suptitle()}", fontsize=12)
        save(
            page,
            path,
            guess_note(documents[0].rig.controls, [found.control for found in documents]),
        )
    before = [draw_cover(documents, issue), *draw_check_table(documents, issue, numbers, system)]
    save_pages([*before, *pages.values()], pdf)
    return list(pages)
