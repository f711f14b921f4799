"""Comparison of an exported flight with coupled's own, channel by channel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.authority.compare import judge
from coupled.flight.everyframe import LATERAL_PROPERTIES, LONGITUDINAL_PROPERTIES
from coupled.flight.manoeuvre import Manoeuvre
from coupled.record.channels import (
    LATERAL,
    LONGITUDINAL,
    SURFACES,
    ControlName,
    channel,
    motion_channels,
    unit_of,
)
from coupled.record.record import Record
from coupled.units import FOOT_m, PSF_Pa

Floats = NDArray[np.float64]
NEUTRAL = 0.01  # of travel, within which F_mod's breakout may have either sign


@dataclass(frozen=True)
class FlightErrors:
    """The errors of an exported flight against coupled's own, at the worst frame and control.

    `deflection` and `estimate` are shares of the travel, `force` and `modifying_force` of the
    largest there (F_mod where δc is at least 1 % of the travel from neutral, at which it jumps),
    `surface` of the surface's travel; `loss` is the difference of the lost authority, a share;
    `load_factor` and `pitch_rad` the motion's. None if there is none.
    """

    run: str
    case: str
    configuration: str
    deflection: float
    estimate: float
    force: float
    modifying_force: float
    surface: float
    loss: float | None
    load_factor: float | None
    pitch_rad: float | None

    def as_dict(self) -> dict[str, object]:
        """Return the figures by name."""
        return asdict(self)


def properties(manoeuvre: Manoeuvre) -> list[str]:
    """Return the properties of an exported flight that correspond to a record's channels."""
    found = [name for control in manoeuvre.rig.controls for name in _own(control).values()]
    return found + list(_motion(manoeuvre))


def _own(control: ControlName) -> dict[str, str]:
    """Return {channel: property} of a control."""
    d, at = unit_of(control), f"coupled/{control}"
    return {
        channel(control, name): f"{at}/{prop}"
        for name, prop in {
            "hand_force": "force-held-N",
            "force": "force-read-N",
            "computed": f"computed-{d}",
            "deflection": f"deflection-{d}",
            "estimate": f"estimate-{d}",
            "gradient": f"gradient-N_per_{d}",
            "modifying_force": "modifying-force-N",
            "surface_norm": "surface-norm",
        }.items()
    }


def _motion(manoeuvre: Manoeuvre) -> dict[str, tuple[str, float]]:
    """Return {property: (channel, factor to SI)} of the motion."""
    rig = manoeuvre.rig
    if rig.flight is None:
        return {}
    scales = {"dynamic_pressure_Pa": PSF_Pa, "true_airspeed_m_per_s": FOOT_m, "altitude_m": FOOT_m}
    known = [*zip(LONGITUDINAL_PROPERTIES, LONGITUDINAL, strict=True)]
    if len(motion_channels(list(rig.controls), flown=True)) > len(LONGITUDINAL):
        known += zip(LATERAL_PROPERTIES, LATERAL, strict=True)
    own = {
        f"{SURFACES[name]}_rad": control.properties.position[0]
        for name, control in rig.controls.items()
        if control.properties.position
    }
    return {own.get(name, prop): (name, scales.get(name, 1.0)) for prop, name in known}


def alone_record(manoeuvre: Manoeuvre, record: Record, table: Floats) -> Record:
    """Return coupled's own record with the channels of JSBSim's flight instead.

    `table` has a row for each run and the columns of `properties`. A row of a record has the host's
    data at the start of a frame: the controls' from the run over that frame, the motion from the
    run before. The first row keeps our motion, since JSBSim trims in its first run.
    """
    flight = manoeuvre.rig.flight
    steps = flight.steps_per_frame if flight is not None else 1
    rows = min(len(record), 1 + (len(table) - 1) // steps)
    data, columns = record.data[:rows].copy(), list(record.channels)
    at = 0
    for control in manoeuvre.rig.controls:
        for name in _own(control):
            data[:, columns.index(name)] = table[::steps, at][:rows]
            at += 1
    for name, scale in _motion(manoeuvre).values():
        data[1:, columns.index(name)] = scale * table[steps - 1 :: steps, at][: rows - 1]
        at += 1
    return Record(record.channels, data, dict(record.manifest))


def compare(manoeuvre: Manoeuvre, configuration: str, ours: Record, alone: Record) -> FlightErrors:
    """Compare a flight by JSBSim alone with coupled's own."""
    rig, rows = manoeuvre.rig, min(len(ours), len(alone))
    worst = dict.fromkeys(("deflection", "estimate", "force", "modifying_force", "surface"), 0.0)
    for control, data in rig.controls.items():
        names = _names(control)
        off = {key: np.abs(alone[name][:rows] - ours[name][:rows]) for key, name in names.items()}
        clear = np.abs(ours[channel(control, "computed")][:rows]) > NEUTRAL * data.travel
        off["modifying_force"] = np.where(clear, off["modifying_force"], 0.0)
        scale = dict.fromkeys(("deflection", "estimate"), data.travel) | {"surface": 1.0}
        for key in ("force", "modifying_force"):
            scale[key] = float(np.max(np.abs(ours[names[key]][:rows]))) or 1.0
        for key in worst:
            worst[key] = max(worst[key], float(np.max(off[key])) / scale[key])
    flown = rig.flight is not None
    first, second = (judge(manoeuvre, configuration, record).loss for record in (ours, alone))
    loss = second - first
    return FlightErrors(
        manoeuvre.name,
        manoeuvre.label,
        configuration,
        worst["deflection"],
        worst["estimate"],
        worst["force"],
        worst["modifying_force"],
        worst["surface"],
        loss if np.isfinite(loss) else None,
        _off(ours, alone, "load_factor", rows) if flown else None,
        _off(ours, alone, "pitch_rad", rows) if flown else None,
    )


def _names(control: ControlName) -> Mapping[str, str]:
    return {
        "deflection": channel(control, "deflection"),
        "estimate": channel(control, "estimate"),
        "force": channel(control, "hand_force"),
        "modifying_force": channel(control, "modifying_force"),
        "surface": channel(control, "surface_norm"),
    }


def _off(ours: Record, alone: Record, name: str, rows: int) -> float:
    return float(np.max(np.abs(alone[name][:rows] - ours[name][:rows])))
