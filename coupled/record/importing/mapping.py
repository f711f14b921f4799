"""The map of a log: which of its columns is which channel, in what unit, sign and time.

A channel of the record is sign · unit · (scale · raw + offset), with `offset` in the log's
unit; what a sensor reads `delay_s` late is moved forward by that.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator
from pydantic_core import PydanticCustomError

from coupled.errors import InputError, nearest
from coupled.record.channels import CONTROL_NAMES, LATERAL, LONGITUDINAL, TIME, control_channels
from coupled.schema import Section, build, file_keys, known_keys, load_toml, named, quantity
from coupled.units import Unit, parse_unit, unit_names, units_like

CHANNELS: tuple[str, ...] = (
    *(name for control in CONTROL_NAMES for name in control_channels(control)),
    *LONGITUDINAL,
    *LATERAL,
)
LOAD_FACTOR = "load_factor"


class Layout(Section):
    """How the log's file is laid out; `format` is by the file's extension where not given."""

    format: Literal["csv", "parquet", "mat"] | None = None
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


class Clock(Section):
    """Where a row's time comes from, the record's frame rate, and the cut."""

    source: str = named("from", "")
    unit: str = "s"
    rate: float | None = quantity("Hz", None, gt=0, le=1e6)
    frame_rate: float | None = quantity("Hz", None, ge=1, le=2000)
    start: float = quantity("s", 0.0, ge=0)
    end: float | None = quantity("s", None, gt=0)
    longest_gap: int = quantity("rows", 2, ge=0, le=1000)


def _no_bool(value: object) -> object:
    if isinstance(value, bool):  # which Python takes for 1
        raise PydanticCustomError("sign", "should be 1 or -1")
    return value


class Channel(Section):
    """One channel of the record, from one column of the log."""

    source: str = named("from", min_length=1)
    unit: str = ""
    sign: Annotated[Literal[1, -1], BeforeValidator(_no_bool)] = 1
    scale: float = 1.0
    offset: float = 0.0
    delay: float = quantity("s", 0.0, ge=0, le=1)
    longest_gap: int | None = quantity("rows", None, ge=0, le=1000)


class LogMap(Section):
    """A whole map."""

    log: Layout = Layout()
    clock: Clock
    channels: dict[str, Channel]


def read_map(path: Path) -> LogMap:
    """Return the map of a file; every fault is one line with its key."""
    table = load_toml(path)
    known_keys(table, file_keys(LogMap, "m"), path, "")
    channels = table.get("channels")
    if not isinstance(channels, dict) or not channels:
        raise InputError(path, "channels", "needs at least one, as [channels.column_force_N]")
    for name in channels:
        if name == TIME:
            raise InputError(path, f"channels.{name}", "the time is given by [clock]")
        if name not in CHANNELS:
            hint = nearest(name, CHANNELS)
            raise InputError(path, f"channels.{name}", f"no record has such a channel; {hint}")
    made = {name: build(Channel, channels[name], path, f"channels.{name}") for name in channels}
    found = build(LogMap, {**table, "channels": made}, path, "")
    _check_clock(found.clock, path)
    if not found.log.delimiter.isascii() or found.log.delimiter in '"\r\n':
        problem = f'is {found.log.delimiter!r}; give one plain character, as ";" or "\\t"'
        raise InputError(path, "log.delimiter", problem)
    if found.log.decimal == "," and found.log.delimiter == ",":
        problem = 'is the decimal comma as well; give the delimiter, as ";"'
        raise InputError(path, "log.delimiter", problem)
    for name, channel in found.channels.items():
        if channel.scale == 0.0:
            raise InputError(path, f"channels.{name}.scale", "must not be 0")
        if channel.unit:
            factor_of(name, channel.unit, path)
    return found


def _check_clock(clock: Clock, path: Path) -> None:
    if bool(clock.source) == (clock.rate is not None):
        problem = "give either from, the column with the time, or rate_Hz of a log without one"
        raise InputError(path, "clock", problem)
    unit = known_unit(clock.unit, path, "clock.unit")
    if unit.dimension != _own("s").dimension:
        fit = ", ".join(units_like(_own("s")))
        raise InputError(path, "clock.unit", f"{clock.unit!r} is {unit.word}; give one of {fit}")
    if clock.end is not None and clock.end <= clock.start:
        raise InputError(path, "clock.end_s", f"must lie after start_s = {clock.start:g}")


def own_unit(channel: str) -> str:
    """Return the unit that a channel of a record ends in: `N/m`, `rad`; `1` where it has none."""
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


def known_unit(text: str, file: object, key: str) -> Unit:
    """Return the unit of a text, or refuse it with the nearest known one."""
    unit = parse_unit(text)
    if unit is None:
        hint = nearest(text, unit_names())
        raise InputError(file, key, f"{text[:40]!r} is no known unit; {hint}")
    return unit


def factor_of(channel: str, text: str, file: object) -> float:
    """Return what a number in a unit is to be multiplied by for a channel of the record."""
    key = f"channels.{channel}.unit"
    given, own = known_unit(text, file, key), _own(own_unit(channel))
    if channel == LOAD_FACTOR and given.dimension == _own("1").dimension:
        return given.factor
    if given.dimension != own.dimension:
        fit = ", ".join(units_like(own))
        raise InputError(file, key, f"{text!r} is {given.word}, {channel} {own.word}: {fit}")
    return given.factor / own.factor


def as_table(log_map: LogMap) -> dict[str, Any]:
    """Return the map with the keys of its file, for a manifest."""
    keys = {
        Layout: file_keys(Layout, "m"),
        Clock: file_keys(Clock, "m"),
        Channel: file_keys(Channel, "m"),
    }

    def plain(section: Section) -> dict[str, Any]:
        return {key: getattr(section, field) for key, field in keys[type(section)].items()}

    channels = {name: plain(channel) for name, channel in log_map.channels.items()}
    return {"log": plain(log_map.log), "clock": plain(log_map.clock), "channels": channels}
