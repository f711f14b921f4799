"""The house rules that a reader relies on: imports point one way, and the physics has one home."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from coupled import channels
from coupled.campaign.plan import Survive, SweepFile, Vary
from coupled.flight.event import Event
from coupled.flight.expectation import Expect
from coupled.flight.pilot import PILOTS
from coupled.flight.scenario import Bench, Measure, RunFile
from coupled.flight.weather import Gust, Turbulence
from coupled.flight.wind import Wind
from coupled.logs.mapping import Channel, Clock, Layout, LogMap
from coupled.rig import parameters
from coupled.schema import Section, file_keys

PACKAGE = Path(__file__).parents[1] / "coupled"
SOURCES = sorted(PACKAGE.rglob("*.py"))

# A room may import from the rooms left of it.
ORDER = [
    "errors",
    "units",
    "files",
    "schema",
    "csvfile",
    "resources",
    "channels",
    "rig",
    "record",
    "logs",
    "flight",
]
ORDER += [
    "authority",
    "maps",
    "stability",
    "campaign",
    "calibration",
    "gap",
    "blind",
    "plots",
    "tables",
    "terminal",
    "cli",
]
LOWER = {room: set(ORDER[: i + 1]) for i, room in enumerate(ORDER)}


def room(path: Path) -> str:
    first = path.relative_to(PACKAGE).parts[0]
    return first.removesuffix(".py")


def imports(path: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module)
    return names


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_one_way(path: Path) -> None:
    if room(path) in ("__init__", "__main__"):
        return
    for name in imports(path):
        if name.startswith("coupled."):
            assert name.split(".")[1] in LOWER[room(path)], name


@pytest.mark.parametrize(
    ("library", "home"),
    [("jsbsim", "flight/airframe.py"), ("matplotlib", "plots/"), ("numba", "rig/compiled.py")],
)
def test_a_library_has_one_home(library: str, home: str) -> None:
    users = [
        path.relative_to(PACKAGE).as_posix()
        for path in SOURCES
        if any(name.split(".")[0] == library for name in imports(path))
    ]
    assert users
    assert all(user == home or (home[-1] == "/" and user.startswith(home)) for user in users)


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_module_grows_past_reading(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= 300


def test_nothing_silences_a_warning_or_a_type() -> None:
    for path in [*SOURCES, *Path(__file__).parent.rglob("*.py")]:
        if path == Path(__file__):
            continue
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"# (type: ignore|noqa)|filterwarnings|simplefilter", text), path


def test_every_key_of_the_files_is_documented() -> None:
    text = (PACKAGE.parent / "docs" / "files.md").read_text(encoding="utf-8")
    sections: list[type[Section]] = [parameters.Rig, parameters.Flight, parameters.Control]
    sections += [parameters.Loader, parameters.Schedule, parameters.Compensation]
    sections += [parameters.Sensing, parameters.Gains, parameters.Calibration, parameters.Rigging]
    sections += [RunFile, Bench, Wind, Gust, Turbulence, Event, Measure, Expect]
    sections += [SweepFile, Vary, Survive]
    sections += [*PILOTS.values(), LogMap, Layout, Clock, Channel]
    for section in sections:
        for key in file_keys(section, "{d}"):
            if key in ("controls", "flight", "loader", "schedule", "compensation", "sensing"):
                continue
            if key in ("gains", "calibration", "rigging", "noise", "measure"):
                continue
            if key in ("bench", "wind", "case", "expect", "kind", "vary"):
                continue
            if key in ("gust", "turbulence", "event", "survive"):
                continue
            if section is LogMap:
                assert f"[{key}" in text, key
                continue
            assert f"`{key}`" in text, (section.__name__, key)
    for name in channels.record_channels(["column"], flown=True)[1:]:
        assert name.removeprefix("column_").replace("_m", "_{d}", 1) in text or name in text, name
