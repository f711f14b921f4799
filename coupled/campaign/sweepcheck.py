"""Checks of a sweep file's tables by themselves, before its run is read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from coupled.campaign.points import grid_size
from coupled.campaign.sweepfile import MOST_FLIGHTS, Survive, SweepFile, Vary
from coupled.errors import MISSING, InputError, collected, together
from coupled.schema import Section, build, file_keys, known_keys

_NO_CONDITION = ("name", "card", "case", "configurations", "expect", "record_properties")


def read_sections(given: Mapping[str, Any], file: Path) -> SweepFile:
    """Return a sweep file's tables; all faults are raised together."""
    sweep = _sections(given, file)
    if faults := list(_faults(sweep, file)):
        raise together(faults)
    return sweep


def _sections(given: Mapping[str, Any], file: Path) -> SweepFile:
    """Return a sweep file's tables, with each value checked by itself."""
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
        there = [key for key in kinds if key in given]  # present, with faults of their own
        raise together([f for f in faults if f.problem != MISSING or f.key not in there])
    return sweep


def _faults(sweep: SweepFile, file: Path) -> Iterator[InputError]:
    """Yield the contradictions between a sweep's values."""
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
