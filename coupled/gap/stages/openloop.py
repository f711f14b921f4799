"""The JSBSim model flown open loop from its own trim, driven by the measured surfaces.

An aircraft with another weight, lift or moment trims at other surface positions. The record gives
its surface positions in trim (`surfaces`). The surfaces' deflections from there are added to the
model's own trim, so that the model does not start with a transient from one trim to the other. A
measured trim has an error, which would act on a model as a constant deflection, and its attitude
would drift. If the model's own trim is within that error, the record's trim is therefore taken to
be the model's own; beyond, it is the measured one. In between would be a barrier: a deflection of
up to the error, in a model that trims elsewhere.

Speed and attitude integrate every small error, so that an open-loop flight drifts away from the
record. For them the model is restarted every few seconds from the measured speed, flow angles,
rates, attitude and altitude: multiple shooting (Jategaonkar 2015; Klein and Morelli 2016). Within a
segment drag, thrust and the phugoid show. Engines and control laws are not restarted: their inputs
are known. States that are not recorded stay those of the model.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Literal

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.ndimage import median_filter

from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.altered import STILL
from coupled.flight.everyframe import PROPERTIES
from coupled.flight.gusts import DRAWN, GivenAir, Gusts, in_pairs
from coupled.gap.noise.smooth import Smoother, smoothed
from coupled.gap.signals.conditions import trim_shift, wrappers_of
from coupled.gap.signals.output import Floats, estimate_noise
from coupled.gap.thresholds import LOST_MOTION, NEGLIGIBLE, SAME_TRIM_rad, SHORTEST_RECORD_s
from coupled.record.channels import ControlName, motion_channels
from coupled.record.levers import levers_of
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight
from coupled.rig.placed import Commands
from coupled.rig.recorder import stamped
from coupled.schema import changed
from coupled.units import FOOT_m

Points = tuple[Floats, Floats]
Between = Literal["held", "pchip", "spline", "jumps"]
States = Mapping[int, Mapping[str, float]]  # by row: the measured states, by channel
SLOW = ("true_airspeed_m_per_s", "pitch_rad")
NEEDS = (*SLOW, "alpha_rad", "pitch_rate_rad_per_s")
BESIDE = (
    *("sideslip_rad", "roll_rate_rad_per_s", "yaw_rate_rad_per_s"),
    *("roll_rad", "heading_rad", "altitude_m"),
)
_SI = {"true_airspeed_m_per_s": FOOT_m, "altitude_m": FOOT_m}  # JSBSim has the others in SI


def command_of(position: Floats, points: Points) -> Floats:
    """Return the commands about trim that give these surface positions, same shape."""
    commands, positions = points
    order = np.argsort(positions)
    return np.interp(position, positions[order], commands[order])


def about(position: float, filed: float, points: Points) -> float:
    """Return the command that holds a surface at a position, about that of the `filed` trim."""
    if abs(position - filed) <= SAME_TRIM_rad:
        return 0.0
    held, before = command_of(np.array([position, filed]), points)
    return float(held - before)


@dataclass(frozen=True)
class Moved:
    """The motion of one control's surface over a record.

    `channel` is its name. With a map from command to position (`points`), `values` are positions
    in rad, `trim` is the measured position in trim with the largest error `unsure`, and `filed` is
    the position in trim of the map's model. With a `gain`, rad of the surface per command, `values`
    are positions that the commands are to reach beside the aircraft's own laws. Otherwise `values`
    are commands about trim. Row k is the input of the motion in row k.
    """

    channel: str
    values: Floats
    points: Points | None = None
    trim: float = 0.0
    filed: float = 0.0
    unsure: float = 0.0
    gain: float = 0.0

    def commands(self, own: float) -> Floats:
        """Return the commands about the trim of a model whose surface trims at `own`."""
        if self.points is None:
            return self.values
        off = own - self.trim
        moved = off if abs(off) > max(self.unsure, SAME_TRIM_rad) else 0.0
        return command_of(self.values + moved, self.points) - about(own, self.filed, self.points)


@dataclass(frozen=True)
class Flown:
    """A flight: the requested channels, shape (frames, channels), and the surfaces in trim."""

    motion: Floats
    trim: tuple[float, ...]  # rad, in the order of the controls


@dataclass(frozen=True)
class Manner:
    """How a model is flown beside its surfaces.

    air           the motion of the air
    between_rows  how the commands change over a frame of several steps: `held`, as those of a host,
                  or interpolated, or with jumps at a frame's start
    restarts      states of the motion from which the flight goes on, by row
    coarse        whether steps are twice as wide; rows between them are interpolated
    """

    air: GivenAir = DRAWN
    between_rows: Between = "held"
    restarts: States = field(default_factory=dict)
    coarse: bool = False


def fly_open_loop(
    flight: Flight,
    frame_rate_Hz: float,
    controls: Sequence[ControlName],
    moved: Sequence[Moved],
    channels: Sequence[str],
    record: Record | None = None,
    manner: Manner | None = None,
) -> Flown:
    """Return the flight of a model from its trim, driven by its surfaces; a row for each frame.

    A channel may be any property of the model, in JSBSim's unit; it is 0 if the model lacks it. The
    conditions of the flight of a `record` act on the model as on the aircraft; recorded surface
    positions include their shift of the trim. Raises InputError if the model cannot be trimmed.
    """
    manner = Manner() if manner is None else manner
    frame_s, steps, rows, air = 1.0 / frame_rate_Hz, 1, len(moved[0].values), manner.air
    shifts = [0.0 if record is None else trim_shift(record, one, frame_s)[:-1] for one in controls]
    per_frame, wide = flight.steps_per_frame, 1
    if manner.coarse and per_frame > 1:
        per_frame //= 2
    elif manner.coarse:
        wide = 2
        frame_s, air = wide * frame_s, air.in_pairs()
    if manner.between_rows != "held" and per_frame > 1:
        steps, per_frame = per_frame, 1
        frame_s /= steps
        air = air.repeated(steps)
    conditions = [] if record is None else wrappers_of(record, frame_s)
    still = changed(flight, {**STILL, "steps_per_frame": per_frame}, "rig", "flight")
    gusts = Gusts(still, frame_s, air=air)
    models = [aircraft_folder()]
    airframe = make_aircraft(still, frame_s, controls, models, conditions=conditions, gusts=gusts)
    start = dict(zip(motion_channels(controls, flown=True), airframe.motion(), strict=True))
    trim = tuple(start[one.channel] for one in moved)
    asked = np.zeros((rows + 1, 3))
    for i, (one, own) in enumerate(zip(moved, trim, strict=True)):
        asked[:-1, i] = one.commands(own)
        if one.points is not None:
            asked[1:-1, i] -= shifts[i]  # a row results from the frame before it
    asked[-1] = asked[-2]
    if steps == 1:
        asked = asked[1:] if wide == 1 else in_pairs(asked[1:])
    else:  # at each step after the first row
        at = (1.0 + np.arange((len(asked) - 1) * steps)) / steps
        asked = _between(asked, at, manner.between_rows)
    states = {row * steps // wide: state for row, state in manner.restarts.items()}
    led = [
        _Led(i, airframe.reader(PROPERTIES[one.channel]), one.gain)
        for i, one in enumerate(moved)
        if one.gain
    ]
    motion = _motion(airframe, asked, channels, states, led)[::steps]
    if wide > 1:
        known = wide * np.arange(len(motion))
        motion = np.column_stack([np.interp(np.arange(rows), known, one) for one in motion.T])
    return Flown(motion, trim)


def _between(rows: Floats, at: Floats, law: Between) -> Floats:
    """Return the commands of rows, shape (rows, controls), at given numbers of rows.

    A jump may lie anywhere between two rows. An interpolation spreads it over the frame; by `jumps`
    it is at the start of the frame. It is what exceeds the median change of three frames.
    """
    jumped = np.zeros_like(rows)
    if law == "jumps":
        changes = np.diff(rows, axis=0)
        usual = median_filter(changes, size=(3, 1), mode="nearest")
        jumped[1:] = np.cumsum(changes - usual, axis=0)
    smooth = CubicSpline if law == "spline" else PchipInterpolator
    line = smooth(np.arange(len(rows)), rows - jumped, axis=0)(at)
    return np.asarray(line + jumped[np.ceil(at).astype(int)])


@dataclass
class _Led:
    """The commands of a surface that is led to positions: number of the control, and the last one.

    `laws` is what the aircraft's own laws added in the frame before, rad, continued linearly.
    """

    number: int
    position: Callable[[], float] | None
    gain: float
    last: float = 0.0
    laws: float | None = None

    def to(self, wanted: float) -> float:
        """Return the command that leads the surface to a position, rad."""
        assert self.position is not None
        laws = self.position() - self.gain * self.last
        before = laws if self.laws is None else self.laws
        self.last = min(max((wanted - 2.0 * laws + before) / self.gain, -1.0), 1.0)
        self.laws = laws
        return self.last


def _reaching(commands: Commands, led: Sequence[_Led]) -> Commands:
    """Return the commands in which those of surfaces that are led reach their positions."""
    by_number = {one.number: one.to(commands[one.number]) for one in led}
    column, wheel, pedals = (by_number.get(i, own) for i, own in enumerate(commands))
    return column, wheel, pedals


def _motion(
    airframe: JSBSimAirframe,
    asked: Floats,
    channels: Sequence[str],
    restarts: States,
    led: Sequence[_Led],
) -> Floats:
    """Return the channels, SI, shape (steps, channels), of a flight with commands about trim.

    A row results from the commands of the row before, or is a state of `restarts`. The columns of
    surfaces that are `led` have their positions.
    """
    each = [airframe.reader(PROPERTIES.get(name, name)) for name in channels]
    step, readers = airframe.step, [read or float for read in each]
    motion, columns = array("d"), asked.T.tolist()  # lists of rows take a tenth of the time
    for k, commands in enumerate(zip(*columns, strict=True)):
        now = [read() for read in readers]
        if (state := restarts.get(k)) is not None:
            airframe.put(state)
            put = zip(channels, readers, strict=True)
            now = [state[n] / _SI.get(n, 1.0) if n in state else read() for n, read in put]
        if not abs(now[0]) <= LOST_MOTION:  # true for NaN too
            motion.extend((motion[-len(now) :] or array("d", now)) * (len(asked) - k))
            break
        motion.extend(now)
        step(_reaching(commands, led) if led else commands)
    found = np.frombuffer(motion).reshape(len(asked), len(channels))
    return found * [_SI.get(name, 1.0) for name in channels]


@dataclass(frozen=True)
class Restarts:
    """The measured states of a record, by channel: as recorded, and smoothed."""

    recorded: Mapping[str, Floats]
    smooth: Mapping[str, Floats]
    every: int  # frames

    @classmethod
    def of(cls, record: Record, frame_rate_Hz: float) -> Restarts | None:
        """Return the restarts of a record; None if it lacks a channel or does not last for two."""
        every = round(SHORTEST_RECORD_s * frame_rate_Hz)
        if lacking(record) or len(record) <= every:
            return None
        names = (*NEEDS, *(one for one in BESIDE if one in record))
        read = {name: record[name] for name in names}
        if "heading_rad" in read:
            read["heading_rad"] = np.unwrap(read["heading_rad"])
        return cls(read, {name: smoothed(values) for name, values in read.items()}, every)

    def at(self, late: float = 0.0, zeros: Mapping[str, float] = MappingProxyType({})) -> States:
        """Return the states at the restarts; the motion is stamped so many frames `late`.

        `zeros` are readings of the sensors at zero, by channel.
        """
        each = ((name, stamped(x, -late)) for name, x in self.smooth.items())
        return self.rows({name: x - zeros.get(name, 0.0) for name, x in each})

    def wrong(self, sample: int) -> States:
        """Return the states with a sample of their error, by its number."""
        rng = np.random.default_rng([53, sample])
        found = dict[str, Floats]()
        for name, read in self.recorded.items():
            noise = estimate_noise(read)
            error = Smoother.of(read).wiener_error(noise, len(read), rng)
            found[name] = self.smooth[name] + error
        return self.rows(found)

    def rows(self, each: Mapping[str, Floats]) -> States:
        """Return the states of some channels at the restarts."""
        rows = range(self.every, len(each[NEEDS[0]]), self.every)
        return {row: {name: float(values[row]) for name, values in each.items()} for row in rows}


def lacking(record: Record) -> tuple[str, ...]:
    """Return the channels that a record lacks to judge speed and attitude."""
    return tuple(name for name in NEEDS if name not in record)


def is_throttled(record: Record) -> bool:
    """Tell whether a throttle moves in a record, and is none of `levers_of`, so not the model's."""
    levers = levers_of(record.channels)
    own = [name for name in record.channels if "throttle" in name and name not in levers]
    return any(float(np.ptp(record[name])) > NEGLIGIBLE for name in own)


def not_judged(records: Sequence[Record]) -> str:
    """Return what the records do not show of the airframe, in a sentence; empty if one does."""
    if all(map(is_throttled, records)):
        return (
            "The throttle moves, and the model's stays as in trim: speed and attitude, which show "
            "drag and thrust, cannot be judged. Name its channel throttle_norm, from 0 to 1."
        )
    each = [lacking(record) for record in records]
    if not all(each):
        return ""
    fewest: tuple[str, ...] = min(each, key=len)
    names = ", ".join(fewest)
    return f"Without {names}, speed and attitude are not judged: they show drag and thrust."
