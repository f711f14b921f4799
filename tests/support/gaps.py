"""Records with a known effect, made by flying a rig that has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile
from coupled.flight.pilot import ForceTable
from coupled.flight.runfile import read_run
from coupled.gap import prepare
from coupled.gap.effects.effect import Effect, apply
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.problem import Problem
from coupled.gap.search.screen import Screen, Worth
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.records import NOISE
from tests.support.rigs import BENCH, bench

LONG_s = 40.0


def starts_of(case: Case, effect: Effect) -> list[dict[str, float]]:
    """Return the start values of the fits of an effect, without those of nuisance parameters."""
    problem = Problem(case)
    root, every = problem.fit(()), np.full(len(case.outputs), 1e6)
    screen = Screen(problem, problem.model_error(root.rig))
    found = screen.best(root, [effect], Worth(0.0, every))
    return [start for one in found for start in one.starts]


def know_only(monkeypatch: pytest.MonkeyPatch, effects: Sequence[Effect]) -> None:
    """Restrict the library to these effects; a record of another effect is then out of library."""
    monkeypatch.setattr(prepare, "library_of", lambda *_: list(effects))


def pushes(seed: int, amplitude_N: float = 45.0) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a pilot's force: holds of random size and length plus a sweep."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(LONG_s * 120) + 1) / 120
    force = 0.2 * amplitude_N * np.sin(2 * np.pi * (0.1 + 0.0125 * t) * t) * (t < LONG_s - 3)
    at = 1.0
    while at < LONG_s - 4:
        length, size = rng.uniform(0.4, 3.0), rng.uniform(-1, 1) * amplitude_N
        for start, sign in ((at, 1.0), (at + length, -1.0)):
            share = np.clip((t - start) / 0.25, 0.0, 1.0)
            force += sign * size * 0.5 * (1.0 - np.cos(np.pi * share))
        at += length + rng.uniform(0.0, 0.6)
    return t, force


def nominal_rig(flown: bool) -> Rig:
    """Return the nominal rig of a diagnosis."""
    if flown:
        return read_run("worst-case-t37")[0].rig
    table = {**BENCH, "frame_rate_Hz": 120.0}
    return bench({"controls.column.schedule.pressure_scale": 1.0}, table)


def made(
    folder: Path,
    nominal: Rig,
    values: Mapping[str, Mapping[str, float]],
    seed: int,
    amplitude_N: float = 45.0,
    noisier: float = 1.0,
) -> Record:
    """Return the noisy record of a rig that has the effects of `values`."""
    effects = [BY_NAME[name] for name in values]
    flat = {f"{name}.{key}": v for name, found in values.items() for key, v in found.items()}
    real = apply(nominal, "column", effects, flat)
    flown = nominal.flight is not None
    of_a_bench = ("column", "dynamic")
    noise = {n: noisier * rms for n, rms in NOISE.items() if flown or n.startswith(of_a_bench)}
    real = real.changed({"noise": noise})
    t, force = pushes(seed, amplitude_N)
    rows = "".join(f"{a:.7f},{b:.6f}\n" for a, b in zip(t, force, strict=True))
    (folder / "force.csv").write_text("time_s,column_force_N\n" + rows)
    pilot = ForceTable(file=str(folder / "force.csv"))
    pressures = [300.0, 300.0, 1200.0, 1200.0, 2000.0, 2000.0, 2900.0]
    times = [0.0, 9.0, 10.0, 19.0, 20.0, 29.0, 30.0]
    profile = None if flown else PressureProfile(time_s=times, dynamic_pressure_Pa=pressures)
    return fly(Manoeuvre(real, {"column": pilot}, LONG_s, seed=seed, bench=profile))
