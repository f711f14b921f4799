"""Events in flight: engine failure, trim runaway, moved levers, services of the loader.

Each event is a table of a run file, `[event.NAME]`, of one of four kinds. The aircraft starts in
trim and without faults. A service is the rig's, with or without an aircraft (`rig/serving`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.flight.everyframe import TRIMS
from coupled.flight.wrapper import Aircraft, Hook, Wrapper
from coupled.record.channels import SURFACES, ControlName
from coupled.rig.control import ControlArray
from coupled.rig.packing import COMMAND_SIGN
from coupled.rig.serving import service_command, set_service
from coupled.schema import Section, named, quantity

Move = Callable[[float], None]  # to a share of the whole, from 0 to 1
# Fuel cut and magnetos off, for the engine selected in JSBSim; −1 selects all.
OFF = {"propulsion/cutoff_cmd": 1.0, "propulsion/magneto_cmd": 0.0}
PICK = "propulsion/active_engine"
EARLY = 1e-6  # of a frame, within which an event at the start of a frame belongs to it


class Event(Section):
    """One event: `engine_out`, `trim` with `by_norm`, or `property` or `service` with `to`."""

    at: float = quantity("s", ge=0, le=7200)
    over: float = quantity("s", 0.0, ge=0, le=7200)
    engine_out: int | None = quantity("", None, ge=0, le=99)
    trim: ControlName | None = None
    by: float | None = quantity("norm", None, ge=-2, le=2)
    of_model: str | None = named("property", None, min_length=1, max_length=200)
    service: str | None = quantity("", None, min_length=1, max_length=200)
    control: ControlName | None = None
    to: float | None = None


def check_events(events: Mapping[str, Event], file: object) -> None:
    """Refuse an event that is none of the four kinds, or two at once."""
    for name, event in events.items():
        place = f"event.{name}"
        kinds = {"engine_out": event.engine_out, "trim": event.trim, "property": event.of_model}
        kinds["service"] = event.service
        given = [key for key, value in kinds.items() if value is not None]
        if len(given) != 1:
            problem = "give one of engine_out, trim, property and service"
            raise InputError(file, place, problem)
        values = {
            "by_norm": (("trim",), event.by),
            "to": (("property", "service"), event.to),
            "control": (("service",), event.control),
        }
        for key, (with_, value) in values.items():
            if (given[0] in with_) != (value is not None):
                problem = f"is given with {' or '.join(with_)}, and only there"
                raise InputError(file, f"{place}.{key}", problem)
        if event.engine_out is not None and event.over > 0.0:
            raise InputError(file, f"{place}.over_s", "an engine stops at once; leave it out")


class Events(Wrapper):
    """A run's events; `file` is where they are described."""

    def __init__(self, events: Mapping[str, Event], file: object, frame_s: float) -> None:
        self._events, self._file, self._frame_s = events, file, frame_s

    def attach(self, aircraft: Aircraft) -> Hook | None:
        """Return a hook that moves all events begun by the start of each frame."""
        makers = (_trim, _engine, _property)
        moves = [
            (event, move)
            for name, event in self._events.items()
            for make in makers
            if (move := make(aircraft, event, self._file, f"event.{name}")) is not None
        ]
        return event_hook(moves, self._frame_s)


def event_hook(moves: list[tuple[Event, Move]], frame_s: float) -> Hook:
    """Return a hook that moves all events begun by the start of each frame."""
    frame = 0

    def apply_events() -> None:
        nonlocal frame, moves
        time = (frame + EARLY) * frame_s
        frame += 1
        for event, move in moves:
            if time >= event.at:
                move(min((time - event.at) / event.over, 1.0) if event.over > 0.0 else 1.0)
        moves = [(event, move) for event, move in moves if time < event.at + event.over]

    return apply_events


def service_events(
    events: Mapping[str, Event], controls: ControlArray, names: Sequence[str], frame_s: float
) -> Hook | None:
    """Return a hook that sets the loaders' services of a flying rig before each frame, if any."""
    moves = [(e, _service(controls, names, e)) for e in events.values() if e.service is not None]
    return event_hook(moves, frame_s) if moves else None


def _service(controls: ControlArray, names: Sequence[str], event: Event) -> Move:
    """Return a function that moves a service linearly from its present value to its target."""
    control, service, to = str(event.control), str(event.service), float(event.to or 0.0)
    begun: float | None = None

    def move(share: float) -> None:
        nonlocal begun
        begun = service_command(controls, names, control, service) if begun is None else begun
        set_service(controls, names, control, service, begun + (to - begun) * share)

    return move


def trim_moved(
    events: Mapping[str, Event], control: ControlName, times_s: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the shift of a control's trim by events at some times, as a JSBSim command."""
    moved = np.zeros_like(times_s)
    for event in events.values():
        if event.trim == control and event.by is not None:
            since = times_s + EARLY * (times_s[1] - times_s[0]) - event.at
            share = np.clip(since / event.over, 0.0, 1.0) if event.over > 0.0 else since >= 0.0
            moved += COMMAND_SIGN[SURFACES[control]] * event.by * share
    return moved


def _trim(aircraft: Aircraft, event: Event, file: object, place: str) -> Move | None:
    """Return a function that moves the trim by a share of the surface's travel; shifts add up."""
    if event.trim is None or event.by is None:
        return None
    lever = aircraft.lever(TRIMS[event.trim], file, f"{place}.trim")
    whole, before = COMMAND_SIGN[SURFACES[event.trim]] * event.by, 0.0

    def move(share: float) -> None:
        nonlocal before
        lever.set(lever.read() + whole * (share - before))
        before = share

    return move


def _engine(aircraft: Aircraft, event: Event, file: object, place: str) -> Move | None:
    """Return a function that stops an engine."""
    if event.engine_out is None:
        return None
    number = f"[{event.engine_out}]" if event.engine_out else ""  # JSBSim's index
    running = f"propulsion/engine{number}/set-running"
    if not aircraft.has(running):
        raise InputError(file, f"{place}.engine_out", "there is no such engine; the first is 0")
    pick = aircraft.lever(PICK, file, place)
    levers = [
        (aircraft.lever(name, file, place), to) for name, to in OFF.items() if aircraft.has(name)
    ]
    levers.append((aircraft.lever(running, file, place), 0.0))

    def move(share: float) -> None:
        pick.set(float(event.engine_out or 0))
        for lever, value in levers:
            lever.set(value)
        pick.set(-1.0)

    return move


def _property(aircraft: Aircraft, event: Event, file: object, place: str) -> Move | None:
    """Return a function that moves a property of the model to a value."""
    if event.of_model is None or event.to is None:
        return None
    lever, to = aircraft.lever(event.of_model, file, f"{place}.property"), event.to
    begun: float | None = None

    def move(share: float) -> None:
        nonlocal begun
        begun = lever.read() if begun is None else begun
        lever.set(begun + (to - begun) * share)

    return move
