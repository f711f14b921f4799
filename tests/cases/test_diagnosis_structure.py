"""Records without δc, machines without a servo, stops within the travel: what each answer must be.

The records of `no-computed-deflection` are of an independent simulation of a bench without a servo:
4 kg, 60 N·s/m, 1401 N/m, a breakout of 8.9 N, K of 5.71e-5 m/N, and in `bend.csv` 1.6 times that.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.authority.stability.linear import growth as linear_growth
from coupled.authority.stability.planes import linear_rig
from coupled.errors import InputError
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.flown import fly_force
from coupled.gap.nominal import fit_nominal
from coupled.record.record import Record, read_record
from coupled.resources import find, shipped_rigs
from coupled.rig.growth import growth as simulated_growth
from coupled.rig.packing import Hand
from coupled.rig.replay import replay_linkage
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig, rig_from_table
from coupled.rig.rigwrite import rig_text
from coupled.schema import loads_toml
from tests.support.rigs import K_REPORT, bench, push

Floats = NDArray[np.float64]
CASES = Path(__file__).parents[1] / "data" / "cases"
BENCH_FOLDER = CASES / "no-computed-deflection"
SERVO = "controls.column.loader.servo_frequency_Hz"
BEND = "controls.column.loader.bend_m_per_N"
COMPUTED = "column_computed_m"
RATE_Hz, STILL_Pa = 100.0, 0.0


def measured_bench(name: str) -> Record:
    return read_record(BENCH_FOLDER / name)


def bench_rig(servo_Hz: float = 0.0) -> Rig:
    return read_rig(BENCH_FOLDER / "rig-18Hz.toml").changed({SERVO: servo_Hz})


def lacking(record: Record, *names: str) -> Record:
    kept = [name for name in record.channels if name not in names]
    return Record(tuple(kept), np.column_stack([record[name] for name in kept]))


def moved(
    rig: Rig, seconds: float = 25.0, rates_Hz: tuple[float, float] = (0.3, 1.4), seed: int = 1
) -> Record:
    """Return the record of a bench under two sines of force: F and δ with noise, and no δc."""
    noise = {"noise.column_force_N": 0.15, "noise.column_deflection_m": 2e-5}
    times = np.arange(round(seconds * rig.frame_rate)) / rig.frame_rate
    slow, fast = (np.sin(2.0 * np.pi * f * times) for f in rates_Hz)
    force = (30.0 * slow + 15.0 * fast) * np.minimum(times, 1.0)
    flown = fly_force(
        rig.changed(noise), {"column": force}, np.full(len(times), STILL_Pa), seed=seed
    )
    kept = ("time_s", "column_force_N", "column_deflection_m", "dynamic_pressure_Pa")
    return Record(kept, np.column_stack([flown[name] for name in kept]))


def plain(**changes: Any) -> Rig:
    return bench({"friction_N": 0.0, "breakout_N": 0.0, **changes})


def named(found: Diagnosis) -> list[str]:
    return [effect.name for effect in found.effects]


# Records without δc.


def test_a_healthy_bench_without_computed_deflection_has_no_gap() -> None:
    found = diagnose(bench_rig(), {"r": lacking(measured_bench("well.csv"), COMPUTED)})
    assert found.verdict == "no_gap"
    assert found.stage("loader").gap == pytest.approx(1.0, abs=0.2)
    assert found.stage("linkage").why == "see loader"
    assert "linkage" not in found.summary.partition("Not judged")[2]


@pytest.mark.slow
def test_a_bend_is_found_without_computed_deflection() -> None:
    found = diagnose(bench_rig(), {"r": lacking(measured_bench("bend.csv"), COMPUTED)})
    assert (found.verdict, named(found)) == ("effect", ["bend"])
    assert found.effects[0].value == pytest.approx(1.6 * 5.71e-5, rel=0.02)
    assert found.guilty == ("linkage",)


@pytest.mark.parametrize("drive", ["force", "displacement"])
def test_a_sprung_loader_is_healthy_whoever_moves_it(drive: str) -> None:
    rig = plain(breakout_N=3.0, friction_N=2.0)
    filed = rig.changed({"controls.column.drive": drive})
    found = diagnose(filed, {"r": moved(rig)})
    assert found.verdict == "no_gap"
    assert found.stage("loader").gap == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "changes", "value"),
    [
        ("bend", {"bend_m_per_N": 1.5 * K_REPORT}, 1.5 * K_REPORT),
        ("coulomb_friction", {"friction_N": 4.0}, 4.0),
        ("backlash", {"play_m": 1e-3}, 1e-3),
    ],
)
def test_effects_of_loader_and_linkage_are_found_from_force_and_grip_alone(
    effect: str, changes: dict[str, float], value: float
) -> None:
    found = diagnose(plain(), {"r": moved(plain(**changes))})
    assert (found.verdict, named(found)) == ("effect", [effect])
    assert found.effects[0].value == pytest.approx(value, rel=0.03)


@pytest.mark.slow
def test_a_play_that_a_bench_takes_up_lies_on_the_side_of_the_force() -> None:
    """By hand: a bench pulls, so δ = x + sgn(F)·play/2 + K·F."""
    record, play = moved(plain()), 1.5e-3
    data = np.column_stack([record[name] for name in record.channels])
    at = record.channels.index("column_deflection_m")
    data[:, at] += 0.5 * play * np.sign(record["column_force_N"])
    rig = plain().changed({"controls.column.drive": "displacement"})
    found = diagnose(rig, {"r": Record(record.channels, data)})
    assert (found.verdict, named(found)) == ("effect", ["backlash"])
    assert found.effects[0].value == pytest.approx(play, rel=0.02)


@pytest.mark.slow
def test_of_a_static_record_bend_and_scale_of_the_force_are_one_number() -> None:
    light = {"mass_kg": 1.0, "damping_N_s_per_m": 2.0}
    record = moved(plain(**light, bend_m_per_N=1.5 * K_REPORT), 60.0, (0.02, 0.03))
    found = diagnose(plain(**light), {"r": record})
    assert found.verdict == "ambiguous"
    assert any({"bend", "force_scale"} <= set(group) for group in found.rivals)
    assert "does not distinguish" in found.summary


# Machines without a servo.


def test_a_machine_without_a_servo_has_no_gap_by_a_rig_without_one() -> None:
    found = diagnose(bench_rig(), {"r": measured_bench("well.csv")})
    assert found.verdict == "no_gap"
    assert found.stage("linkage").gap == pytest.approx(1.0, abs=0.2)


@pytest.mark.parametrize("filed_Hz", [18.0, pytest.param(60.0, marks=pytest.mark.slow)])
def test_the_absence_of_a_servo_is_named(filed_Hz: float) -> None:
    found = diagnose(bench_rig(filed_Hz), {"r": measured_bench("well.csv")})
    assert (found.verdict, named(found)) == ("effect", ["no_servo"])
    assert found.guilty == ("linkage",)
    assert f"Set {SERVO} in the rig file to 0.0." in found.summary
    improved, true = (rig.controls["column"].loader for rig in (found.improved, bench_rig()))
    assert improved.servo_frequency == true.servo_frequency == 0.0
    assert improved.mass == pytest.approx(true.mass, rel=0.01)  # within its tolerance


@pytest.mark.slow
def test_a_servo_that_a_rig_file_lacks_is_found_by_its_frequency() -> None:
    record = moved(plain(servo_frequency_Hz=9.0))
    found = diagnose(plain(servo_frequency_Hz=0.0), {"r": record})
    assert named(found)[0] == "servo_lag"
    [number] = found.effects[0].parameters
    assert number.name == "frequency_Hz"
    assert number.value == pytest.approx(9.0, rel=0.05)


def test_a_fitted_servo_that_would_ring_is_doubted() -> None:
    keys = ["loader.servo_frequency_Hz", "loader.servo_damping_ratio"]
    fitted = fit_nominal(bench_rig(18.0), {"r": measured_bench("well.csv")}, keys)
    assert fitted.rig.controls["column"].loader.servo_damping_ratio < 0.1
    [doubt] = fitted.doubts
    assert "is no servo: a servo's damping ratio is at least 0.1" in doubt
    assert "without a servo the held-out stretches are predicted as well" in doubt
    assert fitted.as_dict()["doubts"] == [doubt]


def test_a_servo_that_is_there_is_not_doubted() -> None:
    keys = ["loader.servo_frequency_Hz", "loader.servo_damping_ratio"]
    fitted = fit_nominal(plain(servo_frequency_Hz=16.0), {"r": moved(plain())}, keys)
    assert fitted.numbers[0].found == pytest.approx(18.0, rel=0.1)
    assert fitted.doubts == ()


@pytest.mark.slow
def test_without_a_servo_none_is_fitted_by_default() -> None:
    fitted = fit_nominal(bench_rig(), {"r": lacking(measured_bench("well.csv"), COMPUTED)})
    keys = {number.key for number in fitted.numbers}
    assert not any("servo" in key for key in keys)
    assert "loader.bend_m_per_N" in keys  # which shows in the loader's output


@pytest.mark.parametrize(
    ("lines", "key"),
    [
        ("servo_damping_ratio = 0.7", "servo_frequency_Hz: is missing beside servo_damping_ratio"),
        ("servo_frequency_Hz = 18.0", "servo_damping_ratio: is missing beside servo_frequency_Hz"),
        ("servo_rate_share = 0.5", "servo_rate_share: needs a servo"),
        ("servo_acceleration_limit_m_per_s2 = 3.0", "servo_acceleration_limit_m_per_s2: needs a"),
    ],
)
def test_half_a_servo_is_refused(tmp_path: Path, lines: str, key: str) -> None:
    text = (BENCH_FOLDER / "rig-18Hz.toml").read_text(encoding="utf-8")
    whole = "servo_frequency_Hz = 18\nservo_damping_ratio = 0.7\n"
    assert whole in text
    file = tmp_path / "rig.toml"
    file.write_text(text.replace(whole, lines + "\n"), encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(f"controls.column.loader.{key}")):
        read_rig(file)


def test_the_mass_beyond_a_gauge_needs_a_servo() -> None:
    with pytest.raises(InputError, match=r"sensing\.gauge_mass_kg: needs a servo"):
        bench_rig().changed({"controls.column.sensing.gauge_mass_kg": 0.5})


# Stops within the travel.


@pytest.mark.slow
def test_stops_within_the_travel_are_found_on_both_sides() -> None:
    record = read_record(CASES / "stop-inside-travel" / "rec.csv")
    found = diagnose(read_rig(find("report-column", shipped_rigs(), "rig")), {"r": record})
    assert named(found) == ["travel"]
    sizes = {p.name: p.value for p in found.effects[0].parameters}
    assert sizes == pytest.approx({"aft_m": 0.02, "forward_m": 0.02}, rel=0.01)
    assert found.guilty == ("loader",)


@pytest.mark.slow
def test_a_stop_on_one_side_leaves_the_other_at_the_travel() -> None:
    rig = plain()
    record = moved(plain(stop_aft_m=0.03))
    found = diagnose(rig, {"r": record})
    assert (found.verdict, named(found)) == ("effect", ["travel"])
    sizes = {p.name: p.value for p in found.effects[0].parameters}
    assert sizes["aft_m"] == pytest.approx(0.03, rel=0.01)
    assert sizes["forward_m"] == pytest.approx(rig.controls["column"].travel)
    assert "aft none → 0.03 m, forward no limit reached" in found.summary


def test_a_wheel_stops_in_radians_and_a_column_in_metres() -> None:
    aft, forward = BY_NAME["travel"].free
    assert (aft.named("wheel"), forward.named("column")) == ("aft_rad", "forward_m")
    assert aft.key_on("wheel") == "loader.stop_aft_rad"


@pytest.mark.parametrize(("force_N", "wanted_m"), [(60.0, 0.02), (-60.0, -0.03)])
def test_a_loader_stops_where_each_side_has_its_stop(force_N: float, wanted_m: float) -> None:
    """Both are less than the travel, and than the 60/560 m to which the spring would yield."""
    rig = plain(stop_aft_m=0.02, stop_forward_m=0.03)
    assert push(rig, force_N, 2.0)[-1] == wanted_m


def test_a_stop_beyond_the_travel_is_none() -> None:
    rig = plain(stop_aft_m=9.0)
    assert push(rig, 150.0, 2.0)[-1] == rig.controls["column"].travel  # 150/560 m is beyond


def test_a_grip_without_a_servo_is_where_the_computed_deflection_is() -> None:
    rig = plain(servo_frequency_Hz=0.0, bend_m_per_N=0.0)
    computed = 0.01 * np.sin(np.arange(200) / 9.0)
    assert replay_linkage(rig, "column", computed, np.zeros(200)) == pytest.approx(computed)


def test_a_rig_without_a_servo_reads_back_as_it_was_written() -> None:
    rig = plain(servo_frequency_Hz=0.0)
    assert rig_from_table(loads_toml(rig_text(rig), "text"), "text") == rig


def test_without_a_servo_a_free_loader_dies_by_half_its_damping_over_its_mass() -> None:
    """A closed form, c/(2·m) = 75/8 1/s, of a mass on a spring with damping below critical."""
    rig = linear_rig(plain(servo_frequency_Hz=0.0), "column", 560.0)
    assert linear_growth(rig, Hand()) == pytest.approx(-75.0 / 8.0)
    assert simulated_growth(rig, Hand(), 3.0) == pytest.approx(-75.0 / 8.0, rel=0.01)
