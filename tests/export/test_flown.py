"""An exported rig, flown by JSBSim in a process that has not our package, beside our own flight."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.exporting.comparison import compare
from coupled.exporting.write import DEFLECTION, FORCE, LOSS
from coupled.flight.runfile import read_run
from coupled.resources import shipped_runs
from tests.support.exported import bench, both, forces, on_bench


def test_a_pull_on_the_t37_is_the_same_channel_by_channel() -> None:
    _, middle, _ = read_run("pull-up-t37")
    ours, alone, said = both(middle)
    assert said == ""  # no message of JSBSim's at load, at trim or in flight
    found = compare(middle.configured("compensated"), "compensated", ours, alone)
    assert found.deflection < 0.001
    assert found.estimate < 0.001
    assert found.modifying_force < 0.005
    assert found.force < 1e-6
    assert abs(found.loss or 0.0) < 1e-4
    for channel, most in (
        ("column_gradient_N_per_m", 1.0),
        ("column_computed_m", 1e-4),
        ("load_factor", 1e-3),
        ("pitch_rad", 1e-4),
        ("elevator_rad", 1e-3),
        ("altitude_m", 0.05),
    ):
        assert np.max(np.abs(alone[channel] - ours[channel])) < most, channel
    assert np.ptp(ours["load_factor"]) > 1.0  # it was a pull


# What holds still by friction, and what a cycle loses: the closed forms of dry friction.


def test_a_control_inside_its_friction_does_not_creep() -> None:
    rig = bench({"controls.column.loader.friction_N": 4.0})
    _, alone, _ = both(on_bench(rig, forces([0.0, 0.1, 12.0], [0.0, 3.9, 3.9]), 12.0))
    assert np.max(np.abs(alone["column_force_N"])) == pytest.approx(3.9, rel=1e-9)
    assert np.all(alone["column_computed_m"] == 0.0)


def test_friction_keeps_twice_its_force_between_going_and_coming() -> None:
    """Pulled out and let back slowly, δc differs by 2·F_c/k at the same force."""
    friction_N = 4.0
    rig = bench({"controls.column.loader.friction_N": friction_N})
    slow = on_bench(rig, forces([0.0, 20.0, 40.0], [0.0, 60.0, 0.0]), 40.0)
    _, alone, _ = both(slow, "uncompensated")
    at = np.searchsorted(alone.time_s, [10.0, 30.0])
    out, back = alone["column_computed_m"][at]
    gradient = alone["column_gradient_N_per_m"][0]
    # A creep of 3 N/s against c leaves 75·(3/2189) = 0.1 N on either side.
    assert back - out == pytest.approx((2.0 * friction_N + 0.2) / gradient, rel=0.005)


def test_a_breakaway_above_friction_holds_longer_than_it_rubs() -> None:
    """From rest it holds to F_s; in slow motion the force is F_c + k·δc + c·δc'."""
    changes = {"friction_N": 3.0, "breakaway_N": 8.0, "stribeck_rate_m_per_s": 0.002}
    rig = bench({f"controls.column.loader.{key}": value for key, value in changes.items()})
    _, alone, _ = both(on_bench(rig, forces([0.0, 10.0], [0.0, 50.0]), 10.0), "uncompensated")
    force, computed = alone["column_force_N"], alone["column_computed_m"]
    left = int(np.argmax(computed != 0.0))
    assert force[left] == pytest.approx(8.0, abs=0.1)
    ours, alone, _ = both(on_bench(rig, forces([0.0, 2.0], [0.0, 50.0]), 3.0))
    assert np.max(np.abs(alone["column_deflection_m"] - ours["column_deflection_m"])) < 0.0018


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_friction_falls_with_the_square_of_the_speed(share: float) -> None:
    """Sliding evenly at v, F − G·δc − c·v = F_c + (F_s − F_c)·exp(−(v/v_s)²)."""
    running_N, breakaway_N, fades_m_per_s = 3.0, 9.0, 0.1
    gradient, damping = 2000.0, 150.0
    changes = {
        "loader.friction_N": running_N,
        "loader.breakaway_N": breakaway_N,
        "loader.stribeck_rate_m_per_s": fades_m_per_s,
        "loader.damping_N_s_per_m": damping,
        "schedule.total_gradient_N_per_m": [gradient, gradient],
        "schedule.dynamic_pressure_Pa": [0.0, 4000.0],
    }
    rig = bench({f"controls.column.{key}": value for key, value in changes.items()})
    speed = share * fades_m_per_s
    seconds = 0.15 / speed
    pull = forces([0.0, seconds], [0.0, gradient * speed * seconds])
    _, alone, _ = both(on_bench(rig, pull, seconds), "uncompensated")
    even = alone.time_s > 0.7 * seconds
    computed = alone["column_computed_m"][even]
    found = np.polyfit(alone.time_s[even], computed, 1)[0]
    assert found == pytest.approx(speed, rel=0.01)
    friction = alone["column_force_N"][even] - gradient * computed - damping * found
    wanted = running_N + (breakaway_N - running_N) * np.exp(-(share**2))
    assert np.mean(friction) == pytest.approx(wanted, abs=0.15)


def test_a_breakout_holds_neutral_and_then_follows_its_line() -> None:
    """F = F_BO + G·δ, however slowly; below F_BO the grip moves by the bend alone."""
    rig = bench({"controls.column.loader.breakout_N": 9.0})
    _, alone, _ = both(on_bench(rig, forces([0.0, 30.0], [0.0, 120.0]), 30.0))
    force, computed = alone["column_force_N"], alone["column_computed_m"]
    assert np.all(computed[force < 9.0] == 0.0)
    at = int(np.searchsorted(force, 100.0))
    gradient, bend = alone["column_gradient_N_per_m"][at], 9.136e-5
    rate_N = 75.0 * 4.0 / (gradient / (1.0 - bend * gradient))  # c·δc'
    wanted = (force[at] - rate_N - 9.0) / gradient
    assert alone["column_deflection_m"][at] == pytest.approx(wanted, rel=2e-3)


def test_a_stop_holds_the_loader_at_its_travel() -> None:
    rig = bench()
    pull = forces([0.0, 0.3, 1.5, 1.8, 4.0], [0.0, 900.0, 900.0, 0.0, 0.0])
    ours, alone, _ = both(on_bench(rig, pull, 4.0))
    travel = rig.controls["column"].travel
    held = (alone.time_s > 1.0) & (alone.time_s < 1.5)
    assert np.all(alone["column_computed_m"][held] == travel)
    assert np.max(np.abs(alone["column_computed_m"])) == travel
    off = np.abs(alone["column_deflection_m"] - ours["column_deflection_m"])
    assert np.max(off) < DEFLECTION * travel


def test_a_digital_product_is_held_over_a_frame_and_a_hybrid_one_is_not() -> None:
    """At 20 Hz δc moves within a frame; the digital product stands, so the loader overshoots."""
    runs = {case.label: case for case in read_run("multiplier")}
    digital, hybrid = runs["digital 20 Hz"], runs["hybrid 20 Hz"]
    flights = {case.label: both(case) for case in (digital, hybrid)}
    for case in (digital, hybrid):
        ours, alone, _ = flights[case.label]
        found = compare(case.configured("compensated"), "compensated", ours, alone)
        assert found.deflection < 0.001
        assert found.modifying_force < 0.005
    # The two are told apart by far more than that.
    apart = flights[digital.label][1]["column_computed_m"]
    apart = apart - flights[hybrid.label][1]["column_computed_m"]
    assert np.max(np.abs(apart)) > 0.01 * digital.rig.controls["column"].travel


def test_a_bob_weight_pulls_against_the_load() -> None:
    """b·(n_z − 1) more force for the same place: without b the same pull goes further."""
    low, *_ = read_run("pull-up-c172p")
    weightless = low.rig.changed({"controls.column.loader.bob_weight_N_per_g": 0.0})
    flights = [both(case) for case in (low, replace(low, rig=weightless))]
    travel = low.rig.controls["column"].travel
    for ours, alone, _ in flights:
        off = np.abs(alone["column_deflection_m"] - ours["column_deflection_m"])
        assert np.max(off) < 0.001 * travel
    with_it, without = (alone["column_deflection_m"] for _, alone, _ in flights)
    assert np.max(np.abs(with_it - without)) > 0.02 * travel


@pytest.mark.slow
@pytest.mark.parametrize("run", sorted(shipped_runs()))
def test_every_shipped_run_flies_in_jsbsim_alone_as_in_ours(run: str) -> None:
    """Or its rig or its events are refused by a key of theirs: the loader's services."""
    for case in read_run(run):
        for configuration in case.configurations:
            if configuration == "calibrated low":
                continue
            place = (case.label, configuration)
            try:
                ours, alone, said = both(case, configuration)
            except InputError as error:
                assert error.key.startswith(("controls.column.services.", "event.")), place
                continue
            found = compare(case.configured(configuration), configuration, ours, alone)
            assert said == "", place
            assert found.deflection <= DEFLECTION, place
            assert max(found.force, found.modifying_force) <= FORCE, place
            assert abs(found.loss or 0.0) <= LOSS, place


def test_a_service_is_refused_by_name() -> None:
    """Those of the loader: an event of one, and a key of one."""
    failure, *_ = read_run("feel-failure")
    with pytest.raises(InputError, match=r"event\.failure: is not exported"):
        both(failure)
    _, stop, *_ = read_run("soft-limits")
    with pytest.raises(InputError, match=r"services\.soft_stop_m: is not exported"):
        both(stop)
    low, *_ = read_run("calibrated-low")
    with pytest.raises(InputError, match="configurations: calibrated low"):
        both(low, "calibrated low")
