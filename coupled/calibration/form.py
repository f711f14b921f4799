"""A plan as a form to be filled in at the bench."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from coupled.calibration.plan import Station
from coupled.record.channels import ControlName, unit_of


def form(
    chosen: Sequence[tuple[Station, int]],
    control: str,
    looks: int = 2,
    crossed: Mapping[ControlName, Sequence[float]] | None = None,
) -> str:
    """Return a plan as a CSV to be filled in: where to hold, and empty cells to write into.

    `crossed` is what to hold on other controls, N, reading after reading.
    """
    others = dict(crossed or {})
    unit = unit_of(control)
    heads = [f"gradient_set,deflection_{unit},force_N,v1_V,v3_V"]
    heads += [f"force_after_N,deflection_after_{unit}"] if looks == 2 else []
    heads += [f"force_on_{name}_N" for name in others]
    lines = [",".join([*heads, "v2_V,approach,remark"])]
    empty = "," * (7 + 2 * (looks == 2) + len(others))
    for station, count in chosen:
        where = f"hold at {station.deflection:.4g} {unit} and about {station.force:.3g} N"
        where += f" with {station.pressure_Pa:.5g} Pa given to the host"
        for _ in range(count):
            at = len(lines) - 1
            held = [f" and {forces[at]:g} N on the {name}" for name, forces in others.items()]
            lines.append(f"{station.label}{empty}{where}{''.join(held)}")
    return "\n".join(lines) + "\n"
