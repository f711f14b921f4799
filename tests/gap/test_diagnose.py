"""Diagnoses of records whose effect is known, of records without one, and of one from outside."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.gap.checks import check_record
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.output import white
from coupled.record.record import Record, write_record
from coupled.rig.rigfile import read_rig
from tests.support.commands import ROOT, coupled
from tests.support.gaps import made, nominal_rig
from tests.support.records import OWN, available, reference
from tests.support.singles import SINGLES

# Those that take longest to tell from their rivals; of each stage others are found in a moment.
LONG = {"viscous_damping", "gradient_error", "cubic_stiffness", "breakout", "bob_weight"}
LONG |= {"force_offset", "digital_multiplier", "transport_delay", "deflection_scale"}
LONG |= {"asymmetric_friction", "load_friction", "relaxation", "friction_ripple"}
LONG |= {"force_scale", "force_zero", "scale_drift", "force_skew", "motion_skew"}
LONG |= {"soft_backlash", "bend_hysteresis", "structural_mode", "force_limit"}
LONG |= {"elevator_effectiveness", "vertical_gust", "coulomb_friction"}
LONG |= {"pitch_stiffness", "lift_slope", "mass", "inertia", "modifying_lag", "presliding_friction"}
LONG |= {"stiffening_bend", "cable_stretch", "surface_freeplay", "rigging_offset"}
LONG |= {"surface_rate_limit", "servo_rate_limit", "pitch_damping"}
LONG |= {"servo_lag", "deflection_zero", "pressure_scale", "bend"}
LONG |= {"backlash"}  # `test_diagnose_on_the_command_line` and tests/test_front_door.py find one

# Forty seconds meet few gusts. The noise of F walks a contact that yields, smoothed as it is.
ROUGHLY = {
    ("vertical_gust", "rms_m_per_s"): 0.25,
    ("presliding_friction", "stiffness_N_per_{d}"): 0.25,
}


def diagnosed(
    folder: Path, flown: bool, values: Mapping[str, Mapping[str, float]], seed: int = 4
) -> Diagnosis:
    nominal = nominal_rig(flown)
    return diagnose(nominal, {"r.csv": made(folder, nominal, values, seed)})


@pytest.mark.parametrize(
    ("flown", "name", "values"),
    [
        pytest.param(*each, id=each[1], marks=[pytest.mark.slow] if each[1] in LONG else [])
        for each in SINGLES
    ],
)
def test_a_single_effect_is_named_at_its_stage_and_size(
    tmp_path: Path, flown: bool, name: str, values: dict[str, float]
) -> None:
    found = diagnosed(tmp_path, flown, {name: values})
    names = {effect.name for effect in found.effects}
    assert names == {name}, found
    assert found.verdict in ("effect", "ambiguous")
    assert found.guilty == (BY_NAME[name].stage,)
    got = {p.name: p.value for effect in found.effects for p in effect.parameters}
    for key, value in values.items():
        measured = got[key.format(d="m")]
        near = ROUGHLY.get((name, key), 0.06)
        assert measured == pytest.approx(value, rel=near), got
    assert found.shrink.closed is not None and found.shrink.closed > 0.95
    assert name.replace("_", " ") in found.summary.lower()
    assert found.curves == ()
    json.dumps(found.as_dict(), allow_nan=False)


@pytest.mark.slow
@pytest.mark.parametrize("pull_N", [3.0, 0.3])
def test_friction_by_direction_is_likelier_than_two_effects_of_the_same_force(
    tmp_path: Path, pull_N: float
) -> None:
    """It is even friction of the mean with a force of half the difference: one effect for two."""
    pair = {"pull_N": pull_N, "push_N": pull_N / 3.0}
    found = diagnosed(tmp_path, False, {"asymmetric_friction": pair}, 5)
    (effect,) = found.effects
    assert effect.name == "asymmetric_friction" and effect.probability > 0.8
    assert found.rivals == (("asymmetric_friction", "coulomb_friction", "force_offset"),)


@pytest.mark.slow
def test_two_effects_at_two_stages_are_both_named(tmp_path: Path) -> None:
    pair = {"inertia": {"factor": 1.4}, "backlash": {"play_{d}": 1e-3}}
    found = diagnosed(tmp_path, False, pair)
    assert {effect.name for effect in found.effects} == set(pair)
    assert found.verdict == "effect"


@pytest.mark.parametrize("flown", [False, True])
@pytest.mark.parametrize(
    "seed", [11, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (12, 13))]
)
def test_without_an_effect_there_is_no_gap(tmp_path: Path, flown: bool, seed: int) -> None:
    found = diagnosed(tmp_path, flown, {}, seed)
    assert found.verdict == "no_gap"
    assert (found.effects, found.curves) == ((), ())
    assert all(stage.gap < 1.15 for stage in found.stages if stage.gap is not None)


def test_an_effect_outside_the_library_is_unexplained_at_its_stage(tmp_path: Path) -> None:
    """A transducer that jumps back and forth by two millimetres now and then."""
    nominal = nominal_rig(False)
    record = made(tmp_path, nominal, {}, 5).between(0.0, 20.0)
    data = record.data.copy()
    at = record.channels.index("column_deflection_m")
    jumps = np.where(np.sin(record.time_s * 9.0) > 0.6, 2e-3, 0.0)
    data[:, at] += jumps - jumps.mean()  # a mean would be a zero that is off
    found = diagnose(nominal, {"r.csv": Record(record.channels, data)}, "column")
    assert found.verdict == "unexplained"
    assert found.guilty == ("linkage",)
    assert found.curves == ()


def test_a_stage_whose_channels_lack_is_not_judged(tmp_path: Path) -> None:
    nominal = nominal_rig(False)
    record = made(tmp_path, nominal, {"backlash": {"play_{d}": 1e-3}}, 6)
    keep = [name for name in record.channels if name != "column_deflection_m"]
    data = np.column_stack([record[name] for name in keep])
    found = diagnose(nominal, {"r.csv": Record(tuple(keep), data)}, "column")
    lacks = {"judged": False, "missing": ["column_deflection_m"]}
    assert found.stage("linkage").as_dict() == lacks
    assert found.verdict == "no_gap"
    keep.remove("column_force_N")
    data = np.column_stack([record[name] for name in keep])
    found = diagnose(nominal, {"r.csv": Record(tuple(keep), data)}, "column")
    assert found.stage("loader").missing == ("column_force_N",)
    assert "Not judged: loader, sensing, linkage, compensation" in found.summary


@pytest.mark.parametrize("name", available())
def test_clean_records_have_no_gap(name: str, tmp_path: Path) -> None:
    """Those of another program where they lie beside the clone, and one flown here."""
    if name == OWN:
        rig = nominal_rig(True)
        record = made(tmp_path, rig, {}, 14)
    else:
        rig, record = reference(name)
    found = diagnose(rig, {"r.csv": record}, "column")
    assert found.verdict == "no_gap", found.stages


def spoiled(record: Record, **changes: Any) -> Record:
    data = record.data.copy()
    for name, change in changes.items():
        at = record.channels.index(name)
        data[:, at] = change(data[:, at])
    return Record(record.channels, data)


def test_bad_records_are_refused_in_one_line(tmp_path: Path) -> None:
    nominal = nominal_rig(False)
    good = made(tmp_path, nominal, {}, 7)
    computed = good["column_computed_m"]
    cases: list[tuple[Record, str]] = [
        (spoiled(good, column_force_N=lambda f: f / 4.448), "it is in pounds"),
        (spoiled(good, column_computed_m=lambda x: 0.0 * x), "never changes"),
        (spoiled(good, column_deflection_m=lambda x: computed), "is a copy of column_computed_m"),
        (spoiled(good, column_deflection_m=lambda x: x * 1000.0), "another unit"),
        (spoiled(good, column_force_N=lambda f: np.where(f > 30.0, np.nan, f)), "holds no number"),
        (spoiled(good, time_s=lambda t: np.where(t > 20.0, t + 1.0, t)), "a gap or a jump after"),
        (spoiled(good, dynamic_pressure_Pa=lambda q: 0.0 * q), "it is stuck"),
        (spoiled(good, time_s=lambda t: t * 2.0), "another rig?"),
        (spoiled(good, time_s=lambda t: t * 1000.0), "is it in milliseconds?"),
        (Record(good.channels, good.data[:400]), "5 s are needed"),
    ]
    for record, says in cases:
        with pytest.raises(InputError, match=says.replace("?", r"\?")) as caught:
            diagnose(nominal, {"r.csv": record}, "column")
        assert str(caught.value).startswith("r.csv: ")


@pytest.mark.parametrize("name", ["elevator_rad", "alpha_rad", "pitch_rad", "pitch_rate_rad_per_s"])
def test_a_motion_in_degrees_is_refused(name: str) -> None:
    """A pitch attitude in degrees was no gap, an elevator in degrees a loss of its effect."""
    rig = nominal_rig(True)
    time_s = np.arange(720) / rig.frame_rate
    swings = np.sin(3.0 * time_s)
    moves = {
        "elevator_rad": 0.07,
        "alpha_rad": 0.065,
        "pitch_rad": 0.4,
        "pitch_rate_rad_per_s": 0.2,
    }
    moved = {**moves, name: np.degrees(moves[name])}
    columns = np.column_stack([time_s, *(size * swings for size in moved.values())])
    record = Record(("time_s", *moved), columns)
    with pytest.raises(InputError, match=rf"r: {name}: reaches .* degrees\?"):
        check_record(rig, record, "column", "r")
    small = np.column_stack([time_s, *(size * swings for size in moves.values())])
    check_record(rig, replace(record, data=small), "column", "r")


def test_effects_are_data_that_leave_the_hosts_values_as_they_are() -> None:
    nominal = nominal_rig(False)
    rig = apply(nominal, "column", [BY_NAME["gradient_error"]], {"gradient_error.factor": 1.1})
    column = rig.controls["column"]
    assert column.loader.basic_gradient == pytest.approx(616.0)
    assert column.compensation.basic_gradient == 560.0
    assert len({effect.name for effect in EFFECTS}) == len(EFFECTS)


def test_the_smoother_takes_noise_off_and_leaves_edges() -> None:
    rng = np.random.default_rng(3)
    t = np.arange(2400) / 120
    smooth = 20.0 * np.sin(3.0 * t) + 10.0 * np.sin(11.0 * t)
    left = smoothed(smooth + rng.normal(0.0, 0.15, len(t))) - smooth
    assert np.std(left) < 0.4 * 0.15
    assert white(smooth + rng.normal(0.0, 0.15, len(t))) == pytest.approx(0.15, rel=0.1)
    edge = np.where(t < 10.0, 0.0, 30.0)
    kept = smoothed(edge + rng.normal(0.0, 0.05, len(t)))
    assert np.mean(np.abs(kept - edge) > 3.0) < 0.01


@pytest.mark.slow
def test_another_rigs_gradients_are_a_gap(tmp_path: Path) -> None:
    nominal = read_rig(ROOT / "aircraft" / "T37" / "report-column.toml")
    record = made(tmp_path, nominal, {"backlash": {"play_{d}": 1e-3}}, 8)
    write_record(record.between(0.0, 15.0), tmp_path / "r.csv")
    done = coupled(tmp_path, "diagnose", "r.csv", "--rig", "bench")
    assert done.returncode == 0
    assert "No gap" not in done.stdout


def test_diagnose_on_the_command_line(tmp_path: Path) -> None:
    rig = ROOT / "aircraft" / "T37" / "report-column.toml"
    nominal = read_rig(rig)
    record = made(tmp_path, nominal, {"backlash": {"play_{d}": 1e-3}}, 8)
    write_record(record.between(0.0, 15.0), tmp_path / "r.csv")
    words = ("diagnose", "r.csv", "--rig", "report-column", "--json", "d.json")
    done = coupled(tmp_path, *words, "--improve", "new.toml")
    assert done.returncode == 0, done.stderr
    assert "of the linkage's gap; the remaining residual is noise" in " ".join(done.stdout.split())
    found = json.loads((tmp_path / "d.json").read_text())
    assert found["effects"][0]["parameters"]["play_m"]["value"] == pytest.approx(1e-3, rel=0.05)
    assert "# changed: loader.play_m 0 → " in (tmp_path / "new.toml").read_text(encoding="utf-8")
    assert read_rig(tmp_path / "new.toml").controls["column"].loader.play == pytest.approx(
        1e-3, rel=0.05
    )
    again = coupled(tmp_path, "diagnose", "r.csv", "--rig", "./new.toml")
    assert "No gap" in again.stdout
    wrong = coupled(tmp_path, "diagnose", "r.csv", "--rig", "report-column", "--control", "wheel")
    assert wrong.returncode == 2
    assert wrong.stderr.count("\n") == 1
