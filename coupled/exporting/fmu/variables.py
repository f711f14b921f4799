"""The variables of an FMU, in the order of their value references."""

from __future__ import annotations

from typing import Literal, NamedTuple, cast

from coupled.exporting.fmu.descriptions import of_inputs, of_outputs
from coupled.exporting.fmu.kernel import ROW
from coupled.exporting.fmu.numbers import Bounds, Parameter, parameters
from coupled.record.channels import ControlName, channel, unit_of
from coupled.rig.rig import Rig

Role = Literal["independent", "input", "output", "parameter"]
ANY_VALUE = Bounds()
# By output: its place in a frame's row at the start of a frame, and at its end. The host sets all
# but the deflections at the start, for the whole frame (`rig/frame.host_frame`).
ROWS = {
    "computed": (2, ROW - 2),
    "deflection": (3, ROW - 1),
    "estimate": (4, 4),
    "modifying_force": (6, 6),
    "gradient": (5, 5),
    "surface_norm": (8, 8),
}


class Variable(NamedTuple):
    """A variable: its name, unit as in keys of files, and range; `of` is its parameter, if any."""

    name: str
    role: Role
    unit: str
    description: str
    start: float
    bounds: Bounds = ANY_VALUE
    of: Parameter | None = None


def variables(rig: Rig, control: str) -> list[Variable]:
    """Return the variables of a control; the place in the list is the value reference."""
    found = [Variable("time", "independent", "s", "time", 0.0)]
    found += _inputs(rig, control) + _outputs(rig, control)
    for one in parameters(rig, control):
        text = one.description
        found.append(Variable(one.key, "parameter", one.unit, text, one.start, one.bounds, one))
    return found


def needs_alpha(rig: Rig, control: str) -> bool:
    """Return whether a control's services depend on the angle of attack."""
    services = rig.controls[cast(ControlName, control)].services
    return any((services.shaker_alpha, services.pusher_alpha, services.hinge_alpha))


def _inputs(rig: Rig, control: str) -> list[Variable]:
    text = of_inputs(control)
    lowest = rig.controls[cast(ControlName, control)].schedule.dynamic_pressure[0]
    found = [
        Variable(f"{control}_force_N", "input", "N", text["force"], 0.0),
        Variable(f"{control}_force_rate_N_per_s", "input", "N_per_s", text["force_rate"], 0.0),
    ]
    name = "dynamic_pressure_Pa"
    start = max(lowest, 0.0)
    positive = Bounds(least=0.0)
    found.append(Variable(name, "input", "Pa", text[name], start, positive))
    found.append(Variable("load_factor", "input", "", text["load_factor"], 1.0))
    if needs_alpha(rig, control):
        found.append(Variable("alpha_rad", "input", "rad", text["alpha_rad"], 0.0))
    return found


def _outputs(rig: Rig, control: str) -> list[Variable]:
    d = unit_of(control)
    units = {"modifying_force": "N", "gradient": f"N_per_{d}", "surface_norm": ""}
    text = of_outputs(rig.controls[cast(ControlName, control)].surface)
    return [
        Variable(channel(control, each), "output", units.get(each, d), text[each], 0.0)
        for each in ROWS
    ]
