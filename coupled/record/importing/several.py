"""Several logs of one test, each with stamps of its own from one clock, on the same frames.

So are the parts of one log that has groups of columns sampled apart (MDF, TDMS, MCAP, ULog).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from coupled.errors import InputError, nearest
from coupled.record.importing.clock import EVEN_frames, Grid, beside, lay_grid, stamps_of
from coupled.record.importing.mapping import Clock, LogMap, OtherClock
from coupled.record.importing.reading import Log, Stamps, read_log


def read_logs(files: Sequence[Path], log_map: LogMap, map_file: Path) -> dict[str, Log]:
    """Return the logs by their file names, the one that makes the frames first."""
    logs: dict[str, Log] = {}
    for file in files:
        if file.name in logs:
            raise InputError(file, "", "has the name of another log given: rename one of them")
        logs[file.name] = read_log(file, log_map.log)
    for name in log_map.clocks:
        if name not in logs:
            raise InputError(map_file, f"clocks.{name}", _not_given(name, logs))
    if len(logs) > 1 and not log_map.clock.source:
        problem = "is needed where several logs are given: their stamps say how they lie"
        raise InputError(map_file, "clock.from", problem)
    parts = [part for log in logs.values() for part in _parts(log, logs, log_map, map_file)]
    return {part.name: part for part in parts}


def _parts(log: Log, logs: Mapping[str, Log], log_map: LogMap, map_file: Path) -> list[Log]:
    """Return a log as the parts of it that are used and were sampled apart, the clock's first."""
    clock = log_map.clocks.get(log.file.name, log_map.clock)
    if not log.stamps or not clock.source:
        return [log]
    log.find(clock.source, map_file, "clock.from")
    main = log.groups.get(clock.source, "")
    used = set()
    for name, channel in log_map.channels.items():
        if log_of(name, log_map, logs, map_file) == log.file.name:
            log.find(channel.source, map_file, f"channels.{name}.from")
            used.add(log.groups.get(channel.source, ""))
    parts = []
    for group in dict.fromkeys([main, *log.groups.values()]):
        if group not in used | {main}:
            continue
        with_clock = group == main
        columns = {
            name: column
            for name, column in log.columns.items()
            if log.groups.get(name, "") == group or (with_clock and name not in log.stamps)
        }
        parts.append(replace(log, columns=columns, part="" if with_clock else group))
    return parts


def _not_given(name: str, logs: Mapping[str, Log]) -> str:
    names = [log.file.name for log in logs.values()]
    return f"no log {name!r} was given; {nearest(name, names)}"


def log_of(channel: str, log_map: LogMap, logs: Mapping[str, Log], map_file: Path) -> str:
    """Return the file name of the log that a channel is in; the first unless the map says more."""
    name = log_map.channels[channel].log
    source = log_map.channels[channel].source
    file = name or next(iter(logs.values())).file.name
    own = [each for each, log in logs.items() if log.file.name == file]
    if not own:
        raise InputError(map_file, f"channels.{channel}.log", _not_given(name, logs))
    return next((each for each in own if source in logs[each].columns), own[0])


def clock_of(log: Log, log_map: LogMap) -> Clock | OtherClock:
    """Return what a log's stamps are read by.

    A part that was sampled apart has its times in a column of its own: the one that is called
    as the clock's is in its group, or else the one that its format stamps it by.
    """
    clock = log_map.clocks.get(log.file.name, log_map.clock)
    if not log.part:
        return clock
    main = log.groups.get(clock.source, "")
    alike = f"{log.part}{clock.source.removeprefix(main)}"
    if alike in log.columns and alike != clock.source:
        return OtherClock.model_construct(source=alike, unit=clock.unit, date=clock.date)
    column = next(iter(log.columns))
    return OtherClock.model_construct(source=log.stamps[column], unit="", date="")


def lay_grids(
    logs: Mapping[str, Log], log_map: LogMap, map_file: Path, frame_rate_Hz: float | None
) -> dict[str, Grid]:
    """Return the record's frames over the rows of each log, over what all of them last."""
    main, *others = logs
    if not others:
        return {main: lay_grid(logs[main], log_map, map_file, frame_rate_Hz)}
    stamps = {name: _stamps(logs[name], name, log_map, map_file) for name in logs}
    first_s = {name: float(found.first_s - stamps[main].first_s) for name, found in stamps.items()}
    last_s = {name: first_s[name] + float(stamps[name].from_first_s[-1]) for name in logs}
    span_s = max(first_s.values()), min(last_s.values())
    if span_s[0] >= span_s[1]:
        begin = next(name for name in logs if first_s[name] == span_s[0])
        end = next(name for name in logs if last_s[name] == span_s[1])
        problem = f"begins {span_s[0] - span_s[1]:.6g} s after {end} ends: one clock for both?"
        raise InputError(logs[begin].file, clock_of(logs[begin], log_map).source, problem)
    # A row that lies on the end but for its stamp's rounding is not cut off.
    slack_s = EVEN_frames * float(np.median(np.diff(stamps[main].from_first_s)))
    span_s = span_s[0] - slack_s, span_s[1] + slack_s
    grid = lay_grid(logs[main], log_map, map_file, frame_rate_Hz, span_s)
    grids = {main: grid}
    delay_s = max(channel.delay for channel in log_map.channels.values())
    gap = log_map.clock.longest_gap
    for name in others:
        source = clock_of(logs[name], log_map).source
        time_s = np.asarray(
            stamps[name].from_first_s + (first_s[name] - first_s[main] - grid.account.start_s)
        )
        grids[name] = beside(grid, time_s, delay_s, logs[name], source, gap)
    return grids


def _stamps(log: Log, name: str, log_map: LogMap, map_file: Path) -> Stamps:
    key = f"clocks.{name}" if name in log_map.clocks else "clock"
    return stamps_of(log, clock_of(log, log_map), map_file, key)
