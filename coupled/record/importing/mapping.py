"""The map of a log: the column, unit, sign and time of each channel.

A channel of the record is sign · unit · (scale · raw + offset), with `offset` in the log's unit; a
torque is a force at a radius, and a channel may be a constant. A sensor's delay `delay_s` is
removed. With several logs, a channel names its own, and each log has its own stamps, all from one
clock.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator
from pydantic_core import PydanticCustomError

from coupled.errors import InputError, collected, nearest, together
from coupled.record.channels import (
    CONTROL_NAMES,
    LATERAL,
    LOADER_TIME,
    LONGITUDINAL,
    TIME,
    VALIDITY,
    control_channels,
    misnamed,
)
from coupled.schema import Section, build, file_keys, known_keys, load_toml, named, quantity
from coupled.units import Unit, parse_unit, unit_names, units_like

CHANNELS: tuple[str, ...] = (
    *(name for control in CONTROL_NAMES for name in control_channels(control)),
    *LONGITUDINAL,
    *LATERAL,
)
LOAD_FACTOR = "load_factor"
_OWN_NAME = re.compile("[A-Za-z][A-Za-z0-9_]{0,63}")


class Layout(Section):
    """The layout of the log's file; `format` is by default that of the file's extension."""

    format: (
        Literal["csv", "parquet", "mat", "hdf5", "mdf", "tdms", "mcap", "ulog", "json"] | None
    ) = None
    delimiter: str = quantity("", ",", min_length=1, max_length=1)
    decimal: Literal[".", ","] = "."
    comment: str = ""
    skip_rows: int = quantity("", 0, ge=0, le=100_000)
    header: bool = True
    units_row: bool = False
    missing: list[str] = []
    encoding: Literal["utf-8", "latin-1", "utf-16"] = "utf-8"
    matrix: str = ""
    names: list[str] | str = "signals"


def _rows_given(value: object) -> object:
    each = value if isinstance(value, list) else [None]
    if any(isinstance(row, bool) or not isinstance(row, (int, str)) for row in each):
        raise PydanticCustomError("rows", 'should be a list of rows, as [962, "970-980"]')
    return value


class Stamped(Section):
    """The times of a log's rows, and which rows are used."""

    source: str = named("from", "")
    unit: str = ""  # the log's own, or s where it states none
    date: str = ""
    wraps_at: float | None = quantity("", None, gt=0, le=2.0**64)
    drop_rows: Annotated[list[int | str], BeforeValidator(_rows_given)] = []
    sort: bool = False
    drop_duplicates: bool = False


class Clock(Stamped):
    """The clock of the log that makes the frames, the record's frame rate, and the cut."""

    rate: float | None = quantity("Hz", None, gt=0, le=1e6)
    frame_rate: float | None = quantity("Hz", None, ge=1, le=10_000)
    start: float = quantity("s", 0.0, ge=0)
    end: float | None = quantity("s", None, gt=0)
    longest_gap: int = quantity("rows", 2, ge=0, le=1000)


def _no_bool(value: object) -> object:
    if isinstance(value, bool):  # a subclass of int in Python
        raise PydanticCustomError("sign", "should be 1 or -1")
    return value


def _one_element(value: object) -> object:
    place = isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= 10_000
    if not place and not (isinstance(value, str) and value):
        raise PydanticCustomError("element", "should be a place from 1 to 10000, or a name")
    return value


class OtherClock(Stamped):
    """The clock of a further log, if its stamps differ from the first log's.

    `shift` is added to its times: by so much the first log's clock is ahead.
    """

    source: str = named("from", min_length=1)
    shift: float = quantity("s", 0.0)


class Channel(Section):
    """One channel of the record, from one column of a log, or of one `value` throughout.

    `own` is true for a channel of the user's own, as a temperature: it is kept without a unit.
    """

    source: str = named("from", "")
    own: bool = False
    value: float | None = None
    log: str = ""
    element: Annotated[int | str | None, BeforeValidator(_one_element)] = None
    sign_bit: int | None = quantity("", None, ge=1, le=52)
    wraps_at: float | None = quantity("", None, gt=0, le=2.0**53)
    unwrap: bool | None = None
    unit: str = ""
    radius: float | None = quantity("m", None, gt=0, le=100)
    sign: Annotated[Literal[1, -1], BeforeValidator(_no_bool)] = 1
    scale: float = 1.0
    offset: float = 0.0
    delay: float = quantity("s", 0.0, ge=0, le=1)
    longest_gap: int | None = quantity("rows", None, ge=0, le=1000)


class LogMap(Section):
    """A whole map."""

    log: Layout = Layout()
    clock: Clock
    clocks: dict[str, OtherClock] = {}
    channels: dict[str, Channel]


def read_map(path: Path) -> LogMap:
    """Return the map of a file; every fault is one line with its key, all raised together."""
    table, faults = load_toml(path), list[InputError]()
    with collected(faults):
        known_keys(table, file_keys(LogMap, "m"), path, "")
    open_keys = [*_open_keys({key: table[key] for key in table if key != "log"}, "")]
    if open_keys:
        problem = '"?" is a question of the proposed map: replace it by the answer'
        raise together([*faults, *(InputError(path, key, problem) for key in open_keys)])
    channels = table.get("channels")
    if not isinstance(channels, dict) or not channels:
        problem = "needs at least one, as [channels.column_force_N]"
        raise together([*faults, InputError(path, "channels", problem)])
    made = {}
    for name, given in channels.items():
        with collected(faults):
            made[name] = build(Channel, given, path, f"channels.{name}")
            _check_name(name, made[name], path)
    clocks, others = table.get("clocks", {}), {}
    if not isinstance(clocks, dict):
        problem = 'is a table for each further log, as [clocks."state.csv"]'
        faults.append(InputError(path, "clocks", problem))
        clocks = {}
    for name, given in clocks.items():
        with collected(faults):
            others[name] = build(OtherClock, given, path, f"clocks.{name}")
    known = {key: table[key] for key in ("log", "clock") if key in table}
    found: LogMap | None = None
    with collected(faults):
        found = build(LogMap, {**known, "channels": made, "clocks": others}, path, "")
    if found is not None:
        faults += _faults(found, path)
    if faults or found is None:
        raise together(faults)
    return found


def _open_keys(table: dict[str, Any], path: str) -> Iterator[str]:
    """Yield the keys that a proposed map has left to the user."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _open_keys(value, f"{path}{key}.")
        elif value == "?":
            yield path + key


def _check_name(name: str, channel: Channel, path: Path) -> None:
    key = f"channels.{name}"
    if name == TIME:
        raise InputError(path, key, "the time is given by [clock]")
    if channel.own:
        known = name in (*CHANNELS, LOADER_TIME, VALIDITY)
        mistyped = (name, name) if known else misnamed([name])
        if mistyped is not None:
            raise InputError(path, f"{key}.own", f"is not for {mistyped[1]}, a channel of records")
        if not _OWN_NAME.fullmatch(name):
            problem = "is no name: give letters, digits and underscores, as room_C"
            raise InputError(path, key, problem)
        if channel.unit or channel.radius is not None:
            problem = "is not for a channel of your own: convert it by scale and offset"
            raise InputError(path, f"{key}.{'unit' if channel.unit else 'radius_m'}", problem)
    elif name not in CHANNELS:
        problem = f"no record has such a channel; {nearest(name, CHANNELS)}"
        raise InputError(path, key, f"{problem}; own = true for one of your own")


def named_in(log_map: LogMap) -> list[str]:
    """Return the channels of a map in the order of a record, the user's own last."""
    own = [name for name, channel in log_map.channels.items() if channel.own]
    return [*(name for name in CHANNELS if name in log_map.channels), *own]


def _faults(found: LogMap, path: Path) -> list[InputError]:
    """Return the contradictions between a map's values."""
    faults: list[InputError] = []
    with collected(faults):
        _check_clock(found.clock, path)
    for name, clock in found.clocks.items():
        with collected(faults):
            _check_stamps(clock, path, f"clocks.{name}")
    if not found.log.delimiter.isascii() or found.log.delimiter in '"\r\n':
        problem = f'is {found.log.delimiter!r}; give one plain character, as ";" or "\\t"'
        faults.append(InputError(path, "log.delimiter", problem))
    for name, channel in found.channels.items():
        if channel.scale == 0.0:
            faults.append(InputError(path, f"channels.{name}.scale", "must not be 0"))
        if channel.sign_bit is not None and channel.wraps_at is not None:
            problem = "and wraps_at are two ways to keep a sign: give one"
            faults.append(InputError(path, f"channels.{name}.sign_bit", problem))
        if channel.unwrap is not None and channel.wraps_at is None:
            problem = "goes with wraps_at, as 360: give that too"
            faults.append(InputError(path, f"channels.{name}.unwrap", problem))
        with collected(faults):
            if channel.unit:
                factor_of(name, channel.unit, path, channel.radius)
        with collected(faults):
            _check_source(name, channel, path)
    if all(channel.value is not None for channel in found.channels.values()):
        problem = "are all constant: at least one needs from, the column that it is read from"
        faults.append(InputError(path, "channels", problem))
    return faults


def _check_source(name: str, channel: Channel, path: Path) -> None:
    """Refuse a channel that is neither read from a column nor a constant, or that is both."""
    key = f"channels.{name}"
    if channel.value is None:
        if not channel.source:
            problem = "is missing: the column of the log; or give value, where it is constant"
            raise InputError(path, f"{key}.from", problem)
        return
    if channel.source:
        problem = "and from exclude each other: a constant, or a column"
        raise InputError(path, f"{key}.value", problem)
    for other in ("log", "element", "sign_bit", "wraps_at", "unwrap", "delay", "longest_gap"):
        if getattr(channel, other):
            keys = {field: name for name, field in file_keys(Channel, "m").items()}
            raise InputError(path, f"{key}.{keys[other]}", "goes with from, not with value")


def _check_clock(clock: Clock, path: Path) -> None:
    if bool(clock.source) == (clock.rate is not None):
        problem = "give either from, the column with the time, or rate_Hz of a log without one"
        raise InputError(path, "clock", problem)
    if clock.rate is not None:
        for key in ("wraps_at", "sort", "drop_duplicates"):
            if getattr(clock, key):
                raise InputError(path, f"clock.{key}", "needs a column of times: give clock.from")
    _check_stamps(clock, path, "clock")
    if clock.end is not None and clock.end <= clock.start:
        raise InputError(path, "clock.end_s", f"must lie after start_s = {clock.start:g}")


def _check_stamps(clock: Stamped, path: Path, key: str) -> None:
    dropped_rows(clock, path, key)
    if clock.date and clock.wraps_at is not None:
        raise InputError(path, f"{key}.wraps_at", "is for a counter; dates do not wrap: leave out")
    unit = known_unit(clock.unit or "s", path, f"{key}.unit", like="s")
    if unit.dimension != _own("s").dimension:
        fit = ", ".join(units_like(_own("s")))
        raise InputError(path, f"{key}.unit", f"{clock.unit!r} is {unit.word}; give one of {fit}")
    if clock.date and clock.date != "iso" and "%" not in clock.date:
        problem = f'is {clock.date[:40]!r}; give "iso", or a pattern as "%d.%m.%Y %H:%M:%S.%f"'
        raise InputError(path, f"{key}.date", problem)
    directives = re.findall("%(.)", clock.date or "")
    if doubled := next((one for one in directives if directives.count(one) > 1 and one != "%"), ""):
        raise InputError(path, f"{key}.date", f"{clock.date[:40]!r} has %{doubled} twice")


def dropped_rows(clock: Stamped, path: Path, key: str) -> list[tuple[int, int]]:
    """Return the first and the last row of each entry of `drop_rows`, numbered as in faults."""
    found = []
    for entry in clock.drop_rows:
        match = re.fullmatch(r"\s*(\d{1,12})(?:\s*-\s*(\d{1,12}))?\s*", str(entry), re.ASCII)
        first, last = (int(match[1]), int(match[2] or match[1])) if match else (0, 0)
        if not 1 <= first <= last:
            problem = f'{str(entry)[:40]!r} is no row; give rows, as 962, or ranges, as "962-1000"'
            raise InputError(path, f"{key}.drop_rows", problem)
        found.append((first, last))
    return found


def own_unit(channel: str) -> str:
    """Return the unit at the end of a channel's name: `N/m`, `rad`; `1` if it has none."""
    if channel == LOAD_FACTOR:
        return "g"
    parts = channel.split("_")
    for unit in ("_".join(parts[-3:]), parts[-1]):
        text = unit.replace("_per_", "/")
        if parse_unit(text) is not None:
            return text
    return "1"


def _own(text: str) -> Unit:
    unit = parse_unit(text)
    assert unit is not None
    return unit


def known_unit(text: str, file: object, key: str, like: str = "") -> Unit:
    """Return the unit of a text; raises InputError with the nearest one, as of units `like` one."""
    unit = parse_unit(text)
    if unit is None:
        hint = nearest(text, units_like(_own(like)) if like else unit_names())
        raise InputError(file, key, f"{text[:40]!r} is no known unit; {hint}")
    return unit


def factor_of(channel: str, text: str, file: object, radius_m: float | None = None) -> float:
    """Return the factor from a unit to that of a channel of the record.

    A torque about an axis is a force at a radius, in m.
    """
    key = f"channels.{channel}.unit"
    given, own = known_unit(text, file, key), _own(own_unit(channel))
    if channel == LOAD_FACTOR and given.dimension == _own("1").dimension:
        return given.factor
    if given.dimension == _own("Nm").dimension and own.dimension == _own("N").dimension:
        if radius_m is None:
            problem = f"{text!r} is a torque: give radius_m, at which the force acts"
            raise InputError(file, key, problem)
        return given.factor / radius_m
    if radius_m is not None:
        problem = f"goes with a force that is logged as a torque, as Nm; {text!r} is {given.word}"
        raise InputError(file, f"channels.{channel}.radius_m", problem)
    if given.dimension != own.dimension:
        fit = ", ".join(units_like(own))
        raise InputError(file, key, f"{text!r} is {given.word}, {channel} {own.word}: {fit}")
    return given.factor / own.factor


def as_table(log_map: LogMap) -> dict[str, Any]:
    """Return the map with the keys of its file, for a manifest."""
    keys = {
        Layout: file_keys(Layout, "m"),
        Clock: file_keys(Clock, "m"),
        OtherClock: file_keys(OtherClock, "m"),
        Channel: file_keys(Channel, "m"),
    }

    def plain(section: Section) -> dict[str, Any]:
        return {key: getattr(section, field) for key, field in keys[type(section)].items()}

    channels = {name: plain(channel) for name, channel in log_map.channels.items()}
    clocks = {name: plain(clock) for name, clock in log_map.clocks.items()}
    table = {"log": plain(log_map.log), "clock": plain(log_map.clock), "channels": channels}
    return {**table, "clocks": clocks} if clocks else table
