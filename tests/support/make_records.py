"""Make the reference records: clean rigs, by the twin, which shares no stage with the library.

    python -m tests.support.make_records

The twin steps its loader 128 times a frame, 15 kHz, some eight times as finely as these rigs are
flown, and solves every stage by other means. Each record has the noise of the contract's sensors
and a logger's digits, and lies in tests/reference with the rig file that it was made with. They
are kept in the repository so that a change of twin and stages together is noticed too.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from coupled.blind.twin.excitation import pilot_force
from coupled.blind.twin.kernel import NODES
from coupled.blind.twin.setting import NOISE, channels
from coupled.blind.twin.twin import fly_twin, nominal_twin
from coupled.record.record import Record, write_record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.rig.rigwrite import rig_text

HERE = Path(__file__).parents[1] / "reference"
DURATION_s = 30.0
LOADER = "controls.column.loader"
PLAIN = {f"{LOADER}.{key}": 0.0 for key in ("breakout_N", "friction_N", "bob_weight_N_per_g")}
ONE_SEGMENT = {
    "controls.column.schedule.second_gradient_N_per_m": None,
    "controls.column.schedule.break_deflection_m": 0.0,
}


def rigs() -> dict[str, tuple[Rig, float]]:
    """Return {name: rig, the pilot's force in N}: a column in flight, and one on a bench."""
    c172p = read_rig(shipped_rigs()["c172p"])
    column = c172p.controls["column"]
    flown = c172p.changed({"controls": {"column": column}}).changed({"name": "twin-c172p", **PLAIN})
    bench = read_rig(shipped_rigs()["bench"])
    bench = bench.changed({"name": "twin-bench", **PLAIN, **ONE_SEGMENT})
    return {"twin-c172p": (flown, 30.0), "twin-bench": (bench, 60.0)}


def force(rig: Rig, level_N: float) -> np.ndarray:
    """Return the pilot's force at the twin's nodes, N: a sweep of 0.1 to 2 Hz between two rests."""
    nodes = round(DURATION_s * rig.frame_rate) * NODES + 1
    t = np.linspace(0.0, DURATION_s, nodes)
    rate = np.log(20.0) / (DURATION_s - 4.0)
    phase = 2.0 * np.pi * 0.1 * np.expm1(rate * np.clip(t - 2.0, 0.0, DURATION_s - 4.0)) / rate
    ends = np.clip(t - 1.0, 0.0, 1.0) * np.clip(DURATION_s - 1.0 - t, 0.0, 1.0)
    return pilot_force(rig, np.sin(phase) * np.sin(0.5 * np.pi * ends) ** 2, level_N)


def pressure(rig: Rig) -> np.ndarray | None:
    """Return the q̄ that a bench's host reads, Pa: holds and ramps over the schedule."""
    if rig.flight is not None:
        return None
    t = np.arange(round(DURATION_s * rig.frame_rate)) / rig.frame_rate
    times = [0.0, 6.0, 9.0, 15.0, 18.0, 24.0, 27.0]
    return np.interp(t, times, [300.0, 300.0, 1500.0, 1500.0, 2900.0, 2900.0, 900.0])


def make(rig: Rig, level_N: float, seed: int) -> Record:
    """Return a noisy, rounded record of the rig as filed."""
    frames = round(DURATION_s * rig.frame_rate)
    names = channels(rig)
    noise = np.random.default_rng(seed).standard_normal((frames, len(names)))
    noise *= [NOISE[name][0] for name in names]
    record = fly_twin(rig, nominal_twin(rig), force(rig, level_N), frames, pressure(rig), noise)
    data = record.data.copy()
    for i, name in enumerate(record.channels):
        data[:, i] = np.round(data[:, i], NOISE[name][1] if name in NOISE else 9)
    return Record(record.channels, data)


def main() -> None:
    """Write each record and its rig file."""
    for seed, (name, (rig, level_N)) in enumerate(rigs().items()):
        text = rig_text(rig, f"The rig of {name}.parquet, made by make_records.py")
        (HERE / f"{name}.toml").write_text(text, encoding="utf-8")
        write_record(make(rig, level_N, seed), HERE / f"{name}.parquet")


if __name__ == "__main__":
    main()
