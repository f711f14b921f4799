"""The start of an exported flight: JSBSim's initial conditions, and settings before its trim."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence

import numpy as np

from coupled.exporting.host import BENCH_PRESSURE
from coupled.exporting.load import POINT, TANKS
from coupled.exporting.model import Files, parsed_leniently
from coupled.exporting.script import Script
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.altered import alterations
from coupled.flight.loop import make_airframe
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.modelparts import Scaled
from coupled.record.channels import ALPHA
from coupled.rig.parameters import Flight, SurfaceProperties
from coupled.units import KNOT_m_per_s

_LEVERS = re.compile(r"fcs/(mixture|advance)-cmd-norm(\[\d+\])?").fullmatch
_THROTTLES = re.compile(r"fcs/throttle-cmd-norm(\[\d+\])?").fullmatch


def initial_conditions(manoeuvre: Manoeuvre, alpha_rad: float | None) -> str:
    """Return JSBSim's file of initial conditions for a manoeuvre, at a given angle of attack."""
    flight = manoeuvre.rig.flight
    values: list[tuple[str, str, float]] = [("altitudeMSL", "M", 3000.0)]
    if flight is not None:
        values = [
            ("altitudeMSL", "M", flight.altitude),
            ("vc", "KTS", flight.calibrated_airspeed / KNOT_m_per_s),
            ("gamma", "DEG", math.degrees(flight.flight_path)),
        ]
    if alpha_rad is not None:
        values.append(("alpha", "RAD", alpha_rad))
    lines = [f'  <{tag} unit="{unit}"> {value!r} </{tag}>' for tag, unit, value in values]
    head = ['<?xml version="1.0"?>', '<initialize name="coupled">']
    return "\n".join([*head, *lines, "</initialize>", ""])


def add_start(
    script: Script, manoeuvre: Manoeuvre, exported: Flight | None, files: Files
) -> float | None:
    """Add an aircraft's settings before its trim, and in it.

    `exported` is the section of the exported rig, whose loading the aircraft has; `files` are the
    aircraft's own. Return the angle of attack at the start, rad, if JSBSim does not find it itself.
    Raises InputError.
    """
    flight = manoeuvre.rig.flight
    if flight is None:
        script.trims = False
        bench = manoeuvre.bench
        assert bench is not None
        times, pressures = np.array(bench.time_s), np.array(bench.dynamic_pressure_Pa)
        for name in manoeuvre.rig.controls:
            script.led[f"coupled/{name}/{BENCH_PRESSURE}"] = times, pressures
        return None
    airframe = make_airframe(manoeuvre)
    assert isinstance(airframe, JSBSimAirframe)
    names = airframe.names()
    script.before["propulsion/set-running"] = -1.0
    script.before |= dict.fromkeys(filter(_LEVERS, names), 1.0)
    if exported is None or flight.cg_aft != exported.cg_aft:
        script.before[POINT] = airframe.lever(POINT).read()
    if exported is None or flight.fuel != exported.fuel:
        tanks = filter(TANKS, names)
        script.before |= {name: airframe.lever(name).read() for name in tanks}
    script.before |= flight.properties
    _add_factors(script, flight, names)
    if flight.trim == "newton":
        _add_newton(script, airframe, flight, names, files)
        return float(airframe.motion()[ALPHA])
    return None


def _add_factors(script: Script, flight: Flight, names: Sequence[str]) -> None:
    """Add the factors with reference trim; the model has the others."""
    for part, factor, about_trim in alterations(flight):
        if about_trim is not None and isinstance(part, Scaled):
            known = [name for name in part.properties if name in names]
            script.started |= {part.held(name): name for name in known}
            script.started |= part.settings(factor)


def _add_newton(
    script: Script, airframe: JSBSimAirframe, flight: Flight, names: list[str], files: Files
) -> None:
    """Set an aircraft that JSBSim cannot trim to the state of Newton's method, before the start."""
    script.trims = False
    column = flight.surfaces.get("column", SurfaceProperties())
    commands = column.command or ["fcs/elevator-cmd-norm"]
    levers = [*filter(_THROTTLES, names), *commands, *_moved_slowly(files)]
    script.before |= {name: airframe.lever(name).read() for name in levers}


def _moved_slowly(files: Files) -> Iterator[str]:
    """Yield the properties that a model moves at a rate, which would start elsewhere."""
    for place, text in files.items():
        if place.suffix != ".xml" or b"<kinematic" not in text:
            continue
        for moving in parsed_leniently(text).iter("kinematic"):
            yield from ((output.text or "").strip() for output in moving.findall("output"))
