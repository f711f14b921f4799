"""Records and their files: read, write, import."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike, fspath
from pathlib import Path

from coupled.arguments import public
from coupled.errors import InputError
from coupled.record import record as files
from coupled.record.importing import convert
from coupled.record.importing.account import ImportAccount
from coupled.record.record import DataFrame, Record, record_of
from coupled.rig.rig import Rig

Given = Record | DataFrame | str | PathLike[str]


@public
def read_record(path: str | PathLike[str]) -> Record:
    """Return the record of a CSV or Parquet file, with its manifest if there is one.

    Channels are in SI, with units in their names; `time_s` is required and must increase. Raises
    InputError with file, column and row for an invalid file.

    >>> import coupled, tempfile, pathlib
    >>> flight = coupled.fly("t37", column=coupled.Step(force_N=20, start_s=0), duration_s=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = pathlib.Path(folder) / "flight.parquet"
    ...     coupled.write_record(flight.record, path)
    ...     again = coupled.read_record(path)
    >>> bool((again.data == flight.record.data).all())
    True
    """
    return files.read_record(Path(path))


@public
def write_record(record: Record | DataFrame, path: str | PathLike[str]) -> None:
    """Write a record as CSV or Parquet, by the extension of the path, and its manifest.

    A DataFrame is converted to a record (`Record.from_frame`). Either both files are written or
    none. Raises InputError for another extension, and for a path that cannot be written.

    >>> import coupled, tempfile, pathlib
    >>> flight = coupled.fly("t37", column=coupled.Step(force_N=20), duration_s=1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     coupled.write_record(flight.record, pathlib.Path(folder) / "flight.csv")
    ...     sorted(path.name for path in pathlib.Path(folder).iterdir())
    ['flight.csv', 'flight.manifest.json']
    """
    whole = record if isinstance(record, Record) else Record.from_frame(record)
    files.write_record(whole, Path(path))


@public
def import_log(
    log: str | PathLike[str] | Sequence[str | PathLike[str]],
    log_map: str | PathLike[str] | None = None,
    rig: Rig | None = None,
) -> tuple[Record, ImportAccount]:
    r'''Return the record of a log of your own, and the account of how it was made.

    Several logs of one test, with stamps of one clock, are interpolated to the rows of the first.

    `log_map` is a TOML file that names the log's columns and their units; logs of JSBSim,
    FlightGear and X-Plane are recognised by their headers and need none. `rig` gives the record's
    frame rate. The account has `.clock`, `.channels`, `.unmapped` and `.warnings`. Raises
    InputError, naming file, column and row.

    >>> import coupled, tempfile, pathlib
    >>> columns = """
    ... [clock]
    ... from = "T"
    ... [channels.column_force_N]
    ... from = "F"
    ... unit = "lbf"
    ... """
    >>> rows = ["T,F", *(f"{k / 60:.6f},{0.1 * (k % 7)}" for k in range(120))]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     log, log_map = (pathlib.Path(folder) / name for name in ("log.csv", "map.toml"))
    ...     _ = log.write_text("\n".join(rows)), log_map.write_text(columns)
    ...     record, account = coupled.import_log(log, log_map)
    >>> record.channels
    ('time_s', 'column_force_N')
    '''
    logs = [log] if isinstance(log, (str, PathLike)) else log
    if not logs:
        raise InputError("import_log", "log", "is empty; give a log's path, or several")
    map_file = None if log_map is None else Path(log_map)
    return convert.import_log([Path(each) for each in logs], map_file, rig)


def named_records(records: Given | Sequence[Given] | Mapping[str, Given]) -> dict[str, Record]:
    """Return records by the name for error messages: the file, or a number."""
    if isinstance(records, (Record, DataFrame, str, PathLike)):
        records = [records]
    if not records:
        raise InputError("records", "", "needs at least one")
    if isinstance(records, Mapping):
        return {name: _record(given, name) for name, given in records.items()}
    named: dict[str, Record] = {}
    for i, given in enumerate(records, 1):
        numbered = "record" if len(records) == 1 else f"record {i}"
        name = fspath(given) if isinstance(given, (str, PathLike)) else numbered
        if name in named:
            raise InputError(name, "", "is given twice")
        named[name] = _record(given, name)
    return named


def _record(given: Given, name: str) -> Record:
    """Return a record from a `Record`, a DataFrame or a file, with the checks of a file."""
    if isinstance(given, Record):
        return record_of({each: given[each] for each in given.channels}, name, given.manifest)
    return Record.from_frame(given) if isinstance(given, DataFrame) else read_record(given)
