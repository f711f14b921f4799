"""A sweep file: its keys, and the checks that need no run file."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

from coupled.errors import MISSING, InputError, collected, together
from coupled.flight.expectation import Figure
from coupled.flight.manoeuvre import Configuration
from coupled.rig.parameters import PlainName
from coupled.schema import Section, build, file_keys, known_keys, quantity

MOST_FLIGHTS = 1_000_000
FIGURES: tuple[Figure, ...] = ("loss", "felt_ratio", "force_N", "peak_rate_rad_per_s")
_NO_CONDITION = ("name", "card", "case", "configurations", "expect", "record_properties")


class Vary(Section):
    """A parameter and its values: a list, or a range. `also` are further keys with its value."""

    key: str = quantity("", min_length=1, max_length=200)
    also: list[str] = []
    values: list[Any] | None = quantity("", None, min_length=1)
    low: float | None = None
    high: float | None = None
    steps: int | None = quantity("", None, ge=2, le=10_000)
    spread: Literal["even", "log"] = "even"


class Survive(Section):
    """A condition of survival: a channel within bounds, in every row."""

    channel: str = quantity("", min_length=1)
    least: float | None = None
    most: float | None = None


class SweepFile(Section):
    """The keys of a sweep file."""

    name: PlainName
    run: str = quantity("", min_length=1)
    case: str | None = None
    configurations: list[Configuration] = []
    method: Literal["grid", "sobol", "random", "sensitivity"] = "grid"
    samples: int | None = quantity("", None, ge=1, le=MOST_FLIGHTS)
    seed: int = quantity("", 0, ge=0)
    reseed: bool = False
    keep: list[Figure] = quantity("", list(FIGURES), min_length=1)
    extremes: list[str] = []
    survive: list[Survive] = []
    vary: list[Vary] = quantity("", min_length=1)


def read_sections(given: Mapping[str, Any], file: Path) -> SweepFile:
    """Return a sweep file's tables; all their faults are raised together."""
    sweep = _sections(given, file)
    if faults := list(_faults(sweep, file)):
        raise together(faults)
    return sweep


def _sections(given: Mapping[str, Any], file: Path) -> SweepFile:
    """Return the tables of a sweep file, with each value checked separately."""
    table, faults = dict(given), list[InputError]()
    with collected(faults):
        known_keys(table, file_keys(SweepFile, "m"), file, "")
    kinds: dict[str, type[Section]] = {"vary": Vary, "survive": Survive}
    for key, kind in kinds.items():
        listed = table.get(key, [])
        if not isinstance(listed, list):
            faults.append(InputError(file, key, f"each is written [[{key}]]"))
            del table[key]
            continue
        built = []
        for i, item in enumerate(listed):
            with collected(faults):
                built.append(build(kind, item, file, f"{key}[{i}]"))
        if built:
            table[key] = built
        elif listed:
            del table[key]
    known = {key: value for key, value in table.items() if key in file_keys(SweepFile, "m")}
    sweep: SweepFile | None = None
    with collected(faults):
        sweep = build(SweepFile, known, file, "")
    if faults or sweep is None:
        there = [key for key in kinds if key in given]  # but with errors of their own
        raise together([f for f in faults if f.problem != MISSING or f.key not in there])
    return sweep


def _faults(sweep: SweepFile, file: Path) -> Iterator[InputError]:
    """Yield the errors of combinations of keys."""
    keys: list[Any] = [key for vary in sweep.vary for key in (vary.key, *vary.also)]
    lists: dict[str, list[Any]] = {"vary": keys, "keep": sweep.keep, "extremes": sweep.extremes}
    lists["configurations"] = sweep.configurations
    for name, words in lists.items():
        for word in dict.fromkeys(words):
            if words.count(word) > 1:
                yield InputError(file, name, f"duplicate {word}")
    for key in keys:
        if key.partition(".")[0] in _NO_CONDITION:
            yield InputError(file, "vary", f"{key} is varied, but has no effect on any flight")
    ranges = [fault for i in range(len(sweep.vary)) for fault in _range_faults(sweep, i, file)]
    yield from ranges
    yield from _size_faults(sweep, file, countable=not ranges)
    for i, each in enumerate(sweep.survive):
        if each.least is None and each.most is None:
            yield InputError(file, f"survive[{i}]", "has no bound: give least or most")


def _size_faults(sweep: SweepFile, file: Path, countable: bool) -> Iterator[InputError]:
    if (sweep.method != "grid") != (sweep.samples is not None):
        problem = "is given with sobol, random and sensitivity, and not with grid"
        yield InputError(file, "samples", problem)
        return
    samples = sweep.samples or 0
    if sweep.method == "sensitivity" and (samples < 8 or samples & (samples - 1)):
        near = 2 ** max(3, round(math.log2(samples)))
        yield InputError(
            file, "samples", f"must be a power of two, 8 or more, with sensitivity: {near}"
        )
    if countable and (flights := flight_count(sweep)) > MOST_FLIGHTS:
        yield InputError(file, "vary", f"makes {flights} flights; at most {MOST_FLIGHTS}")


def flight_count(sweep: SweepFile) -> int:
    """Return the number of flights of a sweep."""
    flights = (sweep.samples or grid_size(sweep)) * max(1, len(sweep.configurations))
    return flights * (len(sweep.vary) + 2) if sweep.method == "sensitivity" else flights


def grid_size(sweep: SweepFile) -> int:
    """Return the number of points of a grid."""
    size = 1
    for vary in sweep.vary:
        size *= vary.steps or len(vary.values or ())
    return size


def _range_faults(sweep: SweepFile, index: int, file: Path) -> Iterator[InputError]:
    vary, place = sweep.vary[index], f"vary[{index}]"
    ranged = vary.low is not None and vary.high is not None
    if (vary.values is None) != ranged or (vary.low is None) != (vary.high is None):
        yield InputError(file, place, "give values, or low and high")
        return
    if ranged and (sweep.method == "grid") != (vary.steps is not None):
        yield InputError(file, f"{place}.steps", "goes with low and high in a grid, and only there")
    low, high = vary.low or 0.0, vary.high or 0.0
    if ranged and not (low < high and (vary.spread == "even" or low > 0.0)):
        problem = "must be above low, and low above 0 where the spread is log"
        yield InputError(file, f"{place}.high", problem)
