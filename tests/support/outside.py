"""Bench records of a twin with a fault outside the library, and fitted curves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coupled.blind.trials.deck import read_deck
from coupled.blind.twin.excitation import bench_pressure, pilot_force, pilot_shape
from coupled.blind.twin.kernel import twin_frame
from coupled.blind.twin.numbers import TWIN_STATE
from coupled.blind.twin.setting import NOISE
from coupled.blind.twin.twin import RIG_CHANNELS, Twin, nominal_twin
from coupled.gap.chain import Part
from coupled.gap.findings.curves import Curves, find_curves
from coupled.gap.prepare import prepare
from coupled.gap.search.beam import search_sets
from coupled.record.record import Record
from coupled.rig.compiled import bound
from coupled.rig.rig import Rig

TABLE = {
    "dynamic_pressure_Pa": [0.0, 800.0, 1500.0, 2200.0, 3000.0],
    "total_gradient_N_per_m": [560.0, 900.0, 1300.0, 1800.0, 2200.0],
}
_CHANGES = {f"controls.column.schedule.{key}": values for key, values in TABLE.items()}
RIG = read_deck(1).rigs["bench-rigid"].changed(_CHANGES)
SECONDS = 20.0
LEVEL_N = 60.0

Fault = Callable[[Twin, float, float], None]  # of the twin, time in s and q̄ in Pa


def recorded(fault: Fault, seed: int = 1, rig: Rig = RIG, seconds: float = SECONDS) -> Record:
    """Return a noisy bench record of the twin of a rig; the fault is applied at each frame."""
    rng = np.random.default_rng(seed)
    frames = round(seconds * rig.frame_rate)
    shape, _ = pilot_shape(rng, frames, rig.frame_rate)
    nodes, pressures = pilot_force(rig, shape, LEVEL_N), bench_pressure(rng, rig, frames)
    sigma = np.array([NOISE[name][0] for name in RIG_CHANNELS])
    rows = sigma * rng.standard_normal((frames, len(RIG_CHANNELS)))
    twin, state, others = nominal_twin(rig), np.zeros(1, TWIN_STATE), np.zeros_like(nodes)
    time_s = np.arange(frames) / rig.frame_rate
    fault(twin, 0.0, float(pressures[0]))
    kernel = bound(twin_frame, twin.numbers, state, nodes, others, rows[0], 0, 1.0, 1.0)
    for k in range(frames):
        fault(twin, float(time_s[k]), float(pressures[k]))
        kernel(twin.numbers, state, nodes, others, rows[k], k, float(pressures[k]), 1.0)
    return Record(("time_s", *RIG_CHANNELS), np.column_stack((time_s, rows)))


def curves_of(record: Record, rig: Rig = RIG) -> Curves | None:
    """Return the curves fitted without effects, as with an empty library."""
    prepared = prepare(rig, {"record": record}, Part("column"))
    case, choice = prepared.case, search_sets(prepared.case, [])[1]
    return find_curves(case, choice, (), [record])
