"""What the host believes of its scales and bend, and a rig whose host believes a calibration.

A calibration changes beliefs, not the hardware: S₁, S₂, S₃ and K̂ become what was found,
and each scale's factor of real over believed is kept true of the same hardware.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from coupled.record.channels import ControlName
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig

if TYPE_CHECKING:
    from coupled.calibration.calibrate import Result

_GAINS = ("mechanical_advantage", "s1_over_s2", "s3_over_s2")


@dataclass(frozen=True)
class Scales:
    """S₁ in V/d, S₂ and S₃ in V/N."""

    s1: float
    s2: float
    s3: float


def believed_scales(control: Control) -> Scales:
    """Return the scales of the rig file.

    One that is left out puts the converters' full scale at full travel, or at the force that
    full travel takes at the stiffest gradient (the report's 100-V scale factors).
    """
    sensing = control.sensing
    most = max(control.schedule.total_gradient) * control.travel + control.loader.breakout
    volts = sensing.full_scale
    force_scale = volts / most if most > 0.0 else 1.0
    s1 = sensing.s1 or volts / control.travel
    return Scales(s1, sensing.s2 or force_scale, sensing.s3 or force_scale)


def real_scales(control: Control) -> Scales:
    """Return the scales that the hardware really has."""
    believed, factor = believed_scales(control), control.sensing
    return Scales(
        believed.s1 * factor.deflection_scale,
        believed.s2 * factor.modifying_scale,
        believed.s3 * factor.force_scale,
    )


def with_calibration(
    rig: Rig, control: ControlName, found: Result, date: str = "", hardware: bool = False
) -> Rig:
    """Return the rig whose host believes a calibration.

    With `hardware` the rig's own structure and scales are taken to be as found, too: for
    readings of a real loader, whose rig file is a model.
    """
    data = rig.controls[control]
    real, sensing = real_scales(data), data.sensing
    s2 = found.s2_chosen
    s1, s3, bend = found.line.s1, found.s3, found.line.bend
    scales: dict[str, Any] = {"s1": s1.value, "s3": s3.value}
    scales["deflection_scale"] = 1.0 if hardware else real.s1 / s1.value
    scales["force_scale"] = 1.0 if hardware else real.s3 / s3.value
    if s2 is not None:
        scales["s2"] = s2.value
        scales["modifying_scale"] = 1.0 if hardware else real.s2 / s2.value
    noted: dict[str, Any] = {
        "readings": found.count,
        "date": date,
        **{"s1": s1.value, "s1_error": s1.error, "s3": s3.value, "s3_error": s3.error},
        **({"s2": s2.value, "s2_error": s2.error} if s2 is not None else {}),
        **{"bend": bend.value, "bend_error": bend.error, "length": data.length},
        **{name: getattr(data.gains, name) for name in _GAINS},
    }
    believed = max(bend.value, 0.0)
    changed: dict[str, Any] = {
        "sensing": sensing.model_copy(update=scales),
        "compensation": data.compensation.model_copy(update={"bend": believed}),
        "calibration": data.calibration.model_copy(update=noted),
    }
    if hardware:
        changed["loader"] = data.loader.model_copy(update={"bend": believed})
    controls = {**rig.controls, control: data.model_copy(update=changed)}
    return rig.model_copy(update={"controls": controls})


def stale(control: Control) -> list[str]:
    """Return what has changed since a control's calibration, a phrase each; empty if nothing."""
    then = control.calibration
    if then.readings == 0:
        return []
    now = {"length": control.length, **{n: getattr(control.gains, n) for n in _GAINS}}
    named = {
        "length": "the column's length (m)",
        "mechanical_advantage": "the mechanical advantage",
        "s1_over_s2": "the gain S1/S2",
        "s3_over_s2": "the gain S3/S2",
    }
    changes = [
        f"{named[name]} was {getattr(then, name):.6g} and is {value:.6g}"
        for name, value in now.items()
        if not _same(getattr(then, name), value)
    ]
    used = {"S1": (then.s1, control.sensing.s1), "S3": (then.s3, control.sensing.s3)}
    used["K"] = (max(then.bend, 0.0), control.compensation.bend)
    if then.s2 > 0.0:
        used["S2"] = (then.s2, control.sensing.s2)
    changes += [
        f"the host uses {name} = {value:.6g}, not the calibrated {found:.6g}"
        for name, (found, value) in used.items()
        if not _same(found, value)
    ]
    return changes


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= 1e-9 * max(abs(one), abs(other))
