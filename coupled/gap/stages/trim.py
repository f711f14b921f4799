"""The surface positions in trim of a record, which may differ from the model's.

A record starts in trim. A surface that differs from the model's trim by more than noise has one of
two causes. If the aircraft trims elsewhere (other weight, lift or moment), the first row is
there too, and the aircraft stays in trim. If something moved the surface afterwards (a rigging
offset), the aircraft responds. The two are compared by the first row, and by the model's residual
in open-loop flight. If the first row excludes each alone, both causes are present. If the two
cancel from the second row on, the flight must confirm them as well. Without evidence the aircraft's
trim is assumed; for a record without motion, a fault of the surface.

The trim is also an output that is compared with the model's trim. With the angle of attack in trim
it discriminates lift, moment and weight.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.conditions import trim_shift
from coupled.gap.signals.output import estimate_noise, memory, white
from coupled.gap.stages.openloop import about, fly_open_loop
from coupled.gap.stages.surfaces import (
    Trim,
    asked_of,
    filed_trim,
    flown_by,
    moved,
    own_trim,
    surface_channel,
    surface_points,
)
from coupled.gap.thresholds import (
    KNOWN,
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
    TRIM_LAGS_s,
)
from coupled.record.channels import ControlName, channel
from coupled.record.record import Record
from coupled.rig.replay import replay_surface
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
WEIGHED = ("pitch_rate_rad_per_s", "alpha_rad", "load_factor")
_LATERAL = ("roll_rate_rad_per_s", "yaw_rate_rad_per_s", "sideslip_rad")


def trim_of(rig: Rig, record: Record, control: ControlName) -> Trim | None:
    """Return a control's surface position in trim; None if the record does not show it."""
    name, points = surface_channel(control), surface_points(rig, control)
    if name not in record or points is None:
        return None
    own, noise, first = own_trim(rig, control), white(record[name]), float(record[name][0])
    off = _standing_off(rig, record, control, own)
    if off is None:  # by the rows before it moves
        start, error = _start_of(record[name][: max(2, round(BRIEF_s * rig.frame_rate))], noise)
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


def _start_of(position: Floats, noise: float) -> tuple[float, float]:
    """Return a surface's position in the first row, rad, and its standard error.

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
    """Return a surface's position in the trim of an aircraft that trims `near` it, and its error.

    A command moves the surface from there, by another amount than from the model's own trim if the
    surface's travels are unequal. Both in rad.
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
    imitate another trim. The offset is estimated over the longest of `STANDING_s` from the record's
    start whose residual is noise alone: with play or a dead zone the residual is larger. If it is
    larger for each of these times, the shortest is used. Return None if the record does not have
    the command.
    """
    estimate, pressure = channel(control, "estimate"), "dynamic_pressure_Pa"
    points = surface_points(rig, control)
    if estimate not in record or pressure not in record or points is None:
        return None
    wanted, measured = asked_of(record, control), record[surface_channel(control)]
    held = about(trim, filed_trim(rig, control), points)
    noise = estimate_noise(measured)
    crowded = (1.0 + noise.memory) / (1.0 - noise.memory)  # variance of a mean, over white noise's
    error = noise.rms * math.sqrt(crowded)
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

    All in rad, the last as rms. `ordered` is the motion by the command. A share of it and of its
    rate are fitted beside the constant. If they do not improve the fit and the constant is
    significant, it is estimated by the mean, which is more precise. It is significant in that fit,
    or from the rows before the command has moved the surface by a quarter of it, since a lag is no
    larger than its command.
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
    """Return twice the log-likelihood gain of the `other` trim over the `one`.

    None if the record does not have the motion.
    """
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
