"""The figures of an outcome for people: what each is called, its unit, and how it is written."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from coupled.display import System, shown
from coupled.record.channels import unit_of
from coupled.units import DEGREE_rad, INCH_m

if TYPE_CHECKING:
    from coupled.authority.compare import Flight, Outcome
    from coupled.flight.manoeuvre import Manoeuvre

NONE = "–"  # in place of a figure that a flight does not have
_NOTICED = 0.005  # of the hand's travel: what it moves further is said
_ALIKE = 0.05  # of the rigid rig's surface: what goes about as far
_FORCES = ("step", "ramp", "doublet", "3211", "sweep", "table")  # pilots that hold a force
_WORDS = {"column": ("pitch", "pitch"), "wheel": ("roll", "bank"), "pedals": ("yaw", "heading")}


@dataclass(frozen=True)
class Figure:
    """A figure of an outcome: its field, its label with the unit, and how its value is written."""

    field: str
    label: str
    form: Callable[[float], str]

    def written(self, outcome: Outcome, factor: float = 1.0) -> str:
        """Return the figure of an outcome; a dash where there is none, no sign before a zero.

        `factor` takes it to the unit that it is written in.
        """
        value = getattr(outcome, self.field)
        if value is None or not math.isfinite(value):
            return NONE
        text = self.form(factor * value)
        return text.lstrip("-") if float(text) == 0.0 else text


FIGURES: tuple[Figure, ...] = (
    Figure("asked_norm", "surface asked, % of travel", lambda x: f"{100 * abs(x):.2f}"),
    Figure("reached_norm", "surface reached, %", lambda x: f"{100 * abs(x):.2f}"),
    Figure("hand_travel_norm", "hand's travel, {unit}", lambda x: f"{abs(x):.1f}"),
    Figure("loss", "authority lost, %", lambda x: f"{100 * x:.2f}"),
    Figure("loss_closed_form", "  by closed form, %", lambda x: f"{100 * x:.2f}"),
    Figure("felt_ratio", "felt of specified gradient", lambda x: f"{x:.3f}"),
    Figure("felt_ratio_closed_form", "  by closed form", lambda x: f"{x:.3f}"),
    Figure("force_N", "force needed, {force}", lambda x: f"{x:.1f}"),
    Figure("force_step_N", "force step, {force}", lambda x: f"{x:.2f}"),
    Figure("peak_rate_rad_per_s", "peak {rate} rate, °/s", lambda x: f"{x / DEGREE_rad:.2f}"),
    Figure("peak_load_factor", "peak load factor", lambda x: f"{x:.3f}"),
    Figure("time_to_attitude_s", "time to {change:.1f}° of {angle}, s", lambda x: f"{x:.2f}"),
)


def rows(flights: Sequence[Flight], system: System = "si") -> Iterator[tuple[str, list[str]]]:
    """Yield each figure that any of the flights has: its label, and how it is written of each."""
    manoeuvre = flights[0].manoeuvre
    rate, angle = _WORDS[manoeuvre.control]
    change = manoeuvre.measure.attitude_change / DEGREE_rad
    size, unit = _travel(manoeuvre, system)
    force = shown("force_N", system)
    factors = {"hand_travel_norm": size, "force_N": force.factor, "force_step_N": force.factor}
    for figure in FIGURES:
        factor = factors.get(figure.field, 1.0)
        written = [figure.written(flight.outcome, factor) for flight in flights]
        if any(text != NONE for text in written):
            yield (
                figure.label.format(
                    rate=rate, angle=angle, change=change, unit=unit, force=force.unit
                ),
                written,
            )


def _travel(manoeuvre: Manoeuvre, system: System) -> tuple[float, str]:
    """Return the travel of the control that is looked at, and the unit it is written in."""
    travel = manoeuvre.rig.controls[manoeuvre.control].travel
    if unit_of(manoeuvre.control) == "rad":
        return travel / DEGREE_rad, "°"
    return (travel / INCH_m, "in") if system == "us" else (1000.0 * travel, "mm")


def further(case: Sequence[Flight], system: System = "si") -> str:
    """Return why authority is lost where a force moves the surface as on the rigid rig.

    Nothing where the hand does not hold a force, or moves no further for it.
    """
    manoeuvre = case[0].manoeuvre
    pilot = manoeuvre.pilots.get(manoeuvre.control)
    flown = {flight.configuration: flight.outcome for flight in case}
    rigid, bent = flown.get("rigid"), flown.get("uncompensated")
    if pilot is None or pilot.kind not in _FORCES or rigid is None or bent is None:
        return ""
    further = abs(bent.hand_travel_norm) - abs(rigid.hand_travel_norm)
    if not further > _NOTICED:
        return ""
    size, unit = _travel(manoeuvre, system)
    digits = 1 if unit == "in" else 0
    where = f" ({bent.case})" if manoeuvre.label != manoeuvre.name else ""
    places = [f"{size * abs(each.hand_travel_norm):.{digits}f} {unit}" for each in (bent, rigid)]
    alike = abs(bent.reached_norm - rigid.reached_norm) <= _ALIKE * abs(rigid.reached_norm)
    surface = "the surface goes about as far, while" if alike else "and"
    return (
        f"The pilot holds a force: uncompensated, the hand moves {places[0]} for it instead of"
        f" {places[1]}{where}, since the structure bends; {surface} {100 * bent.loss:.0f} % of what"
        " the hand asks for is lost."
    )
