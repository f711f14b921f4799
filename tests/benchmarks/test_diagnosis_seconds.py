"""What one diagnosis of a 60 s record costs by what is found, in wall and processor seconds.

    OPENBLAS_NUM_THREADS=1 COUPLED_BENCHMARKS=keep \
        pytest -m bench tests/benchmarks/test_diagnosis_seconds.py -s

with the variable that `coupled` sets for its commands: BLAS's own threads take the other core.
Each in this process, with its code compiled before, by one thread and by one a core: the answers
are the same, and the wall seconds of both stand side by side.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from tests.support import gaps
from tests.support.benchmarks import keep

pytestmark = pytest.mark.bench

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
    keep("diagnosis of 60 s", figures, load)
