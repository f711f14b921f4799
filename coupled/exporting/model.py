"""The aircraft of an export: its files with the includes, and all files that they name."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree
from xml.parsers import expat

from coupled.errors import InputError, nearest
from coupled.files import read_bytes
from coupled.flight.airframe import packaged_models
from coupled.flight.altered import alterations
from coupled.flight.modelfile import loadable
from coupled.flight.modelparts import NothingToScaleError
from coupled.flight.modeltext import UnreadableModelError, parsed
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight

Files = dict[PurePosixPath, bytes]
_SYSTEMS = ("system", "autopilot", "flight_control")  # in JSBSim's order of loading
_BENCH = b"""<?xml version="1.0"?>
<!-- No aircraft: a weight that carries the loader of a bench. q comes from a property. -->
<fdm_config name="bench" version="2.0">
  <metrics>
    <wingarea unit="M2">1</wingarea><wingspan unit="M">1</wingspan><chord unit="M">1</chord>
    <location name="AERORP" unit="M"><x>0</x><y>0</y><z>0</z></location>
    <location name="EYEPOINT" unit="M"><x>0</x><y>0</y><z>0</z></location>
    <location name="VRP" unit="M"><x>0</x><y>0</y><z>0</z></location>
  </metrics>
  <mass_balance>
    <ixx unit="KG*M2">1</ixx><iyy unit="KG*M2">1</iyy><izz unit="KG*M2">1</izz>
    <emptywt unit="KG">1</emptywt>
    <location name="CG" unit="M"><x>0</x><y>0</y><z>0</z></location>
  </mass_balance>
  <ground_reactions/>
  <flight_control name="bench"/>
  <aerodynamics><axis name="DRAG"/><axis name="ROLL"/></aerodynamics>
</fdm_config>
"""


def model_name(flight: Flight | None) -> str:
    """Return the name of the folder and file of a rig's aircraft; for a bench the stand's."""
    return "bench" if flight is None else flight.model


def model_files(flight: Flight | None, systems: Sequence[str], file: object) -> Files:
    """Return an aircraft's files by their paths in the exported folder.

    `systems` are the names of those to include, before all of the aircraft's own; `file` is named
    in faults. All XML files of the model's folder are included, and the shared engines, thrusters
    and systems that they name.
    """
    name = model_name(flight)
    folder = PurePosixPath("aircraft", name)
    if flight is None:
        return {folder / "bench.xml": _including(_BENCH, systems)}
    home = _home(flight, file)
    parts = [each.part for each in alterations(flight)]
    try:
        with loadable(home / flight.main_file, parts) as made:
            main = read_bytes(made / name / f"{name}.xml")
    except NothingToScaleError as error:
        raise InputError(file, f"flight.{error.name}", f"{name} has {error.lacking}") from None
    except UnreadableModelError as error:
        raise InputError(file, "flight.model", str(error)) from None
    found: Files = {folder / f"{name}.xml": _including(main, systems)}
    for path in sorted((home / name).rglob("*.xml")):
        place = folder / PurePosixPath(path.relative_to(home / name).as_posix())
        if place not in found:
            found[place] = read_bytes(path)
    found |= _shared(found, folder)
    if flight.trim == "newton":
        found = {place: _settable(text) for place, text in found.items()}
    shown = folder / f"{name}-set.xml"
    if shown not in found:
        found[shown] = flightgear_set(name, systems).encode()
    return found


def _settable(text: bytes) -> bytes:
    """Return a file in which each kinematic has an output, which JSBSim can initialise.

    If JSBSim does not trim, parts that move at a rate must start in their positions (`start`).
    """

    def with_output(found: re.Match[bytes]) -> bytes:
        name, inside = found[1], found[2]
        output = b"" if b"<output>" in inside else b"  <output> %s </output>\n    " % name
        return b'<kinematic name="%s">%s%s</kinematic>' % (name, inside, output)

    return re.sub(rb'<kinematic name="([^"]*)">(.*?)</kinematic>', with_output, text, flags=re.S)


def flightgear_set(name: str, systems: Sequence[str]) -> str:
    """Return FlightGear's file of an aircraft, with each joystick axis as a hand."""
    names = [at.removeprefix("coupled-") for at in systems]
    hands = "".join(f'<{control}><hand type="double">1</hand></{control}>' for control in names)
    return f"""<?xml version="1.0"?>
<PropertyList>
  <sim>
    <description>{name} with control loaders</description>
    <flight-model>jsb</flight-model>
    <aero>{name}</aero>
    <minimum-fg-version>2020.3.0</minimum-fg-version>
  </sim>
  <fdm><jsbsim><coupled>{hands}</coupled></jsbsim></fdm>
</PropertyList>
"""


def _home(flight: Flight, file: object) -> Path:
    if flight.folder:
        return Path(flight.folder)
    own = aircraft_folder()
    if (own / flight.model / f"{flight.model}.xml").is_file():
        return own
    known = packaged_models()
    if flight.model not in known:
        problem = f"there is no JSBSim model {flight.model!r}; {nearest(flight.model, known)}"
        raise InputError(file, "flight.model", problem)
    return known[flight.model]


def _including(text: bytes, systems: Sequence[str]) -> bytes:
    """Return a model's file with systems included before its own, otherwise unchanged."""
    places = list(_top_level(text))
    at = next((place for tag, place in places if tag in _SYSTEMS), None)
    if at is None:
        at = text.rindex(b"</fdm_config")
    lines = b"".join(b'<system file="%s"/>\n    ' % name.encode() for name in systems)
    return text[:at] + lines + text[at:]


def _top_level(text: bytes) -> Iterator[tuple[str, int]]:
    """Yield tag and position of each element directly below the root."""
    depth, found = 0, list[tuple[str, int]]()
    parser = expat.ParserCreate()

    def start(tag: str, _: dict[str, str]) -> None:
        nonlocal depth
        if depth == 1:
            found.append((tag, parser.CurrentByteIndex))
        depth += 1

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.Parse(text, True)
    yield from found


def _shared(files: Files, folder: PurePosixPath) -> Files:
    """Return the files of JSBSim's own folders that the files name, and those that they name.

    They are put into the model's own folder, where JSBSim searches first and FlightGear only.
    """
    root = next(iter(packaged_models().values())).parent
    found: Files = {}
    waiting = list(files.values())
    while waiting:
        for element in parsed_leniently(waiting.pop()).iter():
            name = element.attrib.get("file", "").removesuffix(".xml")
            places = {"engine": "Engines", "thruster": "Engines", "system": "Systems"}
            if not name or element.tag not in places:
                continue
            place = folder / places[element.tag] / f"{name}.xml"
            source = root / ("systems" if element.tag == "system" else "engine") / f"{name}.xml"
            here = {folder / f"{name}.xml", place}
            if here & (files.keys() | found.keys()) or not source.is_file():
                continue
            found[place] = read_bytes(source)
            waiting.append(found[place])
    return found


def parsed_leniently(text: bytes) -> ElementTree.Element:
    """Return the root of a file's XML, an empty one if it cannot be read."""
    try:
        return parsed(text, "")
    except UnreadableModelError:
        return ElementTree.Element("unreadable")
