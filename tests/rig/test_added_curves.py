"""Curves of a rig: a linear one equals the number that it replaces; a neutral one is none."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from coupled.authority.heldcontrol import breakaway_force
from coupled.authority.stability.limits import gradient_range
from coupled.authority.stability.local import about_rest
from coupled.errors import InputError
from coupled.exporting.keys import check_keys
from coupled.flight.manoeuvre import configure
from coupled.rig.curves import BendCurve, CommandCurve, Curve, FrictionCurve
from coupled.rig.declaration import Hand
from coupled.rig.frame import step_frame
from coupled.rig.hosted import Feel
from coupled.rig.imposed import answer_to
from coupled.rig.nodes import on_nodes
from coupled.rig.packing import pack
from coupled.rig.piecewise import along, count_of, damping_table, solve_along, table_of
from coupled.rig.replay import replay_surface
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.rig.statics import static_line, static_point
from tests.support.rigs import bench

Floats = NDArray[np.float64]
RATE_Hz, SECONDS, LIMIT = 100.0, 3.0, 1e-12
SCHEDULE, SENSING = "controls.column.schedule", "controls.column.sensing"
FRAMES = round(RATE_Hz * SECONDS) + 1
TIMES_s = np.arange(FRAMES) / RATE_Hz
PRESSURE_Pa = 1500.0 + 900.0 * np.sin(2.0 * TIMES_s)


def force_on_nodes(rig: Rig) -> Floats:
    """Return a force that stops, reverses and meets the travel, N on the loader's nodes."""
    times = np.arange((FRAMES - 1) * rig.substeps + 1) / (RATE_Hz * rig.substeps)
    return 160.0 * np.sin(5.0 * times) * np.sin(1.3 * times)


def flown(rig: Rig, hand: Hand | None = None) -> Floats:
    """Return the channels of a bench flight of the column under that force, a row a frame."""
    controls = pack(rig, {"column": hand or Hand()})
    script = np.zeros((1, 2, (FRAMES - 1) * rig.substeps + 1))
    script[0, int(hand is not None)] = force_on_nodes(rig) * (1e-3 if hand else 1.0)
    record = np.zeros((FRAMES, 12))
    for k in range(FRAMES - 1):
        step_frame(controls, script, record, k, (float(PRESSURE_Pa[k]),), 1.0)
    return record


def both(plain: dict[str, Any], curve: dict[str, Any], rest: dict[str, Any] | None = None) -> float:
    """Return the largest difference of two flights, relative to each channel's largest value."""
    first, second = (flown(bench({**(rest or {}), **each})) for each in (plain, curve))
    assert np.abs(first - flown(bench(rest))).max() > 1e-6  # what is compared acts
    size = np.abs(first).max(axis=0)
    return float((np.abs(first - second).max(axis=0)[size > 0.0] / size[size > 0.0]).max())


def line(of: str, value: str, slope: float, to: float, begin: float = 0.0) -> dict[str, Any]:
    """Return the table of a linear curve of several segments, from `begin` on."""
    nodes = [begin, 0.13 * to, 0.4 * to, to]
    return {of: nodes, value: [slope * node for node in nodes]}


SPRING = ("deflection_m", "force_N")
DAMPING = ("rate_m_per_s", "force_N")
EQUAL: dict[str, tuple[dict[str, Any], dict[str, Any], dict[str, Any]]] = {
    "a spring": (
        {"basic_gradient_N_per_m": 700.0},
        {"force_curve": line(*SPRING, 140.0, 0.05)},
        {"controls.column.compensation.basic_gradient_N_per_m": 560.0},
    ),
    "a spring of two signs": (
        {"basic_gradient_N_per_m": 700.0, "offset_N": -1.5},
        {
            "force_curve": {
                "deflection_m": [-0.02, 0.01, 0.03],
                "force_N": [-1.3, 2.9, 5.7],
            }
        },
        {"controls.column.compensation.basic_gradient_N_per_m": 560.0},
    ),
    "damping": ({"damping_N_s_per_m": 95.0}, {"friction_curve": line(*DAMPING, 20.0, 0.1)}, {}),
    "less damping": (
        {"damping_N_s_per_m": 55.0},
        {"friction_curve": line(*DAMPING, -20.0, 0.1)},
        {},
    ),
    "dry friction": (
        {"friction_N": 7.0},
        {"friction_curve": {"rate_m_per_s": [0.0, 1.0], "force_N": [7.0, 7.0]}},
        {},
    ),
    "dry friction by direction": (
        {"friction_N": 1.0, "friction_pull_N": 6.0, "friction_push_N": 3.0},
        {
            "friction_N": 1.0,
            "friction_curve": {
                "rate_m_per_s": [0.0, 1.0],
                "force_N": [6.0, 6.0],
                "force_push_N": [3.0, 3.0],
            },
        },
        {},
    ),
    "friction and damping, with a contact that yields": (
        {"friction_N": 5.0, "damping_N_s_per_m": 95.0},
        {"friction_N": 5.0, "friction_curve": line(*DAMPING, 20.0, 0.1)},
        {"friction_stiffness_N_per_m": 20000.0, "friction_N": 5.0},
    ),
    "friction by load": (
        {"friction_by_load": 0.2},
        {"load_curve": line("load_N", "friction_N", 0.2, 80.0)},
        {},
    ),
    "friction at any load": (
        {"friction_N": 3.0},
        {"load_curve": {"load_N": [0.0, 50.0], "friction_N": [3.0, 3.0]}},
        {},
    ),
    "a bend": (
        {"bend_m_per_N": 3e-4},
        {"bend_curve": line("force_N", "bend_m", 3e-4 - 9.136e-5, 60.0)},
        {},
    ),
    "a bend by direction": (
        {"bend_m_per_N": 3e-4, "bend_push_m_per_N": 2e-4},
        {
            "bend_curve": {
                "force_N": [-50.0, 0.0, 50.0],
                "bend_m": [-50.0 * (2e-4 - 9.136e-5), 0.0, 50.0 * (3e-4 - 9.136e-5)],
            }
        },
        {},
    ),
    "the scale of the deflection": (
        {f"{SENSING}.deflection_scale": 1.07},
        {f"{SENSING}.deflection_curve": line("deflection_m", "reading_m", 1.07, 0.1)},
        {"multiplier": "digital"},
    ),
    "the zero of the grip's transducer": (
        {f"{SENSING}.deflection_zero_m": 2e-3},
        {f"{SENSING}.grip_curve": {"deflection_m": [-0.1, 0.2], "reading_m": [-0.098, 0.202]}},
        {},
    ),
    "the reading at the grip by the force": (
        {"bend_m_per_N": 3e-4},
        {f"{SENSING}.grip_load_curve": line("force_N", "reading_m", 3e-4 - 9.136e-5, 60.0)},
        {},
    ),
    "the gauge's scale and zero": (
        {f"{SENSING}.force_scale": 1.07, f"{SENSING}.force_zero_N": 2.0},
        {f"{SENSING}.force_curve": {"force_N": [-60.0, 50.0], "reading_N": [-62.2, 55.5]}},
        {},
    ),
    "the schedule's slope": (
        {f"{SCHEDULE}.slope": 1.1},
        {
            f"{SCHEDULE}.gradient_curve": {
                "dynamic_pressure_Pa": [0.0, 500.0, 3000.0],
                "gradient_N_per_m": [0.0, 162.9 / 6.0, 162.9],
            }
        },
        {},
    ),
}


@pytest.mark.parametrize("name", EQUAL)
def test_a_linear_curve_equals_the_number_that_it_replaces(name: str) -> None:
    assert both(*EQUAL[name]) < LIMIT


KINDS: dict[str, tuple[str, str, bool]] = {  # of each curve its lists, and whether it is a map
    "force_curve": (*SPRING, False),
    "friction_curve": (*DAMPING, False),
    "load_curve": ("load_N", "friction_N", False),
    "bend_curve": ("force_N", "bend_m", False),
    f"{SCHEDULE}.gradient_curve": ("dynamic_pressure_Pa", "gradient_N_per_m", False),
    f"{SENSING}.deflection_curve": ("deflection_m", "reading_m", True),
    f"{SENSING}.force_curve": ("force_N", "reading_N", True),
    f"{SENSING}.grip_curve": ("deflection_m", "reading_m", True),
    f"{SENSING}.grip_load_curve": ("force_N", "reading_m", False),
    "controls.column.rigging.command_curve": ("deflection_norm", "command_norm", True),
}
RUBBING = {"friction_N": 2.0, "breakout_N": 3.0}


@pytest.mark.parametrize("key", KINDS)
def test_a_neutral_curve_gives_the_same_bytes(key: str) -> None:
    of, value, is_map = KINDS[key]
    nodes = [0.0, 0.013, 0.07, 41.0]
    table = {of: nodes, value: nodes if is_map else [0.0] * len(nodes)}
    plain = flown(bench(RUBBING))
    assert flown(bench({**RUBBING, key: table})).tobytes() == plain.tobytes()


def test_a_commands_curve_scales_the_travel_and_is_clipped_after_it() -> None:
    key = "controls.column.rigging.command_curve"
    rig = bench({key: line("deflection_norm", "command_norm", 1.25, 1.0)})
    at = np.linspace(-0.17, 0.17, 41)
    pressure = np.full_like(at, 1500.0)
    scaled = replay_surface(bench(), "column", 1.25 * at, pressure)
    assert np.any(np.abs(scaled) == 1.0)
    np.testing.assert_allclose(replay_surface(rig, "column", at, pressure), scaled, atol=LIMIT)
    pulled = {"deflection_norm": [-1.0, 0.0, 1.0], "command_norm": [-0.5, 0.0, 1.0]}
    softer = replay_surface(bench({key: pulled}), "column", at, pressure)
    plain = replay_surface(bench(), "column", at, pressure)
    np.testing.assert_allclose(softer, np.where(at > 0.0, 1.0, 0.5) * plain, atol=LIMIT)


def value_of(curve: Curve, x: float) -> float:
    """Return a curve's value by the kernels."""
    found = along(table_of(curve), count_of(curve), x)
    return found + x if curve.MAP else found


@settings(max_examples=60, deadline=None)
@given(
    steps=st.lists(st.floats(0.01, 5.0), min_size=1, max_size=23),
    values=st.lists(st.floats(-50.0, 50.0), min_size=24, max_size=24),
    begin=st.sampled_from([0.0, -3.0]),
    x=st.floats(-60.0, 60.0),
)
def test_kernels_and_arrays_interpolate_and_continue_alike(
    steps: list[float], values: list[float], begin: float, x: float
) -> None:
    nodes = [begin, *(begin + np.cumsum(steps)).tolist()]
    given_values = [0.0 if begin == 0.0 else values[0], *values[1 : len(nodes)]]
    curve = BendCurve(force=nodes, bend=given_values)
    size = abs(x) if curve.odd else x
    i = 0
    while i + 2 < len(nodes) and size >= nodes[i + 1]:
        i += 1
    slope = (given_values[i + 1] - given_values[i]) / (nodes[i + 1] - nodes[i])
    wanted = given_values[i] + slope * (size - nodes[i])
    wanted = math.copysign(1.0, x) * wanted if curve.odd else wanted
    scale = 1e-12 * max(1.0, abs(wanted), abs(slope) * 60.0)
    assert float(curve.at(x)) == pytest.approx(wanted, abs=scale)
    assert value_of(curve, x) == pytest.approx(wanted, abs=scale)
    mapped = CommandCurve(deflection=nodes, command=given_values)
    assert value_of(mapped, x) == pytest.approx(float(mapped.at(x)), abs=10.0 * scale)


@settings(max_examples=60, deadline=None)
@given(
    steps=st.lists(st.floats(0.1, 5.0), min_size=1, max_size=23),
    slopes=st.lists(st.floats(-0.9, 5.0), min_size=23, max_size=23),
    wanted=st.floats(0.0, 100.0),
)
def test_a_rising_law_is_solved_on_its_own_segment(
    steps: list[float], slopes: list[float], wanted: float
) -> None:
    nodes = [0.0, *np.cumsum(steps).tolist()]
    rises = np.array(slopes[: len(steps)]) * steps
    curve = BendCurve(force=nodes, bend=[0.0, *np.cumsum(rises).tolist()])
    x, rise = solve_along(table_of(curve), count_of(curve), 1.0, 1.0, wanted, 0.0)
    assert rise > 0.0
    assert x + float(curve.at(x)) == pytest.approx(wanted, abs=1e-9)


def test_a_force_through_a_damping_of_several_segments_settles_at_its_speed() -> None:
    """Without springs c·v + g(v) = F at the end; the first segment is 40 times as steep as c."""
    curve = FrictionCurve(
        rate=[0.0, 0.002, 0.02, 0.05, 0.06],
        force=[0.0, 6.0, 7.0, 4.0, 4.0],
        force_push=[0.0, 3.0, 3.0, 9.0, 9.0],
    )
    table = {
        "rate_m_per_s": curve.rate,
        "force_N": curve.force,
        "force_push_N": curve.force_push,
    }
    assert damping_table(curve)[0, : 2 * len(curve.rate) - 1].tolist() == [
        *(-rate for rate in curve.rate[:0:-1]),
        *curve.rate,
    ]
    free = {"basic_gradient_N_per_m": 0.0, "friction_curve": table}
    rig = bench({**free, f"{SCHEDULE}.total_gradient_N_per_m": [0.0, 0.0]})
    for force, forces in ((7.3, curve.force), (-5.0, curve.force_push)):
        controls = pack(rig)
        script = np.full((1, 2, 200 * rig.substeps + 1), force)
        record = np.zeros((200, 12))
        for k in range(100):
            step_frame(controls, script, record, k, (0.0,), 1.0)
        speed = float(controls["state"]["loader"]["rate"][0])
        assert 0.002 < abs(speed) < 0.05
        level = float(np.interp(abs(speed), curve.rate, forces))
        assert 75.0 * abs(speed) + level == pytest.approx(abs(force), rel=1e-9)


@pytest.mark.slow
def test_an_imposed_motion_is_answered_with_damping_and_spring_of_curves() -> None:
    time = np.arange(400) / RATE_Hz
    way = 0.05 * np.sin(8.0 * time)

    def answered(changes: dict[str, Any]) -> Floats:
        rig = bench(changes)
        return answer_to(rig, "column", on_nodes(rig, way), Feel(np.full(len(way), 560.0))).force

    more = {
        "friction_curve": {"rate_m_per_s": [0.0, 0.2, 0.5], "force_N": [0.0, 2.0, 20.0]},
        "force_curve": line(*SPRING, 90.0, 0.05),
    }
    rate = 0.4 * np.cos(8.0 * time)
    damped = np.sign(rate) * np.interp(np.abs(rate), [0.0, 0.2, 0.5], [0.0, 2.0, 20.0])
    found = answered(more) - answered({})
    np.testing.assert_allclose(found[5:-5], (damped + 90.0 * way)[5:-5], atol=0.02)


def test_the_statics_have_each_curve() -> None:
    spring = line(*SPRING, 90.0, 0.1)
    bends = {"force_N": [0.0, 40.0, 80.0], "bend_m": [0.0, 1e-3, 5e-3]}
    reads = {"force_N": [-100.0, 0.0, 100.0], "reading_N": [-100.0, 0.0, 120.0]}
    plain = bench({"breakout_N": 3.0})
    rig = bench(
        {
            "breakout_N": 3.0,
            "force_curve": spring,
            "bend_curve": bends,
            f"{SENSING}.force_curve": reads,
            "controls.column.rigging.command_curve": {
                "deflection_norm": [0.0, 1.0],
                "command_norm": [0.0, 0.8],
            },
        }
    )
    at = np.array([-0.06, -0.01, 0.02, 0.1])
    first, second = (static_line(each, "column", 1500.0, at) for each in (plain, rig))
    np.testing.assert_allclose(second.force - first.force, 90.0 * at, rtol=1e-11)
    bend = rig.controls["column"].loader.bend
    bent = bend * second.force + np.sign(at) * np.interp(
        np.abs(second.force), bends["force_N"], bends["bend_m"]
    )
    beyond = np.maximum(np.abs(second.force) - 80.0, 0.0) * 1e-4 * np.sign(at)
    np.testing.assert_allclose(second.deflection, at + bent + beyond, rtol=1e-11)
    read = np.where(second.force > 0.0, 1.2, 1.0) * second.force
    np.testing.assert_allclose(second.estimate, at + bend * read, rtol=1e-11)
    np.testing.assert_allclose(second.command, -0.8 * second.estimate / 0.1778, rtol=1e-11)
    for deflection, force in zip(second.deflection, second.force, strict=True):
        point = static_point(rig, "column", 1500.0, float(deflection))
        assert float(point.force[0]) == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize("limit", [0.0, 0.02])
def test_a_grip_does_not_go_beyond_its_reach_through_curves(limit: float) -> None:
    rig = bench(
        {
            "friction_N": 2.0,
            "bend_limit_m": limit,
            "load_curve": {"load_N": [0.0, 30.0, 60.0], "friction_N": [0.0, 1.0, 9.0]},
            "bend_curve": {"force_N": [-50.0, 0.0, 50.0], "bend_m": [-2e-3, 0.0, 4e-3]},
        }
    )
    controls = pack(rig, {"column": Hand(reach=0.05)})
    times = np.arange(200 * rig.substeps + 1) / (100.0 * rig.substeps)
    script = np.zeros((1, 2, len(times)))
    script[0, 0] = 200.0 * np.sin(2.0 * np.pi * times)
    record = np.zeros((201, 12))
    for k in range(200):
        step_frame(controls, script, record, k, (1500.0,), 1.0)
    deflection = record[:200, 3]
    assert deflection.max() == pytest.approx(0.05, abs=1e-9)
    assert deflection.min() == pytest.approx(-0.05, abs=1e-9)


def test_a_rigid_structure_has_no_curve_and_small_motions_its_slope() -> None:
    bends = {"force_N": [0.0, 40.0, 80.0], "bend_m": [0.0, 1e-3, 5e-3]}
    damping = {"rate_m_per_s": [0.0, 0.1], "force_N": [2.0, 4.0], "force_push_N": [1.0, 5.0]}
    spring = {"deflection_m": [-0.1, 0.0, 0.1], "force_N": [-5.0, 0.0, 9.0]}
    rig = bench({"bend_curve": bends, "friction_curve": damping, "force_curve": spring})
    assert configure(rig, "rigid").controls["column"].loader.bend_curve.nodes == []
    local = about_rest(rig).controls["column"].loader
    assert local.bend == pytest.approx(rig.controls["column"].loader.bend + 2.5e-5)
    assert local.damping == pytest.approx(75.0 + 0.5 * (20.0 + 40.0))
    assert local.basic_gradient == pytest.approx(560.0 + 0.5 * (50.0 + 90.0))
    assert not (local.bend_curve.nodes or local.friction_curve.nodes or local.force_curve.nodes)
    plain = bench()
    assert about_rest(plain) is plain
    soft = bench({"force_curve": {"deflection_m": [0.0, 0.1], "force_N": [0.0, -60.0]}})
    with pytest.raises(InputError) as refused:
        about_rest(soft)
    assert refused.value.key == "controls.column.loader.force_curve"


def test_the_range_of_gradients_and_the_breakaway_have_their_curves() -> None:
    peak = {"dynamic_pressure_Pa": [0.0, 1500.0, 3000.0], "gradient_N_per_m": [0.0, 1800.0, 0.0]}
    rub = {"rate_m_per_s": [0.0, 0.1], "force_N": [2.0, 9.0], "force_push_N": [4.0, 4.0]}
    rig = bench({f"{SCHEDULE}.gradient_curve": peak, "friction_N": 1.0, "friction_curve": rub})
    control = rig.controls["column"]
    assert gradient_range(control) == pytest.approx((560.0, 0.5 * (560.0 + 2189.0) + 1800.0))
    assert gradient_range(bench().controls["column"]) == (560.0, 2189.0)
    assert breakaway_force(control.loader) == 1.0 + 4.0


def test_a_rig_file_keeps_its_curves(tmp_path: Path) -> None:
    changes = {
        "force_curve": {"deflection_m": [0.0, 0.05, 0.1], "force_N": [0.0, 3.0, 4.0]},
        f"{SENSING}.force_curve": {"force_N": [-9.0, 9.0], "reading_N": [-9.0, 8.0]},
    }
    rig = bench(changes)
    rig.save(tmp_path / "rig.toml")
    again = read_rig(tmp_path / "rig.toml")
    assert again == rig
    less = again.changed({"controls.column.loader.force_curve": {}})
    less.save(tmp_path / "less.toml")
    assert read_rig(tmp_path / "less.toml") == bench(dict([list(changes.items())[1]]))
    assert again["controls.column.loader.force_curve.force_N"] == [0.0, 3.0, 4.0]


def test_an_export_to_jsbsim_refuses_a_curve_by_its_name() -> None:
    check_keys(bench(), "rig.toml")
    for key, (of, value, _) in KINDS.items():
        rig = bench({key: {of: [0.0, 1.0], value: [0.0, 1e-5 if value == "bend_m" else 0.5]}})
        with pytest.raises(InputError) as refused:
            check_keys(rig, "rig.toml")
        assert refused.value.key.endswith(key.rpartition(".")[2])
        assert "export an FMU" in refused.value.problem


@pytest.mark.parametrize(
    ("key", "table", "where", "said"),
    [
        ("force_curve", {"deflection_m": [0.0, 0.1]}, ".force_N", "is missing"),
        ("force_curve", {"deflection_m": [0.0], "force_N": [0.0]}, ".deflection_m", "at least two"),
        ("force_curve", line(*SPRING, 1.0, 0.0), ".deflection_m", "must rise"),
        (
            "force_curve",
            {"deflection_m": [0.0, 0.1], "force_N": [0.0, 1.0, 2.0]},
            ".force_N",
            "has 3 values, deflection_m 2",
        ),
        (
            "force_curve",
            {"deflection_m": np.linspace(0, 1, 25).tolist(), "force_N": [0.0] * 25},
            ".deflection_m",
            "more than 24",
        ),
        ("force_curve", {"deflection_m": [0.1, 0.2], "force_N": [0, 1.0]}, ".deflection_m", "rise"),
        ("force_curve", {"deflection_m": [0.0, 0.2], "force_N": [2.0, 3.0]}, ".force_N", "begins"),
        ("force_curve", {"deflection": [0.0, 0.2]}, ".deflection", "deflection_m"),
        ("force_curve", line(*SPRING, -1e9, 0.1), ".force_N", "at most"),
        ("friction_curve", line(*DAMPING, -1e6, 0.1), ".force_N", "at most"),
        ("friction_curve", line(*DAMPING, 1.0, 0.1, -0.1), ".rate_m_per_s", "begin at 0"),
        ("load_curve", line("load_N", "friction_N", 0.95, 9.0), ".friction_N", "0.9 at most"),
        (
            "load_curve",
            {"load_N": [0.0, 9.0, 20.0], "friction_N": [0.0, -1.0, 2.0]},
            ".friction_N",
            "is -1 at 9; dry friction is not below 0",
        ),
        (
            "friction_curve",
            {"rate_m_per_s": [0.0, 0.1], "force_N": [1.0, 0.0], "force_push_N": [-2.0, 1.0]},
            ".force_push_N",
            "is -2 at 0; dry friction is not below 0",
        ),
        ("bend_curve", line("force_N", "bend_m", -1e-4, 9.0), ".bend_m", "against the force"),
        (
            "bend_curve",
            {"force_N": [-1.0, 1.0], "bend_m": [1e-4, 2e-4]},
            ".bend_m",
            "without a force",
        ),
        (
            f"{SENSING}.force_curve",
            {"force_N": [-9.0, 0.0, 9.0], "reading_N": [-9.0, 0.0, -1.0]},
            ".reading_N",
            "may not fall",
        ),
        (
            f"{SCHEDULE}.gradient_curve",
            {"dynamic_pressure_Pa": [0.0, 900.0], "gradient_N_per_m": [0.0, -1500.0]},
            "",
            "cannot be negative",
        ),
        (
            f"{SCHEDULE}.gradient_curve",
            {"dynamic_pressure_Pa": [0.0, 900.0], "gradient_N_per_m": [0.0, 20000.0]},
            None,
            "K·G_T",
        ),
    ],
)
def test_a_wrong_curve_is_one_line_with_its_key(
    key: str, table: dict[str, Any], where: str | None, said: str
) -> None:
    with pytest.raises(InputError) as refused:
        bench({key: table})
    if where is not None:
        dotted = key if "." in key else f"controls.column.loader.{key}"
        assert refused.value.key == dotted + where
    assert said in refused.value.problem
    assert "\n" not in str(refused.value)
