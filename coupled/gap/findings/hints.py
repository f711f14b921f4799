"""What to check in the channels of a record whose gap no effect explains, or not one alone."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from coupled.errors import joined
from coupled.flight.airframe import SPEED
from coupled.gap.chain import AIRFRAME
from coupled.gap.findings.result import EffectResult
from coupled.gap.signals.output import TRIM, Output, estimate_noise, exceeds_noise
from coupled.gap.stages.surfaces import states_trim, surface_channel
from coupled.gap.thresholds import NEARLY_ALL, NEGLIGIBLE, TRIM_SIGMAS, BRIEF_s, WINDOW_s
from coupled.record.channels import CONTROL_NAMES, ControlName, channel
from coupled.record.levers import levers_of
from coupled.record.record import Record
from coupled.rig.rig import Rig
from coupled.units import GRAVITY_m_per_s2

_POSITIONS = tuple(map(surface_channel, CONTROL_NAMES))


def late_channels(outputs: Sequence[Output], rig: Rig) -> str:
    """Return a sentence on the channels that nearly agree with the model at another time."""
    flown = [one for one in outputs if one.stage == AIRFRAME and one.channel != TRIM]
    delays = {one.channel: _delay_s(one, rig) for one in flown if one.gap(rig) > one.limit}
    late = {name: delay for name, delay in delays.items() if delay != 0.0}
    if not late:
        return ""
    each = [f"{name} ({delay:.2g} s)" for name, delay in late.items()]
    verb = "is" if len(each) == 1 else "are"
    return f"{joined(each)} {verb} late, relative to the model: check the time stamps."


def _delay_s(output: Output, rig: Rig) -> float:
    """Return the delay of the model's motion that removes nearly all of a gap; 0 if none does."""
    most = round(WINDOW_s * output.frame_rate_Hz)
    if len(output.measured) <= 4 * most:
        return 0.0
    measured = output.measured[most:-most] / output.floor
    predicted = output.measured / output.floor - output.residual(rig)

    def excess(frames: int) -> float:
        shifted = predicted[most - frames : len(predicted) - most - frames]
        return max(float(np.mean((measured - shifted) ** 2)) - 1.0, 0.0)

    delay = min(range(-most, most + 1), key=excess)
    explains = excess(delay) <= (1.0 - NEARLY_ALL) * excess(0)
    return delay / output.frame_rate_Hz if explains else 0.0


def still_surfaces(records: Sequence[Record]) -> str:
    """Return a sentence on the recorded surfaces that never change."""
    values = {name: [one[name] for one in records if name in one] for name in _POSITIONS}
    still = [name for name, each in values.items() if each and not any(map(np.ptp, each))]
    verb = "never changes" if len(still) == 1 else "never change"
    return f"{joined(still)} {verb}: is a sensor stuck?" if still else ""


def held_still(rig: Rig, control: ControlName, records: Sequence[Record]) -> str:
    """Return a sentence on a loader that no force of the records moves; empty if one moves it.

    Whatever holds it, friction, breakout or a stop, is then only known to exceed the force.
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


def unknown_conditions(records: Sequence[Record]) -> str:
    """Return what of a flight no record shows, in words; empty if the flight was simulated."""
    if any(map(states_trim, records)):
        return ""
    recorded = {kind for one in records for kind, _ in levers_of(one.channels).values()}
    lacking = [kind for kind in ("throttle", "flap", "gear") if kind not in recorded]
    words = ""
    if lacking:
        names = joined([f"{kind}_norm" for kind in lacking])
        words = f"Not recorded, and in the model as in trim: {names}. "
    return words + (
        "In the model all engines run, and no wind changes the airspeed or rotates the "
        "aircraft: leave out the rows with an engine failure, wind shear or turbulence."
    )
