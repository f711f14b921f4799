"""Schedule, modification, linkage, sensing, compensation and surface, each by its closed form."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.flight.manoeuvre import configure
from coupled.record.channels import ControlName
from coupled.resources import shipped_rigs
from coupled.rig import equations, linkage, modification, sensing
from coupled.rig.equations import bend_loss, uncompensated_loss
from coupled.rig.packing import pack
from coupled.rig.parameters import Rigging
from coupled.rig.replay import (
    drive_loader,
    replay_linkage,
    replay_product,
    replay_schedule,
    replay_surface,
)
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.rig.statics import static_line, static_point
from tests.support.rigs import G_STIFF, K_REPORT, amounts, bench

SCHEDULE = "controls.column.schedule"


# --- schedule ------------------------------------------------------------------------------------


def test_schedule_interpolates_and_holds_its_ends() -> None:
    q = np.array([-10.0, 0.0, 1500.0, 3000.0, 9000.0])
    g = replay_schedule(bench(), "column", q)
    assert g == pytest.approx([560.0, 560.0, (560.0 + G_STIFF) / 2, G_STIFF, G_STIFF], rel=1e-12)


def test_a_schedule_of_many_rows_is_straight_between_each_two() -> None:
    q, g = [500.0, 1500.0, 2000.0, 4000.0], [560.0, 900.0, 2100.0, 1700.0]
    rig = bench({f"{SCHEDULE}.dynamic_pressure_Pa": q, f"{SCHEDULE}.total_gradient_N_per_m": g})
    asked = np.array([400.0, 500.0, 750.0, 1500.0, 1625.0, 1999.0, 2000.0, 3500.0, 4100.0])
    assert replay_schedule(rig, "column", asked) == pytest.approx(np.interp(asked, q, g), rel=1e-12)


def test_schedule_scale_and_slope() -> None:
    q = np.array([0.0, 1000.0])
    scaled = replay_schedule(bench({f"{SCHEDULE}.pressure_scale": 1.5}), "column", q)
    assert scaled == pytest.approx([560.0, 560.0 + (G_STIFF - 560.0) * 0.5], rel=1e-12)
    sloped = replay_schedule(bench({f"{SCHEDULE}.slope": 0.5}), "column", q)
    assert sloped == pytest.approx([560.0, 560.0 + 0.5 * (G_STIFF - 560.0) / 3], rel=1e-12)


def test_pressure_lag_is_first_order() -> None:
    rig = bench({f"{SCHEDULE}.pressure_lag_s": 0.4})
    t = np.arange(200) / rig.frame_rate
    q = np.where(t > 0.0, 3000.0, 0.0)
    g = replay_schedule(rig, "column", q)
    exact = 560.0 + (G_STIFF - 560.0) * (1.0 - np.exp(-t / 0.4))
    assert g == pytest.approx(exact, rel=1e-12)


def test_a_lagging_pressure_begins_where_the_first_frame_has_it() -> None:
    rig = bench({f"{SCHEDULE}.pressure_lag_s": 0.4, f"{SCHEDULE}.pressure_scale": 1.5})
    g = replay_schedule(rig, "column", np.full(50, 1000.0))
    assert g == pytest.approx((560.0 + G_STIFF) / 2, rel=1e-12)


# --- gradient modification: eqs. (9) to (12), appendix C -----------------------------------------


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
    """Up to F₀/(1 − K·G₂), where δ = K·F meets the second segment; then the loader lets go."""
    rig = bench(STIFF_737)
    leaves = (45.0 + (6130 - 3120) * 0.022) / (1.0 - 1.3e-4 * 3120.0)
    assert 1.3e-4 * leaves > 0.022
    frames = 400
    for force, moves in ((0.999 * leaves, False), (1.001 * leaves, True)):
        nodes = np.full(frames * rig.substeps + 1, force)
        first, second = np.full(frames, 6130.0), np.full(frames, 3120.0)
        x, _ = drive_loader(rig, "column", nodes, first, np.zeros(frames), None, second)
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
    given = replay_product(rig, "column", computed, 0.0 * computed + first, 0.0 * computed + second)
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
            bench({"breakout_N": 9.0, key: scale}), "column", computed, 0 * computed + G_STIFF
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
        x, _ = drive_loader(rig, "column", nodes, first, np.zeros(frames), None, second)
        line = static_line(rig, "column", 3000.0, x[-1:])
        assert line.force[0] == pytest.approx(force, rel=1e-6)


def test_a_digital_product_is_of_what_the_host_read() -> None:
    rig = bench({"controls.column.loader.multiplier": "digital"})
    gradient, misread = np.full(300, G_STIFF), np.zeros(300)
    misread[100] = 1e-3
    nodes = np.zeros(299 * rig.substeps + 1)
    x, product = drive_loader(rig, "column", nodes, gradient, misread)
    host = rig.controls["column"].compensation
    added = G_STIFF / (1.0 - host.bend * G_STIFF) - rig.controls["column"].loader.basic_gradient
    assert product[:101] == pytest.approx(added * misread[:101])
    assert x[101] < -1e-6  # held over the frame, it moves the loader the other way
    assert product[101] == pytest.approx(added * x[101])


# --- the report's numbers ------------------------------------------------------------------------


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


# --- linkage -------------------------------------------------------------------------------------


def servo(changes: dict[str, Any], computed: np.ndarray, force: np.ndarray | float = 0.0) -> Any:
    rig = bench({"bend_m_per_N": 0.0, "controls.column.compensation.bend_m_per_N": 0.0, **changes})
    rig = rig.changed({"frame_rate_Hz": 2000.0})
    return replay_linkage(rig, "column", computed, np.zeros_like(computed) + force)


def test_servo_ramp_response() -> None:
    w, z = 2 * math.pi * 18.0, 0.7
    t = np.arange(2000) / 2000.0
    x = servo({}, 0.1 * t)
    wd = w * math.sqrt(1 - z * z)
    lag = 2 * z / w
    decay = np.exp(-z * w * t) * (
        lag * np.cos(wd * t) + (2 * z * z - 1) / (w * math.sqrt(1 - z * z)) * np.sin(wd * t)
    )
    assert x == pytest.approx(0.1 * (t - lag + decay), abs=1e-9)


@pytest.mark.parametrize("frequency_Hz", [2.0, 1000.0])
def test_servo_is_stable_at_any_frequency(frequency_Hz: float) -> None:
    x = servo({"servo_frequency_Hz": frequency_Hz}, np.full(8000, 0.02))
    assert x[-1] == pytest.approx(0.02, rel=1e-9)


def test_servo_rate_limit_is_the_slope() -> None:
    t = np.arange(4000) / 2000.0
    x = servo({"servo_rate_limit_m_per_s": 0.05}, np.where(t < 0.2, 0.0, 0.08))
    moving = (x > 0.01) & (x < 0.06)
    assert np.diff(x)[moving[:-1] & moving[1:]] * 2000.0 == pytest.approx(0.05, rel=1e-9)
    assert x[-1] == pytest.approx(0.08, rel=1e-6)


def test_a_servo_off_its_rate_limit_arrives_with_the_limits_speed() -> None:
    """It leaves the limit where ω²·(u − x) = 2ζω·v, and swings out freely from there."""
    w, z, v, u = 2 * math.pi * 18.0, 0.7, 0.5, 0.15
    t = np.arange(4000) / 2000.0
    x = servo({"servo_rate_limit_m_per_s": v}, np.where(t < 0.01, 0.0, u))
    off = -2 * z * v / w
    start = float(np.interp(u + off, x[: np.argmax(x)], t[: np.argmax(x)]))
    since, wd = t[t > start] - start, w * math.sqrt(1 - z * z)
    swing = np.exp(-z * w * since) * (
        off * np.cos(wd * since) + (v + z * w * off) / wd * np.sin(wd * since)
    )
    assert np.max(swing) > 1e-4
    assert x[t > start] == pytest.approx(u + swing, abs=5e-6)


def test_backlash_lets_the_grip_lag_by_half_the_play_each_way() -> None:
    t = np.arange(40000) / 2000.0
    x = 0.04 * np.sin(2 * np.pi * t / 10.0)
    loose = servo({"play_m": 0.006}, x)
    tight = servo({}, x)
    assert np.max(loose) == pytest.approx(0.04 - 0.003, rel=1e-4)
    rising = (np.diff(tight)[:-1] > 0) & (t[1:-1] > 8.6) & (t[1:-1] < 12.0)
    assert (tight - loose)[1:-1][rising] == pytest.approx(0.003, abs=1e-9)


def test_bend_is_linear_or_saturates_towards_its_limit() -> None:
    force = np.linspace(-400.0, 400.0, 101)
    flat = np.zeros_like(force)
    bent = servo({"bend_m_per_N": K_REPORT}, flat, force)
    assert bent == pytest.approx(K_REPORT * force, rel=1e-12)
    stiff = servo({"bend_m_per_N": K_REPORT, "bend_limit_m": 0.02}, flat, force)
    assert stiff == pytest.approx(0.02 * np.tanh(K_REPORT * force / 0.02), rel=1e-12)
    p = pack(bench({"bend_limit_m": 0.02}))[0]["parameters"]["linkage"]
    ahead = (linkage.bend(p, 100.01) - linkage.bend(p, 99.99)) / 0.02
    assert linkage.bend_slope(p, 100.0) == pytest.approx(ahead, rel=1e-7)


def test_arc_eqs_15_to_17() -> None:
    """The report: 1 % at 14°, 2 % at 20° (by its own series 19.8°)."""
    for angle_deg, error in ((14.0, 0.01), (19.8, 0.02)):
        rig = bench({"arc_geometry": True, "controls.column.length_m": 0.4})
        p = pack(rig)[0]["parameters"]["linkage"]
        along = 0.4 * math.radians(angle_deg)
        assert 1.0 - linkage.transducer(p, along) / along == pytest.approx(error, rel=2e-2)


# --- sensing and surface -------------------------------------------------------------------------


@given(value=st.floats(-0.2, 0.2), bits=st.integers(6, 16))
def test_a_converter_is_within_half_a_step(value: float, bits: int) -> None:
    step = 2 * 0.2 / 2**bits
    got = sensing.converted(value, step, 0.2)
    assert abs(got - value) <= (0.5 if value < 0.2 - step else 1.0) * step + 1e-15
    assert sensing.converted(got, step, 0.2) == pytest.approx(got, abs=1e-15)


def test_a_converter_rounds_to_the_nearest_of_its_steps_and_holds_at_its_ends() -> None:
    """Of 2ᴺ steps from −full scale on, the last is one step under full scale."""
    found = [sensing.converted(0.1 * steps, 0.1, 0.8) for steps in (0.49, 0.51, -0.49, -0.51, 2.5)]
    assert found == pytest.approx([0.0, 0.1, 0.0, -0.1, 0.3], abs=1e-15)
    assert sensing.converted(5.0, 0.1, 0.8) == pytest.approx(0.7)
    assert sensing.converted(-5.0, 0.1, 0.8) == pytest.approx(-0.8)
    assert sensing.converted(0.123, 0.0, 0.0) == 0.123


def test_what_is_read_is_the_scale_times_the_quantity_and_the_noise_on_it() -> None:
    prefix = "controls.column.sensing"
    rig = bench({f"{prefix}.deflection_scale": 1.1, f"{prefix}.force_scale": 0.9})
    p = pack(rig)[0]["parameters"]["sensing"]
    assert sensing.read_computed(p, 0.05, 1e-3) == pytest.approx(0.056, rel=1e-12)
    assert sensing.read_force(p, -40.0, 0.5) == pytest.approx(-35.5, rel=1e-12)


def test_scales_and_word_length_set_the_steps() -> None:
    prefix = "controls.column.sensing"
    rig = bench(
        {
            f"{prefix}.word_length_bits": 12,
            f"{prefix}.s1_V_per_m": 500.0,
            f"{prefix}.s2_V_per_N": 0.2,
            f"{prefix}.s3_V_per_N": 0.25,
        }
    )
    p = pack(rig)[0]["parameters"]["sensing"]
    assert p["computed_step"] == pytest.approx(200.0 / 4096 / 500.0)
    assert p["force_step"] == pytest.approx(200.0 / 4096 / 0.25)
    assert p["product_step"] == pytest.approx(200.0 / 4096 / 0.2)
    assert p["gradient_range"] == pytest.approx(500.0 / 0.2)
    assert p["gradient_step"] == pytest.approx(2.0 * 500.0 / 0.2 / 4096)
    for of, full in (("computed", 100.0 / 500.0), ("force", 100.0 / 0.25), ("product", 500.0)):
        assert p[f"{of}_range"] == pytest.approx(full)


def command(changes: dict[str, Any], estimated: np.ndarray, q: float = 1000.0) -> np.ndarray:
    rig = bench({f"controls.column.rigging.{k}": v for k, v in changes.items()})
    return replay_surface(rig, "column", estimated, np.full_like(estimated, q))


def test_surface_command_sign_travel_and_clip() -> None:
    estimated = np.array([0.0, 0.0889, -0.1778, 0.5])
    assert command({}, estimated) == pytest.approx([0.0, -0.5, 1.0, -1.0])


@pytest.mark.parametrize(("control", "sign"), [("column", -1), ("wheel", 1), ("pedals", -1)])
def test_a_surface_has_jsbsims_sign_and_is_clipped_both_ways(
    control: ControlName, sign: int
) -> None:
    rig = read_rig(shipped_rigs()["737"]).changed({f"controls.{control}.rigging": Rigging()})
    travel = rig.controls[control].travel
    estimated = travel * np.array([0.5, -0.25, 1.05, -1.05, 3.0, -3.0])
    moved = replay_surface(rig, control, estimated, np.zeros(6))
    assert moved == pytest.approx(sign * np.array([0.5, -0.25, 1.0, -1.0, 1.0, -1.0]))


def test_the_command_is_clipped_before_the_cable_yields() -> None:
    """A host asks for no more than full travel, of which the air load takes its share."""
    twice = np.full(3, 2 * 0.1778)
    assert command({"stretch_loss_per_Pa": 2e-4}, twice) == pytest.approx(-1.0 / 1.2)


def test_the_yield_is_lagged_with_the_command() -> None:
    """Stretch before lag: where q̄ steps, the surface goes over with the lag's time."""
    rig = bench(
        {
            "controls.column.rigging.stretch_loss_per_Pa": 2e-4,
            "controls.column.rigging.lag_s": 0.1,
        }
    )
    frames = np.arange(200)
    q = np.where(frames < 120, 0.0, 2500.0)
    moved = -replay_surface(rig, "column", np.full(200, 0.0889), q)
    assert moved[119] == pytest.approx(0.5, rel=1e-4)
    after = 1.0 - np.exp(-(frames[120:] - 119) * 0.01 / 0.1)
    assert moved[120:] == pytest.approx(0.5 - (0.5 - 0.5 / 1.5) * after, rel=1e-4)


def test_the_rate_limit_follows_the_lag_and_the_play_follows_both() -> None:
    """A step: min(r·t, 1 − exp(−t/τ)), and half the play behind; the offset is put on last."""
    t = 0.01 * np.arange(1, 201)
    settings = {"lag_s": 0.2, "rate_limit_norm_per_s": 1.0}
    moved = np.minimum(1.0 * t, 1.0 - np.exp(-t / 0.2))
    step = np.full(200, -0.1778)
    assert command(settings, step) == pytest.approx(moved, rel=1e-9)
    loose = command({**settings, "play_norm": 0.1, "offset_norm": 0.03}, step)
    assert loose == pytest.approx(np.maximum(moved - 0.05, 0.0) + 0.03, rel=1e-9)


def test_cable_stretch_lag_rate_play_and_offset() -> None:
    frames = np.arange(300)
    step = np.where(frames > 0, -0.1778, 0.0)
    stretched = command({"stretch_loss_per_Pa": 1e-4}, step)
    assert stretched[-1] == pytest.approx(1.0 / 1.1)
    lagged = command({"lag_s": 0.2}, step)
    assert lagged == pytest.approx(1.0 - np.exp(-frames / 100.0 / 0.2), abs=1e-12)
    limited = command({"rate_limit_norm_per_s": 2.0}, step)
    assert limited == pytest.approx(np.minimum(frames * 0.02, 1.0), abs=1e-12)
    loose = command({"play_norm": 0.1}, -0.1778 * np.sin(frames / 30.0))
    assert np.max(loose) == pytest.approx(0.95, abs=1e-3)
    assert np.min(loose) == pytest.approx(-0.95, abs=1e-3)
    assert command({"offset_norm": 0.03}, step)[0] == pytest.approx(0.03)
