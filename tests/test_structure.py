"""The house rules that a reader relies on: imports point one way, and the physics has one home."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from coupled.campaign.sweepfile import Survive, SweepFile, Vary
from coupled.flight.event import Event
from coupled.flight.expectation import Expect
from coupled.flight.manoeuvre import Measure, PressureProfile
from coupled.flight.pilot import PILOTS
from coupled.flight.runfile import RunFile
from coupled.flight.weather import Gust, Turbulence, Wind
from coupled.record import channels
from coupled.record.importing.mapping import Channel, Clock, Layout, LogMap
from coupled.rig import parameters
from coupled.rig.curves import Curve
from coupled.rig.rig import Rig
from coupled.rig.structure import Compliance, Structure
from coupled.schema import Section, file_keys

PACKAGE = Path(__file__).parents[1] / "coupled"
SOURCES = sorted(PACKAGE.rglob("*.py"))

# A room may import from the rooms before it. Parts of a package that are listed by themselves:
# - `plots/histories` draws channels and needs no record, so that `Record.plot` can use it;
# - `record/importing` checks a log against the rig that it is from, so it comes after `rig`;
# - the parts of `gap`, `blind` and `cli` import each other in this order only.
ORDER = [
    "version",
    "errors",
    "timing",
    "units",
    "display",
    "files",
    "outputs",
    "callpool",
    "parallel",
    "schema",
    "arguments",
    "resources",
]
ORDER += [
    "record/channels",
    "plots/histories",
    "results",
    "record",
    "rig",
    "record/importing",
    "flight",
    "surveying",
    "authority",
    "exporting",
    "campaign",
    "calibration",
]
ORDER += [
    "gap/thresholds",
    "gap/chain",
    "gap/noise",
    "gap/signals",
    "gap/effects",
    "gap/stages",
    "gap/search",
    "gap/findings",
    "gap",
    "blind/twin",
    "blind/trials",
    "tables",
    "plots",
    "reports",
    "api",
    "envs",
    "live",
    "pytest_plugin",
    "cli/tables",
    "cli/process",
    "cli/terminal",
    "cli/progress",
    "cli",
]
LOWER = {room: set(ORDER[: i + 1]) for i, room in enumerate(ORDER)}


def room(place: str) -> str:
    """Return the innermost room that a module's place, slashes between its parts, lies in."""
    inside = [name for name in ORDER if place == name or place.startswith(name + "/")]
    return max(inside, key=len, default="")


@cache
def import_statements(path: Path) -> tuple[ast.Import | ast.ImportFrom, ...]:
    """Return the imports of a module anywhere, in functions and for types too."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    return tuple(node for node in nodes if isinstance(node, ast.Import | ast.ImportFrom))


@cache
def imports(path: Path) -> set[str]:
    names = set()
    for node in import_statements(path):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif node.module:
            names.add(node.module)
    return names


@pytest.mark.parametrize("path", SOURCES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_imports_point_one_way(path: Path) -> None:
    here = room(path.relative_to(PACKAGE).with_suffix("").as_posix())
    if path.parent == PACKAGE and path.stem in ("__init__", "__main__"):
        return
    for name in imports(path):
        if name.startswith("coupled."):
            there = room(name.removeprefix("coupled.").replace(".", "/"))
            assert there, name
            assert there in LOWER[here], name


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


def test_nothing_silences_a_warning_or_a_type() -> None:
    for path in [*SOURCES, *Path(__file__).parent.rglob("*.py")]:
        if path == Path(__file__):
            continue
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"# (type: ignore|noqa)|filterwarnings|simplefilter", text), path


def test_every_key_of_the_files_is_documented() -> None:
    text = (PACKAGE.parent / "docs" / "files.md").read_text(encoding="utf-8")
    sections: list[type[Section]] = [Rig, parameters.Flight, parameters.Control]
    sections += [parameters.Loader, parameters.Schedule, parameters.Compensation]
    sections += [parameters.Sensing, parameters.Gains, parameters.Calibration, parameters.Rigging]
    sections += [parameters.Services, *Curve.__subclasses__()]
    sections += [Structure, Compliance]
    sections += [RunFile, PressureProfile, Wind, Gust, Turbulence, Event, Measure, Expect]
    sections += [SweepFile, Vary, Survive]
    sections += [*PILOTS.values(), LogMap, Layout, Clock, Channel]
    for section in sections:
        for key in file_keys(section, "{d}"):
            if key in ("controls", "flight", "loader", "schedule", "compensation", "sensing"):
                continue
            if key in ("services", "gains", "calibration", "rigging", "noise", "measure"):
                continue
            if key in ("structure", "assumed", "bench", "wind", "case", "expect", "kind", "vary"):
                continue
            if key in ("gust", "turbulence", "event", "survive"):
                continue
            if section is LogMap:
                assert f"[{key}" in text, key
                continue
            assert f"`{key}`" in text, (section.__name__, key)
    for name in channels.record_channels(["column"], flown=True)[1:]:
        assert name.removeprefix("column_").replace("_m", "_{d}", 1) in text or name in text, name


# What the twin may take from the rig: its data, and how functions are compiled. No stage.
SHARED = ("coupled.rig.rig", "coupled.rig.parameters", "coupled.rig.compiled")


def test_the_twin_shares_no_stage_with_the_rig() -> None:
    for path in sorted((PACKAGE / "blind" / "twin").glob("*.py")):
        for name in imports(path):
            assert not name.startswith("coupled.rig") or name in SHARED, (path.name, name)


# Circles that stand for now. Delete a line as soon as its circle is gone.
KNOWN_CIRCLES: set[frozenset[str]] = set()


def depends_on(path: Path, modules: set[str]) -> set[str]:
    """Return the package's modules that one imports."""
    found = set()
    for node in import_statements(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            found |= inner & modules if inner <= modules else inner | {node.module}
    return found & modules


def circles(graph: dict[str, set[str]]) -> set[frozenset[str]]:
    """Return the strongly connected components of more than one module (Tarjan 1972)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: set[frozenset[str]] = set()

    def visit(module: str) -> None:
        index[module] = low[module] = len(index)
        stack.append(module)
        for other in graph[module]:
            if other not in index:
                visit(other)
            if other in stack:
                low[module] = min(low[module], low[other])
        if low[module] == index[module]:
            at = stack.index(module)
            component = frozenset(stack[at:])
            del stack[at:]
            if len(component) > 1:
                found.add(component)

    for module in sorted(graph):
        if module not in index:
            visit(module)
    return found


def test_a_circle_of_imports_is_found() -> None:
    graph = {"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": {"e"}, "e": set[str]()}
    assert circles(graph) == {frozenset("abc")}


def test_no_modules_import_each_other_in_a_circle() -> None:
    named = {
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts): path for path in SOURCES
    }
    modules = {name.removesuffix(".__init__"): path for name, path in named.items()}
    graph = {name: depends_on(path, set(modules)) - {name} for name, path in modules.items()}
    found = circles(graph)
    assert found <= KNOWN_CIRCLES, [sorted(circle) for circle in found - KNOWN_CIRCLES]


TESTS = sorted(Path(__file__).parent.rglob("*.py"))


@pytest.mark.parametrize("path", TESTS, ids=lambda p: str(p.relative_to(PACKAGE.parent)))
def test_test_modules_share_code_only_through_tests_support(path: Path) -> None:
    """No test module imports another."""
    for name in imports(path):
        assert not name.startswith("tests.") or name.startswith("tests.support"), name
