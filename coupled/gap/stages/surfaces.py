"""The motion of the airframe's surfaces, from their recorded positions, and where they trim.

Each model has its own map from command to position, found by flying it. If the aircraft itself
moves a surface (a yaw damper, the control laws of an F-16), the position depends on the aircraft's
motion too. The input is then the host's command, flown through the model's laws, and the surface
stage is not judged. Without a command in the record, the surface is led to where it was measured.

A record starts in trim. A surface that differs from the model's trim by more than noise has one of
two causes. If the aircraft trims elsewhere (other weight, lift or moment), the first row is there
too, and the aircraft stays in trim. If something moved the surface afterwards (a rigging offset),
the aircraft responds. The first row and the model's residual in open-loop flight decide. If the
first row excludes each alone, both causes are present; if they cancel from the second row on, the
flight must confirm them. Without evidence the aircraft's trim is assumed; for a record without
motion, a fault of the surface.

The trim is also an output that is compared with the model's trim. With the angle of attack in trim
it discriminates lift, moment and weight.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.polynomial import Polynomial

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.altered import STILL, UNALTERED
from coupled.gap.noise.smooth import Smoother, smoothed
from coupled.gap.signals.conditions import trim_shift
from coupled.gap.signals.floors import left_noise
from coupled.gap.signals.output import Floats, estimate_noise, memory, white
from coupled.gap.stages.openloop import Moved, Points, about, fly_open_loop
from coupled.gap.thresholds import (
    KNOWN,
    MOST,
    NEGLIGIBLE,
    PARTLY,
    RIVAL_GAIN,
    ROUNDS,
    SHORT_FRAMES,
    SMALL,
    TRIM_ANSWERED,
    TRIM_SIGMAS,
    BRIEF_s,
    FLIGHT_s,
    STANDING_s,
    SURFACE_GUST_m_per_s,
    TRIM_LAGS_s,
)
from coupled.record.channels import (
    CONTROL_NAMES,
    SURFACES,
    VALIDITY,
    ControlName,
    channel,
    motion_channels,
)
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight
from coupled.rig.replay import replay_surface
from coupled.rig.rig import Rig
from coupled.rig.serving import service_rows
from coupled.schema import changed

WEIGHED = ("pitch_rate_rad_per_s", "alpha_rad", "load_factor")
_LATERAL = ("roll_rate_rad_per_s", "yaw_rate_rad_per_s", "sideslip_rad")


@dataclass(frozen=True)
class Trim:
    """A surface's position in trim, rad: the origin of its motion, and the measurement.

    `error` is the standard error of `measured`; `jump` the surface's offset from the second row on.
    """

    position: float
    measured: float
    error: float
    jump: float = 0.0


def surface_channel(control: ControlName) -> str:
    """Return the channel of the surface that a control moves."""
    return f"{SURFACES[control]}_rad"


def flown_by(rig: Rig) -> tuple[ControlName, ...]:
    """Return the controls whose surfaces drive the model: all if the rig has no control."""
    return tuple(rig.controls) or CONTROL_NAMES


def surface_points(rig: Rig, control: ControlName) -> Points | None:
    """Return commands about trim and the surface positions that the model gives them, rad.

    None if the aircraft's own laws move the surface.
    """
    return _points(*_unaltered(rig), control)


def _unaltered(rig: Rig) -> tuple[str, tuple[ControlName, ...], float]:
    """Return the aircraft of a rig without its alterations (JSON), its controls and frame rate."""
    assert rig.flight is not None
    plain = changed(rig.flight, UNALTERED, rig.place, "flight")
    return plain.model_dump_json(), flown_by(rig), rig.frame_rate


@lru_cache(maxsize=64)
def _points(
    flight: str, controls: tuple[ControlName, ...], rate_Hz: float, control: ControlName
) -> Points | None:
    if _moves_itself(_aircraft(flight, controls, rate_Hz), controls, rate_Hz, control):
        return None
    return _aircraft(flight, controls, rate_Hz).surface_map(surface_channel(control))


def _aircraft(
    flight: str, controls: tuple[ControlName, ...], rate_Hz: float, name: str = "rig"
) -> JSBSimAirframe:
    """Return the aircraft of a flight section in JSON, trimmed."""
    section = Flight.model_validate_json(flight)
    return make_aircraft(section, 1.0 / rate_Hz, controls, [aircraft_folder()], name)


def _moves_itself(
    airframe: JSBSimAirframe, controls: Sequence[ControlName], rate_Hz: float, control: ControlName
) -> bool:
    """Tell whether a surface moves with gusts or other controls, or after its command's frame."""
    at = motion_channels(controls, flown=True).index(surface_channel(control))
    own, frames = controls.index(control), round(BRIEF_s * rate_Hz)

    def goes(moved: int) -> list[float]:
        """Return the surface position frame by frame while one control is held off neutral."""
        places = []
        for _ in range(frames):
            first, second, third = (SMALL * (i == moved) for i in range(3))
            airframe.step((first, second, third))
            places.append(airframe.motion()[at])
        return places

    still = airframe.motion()[at]
    airframe.set_gust(SURFACE_GUST_m_per_s)
    left_alone = goes(-1) + [place for i in range(len(controls)) if i != own for place in goes(i)]
    led = goes(own)
    moved = [*(place - still for place in left_alone), *(place - led[0] for place in led)]
    return max(map(abs, moved)) > KNOWN


def filed_trim(rig: Rig, control: ControlName) -> float:
    """Return a surface's position in the trim to which `surface_points` refers, rad."""
    flight, controls, rate_Hz = _unaltered(rig)
    return _trim(flight, controls, rate_Hz, rig.place)[controls.index(control)]


def own_trim(rig: Rig, control: ControlName) -> float:
    """Return a surface's position in the trim of the rig's own aircraft, rad."""
    assert rig.flight is not None
    still = changed(rig.flight, {**STILL, "elevator_zero_rad": 0.0}, rig.place, "flight")
    controls = flown_by(rig)
    each = _trim(still.model_dump_json(), controls, rig.frame_rate, rig.place)
    own = each[controls.index(control)]
    return own + rig.flight.elevator_zero if control == "column" else own


@lru_cache(maxsize=64)
def _trim(
    flight: str, controls: tuple[ControlName, ...], rate_Hz: float, name: str
) -> tuple[float, ...]:
    motion = _aircraft(flight, controls, rate_Hz, name).motion()
    every = motion_channels(controls, flown=True)
    return tuple(motion[every.index(surface_channel(control))] for control in controls)


def moved(
    rig: Rig,
    record: Record,
    trims: Mapping[ControlName, Trim],
    rng: np.random.Generator,
) -> tuple[list[Moved], list[Moved]]:
    """Return the motion of the surfaces, and the same with a sample of its error.

    In the order of `flown_by`. `trims` are those of the record; a jump is not smoothed. A control
    without any channel in the record is taken as not moved.
    """
    each = [_moved(rig, record, control, trims.get(control), rng) for control in flown_by(rig)]
    wrong = [
        one if error is None else replace(one, values=one.values + error) for one, error in each
    ]
    return [one for one, _ in each], wrong


def _moved(
    rig: Rig, record: Record, control: ControlName, trim: Trim | None, rng: np.random.Generator
) -> tuple[Moved, Floats | None]:
    """Return the motion of a surface, and a sample of its error, rad; None if it has no error."""
    name, points = surface_channel(control), surface_points(rig, control)
    if is_led(rig, record, control):
        position, gain = record[name], _gain_of(rig, control)
        error = Smoother.of(position).wiener_error(estimate_noise(position), len(position), rng)
        return Moved(name, smoothed(position), gain=gain), error
    if name not in record or points is None:
        return Moved(name, _asked(rig, record, control)), None
    position, filed = record[name], filed_trim(rig, control)
    trim = trim or Trim(filed, filed, 0.0)
    given = (points, trim.measured, filed, TRIM_SIGMAS * trim.error)
    if VALIDITY in record:  # the surface of a live flight is the model's: no noise
        return Moved(name, position, *given), None
    left, estimated = position - _led(rig, record, control, trim.position), estimate_noise(position)
    level = left_noise(estimated, position, left)
    if float(np.std(left)) < MOST * estimated.rms:
        # The command explains its roughness, so that is motion of the surface, not noise.
        error = level.sample(len(position), rng)
        error *= min(1.0, float(np.std(left)) / max(level.rms, 1e-300))
        return Moved(name, position, *given), error
    step = np.where(np.arange(len(position)) > 0, trim.jump, 0.0)
    error = Smoother.of(position - step).wiener_error(level, len(position), rng)
    return Moved(name, smoothed(position - step) + step, *given), error


def is_led(rig: Rig, record: Record, control: ControlName) -> bool:
    """Tell whether a surface that the aircraft's laws move is known by its position alone."""
    by_position = surface_channel(control) in record and channel(control, "estimate") not in record
    return by_position and surface_points(rig, control) is None and _gain_of(rig, control) != 0.0


def _gain_of(rig: Rig, control: ControlName) -> float:
    return _gain(*_unaltered(rig), control)


@lru_cache(maxsize=64)
def _gain(
    flight: str, controls: tuple[ControlName, ...], rate_Hz: float, control: ControlName
) -> float:
    """Return how far a surface goes with its command within a frame, rad; 0 if it goes later."""
    at = controls.index(control)
    surface = motion_channels(controls, flown=True).index(surface_channel(control))

    def place(command: float, frames: int) -> float:
        airframe = _aircraft(flight, controls, rate_Hz)
        first, second, third = (command * (i == at) for i in range(3))
        for _ in range(frames):
            airframe.step((first, second, third))
        return float(airframe.motion()[surface])

    once, twice = (place(SMALL, frames) - place(0.0, frames) for frames in (1, 2))
    return once / SMALL if abs(twice - once) < SMALL * abs(once) else 0.0


def _led(rig: Rig, record: Record, control: ControlName, trim: float) -> Floats:
    """Return the position that the host's command gives a surface with this trim, rad."""
    points = surface_points(rig, control)
    assert points is not None
    held = about(trim, filed_trim(rig, control), points)
    shift = trim_shift(record, control, 1.0 / rig.frame_rate)
    shift = np.concatenate(([0.0], shift[:-1]))
    return np.interp(held + _asked(rig, record, control) + shift, *points)


def _asked(rig: Rig, record: Record, control: ControlName) -> Floats:
    """Return the host's command of a surface; zero if the record has no estimate."""
    pressure = "dynamic_pressure_Pa"
    if channel(control, "estimate") not in record or pressure not in record:
        return np.zeros(len(record))
    asked = replay_surface(rig, control, asked_of(record, control), record[pressure])
    return np.concatenate(([0.0], asked[:-1]))


def asked_of(record: Record, control: ControlName) -> Floats:
    """Return the recorded command of a surface, d: δ̂, or as changed by a jam or the other side."""
    rows = service_rows(record, control)
    return record[channel(control, "estimate")] if rows is None else rows.asked


def trim_of(rig: Rig, record: Record, control: ControlName) -> Trim | None:
    """Return a control's surface position in trim; None if the record does not show it."""
    name, points = surface_channel(control), surface_points(rig, control)
    if name not in record or points is None:
        return None
    own, noise, first = own_trim(rig, control), white(record[name]), float(record[name][0])
    off = _standing_off(rig, record, control, own)
    if off is None:  # by the rows before it moves
        start, error = start_of(record[name][: max(2, round(BRIEF_s * rig.frame_rate))], noise)
        at = own if abs(start - own) <= TRIM_SIGMAS * error else start
        return Trim(at, start, error)
    standing, error = off
    there = own + standing
    unsure = math.hypot(noise, KNOWN)
    excluded = min(abs(first - own), abs(first - there)) > TRIM_SIGMAS * unsure
    both = Trim(first, first, unsure, there - first)
    if abs(standing) <= TRIM_SIGMAS * error:
        plain = Trim(own, there, error)
        flown = _followed(rig, record, control, plain, both) if excluded else None
        return both if flown is not None and flown > RIVAL_GAIN else plain
    if excluded:
        return both
    there, error = _trimmed(rig, record, control, there)
    evidence = ((first - own) ** 2 - (first - there) ** 2) / max(noise, 1e-12) ** 2
    flown = _followed(rig, record, control, Trim(own, own, 0.0, standing), Trim(there, there, 0.0))
    in_trim = evidence > RIVAL_GAIN if flown is None else evidence + flown > -RIVAL_GAIN
    return Trim(there, there, error) if in_trim else Trim(own, own, noise, standing)


def trim_by_speed(rig: Rig, record: Record, control: ControlName) -> float:
    """Return the standard error of a surface's trim due to the measured airspeed, rad.

    0 if the trim is taken from the manifest or the rig file.
    """
    speed = "true_airspeed_m_per_s"
    if speed not in record or states_trim(record) or rig.flight is None:
        return 0.0
    noise = estimate_noise(record[speed])
    level = noise.rms * math.sqrt(noise.mean_variance)
    start, error = start_of(record[speed][: max(2, round(BRIEF_s * rig.frame_rate))], level)
    calibrated = rig.flight.calibrated_airspeed * (1.0 + NEGLIGIBLE)
    try:
        faster = own_trim(rig.changed({"flight.calibrated_airspeed_m_per_s": calibrated}), control)
    except InputError:  # no trim there
        return 0.0
    return abs(faster - own_trim(rig, control)) / NEGLIGIBLE * error / start


def states_trim(record: Record) -> bool:
    """Tell whether a record's manifest states the trim that was flown.

    The manifest of an imported log has a rig with which the log was compared, not flown.
    """
    table = record.manifest.get("rig")
    flown = isinstance(table, Mapping) and isinstance(table.get("flight"), Mapping)
    return flown and "imported_from" not in record.manifest


def start_of(position: Floats, noise: float) -> tuple[float, float]:
    """Return a channel's value in the first row, and its standard error.

    From the rows before it moves by more than noise: their mean, or the start of a parabola if that
    improves the fit.
    """
    moves = np.abs(position - position[:SHORT_FRAMES].mean()) > TRIM_SIGMAS * noise
    rows = int(np.argmax(moves)) if moves.any() else len(position)
    if rows < SHORT_FRAMES:
        return float(position[0]), noise
    seen, at = position[:rows], np.arange(rows)
    mean, parabola = float(seen.mean()), Polynomial.fit(at, seen, 2)
    gained = float(np.sum((seen - mean) ** 2 - (seen - parabola(at)) ** 2))
    if gained < TRIM_ANSWERED * noise**2:
        return mean, noise / math.sqrt(rows)
    return float(parabola(0.0)), 3.0 * noise / math.sqrt(rows)  # of the end of a parabola


def _trimmed(rig: Rig, record: Record, control: ControlName, near: float) -> tuple[float, float]:
    """Return a surface's position, rad, in the trim of an aircraft `near` that, and its error.

    With unequal travels, a command moves the surface otherwise than from the model's own trim.
    """
    found, error = near, math.inf
    for _ in range(ROUNDS):
        known = _standing_off(rig, record, control, found)
        assert known is not None  # the record has the command
        found, error = found + known[0], known[1]
    return found, error


def _standing_off(
    rig: Rig, record: Record, control: ControlName, trim: float
) -> tuple[float, float] | None:
    """Return a surface's initial offset from a trim and command, and its standard error, rad.

    Shortfall and lag behind the command are fitted too; if the command moves at once, they would
    imitate another trim. The offset is over the longest of `STANDING_s` from the record's start
    whose residual is noise alone (with play or a dead zone it is larger), or over the shortest.
    None if the record does not have the command.
    """
    estimate, pressure = channel(control, "estimate"), "dynamic_pressure_Pa"
    points = surface_points(rig, control)
    if estimate not in record or pressure not in record or points is None:
        return None
    wanted, measured = asked_of(record, control), record[surface_channel(control)]
    held = about(trim, filed_trim(rig, control), points)
    noise = estimate_noise(measured)
    error = noise.rms * math.sqrt(noise.mean_variance)
    found = 0.0, math.inf
    for time_s in STANDING_s:
        rows = max(2, round(time_s * rig.frame_rate))
        asked = replay_surface(rig, control, wanted[:rows], record[pressure][:rows])
        asked = asked + trim_shift(record, control, 1.0 / rig.frame_rate)[:rows]
        left = measured[1:rows] - np.interp(held + asked[:-1], *points)
        moved_by = np.interp(held + smoothed(asked)[:-1], *points) - np.interp(held, *points)
        found, leaves = _constant(left, moved_by, error)
        if leaves <= (1.0 + SMALL) * error:
            break
    return found


def _constant(left: Floats, ordered: Floats, noise: float) -> tuple[tuple[float, float], float]:
    """Return the constant part of a surface's deviation with its standard error, and what is left.

    All in rad, the last as rms. A share of the motion by the command, `ordered`, and of its rate
    are fitted beside the constant. If they do not improve the fit and the constant is significant,
    it is the mean, which is more precise. It is significant in that fit, or from the rows before
    the command has moved the surface by a quarter of it, since a lag is no larger than its command.
    """
    answers = np.column_stack([ordered, np.gradient(ordered)])
    answers /= np.maximum(np.linalg.norm(answers, axis=0), 1e-300)
    one = np.ones(len(left))
    apart = one - answers @ np.linalg.lstsq(answers, one)[0]  # orthogonal to the command
    known = float(apart @ apart)
    mean, alone = float(np.mean(left)), noise / math.sqrt(len(left))
    still = np.maximum.accumulate(np.abs(ordered)) <= PARTLY * abs(mean)
    count = max(1, int(still.sum()))
    at_once = abs(float(np.sum(left[still]))) > TRIM_SIGMAS * noise * math.sqrt(count)
    if known < 1e-9 * len(left):
        return (mean, alone if at_once else abs(mean) + alone), float(np.std(left))
    found, error = float(apart @ left) / known, noise / math.sqrt(known)
    rest = left - found
    rest -= answers @ np.linalg.lstsq(answers, rest)[0]
    leaves = math.sqrt(float(np.mean(rest**2)))
    if not at_once and abs(found) <= TRIM_SIGMAS * error:
        return (found, error), leaves
    if float(np.sum((left - mean) ** 2) - rest @ rest) < TRIM_ANSWERED * noise**2:
        return (mean, alone), leaves
    return (found, error), leaves


def _followed(
    rig: Rig, record: Record, control: ControlName, one: Trim, other: Trim
) -> float | None:
    """Return twice the log-likelihood gain of the `other` trim; None without the motion."""
    rows = min(len(record), round(FLIGHT_s * rig.frame_rate))
    short = Record(record.channels, record.data[:rows], record.manifest)
    weighed = WEIGHED if control == "column" else _LATERAL
    names = [name for name in weighed if name in record]
    if not names or rig.flight is None:
        return None
    lefts = []
    for trim in (one, other):
        surfaces, _ = moved(rig, short, {control: trim}, np.random.default_rng(43))
        given = (rig.flight, rig.frame_rate, flown_by(rig), surfaces, names, short)
        flown = fly_open_loop(*given)
        left = np.column_stack([short[n] - flown.motion[:, i] for i, n in enumerate(names)])
        linear = _lagged(smoothed(short[surface_channel(control)]), rig.frame_rate)
        left -= linear @ np.linalg.lstsq(linear, left, rcond=None)[0]
        lefts.append(left.T)
    gained = 0.0
    for before, after in zip(*lefts, strict=True):
        powers = [float(np.mean(left**2)) for left in (before, after)]
        quieter = before if powers[0] < powers[1] else after
        gained += rows / memory(quieter) * float(np.log(powers[0] / powers[1]))
    return gained


def _lagged(surface: Floats, rate_Hz: float) -> Floats:
    """Return a constant and delayed surface positions, shape (rows, 1 + lags).

    Model errors of the aircraft's response are linear in them; an error of the trim is not.
    """
    rows = np.arange(len(surface))
    before = [np.maximum(rows - round(lag * rate_Hz), 0) for lag in TRIM_LAGS_s]
    return np.column_stack([np.ones(len(surface)), *(surface[at] - surface[0] for at in before)])
