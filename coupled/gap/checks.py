"""Records that are refused, and the trim that they were flown from.

Clock, values, sensors and units of a record are checked before its diagnosis. A rig file describes
a machine. The trim of its aircraft (speed, altitude, flight path, flaps) is a condition of the
flight and no fault, so it is taken from the record. Other values of a manifest's rig (a mass, a
moment, a bend) are not used.

Of a rig without controls, an aircraft alone, records of control forces and of the host are ignored.
The rig takes the frame rate of the record, since no loader or host depends on it. If the record is
slower than the rig, the model is stepped at least at the rig's rate, and the surfaces are
interpolated between the rows.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from coupled.errors import InputError, joined, nearest
from coupled.flight.aircraft import make_aircraft
from coupled.flight.altered import STILL
from coupled.flight.everyframe import PROPERTIES
from coupled.gap.signals.live import measured_stretches
from coupled.gap.signals.output import Floats, Output, estimate_noise
from coupled.gap.signals.reading import PRESSURE
from coupled.gap.stages.surfaces import start_of, states_trim, surface_channel, surface_points
from coupled.gap.thresholds import (
    DOUBLED,
    FAR_SIGMAS,
    KNOWN,
    LESSER,
    MOST,
    NEGLIGIBLE,
    OTHER_SPEED,
    PIECE,
    REVERSED,
    ROUGH,
    SHORT_FRAMES,
    SHORT_SWINGS,
    SMALL,
    TINY,
    TRIM_SIGMAS,
    BRIEF_s,
    OTHER_ALTITUDE_m,
    SHORTEST_RECORD_s,
)
from coupled.record.channels import (
    CONTROL_NAMES,
    LATERAL,
    LONGITUDINAL,
    RATE,
    TIME,
    ControlName,
    channel,
    motions_in,
)
from coupled.record.importing import plausible
from coupled.record.importing.account import log_rate_of
from coupled.record.importing.redundant import force_unit, other_units, rate_ratio, reversed_rates
from coupled.record.importing.suggest.sizes import RATES_Hz
from coupled.record.levers import OF_ENGINES, lever_property, levers_of
from coupled.record.record import Record
from coupled.record.samples import FINER, check_samples, sampling_rate_of
from coupled.resources import aircraft_folder
from coupled.rig.equations import specified_gradient
from coupled.rig.parameters import Flight
from coupled.rig.replay import replay_schedule, replay_surface
from coupled.rig.rig import Rig
from coupled.rig.rigfile import rig_from_table
from coupled.schema import changed, file_keys

SPEED = "true_airspeed_m_per_s"
ELEVATOR = surface_channel("column")


def check_record(
    rig: Rig, record: Record, control: ControlName, file: object, moved: bool = True
) -> None:
    """Check that a record can be of a rig. Raises InputError with the reason if it cannot.

    The channels of the control are checked if it is to be `moved`.
    """
    if rig.controls and control not in rig.controls:
        raise InputError(file, control, f"the rig has no {control}")
    for data in rig.controls.values():
        regressor = data.loader.regressor
        if regressor is not None and regressor not in record:
            problem = f"has no channel {regressor}, the regressor of the rig file"
            raise InputError(file, "", f"{problem}; {nearest(regressor, record.channels)}")
    rate = sampling_rate_of(record, file)
    if abs(rate / rig.frame_rate - 1.0) > TINY:
        slower = rig.frame_rate / rate
        unit = next((unit for n, unit in FINER.items() if abs(slower / n - 1.0) <= TINY), "")
        asked = f"is it in {unit}?" if unit else "another rig?"
        problem = f"runs at {rate:.4g} Hz, the rig at {rig.frame_rate:g} Hz: {asked}"
        raise InputError(file, "time_s", problem)
    check_samples(record, file)
    if len(record) < SHORTEST_RECORD_s * rig.frame_rate:
        _check_short(record, control, file)
    if rig.flight is not None:
        _check_angles(record, file)
    if rig.controls and moved:
        _check_channels(rig, record, control, file)


def check_units(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Raise InputError if a channel has another unit or sign, by channels that determine it.

    Checked before the trim is taken from the record, since a speed in knots has none, nor has one
    on the ground.
    """
    columns = _columns(record)
    found = other_units(columns, rig)
    force = force_unit(columns, rig, control) if not found else None
    found |= {channel(control, "force"): force} if force is not None else {}
    for name, one in found.items():
        raise InputError(file, name, f"{one.reason}: it is in {one.unit}")
    for name, angle in reversed_rates(columns).items():
        raise InputError(file, name, f"moves against {angle}: one of them is reversed")
    if rig.flight is not None:
        _check_airborne(record, file)


def _columns(record: Record) -> dict[str, Floats]:
    return dict(zip(record.channels, record.data.T, strict=True))


def _check_angles(record: Record, file: object) -> None:
    """Raise InputError if the load factor, an angle, a rate or a surface is beyond that in flight.

    Roll and heading may be counted on over full turns, so that their size shows no unit.
    """
    load = "load_factor"
    if load in record and (doubt := plausible.size_doubt(load, record[load])) is not None:
        raise InputError(file, load, doubt)
    turning = ("roll_rad", "heading_rad")
    angles = (one for one in (*LONGITUDINAL, *LATERAL) if one.endswith(("_rad", "_rad_per_s")))
    for name in (one for one in angles if one in record and one not in turning):
        if plausible.size_doubt(name, record[name]) is not None:
            most = float(np.max(np.abs(record[name])))
            raise InputError(file, name, f"reaches {most:.3g}: is it in degrees?")


def _check_short(record: Record, control: ControlName, file: object) -> None:
    """Raise InputError if a short record has too few frames or swings to fit and to hold out."""
    swings = min(map(_swings, _signals(record, control).values()), default=0)
    if len(record) < 2 * PIECE or swings < SHORT_SWINGS:
        length_s = record.time_s[-1] - record.time_s[0]
        problem = f"is {length_s:.1f} s long with {swings} swings in {len(record)} rows;"
        needed = f"{SHORTEST_RECORD_s:g} s are needed, or {SHORT_SWINGS} swings in {2 * PIECE} rows"
        raise InputError(file, "", f"{problem} {needed}")


def _signals(record: Record, control: ControlName) -> dict[str, Floats]:
    """Return the force on a control and its deflections, by channel, if recorded."""
    names = (channel(control, quantity) for quantity in ("force", "computed", "deflection"))
    return {name: record[name] for name in names if name in record}


def _swings(signal: Floats) -> int:
    """Return how often a signal crosses its mean by half of its standard deviation or more."""
    away = signal - signal.mean()
    sides = np.sign(away[np.abs(away) > 0.5 * away.std()])
    return int(np.count_nonzero(np.diff(sides)))


def _check_channels(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Raise InputError if a channel is stuck, a copy of another, or in another unit."""
    present = _signals(record, control)
    for name, signal in present.items():
        if plausible.is_constant(signal):
            raise InputError(file, name, f"never changes: {_why_constant(rig, record, control)}")
        other = plausible.copy_of(name, present)
        if other is not None:
            raise InputError(file, name, f"is a copy of {other}")
    gradient = channel(control, "gradient")
    both = gradient in record and PRESSURE in record
    stuck = both and plausible.is_constant(record[PRESSURE])
    if stuck and not plausible.is_constant(record[gradient]):
        raise InputError(file, PRESSURE, f"never changes, while {gradient} does: it is stuck")
    travel = rig.controls[control].travel
    for name, signal in present.items():
        most = float(np.max(np.abs(signal)))
        if name != channel(control, "force") and most > plausible.FAR_BEYOND * travel:
            problem = f"reaches {most:.3g}, beyond {travel:g}: is it in another unit?"
            raise InputError(file, name, problem)
    _check_signs(rig, record, control, file)
    _check_schedule(rig, record, control, file)


def _check_signs(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Raise InputError if the force, or one of two deflections, has a reversed sign."""
    moved, force = _signals(record, control), channel(control, "force")
    pull = moved.pop(force, None)
    if not moved:
        return
    (first, motion), *others = moved.items()
    problem = f"moves against {first}: one of them is reversed"
    for name, other in others:
        if plausible.move_oppositely(motion, other):
            raise InputError(file, name, problem)
    passive = rig.controls[control].drive != "setpoint"
    if passive and pull is not None and plausible.drives_the_hand(pull, motion):
        raise InputError(file, force, problem)


def check_against_model(
    outputs: Sequence[Output], rig: Rig, files: Sequence[object], records: Sequence[Record]
) -> None:
    """Raise InputError if a surface, or the pitch or roll rate, moves against the model's.

    No effect of the library reverses these; adverse yaw may reverse the yaw rate. A surface is an
    input of the model's flight, so a reversed one reverses the model's rate: the attitude shows
    which of the two is right.
    """
    signed = (*map(surface_channel, CONTROL_NAMES), RATE["column"], RATE["wheel"])
    for output in outputs:
        if output.channel not in signed:
            continue
        predicted = output.measured - output.floor * output.residual(rig)
        if plausible.move_oppositely(predicted, output.measured, REVERSED):
            problem = f"moves against that of {rig.name}: is its sign reversed?"
            file, name, record = files[output.record], output.channel, records[output.record]
            turned = next((one for one in CONTROL_NAMES if RATE[one] == name), None)
            if turned is not None and _surface_is_reversed(rig, record, turned):
                problem = f"turns {name} against that of {rig.name}: is its sign reversed?"
                raise InputError(file, surface_channel(turned), problem)
            raise InputError(file, name, problem)


def _surface_is_reversed(rig: Rig, record: Record, control: ControlName) -> bool:
    """Tell whether a rate against the model's is due to its surface, not to its own sign.

    Then the rate agrees with the attitude or, without it, the surface moves against the command of
    the rig's gearing at the measured deflection.
    """
    name = surface_channel(control)
    if name not in record:
        return False
    ratio = rate_ratio(_columns(record), RATE[control])
    if ratio is not None:
        return ratio > 0.0
    moved = motions_in(record, control)
    points = surface_points(rig, control) if control in rig.controls else None
    if not moved or points is None or PRESSURE not in record:
        return False
    command = replay_surface(rig, control, record[moved[0]], record[PRESSURE])
    return plausible.move_oppositely(np.interp(command, *points), record[name])


def clipped(record: Record, control: ControlName, file: str) -> list[str]:
    """Return a sentence on each sensor of a control that is clipped."""
    ends = {name: plausible.clipped_at(one) for name, one in _signals(record, control).items()}
    return [
        f"{name} of {file} is clipped at {end:.4g}; no effect explains what is lost beyond."
        for name, end in ends.items()
        if end is not None
    ]


def not_measured(
    record: Record,
    control: ControlName | None,
    file: str,
    set_points: bool = False,
    motion: Collection[str] = (),
) -> list[str]:
    """Return sentences on the sensors of a control, or of the motion, that repeat their readings.

    A force may be applied in steps, and δc if it is a set point; they are longer than those of the
    slowest log. Rows that the import has interpolated have a sentence too.
    """
    signals = {} if control is None else _signals(record, control)
    signals |= {name: record[name] for name in motion if name in record}
    rate_Hz = sampling_rate_of(record, file)
    applied = ("force", "computed") if set_points else ("force",)
    most = {} if control is None else {channel(control, q): rate_Hz / RATES_Hz[0] for q in applied}
    repeating = dict[str, list[str]]()
    for name, signal in signals.items():
        if repeats := plausible.held(signal, most.get(name, math.inf)):
            repeating.setdefault(repeats, []).append(name)
    said = [
        f"{'Each of ' if len(names) > 1 else ''}{joined(names)} of {file} {repeats}: an effect may "
        "be the recorder's. Log new readings only."
        for repeats, names in repeating.items()
    ]
    log_Hz = log_rate_of(record)
    if log_Hz is not None and log_Hz < (1.0 - SMALL) * rate_Hz:
        said.append(
            f"{file} is interpolated between the {log_Hz:.4g} rows a second of its log: its noise "
            "is unknown, and a gap may be the interpolation's. Log every frame."
        )
    return said


def _why_constant(rig: Rig, record: Record, control: ControlName) -> str:
    """Return the possible cause of a constant channel: no motion, or a stuck sensor."""
    force = channel(control, "force")
    if force not in record:
        return f"the {control} is at rest, or a sensor is stuck"
    most = float(np.max(np.abs(record[force])))
    if most == 0.0:
        return f"no force moves the {control}, or a sensor is stuck"
    loader, computed = rig.controls[control].loader, channel(control, "computed")
    if computed not in record or plausible.is_constant(record[computed]):
        holds = loader.breakout + max(loader.friction, loader.breakaway)
        return (
            f"{most:.4g} N do not move the {control} (breakout and friction hold {holds:.4g} N in "
            "the rig file), or a sensor is stuck; record a larger force"
        )
    return "a sensor that is stuck"


def _check_schedule(rig: Rig, record: Record, control: ControlName, file: object) -> None:
    """Raise InputError if the gradients differ from those of the rig's table."""
    gradient, computed = channel(control, "gradient"), channel(control, "computed")
    if gradient not in record or PRESSURE not in record:
        return
    schedule, pressure = rig.controls[control].schedule, record[PRESSURE]
    specified = specified_gradient(schedule, pressure)
    if schedule.curved and computed in record:
        specified = replay_schedule(rig, control, pressure, computed=record[computed])
    if np.median(specified) == 0.0:
        return
    ratio = float(np.median(record[gradient]) / np.median(specified))
    if not 1.0 / DOUBLED < ratio < DOUBLED:
        problem = f"is {ratio:.3g} times what this rig's table gives: another rig's file?"
        raise InputError(file, gradient, problem)


def _check_airborne(record: Record, file: object) -> None:
    """Raise InputError if a record starts on the ground, at little of its largest airspeed."""
    if SPEED not in record:
        return
    speed = record[SPEED]
    rows = max(1, round(BRIEF_s * sampling_rate_of(record, file)))
    if (start := float(np.mean(speed[:rows]))) < LESSER * float(np.max(speed)):
        problem = f"starts at {start:.1f} m/s, on the ground; give the record from a trim in flight"
        raise InputError(file, SPEED, f"{problem} on")


def check_trim(trim_speed_m_per_s: float, record: Record, file: object) -> None:
    """Raise InputError if a record does not start at the trim speed of the rig's aircraft."""
    if SPEED not in record:
        return
    start = float(np.median(record[SPEED][_FIRST]))
    if abs(start / trim_speed_m_per_s - 1.0) > OTHER_SPEED:
        problem = f"starts at {start:.4g}, and the aircraft is trimmed at {trim_speed_m_per_s:.4g}"
        remedy = "give records from their trim on, and those of another trim by themselves"
        raise InputError(file, SPEED, f"{problem}: {remedy}")


ALTITUDE, CALIBRATED, PATH = "altitude_m", "calibrated_airspeed_m_per_s", "flight_path_rad"
# The keys of a rig's `flight` that define the initial trim, not the aircraft.
TRIM_KEYS = (ALTITUDE, CALIBRATED, PATH, "trim", "landing", "properties")
_FIELDS = file_keys(Flight, "m")
_FIRST, _LAST = slice(SHORT_FRAMES), slice(-SHORT_FRAMES, None)


def rig_of_manifests(records: Mapping[str, Record]) -> Rig:
    """Return the rig in the manifests of some records, from the first manifest.

    Raises InputError if a record has no manifest with a rig, or if the rigs differ.
    """
    found: dict[str, Rig] = {}
    for file, record in records.items():
        table = record.manifest.get("rig")
        if not isinstance(table, Mapping):
            problem = "is missing, and no manifest beside the record holds a rig: give the rig file"
            raise InputError(file, "--rig", problem)
        found[file] = rig = rig_from_table(table, f"{file} (its manifest)")
        first, known = next(iter(found.items()))
        if (rig.controls, rig.structure) != (known.controls, known.structure):
            problem = f"its manifest holds another rig than that of {first}: give the rig file"
            raise InputError(file, "--rig", problem)
    return next(iter(found.values()))


def trimmed(rig: Rig, records: Mapping[str, Record]) -> tuple[dict[str, Rig], str]:
    """Return the rig in the trim at the start of each record, and sentences about the changes.

    A record that does not show its trim has that of the first record that does. Raises InputError
    if a manifest has another aircraft, or if the aircraft cannot be trimmed at a record's start.
    """
    found, said = dict.fromkeys(records, rig), dict[str, str]()
    if rig.flight is None:
        return found, ""
    shown = [file for file, record in records.items() if _shows_trim(rig.flight, record, file)]
    for file in shown:
        record = records[file]
        taken, source = _manifest_trim(rig.flight, record, file), f"the manifest of {file}"
        if taken is None:
            taken, source = _measured_trim(rig, record, file), f"the first rows of {file}"
        new = {key: value for key, value in taken.items() if not _same(rig.flight, key, value)}
        if new:
            found[file] = rig.changed({f"flight.{key}": value for key, value in new.items()})
            was = ", ".join(_change(rig.flight, key, value) for key, value in new.items())
            said.setdefault(was, f"Trim taken from {source}, not from the rig file: {was}.")
    if shown:
        found |= {file: found[shown[0]] for file in records if file not in shown}
    return found, " ".join(said.values())


def _shows_trim(flight: Flight, record: Record, file: str) -> bool:
    """Tell whether a record or its manifest shows the trim that it was flown from."""
    return SPEED in record or _manifest_trim(flight, record, file) is not None


def trim_in(rig: Rig, other: Rig) -> dict[str, Any]:
    """Return the fields of a rig's `flight` in which its trim differs from another's."""
    fields = () if rig.flight is None else [_FIELDS[key] for key in TRIM_KEYS]
    return {
        name: getattr(rig.flight, name)
        for name in fields
        if getattr(rig.flight, name) != getattr(other.flight, name)
    }


def _same(flight: Flight, key: str, value: Any) -> bool:
    """Tell whether a value of the rig file equals the flown one, to a relative 1e-6."""
    filed = getattr(flight, _FIELDS[key])
    if isinstance(value, float) and isinstance(filed, float):
        return math.isclose(value, filed, rel_tol=1e-6, abs_tol=1e-9)
    return bool(value == filed)


def _change(flight: Flight, key: str, value: Any) -> str:
    """Return a text of the change of a key."""
    if key == "properties":
        old = flight.properties
        new = {name: each for name, each in value.items() if each != old.get(name)}
        return ", ".join(
            f"{n} {old[n]:g} → {x:g}" if n in old else f"{n} {x:g}" for n, x in new.items()
        )
    before = getattr(flight, _FIELDS[key])
    if isinstance(value, float):
        return f"{key} {before:.4g} → {value:.4g}"
    return f"{key} {before} → {value}"


def _manifest_trim(flight: Flight, record: Record, file: str) -> dict[str, Any] | None:
    """Return the trim in a record's manifest, by keys of a rig file; None if it has none."""
    table = record.manifest.get("rig")
    given = table.get("flight") if isinstance(table, Mapping) else None
    if not isinstance(given, Mapping):
        return None
    if given.get("model") != flight.model:
        problem = f"is {given.get('model')!r} in the manifest, {flight.model!r} in the rig file"
        raise InputError(file, "flight.model", f"{problem}: another rig's file?")
    if not states_trim(record):
        return None
    return {key: given[key] for key in TRIM_KEYS if key in given}


def _measured_trim(rig: Rig, record: Record, file: str) -> dict[str, Any]:
    """Return the measured trim at a record's start, where it differs by more than its error."""
    assert rig.flight is not None
    names = (SPEED, ALTITUDE, "pitch_rad", "alpha_rad")
    known = {name: record[name] for name in names if name in record}
    if SPEED not in known or not all(np.isfinite(values).all() for values in known.values()):
        return {}
    flight, found = rig.flight, dict[str, Any]()
    rows = max(2, round(BRIEF_s * rig.frame_rate))
    if configured := _configuration(rig, record, rows):
        found["properties"] = flight.properties | configured

    def off(values: Floats, filed: float, least: float = 0.0) -> float | None:
        noise = estimate_noise(values)
        start, error = start_of(values[:rows], noise.rms * math.sqrt(noise.mean_variance))
        return start if abs(start - filed) > max(TRIM_SIGMAS * error, least) else None

    if ALTITUDE in known:
        height = off(known[ALTITUDE], flight.altitude, OTHER_ALTITUDE_m)
        found |= {} if height is None else {ALTITUDE: height}
    here = rig.changed({f"flight.{key}": value for key, value in found.items()})
    wanted = off(known[SPEED], trim_speed(here))
    if "pitch_rad" in known and "alpha_rad" in known:
        angle = off(known["pitch_rad"] - known["alpha_rad"], flight.flight_path)
        if angle is not None and _climbs(record, angle - flight.flight_path):
            found[PATH] = angle
    if wanted is None:
        return found

    def true_speed(calibrated: float) -> float:
        found[CALIBRATED] = calibrated
        return trim_speed(rig.changed({f"flight.{key}": value for key, value in found.items()}))

    speed = flight.calibrated_airspeed
    try:
        for _ in range(3):  # the two speeds are nearly in proportion
            speed *= wanted / true_speed(speed)
        true_speed(speed)
    except InputError:
        problem = f"starts at {wanted:.4g}, where the rig's {flight.model} does not trim;"
        filed = f"the rig file has it at {trim_speed(rig):.4g}: another rig's file?"
        raise InputError(file, SPEED, f"{problem} {filed}") from None
    return found


def _configuration(rig: Rig, record: Record, rows: int) -> dict[str, float]:
    """Return the positions of flaps, gear and the like in the first rows, if the rig has others.

    The keys are properties of the model; a lever that the model lacks is left out.
    """
    assert rig.flight is not None
    levers = {name: kind for name, (kind, _) in levers_of(record.channels).items()}
    shown = {name: lever_property(kind) for name, kind in levers.items() if kind not in OF_ENGINES}
    if not shown:
        return {}
    still, folders = changed(rig.flight, STILL, "rig", "flight"), [aircraft_folder()]
    plain = make_aircraft(still, 1.0 / rig.frame_rate, ["column"], folders)
    filed = {own: plain.lever(own).read() for own in shown.values() if plain.has(own)}
    measured = {own: float(np.median(record[name][:rows])) for name, own in shown.items()}
    return {
        own: measured[own]
        for own, value in filed.items()
        if abs(measured[own] - value) > NEGLIGIBLE
    }


def _climbs(record: Record, angle: float) -> bool:
    """Tell whether the altitude, if recorded, confirms that the flight path is off by an angle.

    An offset of the vane or of the attitude changes the angle, but not the altitude.
    """
    if ALTITUDE not in record:
        return True
    names = ("roll_rad", "sideslip_rad", "pitch_rad", "alpha_rad")
    level = np.zeros(len(record))
    roll, beta, pitch, alpha = (
        record[name] if name in record.channels else level for name in names
    )
    forward, down = np.cos(alpha) * np.cos(beta), np.sin(alpha) * np.cos(beta) * np.cos(roll)
    up = forward * np.sin(pitch) - (np.sin(beta) * np.sin(roll) + down) * np.cos(pitch)
    lengths = record[SPEED][:-1] * np.diff(record.time_s)  # of the path, by frames
    first, last = (np.median(record[ALTITUDE][rows]) for rows in (_FIRST, _LAST))
    missed = (last - first - float(np.sum(up[:-1] * lengths))) / float(np.sum(lengths))
    return bool(abs(missed) < MOST * abs(angle))


def unmeasured_trim(rig: Rig, records: Mapping[str, Record]) -> str:
    """Return a sentence on a trim that a record and its manifest do not show; empty if they do."""
    flight = rig.flight
    if flight is None:
        return ""
    shown = [file for file, record in records.items() if _shows_trim(flight, record, file)]
    if len(shown) == len(records):
        return ""
    filed = f"{CALIBRATED} {flight.calibrated_airspeed:.4g}, {ALTITUDE} {flight.altitude:.4g}"
    trim = f"that of {shown[0]}" if shown else f"the rig file's: {filed}"
    return (
        f"Without {SPEED} the trim is {trim}. A flight from another one differs as by mass and "
        "inertias."
    )


def trim_speed(rig: Rig) -> float:
    """Return the true airspeed at which the rig's aircraft is trimmed, m/s."""
    return _in_trim(rig, SPEED)


def not_in_trim(record: Record, file: str) -> str:
    """Return a sentence on a rate that is not 0 at a record's start, where the model is in trim."""
    for name in (one for one in RATE.values() if one in record):
        signal = record[name]
        # The first value of a line, as in a gust a rate grows from 0; twice the error of a mean.
        start = float(np.polyfit(np.arange(SHORT_FRAMES), signal[:SHORT_FRAMES], 1)[1])
        least = FAR_SIGMAS * 2.0 * plausible.noise_level(signal) / math.sqrt(SHORT_FRAMES)
        if abs(start) > max(least, SMALL * float(np.std(signal))):
            return (
                f"{file} does not start in trim, from which the model is flown, or a sensor has an "
                f"offset: {name} starts at {start:.3g}. Give the record from its trim on."
            )
    return ""


def density_of(rig: Rig, record: Record) -> float:
    """Return the density of a record's air over the model's at that altitude; 1 if not measured.

    It is 1 up to `NEGLIGIBLE`. Forces in other air are those of another mass and other inertias.
    """
    names = (PRESSURE, SPEED, ALTITUDE)
    if any(name not in record for name in names):
        return 1.0
    measured = plausible.pressure_ratio(*(record[name] for name in names))
    own = plausible.pressure_ratio(*(np.array([_in_trim(rig, name)]) for name in names))
    if measured is None or own is None or abs(measured / own - 1.0) <= NEGLIGIBLE:
        return 1.0
    return measured / own


def other_air(density: float, file: str) -> str:
    """Return a sentence on air of another density than the model's; empty if it is that."""
    if density == 1.0:
        return ""
    return (
        f"By q̄ and airspeed of {file} the density of the air is {density:.3f} times the "
        "model's, which acts as a factor on mass and inertias: check altitude (above sea level), "
        'airspeed (true) and temperature ("atmosphere/delta-T" in flight.properties, °R).'
    )


def _in_trim(rig: Rig, name: str) -> float:
    """Return a channel of the motion of the rig's aircraft in trim."""
    assert rig.flight is not None
    still = changed(rig.flight, STILL, rig.place, "flight")
    motion = _trim_motion(still.model_dump_json(), rig.frame_rate, rig.place)
    return motion[LONGITUDINAL.index(name)]


@lru_cache(maxsize=64)
def _trim_motion(flight: str, rate_Hz: float, name: str) -> tuple[float, ...]:
    still = Flight.model_validate_json(flight)
    airframe = make_aircraft(still, 1.0 / rate_Hz, ["column"], [aircraft_folder()], name)
    return tuple(airframe.motion())


def motion_alone(records: Mapping[str, Record]) -> dict[str, Record]:
    """Return the records with time, the positions of surfaces and levers, and motion only.

    Raises InputError if one lacks the elevator position or the pitch rate.
    """
    found = {}
    for file, record in records.items():
        for name in (ELEVATOR, RATE["column"]):
            if name not in record:
                problem = "is missing; the rig has an aircraft only, and is judged by it"
                raise InputError(file, name, problem)
        kept = [name for name in (TIME, *LONGITUDINAL, *LATERAL) if name in record]
        levers = levers_of(record.channels)
        kept += [name for name in record.channels if name in levers or "throttle" in name]
        data = np.column_stack([record[name] for name in kept])
        found[file] = Record(tuple(kept), data, record.manifest)
    return found


def without_dropouts(records: Mapping[str, Record]) -> tuple[dict[str, Record], list[str]]:
    """Return the records of an aircraft alone without filled dropouts, and a sentence on each.

    The surfaces in a dropout are not known, nor the motion after it. Of the stretches that begin in
    trim the longest is judged; if all are too short, the whole record.
    """
    found, said = dict(records), []
    for file, record in records.items():
        known = [one for one in measured_stretches(record) if not not_in_trim(one, file)]
        longest = max(known, key=len, default=record)
        span_s = longest.time_s[[0, -1]] - record.time_s[0]
        if len(longest) < len(record) and np.ptp(span_s) >= SHORTEST_RECORD_s:
            found[file] = longest
            said.append(
                f"Rows of {file} repeat all channels, as in a dropout: it is judged from "
                f"{span_s[0]:.2f} to {span_s[1]:.2f} s only."
            )
    return found, said


def check_levers(record: Record, file: str) -> None:
    """Raise InputError if a lever of a record is no share of its travel."""
    for name in levers_of(record.channels):
        if (most := float(np.max(np.abs(record[name])))) > 1.0 + ROUGH:
            raise InputError(file, name, f"reaches {most:.4g}; a lever is from 0 to 1: in percent?")


def at_rate_of(rig: Rig, records: Mapping[str, Record]) -> Rig:
    """Return the rig with the frame rate of the first record, and steps per frame by its own."""
    assert rig.flight is not None
    file, record = next(iter(records.items()))
    rate_Hz = sampling_rate_of(record, file)
    if abs(rate_Hz / rig.frame_rate - 1.0) <= TINY:
        return rig
    wanted = math.ceil(rig.frame_rate * rig.flight.steps_per_frame / rate_Hz - 0.01)
    steps = min(max(1, wanted), 100)
    return rig.changed({"frame_rate_Hz": float(f"{rate_Hz:.6g}"), "flight.steps_per_frame": steps})


def check_moved_by_pilot(rig: Rig, records: Mapping[str, Record]) -> None:
    """Raise InputError if a recorded surface of an aircraft alone cannot drive the model.

    Control laws of the model may move its elevator, or the property of a surface's channel may not
    follow its command, as if the model has the position elsewhere.
    """
    assert rig.flight is not None
    model, key = rig.flight.model, "flight.model"
    for control in CONTROL_NAMES:
        name, points = surface_channel(control), surface_points(rig, control)
        if points is None and control == "column":
            problem = "has control laws that move its elevator, which follow the column's command;"
            remedy = "give a rig with [controls.column], and a record with column_estimate_m"
            raise InputError(rig.place, key, f"{model} {problem} {remedy}")
        recorded = (file for file, one in records.items() if name in one and np.ptp(one[name]) > 0)
        file = next(recorded, None)
        if points is None or np.ptp(points[1]) > KNOWN or file is None:
            continue
        problem = f"{model} does not move {PROPERTIES[name]}, the position of {name} in {file};"
        own = f"give a rig with [controls.{control}] and its surface_property"
        remedy = own if control == "column" else f"{own}, or the record without {name}"
        raise InputError(rig.place, key, f"{problem} {remedy}")
