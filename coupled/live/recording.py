"""The record on disk during a flight: rows are appended every second.

After a crash of the host or a loss of power the record is complete up to the last second. A full
disk ends the recording, not the flight: the file is cut after its last whole row. A thread writes,
so that a slow disk does not delay frames.
"""

from __future__ import annotations

import io
import os
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from io import BufferedRandom, BufferedWriter
from pathlib import Path
from typing import TYPE_CHECKING

from coupled.errors import InputError
from coupled.files import json_text, unfinished_name
from coupled.record.record import FORMAT, Record, manifest_path

if TYPE_CHECKING:
    from coupled.live.host import Host, Request

EVERY_s = 1.0
UNFINISHED = "the host, or its recording, was stopped before the flight was over"


def recording_path(path: Path) -> Path:
    """Return the path of a record during its flight.

    A CSV file is written in place. A Parquet file cannot be appended to: until the end of the
    flight its rows are in a CSV file beside it.
    """
    return path if path.suffix.lower() == ".csv" else path.with_name(f"{path.stem}-in-flight.csv")


class Recording:
    """A watcher that appends rows to the file of `recording_path(path)`.

    `warn` receives a line if the recording ends before the flight.
    """

    def __init__(self, path: Path, warn: Callable[[str], None]) -> None:
        self._whole, self.path, self._warn = path, recording_path(path), warn
        self.recorded_s = 0.0  # of the flight, in the file
        self.problem = ""  # why the recording ended before the flight
        self._channels: tuple[str, ...] = ()
        self._stops: dict[str, float] = {}  # when a control first reached its stop, s
        self._bytes = self._rows = self._due = self._done = 0
        self._wake, self._ended = threading.Condition(), False
        self._thread: threading.Thread | None = None

    def begin(self, host: Host) -> None:
        """Start the thread."""
        self._host, self._every = host, max(2, round(EVERY_s / host.frame_s))
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def observe(self, host: Host, k: int) -> None:
        """Write the rows before frame k, once a second."""
        if k and k % self._every == 0:
            with self._wake:
                self._due = k
                self._wake.notify()

    def requests(self) -> Sequence[Request]:
        """Return no requests."""
        return ()

    def close(self) -> None:
        """Stop appending; the caller writes the whole record next."""
        if self._thread is not None:
            with self._wake:
                self._ended = True
                self._wake.notify()
            self._thread.join()

    def instead_of(self, error: InputError) -> InputError:
        """Return the error of a whole record that could not be written, with what is kept."""
        if not self._rows:
            return error
        problem = f"{error.problem}; {self.path} keeps the first {self.recorded_s:.0f} s"
        return InputError(error.file, error.key, problem)

    def forget(self) -> None:
        """Remove the CSV file beside a complete Parquet record."""
        if self._rows and self.path != self._whole:
            for path in (self.path, manifest_path(self.path)):
                with suppress(OSError):
                    path.unlink()

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._ended or self._due > self._done)
                if self._ended:
                    return
                due = self._done = self._due
            try:
                self._append(due)
            except OSError as error:
                self._give_up(error.strerror or str(error))
                return
            except InputError as error:
                self._give_up(error.problem)
                return

    def _give_up(self, why: str) -> None:
        with suppress(OSError):
            if self._rows:
                os.truncate(self.path, self._bytes)
        self.problem = why
        kept = f"{self.path} keeps its first {self.recorded_s:.0f} s" if self._rows else "none"
        self._warn(f"the recording ended: {why}; {kept}; the flight continues")

    def _append(self, due: int) -> None:
        """Write the rows before frame `due` that are not in the file yet, and the manifest."""
        part = self._host.so_far(self._rows, due)
        if not len(part):
            return
        anew = part.channels != self._channels  # at first, and when a channel was added
        if anew and self._rows:
            part = self._host.so_far(0, due)
        rows = len(part) if anew else self._rows + len(part)
        if anew:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            _put(self.path, _csv(part, header=True))
        self._put_manifest(part, rows)
        if not anew:  # the manifest first, so that the switches of every row are known
            with self.path.open("r+b") as file:
                file.seek(self._bytes)
                file.write(_csv(part, header=False))
                _sync(file)
        self._channels, self._rows = part.channels, rows
        self.recorded_s, self._bytes = float(part.time_s[-1]), self.path.stat().st_size

    def _put_manifest(self, part: Record, rows: int) -> None:
        stops = {**part.manifest["stop_first_met_s"], **self._stops}
        self._stops = stops
        ended = {"reason": UNFINISHED, "time_s": float(part.time_s[-1])}
        own = {"rows": rows, "stop_first_met_s": stops, "ended_early": ended, "format": FORMAT}
        live = {**part.manifest["live"], "unfinished": True}
        table = {**part.manifest, **own, "live": live}
        _put(manifest_path(self.path), json_text(table, sort_keys=True).encode("utf-8"))


def _put(path: Path, content: bytes) -> None:
    """Write a file atomically, synchronised to the disk."""
    part = path.with_name(unfinished_name(path.suffix))
    try:
        with part.open("wb") as file:
            file.write(content)
            _sync(file)
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _sync(file: BufferedWriter | BufferedRandom) -> None:
    file.flush()
    os.fsync(file.fileno())


def _csv(record: Record, header: bool) -> bytes:
    """Return rows in the format of `write_record`."""
    text = io.BytesIO()
    record.to_polars().write_csv(text, include_header=header)
    return text.getvalue()
