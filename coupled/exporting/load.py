"""The loading and the factors of a rig's aircraft, written into its exported model's files.

In flight, `flight/loading` moves the centre of gravity and fills the tanks of a loaded model, and
`flight/altered` sets the factors on its aerodynamics. The exported aircraft must be the same in
JSBSim and in FlightGear, with a script and without, so the numbers are written into its files:

    cg_aft              the aerodynamic reference point, moved forward: metrics, location AERORP
    fuel                the contents of each tank, times the factor
    pitch_damping, …    the factors with reference zero, in the model's aerodynamics

A factor about the trim (`elevator_effectiveness`) needs the surface position in trim, which a file
cannot contain: a script sets it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree
from xml.parsers import expat

from coupled.errors import InputError
from coupled.exporting.model import Files, model_name
from coupled.flight.aircraft import make_aircraft
from coupled.flight.altered import ALTERATIONS, alterations
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight
from coupled.rig.rig import Rig
from coupled.units import FOOT_m, INCH_m

POINT = "metrics/aero-rp-x-in"
TANKS = re.compile(r"propulsion/tank(\[\d+\])?/contents-lbs").fullmatch
_UNITS_m = {"IN": INCH_m, "FT": FOOT_m, "M": 1.0}  # of a location; JSBSim accepts no others
_REACHED = 1e-6  # relative tolerance: JSBSim's own unit factors have seven digits


def set_load(files: Files, flight: Flight | None, file: object) -> Files:
    """Return an exported aircraft's files with the rig's loading and factors.

    `file` is the rig's, named in faults. Raises InputError if the model cannot have them.
    """
    if flight is None:
        return files
    name = model_name(flight)
    main = PurePosixPath("aircraft", name, f"{name}.xml")
    found = dict(files)
    if flight.cg_aft != 0.0:
        place = _section(found, main, "metrics")
        found[place] = _with_point(found[place], flight, file)
    if flight.fuel != 1.0:
        place = _section(found, main, "propulsion")
        found[place] = _with_contents(found[place], flight.fuel)
    found[main] = _with_factors(found[main], flight)
    return found


def check_load(folder: Path, rig: Rig, file: object) -> None:
    """Load an exported aircraft in JSBSim, and compare its loading with that of our own flight.

    `folder` has the export. Raises InputError if they differ, and if the rig's own aircraft cannot
    be loaded so, for example with more fuel than its tanks hold.
    """
    flight = rig.flight
    if flight is None or (flight.cg_aft == 0.0 and flight.fuel == 1.0):
        return
    plain = {
        "cg_aft": 0.0,
        "fuel": 1.0,
        "terms": {},
        **{a.part.name: a.part.neutral for a in ALTERATIONS},
    }
    own = {"folder": str(folder / "aircraft"), "model_file": ""}
    exported = flight.model_copy(update={**plain, **own})
    frame_s, controls = 1.0 / rig.frame_rate, list(rig.controls)
    ours, alone = (
        make_aircraft(each, frame_s, controls, [aircraft_folder()], file)
        for each in (flight, exported)
    )
    for name in (POINT, *filter(TANKS, ours.names())):
        wanted, found = ours.lever(name).read(), alone.lever(name).read()
        if not math.isclose(wanted, found, rel_tol=_REACHED, abs_tol=_REACHED):
            key = "cg_aft_m" if name == POINT else "fuel"
            problem = f"{flight.model} as exported has {name} = {found:.8g}, not {wanted:.8g}"
            remedy = "put the load into the model's own file, and leave the key out"
            raise InputError(file, f"flight.{key}", f"{problem}; {remedy}")


def _section(files: Files, main: PurePosixPath, name: str) -> PurePosixPath:
    """Return the file of a section of the model: the model's, or one that it names."""
    section = ElementTree.fromstring(files[main]).find(name)
    own = "" if section is None else section.get("file", "").removesuffix(".xml")
    place = main.parent / f"{own}.xml"
    return place if own and place in files else main


def _with_point(text: bytes, flight: Flight, file: object) -> bytes:
    """Return a file with the aerodynamic reference point moved forward by `cg_aft`."""
    for number in _numbers(text, "location", "x"):
        unit = number.within.get("unit", "IN")
        if number.within.get("name") == "AERORP" and unit in _UNITS_m:
            return number.replaced(text, number.value - flight.cg_aft / _UNITS_m[unit])
    problem = f"{flight.model} has no location AERORP in {', '.join(_UNITS_m)} that could be moved"
    raise InputError(file, "flight.cg_aft_m", f"{problem}; leave it at 0")


def _with_contents(text: bytes, share: float) -> bytes:
    """Return a file with the contents of all tanks multiplied by `share`."""
    for number in reversed(_numbers(text, "tank", "contents")):
        text = number.replaced(text, share * number.value)
    return text


def _with_factors(text: bytes, flight: Flight) -> bytes:
    """Return a model with the factors with reference zero (declared by `modelparts`)."""
    for part, factor, about_trim in alterations(flight):
        if about_trim is not None:
            continue
        neutral = part.settings(part.neutral)
        for name, value in part.settings(factor).items():
            declared = f'<property value="{neutral[name]:g}">{name}</property>'
            assert declared.encode() in text, name
            stated = f'<property value="{value!r}">{name}</property>'
            text = text.replace(declared.encode(), stated.encode())
    return text


@dataclass(frozen=True)
class _Number:
    """A number in an XML file: its bytes, and the attributes of its parent element."""

    value: float
    start: int
    end: int
    within: Mapping[str, str]

    def replaced(self, text: bytes, value: float) -> bytes:
        """Return the file with only this number replaced."""
        return text[: self.start] + repr(value).encode() + text[self.end :]


def _numbers(text: bytes, within: str, tag: str) -> list[_Number]:
    """Return the numbers of all elements `tag` directly within elements `within`, in order."""
    stack, said, found = list[tuple[str, dict[str, str]]](), list[str](), list[_Number]()
    begin = 0
    parser = expat.ParserCreate()

    def start(name: str, attributes: dict[str, str]) -> None:
        stack.append((name, attributes))
        said.clear()

    def characters(more: str) -> None:
        nonlocal begin
        begin = begin if said else parser.CurrentByteIndex
        said.append(more)

    def end(_: str) -> None:
        if [name for name, _ in stack[-2:]] == [within, tag] and said:
            attributes = stack[-2][1]
            found.append(_Number(float("".join(said)), begin, parser.CurrentByteIndex, attributes))
        stack.pop()
        said.clear()

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = characters
    parser.Parse(text, True)
    return found
