"""The figures of an outcome for people: what each is called, its unit, and how it is written."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from coupled.units import DEGREE_rad

if TYPE_CHECKING:
    from coupled.authority.compare import Flight, Outcome

NONE = "–"  # in place of a figure that a flight does not have
_WORDS = {"column": ("pitch", "pitch"), "wheel": ("roll", "bank"), "pedals": ("yaw", "heading")}


@dataclass(frozen=True)
class Figure:
    """A figure of an outcome: its field, its label with the unit, and how its value is written."""

    field: str
    label: str
    form: Callable[[float], str]

    def written(self, outcome: Outcome) -> str:
        """Return the figure of an outcome; a dash where there is none, no sign before a zero."""
        value = getattr(outcome, self.field)
        if value is None or not math.isfinite(value):
            return NONE
        text = self.form(value)
        return text.lstrip("-") if float(text) == 0.0 else text


FIGURES: tuple[Figure, ...] = (
    Figure("asked_norm", "surface asked, % of travel", lambda x: f"{100 * abs(x):.2f}"),
    Figure("reached_norm", "surface reached, %", lambda x: f"{100 * abs(x):.2f}"),
    Figure("loss", "authority lost, %", lambda x: f"{100 * x:.2f}"),
    Figure("loss_closed_form", "  by closed form, %", lambda x: f"{100 * x:.2f}"),
    Figure("felt_ratio", "felt of specified gradient", lambda x: f"{x:.3f}"),
    Figure("felt_ratio_closed_form", "  by closed form", lambda x: f"{x:.3f}"),
    Figure("force_N", "force needed, N", lambda x: f"{x:.1f}"),
    Figure("force_step_N", "force step, N", lambda x: f"{x:.2f}"),
    Figure("peak_rate_rad_per_s", "peak {rate} rate, °/s", lambda x: f"{x / DEGREE_rad:.2f}"),
    Figure("peak_load_factor", "peak load factor", lambda x: f"{x:.3f}"),
    Figure("time_to_attitude_s", "time to {change:.1f}° of {angle}, s", lambda x: f"{x:.2f}"),
)


def rows(flights: Sequence[Flight]) -> Iterator[tuple[str, list[str]]]:
    """Yield each figure that any of the flights has: its label, and how it is written of each."""
    manoeuvre = flights[0].manoeuvre
    rate, angle = _WORDS[manoeuvre.control]
    change = manoeuvre.measure.attitude_change / DEGREE_rad
    for figure in FIGURES:
        written = [figure.written(flight.outcome) for flight in flights]
        if any(text != NONE for text in written):
            yield figure.label.format(rate=rate, angle=angle, change=change), written
