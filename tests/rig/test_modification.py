"""Gradient modification: eqs. (1) to (12), appendix C, and the report's numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.flight.manoeuvre import configure
from coupled.rig import equations, modification
from coupled.rig.equations import bend_loss, uncompensated_loss
from coupled.rig.hosted import Feel
from coupled.rig.packing import pack
from coupled.rig.replay import (
    drive_loader,
    replay_product,
)
from coupled.rig.rig import Rig
from coupled.rig.statics import static_line, static_point
from tests.support.rigs import G_STIFF, K_REPORT, amounts, bench

SCHEDULE = "controls.column.schedule"


@given(share=st.floats(0.0, 0.95), gradient=st.floats(1.0, 5000.0))
def test_eq_12_gives_the_asked_gradient_at_the_grip(share: float, gradient: float) -> None:
    bend = share / gradient
    on_computed = equations.total_to_computed(gradient, bend)
    computed = 0.03
    force = on_computed * computed
    assert force / (computed + bend * force) == pytest.approx(gradient, rel=1e-9)


@given(
    share=st.floats(0.0, 0.9),
    gradient=st.floats(1.0, 5000.0),
    basic=st.floats(0.0, 5000.0),
    deflection=st.floats(-0.2, 0.2),
)
def test_the_steps_from_eq_6_to_12_are_one_force(
    share: float, gradient: float, basic: float, deflection: float
) -> None:
    """Eqs. (6) to (12): F_mod as a difference of forces, by δ and δc, and by ΔG."""
    bend = share / gradient
    force = gradient * deflection
    computed = equations.computed_deflection(deflection, force, bend)
    assert equations.seen_deflection(deflection, bend, gradient) == computed
    assert computed == pytest.approx(deflection * (1.0 - equations.bend_loss(bend, gradient)))
    needed = equations.added_force(force, equations.basic_force(basic, computed))
    assert needed == force - basic * computed
    assert equations.needed_force(gradient, deflection, basic, computed) == needed
    made = equations.modifying_force(gradient, bend, basic, computed)
    assert made == pytest.approx(needed, rel=1e-9, abs=1e-9)
    added = equations.modifying_gradient(gradient, bend, basic)
    assert added == pytest.approx(gradient / (1.0 - bend * gradient) - basic, abs=1e-9)


def test_eqs_1_to_3_by_hand() -> None:
    """Eqs. (1) to (3): 0.1 m under 200 N on K = 1e-4 m/N, at 500 V/m."""
    assert equations.computed_deflection(0.1, 200.0, 1e-4) == pytest.approx(0.08)
    assert equations.true_deflection(0.08, 200.0, 1e-4) == pytest.approx(0.1)
    assert equations.volts(500.0, 0.08) == pytest.approx(40.0)
    assert equations.volts_of_computed(500.0, 0.1, 200.0, 1e-4) == pytest.approx(40.0)


def two_segments(breakout: float, term: str) -> Rig:
    return bench(
        {
            "breakout_N": breakout,
            f"{SCHEDULE}.second_gradient_N_per_m": [300.0, 1000.0],
            f"{SCHEDULE}.break_deflection_m": 0.05,
            "controls.column.compensation.breakout_term": term,
        }
    )


def test_two_segments_with_breakout_are_felt_exactly() -> None:
    line = static_line(two_segments(9.0, "exact"), "column", 3000.0, np.linspace(0.001, 0.12, 200))
    assert line.force == pytest.approx(line.specified, rel=1e-12)
    assert line.estimate == pytest.approx(line.deflection, rel=1e-12)


STIFF_737 = {  # a 737's column at 30 kPa on a structure that bends past the break
    "breakout_N": 45.0,
    "basic_gradient_N_per_m": 1750.0,
    "bend_m_per_N": 1.3e-4,
    f"{SCHEDULE}.total_gradient_N_per_m": [1750.0, 6130.0],
    f"{SCHEDULE}.second_gradient_N_per_m": [990.0, 3120.0],
    f"{SCHEDULE}.break_deflection_m": 0.022,
    "controls.column.compensation.bend_m_per_N": 1.3e-4,
}


def test_a_break_within_the_breakouts_bend_puts_all_motion_on_the_second_segment() -> None:
    """δc₁ = 0.022 − 1.3e-4·(45 + 6130·0.022) < 0; once read as one segment, felt 824 N for 507."""
    rig = bench(STIFF_737)
    point = static_point(rig, "column", 3000.0, 0.127)
    assert point.specified[0] == pytest.approx(45.0 + 6130 * 0.022 + 3120 * (0.127 - 0.022))
    line = static_line(rig, "column", 3000.0, np.linspace(-0.1, 0.1, 201)[np.r_[:100, 101:201]])
    assert np.min(np.abs(line.deflection)) > 0.022
    assert line.force == pytest.approx(line.specified, rel=1e-12)
    assert line.estimate == pytest.approx(line.deflection, rel=1e-12)


def test_under_that_break_the_grip_moves_by_the_bend_alone() -> None:
    """Up to F₀/(1 − K·G₂), where δ = K·F meets the second segment; then the loader moves."""
    rig = bench(STIFF_737)
    leaves = (45.0 + (6130 - 3120) * 0.022) / (1.0 - 1.3e-4 * 3120.0)
    assert 1.3e-4 * leaves > 0.022
    frames = 400
    for force, moves in ((0.999 * leaves, False), (1.001 * leaves, True)):
        nodes = np.full(frames * rig.substeps + 1, force)
        first, second = np.full(frames, 6130.0), np.full(frames, 3120.0)
        x, _ = drive_loader(rig, "column", nodes, Feel(first, second), np.zeros(frames))
        assert (x[-1] > 0.0) == moves


@given(
    bend=amounts(1.55e-4),
    breakout=amounts(200.0),
    at=st.floats(0.001, 0.1),
    gradients=st.tuples(amounts(6400.0), amounts(6400.0)),
)
def test_f_mod_is_the_force_specified_less_that_of_the_loader(
    bend: float, breakout: float, at: float, gradients: tuple[float, float]
) -> None:
    """Eqs. (6), (8) and (9), with breakout and two segments in either order, wherever δc moves."""
    first, second = gradients
    column = "controls.column"
    rig = bench(STIFF_737).changed(
        {
            f"{column}.loader.breakout_N": breakout,
            f"{column}.compensation.bend_m_per_N": bend,
            f"{SCHEDULE}.total_gradient_N_per_m": [first, first],
            f"{SCHEDULE}.second_gradient_N_per_m": [second, second],
            f"{SCHEDULE}.break_deflection_m": at,
        }
    )
    deflection = np.linspace(0.002, 0.15, 60)
    wanted = equations.specified_force(rig, "column", 0.0, deflection)
    computed = equations.computed_deflection(deflection, wanted, bend)
    deflection, wanted, computed = (a[computed > 1e-6] for a in (deflection, wanted, computed))
    feel = Feel(0.0 * computed + first, 0.0 * computed + second)
    given = replay_product(rig, "column", computed, feel)
    available = breakout + equations.basic_force(1750.0, computed)
    assert given == pytest.approx(equations.added_force(wanted, available), rel=1e-9, abs=1e-7)


def test_the_slope_of_f_mod_is_its_derivative_on_both_segments() -> None:
    (packed,) = pack(two_segments(9.0, "exact"))
    s = packed["state"]["modification"]
    modification.set_gradients(packed["parameters"]["modification"], s, G_STIFF, 1000.0)
    at = s["break_computed"]
    assert 0.01 < at < 0.05
    for x in (0.01, 0.9 * at, 1.1 * at, 3.0 * at, -0.9 * at, -1.1 * at):
        rise = modification.smooth_force(s, x + 1e-4) - modification.smooth_force(s, x - 1e-4)
        assert modification.slope(s, x) == pytest.approx(rise / 2e-4, rel=1e-9)
    assert modification.modifying_force(s, 0.0) == 0.0
    modification.set_gradients(packed["parameters"]["modification"], s, G_STIFF, G_STIFF)
    assert modification.slope(s, 0.001) == modification.slope(s, 1.0)


def test_a_force_is_made_by_the_scale_that_the_host_assumes_over_the_real_one() -> None:
    """v₂ = Ŝ₂·ΔF makes ΔF·Ŝ₂/S₂ of newtons, with S₂ a quarter more than assumed."""
    computed = np.array([0.03, -0.05])
    key = "controls.column.sensing.modifying_scale"
    right, wrong = (
        replay_product(
            bench({"breakout_N": 9.0, key: scale}), "column", computed, Feel(0 * computed + G_STIFF)
        )
        for scale in (1.0, 1.25)
    )
    assert wrong == pytest.approx(right / 1.25, rel=1e-12)


def test_appendix_c_as_printed_is_too_light_by_k_g_times_the_breakout() -> None:
    """Cleveland, appendix C leaves out the term: the pilot feels K·G₁·F_BO too little."""
    exact = two_segments(9.0, "exact")
    printed = two_segments(9.0, "printed")
    for deflection in (0.01, 0.03, -0.04):
        right = static_point(exact, "column", 3000.0, deflection)
        wrong = static_point(printed, "column", 3000.0, deflection)
        missing = abs(right.force[0]) - abs(wrong.force[0])
        assert missing == pytest.approx(K_REPORT * G_STIFF * 9.0, rel=1e-9)
    plain = static_point(two_segments(0.0, "printed"), "column", 3000.0, 0.03)
    assert plain.force[0] == pytest.approx(plain.specified[0], rel=1e-12)


def test_the_loader_holds_the_two_segment_force() -> None:
    rig = two_segments(9.0, "exact")
    frames = 800
    for force in (30.0, 160.0, -200.0):
        nodes = np.full(frames * rig.substeps + 1, force)
        first, second = np.full(frames, G_STIFF), np.full(frames, 1000.0)
        x, _ = drive_loader(rig, "column", nodes, Feel(first, second), np.zeros(frames))
        line = static_line(rig, "column", 3000.0, x[-1:])
        assert line.force[0] == pytest.approx(force, rel=1e-6)


def test_a_digital_product_is_of_what_the_host_read() -> None:
    rig = bench({"controls.column.loader.multiplier": "digital"})
    gradient, misread = np.full(300, G_STIFF), np.zeros(300)
    misread[100] = 1e-3
    nodes = np.zeros(299 * rig.substeps + 1)
    x, product = drive_loader(rig, "column", nodes, Feel(gradient), misread)
    host = rig.controls["column"].compensation
    added = G_STIFF / (1.0 - host.bend * G_STIFF) - rig.controls["column"].loader.basic_gradient
    assert product[:101] == pytest.approx(added * misread[:101])
    assert x[101] < -1e-6  # held over the frame, it moves the loader the other way
    assert product[101] == pytest.approx(added * x[101])


@pytest.mark.parametrize(
    ("deflection_in", "gradient_lb_per_in", "loss"), [(2.0, 12.5, 0.20), (7.0, 3.2, 0.0512)]
)
def test_the_reports_losses(deflection_in: float, gradient_lb_per_in: float, loss: float) -> None:
    """Cleveland, p. 5: 0.4 in of 2 in lost, and 0.36 in of 7 in: eqs. (7) and (7a)."""
    gradient = gradient_lb_per_in * 175.126835
    rig = bench({f"{SCHEDULE}.total_gradient_N_per_m": [gradient, gradient]})
    right = static_point(configure(rig, "gradient only"), "column", 0.0, deflection_in * 0.0254)
    lost = 1.0 - right.estimate[0] / right.deflection[0]
    assert lost == pytest.approx(loss, rel=1e-3)
    assert lost == pytest.approx(bend_loss(K_REPORT, gradient), rel=1e-9)
    plain = static_point(configure(rig, "uncompensated"), "column", 0.0, deflection_in * 0.0254)
    lost = 1.0 - plain.estimate[0] / plain.deflection[0]
    assert lost == pytest.approx(uncompensated_loss(K_REPORT, gradient), rel=1e-9)
    assert plain.force[0] / plain.specified[0] == pytest.approx(1 / (1 + K_REPORT * gradient))
