"""A user's own JSBSim model, first loaded in a process of its own.

JSBSim is compiled code that some faults of a model's files crash beyond any `except`: a malformed
name of a property, a huge index, a missing section. Then only that process ends, and the fault is
one line. Models of JSBSim or of this package are loaded directly.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path

from coupled.errors import InputError
from coupled.files import clear_temporary
from coupled.flight.altered import ALTERATIONS
from coupled.flight.loading import INERTIAS
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight

TRIED = "coupled.flight.tryout"  # module of that process
REFUSED = 3  # exit code of a process that reports the fault itself
UNCREATED = 4  # likewise, of properties that nothing creates
LONGEST_s = 60.0  # a packaged model takes less than 2 s on a slow machine
# Keys of a flight section that change the loaded files or their content.
_LOADED = (
    *("model", "folder", "model_file", "steps_per_frame", "trim", "cg_aft", "fuel", "mass"),
    *(*INERTIAS, "terms", *(alteration.part.name for alteration in ALTERATIONS)),
)
_MOST_FILES = 10_000


def check_own_model(
    flight: Flight, frame_s: float, controls: Sequence[str], models: Sequence[Path], file: object
) -> None:
    """Refuse a model that crashes JSBSim; `file` is the rig's, for faults.

    A model is tried once for each state of its files and each request.
    """
    home = _own_home(flight, models)
    if home is None:
        return
    named = sorted(flight.properties)
    asked = json.dumps([*(getattr(flight, name) for name in _LOADED), named])
    said = _load_failure(
        str(home), _state(home / flight.model), asked, _Request(flight, frame_s, tuple(controls))
    )
    if said.startswith(flight.model):
        raise InputError(file, "flight.properties", said)
    if said:
        raise InputError(file, "flight.model", f"{flight.model} {said}")


class _Request:
    """The flight to be tried; equal to any other, so that only other arguments key the cache."""

    def __init__(self, flight: Flight, frame_s: float, controls: tuple[str, ...]) -> None:
        self.flight, self.frame_s, self.controls = flight, frame_s, controls

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Request)

    def __hash__(self) -> int:
        return 0


def _own_home(flight: Flight, models: Sequence[Path]) -> Path | None:
    """Return the folder of a user's own model; None for a shipped model."""
    if flight.folder:
        return Path(flight.folder)
    own = [folder for folder in models if folder != aircraft_folder()]
    return next((f for f in own if (f / flight.model / f"{flight.model}.xml").is_file()), None)


def _state(folder: Path) -> tuple[tuple[str, int, int], ...]:
    """Return the files of a model with their sizes and times, to detect changes."""
    found = []
    with suppress(OSError, ValueError):  # an impossible folder, refused when loading
        for path in sorted(folder.rglob("*.xml"))[:_MOST_FILES]:
            known = path.stat()
            found.append((str(path), known.st_mtime_ns, known.st_size))
    return tuple(found)


@lru_cache(maxsize=64)
def _load_failure(home: str, state: object, asked: str, request: _Request) -> str:
    """Return why a model cannot be loaded; empty if it can, or if loading it here will refuse it.

    `state` and `asked` key the cache.
    """
    task = {
        "flight": request.flight.model_dump_json(),
        "frame_s": request.frame_s,
        "controls": request.controls,
        "home": home,
    }
    found = {"PYTHONPATH": os.pathsep.join(place for place in sys.path if place)}
    try:
        done = subprocess.run(
            [sys.executable, "-P", "-m", TRIED],
            check=False,
            input=json.dumps(task).encode(),
            capture_output=True,
            env={**os.environ, **found},
            timeout=LONGEST_s,
        )
    except subprocess.TimeoutExpired:
        return f"is not loaded within {LONGEST_s:.0f} s: a fault of its files"
    finally:
        clear_temporary(again=True)
    if done.returncode == 0:
        return ""
    lines = [line.strip() for line in done.stderr.decode("utf-8", "replace").splitlines()]
    last = next((line for line in reversed(lines) if line), "")
    if done.returncode == UNCREATED:
        return last
    last = last[-200:]
    if done.returncode == REFUSED:
        return f"cannot be loaded: {last}"
    why = f"crashes JSBSim when loaded ({_ending(done.returncode)}): a fault of its files"
    return f"{why}; JSBSim's last message: {last}" if last else why


def _ending(code: int) -> str:
    """Return how a process ended, in words."""
    if code >= 0:
        return f"exit code {code}"
    try:
        return signal.Signals(-code).name
    except ValueError:
        return f"signal {-code}"
