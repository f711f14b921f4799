"""Parquet and MATLAB files are read in a process of their own.

Their readers are compiled code that a damaged file can crash, past any `except`: then only
that process dies, and the command says in one line that the file is damaged.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

import polars as pl

from coupled.errors import InputError
from coupled.record.importing.mapping import Layout
from coupled.record.importing.matlab import read_matlab

REFUSED = 3  # exit code of a process that says itself what is wrong
_KINDS = {"parquet": "Parquet", "mat": "MATLAB"}


@dataclass(frozen=True)
class Task:
    """What a separate process is to read: a `kind` of file, and of a MATLAB file which matrix."""

    kind: str
    file: str
    matrix: str
    names: list[str] | str


def read_separately(path: Path, content: bytes, kind: str, layout: Layout) -> dict[str, pl.Series]:
    """Return the columns of a Parquet or MATLAB file."""
    task = Task(kind, str(path), layout.matrix, layout.names)
    # The packages are found where this process finds them, and nowhere else.
    found = {"PYTHONPATH": os.pathsep.join(place for place in sys.path if place)}
    done = subprocess.run(
        [sys.executable, "-P", "-m", "coupled.record.importing.separate", json.dumps(asdict(task))],
        check=False,
        input=content,
        capture_output=True,
        env={**os.environ, **found},
    )
    if done.returncode == REFUSED:
        said = json.loads(done.stdout)
        raise InputError(path, said["key"], said["problem"])
    if done.returncode != 0:
        raise InputError(path, "", f"is not a {_KINDS[kind]} file, or is damaged")
    table = pl.read_ipc(io.BytesIO(done.stdout))
    if kind == "parquet":
        return {name: table[name] for name in table.columns}
    return dict(zip(table["name"], table["values"], strict=True))


def _read(task: Task, content: bytes) -> pl.DataFrame:
    if task.kind == "parquet":
        return pl.read_parquet(io.BytesIO(content))
    vectors = read_matlab(Path(task.file), content, task.matrix, task.names)
    values = [pl.Series(vector) for vector in vectors.values()]  # each of its own length
    return pl.DataFrame({"name": list(vectors), "values": values})


def _main() -> int:
    try:
        table = _read(Task(**json.loads(sys.argv[1])), sys.stdin.buffer.read())
    except InputError as error:
        sys.stdout.write(json.dumps({"key": error.key, "problem": error.problem}))
        return REFUSED
    table.write_ipc(sys.stdout.buffer)
    return 0


if __name__ == "__main__":
    sys.exit(_main())
