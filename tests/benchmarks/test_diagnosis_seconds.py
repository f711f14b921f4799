"""What a diagnosis of a 60 s record costs by what is found, in wall and processor seconds.

    OPENBLAS_NUM_THREADS=1 COUPLED_BENCHMARKS=keep \
        pytest -m bench tests/benchmarks/test_diagnosis_seconds.py -s

with the variable that `coupled` sets for its commands: BLAS's own threads take the other core.
Each in this process, with its code compiled before, by one thread and by one a core: the answers
are the same, and the wall seconds of both stand side by side.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import coupled
from coupled.gap.diagnose import diagnose
from coupled.record.record import Record, write_record
from tests.support import gaps, threecontrols
from tests.support.airframes import noisy
from tests.support.benchmarks import keep

pytestmark = pytest.mark.bench
# The command, which tells its largest memory: that of a child counts its parent's before it begins.
PEAK = """
import atexit, runpy, sys
atexit.register(lambda: print(open("/proc/self/status").read(), file=sys.stderr))
runpy.run_module("coupled", run_name="__main__")
"""
Floats = NDArray[np.float64]

CASES: dict[str, dict[str, dict[str, float]]] = {
    "none": {},
    "bend": {"bend": {"bend_{d}_per_N": 2e-4}},
    "inertia": {"inertia": {"factor": 1.4}},
    "pitch damping": {"pitch_damping": {"factor": 1.4}},
    "Coulomb friction": {"coulomb_friction": {"friction_N": 3.0}},
    "presliding friction": {
        "presliding_friction": {
            "friction_N": 4.0,
            "stiffness_N_per_{d}": 2e4,
            "elastic_share": 0.3,
        }
    },
    "Stribeck friction": {
        "stribeck_friction": {
            "friction_N": 2.0,
            "breakaway_N": 6.0,
            "stribeck_{d}_per_s": 2e-3,
        }
    },
}


def jams(grip_m: Floats) -> Floats:
    """Return the motion of a grip that is held for 0.3 s every 4 s."""
    frames = np.arange(len(grip_m))
    held = frames - np.where(frames % 480 < 36, frames % 480, 0)
    return np.asarray(grip_m[held])


def dead_zone(grip_m: Floats) -> Floats:
    """Return the motion that a transducer reads with a dead zone of 4 mm about neutral."""
    return np.asarray(grip_m - np.clip(grip_m, -2e-3, 2e-3))


THREE_CONTROLS: dict[str, dict[str, float]] = {
    "none": {},
    "a bend of the column": {"controls.column.loader.bend_m_per_N": 2e-4},
    "roll damping": {"flight.roll_damping": 0.7},
    "a bend of the wheel and elevator effectiveness": {
        "controls.wheel.loader.bend_rad_per_N": 2e-3,
        "flight.elevator_effectiveness": 0.8,
    },
}
OUTSIDE = {"an intermittent jam": jams, "a dead zone of the reading": dead_zone}


def spoiled(record: Record, spoil: Callable[[Floats], Floats]) -> Record:
    """Return a record whose grip moves, or is read, as no effect of the library has it."""
    data, at = record.data.copy(), record.channels.index("column_deflection_m")
    data[:, at] = spoil(data[:, at])
    return Record(record.channels, data, record.manifest)


def test_a_diagnosis_by_all_cores_is_that_of_one_and_its_seconds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    load = os.getloadavg()[0]
    monkeypatch.setattr(gaps, "LONG_s", 60.0)
    nominal = gaps.nominal_rig(True)
    figures: dict[str, float] = {}
    for seed, (name, values) in enumerate(CASES.items(), 21):
        record = gaps.made(tmp_path, nominal, values, seed)
        if not figures:
            diagnose(nominal, {"r": record.between(0.0, 12.0)}).as_dict()
        answers = []
        for threads, words in ((1, "one"), (0, "all")):
            wall_s, used_s = time.perf_counter(), time.process_time()
            answers.append(diagnose(nominal, {"r": record}, workers=threads).as_dict())
            figures[f"{name}, processor_s by {words}"] = time.process_time() - used_s
            figures[f"{name}, wall_s by {words}"] = time.perf_counter() - wall_s
        one, both = (figures[f"{name}, wall_s by {words}"] for words in ("one", "all"))
        print(f"\n{name}: {both:.1f} s by all cores, {one:.1f} s by one,", end=" ")
        print(f"{figures[f'{name}, processor_s by one']:.1f} s of a processor")
        assert answers[0] == answers[1]
        assert [effect["name"] for effect in answers[0]["effects"]] == list(values)
    peaks = list[float]()
    for name, spoil in OUTSIDE.items():
        record = spoiled(gaps.made(tmp_path, nominal, {}, 31), spoil)
        wall_s = time.perf_counter()
        found = diagnose(nominal, {"r": record})
        found.as_dict()
        figures[f"{name}, wall_s by all"] = time.perf_counter() - wall_s
        print(f"\n{name}: {figures[f'{name}, wall_s by all']:.1f} s by all cores")
        assert found.verdict == "unexplained"
        write_record(record, tmp_path / "outside.csv")
        nominal.save(tmp_path / "outside.toml")
        command = [sys.executable, "-c", PEAK, "diagnose", "outside.csv", "--rig", "outside.toml"]
        done = subprocess.run(command, cwd=tmp_path, check=True, capture_output=True, text=True)
        peaks.append(float(done.stderr.rpartition("VmHWM:")[2].split()[0]) / 1024.0)
    figures["peak_MB"] = max(peaks)
    print(f"\nthe command at most {figures['peak_MB']:.0f} MB of memory")
    keep("diagnosis of 60 s", figures, load)


def test_the_seconds_of_a_diagnosis_of_three_controls() -> None:
    load = os.getloadavg()[0]
    rig = noisy(coupled.load_rig("c172p"))
    figures: dict[str, float] = {}
    for name, values in THREE_CONTROLS.items():
        record = threecontrols.flown(rig, values, 60.0, pedals=160.0)
        if not figures:
            diagnose(rig, {"r": record.between(0.0, 12.0)}).as_dict()
        wall_s = time.perf_counter()
        found = diagnose(rig, {"r": record})
        found.as_dict()
        figures[name] = time.perf_counter() - wall_s
        print(f"\n{name}: {figures[name]:.1f} s")
        assert len(found.effects) == len(values)
    keep("diagnosis of 60 s of three controls", figures, load)
