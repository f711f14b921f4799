"""Results of benchmarks, in docs/benchmarks.json, and the README's sentences from them.

    COUPLED_BENCHMARKS=keep pytest -m bench -s

writes each benchmark's figures into the file with machine, date, versions, and the load that the
machine had meanwhile; without the variable nothing is written. The README says only what is there.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from coupled import __version__
from tests.support.commands import ROOT

FILE = ROOT / "docs" / "benchmarks.json"
FRAME = "A coupled frame, with the loader at 2 kHz and the record on,"
FRAME_BOUNDS = {1: 1.3, 3: 1.5}  # times run(), by how many controls
HELD = "A benchmark requires 1.8 times the rate of one worker from two, in constant memory"
LIBRARIES = ("jsbsim", "numba", "numpy", "polars")
Figures = Mapping[str, float]


def processor() -> str:
    """Return the processor's name, if the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor()


def everything() -> dict[str, Any]:
    """Return the whole file, by benchmark."""
    return dict(json.loads(FILE.read_text(encoding="utf-8"))) if FILE.exists() else {}


def keep(name: str, figures: Figures, load_before: float) -> None:
    """Write the results of a benchmark if the environment requests it.

    `load_before` is the machine's load (mean of a minute) at the start, by other processes.
    """
    if os.environ.get("COUPLED_BENCHMARKS") != "keep":
        return
    entry = {
        "figures": {key: float(f"{value:.4g}") for key, value in figures.items()},
        "date": datetime.now(UTC).date().isoformat(),
        "load_before": round(load_before, 1),
        "machine": {
            "processor": processor(),
            "cores": len(os.sched_getaffinity(0)),
            "system": f"{platform.system()} {platform.machine()}",
        },
        "versions": {
            "coupled": __version__,
            "python": platform.python_version(),
            **{library: version(library) for library in LIBRARIES},
        },
    }
    kept = dict(sorted({**everything(), name: entry}.items()))
    text = json.dumps(kept, indent=2, ensure_ascii=False)
    FILE.write_text(text + "\n", encoding="utf-8")


def kept_figures(name: str) -> dict[str, float]:
    """Return the results of a benchmark in the file, empty if it has none."""
    return dict(everything().get(name, {"figures": {}})["figures"])


def under(name: str) -> str:
    """Return the link to a benchmark's figures, with the number of cores."""
    cores = everything()[name]["machine"]["cores"]
    return f"([measured](docs/benchmarks.json) on {cores} cores)"


def frame_cost() -> str:
    """Return the README's sentence on a frame's cost, from the measurement."""
    names = {n: f"frame cost, {n} control(s)" for n in (1, 3)}
    each = [list(kept_figures(name).values()) for name in names.values()]
    if not all(each):
        return (
            f"{FRAME} may take {FRAME_BOUNDS[1]} times as long as JSBSim's `run()`, with three"
            f" controls {FRAME_BOUNDS[3]} times."
        )
    one, three = (f"{min(x):.2f} to {max(x):.2f} times" for x in each)
    return (
        f"{FRAME} takes {one} as long as JSBSim's `run()`, with three controls {three}"
        f" {under(names[3])}.{_frame_parts()}"
    )


def _frame_parts() -> str:
    """Return the parts of the time beyond `run()`, with one control."""
    kept = kept_figures("frame parts, 1 control(s)")
    part: dict[str, list[float]] = {}
    for name, value in kept.items():
        part.setdefault(name.rpartition(", ")[2].removesuffix("_us"), []).append(value)
    if not part:
        return ""
    more = [rig + rest for rig, rest in zip(part["rig"], part["rest"], strict=True)]
    return (
        f" One control adds {min(more):.1f} to {max(more):.1f} µs; a loader without aircraft"
        f" takes {max(part['rig']):.1f} µs."
    )


def sweep_rate() -> str:
    """Return the guide's sentence on a sweep's rate, from the measurement."""
    kept = kept_figures("sweep")
    if not kept:
        return f"{HELD} (`pytest -m bench tests/benchmarks/test_campaign.py -s`)."
    return (
        f"Two workers fly {kept['flights']:,.0f} flights of {kept['seconds']:g} s in"
        f" {kept['taken_s']:.0f} s: {kept['two_of_one']:.2f} times the rate of one worker,"
        f" {kept['of_bare']:.2f} times that of JSBSim alone {under('sweep')}."
    )


OUTSIDE = ("an ", "a ")  # how the benchmark names faults that no effect of the library explains


def diagnosis_seconds() -> str:
    """Return the guide's sentence on the time of a diagnosis, from the measurement."""
    name = "diagnosis of 60 s"
    ends = ", wall_s by all"
    taken = {key.removesuffix(ends): s for key, s in kept_figures(name).items() if ends in key}
    if not taken:
        return "The time that a diagnosis takes depends on the effect; dry friction takes longest."
    unknown = max(s for what, s in taken.items() if what.startswith(OUTSIDE))
    found = {w: s for w, s in taken.items() if w != "none" and not w.startswith(OUTSIDE)}
    quick, slow = min(found, key=found.__getitem__), max(found, key=found.__getitem__)
    every = kept_figures("diagnosis of 60 s of three controls").values()
    most = f" With three controls it takes up to {max(every):.1f} s." if every else ""
    return (
        f"Diagnosis of 60 s takes {taken['none']:.1f} s without a gap, {found[quick]:.1f} s"
        f" ({quick}) to {found[slow]:.1f} s ({slow}) with one effect, and up to {unknown:.1f} s"
        f" if none explains it {under(name)}.{most}"
    )


SENTENCES = {
    "frame cost": frame_cost,
    "sweep rate": sweep_rate,
    "diagnosis seconds": diagnosis_seconds,
}
