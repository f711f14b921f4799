"""Pilots: what a run file's `[pilot.CONTROL]` may say, and what it does to the grip.

Scripted force (step, ramp, doublet, 3-2-1-1, sweep, table), a held deflection (a
clamp: the force is what it takes), and a hand that looks at the pitch attitude. Edges
of scripted inputs are half cosines over `rise_s`, as a hand's are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from coupled.channels import LONGITUDINAL, TIME, channel
from coupled.csvfile import read_columns
from coupled.errors import InputError, nearest
from coupled.rig.packing import Hand
from coupled.rig.parameters import Control
from coupled.schema import Section, quantity

Floats = NDArray[np.float64]
Look = Callable[[float, tuple[float, ...]], float]


@dataclass(frozen=True)
class Action:
    """What a pilot does on one control.

    `force` in N and `held` in d are functions of time in s (arrays in, arrays out); `hand`
    is the impedance; `look`, where given, maps time and motion to a further force in N,
    once a frame.
    """

    force: Callable[[Floats], Floats] | None = None
    held: Callable[[Floats], Floats] | None = None
    hand: Hand = field(default_factory=Hand)
    look: Look | None = None


STRONGEST = 5000.0  # N; 14 CFR 25.143 asks at most 670 N of a pilot, for a short time


class Pilot(Section):
    """What every pilot has."""

    kind: str
    start: float = quantity("s", 1.0, ge=0, le=7200)

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return what this pilot does on a control.

        `gradient` is the specified one at the start, N/d; `name` the control's; files are
        sought in `folder`.
        """
        raise NotImplementedError


def edges(times: Floats, levels: Sequence[tuple[float, float]], rise: float) -> Floats:
    """Return a signal that goes to each (time, level) in turn, over `rise` seconds from it.

    `times` rise; each edge is a half cosine.
    """
    out = np.zeros_like(times)
    before = 0.0
    for at, level in levels:
        start, end = np.searchsorted(times, (at, at + rise))
        share = (times[start:end] - at) / rise if rise > 0.0 else times[start:end]
        out[start:end] += (level - before) * 0.5 * (1.0 - np.cos(np.pi * share))
        out[end:] += level - before
        before = level
    return out


class _Levels(Pilot):
    """A force that goes from level to level."""

    force: float = quantity("N", ge=-STRONGEST, le=STRONGEST)
    rise: float = quantity("s", 0.1, ge=0, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return the (time in s, share of the force) that the signal goes to."""
        raise NotImplementedError

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the scripted force."""
        return Action(force=lambda t: self.force * edges(t, self.levels(), self.rise))


class Step(_Levels):
    """A force held for `duration_s`, or to the end where that is 0."""

    kind: Literal["step"]
    duration: float = quantity("s", 0.0, ge=0, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return one level, and its end."""
        end = [(self.start + self.duration, 0.0)] if self.duration > 0.0 else []
        return [(self.start, 1.0), *end]


class Ramp(Pilot):
    """A force that grows evenly over `ramp_s`, and is then held."""

    kind: Literal["ramp"]
    force: float = quantity("N", ge=-STRONGEST, le=STRONGEST)
    ramp: float = quantity("s", ge=1e-3, le=7200)

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the ramp."""
        return Action(force=lambda t: self.force * np.clip((t - self.start) / self.ramp, 0.0, 1.0))


class Doublet(_Levels):
    """A force one way, then as long the other way."""

    kind: Literal["doublet"]
    half_period: float = quantity("s", ge=1e-3, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return the two halves."""
        t, half = self.start, self.half_period
        return [(t, 1.0), (t + half, -1.0), (t + 2 * half, 0.0)]


class ThreeTwoOneOne(_Levels):
    """The 3-2-1-1 of aircraft identification: alternating pulses of 3, 2, 1 and 1 units."""

    kind: Literal["3211"]
    unit: float = quantity("s", ge=1e-3, le=7200)

    def levels(self) -> list[tuple[float, float]]:
        """Return the four pulses."""
        at = self.start + self.unit * np.array([0, 3, 5, 6, 7])
        return list(zip(at.tolist(), [1.0, -1.0, 1.0, -1.0, 0.0], strict=True))


class Sweep(Pilot):
    """A sine whose frequency goes exponentially from `low_Hz` to `high_Hz`."""

    kind: Literal["sweep"]
    force: float = quantity("N", ge=-STRONGEST, le=STRONGEST)
    duration: float = quantity("s", ge=1e-3, le=7200)
    low: float = quantity("Hz", 0.1, ge=1e-3, le=50)
    high: float = quantity("Hz", 2.0, ge=1e-3, le=50)

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the sweep, faded in and out over a tenth of it."""

        def force(t: Floats) -> Floats:
            u = np.clip((t - self.start) / self.duration, 0.0, 1.0)
            ratio = np.log(self.high / self.low)
            scale = np.expm1(ratio * u) / ratio if ratio != 0.0 else u
            phase = 2.0 * np.pi * self.low * self.duration * scale
            fade = np.sin(0.5 * np.pi * np.clip(np.minimum(u, 1.0 - u) / 0.1, 0.0, 1.0)) ** 2
            return np.asarray(self.force * fade * np.sin(phase))

        return Action(force=force)


class Table(Pilot):
    """A force from a CSV with `time_s` and the control's force channel, straight between rows.

    `start_s` is added to the table's times; outside of them the force is zero.
    """

    kind: Literal["table"]
    file: str
    start: float = quantity("s", 0.0, ge=0, le=7200)

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the table's force."""
        times, forces = read_force_table(folder / self.file, channel(name, "force"))
        return Action(force=lambda t: np.interp(t - self.start, times, forces, left=0.0, right=0.0))


class Clamp(Pilot):
    """Holds the grip at a deflection; the force is what that takes.

    The clamp inverts the rig's own mass, damping and gradient, so that the error of
    deflection dies as exp(−bandwidth·t) on any rig, without a lasting error.
    """

    kind: Literal["clamp"]
    deflection: float = quantity("{d}")
    rise: float = quantity("s", 0.5, gt=0)
    duration: float = quantity("s", 0.0, ge=0, le=7200)
    bandwidth: float = quantity("rad_per_s", 6.0, gt=0, le=30)

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the held deflection, and the clamp's impedance."""
        end = [(self.start + self.duration, 0.0)] if self.duration > 0.0 else []
        levels = [(self.start, 1.0), *end]
        w, loader = self.bandwidth, control.loader
        hand = Hand(w * loader.damping, w * loader.mass, w * gradient)
        return Action(held=lambda t: self.deflection * edges(t, levels, self.rise), hand=hand)


class Attitude(Pilot):
    """A hand that captures a pitch attitude `change_rad` from where it finds it, and holds it.

    Force on the column through the muscle's lag: gain on the error of pitch, its integral,
    and pitch rate. Limited to `force_limit_N`.
    """

    kind: Literal["attitude"]
    change: float = quantity("rad", 0.0, ge=-1.5, le=1.5)
    rise: float = quantity("s", 1.0, ge=0)
    gain: float = quantity("N_per_rad", ge=0, le=1e6)
    rate_gain: float = quantity("N_s_per_rad", 0.0, ge=0, le=1e6)
    integral_gain: float = quantity("N_per_rad_s", 0.0, ge=0, le=1e6)
    lag: float = quantity("s", 0.1, ge=0, le=7200)
    force_limit: float = quantity("N", 330.0, gt=0, le=STRONGEST)
    _PITCH: ClassVar[int] = LONGITUDINAL.index("pitch_rad")
    _RATE: ClassVar[int] = LONGITUDINAL.index("pitch_rate_rad_per_s")

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the hand, with a memory of its own."""
        found, integral, last = None, 0.0, self.start

        def look(time: float, motion: tuple[float, ...]) -> float:
            nonlocal found, integral, last
            if time < self.start:
                return 0.0
            found = motion[self._PITCH] if found is None else found
            wanted = self.change * float(edges(np.array([time]), [(self.start, 1.0)], self.rise)[0])
            error = found + wanted - motion[self._PITCH]
            force = self.gain * error + integral - self.rate_gain * motion[self._RATE]
            if abs(force) < self.force_limit:
                integral += self.integral_gain * error * (time - last)
            last = time
            return min(max(force, -self.force_limit), self.force_limit)

        return Action(hand=Hand(lag_s=self.lag), look=look)


PILOTS: dict[str, type[Pilot]] = {
    "step": Step,
    "ramp": Ramp,
    "doublet": Doublet,
    "3211": ThreeTwoOneOne,
    "sweep": Sweep,
    "table": Table,
    "clamp": Clamp,
    "attitude": Attitude,
}


def read_force_table(path: Path, wanted: str) -> tuple[Floats, Floats]:
    """Return times in s and forces in N of a CSV; gaps and disorder are refused by row."""
    columns = read_columns(path)
    for name in (TIME, wanted):
        if name not in columns:
            raise InputError(path, name, f"no such column; {nearest(name, columns)}")
    times, forces = columns[TIME], columns[wanted]
    if np.max(np.abs(forces), initial=0.0) > STRONGEST:
        raise InputError(path, wanted, f"holds more than {STRONGEST:g} N, which no pilot can")
    if len(times) < 2:
        raise InputError(path, TIME, "needs at least two rows")
    disorder = np.flatnonzero(np.diff(times) <= 0.0)
    if disorder.size:
        raise InputError(path, TIME, f"must rise: row {disorder[0] + 3} does not")
    _refuse_gaps(times, path)
    return times, forces


def _refuse_gaps(times: Floats, path: Path) -> None:
    """Refuse a sampled table with missing rows; a few typed breakpoints may lie as they like."""
    steps = np.diff(times)
    usual = float(np.median(steps))
    if np.mean(np.abs(steps - usual) < 0.02 * usual) < 0.8:
        return
    wide = np.flatnonzero(steps > 1.5 * usual)
    if wide.size:
        row = wide[0]
        raise InputError(
            path,
            TIME,
            f"gap of {steps[row]:g} s after row {row + 2} in a table of {usual:g} s steps; fill it",
        )
