"""How an exported flight starts: JSBSim's initial conditions, and what is set before its trim."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from xml.etree import ElementTree

import numpy as np

from coupled.export.host import BENCH_PRESSURE
from coupled.export.model import Files, altered
from coupled.export.script import Script
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.altered import ALTERATIONS
from coupled.flight.loop import make_airframe
from coupled.flight.manoeuvre import Manoeuvre
from coupled.record.channels import ALPHA
from coupled.rig.parameters import Flight
from coupled.units import KNOT_m_per_s

_LEVERS = re.compile(r"fcs/(mixture|advance)-cmd-norm(\[\d+\])?").fullmatch
_TANKS = re.compile(r"propulsion/tank(\[\d+\])?/contents-lbs").fullmatch
_THROTTLES = re.compile(r"fcs/throttle-cmd-norm(\[\d+\])?").fullmatch
_POINT = "metrics/aero-rp-x-in"


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


def add_start(script: Script, manoeuvre: Manoeuvre, files: Files) -> float | None:
    """Add what an aircraft is set to before its trim, and in it; `files` are its own.

    Return the angle of attack at the start, rad, where JSBSim does not find it itself.
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
    if flight.cg_aft != 0.0:
        script.before[_POINT] = airframe.lever(_POINT).read()
    if flight.fuel != 1.0:
        tanks = filter(_TANKS, names)
        script.before |= {name: airframe.lever(name).read() for name in tanks}
    script.before |= flight.properties
    _add_factors(script, flight)
    if flight.trim == "newton":
        _add_newton(script, airframe, names, files)
        return float(airframe.motion()[ALPHA])
    return None


def _add_factors(script: Script, flight: Flight) -> None:
    """Add the factors on the aerodynamics, of which some count from the trim on."""
    for alteration in ALTERATIONS:
        part, factor = alteration.part, alteration.factor(flight)
        if part.name not in altered(flight):
            continue
        values: dict[str, float | str] = {part.factor: factor, part.rest: 1.0 - factor}
        if alteration.about_trim:
            held = {part.held(name): name for name in part.properties}
            script.started |= {**held, **values}
        else:
            script.before |= {name: float(value) for name, value in values.items()}


def _add_newton(script: Script, airframe: JSBSimAirframe, names: list[str], files: Files) -> None:
    """Put an aircraft that JSBSim does not trim where Newton's method has it, before the start."""
    script.trims = False
    levers = [*filter(_THROTTLES, names), "fcs/elevator-cmd-norm", *_moved_slowly(files)]
    script.before |= {name: airframe.lever(name).read() for name in levers}


def _moved_slowly(files: Files) -> Iterator[str]:
    """Yield the properties that a model moves at a rate, which would begin elsewhere."""
    for place, text in files.items():
        if place.suffix != ".xml" or b"<kinematic" not in text:
            continue
        for moving in ElementTree.fromstring(text).iter("kinematic"):
            yield from ((output.text or "").strip() for output in moving.findall("output"))
