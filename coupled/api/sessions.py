"""A flight that is advanced frame by frame by the caller."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from numbers import Real
from typing import Any, Never, Unpack

import numpy as np

from coupled.api.flights import FlightKeywords, Gradients, Path, manoeuvre_of, pilots_of
from coupled.arguments import checks_itself, public
from coupled.errors import InputError, nearest, shown_value
from coupled.flight.aircraftcache import CachedAircraft, flight_kind, started_aircraft
from coupled.flight.loop import make_airframe
from coupled.flight.manoeuvre import Configuration, Manoeuvre
from coupled.flight.pilot import Pilot
from coupled.flight.pilot.base import STRONGEST
from coupled.flight.pilot.own import GivenForce, Law, OwnPilot
from coupled.flight.started import StartedFlight
from coupled.flight.state import State, copy_row, state_reader
from coupled.record.channels import CONTROL_NAMES, ControlName, channel
from coupled.record.record import EndedEarly, Record
from coupled.rig.rig import Rig
from coupled.rig.serving import check_service, set_service
from coupled.rig.switches import Switches
from coupled.schema import known_keys

_LONGEST_s = 7200.0  # s, greatest length of a flight, as of a run
_FIRST_s = 60.0  # s, initial length of the arrays; doubling them takes as long as some 200 steps
_NAME = "coupled.Session"
_FORCES = dict.fromkeys(f"{control}_force_N" for control in CONTROL_NAMES)
_CLOSED = "the session is closed; make a new one"


@public
class Session:
    """A flight that is advanced by the caller: each `step` flies one frame and returns a `State`.

    Takes the arguments of `fly`, except a duration. `step` takes the forces of the controls without
    a pilot. The record is identical to that of `fly` with the same forces. Events, services, wind
    and gusts act as in a run. Raises InputError as for a run file.

    >>> import coupled
    >>> with coupled.Session("t37", configuration="uncompensated") as session:
    ...     while session.time_s < 0.5:
    ...         pull = 30.0 - 200.0 * session.state.pitch_rate_rad_per_s
    ...         state = session.step(column_force_N=pull)
    ...     session.deflection_correction = True
    ...     state = session.step(column_force_N=30.0)
    >>> session.record
    Record(61 rows, 0.508333 s at 120 Hz; 46 channels: time_s, column_force_N, column_computed_m, …)
    """

    # A mistyped switch, as `session.deflection_corection = True`, raises an error.
    __slots__ = (
        *("__weakref__", "_advance", "_again", "_begin", "_begun", "_capacity", "_closed", "_end"),
        *("_ended", "_flight", "_free", "_has_own", "_k", "_kept", "_own", "_places", "_read"),
        *("_refusal", "_services", "_state", "_switches"),
    )

    def __init__(
        self,
        what: Manoeuvre | Rig | Path,
        *,
        column: Pilot | Law | None = None,
        wheel: Pilot | Law | None = None,
        pedals: Pilot | Law | None = None,
        gradient: Gradients | None = None,
        configuration: Configuration | None = None,
        **terms: Unpack[FlightKeywords],
    ) -> None:
        if "duration_s" in terms:
            raise InputError(_NAME, "duration_s", "a session has none: step it as long as wanted")
        pilots = pilots_of(column, wheel, pedals)
        if isinstance(what, Manoeuvre):
            given = manoeuvre_of(what, pilots, None, gradient, terms)
        else:
            moved = pilots or {"column": GivenForce()}
            given = manoeuvre_of(what, moved, _LONGEST_s, gradient, terms)
        free = dict.fromkeys(given.rig.controls, GivenForce())
        self._begun = replace(given, pilots={**free, **given.pilots})
        if configuration is not None:
            self._begun = self._begun.configured(configuration)
        self._kept: CachedAircraft | None = None
        self._closed: Record | None = None
        self._start(self._begun)

    def _start(self, manoeuvre: Manoeuvre) -> None:
        """Start a flight in trim, with the aircraft of the last one if a reset restores it."""
        kept, kind, rig = self._kept, flight_kind(manoeuvre), manoeuvre.rig
        if kept is None or kept.kind is None or kept.kind != kind or not kept.restarted():
            kept = started_aircraft(make_airframe(manoeuvre), kind)
        self._kept = kept
        self._capacity = max(2, round(_FIRST_s * rig.frame_rate))
        flight = StartedFlight(manoeuvre, kept.airframe, self._capacity, stepped=True)
        self._flight = flight
        self._services: list[tuple[float, str, str, float]] = []
        self._switches = Switches(rig, flight.controls, flight.grips, False)
        names, pilots = list(rig.controls), manoeuvre.pilots
        self._free = {n: i for i, n in enumerate(names) if type(pilots[n]) is GivenForce}
        self._has_own = any(isinstance(pilot, OwnPilot) for pilot in pilots.values())
        self._k = 0
        self._ended: EndedEarly | None = None
        self._refusal = ""
        self._bind_flight()
        self._begin(0)
        self._update_state()

    def _bind_flight(self) -> None:
        """Take the functions of the flight, which change when its arrays grow."""
        flight = self._flight
        self._begin, self._end, self._again, advance = flight.frames.steps()
        # A step with one column whose force is given needs few calls.
        self._advance = advance if self._free and not self._refusal else None
        self._own = flight.forces if self._has_own else None
        self._places, data = flight.places(), flight.data
        self._read = state_reader(self._places, data.data)

    def _update_state(self) -> None:
        """Update the state after the host's frame."""
        self._state = State(self._places, self._flight.row(self._k))

    def __enter__(self) -> Session:
        return self

    def __reduce__(self) -> Never:
        raise TypeError("a coupled.Session cannot be copied or pickled; make another one")

    def __exit__(self, *raised: object) -> None:
        self.close()

    @property
    def state(self) -> State:
        """The state at `time_s`; after the end of the flight, that of its last frame."""
        return self._state

    @property
    def time_s(self) -> float:
        """The time of the flight, s: the number of frames flown over the frame rate."""
        return self._k / self._begun.rig.frame_rate

    @property
    def ended_early(self) -> str:
        """Why and when the flight ended early, as by ground contact, or an empty string."""
        return "" if self._ended is None else str(self._ended)

    @property
    def rig(self) -> Rig:
        """The rig with the current switches."""
        return self._switches.rig

    @property
    def controls(self) -> tuple[ControlName, ...]:
        """The controls without a pilot, whose forces are arguments of `step`."""
        return tuple(self._free)

    @property
    def record(self) -> Record:
        """The record of the frames flown; the state is the row after its last.

        Switches and services set from outside are in the manifest, under `session`.
        """
        if self._closed is not None:
            return self._closed
        found = self._flight.flown(self._k, self._ended)
        if not self._switches.changes and not self._services:
            return found
        switched = [asdict(change) for change in self._switches.changes]
        changed = {"session": {"switched": switched, "services": list(self._services)}}
        return Record(found.channels, found.data, {**found.manifest, **changed})

    @property
    def deflection_correction(self) -> bool:
        """Whether the deflection correction is on, for all controls; can be set in flight."""
        return all(c.compensation.deflection for c in self.rig.controls.values())

    @deflection_correction.setter
    def deflection_correction(self, on: bool) -> None:
        self._correct("deflection", on)

    @property
    def gradient_correction(self) -> bool:
        """Whether the gradient correction is on, for all controls; can be set in flight."""
        return all(c.compensation.gradient for c in self.rig.controls.values())

    @gradient_correction.setter
    def gradient_correction(self, on: bool) -> None:
        self._correct("gradient", on)

    @checks_itself
    def step(
        self,
        *,
        column_force_N: float | None = None,
        wheel_force_N: float | None = None,
        pedals_force_N: float | None = None,
        **unknown: Never,
    ) -> State:
        """Fly one frame and return the state at its end.

        The forces are constant over the frame, up to ±5000 N; a pull, right wheel and right pedal
        are positive. The default is no force (hand off). When the flight ends early, the state is
        the last one, and another step raises InputError.
        """
        k, advance = self._k, self._advance
        if (
            advance is None
            or type(column_force_N) is not float
            or not -5000.0 <= column_force_N <= 5000.0  # STRONGEST; a constant is faster
            or k + 1 == self._capacity
            or wheel_force_N is not None
            or pedals_force_N is not None
            or unknown
        ):
            known_keys(unknown, _FORCES, _NAME, "")
            return self._step((column_force_N, wheel_force_N, pedals_force_N))
        try:
            why = advance(k, column_force_N)
        except BaseException:
            self._interrupt()
            raise
        self._k = k = k + 1
        if why:
            return self._stop(why)
        self._state = state = self._read(k)
        return state

    def _step(self, given: Sequence[float | None]) -> State:
        """Fly one frame with the given forces of column, wheel and pedals."""
        forces = self._forces(given)
        try:
            self._end(self._k, forces)
            self._k += 1
            if self._k == self._capacity:
                self._extend()
            if why := self._begin(self._k):
                return self._stop(why)
        except BaseException:
            self._interrupt()
            raise
        self._update_state()
        return self._state

    def _interrupt(self) -> None:
        self._refuse(f"was interrupted at {self.time_s:.4g} s; call reset()")

    def _forces(self, given: Sequence[float | None]) -> Sequence[float]:
        """Return the forces in the order of the rig's controls, N, checked."""
        if self._refusal:
            raise InputError(_NAME, "step", self._refusal)
        found = [0.0, 0.0, 0.0] if self._own is None else list(self._own(self._k))
        for control, force in zip(CONTROL_NAMES, given, strict=True):
            if force is not None:
                found[self._number(control)] = _checked_force(f"{control}_force_N", force)
        return found

    def _number(self, control: ControlName) -> int:
        """Return the index of a control without pilot. Raises InputError for other controls."""
        if control in self._free:
            return self._free[control]
        name, pilots = f"{control}_force_N", self._begun.pilots
        if control in pilots:
            problem = f"the {control} has a pilot, {pilots[control].title}; leave one of them out"
            raise InputError(_NAME, name, problem)
        raise InputError(_NAME, name, f"the rig has no {control}; {nearest(control, pilots)}")

    def _refuse(self, why: str) -> None:
        """Refuse further steps."""
        self._refusal, self._advance = why, None

    def _extend(self) -> None:
        most = round(_LONGEST_s * self._begun.rig.frame_rate) + 1
        if self._capacity >= most:
            raise InputError(_NAME, "step", f"a flight lasts at most {_LONGEST_s:g} s")
        self._capacity = min(2 * self._capacity, most)
        self._flight.extend(self._capacity)
        self._bind_flight()

    def _stop(self, why: str) -> State:
        """End the flight at the state of its last frame."""
        self._ended = EndedEarly(why, self.time_s)
        self._refuse(f"the flight is over: {self._ended}; call reset()")
        return self._state

    def reset(self, seed: int | None = None) -> State:
        """Return to trim with the initial rig, and return the state there.

        `seed` is for noise, turbulence and gusts of the next flight (default: that of the session).
        A 737, B747, T-37, F-16 or c172p is reset if only its commands act on it. Others are loaded
        again, without a memory leak: JSBSim's reset does not restore the position of a kinematic
        component, as of the nozzles of an awjsra.
        """
        self._check_open("reset")
        self._start(self._begun if seed is None else replace(self._begun, seed=seed))
        return self._state

    def set_switch(self, control: ControlName, switch: str, value: float | bool) -> None:
        """Change a setting of a control from this frame on, as the page of `coupled live` does.

        `deflection` and `gradient` are True or False; `assumed_bend` and `bend` are K̂ and K in m/N
        (rad/N), `friction` and `breakout` in N. Raises InputError as for a rig file.
        """
        self._check_flying("set_switch")
        change = partial(self._switches.set, self.time_s, control, switch, value)
        self._change(change)

    def set_service(self, control: ControlName, service: str, value: float) -> None:
        """Set a service of a control's loader from this frame on, as an event of a run does.

        Services are those of an event (`jammed`, `trim_m`, `autopilot`, …), in SI. Raises
        InputError as for a run file.
        """
        self._check_flying("set_service")
        check_service(self.rig, control, service, value, _NAME, "set_service")
        flight, names = self._flight, list(self._begun.rig.controls)
        asked = flight.data[: self._k + 1, self._places[channel(control, "estimate")]]
        flight.served.serve(control, self._capacity, asked)
        self._bind_flight()
        self._services.append((self.time_s, control, service, value))
        self._change(partial(set_service, flight.controls, names, control, service, value))

    def close(self) -> None:
        """End the session; its record, state and time remain available."""
        if self._closed is None:
            self._closed = self.record
            self._refuse(_CLOSED)
            self._kept = None
            del self._flight, self._begin, self._end, self._again, self._own

    def _correct(self, which: str, on: bool) -> None:
        if not isinstance(on, (bool, np.bool_)):
            problem = f"is {shown_value(on)}; give True or False"
            raise InputError(_NAME, f"{which}_correction", problem)
        for control in self.rig.controls:
            self.set_switch(control, which, bool(on))

    def _change(self, change: Callable[[], None]) -> None:
        """Apply a change of the controls at this frame, and update the state."""
        copy_row(self._state)
        self._again(self._k, change)
        self._update_state()

    def _check_open(self, what: str) -> None:
        if self._closed is not None:
            raise InputError(_NAME, what, _CLOSED)

    def _check_flying(self, what: str) -> None:
        if self._refusal:
            raise InputError(_NAME, what, self._refusal)


def _checked_force(name: str, force: Any) -> float:
    """Return a force of any numeric type as a float, N. Raises InputError for other values."""
    number = isinstance(force, Real) and not isinstance(force, bool)
    if not number or not -STRONGEST <= force <= STRONGEST:
        problem = f"is {shown_value(force)}; give a force from -{STRONGEST:g} to {STRONGEST:g}"
        raise InputError(_NAME, name, problem)
    return float(force)
