"""The airframe's residuals: the JSBSim model, driven from trim by the measured surfaces.

The measured surface deflections from trim are added to the model's own trim, and the model is
flown open loop (`openloop`). Rates, angle of attack, sideslip and load factor are compared, since
errors in them decay within seconds. Speed and pitch attitude integrate every small error, and are
compared in short segments. The elevator position in trim is compared too (`surfaces`). `air`
estimates the motion of the air.

If the aircraft's control laws move a surface, the host's command is the input: it is flown through
JSBSim's laws, and the surface is an output.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from hashlib import sha256
from typing import Any

import numpy as np

from coupled.errors import InputError
from coupled.flight.gusts import DRAWN, GivenAir
from coupled.gap.noise.noise import Floats, Noise
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.air import NEEDS_ACROSS, Air, crossing_air, vertical_air
from coupled.gap.signals.floors import left_noise
from coupled.gap.signals.output import (
    TRIM,
    CoarseRig,
    HiddenGap,
    Output,
    estimate_noise,
    lasting,
    spread,
    white,
)
from coupled.gap.stages.openloop import (
    SLOW,
    Between,
    Flown,
    Manner,
    Moved,
    Restarts,
    States,
    fly_open_loop,
    is_throttled,
)
from coupled.gap.stages.surfaces import (
    Trim,
    flown_by,
    is_led,
    moved,
    surface_channel,
    surface_points,
    trim_by_speed,
    trim_of,
)
from coupled.gap.thresholds import FAR, KNOWN, NEARLY_ALL, ROUGH, SHOT_TRIES
from coupled.parallel import in_threads, in_turn
from coupled.record.channels import LATERAL, ControlName, channel, motion_channels
from coupled.record.record import Record
from coupled.rig.parameters import Flight
from coupled.rig.recorder import ZEROS, stamped, zero_of
from coupled.rig.rig import Rig
from coupled.units import GRAVITY_m_per_s2

RATE = "pitch_rate_rad_per_s"
_LATERAL = ("roll_rate_rad_per_s", "yaw_rate_rad_per_s", "sideslip_rad")
COMPARED = (RATE, "alpha_rad", "load_factor", *_LATERAL)
SHOT = (RATE, *SLOW)  # channels of a flight with restarts
_SIDE = ("forces/fby-total-lbs", "inertia/weight-lbs")
_KEPT = 128  # size of the cache of flights: most of a search; 0.4 MB each in a minute of record


class Flights:
    """A cache of a record's last flights, by aircraft, surface motion and motion of the air.

    It also keeps the changes of a flight by measuring errors. They are those of the aircraft that
    was first flown in air of the same gusts, an approximation for another aircraft.
    """

    def __init__(self) -> None:
        self.law: Between | None = None  # of the commands between rows, once it is estimated
        self._known: list[tuple[tuple[Any, ...], Flown | None]] = []
        self._errors: dict[tuple[Any, ...], list[Floats]] = {}

    def errors(self, what: str, flight: Flight, fly: Callable[[], list[Floats]]) -> list[Floats]:
        """Return the changes of a flight by errors from the cache, or new ones."""
        asked = what, flight.gust_rms, flight.lateral_gust_rms
        if asked not in self._errors:
            self._errors[asked] = fly()
        return self._errors[asked]

    def of(self, asked: tuple[Any, ...], fly: Callable[[], Flown]) -> Flown | None:
        """Return a flight from the cache or a new one; None if the aircraft cannot be trimmed."""
        for known, flown in self._known:
            if known == asked:
                return flown
        made: Flown | None
        try:
            made = fly()
        except InputError:  # no trim with such a mass, lift or moment
            made = None
        self._known[:] = [*self._known[1 - _KEPT :], (asked, made)]
        return made


@dataclass
class Model:
    """The aircraft of one record, driven by its surfaces."""

    rig: Rig
    record: Record
    moved: Sequence[Moved]
    compared: tuple[str, ...] = ()
    flights: Flights = field(default_factory=Flights)
    number: int = 0  # of the record

    @cached_property
    def restarts(self) -> Restarts | None:
        """The measured states from which speed and attitude are predicted."""
        return Restarts.of(self.record, self.rig.frame_rate)

    @cached_property
    def side_m_per_s2(self) -> Floats | None:
        """The side force per mass that the model has in the measured flow, shape (frames,).

        None if the record lacks a channel of the flow.
        """
        if self.restarts is None or any(name not in self.record for name in NEEDS_ACROSS):
            return None
        assert self.rig.flight is not None
        states, names = replace(self.restarts, every=1).at(), (RATE, *_SIDE)
        motion = self.fly(self.rig.flight, self.moved, restarts=states, channels=names, air=DRAWN)
        return np.asarray(motion.motion[:, 1] / motion.motion[:, 2] * GRAVITY_m_per_s2)

    @cached_property
    def up(self) -> Air | None:
        """The vertical motion of the air; None if the record lacks a channel."""
        return vertical_air(self.record, 1.0 / self.rig.frame_rate, self.side_m_per_s2)

    @cached_property
    def across(self) -> Air | None:
        """The motion of the air across the heading; None if the record lacks a channel."""
        return crossing_air(self.record, 1.0 / self.rig.frame_rate, self.side_m_per_s2)

    def air(self, flight: Flight, late: float = 0.0, with_error: bool = False) -> GivenAir:
        """Return the air of a flight with gusts, over each frame.

        The recorded motion, and so the estimate, is `late` frames late. `with_error` adds a sample
        of its error.
        """

        def scaled(rms: float, air: Air | None) -> list[float] | None:
            if air is None or air.rms == 0.0:
                return None
            moves = air.speed * (rms / air.rms)
            moves = stamped(moves + air.error if with_error else moves, -late)
            return [*moves[1:].tolist(), 0.0]  # row k + 1 holds the air over the frame before

        return GivenAir(
            scaled(flight.gust_rms, self.up) if flight.gust_rms > 0.0 else None,
            scaled(flight.lateral_gust_rms, self.across) if flight.lateral_gust_rms > 0.0 else None,
        )

    def flown(self, rig: Rig) -> Flown | None:
        """Return the compared channels and the trim of `rig`; None if it cannot be trimmed.

        That of a coarse rig is flown coarsely (`fly_open_loop`).
        """
        return self._flown(rig)[0]

    def shots(self, rig: Rig) -> Flown | None:
        """Return `SHOT` with restarts; None if `rig` cannot be trimmed."""
        return self._flown(rig)[1]

    def _flown(self, rig: Rig) -> list[Flown | None]:
        """Return the flight of `rig`, and that with restarts if they are known.

        The two are flown at once: what compares one of them compares the other too.
        """
        assert rig.flight is not None
        flight, coarse = _in_time(rig), isinstance(rig, CoarseRig)
        # The air is estimated from the recorded motion, so it has the same late time stamps.
        late = rig.flight.motion_stamp * self.rig.frame_rate
        driven, states, read = _digest(self.moved), self.restarts, rig.flight

        def plain() -> Flown | None:
            moves = late if has_gusts(flight) else 0.0
            asked = (coarse, moves, self.compared, driven, flight)
            fly = partial(self.fly, flight, self.moved, late=moves, coarse=coarse)
            return self.flights.of(asked, fly)

        def restarted() -> Flown | None:
            assert states is not None
            fly = partial(self.fly, flight, self.moved, late=late, coarse=coarse)
            zeros = {name: zero_of(read, name) for name in states.smooth}
            asked = (coarse, late, SLOW, driven, flight, *zeros.values())
            return self.flights.of(asked, lambda: fly(restarts=states.at(late, zeros)))

        if states is None or is_throttled(self.record):
            return [plain(), None]
        return in_threads(lambda fly: fly(), [plain, restarted])

    @property
    def law(self) -> Between:
        """How the commands change between rows, in all flights of the record."""
        if self.flights.law is None:
            flight = self.rig.flight
            assert flight is not None
            known = self.rig.controls or flight.steps_per_frame == 1 or not self.compared
            self.flights.law = "held" if known or self._holds_commands() else "pchip"
        return self.flights.law

    def _holds_commands(self) -> bool:
        """Tell whether the motion has the whole change that commands held over a row make.

        A simulation may hold its commands from row to row. If the commands jump within the rows,
        the motion has about half of this change. The share is the projection of the residual on the
        change. The time stamps of the motion may be late or early by half a row.
        """
        measured = np.column_stack([self.record[name] for name in self.compared])

        def motion(law: Between) -> tuple[Floats, Floats]:
            flown = self.fly(_in_time(self.rig), self.moved, between=law).motion
            each = [np.column_stack([stamped(x, by) for x in flown.T]) for by in (-0.5, 0.0, 0.5)]
            squares = [np.maximum(np.mean((measured - x) ** 2, axis=0), 1e-300) for x in each]
            best = int(np.argmin([np.sum(np.log(one)) for one in squares]))
            return each[best], squares[best]

        laws: tuple[Between, ...] = ("held", "pchip")
        try:
            (held, squares), (other, _) = in_threads(motion, laws)
        except InputError:  # no trim
            return False
        change = (held - other) / np.sqrt(squares)
        left = (measured - other) / np.sqrt(squares)
        share = float(np.sum(left * change)) / max(float(np.sum(change**2)), 1e-300)
        return share > NEARLY_ALL

    def unknown_between(self, plain: Floats, by_shots: bool = False) -> list[float]:
        """Return the mean square change of each channel by other interpolations between the rows.

        `by_shots`: those of `SHOT`.
        """
        flight, restarts = _in_time(self.rig), self.restarts if by_shots else None
        if self.law == "held":
            return [0.0] * plain.shape[1]
        states = None if restarts is None else restarts.at()

        def change(law: Between) -> Floats:
            other = self.fly(flight, self.moved, between=law, restarts=states).motion
            return np.asarray(np.mean((other - plain) ** 2, axis=0))

        others: tuple[Between, ...] = ("spline", "jumps")
        return [float(one) for one in np.sum(in_threads(change, others), axis=0)]

    def restarted(self) -> Floats:
        """Return the change of `SHOT` by restarts from the model's own states.

        It is numerical error, and what a state that is not recorded changes.
        """
        assert self.restarts is not None
        flight, channels = _in_time(self.rig), (RATE, *self.restarts.recorded)
        plain = self.fly(flight, self.moved, channels=channels).motion
        states = self.restarts.rows(dict(zip(channels[1:], plain[:, 1:].T, strict=True)))
        again = self.fly(flight, self.moved, restarts=states).motion
        return again - plain[:, [channels.index(name) for name in SHOT]]

    def carried(
        self, wrong: Sequence[Sequence[Moved]], plain: Floats, by_shots: bool = False
    ) -> list[Floats]:
        """Return the changes of the flight by errors of the surfaces' motion and of the air.

        `by_shots`: those of `SHOT`, by errors of the restarts too.
        """
        flight, restarts = _in_time(self.rig), self.restarts if by_shots else None

        def change(sample: int) -> Floats:
            states = None if restarts is None else restarts.wrong(sample)
            return self.fly(flight, wrong[sample], True, restarts=states).motion - plain

        return in_threads(change, range(len(wrong)))

    def fly(
        self,
        flight: Flight,
        moved: Sequence[Moved],
        with_error: bool = False,
        late: float = 0.0,
        between: Between | None = None,
        restarts: States | None = None,
        channels: tuple[str, ...] = (),
        air: GivenAir | None = None,
        coarse: bool = False,
    ) -> Flown:
        """Return the flight with the given surface motion, interpolated between the rows.

        `with_error` adds a sample of its error to the air, whose estimate is `late` frames late,
        if it is not given. The `channels` are those compared, or of a flight with restarts the
        slow ones.
        """
        air = self.air(flight, late, with_error) if air is None else air
        channels = channels or (self.compared if restarts is None else SHOT)
        given = (flight, self.rig.frame_rate, flown_by(self.rig), moved, channels, self.record)
        manner = Manner(air, between or self.law, restarts or {}, coarse)
        return in_turn(partial(fly_open_loop, *given, manner))


def _in_time(rig: Rig) -> Flight:
    """Return the aircraft of a rig whose motion is recorded in time and with right zeros."""
    assert rig.flight is not None
    zeros = dict.fromkeys(ZEROS.values(), 0.0)
    return rig.flight.model_copy(update={"motion_stamp": 0.0, **zeros})


def has_gusts(flight: Flight) -> bool:
    """Tell whether the air of an aircraft moves."""
    return max(flight.gust_rms, flight.lateral_gust_rms) > 0.0


def _digest(moved: Sequence[Moved]) -> bytes:
    """Return a hash of the surfaces' motion."""
    found = sha256()
    for one in moved:
        found.update(repr((one.channel, one.trim, one.filed, one.unsure)).encode())
        for values in (one.values, *(one.points or ())):
            found.update(values.tobytes())
    return found.digest()


def needs(rig: Rig, record: Record) -> tuple[str, ...]:
    """Return the channels that are necessary to judge the airframe by this record.

    They include the command of a control that was moved and has no surface position.
    """
    own = (surface_channel("column"),) if "column" in flown_by(rig) else ()
    found: tuple[str, ...] = (RATE, *own)
    for control in rig.controls:
        by_position = surface_channel(control) in record and surface_points(rig, control)
        if not by_position and _was_moved(record, control):
            found += (channel(control, "estimate"), "dynamic_pressure_Pa")
    return found


def _was_moved(record: Record, control: ControlName) -> bool:
    names = (channel(control, quantity) for quantity in ("force", "computed", "deflection"))
    return any(name in record and np.ptp(record[name]) > 0.0 for name in names)


def gusts_of(rig: Rig, record: Record) -> Model | None:
    """Return the aircraft of a record, which estimates the motion of the air; None for a bench."""
    if rig.flight is None or any(name not in record for name in needs(rig, record)):
        return None
    return Model(rig, record, _driven(rig, record)[0])


def _driven(
    rig: Rig, record: Record
) -> tuple[list[Moved], list[list[Moved]], dict[ControlName, Trim]]:
    """Return the motion of the surfaces, the same with samples of its error, and the trims."""
    each = {control: trim_of(rig, record, control) for control in flown_by(rig)}
    trims = {control: trim for control, trim in each.items() if trim is not None}
    rng = np.random.default_rng(43)
    made = [moved(rig, record, trims, rng) for _ in range(SHOT_TRIES)]
    return made[0][0], [wrong for _, wrong in made], trims


def airframe_outputs(
    rig: Rig, record: Record, number: int = 0, flights: Flights | None = None
) -> list[Output]:
    """Return the airframe's outputs; empty for a bench, or if channels are missing.

    `flights` is a cache of flights of the same record.
    """
    if rig.flight is None or any(name not in record for name in needs(rig, record)):
        return []
    judged = _known_motion(rig, record)
    by_laws = [
        surface_channel(control)
        for control in flown_by(rig)
        if surface_points(rig, control) is None and not is_led(rig, record, control)
    ]
    wanted = [name for name in (*COMPARED, *by_laws) if name in judged and name in record]
    compared = tuple(name for name in wanted if np.ptp(record[name]) > 0.0)
    right, wrong, trims = _driven(rig, record)
    known = Flights() if flights is None else flights
    model = Model(rig, record, right, compared, known, number)
    flown = model.flown(rig)
    assert flown is not None  # the filed rig can be trimmed
    carried = known.errors("open loop", rig.flight, lambda: model.carried(wrong, flown.motion))
    unknown = model.unknown_between(flown.motion)
    outputs = []
    for i, name in enumerate(compared):
        measured = record[name]
        noise = left_noise(estimate_noise(measured), measured, measured - flown.motion[:, i])
        own = float(np.hypot(noise.rms, KNOWN * np.ptp(measured)))
        errors = [one[:, i] for one in carried]
        outputs.append(_output(model, name, model.flown, i, noise, own, errors, unknown[i]))
    if model.restarts is not None and not is_throttled(record):
        outputs += _slow_outputs(model, wrong)
    if "column" in trims:
        outputs.append(_trim_output(model, trims["column"]))
    return outputs


def _slow_outputs(model: Model, wrong: Sequence[Sequence[Moved]]) -> list[Output]:
    """Return speed and pitch attitude, predicted in segments restarted as measured."""
    record, flight, shots = model.record, model.rig.flight, model.shots(model.rig)
    assert flight is not None and shots is not None  # the filed rig can be trimmed
    errors_of, plain = model.flights.errors, shots.motion
    carried = errors_of("shots", flight, lambda: model.carried(wrong, plain, by_shots=True))
    (restarted,) = errors_of("restarts", flight, lambda: [model.restarted()])
    unknown = model.unknown_between(plain, by_shots=True)
    outputs = []
    for i, name in enumerate(SHOT[1:], 1):
        measured = record[name]
        noise = left_noise(estimate_noise(measured), measured, measured - plain[:, i])
        known = KNOWN * np.ptp(measured)
        own = float(np.sqrt(noise.rms**2 + known**2 + np.mean(restarted[:, i] ** 2)))
        errors = [one[:, i] for one in carried]
        outputs.append(_output(model, name, model.shots, i, noise, own, errors, unknown[i]))
    return outputs


def _output(
    model: Model,
    name: str,
    flown: Callable[[Rig], Flown | None],
    column: int,
    noise: Noise,
    own: float,
    errors: Sequence[Floats],
    between: float,
) -> Output:
    """Return a channel as an output, predicted by a column of a flight of a rig.

    The floor is `own`, the propagated `errors`, and the mean square `between` of what happens
    between the rows.
    """
    measured, rate_Hz = model.record[name], model.rig.frame_rate
    moved_by = float(np.sqrt(np.mean(np.square(errors)) + between))
    floor = float(np.hypot(own, moved_by))

    def predict(rig: Rig) -> Floats:
        assert rig.flight is not None
        made = flown(rig)
        if made is None:
            return measured + FAR * floor
        late = rig.flight.motion_stamp * rate_Hz
        return stamped(np.asarray(made.motion[:, column]), late) + zero_of(rig.flight, name)

    loose, lasts = spread(errors, own, noise.memory, rate_Hz), lasting(errors, floor)
    given = (measured, predict, floor, rate_Hz, model.number, loose, moved_by / floor)
    made = Output("airframe", name, *given, errors=errors, lasts=lasts)
    if (
        name in SLOW
    ):  # the phugoid moves these channels far even if all rates are within their noise
        return made
    noisiest = "the surfaces" if moved_by > own else name
    share = floor / float(np.std(measured))
    return replace(made, hidden_gap=HiddenGap(share, noisiest, name, most=ROUGH))


def unjudged_axes(outputs: Sequence[Output], records: Sequence[Record]) -> list[str]:
    """Return sentences on the axes of an aircraft alone that its records do not show.

    They lack the channels, or each of these has a noise floor that hides a gap.
    """
    surfaces, found = (surface_channel("wheel"), surface_channel("pedals")), []
    for axis, needed in (("pitching", COMPARED[:3]), ("lateral", (*surfaces, *_LATERAL))):
        floors = [one.hidden_gap for one in outputs if one.channel in needed]
        lacking = [name for name in needed if all(name not in record for record in records)]
        if not floors and lacking:
            first = [name for name in lacking if name in surfaces] or lacking
            found.append(f"Without {', '.join(first)} the {axis} motion is not judged.")
        elif all(one is not None and one.much for one in floors):
            found.append(f"The {axis} motion hardly exceeds its noise, which may hide its gap.")
        else:
            still = [
                name for name in needed if name not in surfaces and _never_moves(name, records)
            ]
            found += [f"{name} never changes: it is not judged." for name in still]
    return found


def _never_moves(name: str, records: Sequence[Record]) -> bool:
    """Tell whether a channel is in some of the records, and constant in each of them."""
    given = [record[name] for record in records if name in record]
    return bool(given) and all(np.ptp(values) == 0.0 for values in given)


def _known_motion(rig: Rig, record: Record) -> tuple[str, ...]:
    """Return the motion's channels that the surfaces of a record determine.

    An aircraft alone is flown by all its surfaces: without the positions of aileron and rudder in
    the record, its lateral motion is not known.
    """
    known = motion_channels(flown_by(rig), flown=True)
    beside = (surface_channel("wheel"), surface_channel("pedals"))
    if rig.controls or all(name in record for name in beside):
        return known
    return tuple(name for name in known if name not in LATERAL)


def _trim_output(model: Model, trim: Trim) -> Output:
    """Return the elevator position in trim as an output, with the noise of its channel.

    The trim is measured over a part of the rows, so the noise floor is higher than the noise. The
    model's trim has the error of the measured airspeed. The larger of the two errors is used: their
    sum of squares hides a wrong elevator moment (`test_motion_zeros`).
    """
    position, at = model.record[surface_channel("column")], flown_by(model.rig).index("column")
    noise = position - smoothed(position)
    noise *= white(position) / max(float(np.std(noise)), 1e-12)
    error = max(trim.error, trim_by_speed(model.rig, model.record, "column"))
    floor = math.hypot(error * math.sqrt(len(position)), KNOWN)

    def predict(rig: Rig) -> Floats:
        made = model.flown(rig)
        assert rig.flight is not None
        own = None if made is None else made.trim[at] + rig.flight.elevator_zero
        return np.full(len(position), trim.measured + FAR * floor if own is None else own)

    given = (trim.measured + noise, predict, floor, model.rig.frame_rate, model.number)
    return Output("airframe", TRIM, *given)
