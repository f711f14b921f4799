"""A plan of readings as a CSV form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from coupled.calibration.plan import Station
from coupled.display import System, in_system
from coupled.record.channels import ControlName, unit_of


def form(
    chosen: Sequence[tuple[Station, int]],
    control: str,
    looks: int = 2,
    crossed: Mapping[ControlName, Sequence[float]] | None = None,
    system: System = "si",
) -> str:
    """Return a plan as a CSV form: the forces and deflections to set, and empty cells.

    `crossed` are the forces on other controls, N, by reading. With `us` the units are inches
    (degrees for a wheel) and pounds.
    """
    others = dict(crossed or {})
    moved, force, pressure = (in_system(unit, system) for unit in (unit_of(control), "N", "Pa"))
    unit = "deg" if moved.unit == "°" else moved.unit
    heads = [f"gradient_set,deflection_{unit},force_{force.unit},v1_V,v3_V"]
    heads += [f"force_after_{force.unit},deflection_after_{unit}"] if looks == 2 else []
    heads += [f"force_on_{name}_{force.unit}" for name in others]
    lines = [",".join([*heads, "v2_V,approach,remark"])]
    empty = "," * (7 + 2 * (looks == 2) + len(others))
    for station, count in chosen:
        where = f"hold at {moved.written(station.deflection)} {unit}"
        where += f" and about {force.written(station.force, 3)} {force.unit}"
        where += (
            f" with {pressure.written(station.pressure_Pa, 5)} {pressure.unit} given to the host"
        )
        for _ in range(count):
            at = len(lines) - 1
            held = [
                f" and {force.written(forces[at])} {force.unit} on the {name}"
                for name, forces in others.items()
            ]
            lines.append(f"{station.label}{empty}{where}{''.join(held)}")
    return "\n".join(lines) + "\n"


_STARTING_LOADS = (0.25, 0.5, 0.75, 1.0)  # of the largest pull, in each gradient set


def starting_form(control: str, inches: bool = False) -> str:
    """Return a CSV form with empty cells for an unknown loader.

    Two gradient sets, each pulled at four loads, and four nulls from both sides (eq. 14). A wheel's
    deflection is in degrees; otherwise it is in mm and newtons, or inches and pounds.
    """
    unit = "deg" if control == "wheel" else "in" if inches else "mm"
    force = "lb" if inches else "N"
    heads = f"gradient_set,deflection_{unit},force_{force},v1_V,v3_V"
    heads += f",deflection_after_{unit},force_after_{force},v2_V,approach,remark"
    lines = [heads]
    for label in ("softest", "stiffest"):
        for load in _STARTING_LOADS:
            where = (
                f"{label} gradient: pull to {100 * load:.0f} % of the largest pull that travel and"
            )
            where += " strength allow; read ruler and scale; voltmeter; ruler and scale again"
            lines.append(f"{label},,,,,,,,,{where}")
    for approach in ("out", "in", "out", "in"):
        way = "raise v2 until v1 has its noted value"
        way = way if approach == "out" else "raise v2 until v1 exceeds it; lower v2 to the noted v1"
        what = f"null: with v2 = 0 pull and note v1 and v3; release; {way}; note v2"
        lines.append(f"stiffest,,,,,,,,{approach},{what}")
    return "\n".join(lines) + "\n"
