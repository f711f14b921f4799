"""The twin's effects of the contract's second revision, each against its closed form."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.blind.trials.deck import read_deck
from coupled.blind.twin.kernel import NODES
from coupled.blind.twin.setting import coloured, draw_setting, with_other
from coupled.blind.twin.twin import Bristles, Twin, fly_twin, nominal_twin, set_bristles
from coupled.record.record import Record
from tests.support.twin import POOL, STEP_N, Floats, RATE_Hz, alone, loop, nodes, plain, stepped

FRICTION_N, TRAVEL_m = 4.0, 2e-4


def soft(elastic_share: float) -> tuple[Twin, Floats, Floats]:
    """Return a twin with friction that yields, and force and δc of a slow loop within friction."""
    rig, twin = plain()
    twin.set(running=FRICTION_N, breakaway=FRICTION_N, stribeck_rate=0.002)
    set_bristles(twin, FRICTION_N, Bristles(TRAVEL_m, elastic_share=elastic_share))
    record = alone(rig, twin, loop(40.0, 0.6 * FRICTION_N))
    return twin, record["column_force_N"], record["column_computed_m"]


def left(record: Record, twin: Twin) -> Floats:
    """Return the force that spring, damper and mass leave over, N."""
    x = record["column_computed_m"]
    v = np.gradient(x) * RATE_Hz
    carried = twin.get("basic_gradient") * x + twin.get("damping") * v
    return np.asarray(
        record["column_force_N"] - carried - twin.get("mass") * np.gradient(v) * RATE_Hz
    )


@pytest.mark.slow
def test_elastoplastic_friction_is_a_spring_until_it_slips() -> None:
    twin, force, x = soft(0.8)
    stiffness = FRICTION_N / TRAVEL_m + twin.get("basic_gradient")
    assert np.max(np.abs(x - force / stiffness)) < 0.01 * np.max(np.abs(x))
    assert abs(x[-1]) < 2e-7  # and gives all of it back


def test_bristles_that_slip_early_keep_part_of_it() -> None:
    # Dahl, 1968: under a force rising to f of the friction, x = −s·ln(1 − f/F_c), s = F_c/σ₀.
    # Here all but a share e of the bristles: x = e·s − (1 − e)·s·ln((1 − f/F_c)/(1 − e)).
    share = 0.2
    twin, force, x = soft(share)
    rising = slice(0, len(x) // 4)
    dry = (force - twin.get("basic_gradient") * x)[rising] / FRICTION_N
    slips = dry > share
    most = 1.0 - share
    expected = TRAVEL_m * (share - most * np.log((1.0 - dry[slips]) / most))
    np.testing.assert_allclose(x[rising][slips], expected, atol=0.01 * TRAVEL_m)
    # Back from the peak to no force, all bristles are springs: δc goes as far as they unbend.
    stiffness, g = FRICTION_N / TRAVEL_m, twin.get("basic_gradient")
    peak, middle = len(x) // 4, len(x) // 2
    unbent = (force[peak] - g * x[peak] - force[middle] + g * x[middle]) / stiffness
    assert x[peak] - x[middle] == pytest.approx(unbent, rel=0.02)
    assert x[middle] > 0.1 * TRAVEL_m


def test_slipping_friction_is_the_same_however_it_yields() -> None:
    rig, twin = plain()
    twin.set(running=3.0, breakaway=3.0, stribeck_rate=0.002)
    set_bristles(twin, 3.0, Bristles(5e-4, elastic_share=0.5))
    record = alone(rig, twin, 20.0 * np.sin(2 * np.pi * nodes(40.0) / 20.0))
    rates = np.gradient(record["column_computed_m"])
    moving = np.abs(rates) > 0.5 * np.max(np.abs(rates))
    dry = left(record, twin)[moving]
    np.testing.assert_allclose(dry, 3.0 * np.sign(rates[moving]), atol=0.05)


def test_friction_differs_by_direction_and_grows_with_the_load() -> None:
    rig, twin = plain()
    bristles = Bristles(1e-5, elastic_share=0.5)
    twin.set(pull_friction=3.0, push_friction=1.0)
    set_bristles(twin, 2.0, bristles)
    force = 20.0 * np.sin(2 * np.pi * nodes(40.0) / 20.0)
    record = alone(rig, twin, force)
    rates = np.gradient(record["column_computed_m"])
    moving = np.abs(rates) > 0.3 * np.max(np.abs(rates))
    expected = np.where(rates > 0.0, 3.0, -1.0)
    np.testing.assert_allclose(left(record, twin)[moving], expected[moving], atol=0.05)
    twin.set(pull_friction=0.0, push_friction=0.0, load_friction=0.1)
    record = alone(rig, twin, force)
    rates = np.gradient(record["column_computed_m"])
    moving = np.abs(rates) > 0.3 * np.max(np.abs(rates))
    expected = 0.1 * np.abs(record["column_force_N"]) * np.sign(rates)
    np.testing.assert_allclose(left(record, twin)[moving], expected[moving], atol=0.1)


def test_a_ripple_is_periodic_in_the_deflection() -> None:
    rig, twin = plain()
    twin.set(cog_force=1.5, cog_pitch=0.01)
    record = alone(rig, twin, loop(40.0, 20.0))
    expected = 1.5 * np.sin(2 * np.pi * record["column_computed_m"] / 0.01)
    inner = slice(10, -10)
    np.testing.assert_allclose(left(record, twin)[inner], expected[inner], atol=0.05)


def test_a_relaxing_spring_fades() -> None:
    # Under a constant force, spring G beside k in series with a damper k·τ creeps:
    # x = F/G·(1 − k/(G + k)·e^(−t/T)), T = τ·(G + k)/G, once the mass has settled.
    rig, twin = plain()
    g = twin.get("basic_gradient")
    k, tau = 0.5 * g, 2.0
    twin.set(relaxing=k, relaxing_s=tau, damping=twin.get("damping") * 0.05)
    twin.set(mass=twin.get("mass") * 0.05)
    record = alone(rig, twin, stepped(8.0))
    t = record.time_s
    expected = STEP_N / g * (1.0 - k / (g + k) * np.exp(-t * g / (tau * (g + k))))
    settled = t > 1.0
    error = np.abs(record["column_computed_m"] - expected)[settled]
    assert np.max(error) < 0.01 * STEP_N / g


def test_an_actuator_gives_no_more_than_its_limit() -> None:
    rig, twin = plain()
    twin.set(force_limit=2.0)
    force = np.minimum(nodes(20.0), 10.0) * 3.0
    record = alone(rig, twin, force, pressure_Pa=2000.0)
    x, commanded = record["column_computed_m"][-1], record["column_modifying_force_N"][-1]
    assert commanded > 2.0  # the record holds it as commanded
    assert x == pytest.approx((30.0 - 2.0) / twin.get("basic_gradient"), rel=2e-3)


def test_a_share_of_another_controls_force_reaches_the_loader() -> None:
    rig, twin = plain()
    twin.others = 30.0 * np.sin(2 * np.pi * nodes(4.0) / 2.0)
    twin.set(crosstalk=0.2)
    force = 20.0 * np.sin(2 * np.pi * nodes(4.0) / 3.0)
    both = alone(rig, twin, force)
    own = alone(rig, plain()[1], force)
    theirs = alone(rig, plain()[1], 0.2 * twin.others)  # a linear loader superposes
    np.testing.assert_allclose(
        both["column_computed_m"],
        own["column_computed_m"] + theirs["column_computed_m"],
        atol=1e-9,
    )
    np.testing.assert_array_equal(both["column_force_N"], own["column_force_N"])


def test_a_wheel_is_recorded_beside_the_column() -> None:
    setting = draw_setting(np.random.default_rng(2), POOL["bench-rigid"])
    record = with_other(np.random.default_rng(3), setting).fly().record
    assert record.channels[-1] == "wheel_force_N"
    assert np.std(record["wheel_force_N"]) > 1.0
    assert setting.fly().record.channels == record.channels[:-1]


def test_a_structure_with_mass_rings_at_its_frequency() -> None:
    rig, twin = plain()
    bend, rate, ratio = 1e-4, 2.0 * np.pi * 6.0, 0.05
    twin.set(bend=bend, mode_rate=rate, mode_ratio=ratio)
    stiff = alone(rig, plain()[1], stepped(3.0))
    record = alone(rig, twin, stepped(3.0))
    bent = record["column_deflection_m"] - stiff["column_deflection_m"]
    t = np.maximum(record.time_s - 0.5 / RATE_Hz / NODES, 0.0)
    damped = rate * np.sqrt(1.0 - ratio**2)
    shape = np.cos(damped * t) + ratio * rate / damped * np.sin(damped * t)
    expected = bend * STEP_N * (1.0 - np.exp(-ratio * rate * t) * shape)
    np.testing.assert_allclose(bent, expected, atol=2e-3 * bend * STEP_N)


def test_a_share_of_the_bend_lags_by_a_play_of_the_force() -> None:
    rig, twin = plain()
    bend, share, width = 1e-4, 0.4, 10.0
    twin.set(bend=bend, bend_share=share, bend_width=width)
    record = alone(rig, twin, loop(40.0, 30.0))
    bent = (
        record["column_deflection_m"]
        - alone(rig, plain()[1], loop(40.0, 30.0))["column_deflection_m"]
    )
    force = record["column_force_N"]
    falling = np.gradient(force) < 0.0
    way = np.where(falling, 0.5 * width, -0.5 * width)
    steady = np.abs(np.abs(force) - 30.0) > width
    steady &= record.time_s > 11.0
    expected = bend * ((1.0 - share) * force + share * (force + way))
    np.testing.assert_allclose(bent[steady], expected[steady], atol=1e-9)


def test_a_play_whose_contact_yields() -> None:
    rig, twin = plain()
    play, stiffness = 1e-3, 4e4
    twin.set(play=play, contact=stiffness, contact_s=2e-3)
    force = loop(40.0, 20.0)
    free = alone(rig, plain()[1], force)["column_deflection_m"]
    record = alone(rig, twin, force)
    held = record["column_deflection_m"] - free
    expected = 0.5 * play * np.sign(record["column_force_N"]) + record["column_force_N"] / stiffness
    touching = np.abs(record["column_force_N"]) > 2.0
    np.testing.assert_allclose(held[touching], expected[touching], atol=0.01 * play)
    assert np.max(np.abs(held)) == pytest.approx(0.5 * play + 20.0 / stiffness, rel=0.01)


def test_sensor_errors_change_the_reading_and_not_the_motion() -> None:
    rig, twin = plain()
    force = 20.0 * np.sin(2 * np.pi * nodes(6.0) / 3.0)
    true = alone(rig, twin, force)
    twin.set(force_scale=1.1, force_zero=0.5, deflection_zero=1e-3, scale_drift=0.02)
    read = alone(rig, twin, force)
    t = true.time_s
    np.testing.assert_allclose(read["column_force_N"], 1.1 * true["column_force_N"] + 0.5)
    np.testing.assert_allclose(
        read["column_deflection_m"], true["column_deflection_m"] + 1e-3, atol=1e-12
    )
    np.testing.assert_allclose(
        read["column_computed_m"], true["column_computed_m"] * (1.0 + 0.02 * t), atol=1e-12
    )
    twin.set(force_scale=1.0, force_zero=0.0, scale_drift=0.0, tone=3e-4)
    twin.set(tone_rate=2 * np.pi * 50.0, tone_phase=0.3)
    hummed = alone(rig, twin, force)["column_computed_m"] - true["column_computed_m"]
    np.testing.assert_allclose(hummed, 3e-4 * np.sin(2 * np.pi * 50.0 * t + 0.3), atol=1e-12)


def test_a_force_is_stamped_late_and_used_in_time() -> None:
    rig = POOL["bench-compensated"]
    force = 20.0 * np.sin(2 * np.pi * nodes(6.0) / 3.0)
    prompt = alone(rig, nominal_twin(rig), force)
    twin = nominal_twin(rig)
    twin.set(force_late=5 / RATE_Hz)
    late = alone(rig, twin, force)
    np.testing.assert_allclose(
        late["column_force_N"][5:], prompt["column_force_N"][:-5], atol=1e-12
    )
    for name in ("column_computed_m", "column_estimate_m", "column_deflection_m"):
        np.testing.assert_array_equal(late[name], prompt[name])


def test_a_motion_is_stamped_late() -> None:
    rig = POOL["c172p-rigid"]
    frames = 240
    force = 20.0 * np.sin(2 * np.pi * nodes(2.0))
    twin = nominal_twin(rig)
    prompt = fly_twin(rig, twin, force, frames, None, np.zeros((frames, 14)))
    twin.air.late_s = 3 / RATE_Hz
    late = fly_twin(rig, twin, force, frames, None, np.zeros((frames, 14)))
    for name in ("pitch_rate_rad_per_s", "load_factor", "altitude_m"):
        np.testing.assert_allclose(late[name][3:], prompt[name][:-3], rtol=1e-9, atol=1e-12)
    for name in ("elevator_rad", "dynamic_pressure_Pa", "column_computed_m"):
        np.testing.assert_array_equal(late[name], prompt[name])


def test_a_host_that_misses_frames_holds_them() -> None:
    rig = POOL["bench-compensated"]
    force = 20.0 * np.sin(2 * np.pi * nodes(20.0) / 2.0)
    twin = nominal_twin(rig)
    twin.set(missed_share=0.3, missed_seed=17.5)
    record = alone(rig, twin, force)
    estimate = record["column_estimate_m"]
    held = np.diff(estimate) == 0.0
    assert np.mean(held) == pytest.approx(0.3, abs=0.03)
    k = rig.controls["column"].compensation.bend
    fresh = record["column_computed_m"] + k * record["column_force_N"]
    np.testing.assert_allclose(estimate[1:][~held], fresh[1:][~held], atol=1e-12)
    runs = held[1:] & held[:-1]  # and misses do not come in bursts
    assert np.mean(runs) == pytest.approx(0.09, abs=0.02)


def test_coloured_noise_keeps_its_strength() -> None:
    rng = np.random.default_rng(5)
    corner = 6.0
    found = coloured(rng.standard_normal(200_000), corner, 120.0)
    a = np.exp(-2.0 * np.pi * corner / 120.0)
    assert np.std(found) == pytest.approx(1.0, rel=0.02)
    assert np.mean(found[1:] * found[:-1]) == pytest.approx(a, abs=0.01)
    assert np.mean(found[2:] * found[:-2]) == pytest.approx(a**2, abs=0.01)


@pytest.mark.slow
def test_rigs_of_the_second_version_are_drawn_with_friction_that_yields() -> None:
    deck = read_deck(2)
    drawn = [
        draw_setting(np.random.default_rng(seed), deck.rigs["bench-rigid"], deck.realism).conditions
        for seed in range(200)
    ]
    travels = np.array([one.presliding_m for one in drawn], dtype=float)
    assert 5e-6 <= np.min(travels) < 1e-5
    assert 2.5e-4 < np.max(travels) <= 5e-4
    assert np.mean([bool(one.corner_Hz) for one in drawn]) == pytest.approx(0.35, abs=0.1)
    skewed = [one.force_skew_s + one.motion_skew_s > 0.0 for one in drawn]
    assert np.mean(skewed) == pytest.approx(0.3, abs=0.1)
    assert all(one.bristle_J is None for one in drawn)
