"""The frame loop: rig and aircraft, coupled.

In each frame the airframe gives q̄, load factor and motion, the rig's compiled frame step computes
the surface commands, and the airframe is stepped with them. A flight that meets the ground, loses a
finite state or is interrupted keeps its record so far.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache, partial
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.bench import Airframe, Bench
from coupled.flight.companion import Companion, FlightAccess
from coupled.flight.conditions import condition_wrappers
from coupled.flight.direct import check_direct_controls
from coupled.flight.frames import Frames, Progress
from coupled.flight.gusts import Gusts
from coupled.flight.kept import AircraftCache, CachedAircraft
from coupled.flight.manifest import manifest
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Action
from coupled.flight.pilot.base import Look, Start
from coupled.flight.served import Served
from coupled.flight.trimmable import with_speeds
from coupled.record.channels import (
    PRESSURE,
    SURFACES,
    ControlName,
    record_channels,
)
from coupled.record.record import EndedEarly, Record
from coupled.resources import aircraft_folder
from coupled.rig.control import ControlArray
from coupled.rig.equations import specified_gradient
from coupled.rig.packing import pack
from coupled.rig.placed import Placed
from coupled.rig.recorder import lateness, stamp
from coupled.timing import timed

Floats = NDArray[np.float64]


def fly(
    manoeuvre: Manoeuvre,
    progress: Progress | None = None,
    air_m_per_s: Sequence[float] | None = None,
    companion: Companion | None = None,
    cache: AircraftCache | None = None,
    stops: bool = False,
) -> Record:
    """Fly a manoeuvre and return its record, SI, one row a frame.

    `progress` is called repeatedly with frames done and frames in all. The manifest has the inputs,
    and under `ended_early` why and when a flight ended early. `air_m_per_s` is the upward speed of
    the air at each frame, in place of the rig's gusts. A `companion` is called before and after
    each frame. A `cache` keeps the aircraft for the next flight, unless its air is given. With
    `stops` the manifest has the stops of the compared control's surface, for an aircraft with
    direct controls.
    """
    rig = manoeuvre.rig
    cache = cache if air_m_per_s is None else None
    make = partial(make_airframe, manoeuvre, air_m_per_s)
    with timed("trim"):
        cached = CachedAircraft(make()) if cache is None else cache.take(manoeuvre, make)
    airframe = cached.airframe
    frames, substeps = manoeuvre.frames, rig.substeps
    h = 1.0 / (rig.frame_rate * substeps)
    actions = _actions(manoeuvre, airframe.motion()[PRESSURE])
    names = list(rig.controls)
    channels = record_channels(names, rig.flight is not None)
    grips = {str(name): action.hand for name, action in actions.items()}
    controls = pack(rig, grips)
    script = _script(names, actions, frames * substeps + 1, h)
    data = _noise(channels, rig.noise, frames, manoeuvre.seed)
    noise = data.copy() if lateness(rig) else None
    looks = _looks(controls, names, actions)
    served = Served(manoeuvre, controls, companion is not None and companion.leads)
    elsewhere = companion is not None and companion.elsewhere
    placed = Placed(controls, script, data, rig.frame_rate, elsewhere)
    flight = Frames(manoeuvre, airframe, placed, served, looks, companion, progress)
    beside = (served, flight.extra)
    if companion is not None:
        so_far = partial(_so_far, manoeuvre, channels, (data, noise), beside)
        companion.begin(
            FlightAccess(manoeuvre, airframe, channels, controls, script, data, grips, so_far)
        )
    with timed("fly"):
        flight.fly()
    found = _surface_stops(manoeuvre, airframe) if stops and flight.ended is None else {}
    if cache is not None and flight.ended is None:
        cache.keep(cached)
    flown = (data[: flight.done], noise)
    return _flown(manoeuvre, channels, flown, beside, flight.ended, noted=found)


def _surface_stops(manoeuvre: Manoeuvre, airframe: Airframe) -> dict[str, Any]:
    """Return the manifest's entry on a surface's stops, found after the last frame."""
    flown, control = manoeuvre.rig.flight, manoeuvre.control
    if flown is None or not flown.direct_controls or not isinstance(airframe, JSBSimAirframe):
        return {}
    return {"surface_stops": {SURFACES[control]: airframe.surface_stops(control)}}


def _looks(
    controls: ControlArray, names: Sequence[str], actions: dict[ControlName, Action]
) -> list[tuple[Any, Look]]:
    """Return the hands whose pilots observe the motion, with their functions."""
    hands = controls["state"]["hand"]
    return [(hands[names.index(n)], a.look) for n, a in actions.items() if a.look]


def _so_far(
    manoeuvre: Manoeuvre,
    channels: tuple[str, ...],
    flown: tuple[Floats, Floats | None],
    beside: tuple[Served, Sequence[tuple[float, ...]]],
    first: int,
    last: int,
) -> Record:
    """Return the record from frame `first` to before `last` of a flight in progress.

    A channel with an early time stamp needs later rows, so the record ends before them.
    """
    data, noise = flown
    if noise is None:
        return _flown(manoeuvre, channels, (data[first:last].copy(), None), beside, None, first)
    span = 3 + math.ceil(max(abs(frames) for frames in lateness(manoeuvre.rig).values()))
    begin = max(0, first - span)
    rows = data[begin:last].copy(), noise[begin:last]
    record = _flown(manoeuvre, channels, rows, beside, None, begin)
    return record.rows(first - begin, max(first, last - span) - begin)


def _flown(
    manoeuvre: Manoeuvre,
    channels: tuple[str, ...],
    flown: tuple[Floats, Floats | None],
    beside: tuple[Served, Sequence[tuple[float, ...]]],
    ended: EndedEarly | None,
    first: int = 0,
    noted: Mapping[str, Any] = MappingProxyType({}),
) -> Record:
    """Return the record of the frames flown, with their noise, up to the first NaN.

    Its first row is frame `first`.
    """
    (data, noise), (served, extra), properties = flown, beside, manoeuvre.record_properties
    data, ended = _finite(data, manoeuvre.rig.frame_rate, ended)
    if noise is not None:
        stamp(manoeuvre.rig, channels, data, noise[: len(data)])
    more, data = served.beside(data, first)
    channels = (*channels, *more)
    if properties:
        channels = (*channels, *properties)
        own = extra[first : first + len(data)]
        data = np.column_stack((data, np.reshape(own, (len(data), -1))))
    return Record(channels, data, manifest(manoeuvre, channels, data, ended) | dict(noted))


def _finite(
    data: Floats, rate_Hz: float, ended: EndedEarly | None
) -> tuple[Floats, EndedEarly | None]:
    """Return a record up to the first row that is not finite, and why the flight ended."""
    finite = np.isfinite(data)
    if finite.all():
        return data, ended
    lost = np.flatnonzero(~finite.all(axis=1))
    return data[: lost[0]], EndedEarly("the state is not finite", int(lost[0]) / rate_Hz)


def make_airframe(manoeuvre: Manoeuvre, air_m_per_s: Sequence[float] | None = None) -> Airframe:
    """Return the manoeuvre's aircraft, trimmed and checked, or its bench."""
    rig, source = manoeuvre.rig, manoeuvre.source
    if rig.flight is None:
        assert manoeuvre.bench is not None
        profile = manoeuvre.bench
        points = list(zip(profile.time_s, profile.dynamic_pressure_Pa, strict=True))
        return Bench(1.0 / rig.frame_rate, points)
    models, rig_file = [aircraft_folder()], manoeuvre.rig_file
    frame_s, controls = 1.0 / rig.frame_rate, list(rig.controls)
    try:
        check_direct_controls(rig.flight, frame_s, controls, models, rig_file)
        return make_aircraft(
            rig.flight,
            frame_s,
            controls,
            models,
            rig_file,
            record=manoeuvre.record_properties,
            run_file=manoeuvre.file,
            conditions=condition_wrappers(
                manoeuvre.conditions, manoeuvre.file, frame_s, manoeuvre.seed
            ),
            gusts=Gusts(rig.flight, frame_s, manoeuvre.seed, air_m_per_s),
        )
    except InputError as fault:
        make = partial(make_aircraft, frame_s=frame_s, models=models, file=rig_file)
        error = with_speeds(fault, rig.flight, make)
        if source is not None and error.key in source.changes:
            place = f"case {manoeuvre.label!r}: rig.{error.key}"
            error = InputError(source.run_file, place, error.problem)
        raise error from None


def _actions(manoeuvre: Manoeuvre, pressure_Pa: float) -> dict[ControlName, Action]:
    """Return each pilot's action on a control, within reach, at the dynamic pressure of trim."""
    rig, found = manoeuvre.rig, {}
    for name, pilot in manoeuvre.pilots.items():
        gradient = float(specified_gradient(rig.controls[name].schedule, pressure_Pa))
        start = Start(gradient, manoeuvre.seed, manoeuvre.file, manoeuvre.rig_file)
        action = pilot.act(rig, name, start)
        hand = replace(action.hand, reach=pilot.reach(name))
        found[name] = replace(action, hand=hand)
    return found


def _script(names: Sequence[str], actions: dict[Any, Action], nodes: int, h: float) -> Floats:
    """Return the hands' script on all nodes, shape (controls, 2, nodes): N and d."""
    script = np.zeros((len(names), 2, nodes))  # allocated only where written
    for name, action in actions.items():
        force, held = script[names.index(name)]
        if action.force is not None:
            force[:] = action.force(_times(nodes, h))
        if action.held is not None:
            held[:] = action.held(_times(nodes, h))
    return script


@lru_cache(maxsize=1)
def _times(nodes: int, h: float) -> Floats:
    """Return the times of all nodes, s, cached for the flights of a sweep."""
    times: Floats = np.arange(nodes, dtype=np.float64) * h
    times.flags.writeable = False
    return times


def _noise(channels: tuple[str, ...], levels: dict[str, float], frames: int, seed: int) -> Floats:
    """Return the array of a record with the noise of its channels only."""
    sigma = np.array([levels.get(channel, 0.0) for channel in channels])
    if not sigma.any():
        return np.zeros((frames, len(channels)))
    # The hand's own force has no noise and draws none, so that seeds give the same noise as before.
    drawn = np.array([not channel.endswith("_hand_force_N") for channel in channels])
    hiss = np.zeros((frames, len(channels)))
    hiss[:, drawn] = np.random.default_rng(seed).standard_normal((frames, int(drawn.sum())))
    hiss *= sigma
    return hiss
