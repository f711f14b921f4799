"""What a diagnosis of a 60 s record against the whole list takes, and how often it is wrong.

Run alone, with its figures printed:  pytest tests/benchmarks -s
"""

from __future__ import annotations

import time
from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from tests.gap import made


def test_a_60_s_record_is_diagnosed_in_under_10_s(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(made, "LONG_s", 60.0)
    nominal = made.nominal_rig(True)
    record = made.made(tmp_path, nominal, {"inertia": {"factor": 1.4}}, 21)
    assert record.time_s[-1] > 59.0
    diagnose(nominal, {"r": record.between(0.0, 12.0)}, "column")
    start = time.perf_counter()
    found = diagnose(nominal, {"r": record}, "column").found
    taken = time.perf_counter() - start
    print(f"\na 60 s record against every effect: {taken:.1f} s, {found['verdict']}")
    assert [effect["name"] for effect in found["effects"]] == ["inertia"]
    assert taken < 10.0


def test_false_alarms_on_records_without_an_effect(tmp_path: Path) -> None:
    alarms = 0
    for seed in range(100, 110):
        for flown in (False, True):
            nominal = made.nominal_rig(flown)
            record = made.made(tmp_path, nominal, {}, seed)
            found = diagnose(nominal, {"r": record}, "column").found
            alarms += found["verdict"] != "no_gap"
    print(f"\nfalse alarms: {alarms} of 20")
    assert alarms == 0
