"""Files of the commands `diagnose` and `fit`, which compare records with a rig."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from coupled.errors import InputError
from coupled.files import check_target

if TYPE_CHECKING:
    from coupled.record.record import Record

RECORDS = "CSV or Parquet"  # what a record's file is, for help texts


def files_read(records: Sequence[Path], rig_file: Path | None) -> list[Path]:
    """Return the input files: records, their manifests, and the rig's if given."""
    from coupled.record.record import manifest_path

    own = [] if rig_file is None else [rig_file]
    return [*records, *map(manifest_path, records), *own]


def check_rig_target(
    path: Path | None, option: str, inputs: Sequence[Path], made: Path | None = None
) -> list[Path]:
    """Raise InputError if a rig file cannot be written; return its path if requested."""
    if path is None:
        return []
    if path.suffix != ".toml":
        raise InputError(path, option, "is a rig file: its name ends in .toml")
    check_target(path, inputs, made=made)
    return [path]


def read_each(files: Sequence[Path]) -> dict[str, Record]:
    """Return the records by file name; raise InputError for a record given twice."""
    from coupled.record.record import read_record

    read: dict[str, Record] = {}
    for file in files:
        if str(file) in read:
            raise InputError(file, "", "is a duplicate: give each record once")
        read[str(file)] = read_record(file)
    return read
