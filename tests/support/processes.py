"""Commands started in the background, to be stopped or killed while they run."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

PATIENCE_s = 300.0  # a command that takes longer hangs, also on a busy machine


def begun(
    folder: Path,
    *words: str,
    until: Callable[[], bool],
    script: str = "",
    may_end: bool = False,
) -> subprocess.Popen[bytes]:
    """Start a command or a script in its own process group; return it once it has made progress."""
    process = subprocess.Popen(
        [sys.executable, *(["-c", script] if script else ["-m", "coupled", *words])],
        cwd=folder,
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    patience = time.monotonic() + PATIENCE_s
    while not until():
        assert may_end or process.poll() is None
        assert time.monotonic() < patience
        time.sleep(0.01)
    return process


def stopped(process: subprocess.Popen[bytes], number: int) -> int:
    """Send a signal to a command but not to its workers; return its exit code."""
    process.send_signal(number)
    return process.wait(PATIENCE_s)


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a command without time to clean up; its workers must end with it."""
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    ended(process)


def ended(process: subprocess.Popen[bytes]) -> None:
    """Wait until all processes of a command's group have ended."""
    patience = time.monotonic() + PATIENCE_s
    while True:
        try:
            os.killpg(process.pid, 0)
        except ProcessLookupError:
            return
        assert time.monotonic() < patience
        time.sleep(0.05)
