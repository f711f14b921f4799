"""The frame loop: rig and aircraft, coupled.

In each frame the airframe gives q̄, load factor and motion, the rig's compiled frame step computes
the surface commands, and the airframe is stepped with them. A flight that meets the ground, loses a
finite state or is interrupted keeps its record so far.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.flight.aircraftcache import AircraftCache, CachedAircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.bench import Airframe, Bench
from coupled.flight.companion import Companion
from coupled.flight.conditions import condition_wrappers
from coupled.flight.directcontrols import check_direct_controls
from coupled.flight.frames import Progress
from coupled.flight.gusts import DRAWN, GivenAir, Gusts
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.started import StartedFlight
from coupled.flight.trimmable import with_speeds
from coupled.record.channels import SURFACES
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.timing import timed


def fly(
    manoeuvre: Manoeuvre,
    progress: Progress | None = None,
    air: GivenAir = DRAWN,
    companion: Companion | None = None,
    cache: AircraftCache | None = None,
    stops: bool = False,
) -> Record:
    """Fly a manoeuvre and return its record, SI, one row a frame.

    `progress` is called repeatedly with frames done and frames in all. The manifest has the inputs,
    and under `ended_early` why and when a flight ended early. `air` is the motion of the air, in
    place of the rig's gusts. A `companion` is called before and after
    each frame. A `cache` keeps the aircraft for the next flight, unless its air is given. With
    `stops` the manifest has the stops of the compared control's surface, for an aircraft with
    direct controls.
    """
    cache = cache if air == DRAWN else None
    make = partial(make_airframe, manoeuvre, air)
    with timed("trim"):
        cached = CachedAircraft(make()) if cache is None else cache.take(manoeuvre, make)
    flight = StartedFlight(manoeuvre, cached.airframe, manoeuvre.frames, companion)
    frames = flight.frames
    with timed("fly"):
        frames.fly(manoeuvre.frames, progress)
    found = _surface_stops(manoeuvre, cached.airframe) if stops and frames.ended is None else {}
    if cache is not None and frames.ended is None:
        cache.keep(cached)
    return flight.record(0, frames.done, frames.ended, found)


def _surface_stops(manoeuvre: Manoeuvre, airframe: Airframe) -> dict[str, Any]:
    """Return the manifest's entry on a surface's stops, found after the last frame."""
    flown, control = manoeuvre.rig.flight, manoeuvre.control
    if flown is None or not flown.direct_controls or not isinstance(airframe, JSBSimAirframe):
        return {}
    return {"surface_stops": {SURFACES[control]: airframe.surface_stops(control)}}


def make_airframe(manoeuvre: Manoeuvre, air: GivenAir = DRAWN) -> Airframe:
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
            gusts=Gusts(rig.flight, frame_s, manoeuvre.seed, air),
        )
    except InputError as fault:
        make = partial(make_aircraft, frame_s=frame_s, models=models, file=rig_file)
        error = with_speeds(fault, rig.flight, make)
        if source is not None and error.key in source.changes:
            place = f"case {manoeuvre.label!r}: rig.{error.key}"
            error = InputError(source.run_file, place, error.problem)
        raise error from None
