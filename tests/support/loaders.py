"""Simulated loaders in separate processes, over loopback, and flights with them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).parents[2]


@contextmanager
def fake_loader(kind: str, **numbers: float) -> Iterator[tuple[int, subprocess.Popen[str]]]:
    """Run a simulated loader; yield its port and its process."""
    words = [f"{name}={value}" for name, value in numbers.items()]
    command = [sys.executable, "-m", "tests.support.fakeloader", kind, "0", *words]
    path = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=path)
    try:
        assert process.stdout is not None
        ready, port = process.stdout.readline().split()
        assert ready == "ready"
        yield int(port), process
    finally:
        process.kill()
        process.wait()
        if process.stdout is not None:
            process.stdout.close()
