"""A proposed map of a log: certain keys are filled in, the others are questions.

A question is the value `"?"`, which no map may have, with candidates in a comment. The map is
refused until the user has answered all. Signs of loads and scales of counts are always questions.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.errors import InputError, shown
from coupled.record.channels import CONTROL_NAMES
from coupled.record.channels import channel as channel_name
from coupled.record.importing.formats.columns import TEXT
from coupled.record.importing.mapping import CHANNELS, Layout, own_unit
from coupled.record.importing.plausible import move_oppositely
from coupled.record.importing.reading import Log, read_log
from coupled.record.importing.rows import COARSE
from coupled.record.importing.suggest import sizes
from coupled.record.importing.suggest.columns import Column, columns_of, missing_in
from coupled.record.importing.suggest.dialect import guess_layout, is_number
from coupled.record.importing.suggest.ends import settle_ends
from coupled.record.importing.suggest.names import is_torque, words_of
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.rig.rigwrite import toml_string
from coupled.schema import file_keys
from coupled.units import Unit, parse_unit, units_like

Floats = NDArray[np.float64]
Line = tuple[str, object, str]  # a key, its value, and a remark
LISTED = 8  # columns that a question lists
RECEIVED = ".log_time"  # stamps of an MCAP's recorder
RECORDED = (RECEIVED, ".publish_time")
FEWEST = 3  # values of a quantity; a switch has two, a constant one


@dataclass(frozen=True)
class Proposal:
    """A map as text, its open questions, and the columns that it leaves out.

    `warnings` are those of the logs' readers, and the reasons why columns are not read.
    """

    text: str
    questions: tuple[str, ...]
    mapped: Mapping[str, str]  # channel: column
    unmapped: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {
            "channels": dict(self.mapped),
            "questions": list(self.questions),
            "unmapped": list(self.unmapped),
            "warnings": list(self.warnings),
        }


def propose(files: Sequence[Path], rig: Rig | None = None) -> Proposal:
    """Return a map for a log, or for several of one test; the first one makes the frames.

    A `rig`'s travels reduce the possible units. If no name identifies a column, the map has
    questions on force and deflection. Raises InputError for a file that is not a log.
    """
    layout = guess_layout(files[0])
    read, columns = _read(files, layout)
    far = sorted({text for log in read for text in missing_in(log, columns)})
    if far:
        layout = layout.model_copy(update={"missing": [*layout.missing, *far]})
        read, columns = _read(files, layout)
    logs = [file.name for file in files]
    chosen = _chosen([c for c in columns if c.reading.channel != "time"])
    chosen, asked = settle_ends(chosen)
    clock, clocks = _clocks(_stamps_first(columns, read, chosen), columns, logs)
    sections = [("log", _layout_lines(layout, far)), ("clock", clock)]
    sections += [(f"clocks.{toml_string(name)}", lines) for name, lines in clocks.items()]
    for channel in CHANNELS:
        if channel in chosen:
            control = _control(channel, rig)
            lines = _channel_lines(channel, chosen[channel], control, logs[0], asked)
            sections.append((f"channels.{channel}", lines))
    sections = _signs(sections, chosen)
    mapped = {channel: _named(chosen[channel], logs) for channel in CHANNELS if channel in chosen}
    used = {(c.log, c.name) for c in chosen.values()}
    used |= {(log, str(name)) for log in logs for _, name, _ in clocks.get(log, clock)[:1]}
    left = [c for c in columns if (c.log, c.name) not in used]
    unmapped = tuple(_named(column, logs) for column in left)
    if not mapped:
        sections += _skeleton([column for column in left if column.moves], rig, logs)
    questions = tuple(
        f"{section}.{key}: {remark}"
        for section, lines in sections
        for key, value, remark in lines
        if value == "?"
    )
    warnings = [note for log in read for note in log.notes]
    refused = [each for log in read for each in log.refused.items()]
    warnings += [f"{name}: {why}" for name, why in refused if why != TEXT]
    warnings += _texts(read, left, chosen, logs)
    arms = {_named(column, logs) for column in left if _is_torque(column)}
    text = _text(sections, logs, unmapped, arms)
    return Proposal(text, questions, mapped, unmapped, tuple(dict.fromkeys(warnings)))


def _texts(
    logs: Sequence[Log], left: Sequence[Column], chosen: Mapping[str, Column], names: Sequence[str]
) -> Iterator[str]:
    """Yield why columns with a channel's name are left out whose cells are text."""
    read = {log.file.name: log for log in logs}
    for column in left:
        cells = read[column.log].columns[column.name]
        open_channel = column.reading.channel not in ("", "time", *chosen)
        if column.kind == "text" and open_channel and cells.dtype == pl.String:
            cell = next((str(each) for each in cells if each and not is_number(str(each))), "")
            yield f"{_named(column, names)}: holds {shown(cell, 40)!r}, no number, and is left out"


def _read(files: Sequence[Path], layout: Layout) -> tuple[list[Log], list[Column]]:
    read = [read_log(file, layout) for file in files]
    return read, [column for log in read for column in columns_of(log)]


def _skeleton(
    columns: Sequence[Column], rig: Rig | None, logs: Sequence[str]
) -> list[tuple[str, list[Line]]]:
    """Return the sections of a map with a question for each channel, if no name identifies one.

    Force and deflection are what the least diagnosis needs.
    """
    if not columns:
        raise InputError(logs[0], "", "none of its columns holds numbers that change")
    control = next(iter(rig.controls if rig is not None else ()), CONTROL_NAMES[0])
    listed = ", ".join(_with_range(column, logs) for column in columns[:LISTED])
    more = len(columns) - LISTED
    listed += f" and {more} more" if more > 0 else ""
    found = []
    for quantity, what in (("force", "force"), ("computed", "place")):
        name = channel_name(control, quantity)
        known = " or ".join(units_like(_own(name))[:4])
        lines: list[Line] = [("from", "?", f"which column is the {what}? {listed}")]
        found.append((f"channels.{name}", [*lines, ("unit", "?", known)]))
    return found


def _with_range(column: Column, logs: Sequence[str]) -> str:
    """Return a column's name, and between which numbers it moves."""
    ends = f"{np.nanmin(column.values):.3g} to {np.nanmax(column.values):.3g}"
    return f"{json.dumps(_named(column, logs), ensure_ascii=False)} ({ends})"


def _stamps_first(
    columns: Sequence[Column], logs: Sequence[Log], chosen: Mapping[str, Column]
) -> list[Column]:
    """Return the clocks, first those with the stamps of the chosen columns' groups.

    Fine stamps come before coarse ones, stamps in order before those that go back, and stamps of
    the senders before those of the recorder, which are late by the transport.
    """
    stamps = {log.file.name: log.stamps for log in logs}
    sent = _sent(columns, logs, chosen)
    order = [stamps[c.log].get(c.name) for name in CHANNELS if (c := chosen.get(name))]
    order = [sent.get(name or "", name) for name in order]
    place = {name: i for i, name in reversed(list(enumerate(order)))}

    def rank(column: Column) -> tuple[int, bool, bool]:
        steps = np.diff(column.values)
        coarse = not column.moves or float(np.mean(steps == 0.0)) > COARSE
        return place.get(column.name, len(order)), coarse, bool((steps < 0.0).any())

    return sorted((column for column in columns if column.is_clock), key=rank)


def _sent(
    columns: Sequence[Column], logs: Sequence[Log], chosen: Mapping[str, Column]
) -> dict[str, str]:
    """Return the senders' stamps by the recorder's, if all topics of the channels have them."""
    clocks = {(c.log, c.name) for c in columns if c.is_clock}
    found: dict[str, str] = {}
    for log in logs:
        used = {log.stamps.get(c.name, "") for c in chosen.values() if c.log == log.file.name}
        topics = [name.removesuffix(RECEIVED) for name in used if name.endswith(RECEIVED)]
        fields = [
            {
                name.removeprefix(topic)
                for name, group in log.groups.items()
                if group == topic and log.units.get(name) == "ns"
                if (log.file.name, name) in clocks and not name.endswith(RECORDED)
            }
            for topic in topics
        ]
        common = sorted(set.intersection(*fields), key=len) if fields else []
        if common and len(topics) == len(used):
            found |= {topic + RECEIVED: topic + common[0] for topic in topics}
    return found


def _named(column: Column, logs: Sequence[str]) -> str:
    return column.name if len(logs) == 1 else f"{column.log}: {column.name}"


def _layout_lines(layout: Layout, far: Sequence[str]) -> list[Line]:
    plain = Layout()
    remarks = {"missing": f"{' and '.join(far)}: far outside the other numbers" if far else ""}
    return [
        (key, getattr(layout, field), remarks.get(key, ""))
        for key, field in file_keys(Layout, "m").items()
        if getattr(layout, field) != getattr(plain, field)
    ]


def _clocks(
    stamps: Sequence[Column], columns: Sequence[Column], logs: Sequence[str]
) -> tuple[list[Line], dict[str, list[Line]]]:
    """Return the lines of `[clock]`, and those of logs with other stamps."""
    found = {}
    for name in logs:
        column = next((each for each in stamps if each.log == name), None)
        open_ones = [c for c in columns if c.log == name and not c.reading.channel]
        rising = [each for each in open_ones if each.rises]
        found[name] = (
            _no_clock(rising, len(logs) > 1)
            if column is None
            else _clock(column, main=name == logs[0])
        )
    first = found[logs[0]]
    plain = [line for line in first if line[0] != "frame_rate_Hz"]
    return first, {name: found[name] for name in logs[1:] if not _alike(found[name], plain)}


def _alike(lines: Sequence[Line], others: Sequence[Line]) -> bool:
    return [line[:2] for line in lines] == [line[:2] for line in others]


def _no_clock(rising: Sequence[Column], several: bool) -> list[Line]:
    """Return the questions on the time, if no name or cell shows it; `rising` may be it."""
    if len(rising) == 1:
        named = json.dumps(rising[0].name, ensure_ascii=False)
        remark = f"{named} rises evenly: is it the time?"
        remark += "" if several else " If not, rate_Hz instead: how many rows come in a second?"
        return [("from", "?", remark), _unit(rising[0])]
    if several:
        return [("from", "?", "the column with the time: several logs need their stamps")]
    return [("rate_Hz", "?", "no column is named as the time: how many rows come in a second?")]


def _unit(clock: Column) -> Line:
    """Return the line of a clock's unit, by the size of its steps."""
    fit = sizes.time_units(clock.values)
    step = float(np.median(sizes.forward_steps(clock.values)))
    return ("unit", *_one_of(fit, f"steps of {step:.6g}"))


def _clock(column: Column, main: bool) -> list[Line]:
    lines: list[Line] = [("from", column.name, "")]
    fit = [column.reading.unit or "s"]
    if column.date:
        remark = 'in which pattern? as "%d.%m.%Y %H:%M:%S.%f"' if column.date == "?" else ""
        lines.append(("date", column.date, remark))
        fit = [] if remark else fit
    elif column.kind != "dates" and column.unscaled:
        remark = f"the file gives {column.unscaled}: the unit of its numbers as they are?"
        lines.append(("unit", "?", remark))
        fit = []
    elif column.kind != "dates" and column.doubt and column.reading.unit:
        lines.append(("unit", "?", column.doubt))
        fit = []
    elif column.kind != "dates" and column.reading.unit:
        lines.append(("unit", column.reading.unit, "by its name"))
    elif column.kind != "dates":
        fit = sizes.time_units(column.values)
        lines.append(_unit(column))
    if column.untimed:
        lines.append(("drop_rows", list(column.untimed), "without a time: a header, a summary?"))
    return lines + (_rate(column.values, fit[0]) if len(fit) == 1 and main else [])


def _rate(values: Floats, unit: str) -> list[Line]:
    """Return the line of the frame rate, if the rows are uneven."""
    known = parse_unit(unit)
    time_s = values * known.factor if known is not None else values
    rate = sizes.even_rate(time_s)
    if rate is None:
        return []
    steps_ms = 1e3 * sizes.forward_steps(time_s)
    apart = f"the rows come unevenly, {steps_ms.min():.4g} to {steps_ms.max():.4g} ms apart"
    return [("frame_rate_Hz", rate, apart)]


def _chosen(columns: Sequence[Column]) -> dict[str, Column]:
    """Return the column of each channel; of several, the first with a certain name, or the first.

    A switch, a constant and a commanded force come last. A position of either end is the computed
    one if the grip has its own. Two transducers of one control may each be at either end.
    """
    chosen: dict[str, Column] = {}
    for column in sorted(_with_open_ends(columns), key=_rank):
        channel, unit = column.reading.channel, column.reading.unit
        if not channel or column.kind in ("text", "dates") or not _fits(unit, channel):
            continue
        if channel in chosen and column.reading.either_end:
            channel = channel.replace("_deflection_", "_computed_")
        chosen.setdefault(channel, column)
    return chosen


def _with_open_ends(columns: Sequence[Column]) -> list[Column]:
    """Return the columns, at an open end where two have only a transducer's name for the same."""
    devices = [c.reading.channel for c in columns if c.reading.by_device and c.kind == "numbers"]
    found = []
    for column in columns:
        read = column.reading
        if read.by_device and devices.count(read.channel) > 1:
            end = read.channel.replace("_computed_", "_deflection_")
            read = replace(read, channel=end, either_end=True, sure=False)
        found.append(replace(column, reading=read))
    return found


def _rank(column: Column) -> tuple[bool, bool, bool, bool]:
    read, there = column.reading, column.values[np.isfinite(column.values)]
    return read.either_end, np.unique(there).size < FEWEST, read.commanded, not read.sure


def _fits(unit: str, channel: str) -> bool:
    if not unit:
        return True
    given, own = parse_unit(unit), parse_unit(own_unit(channel))
    return given is not None and own is not None and given.dimension == own.dimension


def _control(channel: str, rig: Rig | None) -> Control | None:
    name = channel.partition("_")[0]
    return rig.controls.get(name) if rig is not None and name in CONTROL_NAMES else None


def _channel_lines(
    channel: str, column: Column, control: Control | None, main: str, asked: Mapping[str, str]
) -> list[Line]:
    remark = "" if column.reading.sure else "is it this? its name is ambiguous"
    lines: list[Line] = [("from", column.name, remark)]
    if channel in asked:
        lines = [("from", "?", asked[channel])]
    if column.log != main:
        lines.append(("log", column.log, ""))
    if column.kind == "lists":
        lines.append(("element", "?", f"which of the {column.length} in each cell, from 1"))
    sign = sizes.kept_sign(column.values)
    magnitude = sign == "" and column.moves and np.nanmin(column.values) >= 0.0
    if sign:
        key, _, value = sign.partition(" = ")
        lines.append((key, "?", f"never negative, and its counts fit {value}: is it so?"))
    elif magnitude and "force" in channel:
        lines.append(("sign", "?", "never negative: 1 or -1, if the hand only pulled; a size"))
    unit = column.reading.unit
    if column.unscaled:
        remark = (
            f"the file gives {column.unscaled}: give it, with an offset, of raw numbers; else 1"
        )
        lines.append(("scale", "?", remark))
    if column.doubt:
        known = " or ".join(units_like(_own(channel))[:4])
        lines.append(("unit", "?", f"{column.doubt}: {known}? else give scale and offset too"))
    elif unit:
        lines.append(("unit", unit, ""))
    elif sizes.are_counts(column.values):
        known = " or ".join(units_like(_own(channel))[:4])
        lines.append(("unit", "?", f"whole counts: give {known}, with scale and offset"))
    else:
        peak = float(np.nanmax(np.abs(column.values), initial=0.0))
        fit = sizes.units_that_fit(channel, column.values, control)
        lines.append(("unit", *_one_of(fit, f"reaches {peak:.4g}")))
    return lines


def _own(channel: str) -> Unit:
    return _unit_of(own_unit(channel))


def _unit_of(text: str) -> Unit:
    unit = parse_unit(text)
    assert unit is not None
    return unit


def _one_of(fit: Sequence[str], size: str) -> tuple[str, str]:
    """Return the only unit that fits, or a question."""
    if len(fit) == 1:
        return fit[0], f"by its size: {size}"
    return "?", f"{size}: {' or '.join(fit)}" if fit else f"{size}: which unit?"


def _signs(
    sections: list[tuple[str, list[Line]]], chosen: Mapping[str, Column]
) -> list[tuple[str, list[Line]]]:
    """Return the sections, with a question if force and deflection have opposite signs."""
    for control in CONTROL_NAMES:
        own = {c: col for c, col in chosen.items() if c.startswith(control) and not col.length}
        force = own.get(f"{control}_force_N")
        moved = next((own[c] for c in own if "computed" in c or "deflection" in c), None)
        if force is None or moved is None or force.log != moved.log:
            continue
        if force.values.size != moved.values.size:  # sampled apart
            continue
        if sizes.kept_sign(force.values) or sizes.kept_sign(moved.values):
            continue  # raw counts do not show a direction
        there = np.isfinite(force.values) & np.isfinite(moved.values)
        if there.any() and move_oppositely(force.values[there], moved.values[there]):
            remark = f"moves against {moved.name}: -1 here, or there? a pull is positive in both"
            for name, lines in sections:
                asked = any(key == "sign" for key, _, _ in lines)
                if name == f"channels.{control}_force_N" and not asked:
                    lines.append(("sign", "?", remark))
    return sections


def _text(
    sections: Sequence[tuple[str, list[Line]]],
    logs: Sequence[str],
    unmapped: Sequence[str],
    torques: Collection[str],
) -> str:
    rows = [
        f"# A map for {', '.join(logs)}, proposed from names, units and sizes. Read it through:",
        '# a "?" asks what the log does not say, and the map is refused until each is answered.',
    ]
    for name, lines in sections:
        if not lines:
            continue
        rows += ["", f"[{name}]"]
        for key, value, remark in lines:
            text = json.dumps(value, ensure_ascii=False)
            rows.append(f"{key} = {text}" + (f"  # {remark}" if remark else ""))
    if unmapped:
        rows += ["", "# Not used:", *(_left(name, name in torques) for name in unmapped)]
    return "\n".join(rows) + "\n"


def _is_torque(column: Column) -> bool:
    unit = parse_unit(column.reading.unit)
    own = unit is not None and unit.dimension == _unit_of("Nm").dimension
    return own or is_torque(words_of(column.name))


def _left(name: str, torque: bool) -> str:
    arm = "  (a torque: with its unit and radius_m, it is a force)" if torque else ""
    return f"# {json.dumps(name, ensure_ascii=False)[1:-1]}{arm}"
