"""Wind in a run: what it does at once, and what of it is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.flight.conditions import Conditions
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.runfile import read_run
from coupled.record.record import Record

RUN = """
name = "windy"
card = "A test."
rig = "{rig}"
duration_s = 2.0

[pilot.column]
kind = "step"
force_N = 0.0

[wind]
{wind}
"""


def scenario(folder: Path, wind: str, rig: str = "report-column") -> Manoeuvre:
    path = folder / "windy.toml"
    path.write_text(RUN.format(rig=rig, wind=wind), encoding="utf-8")
    return read_run(str(path))[0]


def flown(folder: Path, wind: str) -> Record:
    return fly(scenario(folder, wind))


def test_a_tail_wind_takes_airspeed_and_an_updraught_gives_angle_of_attack(tmp_path: Path) -> None:
    still = flown(tmp_path, "time_s = [0.0]\nalong_m_per_s = [0.0]")
    times = "time_s = [0.0, 1.0, 1.02]\n"
    tail = flown(tmp_path, times + "along_m_per_s = [0.0, 0.0, 5.0]")
    up = flown(tmp_path, times + "along_m_per_s = [0.0, 0.0, 0.0]\nup_m_per_s = [0.0, 0.0, 2.0]")
    now = 125  # 1.04 s
    speed = still["true_airspeed_m_per_s"][now]
    assert tail["true_airspeed_m_per_s"][now] == pytest.approx(speed - 5.0, abs=0.1)
    lifted = up["alpha_rad"][now] - still["alpha_rad"][now]
    assert lifted == pytest.approx(2.0 / speed, rel=0.1)
    assert up["load_factor"][now] > still["load_factor"][now] + 0.1
    assert np.array_equal(tail.data[:120], still.data[:120])


def test_no_wind_is_no_different_from_a_wind_of_nothing(tmp_path: Path) -> None:
    nothing = scenario(tmp_path, "time_s = [0.0]\nalong_m_per_s = [0.0]\nup_m_per_s = [0.0]")
    plain = replace(nothing, conditions=Conditions())
    assert np.allclose(fly(nothing).data, fly(plain).data, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("wind", "key", "says"),
    [
        ("time_s = [0.0]", "wind.along_m_per_s", "is missing"),
        ("time_s = []\nalong_m_per_s = []", "wind.time_s", "at least 1 item"),
        ("time_s = [0.0, 0.0]\nalong_m_per_s = [0.0, 1.0]", "wind.time_s", "must rise"),
        ("time_s = [0.0, 1.0]\nalong_m_per_s = [0.0]", "wind.along_m_per_s", "as many values"),
        ("time_s = [0.0]\nalong_m_per_s = [3.0]", "wind.along_m_per_s", "must start at 0"),
        (
            "time_s = [0.0, 1.0]\nalong_m_per_s = [0.0, 0.0]\nup_m_per_s = [0.0, 500.0]",
            "wind.up_m_per_s",
            "beyond ±100",
        ),
        ("time_s = [0.0]\nalong_kt = [0.0]", "wind.along_kt", "along_m_per_s"),
    ],
)
def test_a_fault_is_one_line_with_its_key(tmp_path: Path, wind: str, key: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        scenario(tmp_path, wind)
    assert caught.value.key == key
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_bench_has_nothing_to_blow_on(tmp_path: Path) -> None:
    path = tmp_path / "windy.toml"
    text = RUN.format(rig="bench", wind="time_s = [0.0]\nalong_m_per_s = [0.0]")
    path.write_text(text + "[bench]\ntime_s = [0.0]\ndynamic_pressure_Pa = [3000.0]\n")
    with pytest.raises(InputError, match=r"wind: .* has no aircraft for it"):
        read_run(str(path))
