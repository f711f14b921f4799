"""A log converted to a record: read by its map, put on even frames, checked, with an account."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.files import sha256
from coupled.record.channels import TIME
from coupled.record.importing import plausible
from coupled.record.importing.account import ChannelAccount, ImportAccount
from coupled.record.importing.clock import Grid, on_frames
from coupled.record.importing.heads import known_map
from coupled.record.importing.judging import judge
from coupled.record.importing.mapping import (
    Channel,
    LogMap,
    as_table,
    factor_of,
    named_in,
    own_unit,
    read_map,
)
from coupled.record.importing.reading import Log
from coupled.record.importing.several import clock_of, lay_grids, log_of, read_logs
from coupled.record.record import Record
from coupled.rig.rig import Rig
from coupled.schema import LARGEST, SMALLEST
from coupled.units import parse_unit, usual_unit

Floats = NDArray[np.float64]


def import_log(
    log_file: Path | Sequence[Path], map_file: Path | None = None, rig: Rig | None = None
) -> tuple[Record, ImportAccount]:
    """Return the record of a log, or of several, and the account of the import.

    The first log's rows make the frames; a channel of another log is interpolated by its own
    stamps, and the record covers the time common to all. The record's manifest has the account
    too. Without a map the log must be of a program with known heads. A `rig` with controls gives
    the frame rate of its host. Travels and force gradients of a rig are compared with the channels.
    Raises InputError.
    """
    files = [log_file] if isinstance(log_file, Path) else list(log_file)
    inputs = [*files, *([map_file] if map_file else [])]
    if map_file is None:
        _, log_map = known_map(files[0])
        map_file = files[0]
    else:
        log_map = read_map(map_file)
    whole_map, constants = log_map, _constants(log_map, map_file)
    read = {name: one for name, one in log_map.channels.items() if name not in constants}
    log_map = log_map.model_copy(update={"channels": read})
    logs = read_logs(files, log_map, map_file)
    main = next(iter(logs.values()))
    rate = rig.frame_rate if rig is not None and rig.controls else None
    asked = log_map.clock.frame_rate
    if rate is not None and asked is not None and abs(asked / rate - 1.0) > 1e-3:
        problem = f"is {asked:g}, the rig's {rate:g}; leave it out to take the rig's"
        raise InputError(map_file, "clock.frame_rate_Hz", problem)
    grids = lay_grids(logs, log_map, map_file, rate)
    grid = grids[main.name]
    warnings = [*_notes(logs), *_clock_warnings(grid)]
    if map_file == files[0] and log_map.clock.start > 0.0:
        warnings.append("the first row is from before JSBSim's trim, and is left out")
    record, logged, filled = {}, {}, {}
    for name in named_in(log_map):
        channel = log_map.channels[name]
        log = logs[log_of(name, log_map, logs, map_file)]
        own = grids[log.name]
        values = _in_si(log, name, channel, map_file, warnings)
        if len(values) != own.rows:
            problem = f"has {len(values)} rows, the clock {own.rows}: sampled by another clock?"
            raise InputError(log.file, channel.source, problem)
        kept = values[own.kept]
        filled[name] = _check_gaps(log, log_map, name, own, kept)
        record[name] = _on_frames(name, own, kept, channel.delay)
        logged[name] = kept[np.isfinite(kept) & own.inside()]
        if logged[name].size < 2:
            raise InputError(log.file, channel.source, "has fewer than two numbers in this span")
    judged = judge(record, logged, grid.frame_time_s, rig, main.file)
    record |= {name: np.full(grid.frames, value) for name, value in constants.items()}
    names = [name for name in named_in(whole_map) if name in record]
    channels = {
        name: ChannelAccount(
            source=log_map.channels[name].source,
            least=found.least,
            greatest=found.greatest,
            rms=found.rms,
            noise=found.noise,
            doubts=found.doubts,
            filled_cells=filled[name],
        )
        for name, found in judged.items()
    }
    channels |= {name: ChannelAccount.constant(value) for name, value in constants.items()}
    account = ImportAccount(
        grid.account, channels, _unmapped(logs, log_map, map_file), tuple(warnings)
    )
    manifest = {
        "imported_from": files[0].name if len(files) == 1 else [path.name for path in files],
        "inputs_sha256": {path.name: sha256(path) for path in inputs},
        "map": as_table(whole_map),
        "channels": [TIME, *names],
        "rows": grid.frames,
        "rig": rig.model_dump() if rig is not None else None,
        "import": account.as_dict(),
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("coupled", "numpy", "scipy", "polars")},
        },
    }
    data = np.column_stack([grid.frame_time_s, *(record[name] for name in names)])
    return Record((TIME, *names), data, manifest), account


def _constants(log_map: LogMap, map_file: Path) -> dict[str, float]:
    """Return the channels that no log holds, each in the unit that it ends in."""
    return {
        name: one.sign
        * (1.0 if one.own else factor_of(name, one.unit or own_unit(name), map_file, one.radius))
        * (one.scale * one.value + one.offset)
        for name, one in log_map.channels.items()
        if one.value is not None
    }


def _in_si(log: Log, name: str, channel: Channel, map_file: Path, warnings: list[str]) -> Floats:
    """Return a channel at the log's rows, in the unit of its name."""
    key = f"channels.{name}"
    values = log.values(channel, map_file, key)
    scaling = log.unscaled.get(channel.source)
    if scaling and not channel.model_fields_set & {"scale", "offset"}:
        problem = f"the file gives {scaling}, and whether its numbers still need that is not known:"
        problem += f" give {key}.scale and offset; scale = 1 where they are physical"
        raise InputError(log.file, channel.source, problem)
    stated = log.units.get(channel.source, "")
    if not channel.own and not channel.unit and not stated:
        raise InputError(map_file, f"{key}.unit", "is missing; the log states none")
    given = channel.unit or stated
    factor = 1.0 if channel.own else factor_of(name, given, map_file, channel.radius)
    if channel.unit and stated and parse_unit(usual_unit(stated)) != parse_unit(channel.unit):
        warnings.append(f"{name}: the map says {channel.unit}, the log itself {stated}")
    si = channel.sign * factor * (channel.scale * values + channel.offset)
    huge = np.abs(si) > LARGEST
    if huge.any():
        row = int(np.argmax(huge))
        problem = f"row {log.line(row)} makes {si[row]:.3g}, larger than any real one"
        raise InputError(log.file, channel.source, problem)
    si[np.abs(si) < SMALLEST] = 0.0  # includes −0, from a sign of an exact zero
    return np.asarray(si)


def _check_gaps(log: Log, log_map: LogMap, name: str, grid: Grid, values: Floats) -> int:
    """Return the number of interpolated empty cells; refuse those at an end, or too many."""
    channel = log_map.channels[name]
    most = log_map.clock.longest_gap if channel.longest_gap is None else channel.longest_gap
    empty = ~np.isfinite(values)
    if empty.all():
        raise InputError(log.file, channel.source, "is empty")
    valid = np.flatnonzero(~empty)
    end_s = (grid.frames - 1) / grid.frame_rate_Hz + channel.delay
    slack_s = 0.5 / grid.frame_rate_Hz
    if grid.time_s[valid[0]] > channel.delay + slack_s or grid.time_s[valid[-1]] < end_s - slack_s:
        from_s, to_s = (grid.time_s[valid[i]] + grid.account.start_s for i in (0, -1))
        where = f"has numbers only from {from_s:.3f} to {to_s:.3f} s"
        raise InputError(log.file, channel.source, f"{where}; cut by clock.start_s and end_s")
    holes = np.diff(valid) - 1
    if holes.max(initial=0) > most:
        row = int(valid[int(np.argmax(holes > most))]) + 1
        length = int(holes[holes > most][0])
        where = f"row {log.line(grid.kept.start + row)}: {length} empty cells"
        problem = f"{where}; longest_gap_rows = {most} allows no more in a row"
        raise InputError(log.file, channel.source, problem)
    return int(np.count_nonzero(empty & grid.inside()))


def _on_frames(name: str, grid: Grid, values: Floats, delay_s: float) -> Floats:
    if name not in plausible.TURNING:
        return on_frames(grid, values, delay_s, held=name.endswith("_stop"))
    # Interpolate across the wrap: 0° between 359° and 1°, not 180°.
    turn = 2.0 * np.pi
    valid = np.isfinite(values)
    smooth = values.copy()
    smooth[valid] = np.unwrap(values[valid])
    if np.array_equal(smooth[valid], values[valid]):
        return on_frames(grid, values, delay_s)
    base = 0.0 if np.min(values[valid]) >= 0.0 else -np.pi
    result = on_frames(grid, smooth, delay_s)
    return np.asarray(np.mod(result - base, turn) + base)


def _notes(logs: Mapping[str, Log]) -> list[str]:
    """Return the notes on the logs, each with the log's name if there are several."""
    several = len({log.file for log in logs.values()}) > 1
    notes = [
        f"{log.file.name}: {note}" if several else note
        for log in logs.values()
        for note in log.notes
    ]
    return list(dict.fromkeys(notes))


def _clock_warnings(grid: Grid) -> list[str]:
    warnings = []
    ratio = grid.frame_rate_Hz / grid.account.log_rate_Hz
    if ratio > 1.1:
        share = f"{ratio:.3g} frames a row of the log"
        warnings.append(f"{share}: nothing faster is in it, and its noise is no longer white")
    elif ratio < 0.9:
        half = f"{0.5 * grid.frame_rate_Hz:g} Hz"
        warnings.append(f"{1 / ratio:.3g} rows a frame: what the log has above {half} folds down")
    if grid.account.missing_rows:
        warnings.append(f"{grid.account.missing_rows} missing rows were interpolated")
    return warnings


def _unmapped(logs: Mapping[str, Log], log_map: LogMap, map_file: Path) -> tuple[str, ...]:
    """Return the unmapped columns, with their log if there are several."""
    used = {
        (log_of(name, log_map, logs, map_file), channel.source)
        for name, channel in log_map.channels.items()
    }
    used |= {(name, clock_of(log, log_map).source) for name, log in logs.items()}
    files = {log.file for log in logs.values()}
    return tuple(
        column if len(files) == 1 else f"{name}: {column}"
        for name, log in logs.items()
        for column in log.columns
        if (name, column) not in used
    )
