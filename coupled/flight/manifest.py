"""The manifest of a flight's record: rig, seed, files, versions, signs, and its end."""

from __future__ import annotations

import platform
from dataclasses import asdict
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.files import sha256
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import ForceTable
from coupled.record.channels import TIME, channel
from coupled.record.record import EndedEarly
from coupled.rig.packing import COMMAND_SIGN
from coupled.rig.rigwrite import rig_table, section_table

Floats = NDArray[np.float64]


def input_files(manoeuvre: Manoeuvre) -> list[Path]:
    """Return the input files of a flight, if any: run, rig, and a pilot's tables."""
    source = manoeuvre.source
    own = [source.run_file, source.rig_file] if source is not None else []
    pilots = manoeuvre.pilots.values()
    return own + [Path(p.file) for p in pilots if isinstance(p, ForceTable) and p.file]


def manifest(
    manoeuvre: Manoeuvre, channels: tuple[str, ...], data: Floats, ended: EndedEarly | None
) -> dict[str, Any]:
    """Return the manifest of a flight's record for JSON."""
    stops = {}
    for control in manoeuvre.rig.controls:
        met = np.flatnonzero(data[:, channels.index(channel(control, "stop"))])
        if met.size:
            stops[control] = float(data[met[0], channels.index(TIME)])
    files = [path for path in input_files(manoeuvre) if path.is_file()]
    return {
        "run": manoeuvre.name,
        "case": manoeuvre.label,
        "rig": rig_table(manoeuvre.rig),
        "seed": manoeuvre.seed,
        "conditions": _conditions(manoeuvre),
        "reach": {n: r for n, p in manoeuvre.pilots.items() if (r := p.reach(n)) > 0.0},
        "channels": list(channels),
        "positive": _positive(manoeuvre),
        "rows": len(data),
        "ended_early": None if ended is None else asdict(ended),
        "stop_first_met_s": stops,
        "inputs_sha256": {path.name: sha256(path) for path in files},
        "versions": dict(versions()),
    }


def _conditions(manoeuvre: Manoeuvre) -> dict[str, Any]:
    """Return the wind, gust, turbulence and events of a flight, by the keys of a run file."""
    given = manoeuvre.conditions
    tables = {key: getattr(given, key) for key in ("wind", "gust", "turbulence")}
    found: dict[str, Any] = {
        key: section_table(table, "m") for key, table in tables.items() if table is not None
    }
    events = {name: section_table(event, "m") for name, event in given.event.items()}
    return found | ({"event": events} if events else {})


_PULLS = {"column": "a pull", "wheel": "clockwise", "pedals": "right foot forward"}


def _positive(manoeuvre: Manoeuvre) -> dict[str, str]:
    """Return the positive direction of each control, and of its surface command."""
    found: dict[str, str] = {}
    for name, control in manoeuvre.rig.controls.items():
        sign = "positive" if COMMAND_SIGN[control.surface] > 0 else "negative"
        found[name] = _PULLS[name]
        found[channel(name, "surface_norm")] = f"JSBSim's: {_PULLS[name]} gives a {sign} command"
    return found


@lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    """Return the versions of the packages used in flight."""
    found = {"coupled": version("coupled"), "python": platform.python_version()}
    return found | {name: version(name) for name in ("jsbsim", "numpy", "numba", "scipy")}
