"""What a diagnosis of a 60 s record against the whole list takes, and how often it is wrong.

Run alone, with its figures printed:  pytest -m bench -s
"""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest

from coupled.gap.diagnose import diagnose
from coupled.record.record import write_record
from coupled.rig.rigwrite import rig_text
from tests.support import gaps

PEAK = """
import resource, sys
from coupled.cli import main
sys.argv = ["coupled", *sys.argv[1:]]
try:
    main()
finally:
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def peak_mb(folder: Path, *words: str) -> float:
    """Return the most memory that a command had."""
    done = subprocess.run(
        [sys.executable, "-c", PEAK, *words],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    return float(done.stdout.split()[-1])


@pytest.mark.bench
@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("inertia", {"factor": 1.4}),
        ("stribeck_friction", {"friction_N": 2.0, "breakaway_N": 6.0, "stribeck_{d}_per_s": 2e-3}),
        ("pitch_damping", {"factor": 1.4}),
    ],
)
def test_a_diagnosis_costs_less_than_150_flights_of_its_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, values: dict[str, float]
) -> None:
    monkeypatch.setattr(gaps, "LONG_s", 60.0)
    nominal = gaps.nominal_rig(True)
    record = gaps.made(tmp_path, nominal, {name: values}, 21)
    assert record.time_s[-1] > 59.0
    start = time.perf_counter()
    gaps.made(tmp_path, nominal, {name: values}, 21)
    flight = time.perf_counter() - start
    diagnose(nominal, {"r": record.between(0.0, 12.0)}, "column")
    start = time.perf_counter()
    whole = diagnose(nominal, {"r": record})
    whole.as_dict()
    taken = time.perf_counter() - start
    print(f"\n{name}, a 60 s record against every effect: {taken:.1f} s,", end=" ")
    print(f"{taken / flight:.0f} of its flights")
    assert [effect.name for effect in whole.effects] == [name]
    assert taken < 150.0 * flight


@pytest.mark.bench
def test_a_diagnosis_has_less_than_twice_a_flights_memory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gaps, "LONG_s", 60.0)
    nominal = gaps.nominal_rig(True)
    record = gaps.made(tmp_path, nominal, {"inertia": {"factor": 1.4}}, 21)
    write_record(record, tmp_path / "r.csv")
    (tmp_path / "rig.toml").write_text(rig_text(nominal, "a rig"))
    flying = peak_mb(tmp_path, "fly", "pull-up-t37", "-o", "flown.csv")
    peak = peak_mb(tmp_path, "diagnose", "r.csv", "--rig", "./rig.toml", "--json", "d.json")
    print(f"\npeak memory of a diagnosis: {peak:.0f} MB; of a flight of 10 s {flying:.0f} MB")
    assert (tmp_path / "d.json").is_file()
    assert peak < 2.0 * flying


@pytest.mark.slow
def test_false_alarms_on_records_without_an_effect(tmp_path: Path) -> None:
    alarms = 0
    for seed in range(100, 110):
        for flown in (False, True):
            nominal = gaps.nominal_rig(flown)
            record = gaps.made(tmp_path, nominal, {}, seed)
            alarms += diagnose(nominal, {"r": record}).verdict != "no_gap"
    print(f"\nfalse alarms: {alarms} of 20")
    assert alarms == 0
