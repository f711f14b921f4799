"""Several logs of one test, each with its own stamps of one clock, on the same frames.

The parts of one log with groups of columns sampled apart (MDF, TDMS, MCAP, ULog) are treated alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from coupled.errors import InputError, nearest
from coupled.record.importing.clock import (
    EVEN_frames,
    Grid,
    beside,
    check_rate,
    lay_grid,
    stamps_of,
)
from coupled.record.importing.mapping import Clock, LogMap, OtherClock
from coupled.record.importing.reading import Log, Stamps, read_log
from coupled.record.importing.rows import use_rows


def read_logs(files: Sequence[Path], log_map: LogMap, map_file: Path) -> dict[str, Log]:
    """Return the logs by their names, first the one that makes the frames, with the rows used."""
    logs: dict[str, Log] = {}
    for file in files:
        if file.name in logs:
            raise InputError(file, "", "has the name of another log given: rename one of them")
        logs[file.name] = read_log(file, log_map.log)
    if len(logs) > 1 and not log_map.clock.source:
        problem = "is needed for several logs, which are aligned by their time stamps"
        raise InputError(map_file, "clock.from", problem)
    parts = [part for log in logs.values() for part in _parts(log, logs, log_map, map_file)]
    names = [*logs, *(part.name for part in parts)]
    for name in log_map.clocks:
        if name not in names:
            raise InputError(map_file, f"clocks.{name}", _not_given(name, names))
    by_name = {part.name: part for part in parts}
    found = {}
    for name, part in by_name.items():
        clock, key = clock_of(part, log_map), _key(part, log_map)
        found[name] = use_rows(part, clock, _used(name, by_name, log_map, map_file), map_file, key)
    return found


def _used(name: str, logs: Mapping[str, Log], log_map: LogMap, map_file: Path) -> list[str]:
    """Return the columns of a log in the map."""
    return [
        channel.source
        for own, channel in log_map.channels.items()
        if log_of(own, log_map, logs, map_file) == name
    ]


def _key(log: Log, log_map: LogMap) -> str:
    """Return the key of the map for a log's clock."""
    if log.part or log.file.name in log_map.clocks:
        return f'clocks."{log.name}"'
    return "clock"


def _parts(log: Log, logs: Mapping[str, Log], log_map: LogMap, map_file: Path) -> list[Log]:
    """Return the used parts of a log that were sampled apart, the clock's first."""
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


def _not_given(name: str, names: Iterable[str]) -> str:
    return f"no log {name!r} was given; {nearest(name, names)}"


def log_of(channel: str, log_map: LogMap, logs: Mapping[str, Log], map_file: Path) -> str:
    """Return the file name of the log with a channel; the first unless the map names one."""
    name = log_map.channels[channel].log
    source = log_map.channels[channel].source
    file = name or next(iter(logs.values())).file.name
    own = [each for each, log in logs.items() if log.file.name == file]
    if not own:
        names = [log.file.name for log in logs.values()]
        raise InputError(map_file, f"channels.{channel}.log", _not_given(name, names))
    return next((each for each in own if source in logs[each].columns), own[0])


def clock_of(log: Log, log_map: LogMap) -> Clock | OtherClock:
    """Return the clock by which a log's stamps are read.

    A part that was sampled apart has a column of times of its own: that with the clock's name in
    its group, or else the one by which its format stamps it. Its rows are sorted, and their
    duplicates dropped, as those of the clock, since one logger wrote both.
    """
    clock = log_map.clocks.get(log.file.name, log_map.clock)
    if not log.part:
        return clock
    if log.name in log_map.clocks:
        return log_map.clocks[log.name]
    main = log.groups.get(clock.source, "")
    alike = f"{log.part}{clock.source.removeprefix(main)}"
    if alike in log.columns and alike != clock.source:
        return OtherClock.model_construct(
            source=alike,
            unit=clock.unit,
            date=clock.date,
            wraps_at=clock.wraps_at,
            sort=clock.sort,
            drop_duplicates=clock.drop_duplicates,
        )
    own = log.stamps[next(iter(log.columns))]
    return OtherClock.model_construct(
        source=own,
        unit="" if log.units.get(own) else clock.unit,
        sort=clock.sort,
        drop_duplicates=clock.drop_duplicates,
    )


def lay_grids(
    logs: Mapping[str, Log], log_map: LogMap, map_file: Path, frame_rate_Hz: float | None
) -> dict[str, Grid]:
    """Return the record's frames over the rows of each log, for the time common to all."""
    main, *others = logs
    if not others:
        return {main: lay_grid(logs[main], log_map, map_file, frame_rate_Hz)}
    stamps = {name: _stamps(log, log_map, map_file) for name, log in logs.items()}
    first_s = {name: float(found.first_s - stamps[main].first_s) for name, found in stamps.items()}
    last_s = {name: first_s[name] + float(stamps[name].from_first_s[-1]) for name in logs}
    span_s = max(first_s.values()), min(last_s.values())
    if span_s[0] >= span_s[1]:
        begin = next(name for name in logs if first_s[name] == span_s[0])
        end = next(name for name in logs if last_s[name] == span_s[1])
        problem = f"begins {span_s[0] - span_s[1]:.6g} s after {end} ends: one clock for both? If"
        other = end if begin == main else begin
        problem += f' not, clocks."{other}".shift_s adds their difference to the times of {other}'
        raise InputError(logs[begin].file, clock_of(logs[begin], log_map).source, problem)
    # A row at the end, but for its stamp's rounding, is included.
    slack_s = EVEN_frames * float(np.median(np.diff(stamps[main].from_first_s)))
    span_s = span_s[0] - slack_s, span_s[1] + slack_s
    grid = lay_grid(logs[main], log_map, map_file, frame_rate_Hz, span_s)
    grids = {main: grid}
    delay_s = max(channel.delay for channel in log_map.channels.values())
    gap = log_map.clock.longest_gap
    for name in others:
        clock, key = clock_of(logs[name], log_map), _key(logs[name], log_map)
        own = log_map.clocks[name].unit if name in log_map.clocks else ""
        # Otherwise the unit is that of the first log, or s.
        if not (own or clock.date or logs[name].units.get(clock.source)):
            step_s = float(np.median(np.diff(stamps[name].from_first_s)))
            check_rate(logs[name], clock, step_s, f"{key}.unit", f'set clocks."{name}".unit')
        time_s = np.asarray(
            stamps[name].from_first_s + (first_s[name] - first_s[main] - grid.account.start_s)
        )
        grids[name] = beside(grid, time_s, delay_s, logs[name], clock, key, gap)
    return grids


def _stamps(log: Log, log_map: LogMap, map_file: Path) -> Stamps:
    clock = clock_of(log, log_map)
    found = stamps_of(log, clock, (), map_file, _key(log, log_map))
    shift_s = clock.shift if isinstance(clock, OtherClock) else 0.0
    return replace(found, first_s=found.first_s + Fraction(shift_s))
