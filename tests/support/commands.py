"""Runs commands as a user does: in a folder, with arguments, on a terminal of 80 columns."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO
from unittest.mock import patch

from coupled.cli import main
from coupled.cli.progress import MARK
from coupled.cli.terminal import err, out

ROOT = Path(__file__).parents[2]
TERMINAL = {"COLUMNS": "80", "NO_COLOR": "1"}
_PROGRESS = re.compile(rf"{MARK} .*, after \d+ s$")
HANDLED = (signal.SIGINT, signal.SIGTERM)


def coupled(folder: Path, *words: str, columns: int = 80) -> subprocess.CompletedProcess[str]:
    """Run a command in this process, with everything imported and compiled; return its result.

    Standard output and error are redirected to files, also for libraries in C.
    """
    with (
        patch.dict(os.environ, {**TERMINAL, "COLUMNS": str(columns)}),
        patch.object(sys, "argv", ["coupled", *words]),
        _as_wide_as(columns),
        _working_in(folder),
        _to_file("stdout", 1) as printed,
        _to_file("stderr", 2) as said,
    ):
        try:
            main()
            code = 0
        except SystemExit as end:
            assert isinstance(end.code, int)
            code = end.code
        texts = [_without_progress(_read(file)) for file in (printed, said)]
    return subprocess.CompletedProcess(words, code, *texts)


def _without_progress(text: str) -> str:
    """Return a command's output, without the progress lines of a slow machine."""
    return "".join(line for line in text.splitlines(keepends=True) if not _PROGRESS.match(line))


def coupled_anew(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Run a command in a new Python process, as from a shell."""
    done = subprocess.run(
        [sys.executable, "-m", "coupled", *words],
        check=False,
        cwd=folder,
        env={**os.environ, **TERMINAL},
        capture_output=True,
        text=True,
        timeout=300,
    )
    done.stderr = _without_progress(done.stderr)
    return done


def files(folder: Path) -> set[str]:
    """Return all files of a folder and its subfolders."""
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


@contextmanager
def _as_wide_as(columns: int) -> Iterator[None]:
    """Set the width of the consoles, which is fixed when they are created."""
    before = [(console, console.width) for console in (out, err)]
    for console, _ in before:
        console.width = columns
    try:
        yield
    finally:
        for console, width in before:
            console.width = width


@contextmanager
def _working_in(folder: Path) -> Iterator[None]:
    """Change to a folder; restore what a command sets for its process."""
    before, handlers = Path.cwd(), [signal.getsignal(each) for each in HANDLED]
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
        for each, handler in zip(HANDLED, handlers, strict=True):
            signal.signal(each, handler)


@contextmanager
def _to_file(name: str, descriptor: int) -> Iterator[TextIO]:
    """Redirect a standard stream and its file descriptor to a file."""
    stream: TextIO = getattr(sys, name)
    stream.flush()
    kept = os.dup(descriptor)
    with tempfile.TemporaryFile("w+", encoding="utf-8") as file:
        os.dup2(file.fileno(), descriptor)
        try:
            with patch.object(sys, name, file):
                yield file
        finally:
            os.dup2(kept, descriptor)
            os.close(kept)


def _read(file: TextIO) -> str:
    file.flush()
    file.seek(0)
    return file.read()
