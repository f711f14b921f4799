"""The journal of a sweep's folder: a line for each flight, written to disk before it counts.

Lines of JSON, the first of them the sweep's identity. A line cut short by a kill is dropped, and
its flight flown again. One process at a time may use a folder. The lock of a killed process is
released by the system, and its partial files are removed by the next process.
"""

from __future__ import annotations

import json
import os
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from coupled.campaign.entry import JournalEntry, read_entry
from coupled.campaign.plan import SweepPlan
from coupled.errors import InputError
from coupled.files import clear, read_bytes

JOURNAL = "flights.jsonl"
LOCK = ".lock"
UNFINISHED = ".coupled-"  # prefix of an incomplete file in `files`


ANOTHER = "holds another sweep, or what this one reads has changed since; give a new folder"


def _header(identity: str) -> str:
    """Return the first line of a sweep's journal."""
    return json.dumps({"sweep": identity}) + "\n"


class Journal:
    """The completed flights; only their numbers, `done`, are in memory."""

    def __init__(self, folder: Path, plan: SweepPlan) -> None:
        self.path = folder / JOURNAL
        self.done: set[int] = set()
        self._columns = plan.columns
        self._read(plan.identity)

    @staticmethod
    def check(folder: Path, plan: SweepPlan) -> None:
        """Raise InputError if the folder's journal is another sweep's."""
        first = read_bytes(folder / JOURNAL).partition(b"\n")
        if first[1] and first[0] + b"\n" != _header(plan.identity).encode():
            raise InputError(folder, "", ANOTHER)

    @property
    def complete(self) -> bool:
        """Whether every flight of the sweep is done."""
        return len(self.done) == self._columns.flights

    def _read(self, identity: str) -> None:
        header = _header(identity)
        whole = b""
        if self.path.exists():
            content = read_bytes(self.path)
            whole = content[: content.rfind(b"\n") + 1]
        if not whole:
            self._write(header, "wb")
            return
        first, *lines = whole.decode("utf-8")[:-1].split("\n")
        if first + "\n" != header:
            raise InputError(self.path.parent, "", ANOTHER)
        for number, line in enumerate(lines, 2):
            flight = self._entry(line, number).flight
            if flight in self.done:
                problem = f"duplicate flight {flight}; take one of the lines out"
                raise InputError(self.path, f"line {number}", problem)
            self.done.add(flight)
        with self.path.open("r+b") as file:
            file.truncate(len(whole))

    def add(self, *entries: JournalEntry) -> None:
        """Store flights; they are on the disk when this returns."""
        self._write("".join(entry.line(self._columns) + "\n" for entry in entries), "ab")
        self.done.update(entry.flight for entry in entries)

    def entries(self) -> list[JournalEntry]:
        """Return the flights in the order of their numbers."""
        with self.path.open(encoding="utf-8") as lines:
            next(lines)
            found = [self._entry(line, number) for number, line in enumerate(lines, 2)]
        return sorted(found, key=lambda entry: entry.flight)

    def _entry(self, line: str, number: int) -> JournalEntry:
        return read_entry(line, self._columns, self.path, f"line {number}")

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
def opened(folder: Path, plan: SweepPlan) -> Iterator[Journal]:
    """Open the journal of a sweep's folder, created if needed, for this process alone."""
    try:
        if folder.is_dir() and _foreign(folder) and not (folder / JOURNAL).exists():
            raise InputError(folder, "", "is not empty, and holds no sweep; give a new folder")
        if (folder / JOURNAL).exists():
            Journal.check(folder, plan)  # before anything is written to the folder
        folder.mkdir(parents=True, exist_ok=True)
        # SQLite's lock works on every system, and the kernel releases it after a kill.
        lock = sqlite3.connect(folder / LOCK, timeout=0.0, isolation_level=None)
    except InputError:
        raise
    except (OSError, ValueError, sqlite3.Error):
        raise InputError(folder, "", "cannot be written there") from None
    try:
        try:
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.Error as error:
            busy = error.sqlite_errorcode == sqlite3.SQLITE_BUSY
            problem = "another sweep is writing there" if busy else f"cannot be written: {error}"
            raise InputError(folder, "", problem) from None
        journal = _journal(folder, plan)
        clear(folder)
        yield journal
    finally:
        lock.close()


def _foreign(folder: Path) -> bool:
    """Return whether a folder contains files other than those of an unfinished sweep."""
    names = (path.name for path in folder.iterdir())
    return any(name != LOCK and not name.startswith(UNFINISHED) for name in names)


def _journal(folder: Path, plan: SweepPlan) -> Journal:
    try:
        return Journal(folder, plan)
    except (OSError, UnicodeDecodeError):
        raise InputError(folder / JOURNAL, "", "cannot be read back; give a new folder") from None
