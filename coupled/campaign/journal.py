"""The journal of a sweep's folder: a row a flight, on the disk before the next is counted.

Lines of JSON, the first of them the sweep's identity. A line cut short by a kill is dropped,
and its flight flown again. One process at a time holds a folder; a killed one lets go.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from coupled.errors import InputError

JOURNAL = "flights.jsonl"
Row = dict[str, Any]


class Journal:
    """The rows of the flights that are done; in memory only their numbers, `done`."""

    def __init__(self, folder: Path, identity: str) -> None:
        self.path = folder / JOURNAL
        self.done: set[int] = set()
        self._read(identity)

    def _read(self, identity: str) -> None:
        header = json.dumps({"sweep": identity}) + "\n"
        whole = b""
        if self.path.exists():
            content = self.path.read_bytes()
            whole = content[: content.rfind(b"\n") + 1]
        if not whole:
            self._write(header, "wb")
            return
        first, *lines = whole.decode("utf-8")[:-1].split("\n")
        if first + "\n" != header:
            raise InputError(
                self.path.parent,
                "",
                "holds another sweep, or what this one reads has changed since; give a new folder",
            )
        self.done = {json.loads(line)["flight"] for line in lines}
        with self.path.open("r+b") as file:
            file.truncate(len(whole))

    def add(self, row: Row) -> None:
        """Keep a row: it is on the disk when this returns."""
        self._write(json.dumps(row, ensure_ascii=False) + "\n", "ab")
        self.done.add(row["flight"])

    def rows(self) -> list[Row]:
        """Return the rows, in the order of the flights, as they were written."""
        with self.path.open(encoding="utf-8") as lines:
            next(lines)
            found = [json.loads(line) for line in lines]
        return sorted(found, key=lambda row: int(row["flight"]))

    def _write(self, text: str, mode: str) -> None:
        try:
            with self.path.open(mode) as file:
                file.write(text.encode("utf-8"))
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            problem = f"cannot be written: {error.strerror}; the flights in it are kept"
            raise InputError(self.path, "", problem) from None


@contextmanager
def opened(folder: Path, identity: str) -> Iterator[Journal]:
    """Give the journal of a folder, made if need be, to this process alone."""
    if folder.is_dir() and any(folder.iterdir()) and not (folder / JOURNAL).exists():
        raise InputError(folder, "", "is not empty, and holds no sweep; give a new folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # SQLite's lock works on every system, and is the kernel's: nothing is left by a kill.
        lock = sqlite3.connect(folder / ".lock", timeout=0.0, isolation_level=None)
    except (OSError, sqlite3.Error):
        raise InputError(folder, "", "cannot be written there") from None
    try:
        try:
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error:
            raise InputError(folder, "", "another sweep is writing there") from None
        yield _journal(folder, identity)
    finally:
        lock.close()


def _journal(folder: Path, identity: str) -> Journal:
    try:
        return Journal(folder, identity)
    except (OSError, UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError):
        raise InputError(folder / JOURNAL, "", "cannot be read back; give a new folder") from None
