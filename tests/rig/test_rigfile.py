"""Rig files: what is read, and each fault in one line with its key."""

from __future__ import annotations

import copy
import pickle
from pathlib import Path
from typing import Any

import pytest

from coupled.errors import InputError
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import change, read_rig, rig_from_table
from coupled.rig.rigwrite import rig_text
from coupled.schema import loads_toml
from tests.support.rigs import BENCH, bench

LOADER = "controls.column.loader"
SCHEDULE = "controls.column.schedule"
HOST = "controls.column.compensation"


@pytest.mark.parametrize("name", list(shipped_rigs()))
def test_every_shipped_rig_is_valid(name: str) -> None:
    rig = read_rig(shipped_rigs()[name])
    assert rig.name == name
    assert rig.substeps * rig.frame_rate >= 2000.0


@pytest.mark.parametrize("name", list(shipped_rigs()))
def test_a_rig_written_is_read_back_the_same(name: str, tmp_path: Path) -> None:
    rig = read_rig(shipped_rigs()[name])
    path = tmp_path / "again.toml"
    path.write_text(rig_text(rig, "A copy.\nOf two lines."), encoding="utf-8")
    assert read_rig(path) == rig
    noisy = rig.changed({"noise": {"column_force_N": 0.1}})
    path.write_text(rig_text(noisy), encoding="utf-8")
    assert read_rig(path) == noisy


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        (f"{LOADER}.mass_kg", 0.0, "greater than 0"),
        (f"{LOADER}.mass_kg", "4", "valid number"),
        (f"{LOADER}.mass_kg", True, "valid number"),
        (f"{LOADER}.mass_kg", 1e-320, "smaller than any real one"),
        (f"{LOADER}.bend_m_per_N", 5e-324, "smaller than any real one"),
        (f"{LOADER}.arc_geometry", 1, "valid boolean"),
        (f"{SCHEDULE}.total_gradient_N_per_m", [560.0, True], "valid number"),
        (f"{SCHEDULE}.total_gradient_N_per_m", [1e-310, 560.0], "smaller than any real one"),
        ("controls.column.travel_m", 1e-320, "smaller than any real one"),
        ("controls.column.sensing.word_length_bits", True, "valid integer"),
        ("controls.column.sensing.word_length_bits", 12.0, "valid integer"),
        ("noise.column_force_N", True, "valid number"),
        ("noise.column_force_N", 1e-320, "smaller than any real one"),
        (f"{LOADER}.damping_N_s_per_m", -1.0, "greater than or equal to 0"),
        (f"{LOADER}.bend_m_per_N", float("nan"), "finite"),
        (f"{LOADER}.bend_m_per_N", float("inf"), "finite"),
        (f"{LOADER}.bend_in_per_lb", 0.016, "give bend_m_per_N instead"),
        (f"{LOADER}.friction", 2.0, "give friction_N instead"),
        (f"{LOADER}.frction_N", 2.0, "did you mean friction_N?"),
        (f"{LOADER}.breakaway_N", 1.0, "below friction_N"),
        (f"{LOADER}.multiplier", "analog", "'hybrid' or 'digital'"),
        (f"{LOADER}.delay_s", 5.0, "less than or equal to 0.2"),
        ("controls.column.travel_in", 7.0, "give travel_m instead"),
        ("controls.column.surface", "rudder", "moves the elevator"),
        ("controls.colunm", {}, "did you mean column?"),
        (f"{SCHEDULE}.dynamic_pressure_Pa", [0.0, 3000.0, 2000.0], "must rise"),
        (f"{SCHEDULE}.dynamic_pressure_psf", [0.0, 60.0], "give dynamic_pressure_Pa"),
        (f"{SCHEDULE}.total_gradient_N_per_m", [560.0], "has 1 values"),
        (f"{SCHEDULE}.total_gradient_N_per_m", [560.0, -3.0], "cannot be negative"),
        (f"{SCHEDULE}.total_gradient_N_per_m", [560.0, "stiff"], "valid number"),
        (f"{SCHEDULE}.break_deflection_m", 0.05, "second segment needs both"),
        (f"{HOST}.deflection", 1, "valid boolean"),
        ("frame_rate_Hz", 0.0, "greater than or equal to 1"),
        ("frame_rate_kHz", 0.1, "give frame_rate_Hz instead"),
        ("noise.column_force_lb", 0.1, "no such channel"),
        ("noise.column_force_N", -0.1, "cannot be negative"),
        ("flight", {"model": "c172p"}, "is missing"),
        ("flight", 3, "should be a table"),
        ("controls.column.sensing.word_length_bits", 12, "must be given"),
        ("controls.column.sensing.force_scale", 0.0, "greater than 0"),
        ("controls.column.gains.mechanical_advantage", -1.0, "greater than 0"),
        ("controls.column.gains.s1_over_s2_N_per_m", "1", "valid number"),
        ("controls.column.gains.s1_over_s3", 1.0, "unknown key"),
        ("controls.column.calibration.bend_in_per_lb", 0.016, "give bend_m_per_N instead"),
        ("controls.column.calibration.readings", -1, "greater than or equal to 0"),
        ("controls.column.calibration.date", "a\nb", "one line of at most 40 characters"),
    ],
)
def test_a_fault_is_one_line_with_its_key(key: str, value: Any, says: str) -> None:
    table = copy.deepcopy(BENCH)
    change(table, key, value)
    if key.endswith("breakaway_N"):
        change(table, f"{LOADER}.friction_N", 3.0)
    with pytest.raises(InputError) as caught:
        rig_from_table(table, "my-rig.toml")
    text = str(caught.value)
    assert text.startswith("my-rig.toml: ")
    assert key.rsplit(".", maxsplit=1)[-1] in text
    assert says in text
    assert "\n" not in text


def test_a_converter_is_held_against_what_the_scale_makes_of_the_travel() -> None:
    """500 V/m on 0.1778 m is 88.9 V, and 222 V as a scale of 2.5 has it read: beyond 200 V."""
    sensing = "controls.column.sensing"
    scales = {"s1_V_per_m": 500.0, "s2_V_per_N": 0.2, "s3_V_per_N": 0.2}
    table = {"word_length_bits": 12, "full_scale_V": 200.0, "deflection_scale": 2.5, **scales}
    with pytest.raises(InputError) as caught:
        bench({sensing: table})
    assert "s1_V_per_m: full travel reads 222.2 V at deflection_scale = 2.5" in str(caught.value)
    assert "beyond the converter's 200 V; give at most 449.9" in str(caught.value)
    assert bench({sensing: {**table, "s1_V_per_m": 449.9}})
    with pytest.raises(InputError, match=r"reads 213\.4 V, beyond"):
        bench({sensing: {**table, "s1_V_per_m": 1200.0, "deflection_scale": 1.0}})


@pytest.mark.parametrize("where", [LOADER, HOST])
@pytest.mark.parametrize("table", ["total_gradient_N_per_m", "second_gradient_N_per_m"])
def test_no_gradient_stiffer_than_the_structure(where: str, table: str) -> None:
    changes: dict[str, Any] = {f"{HOST}.bend_m_per_N": 0.0, f"{where}.bend_m_per_N": 1 / 2500.0}
    changes[f"{SCHEDULE}.{table}"] = [560.0, 2600.0]
    if table.startswith("second"):
        changes[f"{SCHEDULE}.break_deflection_m"] = 0.05
        changes[f"{SCHEDULE}.total_gradient_N_per_m"] = [560.0, 2000.0]
    with pytest.raises(InputError, match=r"K·G_T = 1\.04 at 3000 Pa.*must stay below 0\.000385"):
        bench(changes)


def test_a_structure_softer_than_the_host_assumes_may_be_as_soft_as_it_is() -> None:
    """Eq. (12) is singular in K̂ alone: a real K beyond it is what a diagnosis has to find."""
    soft = {f"{LOADER}.bend_m_per_N": 1 / 2500.0, f"{SCHEDULE}.total_gradient_N_per_m": [560, 2600]}
    assert bench(soft).controls["column"].loader.bend == 1 / 2500.0


def test_a_file_that_is_not_a_rig_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    with pytest.raises(InputError, match="cannot be read"):
        read_rig(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        read_rig(path)
    path.write_text("name = ")
    with pytest.raises(InputError, match="not valid TOML"):
        read_rig(path)
    path.write_text("")
    with pytest.raises(InputError, match="controls: needs at least one"):
        read_rig(path)


def test_a_wheel_is_in_radians() -> None:
    table = copy.deepcopy(BENCH)
    column = table["controls"].pop("column")
    wheel: dict[str, Any] = {"surface": "aileron", "travel_rad": 1.5}
    for section in ("loader", "schedule", "compensation"):
        wheel[section] = {
            key.replace("_m_per_N", "_rad_per_N").replace("_per_m", "_per_rad"): value
            for key, value in column[section].items()
        }
    wheel["loader"]["bend_rad_per_N"] = wheel["compensation"]["bend_rad_per_N"] = 1e-4
    table["controls"]["wheel"] = wheel
    assert rig_from_table(table, "t").controls["wheel"].travel == 1.5
    wheel["travel_m"] = wheel.pop("travel_rad")
    with pytest.raises(InputError, match="give travel_rad instead"):
        rig_from_table(table, "t")


FAULTY = """
name = "my rig"
frame_rate = 120
[flight]
model = "T37"
altitude_m = "high"
calibrated_airspeed_m_per_s = 100.0
[controls.column]
surface = "elevator"
travel_in = 7
[controls.column.loader]
mass_kg = -4.0
damping_N_s_per_m = 75.0
basic_gradient_N_per_m = 560.4
servo_frequency_Hz = 18.0
servo_dampng_ratio = 0.7
[controls.column.schedule]
dynamic_pressure_Pa = [0.0, 1.0]
"""


def test_all_faults_of_a_file_are_named_at_once_and_each_once() -> None:
    with pytest.raises(InputError) as fault:
        rig_from_table(loads_toml(FAULTY, "f"), "f")
    column = "controls.column"
    assert [one.key for one in fault.value.every] == [
        "frame_rate",
        f"{column}.travel_in",
        f"{column}.loader.servo_dampng_ratio",
        f"{column}.loader.mass_kg",
        f"{column}.schedule.total_gradient_N_per_m",
        f"{column}.compensation",
        "flight.altitude_m",
        "name",
    ]
    assert str(fault.value) == "f: frame_rate: wrong unit: give frame_rate_Hz instead"
    assert pickle.loads(pickle.dumps(fault.value)).every[-1].key == "name"
