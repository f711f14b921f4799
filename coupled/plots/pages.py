"""Shared by the pages of a force documentation: units, panels and titles."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure

from coupled.display import Shown, System, drawn, pressure_in
from coupled.record.channels import unit_of

if TYPE_CHECKING:
    from coupled.calibration.documentation import Documentation, FeelCondition

NARROWEST = 7.4  # inches; least width for the title of a page
GRAY, ORANGE, GREEN, BLUE = "0.62", "#d55e00", "#009e73", "#0072b2"


def deflection_shown(control: str, system: System = "si") -> Shown:
    """Return the unit in which the deflection of a control is drawn."""
    return drawn(f"deflection_{unit_of(control)}", system)


def plain(text: str, longest: int = 20) -> str:
    """Return a user's text cut to a length, with dollar signs escaped for matplotlib."""
    cut = text if len(text) <= longest else text[: longest - 1] + "…"
    return "".join(c if c.isprintable() else "?" for c in cut).replace("$", r"\$")


def panels(rows: int, columns: int, height: float) -> tuple[Figure, Any]:
    """Return a figure with panels in rows and columns, `height` inches tall, and their axes."""
    wide = max(1.4 + 3.6 * columns, NARROWEST)
    figure = Figure(figsize=(wide, 1.1 + height * rows), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False)


def case_panels(rows: int, cases: int, height: float) -> tuple[Figure, Any]:
    """Return a figure with one column per case, and its axes by row and case.

    The rows of a single case are side by side.
    """
    if cases > 1:
        return panels(rows, cases, height)
    figure, grid = panels(1, rows, 0.9 * height)
    return figure, grid.T


def pressure(pressure_Pa: float, system: System = "si") -> str:
    """Return a dynamic pressure as text for a title."""
    return f"q̄ = {pressure_in(pressure_Pa, system)}"


def title(found: Documentation, what: str) -> str:
    """Return the title of a page."""
    return f"{found.rig.name}, {found.control}: {what}"


def leg_names(condition: FeelCondition) -> list[str]:
    """Return the legend labels of the reference's legs: only the first one present has a name."""
    there = [leg.deflection.size > 0 for leg in condition.specified]
    name = "aircraft" if any(leg.read for leg in condition.specified) else "specified"
    return [name if k == there.index(True) else "" for k in range(len(there))]


def with_legend(figure: Figure, axes: Any, columns: int) -> None:
    """Put one legend for all panels below them."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, fontsize=9)
