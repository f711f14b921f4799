"""Commands of the loaders' services in flight, for a run's events and for a page.

`set_service` sets a service of a flying rig, packed by `pack`, between two frames;
`copy_service_rows` copies the kernels' last values of the services, by the channels of
`service_channels`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError, nearest
from coupled.record.channels import ControlName, unit_of
from coupled.record.record import Record
from coupled.rig.control import ControlArray
from coupled.rig.parameters import Control, Services
from coupled.rig.rig import Rig
from coupled.rig.services import SERVICE_CHANNELS
from coupled.rig.surface import share_of_travel

Floats = NDArray[np.float64]

# The commands of a control: their place in the state, and their largest value, if any is set.
SERVICES: dict[str, tuple[str, str, float | None]] = {
    "trim_{d}": ("loader", "neutral", None),
    "trim_release": ("services", "trim_release", 1.0),
    "autopilot": ("services", "autopilot", 1.0),
    "autopilot_{d}": ("services", "autopilot_at", None),
    "disconnected": ("services", "disconnected", 1.0),
    "jammed": ("services", "jammed", 1.0),
    "other_jammed": ("services", "other_jammed", 1.0),
    "other_force_N": ("services", "other_force", None),
    "shaker": ("services", "shaker", 1.0),
    "pusher": ("services", "pusher", 1.0),
    "feel_lost": ("services", "feel_lost", 1.0),
}
# The key of the rig file that a service requires.
_NEEDS = {
    "autopilot": ("override", "override_N"),
    "autopilot_{d}": ("override", "override_N"),
    "disconnected": ("other_mass", "other_mass_kg"),
    "other_jammed": ("other_mass", "other_mass_kg"),
    "other_force_N": ("other_mass", "other_mass_kg"),
    "shaker": ("shaker", "shaker_N"),
    "pusher": ("pusher", "pusher_N"),
}


def services_of(control: str) -> dict[str, str]:
    """Return {service of a control, with its unit: its key in `SERVICES`}."""
    return {key.format(d=unit_of(control)): key for key in SERVICES}


def service_channels(control: str) -> tuple[str, ...]:
    """Return the channels that record a control's services."""
    return tuple(f"{control}_{name.format(d=unit_of(control))}" for name in SERVICE_CHANNELS)


class ServiceRows(NamedTuple):
    """The services of a control in a record, one value a frame."""

    neutral: Floats  # x₀, d
    force: Floats  # added by them, N
    jammed: Floats  # 0 or 1
    feel_lost: Floats  # share of G_T
    asked: Floats  # command of the surface, d


def service_rows(record: Record, control: str) -> ServiceRows | None:
    """Return a record's channels of a control's services; None if any is missing."""
    quantities = ("trim_{d}", "service_force_N", "jammed", "feel_lost", "asked_{d}")
    names = [f"{control}_{each.format(d=unit_of(control))}" for each in quantities]
    if any(name not in record for name in names):
        return None
    return ServiceRows(*(record[name] for name in names))


def held_force(rig: Rig, record: Record, control: str) -> Floats | None:
    """Return the services' force held by the host over each frame, N, as `begin_services` does.

    That of pusher, hinge moments and envelope, by the recorded motion. None if the rig has none of
    them, or the record lacks a channel for it.
    """
    of, d = rig.controls[cast(ControlName, control)].services, unit_of(control)
    names = {"pusher": f"{control}_pusher", "asked": f"{control}_asked_{d}"}
    names |= {"q": "dynamic_pressure_Pa", "alpha": "alpha_rad", "load": "load_factor"}
    needed = ["pusher"] if of.pusher else []
    needed += ["q", "alpha", "asked"] if of.hinge_alpha or of.hinge_surface else []
    needed += ["load"] if of.envelope or of.envelope_push else []
    if not needed or any(names[one] not in record for one in needed):
        return None
    rows = {one: record[names[one]] for one in needed}
    held = np.zeros(len(record))
    if "pusher" in rows:
        held -= of.pusher * rows["pusher"]
    if "asked" in rows:
        asked = np.concatenate(([0.0], rows["asked"][:-1]))  # at the start of the frame
        moment = of.hinge_alpha * (rows["alpha"] - rows["alpha"][0])
        share = share_of_travel(rig.controls[cast(ControlName, control)], asked)
        held -= rows["q"] * (moment + of.hinge_surface * share)
    if "load" in rows:
        held -= of.envelope * np.maximum(rows["load"] - of.envelope_above, 0.0)
        held += of.envelope_push * np.maximum(of.envelope_below - rows["load"], 0.0)
    return held


def has_services(control: Control) -> bool:
    """Tell whether the rig file has services of a control."""
    return control.services != Services()


def check_service(
    rig: Rig, control: str, service: str, to: float, file: object, place: str
) -> None:
    """Raise InputError for a command impossible on a rig; `place` is the table of a file."""
    if control not in rig.controls:
        problem = f"the rig has no {control}; {nearest(control, rig.controls)}"
        raise InputError(file, f"{place}.control", problem)
    known = services_of(control)
    if service not in known:
        problem = f"no {service!r}; {nearest(service, known)}"
        raise InputError(file, f"{place}.service", problem)
    data = rig.controls[control]
    needed, key = _NEEDS.get(known[service], ("", ""))
    if needed and getattr(data.services, needed) == 0.0:
        problem = f"does nothing without controls.{control}.services.{key} of the rig"
        raise InputError(file, f"{place}.service", problem)
    if not math.isfinite(to):
        raise InputError(file, f"{place}.to", f"is {to}; give a number")
    most = SERVICES[known[service]][2]
    if most is not None and not 0.0 <= to <= most:
        raise InputError(file, f"{place}.to", f"is {to:g}; a share or a switch, from 0 to 1")
    if known[service].endswith("_{d}") and abs(to) > data.travel_to(to):
        problem = f"is {to:g}, beyond the control's travel, {-data.push:g} to {data.pull:g}"
        raise InputError(file, f"{place}.to", problem)


def set_service(
    controls: ControlArray, names: Sequence[str], control: str, service: str, value: float
) -> None:
    """Set a service of a flying rig between two frames; `names` are its controls, in order.

    An engaged autopilot holds the control at its position, until another is set.
    """
    state = controls["state"][list(names).index(control)]
    stage, field, _ = SERVICES[services_of(control)[service]]
    if field == "autopilot" and value > 0.5 >= state["services"]["autopilot"]:
        state["services"]["autopilot_at"] = state["loader"]["computed"]
    state[stage][field] = value
    state["services"]["on"] = 1


def service_command(
    controls: ControlArray, names: Sequence[str], control: str, service: str
) -> float:
    """Return the current command of a service of a flying rig."""
    stage, field, _ = SERVICES[services_of(control)[service]]
    return float(controls["state"][list(names).index(control)][stage][field])


def copy_service_rows(
    controls: ControlArray, names: Sequence[str], which: Sequence[str], into: Floats
) -> None:
    """Write the last values of some controls' services, a row each, shape (n, channels)."""
    rows = controls["state"]["services"]["row"]
    for row, name in zip(into, which, strict=True):
        row[:] = rows[list(names).index(name)]
