"""The adverse conditions of a run in a JSBSim script: moving air, events."""

from __future__ import annotations

import numpy as np

from coupled.errors import InputError
from coupled.exporting.script import Floats, Move, Script
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.altered import alterations
from coupled.flight.event import OFF, PICK, Event
from coupled.flight.everyframe import TRIMS
from coupled.flight.loop import make_airframe
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.modelparts import Scaled
from coupled.flight.weather import GUST, Gust, Turbulence, Wind, gust_properties
from coupled.record.channels import SURFACES, ControlName
from coupled.resources import aircraft_folder
from coupled.rig.packing import COMMAND_SIGN
from coupled.rig.parameters import Flight
from coupled.units import FOOT_m

_MOVED = np.linspace(-1.0, 1.0, 201)  # positions of a moved trim
_MILSPEC = "atmosphere/turbulence/milspec/"


def add_conditions(script: Script, manoeuvre: Manoeuvre) -> None:
    """Add a manoeuvre's wind, gust, turbulence and events. Raises InputError for any other."""
    given = manoeuvre.conditions
    if key := unknown_condition(manoeuvre):
        problem = "is not exported: a script of JSBSim has wind, gust, turbulence, and events of"
        problem += " engine_out, trim and property"
        raise InputError(manoeuvre.file, key, problem)
    if given.wind is not None:
        _add_wind(script, given.wind)
    if given.gust is not None:
        _add_gust(script, given.gust)
    if given.turbulence is not None:
        _add_turbulence(script, given.turbulence, manoeuvre.seed)
    for event in given.event.values():
        _add_event(script, event, manoeuvre)


def unknown_condition(manoeuvre: Manoeuvre) -> str:
    """Return the key of a condition that cannot be exported, or an empty string."""
    given = manoeuvre.conditions
    for key in type(given).model_fields:
        if getattr(given, key) and key not in ("wind", "gust", "turbulence", "event"):
            return key
    for name, event in given.event.items():
        led = event.trim is not None or event.of_model is not None
        if not led and event.engine_out is None:
            return f"event.{name}"
    return ""


def _add_wind(script: Script, wind: Wind) -> None:
    """Add a wind along the initial heading, which is north, and upwards."""
    times = np.array(wind.time)
    script.led["atmosphere/wind-north-fps"] = times, np.array(wind.along) / FOOT_m
    if wind.up is not None:
        script.led["atmosphere/wind-down-fps"] = times, -np.array(wind.up) / FOOT_m


def _add_gust(script: Script, gust: Gust) -> None:
    script.started |= gust_properties(gust)
    script.at.append((gust.at, {GUST + "start": 1.0}))


def _add_turbulence(script: Script, turbulence: Turbulence, seed: int) -> None:
    script.started |= {
        "atmosphere/randomseed": float(seed % 2**31),
        "atmosphere/turb-type": {"milspec": 3.0, "tustin": 4.0}[turbulence.model],
        _MILSPEC + "windspeed_at_20ft_AGL-fps": turbulence.wind_at_6m / FOOT_m,
        _MILSPEC + "severity": float(turbulence.severity),
    }


def _add_event(script: Script, event: Event, manoeuvre: Manoeuvre) -> None:
    if event.trim is not None and event.by is not None:
        _add_runaway(script, event, manoeuvre)
    elif event.of_model is not None and event.to is not None:
        move = Move(*_shares(event, manoeuvre), to=event.to)
        script.moved.setdefault(event.of_model, []).append(move)
    elif event.engine_out is not None:
        # A turbine has no magnetos and a piston engine no cut-off: JSBSim ends a script that sets a
        # missing property.
        airframe = make_airframe(manoeuvre)
        assert isinstance(airframe, JSBSimAirframe)
        number = f"[{event.engine_out}]" if event.engine_out else ""
        off = {name: value for name, value in OFF.items() if airframe.has(name)}
        picked = {PICK: float(event.engine_out)}
        script.at.append(
            (event.at, {**picked, **off, f"propulsion/engine{number}/set-running": 0.0})
        )


def _shares(event: Event, manoeuvre: Manoeuvre) -> tuple[Floats, Floats]:
    """Return the times of an event, s, and its completed share at each: all within a frame."""
    over = max(event.over, 1e-3 / manoeuvre.rig.frame_rate)
    begins = event.at - (over if event.over == 0.0 else 0.0)
    return np.array([begins, begins + over]), np.array([0.0, 1.0])


def _add_runaway(script: Script, event: Event, manoeuvre: Manoeuvre) -> None:
    """Move a trim by an amount, relative to JSBSim's trim."""
    control, flight = event.trim, manoeuvre.rig.flight
    assert control is not None and event.by is not None and flight is not None
    by = COMMAND_SIGN[SURFACES[control]] * event.by
    move = Move(*_shares(event, manoeuvre), by=by)
    script.moved.setdefault(TRIMS[control], []).append(move)
    _follow_trim(script, manoeuvre, flight, control)


def _follow_trim(
    script: Script, manoeuvre: Manoeuvre, flight: Flight, control: ControlName
) -> None:
    """Update the reference of a factor about the trim as the trim moves (`Alterations`)."""
    frame_s, folders = 1.0 / manoeuvre.rig.frame_rate, [aircraft_folder()]
    name = TRIMS[control]
    for part, _, about_trim in alterations(flight):
        if about_trim != control or not isinstance(part, Scaled):
            continue
        plain = JSBSimAirframe(flight, frame_s, (control,), folders)
        known = [each for each in part.properties if plain.has(each)]
        aircraft = JSBSimAirframe(flight, frame_s, (control,), folders, record=known)
        start = aircraft.lever(name).read()
        places = []
        for trim in _MOVED.tolist():
            aircraft.step((trim, 0.0, 0.0))
            places.append(aircraft.extra())
        for each, values in zip(known, np.array(places).T, strict=True):
            script.following[part.held(each)] = (name, start + _MOVED, values)
