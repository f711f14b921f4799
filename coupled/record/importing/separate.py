"""Logs that are not text, read in a process of their own.

Their readers are compiled code. A damaged file can crash it beyond any `except`, or make it run for
ever or exhaust the memory. Then only that process ends, and the command reports a damaged file in
one line.
"""

from __future__ import annotations

import importlib
import importlib.util
import io
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import polars as pl

from coupled.errors import InputError, shown
from coupled.parallel import limit_memory
from coupled.record.importing.formats.columns import Found, pack, unpack
from coupled.record.importing.formats.warned import kept_warnings
from coupled.record.importing.mapping import Layout

REFUSED = 3  # exit code of a process that reports the fault itself
LONGEST_s = 20.0  # time limit of a reader, plus
LONGEST_s_per_MiB = 10.0
MOST_NOTES = 8  # warnings of a reader that are shown
_HDF5 = b"\x89HDF\r\n\x1a\n"
_WORDS = {
    **{
        "parquet": "a Parquet",
        "mat": "a MATLAB",
        "hdf5": "an HDF5 or MATLAB v7.3",
        "mdf": "an MDF",
    },
    **{"tdms": "a TDMS", "mcap": "an MCAP", "ulog": "a ULog"},
}
# The reader of a format, and the packages of the extra `logs` that it imports.
_READERS: dict[str, tuple[str, tuple[str, ...]]] = {
    "mat": ("read_matlab", ()),
    "hdf5": ("read_hdf5", ("h5py",)),
    "mdf": ("read_mdf", ("asammdf",)),
    "tdms": ("read_tdms", ("nptdms",)),
    "mcap": ("read_mcap", ("mcap", "mcap_ros2", "mcap_protobuf")),
    "ulog": ("read_ulog", ("pyulog",)),
}


@dataclass(frozen=True)
class Task:
    """The task of a separate process: a `kind` of file, and which matrix to read.

    `missing` are the words that mean an empty cell.
    """

    kind: str
    file: str
    matrix: str
    names: list[str] | str
    missing: list[str]


def read_separately(
    path: Path, content: bytes, kind: str, layout: Layout
) -> tuple[list[Found], tuple[str, ...]]:
    """Return the columns of a log that is neither text nor Parquet, and its reader's warnings.

    Raises InputError.
    """
    table, notes = _answer(path, content, kind, layout)
    return unpack(table), notes


def read_parquet_separately(
    path: Path, content: bytes
) -> tuple[dict[str, pl.Series], tuple[str, ...]]:
    """Return the columns of a Parquet file, of any type, and its reader's warnings.

    Raises InputError.
    """
    table, notes = _answer(path, content, "parquet", Layout())
    return {name: table[name] for name in table.columns}, notes


def _answer(
    path: Path, content: bytes, kind: str, layout: Layout
) -> tuple[pl.DataFrame, tuple[str, ...]]:
    if kind == "mat" and is_hdf5(content):
        kind = "hdf5"
    _check_installed(path, kind)
    task = Task(kind, str(path), layout.matrix, layout.names, layout.missing)
    # The packages are searched only where this process finds them.
    found = {"PYTHONPATH": os.pathsep.join(place for place in sys.path if place)}
    try:
        done = subprocess.run(
            [
                *(sys.executable, "-P", "-m", "coupled.record.importing.separate"),
                json.dumps(asdict(task)),
            ],
            check=False,
            input=content,
            capture_output=True,
            env={**os.environ, **found},
            timeout=LONGEST_s + LONGEST_s_per_MiB * len(content) / 2**20,
        )
    except subprocess.TimeoutExpired as late:
        problem = f"was not read within {late.timeout:.0f} s: it is damaged, or the machine is busy"
        raise InputError(path, "", problem) from None
    if done.returncode == REFUSED:
        said = json.loads(done.stdout)
        raise InputError(path, said["key"], said["problem"])
    if done.returncode != 0:
        raise InputError(path, "", f"is not {_WORDS[kind]} file, or is damaged")
    notes, _, table = done.stdout.partition(b"\n")
    return pl.read_ipc(io.BytesIO(table)), tuple(json.loads(notes))


def is_hdf5(content: bytes) -> bool:
    """Tell whether a MATLAB file is of v7.3: HDF5 after a block of MATLAB's."""
    return _HDF5 in (content[:8], content[512:520]) or content[:19] == b"MATLAB 7.3 MAT-file"


def _check_installed(path: Path, kind: str) -> None:
    for package in _READERS[kind][1] if kind in _READERS else ():
        if importlib.util.find_spec(package) is None:
            problem = f"needs {package}, which is not installed: pip install 'coupled[logs]'"
            raise InputError(path, "", problem)


def read_here(task: Task, content: bytes, notes: list[str]) -> pl.DataFrame:
    """Read a log in this process; add its reader's warnings to `notes`."""
    if task.kind == "parquet":
        with kept_warnings(notes):
            return pl.read_parquet(io.BytesIO(content))
    name = _READERS[task.kind][0]
    module = importlib.import_module(f"coupled.record.importing.formats.{name[5:]}")
    given: dict[str, tuple[object, ...]] = {
        **dict.fromkeys(("mat", "hdf5"), (task.matrix, task.names)),
        "mdf": (task.missing,),
    }
    with kept_warnings(notes):
        found = getattr(module, name)(Path(task.file), content, *given.get(task.kind, ()))
    return pack(found)


def shortened(notes: Sequence[str], kind: str) -> list[str]:
    """Return a reader's warnings as lines for the user, each once, up to `MOST_NOTES`."""
    lines = list(dict.fromkeys(" ".join(note.split()) for note in notes if note.strip()))
    more = [f"… and {len(lines) - MOST_NOTES} more"] if len(lines) > MOST_NOTES else []
    library = _READERS[kind][1][0] if kind in _READERS and _READERS[kind][1] else "its reader"
    return [f"{library} warns: {shown(line)}" for line in [*lines[:MOST_NOTES], *more]]


def _main() -> int:
    limit_memory()
    task, notes = Task(**json.loads(sys.argv[1])), list[str]()
    try:
        table = read_here(task, sys.stdin.buffer.read(), notes)
    except InputError as error:
        sys.stdout.write(json.dumps({"key": error.key, "problem": error.problem}))
        return REFUSED
    sys.stdout.buffer.write(json.dumps(shortened(notes, task.kind)).encode() + b"\n")
    table.write_ipc(sys.stdout.buffer)
    return 0


if __name__ == "__main__":
    sys.exit(_main())
