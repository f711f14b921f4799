"""The scales assumed by the host and those of the hardware, and whether a calibration is stale."""

from __future__ import annotations

from dataclasses import dataclass

from coupled.record.channels import unit_of
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig

# The gains of a calibration, with their units; another value makes it stale.
GAINS = {"mechanical_advantage": "", "s1_over_s2": "N_per_{d}", "s3_over_s2": ""}


@dataclass(frozen=True)
class Scales:
    """S₁ in V/d, S₂ and S₃ in V/N."""

    s1: float
    s2: float
    s3: float


def assumed_scales(control: Control) -> Scales:
    """Return the scales of the rig file, which the host assumes.

    By default a scale puts the converters' full scale at full travel, or at the force of full
    travel at the stiffest gradient (the report's 100-V scale factors).
    """
    sensing = control.sensing
    most = max(control.schedule.gradients) * control.travel + control.loader.breakout
    volts = sensing.full_scale
    force_scale = volts / most if most > 0.0 else 1.0
    s1 = sensing.s1 or volts / control.travel
    return Scales(s1, sensing.s2 or force_scale, sensing.s3 or force_scale)


def real_scales(control: Control) -> Scales:
    """Return the true scales of the hardware; S₁ is that of the host's v₁."""
    assumed, factor = assumed_scales(control), control.sensing
    return Scales(
        assumed.s1 * factor.read_scale,
        assumed.s2 * factor.modifying_scale,
        assumed.s3 * factor.force_scale,
    )


def stale(control: Control) -> list[str]:
    """Return the changes since a control's calibration, a phrase each; empty if none."""
    then = control.calibration
    if then.readings == 0:
        return []
    now = {"length": control.length, **{n: getattr(control.gains, n) for n in GAINS}}
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
    sensing, scales = control.sensing, {"S1": then.s1, "S2": then.s2, "S3": then.s3}
    used = {"K": (max(then.bend, 0.0), control.compensation.bend)}
    for name, value in scales.items():
        if value > 0.0:
            used[name] = (value, getattr(sensing, name.lower()))
    changes += [
        f"the host uses {name} = {value:.6g}, not the calibrated {found:.6g}"
        for name, (found, value) in used.items()
        if not _same(found, value)
    ]
    return changes


def outdated_bends(filed: Rig, found: Rig) -> list[str]:
    """Return a sentence for each control whose K̂ differs from the K found.

    `filed` is the rig as filed, `found` with the K from records. The host's K̂ is not changed,
    since the records were made with it.
    """
    said = []
    for name, control in found.controls.items():
        old, new, host = filed.controls[name].loader, control.loader, control.compensation
        corrects = host.deflection or host.gradient
        if _same(old.bend, new.bend) or _same(host.bend, new.bend) or not corrects:
            continue
        d = unit_of(name)
        said.append(
            f"the {name}'s K̂ is stale: the host corrects by {host.bend:.6g} {d}/N, and K is"
            f" {new.bend:.6g} {d}/N. To correct by the K found, set"
            f" controls.{name}.compensation.bend_{d}_per_N = {new.bend:.6g}"
        )
    return said


def _same(one: float, other: float) -> bool:
    return abs(one - other) <= 1e-9 * max(abs(one), abs(other))
