"""The stages together on a bench: hands, multipliers, corrections, and repeatability."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile, configure
from coupled.flight.pilot import PILOTS
from coupled.record.record import Record
from coupled.rig.frame import CHANNELS_PER_CONTROL, step_frame
from coupled.rig.growth import growth
from coupled.rig.packing import Hand, pack
from coupled.schema import build
from tests.support.rigs import G_STIFF, K_REPORT, amounts, bench


def run(
    pilot: dict[str, Any],
    changes: dict[str, Any] | None = None,
    q: float = 3000.0,
    seconds: float = 6.0,
    configuration: Any = None,
    seed: int = 0,
    frame_rate: float = 100.0,
) -> Record:
    rig = bench(changes).changed({"frame_rate_Hz": frame_rate})
    if configuration:
        rig = configure(rig, configuration)
    profile = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[q])
    hand = build(PILOTS[pilot["kind"]], pilot, "t", "pilot.column")
    return fly(Manoeuvre(rig, {"column": hand}, seconds, seed=seed, bench=profile))


CLAMP = {"kind": "clamp", "deflection_m": 0.0508}


@pytest.mark.parametrize(
    ("configuration", "loss", "felt"),
    [
        ("rigid", 0.0, 1.0),
        ("uncompensated", 1 - 1 / (1 + K_REPORT * G_STIFF), 1 / (1 + K_REPORT * G_STIFF)),
        ("deflection only", 0.0, 1 / (1 + K_REPORT * G_STIFF)),
        ("gradient only", K_REPORT * G_STIFF, 1.0),
        ("compensated", 0.0, 1.0),
    ],
)
def test_the_clamp_shows_the_closed_form_of_each_configuration(
    configuration: str, loss: float, felt: float
) -> None:
    record = run(CLAMP, configuration=configuration)
    held = record["column_deflection_m"][-1]
    assert held == pytest.approx(0.0508, rel=1e-6)
    assert 1 - record["column_estimate_m"][-1] / held == pytest.approx(loss, abs=1e-6)
    assert record["column_force_N"][-1] / (G_STIFF * held) == pytest.approx(felt, rel=1e-6)


def test_the_loader_does_not_depend_on_the_frame_rate() -> None:
    hand = {"kind": "doublet", "force_N": 40.0, "half_period_s": 0.6}
    coarse = run(hand, {"friction_N": 3.0}, frame_rate=20.0)
    fine = run(hand, {"friction_N": 3.0}, frame_rate=100.0)
    every = fine["column_computed_m"][::5]
    assert coarse["column_computed_m"] == pytest.approx(every, abs=1e-12)
    assert np.max(np.abs(every)) > 0.01


@given(
    share=amounts(0.6),
    force=st.floats(5.0, 150.0),
    q=amounts(5000.0),
)
@settings(max_examples=25, deadline=None)
def test_compensated_the_host_always_has_the_true_deflection(
    share: float, force: float, q: float
) -> None:
    bend = share / G_STIFF
    changes = {"bend_m_per_N": bend, "controls.column.compensation.bend_m_per_N": bend}
    record = run({"kind": "ramp", "force_N": force, "ramp_s": 2.0}, changes, q, 8.0)
    held = record["column_deflection_m"][-1]
    if record["column_stop"].any():
        return
    assert record["column_estimate_m"][-1] == pytest.approx(held, rel=1e-6)
    assert record["column_gradient_N_per_m"][-1] * held == pytest.approx(force, rel=1e-5)


def test_the_host_may_assume_another_bend_than_the_real_one() -> None:
    changes = {"controls.column.compensation.bend_m_per_N": 0.5 * K_REPORT}
    record = run({"kind": "step", "force_N": 60.0}, changes, seconds=8.0)
    half = 0.5 * K_REPORT * 60.0
    assert record["column_deflection_m"][-1] - record["column_estimate_m"][-1] == pytest.approx(
        half
    )


def test_the_digital_product_is_held_over_the_frame_and_steps_by_its_change() -> None:
    hand = {"kind": "sweep", "force_N": 40.0, "duration_s": 5.0}
    digital = run(hand, {"multiplier": "digital"})
    product = digital["column_modifying_force_N"]
    gain = G_STIFF / (1 - K_REPORT * G_STIFF) - 560.0
    assert product == pytest.approx(gain * digital["column_computed_m"], rel=1e-9, abs=1e-12)
    steps = digital["column_force_step_N"][1:]
    assert steps == pytest.approx(np.diff(product), rel=1e-9, abs=1e-9)
    hybrid = run(hand, {"multiplier": "hybrid"})
    assert np.max(np.abs(hybrid["column_force_step_N"])) < 1e-9 < np.max(np.abs(steps))


def test_a_wrong_scale_is_read_and_used_by_the_host() -> None:
    changes = {
        "controls.column.sensing.deflection_scale": 1.1,
        "bend_m_per_N": 0.0,
        "controls.column.compensation.bend_m_per_N": 0.0,
    }
    record = run({"kind": "step", "force_N": 50.0}, changes, seconds=8.0)
    assert record["column_estimate_m"][-1] / record["column_deflection_m"][-1] == pytest.approx(1.1)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_stop_is_recorded_while_it_is_pressed_and_not_where_friction_holds(side: float) -> None:
    """At a stop F − G·travel is taken by the stop beyond the friction, and by friction within."""
    friction = 10.0
    eased = 560.0 * 0.1778 + 0.5 * friction
    hand = {
        "kind": "table",
        "time_s": [0.0, 0.5, 3.0, 3.1, 6.0],
        "force_N": [0.0, side * 150.0, side * 150.0, side * eased, side * eased],
    }
    # Without the gradient's correction: it would pull the control off its stop as the hand eases.
    changes = {"friction_N": friction, "controls.column.compensation.gradient": False}
    record = run(hand, changes, q=0.0)
    assert not record["column_modifying_force_N"].any()
    stop, leaning = record["column_stop"], slice(200, 300)
    assert np.all(record["column_computed_m"][200:] == side * 0.1778)
    assert np.all(stop[leaning] == side)
    assert not stop[320:].any()
    assert not stop[:50].any()


@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
def test_the_breakouts_term_is_given_once(multiplier: str) -> None:
    """F = F_BO + G·δ at rest, whoever makes the product: the digital one holds F_extra itself."""
    changes = {"multiplier": multiplier, "breakout_N": 9.0}
    record = run({"kind": "step", "force_N": 60.0}, changes, seconds=8.0)
    assert record["column_deflection_m"][-1] == pytest.approx((60.0 - 9.0) / G_STIFF, rel=1e-6)


@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
def test_the_products_way_is_through_a_converter(multiplier: str) -> None:
    """A digital host sends F_mod in steps of 2·100 V/2⁸/S₂, a hybrid one ΔG in 2·S₁/S₂/2⁸."""
    sensing = "controls.column.sensing"
    scales = {"s1_V_per_m": 500.0, "s2_V_per_N": 0.2, "s3_V_per_N": 0.25}
    changes = {
        "multiplier": multiplier,
        **{f"{sensing}.{name}": value for name, value in scales.items()},
        f"{sensing}.word_length_bits": 8,
    }
    record = run({"kind": "ramp", "force_N": 80.0, "ramp_s": 4.0}, changes)
    product, computed = record["column_modifying_force_N"], record["column_computed_m"]
    if multiplier == "digital":
        sent, step = product, 200.0 / 256 / 0.2
        assert len(np.unique(sent)) > 10
    else:  # the multiplier's δc is the true one, which rests where the balance has it
        true = (80.0 - product[-1]) / 560.0
        sent, step = product[-1:] / true, 2 * 500.0 / 0.2 / 256
        asked = G_STIFF / (1 - K_REPORT * G_STIFF) - 560.0
        assert sent[0] == pytest.approx(asked, abs=0.5 * step)
        assert computed[-1] == pytest.approx(true, abs=200.0 / 256 / 500.0)
    assert sent / step == pytest.approx(np.round(sent / step), abs=1e-2)


def test_noise_on_the_pressure_read_does_not_reach_the_surface() -> None:
    """The cable yields to the air load itself; the schedule gets what is read."""
    changes = {
        "controls.column.rigging.stretch_loss_per_Pa": 1e-4,
        "noise.dynamic_pressure_Pa": 100.0,
    }
    record = run({"kind": "step", "force_N": 50.0}, changes, q=2000.0, seconds=2.0)
    assert np.std(record["dynamic_pressure_Pa"]) > 50.0
    assert np.std(record["column_gradient_N_per_m"]) > 20.0
    asked = -record["column_estimate_m"] / 0.1778 / 1.2
    assert record["column_surface_norm"] == pytest.approx(asked, rel=1e-12)


@pytest.mark.parametrize("damping", [0.0, 30.0, 60.0])
def test_an_arm_damps_the_control_it_holds(damping: float) -> None:
    """m·x'' + (c + c_h)·x' + G·x = 0 on a rigid rig dies by (c + c_h)/2m."""
    rig = configure(bench({"servo_frequency_Hz": 800.0}), "rigid")
    flat = {"controls.column.schedule.total_gradient_N_per_m": [G_STIFF, G_STIFF]}
    found = growth(rig.changed({**flat, "loader_rate_Hz": 20_000.0}), Hand(damping=damping), 1.0)
    assert found == pytest.approx(-(75.0 + damping) / (2 * 4.0), rel=0.02)


def test_a_coarse_converter_shows_in_the_estimate() -> None:
    prefix = "controls.column.sensing"
    changes = {
        f"{prefix}.word_length_bits": 8,
        f"{prefix}.s1_V_per_m": 500.0,
        f"{prefix}.s2_V_per_N": 0.2,
        f"{prefix}.s3_V_per_N": 0.25,
    }
    record = run({"kind": "ramp", "force_N": 80.0, "ramp_s": 4.0}, changes)
    step = 200.0 / 256 / 500.0
    read = record["column_computed_m"] / step
    assert read == pytest.approx(np.round(read), abs=1e-9)
    assert len(np.unique(read)) > 10


def test_reaching_a_stop_is_marked_in_record_and_manifest() -> None:
    record = run({"kind": "ramp", "force_N": 900.0, "ramp_s": 2.0})
    met = np.flatnonzero(record["column_stop"])
    assert met.size
    assert record["column_computed_m"][met[0] + 1] == pytest.approx(0.1778)
    assert record.manifest["stop_first_met_s"]["column"] == record.time_s[met[0]]


def test_noise_is_of_the_level_asked_and_of_the_seed() -> None:
    changes = {"noise.column_force_N": 0.5}
    hand = {"kind": "ramp", "force_N": 1e-9, "ramp_s": 1.0}
    one, again, other = (run(hand, changes, seconds=60.0, seed=s) for s in (1, 1, 2))
    assert np.array_equal(one.data, again.data)
    assert not np.array_equal(one.data, other.data)
    assert np.std(one["column_force_N"]) == pytest.approx(0.5, rel=0.05)
    assert np.std(one["column_estimate_m"]) == pytest.approx(0.5 * K_REPORT, rel=0.05)


@pytest.mark.parametrize("hand", [Hand(), Hand(stiffness=3000.0, damping=20.0, lag_s=0.05)])
@pytest.mark.parametrize("friction_N", [0.0, 6.0])
def test_a_control_that_stands_alone_moves_as_one_that_is_asked_for_all(
    hand: Hand, friction_N: float
) -> None:
    """Inactive services change no bit, and neither do terms that are not needed at each node."""
    rig = bench({"servo_frequency_Hz": 18.0, "friction_N": friction_N, "play_m": 1e-3})
    frames, rng = 200, np.random.default_rng(3)
    script = np.zeros((1, 2, frames * rig.substeps + 1))
    script[0] = 0.01 * rng.standard_normal(script[0].shape).cumsum(axis=1)
    script[0, 0] *= 400.0
    apart, asked = (np.zeros((frames, 2 + CHANNELS_PER_CONTROL)) for _ in range(2))
    for record, services in ((apart, 0), (asked, 1)):
        packed = pack(rig, {"column": hand})
        packed["state"]["services"]["on"] = services
        packed["state"]["hand"]["command"] = 3.0
        for k in range(frames):
            step_frame(packed, script, record, k, (3000.0,), 1.0)
    assert np.ptp(apart[:, 3]) > 0.01  # the grip moves, and rests now and then
    assert np.array_equal(apart, asked)


def test_a_hand_is_on_its_grip_from_the_first_row_on() -> None:
    """The script's first force, or what holds the first place: k·h = (1 + k·K)·F at δc = 0."""
    rig = bench({"servo_frequency_Hz": 18.0})
    first, held, stiffness = 40.0, 0.01, 3000.0
    for hand, force in (
        (Hand(), first),
        (Hand(stiffness=stiffness), (first + stiffness * held) / (1.0 + stiffness * K_REPORT)),
    ):
        script = np.zeros((1, 2, rig.substeps + 1))
        script[0, 0] = first + np.arange(rig.substeps + 1)
        script[0, 1] = held + 0.01 * np.arange(rig.substeps + 1)
        record = np.zeros((1, 2 + CHANNELS_PER_CONTROL))
        step_frame(pack(rig, {"column": hand}), script, record, 0, (3000.0,), 1.0)
        channels = record[0, 1:-1]
        assert channels[9] == pytest.approx(force, rel=1e-9)  # the hand's own force
        assert channels[0] == channels[9]
        assert channels[2] == pytest.approx(K_REPORT * force, rel=1e-9)
