"""Imports that read each format in this process, without a process for each log."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import polars as pl

from coupled.errors import InputError
from coupled.record.importing import reading, separate
from coupled.record.importing.formats.columns import Found, unpack
from coupled.record.importing.mapping import Layout


def _here(path: Path, content: bytes, kind: str, layout: Layout) -> tuple[Any, tuple[str, ...]]:
    """Read a log in this process; in an import its exception would end the separate process."""
    if kind == "mat" and separate.is_hdf5(content):
        kind = "hdf5"
    task = separate.Task(kind, str(path), layout.matrix, layout.names, layout.missing)
    notes: list[str] = []
    try:
        with warnings.catch_warnings():
            table = separate.read_here(task, content, notes)
    except InputError:
        raise
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        raise InputError(path, "", "is damaged") from None
    return table, tuple(separate.shortened(notes, kind))


def _found_here(
    path: Path, content: bytes, kind: str, layout: Layout
) -> tuple[list[Found], tuple[str, ...]]:
    table, notes = _here(path, content, kind, layout)
    return unpack(table), notes


def _parquet_here(path: Path, content: bytes) -> tuple[dict[str, pl.Series], tuple[str, ...]]:
    table, notes = _here(path, content, "parquet", Layout())
    return {name: table[name] for name in table.columns}, notes


@contextmanager
def in_process() -> Iterator[None]:
    """Let imports read each format in this process, as a separate process takes a second."""
    with (
        patch.object(reading, "read_separately", _found_here),
        patch.object(reading, "read_parquet_separately", _parquet_here),
    ):
        yield
