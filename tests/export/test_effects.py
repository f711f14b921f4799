"""Each key of a rig that the export takes along: it is in the system, and does what it does."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.exporting.comparison import compare
from coupled.exporting.control import control_system
from coupled.exporting.keys import EXPORTED, REFUSED, WITHOUT_EFFECT, check_keys
from coupled.exporting.write import DEFLECTION, FORCE, LOSS
from coupled.flight.manoeuvre import Configuration, Manoeuvre
from coupled.flight.pilot import Step
from coupled.flight.runfile import read_run
from coupled.resources import shipped_rigs
from coupled.rig import parameters
from coupled.rig.rigfile import read_rig
from coupled.schema import Section, file_keys
from tests.support.exported import bench, both, forces, on_bench

LOADER, HOST, SENSES = ("controls.column." + x for x in ("loader", "compensation", "sensing"))
SCHEDULE, RIGGING = "controls.column.schedule", "controls.column.rigging"
VOLTS = {f"{SENSES}.s1_V_per_m": 500.0, f"{SENSES}.s2_V_per_N": 0.25, f"{SENSES}.s3_V_per_N": 0.25}
TWO_SEGMENTS = {
    f"{SCHEDULE}.second_gradient_N_per_m": [300.0, 1300.0],
    f"{SCHEDULE}.break_deflection_m": 0.04,
}

# {key: (a value that is not neutral, what it needs besides)}
EFFECTS: dict[str, tuple[Any, dict[str, Any]]] = {
    f"{LOADER}.mass_kg": (5.0, {}),
    f"{LOADER}.damping_N_s_per_m": (100.0, {}),
    f"{LOADER}.basic_gradient_N_per_m": (600.0, {}),
    f"{LOADER}.breakout_N": (9.0, {}),
    f"{LOADER}.friction_N": (4.0, {}),
    f"{LOADER}.breakaway_N": (7.0, {f"{LOADER}.friction_N": 4.0}),
    f"{LOADER}.stribeck_rate_m_per_s": (
        0.01,
        {f"{LOADER}.friction_N": 4.0, f"{LOADER}.breakaway_N": 7.0},
    ),
    f"{LOADER}.offset_N": (3.0, {}),
    f"{LOADER}.cubic_N_per_m3": (20000.0, {}),
    f"{LOADER}.delay_s": (0.03, {}),
    f"{LOADER}.multiplier": ("digital", {}),
    f"{LOADER}.multiplier_offset_N": (4.0, {}),
    f"{LOADER}.multiplier_drift_N_per_s": (2.0, {}),
    f"{LOADER}.modifying_lag_s": (0.05, {}),
    f"{LOADER}.stop_aft_m": (0.02, {}),
    f"{LOADER}.stop_forward_m": (0.015, {f"{LOADER}.servo_frequency_Hz": 0.0}),
    f"{LOADER}.servo_frequency_Hz": (9.0, {}),
    f"{LOADER}.servo_damping_ratio": (1.2, {}),
    f"{LOADER}.servo_rate_limit_m_per_s": (0.15, {}),
    f"{LOADER}.bend_m_per_N": (8e-5, {}),
    f"{LOADER}.bend_push_m_per_N": (6e-5, {}),
    f"{LOADER}.bend_limit_m": (0.005, {}),
    f"{LOADER}.bend_hysteresis_share": (0.4, {f"{LOADER}.bend_hysteresis_width_N": 20.0}),
    f"{LOADER}.bend_hysteresis_width_N": (20.0, {f"{LOADER}.bend_hysteresis_share": 0.4}),
    f"{LOADER}.play_m": (0.003, {}),
    f"{LOADER}.arc_geometry": (True, {"controls.column.length_m": 0.2}),
    f"{SCHEDULE}.pressure_scale": (0.8, {}),
    f"{SCHEDULE}.pressure_lag_s": (0.4, {}),
    f"{SCHEDULE}.slope": (0.7, {}),
    f"{SCHEDULE}.dynamic_pressure_Pa": ([0.0, 4000.0], {}),
    f"{SCHEDULE}.total_gradient_N_per_m": ([500.0, 2000.0], {}),
    f"{SCHEDULE}.second_gradient_N_per_m": (
        [280.2, 1094.6],
        TWO_SEGMENTS,
    ),
    f"{SCHEDULE}.break_deflection_m": (
        0.03,
        TWO_SEGMENTS,
    ),
    f"{HOST}.bend_m_per_N": (7e-5, {}),
    f"{HOST}.basic_gradient_N_per_m": (500.0, {}),
    f"{HOST}.breakout_N": (6.0, {f"{LOADER}.breakout_N": 9.0}),
    f"{HOST}.breakout_term": ("printed", {f"{LOADER}.breakout_N": 9.0}),
    f"{HOST}.inertia_gradient_N_per_m": (
        [500.0, 2500.0],
        {f"{HOST}.mass_factor": [1.0, 1.3], f"{HOST}.inertia_gradient_N_per_m": [700.0, 2500.0]},
    ),
    f"{HOST}.mass_factor": ([1.0, 1.3], {f"{HOST}.inertia_gradient_N_per_m": [500.0, 2500.0]}),
    f"{HOST}.damping_factor": ([1.0, 1.3], {f"{HOST}.inertia_gradient_N_per_m": [500.0, 2500.0]}),
    f"{HOST}.force_lead_s": ([0.0, 0.01], {f"{HOST}.inertia_gradient_N_per_m": [500.0, 2500.0]}),
    f"{HOST}.force_lead_lag_s": (
        0.01,
        {
            f"{HOST}.inertia_gradient_N_per_m": [500.0, 2500.0],
            f"{HOST}.force_lead_s": [0.0, 0.01],
        },
    ),
    f"{SENSES}.computed_scale": (0.9, {}),
    f"{SENSES}.deflection_scale": (0.9, {}),
    f"{SENSES}.modifying_scale": (0.9, {}),
    f"{SENSES}.force_scale": (0.9, {}),
    f"{SENSES}.word_length_bits": (9, VOLTS),
    f"{SENSES}.full_scale_V": (120.0, {**VOLTS, f"{SENSES}.word_length_bits": 9}),
    f"{SENSES}.s1_V_per_m": (400.0, {**VOLTS, f"{SENSES}.word_length_bits": 9}),
    f"{SENSES}.s2_V_per_N": (0.2, {**VOLTS, f"{SENSES}.word_length_bits": 9}),
    f"{SENSES}.s3_V_per_N": (0.2, {**VOLTS, f"{SENSES}.word_length_bits": 9}),
    f"{RIGGING}.stretch_loss_per_Pa": (2e-5, {}),
    f"{RIGGING}.lag_s": (0.08, {}),
    f"{RIGGING}.rate_limit_norm_per_s": (0.8, {}),
    f"{RIGGING}.play_norm": (0.03, {}),
    f"{RIGGING}.offset_norm": (0.02, {}),
    "controls.column.travel_m": (0.15, {}),
}
TOGETHER = {
    f"{LOADER}.play_m": 0.002,
    f"{LOADER}.servo_rate_limit_m_per_s": 0.25,
    f"{LOADER}.cubic_N_per_m3": 20000.0,
    f"{LOADER}.modifying_lag_s": 0.02,
    f"{LOADER}.delay_s": 0.02,
    f"{SCHEDULE}.pressure_lag_s": 0.2,
    f"{SENSES}.force_scale": 0.95,
    f"{SENSES}.computed_scale": 0.97,
    f"{RIGGING}.lag_s": 0.05,
    f"{RIGGING}.play_norm": 0.02,
}


def hold(changes: dict[str, Any]) -> None:
    """Fly a doublet on the bench, and hold JSBSim's flight against ours."""
    times = [0.0, 0.2, 0.4, 1.2, 1.5, 2.5, 2.8, 4.0]
    push = forces(times, [0.0, 0.0, 70.0, 70.0, -60.0, -60.0, 0.0, 0.0])
    manoeuvre = on_bench(bench(changes), push, 4.0, 2500.0)
    ours, alone, _ = both(manoeuvre)
    found = compare(manoeuvre.configured("compensated"), "compensated", ours, alone)
    assert found.deflection <= DEFLECTION, found
    assert found.estimate <= DEFLECTION, found
    assert max(found.force, found.modifying_force) <= FORCE, found
    assert found.surface <= DEFLECTION, found
    assert abs(found.loss or 0.0) <= LOSS, found


def test_many_effects_together_fly_as_in_our_own_flight() -> None:
    hold(TOGETHER)


@pytest.mark.slow
@pytest.mark.parametrize("key", EFFECTS, ids=lambda key: key.split(".", 2)[2])
def test_an_effect_flies_as_in_our_own_flight(key: str) -> None:
    value, besides = EFFECTS[key]
    hold({**besides, key: value})


def system_text(changes: dict[str, Any]) -> str:
    return control_system(bench(changes), "column", 4).text([])


@pytest.mark.parametrize("key", EFFECTS, ids=lambda key: key.split(".", 2)[2])
def test_a_key_changes_the_system(key: str) -> None:
    value, besides = EFFECTS[key]
    assert system_text({**besides, key: value}) != system_text(besides)


SECTIONS: dict[str, type[Section]] = {
    "loader": parameters.Loader,
    "schedule": parameters.Schedule,
    "compensation": parameters.Compensation,
    "sensing": parameters.Sensing,
    "rigging": parameters.Rigging,
}


def test_every_key_that_is_said_to_be_exported_is_held_here() -> None:
    """But for a control's switches, bob weight and curve, which flights of their own hold."""
    elsewhere = {"deflection", "gradient", "bob_weight", "force"}
    for name, section in SECTIONS.items():
        keys = {field: key for key, field in file_keys(section, "m").items()}
        held = {key.rpartition(".")[2] for key in EFFECTS if f".{name}." in key}
        assert {keys[f] for f in EXPORTED[section] - elsewhere} <= held, name
        assert not EXPORTED[section] & set(REFUSED.get(section, ())), name
        assert not EXPORTED[section] & set(WITHOUT_EFFECT.get(section, ())), name


def test_a_key_that_cannot_be_exported_is_refused_by_name() -> None:
    rig = bench({f"{LOADER}.friction_N": 4.0, f"{LOADER}.friction_stiffness_N_per_m": 1e5})
    with pytest.raises(InputError, match=r"column\.loader\.friction_stiffness_N_per_m: .*0\.0"):
        check_keys(rig, "rig")
    with pytest.raises(InputError, match=r"sensing\.gauge_mass_kg"):
        check_keys(bench({f"{SENSES}.gauge_mass_kg": 0.2}), "rig")


def test_a_key_that_came_to_the_rig_later_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A key that the export does not list is refused."""
    known: dict[type[Section], frozenset[str]] = dict(EXPORTED)
    known[parameters.Loader] -= {"play"}
    monkeypatch.setattr("coupled.exporting.keys.EXPORTED", known)
    assert check_keys(bench(), "rig") == []
    with pytest.raises(
        InputError, match=r"loader\.play_m: is not exported, nor left out in silence"
    ):
        check_keys(bench({f"{LOADER}.play_m": 1e-3}), "rig")


@pytest.mark.parametrize("name", sorted(shipped_rigs()))
def test_every_shipped_rig_is_exported(name: str) -> None:
    rig = read_rig(shipped_rigs()[name])
    assert all("a note of the bench" in line for line in check_keys(rig, name))
    for control in rig.controls:
        assert "<system" in control_system(rig, control, 8).text([])


def test_what_is_left_out_is_said() -> None:
    noisy = bench({"noise": {"column_force_N": 0.1}})
    (left,) = check_keys(noisy, "rig")
    assert left.startswith("noise: ")
    guessed = bench({"controls.column.guesses": ["loader.mass_kg"]})
    (left,) = check_keys(guessed, "rig")
    assert left.startswith("controls.column.guesses: how well the numbers are known")


def joined_controls() -> Manoeuvre:
    """Return six seconds of three controls, of which two bend each other."""
    case, *_ = read_run("three-controls")
    joined = {
        "structure.column_by_wheel_m_per_N": 2e-5,
        "structure.wheel_by_column_rad_per_N": 1e-4,
        "structure.assumed.column_by_wheel_m_per_N": 2e-5,
    }
    return replace(case, rig=case.rig.changed(joined), duration_s=6.0)


def test_a_rigid_structure_does_not_bend_by_another_controls_force() -> None:
    """δ_i = x_i + Σ K_ij·F_j with every K_ij = 0: a column that nobody holds stays at δ = δc."""
    pull = Step(force_N=15.0, start_s=0.5)
    case = replace(joined_controls(), pilots={"wheel": pull}, duration_s=3.0)
    configurations: tuple[Configuration, ...] = ("uncompensated", "rigid")
    deflections = {}
    for configuration in configurations:
        _, alone, _ = both(case, configuration)
        assert np.max(alone["wheel_force_N"]) == pytest.approx(15.0)
        bent = alone["column_deflection_m"] - alone["column_computed_m"]
        deflections[configuration] = bent[alone.time_s > 2.0]
    assert deflections["uncompensated"] == pytest.approx(2e-5 * 15.0, rel=0.01)
    assert np.max(np.abs(deflections["rigid"])) < 1e-6


def test_controls_of_one_structure_bend_each_other() -> None:
    """The wheel's force bends at the column, as in our own flight of it."""
    case = joined_controls()
    ours, alone, _ = both(case)
    bent = ours["column_deflection_m"][ours.time_s > 4.0]
    assert np.ptp(bent) > 3e-4
    found = compare(case.configured("compensated"), "compensated", ours, alone)
    assert found.deflection <= DEFLECTION
    assert found.estimate <= DEFLECTION
