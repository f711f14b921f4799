"""A record: the time history of a flight or of a rig, its channels named with their units.

CSV by default, Parquet by extension. A manifest beside it, in JSON, has its origin: versions,
hashes of the inputs, the seed, and events.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from coupled.arguments import public
from coupled.errors import InputError, MissingKeyError, nearest, shown, shown_value
from coupled.files import MOST_TEXT_bytes, check_format, json_text, named, read_bytes, write_text
from coupled.outputs import Outputs
from coupled.record.channels import TIME, misnamed
from coupled.record.csvfile import read_columns, write_table
from coupled.results import TableResult

if TYPE_CHECKING:
    import polars as pl

    from coupled.plots.histories import Figure

Floats = NDArray[np.float64]
SUFFIXES = (".csv", ".parquet")
FORMAT = 1  # of a record and its manifest; earlier ones have none


@runtime_checkable
class DataFrame(Protocol):
    """A DataFrame of polars or pandas: named columns."""

    @property
    def columns(self) -> Any:
        """The columns' names."""

    def to_dict(self, *how: Any, **more: Any) -> Any:
        """Return the columns by name."""


@dataclass(frozen=True)
class EndedEarly:
    """Why, and after how long, a flight ended before its time."""

    reason: str
    time_s: float

    def __str__(self) -> str:
        return f"{self.reason} at {self.time_s:.2f} s"


@public
@dataclass(frozen=True)
class Record(TableResult):
    """Channels over time: `data` has shape (rows, channels), SI, one row a frame.

    `record["column_force_N"]` is a channel, shape (rows,); an unknown name raises an InputError,
    which is also a KeyError, with the nearest name. Each channel's unit ends its name; a pull,
    right wheel and right pedal are positive. `manifest` is the origin of the record.
    >>> import coupled
    >>> record = coupled.fly("t37", column=coupled.Step(force_N=20), duration_s=2).record
    >>> record
    Record(240 rows, 2 s at 120 Hz; 46 channels: time_s, column_force_N, column_computed_m, …)
    >>> len(record.between(0.5, 1.0)), record["pitch_rad"].shape
    (60, (240,))
    >>> record.to_polars().columns[:2]
    ['time_s', 'column_force_N']
    >>> figure = record.plot("column_force_N", "pitch_rad")
    """

    channels: tuple[str, ...]
    data: Floats
    manifest: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        name = "coupled.Record"
        if len(set(self.channels)) < len(self.channels):
            raise InputError(name, "channels", "names a channel twice")
        if self.data.ndim != 2 or self.data.shape[1] != len(self.channels):
            shape = f"(rows, {len(self.channels)})"
            problem = f"has the shape {self.data.shape}; give {shape}, a column a channel"
            raise InputError(name, "data", problem)
        if self.data.dtype.kind not in "fiu":
            raise InputError(name, "data", f"holds {self.data.dtype}; give numbers")

    @classmethod
    def from_frame(cls, frame: DataFrame) -> Record:
        """Return the record of a DataFrame of polars or pandas, a column for each channel, SI.

        `time_s` is a column or the index, and must rise; a null is NaN. Raises InputError with the
        column.

        >>> import coupled, polars
        >>> frame = polars.DataFrame({"time_s": [0.0, 0.01], "column_force_N": [0.0, 1.5]})
        >>> coupled.Record.from_frame(frame)
        Record(2 rows, 0.02 s at 100 Hz; 2 channels: time_s, column_force_N)
        """
        return record_of(columns_of(frame), "DataFrame")

    def __getitem__(self, channel: str) -> Floats:
        if not isinstance(channel, str):
            problem = f"is {shown_value(channel)}; give the name of a channel"
            raise MissingKeyError("record", "channel", problem)
        if channel not in self.channels:
            problem = f"no channel {shown(channel)}; {nearest(channel, self.channels)}"
            raise MissingKeyError("record", "", problem)
        return self.data[:, self.channels.index(channel)]

    def __contains__(self, channel: object) -> bool:
        return channel in self.channels

    def __len__(self) -> int:
        return len(self.data)

    @property
    def time_s(self) -> Floats:
        """Time of each row."""
        return self[TIME]

    def __repr__(self) -> str:
        rows, names = len(self), ", ".join(self.channels[:3])
        names += ", …" if len(self.channels) > 3 else ""
        what = f"{len(self.channels)} channels: {names}"
        if rows < 2 or TIME not in self:
            return f"Record({rows} rows; {what})"
        step_s = float(np.median(np.diff(self.time_s)))
        if not step_s > 0.0:
            return f"Record({rows} rows, whose time does not rise; {what})"
        return f"Record({rows} rows, {rows * step_s:g} s at {1.0 / step_s:g} Hz; {what})"

    @property
    def ended_early(self) -> EndedEarly | None:
        """Why and when the flight ended early, by the manifest; None if it did not."""
        ended = self.manifest.get("ended_early")
        if not isinstance(ended, Mapping):
            return None
        reason, time_s = ended.get("reason"), ended.get("time_s")
        if not isinstance(reason, str) or not isinstance(time_s, (int, float)):
            return None
        return EndedEarly(reason, float(time_s))

    def between(self, start_s: float, end_s: float) -> Record:
        """Return the rows with start ≤ t < end."""
        rows = (self.time_s >= start_s) & (self.time_s < end_s)
        return Record(self.channels, self.data[rows], self.manifest)

    def rows(self, first: int, last: int) -> Record:
        """Return the rows from `first`, counted from 0, to before `last`."""
        return Record(self.channels, self.data[first:last], self.manifest)

    def to_polars(self) -> pl.DataFrame:
        """Return the rows as a polars DataFrame, a column for each channel, SI."""
        import polars as pl

        return pl.DataFrame(self.data, schema=list(self.channels), orient="row")

    def plot(self, *channels: str, title: str = "") -> Figure:
        """Return a matplotlib Figure of the channels over time, one below the other.

        By default: each control's force and deflection, its surface, and the motion, in usual
        units. A notebook shows the returned figure; `.savefig(path)` writes it. Raises InputError
        for an unknown channel, and without rows.
        """
        from coupled.plots.histories import draw_channels, draw_record

        if not len(self):
            raise InputError("record", "", "holds no rows to draw")
        return draw_channels(self, channels, title) if channels else draw_record(self, title)


def manifest_path(path: Path) -> Path:
    """Return the path of a record's manifest."""
    return named(path).with_suffix(".manifest.json")


def check_suffix(path: Path) -> None:
    """Refuse a record's path with an extension of another format."""
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(path, "", f"a record ends in {' or '.join(SUFFIXES)}")


def write_record(record: Record, path: Path) -> None:
    """Write a record, and its manifest beside it: both, or neither.

    Raises InputError for a record that could not be read again, or a manifest that is no JSON.
    """
    check_suffix(path)
    record_of({name: record[name] for name in record.channels}, path)
    frame = record.to_polars()
    manifest = {**record.manifest, "format": FORMAT}
    for key, value in manifest.items():
        try:
            json_text(value)
        except (TypeError, ValueError):
            problem = f"is {shown_value(value)}; give text, numbers, lists and tables of them"
            raise InputError(path, f"manifest.{key}", problem) from None
    with Outputs() as outputs:
        write_table(frame, outputs.at(path))
        write_text(outputs.at(manifest_path(path)), json_text(manifest, sort_keys=True))


def read_record(path: Path) -> Record:
    """Return the record of a file, with its manifest if there is one."""
    check_suffix(path)
    manifest = _read_manifest(manifest_path(path))
    live = manifest.get("live")
    unfinished = isinstance(live, dict) and live.get("unfinished") is True
    columns = read_columns(path, gaps=True, torn=unfinished)
    return record_of(columns, path, manifest)


def record_of(
    columns: Mapping[str, Floats], file: object, manifest: Mapping[str, Any] | None = None
) -> Record:
    """Return the record of columns by name; `file` is named in faults. Raises InputError."""
    if TIME not in columns:
        raise InputError(file, TIME, f"is missing; a record has it ({nearest(TIME, columns)})")
    wrong = misnamed(list(columns))
    if wrong is not None:
        name, meant = wrong
        problem = f"is no channel of a record; rename it to {meant}, in its unit, or leave it out"
        raise InputError(file, name, problem)
    if len(columns) < 2 or len(columns[TIME]) < 2:
        raise InputError(file, "", "holds no channel over time")
    if not np.all(np.diff(columns[TIME]) > 0.0):
        raise InputError(file, TIME, "must rise from row to row, without a gap")
    return Record(tuple(columns), np.column_stack(list(columns.values())), manifest or {})


def columns_of(frame: DataFrame) -> dict[str, Floats]:
    """Return the columns of a DataFrame of polars or pandas as numbers. Raises InputError."""
    table: Any = frame
    index = getattr(getattr(table, "index", None), "name", None)
    if index is not None and index not in table.columns:
        table = table.reset_index()
    columns: dict[str, Floats] = {}
    for name in table.columns:
        if not isinstance(name, str):
            raise InputError("DataFrame", "columns", f"has {name!r:.60}; give channels' names")
        if name in columns:
            raise InputError("DataFrame", name, "is there twice")
        values = np.asarray(table[name].to_numpy())
        if values.dtype.kind == "O":  # numbers with gaps
            values = _with_gaps(values, name)
        if values.dtype.kind not in "fiu":
            raise InputError("DataFrame", name, f"holds {values.dtype}; give numbers")
        columns[name] = values.astype(float)
    return columns


def _with_gaps(values: NDArray[Any], name: str) -> Floats:
    """Return the numbers of a column of objects, NaN for None."""
    for row, value in enumerate(values.tolist()):
        if value is not None and (isinstance(value, bool) or not isinstance(value, (int, float))):
            raise InputError("DataFrame", f"row {row}: {name}", f"{value!r:.40} is no number")
    return values.astype(float)


def _read_manifest(path: Path) -> dict[str, Any]:
    """Return a record's manifest; empty if there is none, or one of another program."""
    try:
        path.lstat()
    except OSError:
        return {}
    content = read_bytes(path, MOST_TEXT_bytes)
    try:
        manifest = json.loads(content)
    except (ValueError, RecursionError):
        return {}
    if not isinstance(manifest, dict):
        return {}
    check_format(manifest.get("format"), FORMAT, path, "record")
    return manifest
