"""Causes that are no effects, and that may explain the same gap as the effects found.

A position in shares of the full travel makes the model's surface move too far, by the inverse of
its travel in radians, and a wrong effectiveness explains all of it. Simulators log both. A loader
that no force moves may be held by friction, breakout, a stop or a jam. An aircraft that was trimmed
in wind starts in a sideslip, which acts like an offset of the vane. The gear is in `gear`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from coupled.errors import joined
from coupled.flight.airframe import SPEED
from coupled.gap.findings.result import EffectResult
from coupled.gap.signals.output import estimate_noise, exceeds_noise
from coupled.gap.stages.surfaces import surface_channel, surface_points
from coupled.gap.thresholds import MOST, NEGLIGIBLE, TINY, TRIM_SIGMAS, BRIEF_s
from coupled.record.channels import CONTROL_NAMES, SURFACES, ControlName, channel
from coupled.record.record import Record
from coupled.rig.rig import Rig
from coupled.units import DEGREE_rad, GRAVITY_m_per_s2


@dataclass(frozen=True)
class OtherCause:
    """A cause that is no effect, in words, and the names of the effects that it may replace.

    `probability` is the probability of these effects if only they and this cause are possible.
    """

    effects: frozenset[str]
    words: str = ""
    probability: float = MOST


def in_other_unit(rig: Rig, effects: Sequence[EffectResult]) -> list[OtherCause]:
    """Return the units of surfaces that may explain effects.

    They are a surface's effectiveness and, since a trim has the wrong unit too, its zero.
    """
    found = list[OtherCause]()
    for control in CONTROL_NAMES if rig.flight is not None else ():
        surface = SURFACES[control]
        ours = [one for one in effects if one.name == f"{surface}_effectiveness"]
        for unit in (unit for one in ours for unit in _possible(rig, control, one)):
            words = (
                f"{surface_channel(control)} may be in {unit} instead of rad, which acts like this "
                f"{surface} effectiveness: check it, and set unit or scale in the import map."
            )
            found.append(OtherCause(frozenset((ours[0].name, f"{surface}_zero")), words))
    return found


def _possible(rig: Rig, control: ControlName, effect: EffectResult) -> list[str]:
    """Return the units whose size in rad the interval of an effectiveness includes.

    An interval that includes 0 shows no unit.
    """
    (p,) = effect.parameters
    if p.low is None or p.high is None or p.low <= 0.0:
        return []
    return [unit for unit, low, high in _units(rig, control) if p.low <= high and p.high >= low]


def _units(rig: Rig, control: ControlName) -> Iterator[tuple[str, float, float]]:
    """Yield units of a surface's position, and the range of their size in rad."""
    yield "degrees", DEGREE_rad, DEGREE_rad
    points = surface_points(rig, control)
    if points is None:
        return
    low, high = sorted(abs(float(end)) for end in points[1][[0, -1]])
    travel = f"{low:.3g} rad" if high - low < TINY else f"{low:.3g} to {high:.3g} rad"
    for unit, share in (("shares", 1.0), ("per cent", 0.01)):
        yield f"{unit} of its travel ({travel})", share * low, share * high


def held_still(rig: Rig, control: ControlName, records: Sequence[Record]) -> str:
    """Return a sentence on a loader that no force of the records moves; empty if one moves it.

    Friction, breakout or a stop that holds the loader is then only known to exceed the force.
    """
    if not rests(rig, control, records):
        return ""
    most = max(float(np.max(np.abs(one[channel(control, "force")]))) for one in records)
    return (
        f"No force up to {most:.3g} N moves the loader of the {control}: friction, breakout, a stop"
        " or a jam may hold it, and its size is only a lower bound. Record a force that moves it."
    )


def rests(rig: Rig, control: ControlName, records: Sequence[Record]) -> bool:
    """Tell whether the computed deflection of a loader is noise alone in all records."""
    names = channel(control, "computed"), channel(control, "force")
    known = control in rig.controls and all(name in one for one in records for name in names)
    if not known or rig.controls[control].drive != "force":
        return False
    return not any(exceeds_noise(one[names[0]]) for one in records)


def steady_sideslip(records: Mapping[str, Record], effects: Sequence[EffectResult]) -> str:
    """Return a sentence on a flight that starts in a sideslip, if its vane was found to be off.

    The model starts without sideslip. In straight flight a side force balances a bank, as in a
    sideslip; an offset of the vane leaves the wings level.
    """
    if not any(effect.name == "sideslip_zero" for effect in effects):
        return ""
    banks = {file: _unbalanced_bank_rad(one) for file, one in records.items()}
    each = [f"{file} ({math.degrees(bank):.2g}°)" for file, bank in banks.items() if bank]
    if not each:
        return ""
    return (
        f"The wings are not level in the straight flight at the start of {joined(each)}, so the "
        "sideslip may be real, as from a trim in wind. Give records that start without sideslip."
    )


def _unbalanced_bank_rad(record: Record) -> float:
    """Return the bank at a record's start that no turn balances; 0 if it is within its error."""
    names = ("roll_rad", "yaw_rate_rad_per_s", SPEED)
    if any(name not in record for name in names):
        return 0.0
    rows = record.time_s < record.time_s[0] + BRIEF_s
    roll, yaw_rate, speed = (record[name] for name in names)
    bank = roll - speed * yaw_rate / GRAVITY_m_per_s2  # of a coordinated turn, at small angles
    mean = float(np.mean(bank[rows]))
    error = estimate_noise(bank).rms / math.sqrt(int(rows.sum()))
    return mean if abs(mean) > max(TRIM_SIGMAS * error, NEGLIGIBLE) else 0.0
