"""Curves: a force specified over deflection and q̄, by closed forms of its segments."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.flight.manoeuvre import configure
from coupled.rig.equations import specified_force
from coupled.rig.rig import Rig
from coupled.rig.rigfile import rig_from_table
from coupled.rig.rigwrite import rig_table, rig_text
from coupled.rig.standalone import run_control
from coupled.rig.statics import static_line, static_point
from coupled.schema import loads_toml
from tests.support.curves import COLUMN_N, CYCLIC, CYCLIC_N, SCHEDULE, SEGMENT, column, curved
from tests.support.rigs import BENCH, K_REPORT, bench

AT = np.concatenate((np.linspace(-0.15, -0.001, 150), np.linspace(0.001, 0.15, 150)))
TERMS = [("exact", True), ("printed", True), ("exact", False)]


@pytest.mark.parametrize(("term", "on"), TERMS)
@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
def test_a_curve_of_one_or_two_segments_is_the_gradients(
    term: str, on: bool, multiplier: str
) -> None:
    """Eq. (12) and appendix C: the code of one and two gradients is the reference."""
    both: dict[str, Any] = {
        "breakout_N": 9.0,
        "multiplier": multiplier,
        "controls.column.compensation.breakout_term": term,
        "controls.column.compensation.gradient": on,
        "controls.column.sensing.computed_scale": 1.03,
        "controls.column.sensing.modifying_scale": 0.98,
    }
    second = {
        f"{SCHEDULE}.second_gradient_N_per_m": [300.0, 1000.0],
        f"{SCHEDULE}.break_deflection_m": 0.05,
    }
    within = second | {f"{SCHEDULE}.break_deflection_m": 0.0006}  # within the bend by the breakout
    one = curved([0.0, 0.1], [[0.0, 56.0], [0.0, 218.9]], both)
    two = curved([0.0, 0.05, 0.1], [[0.0, 28.0, 43.0], [0.0, 109.45, 159.45]], both)
    near = [[0.0, 0.336, 30.156], [0.0, 1.3134, 100.7134]]
    early = curved([0.0, 0.0006, 0.1], near, both)
    for rig, same in ((one, {}), (two, second), (early, within)):
        filed = bench(both | same)
        for q in (0.0, 1200.0, 4000.0):
            ours, theirs = (static_line(each, "column", q, AT) for each in (rig, filed))
            for name in ("force", "estimate", "specified"):
                wanted = getattr(theirs, name)
                assert getattr(ours, name) == pytest.approx(wanted, rel=1e-9, abs=1e-9), name


def test_five_segments_with_breakout_are_felt_as_specified() -> None:
    """F_mod = F_spec(δ̂) − G_B·δc: what is felt at δ is what is specified there."""
    for q in (0.0, 1700.0, 3000.0):
        line = static_line(column(), "column", q, AT)
        assert line.force == pytest.approx(line.specified, rel=1e-9)
        assert line.estimate == pytest.approx(line.deflection, rel=1e-9)
        share = q / 3000.0
        row = (1.0 - share) * np.array(COLUMN_N[0]) + share * np.array(COLUMN_N[1])
        size = np.abs(line.deflection)
        inside = size < SEGMENT[-1]
        by_hand = np.sign(line.deflection) * (17.8 + np.interp(size, SEGMENT, row))
        assert line.specified[inside] == pytest.approx(by_hand[inside], rel=1e-12)


def test_the_authority_lost_over_a_curve_is_the_closed_form() -> None:
    """Without corrections the loader holds F = F_BO + f(δc), and the host misses K·F of δ."""
    rig = configure(column(), "uncompensated")
    line = static_line(rig, "column", 3000.0, AT)
    size = np.abs(line.computed)
    inside = size < SEGMENT[-1]
    held = np.sign(line.computed) * (17.8 + np.interp(size, SEGMENT, COLUMN_N[1]))
    deflection = line.computed + K_REPORT * held
    assert line.force[inside] == pytest.approx(held[inside], rel=1e-9)
    lost = 1.0 - line.estimate / line.deflection
    assert lost[inside] == pytest.approx((K_REPORT * held / deflection)[inside], rel=1e-9)


def test_beyond_its_ends_a_curve_goes_on_at_its_last_slope() -> None:
    rig = curved([-0.1, 0.0, 0.05], [[-30.0, 0.0, 20.0]])
    line = static_line(rig, "column", 0.0, np.array([-0.14, 0.13]))
    wanted = [
        -30.0 + 300.0 * (line.deflection[0] + 0.1),
        20.0 + 400.0 * (line.deflection[1] - 0.05),
    ]
    assert line.force == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("breakout", [0.0, 6.0])
def test_a_cyclic_flat_about_the_middle_pulls_unlike_it_pushes(breakout: float) -> None:
    rig = curved(CYCLIC, [CYCLIC_N], {"breakout_N": breakout})
    line = static_line(rig, "column", 800.0, AT)
    inside = (line.deflection > CYCLIC[0]) & (line.deflection < CYCLIC[-1])
    wanted = np.interp(line.deflection, CYCLIC, CYCLIC_N) + breakout * np.sign(line.deflection)
    assert line.force[inside] == pytest.approx(wanted[inside], rel=1e-9, abs=1e-9)
    middle = static_point(rig, "column", 800.0, 0.007)
    assert float(middle.force[0]) == pytest.approx(breakout, abs=1e-9)


def test_sides_whose_bend_at_the_breakout_differs_have_their_own_extra_breakout() -> None:
    """At δc = 0 the grip is at δ = K·F: 60 N·K/(1 − K·G) more on the stiff side."""
    rig = curved([-0.1, 0.0, 0.1], [[-20.0, 0.0, 200.0]], {"breakout_N": 60.0})
    line = static_line(rig, "column", 0.0, np.array([-1e-9, 1e-9]))
    wanted = [-60.0 / (1.0 - K_REPORT * 200.0), 60.0 / (1.0 - K_REPORT * 2000.0)]
    assert line.force == pytest.approx(wanted, rel=1e-6)
    whole = static_line(rig, "column", 0.0, AT)
    assert whole.force == pytest.approx(whole.specified, rel=1e-9)


def test_a_slope_error_changes_the_rise_of_each_node() -> None:
    wrong = column({f"{SCHEDULE}.slope": 0.5})
    line = static_line(wrong, "column", 3000.0, AT)
    half = column()
    assert line.force == pytest.approx(
        specified_force(half, "column", 1500.0, line.deflection), rel=1e-9
    )


def held_force(rig: Rig, pressure: float, force: float) -> tuple[float, float, float]:
    """Return δ, F and the specified force after two seconds of a constant force."""
    frames = round(2.0 * rig.frame_rate)
    nodes = np.full(frames * rig.substeps + 1, force)
    run = run_control(rig, "column", nodes, np.full(frames, pressure))
    at = float(run.deflection[-1])
    asked = float(specified_force(rig, "column", pressure, np.array(at)))
    return at, force, asked


@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
def test_a_held_force_meets_the_curve(multiplier: str) -> None:
    """Frame by frame, not by the statics: felt to 0.1 % of the closed form."""
    rig = column({"friction_N": 0.0, "multiplier": multiplier})
    for pressure, force in ((3000.0, 120.0), (1000.0, -60.0)):
        _, felt, asked = held_force(rig, pressure, force)
        assert felt == pytest.approx(asked, rel=1e-3)


def test_the_recorded_gradient_is_that_of_the_segment() -> None:
    rig = column({"friction_N": 0.0})
    frames = round(2.0 * rig.frame_rate)
    nodes = np.full(frames * rig.substeps + 1, 120.0)  # 17.8 + 102.2 N, on the third segment
    run = run_control(rig, "column", nodes, np.full(frames, 3000.0))
    assert run.gradient[-1] == pytest.approx((120.0 - 84.0) / 0.04, rel=1e-6)


HOSTS: list[dict[str, Any]] = [
    {"breakout_N": 9.0, "friction_N": 2.0},
    {"breakout_N": 9.0, f"{SCHEDULE}.break_deflection_m": 0.0006},  # within the bend by the 9 N
    {"controls.column.sensing.gradient_skew_s": 0.004},
    {"multiplier": "digital", "controls.column.compensation.missed_share": 0.3},
    {"modifying_lag_s": 0.01, "force_limit_N": 30.0},
    {
        "controls.column.sensing.word_length_bits": 10,
        "controls.column.sensing.s1_V_per_m": 500.0,
        "controls.column.sensing.s2_V_per_N": 0.2,
        "controls.column.sensing.s3_V_per_N": 0.2,
    },
]


@pytest.mark.parametrize("host", HOSTS)
def test_a_curve_of_two_segments_moves_as_the_gradients_do(host: dict[str, Any]) -> None:
    """In motion at a changing q̄, and through each part of the host that F_mod passes."""
    at = f"{SCHEDULE}.break_deflection_m"
    second: dict[str, Any] = {f"{SCHEDULE}.second_gradient_N_per_m": [300.0, 1000.0], at: 0.05}
    second |= host
    broken = float(second[at])
    rows = [[0.0, g * broken, g * broken + h * 0.1] for g, h in ((560.0, 300.0), (2189.0, 1000.0))]
    own = {key: value for key, value in host.items() if key != at}
    runs = []
    for rig in (curved([0.0, broken, broken + 0.1], rows, own), bench(second)):
        times = np.arange(60 * rig.substeps + 1) / (rig.frame_rate * rig.substeps)
        force = 80.0 * np.sin(9.0 * times)
        runs.append(run_control(rig, "column", force, np.linspace(500.0, 2900.0, 60)))
    ours, theirs = runs
    assert np.max(np.abs(theirs.computed)) > 0.05
    assert ours.computed == pytest.approx(theirs.computed, abs=1e-9)
    assert ours.modifying == pytest.approx(theirs.modifying, abs=1e-6)


def test_a_rig_with_a_curve_is_written_and_read_back() -> None:
    rig = curved(CYCLIC, [CYCLIC_N])
    assert rig_from_table(loads_toml(rig_text(rig), "again"), "again") == rig
    assert rig_from_table(rig_table(rig), "again") == rig


WRONG: list[tuple[dict[str, Any], str, str]] = [
    ({"force_N": None}, "force_N", "is missing; a curve needs both"),
    ({"deflection_m": None}, "deflection_m", "is missing; a curve needs both"),
    ({"total_gradient_N_per_m": [1.0]}, "force_N", "give either"),
    ({"deflection_m": [0.0, 0.1, 0.1]}, "deflection_m", "must rise"),
    ({"deflection_m": [0.01, 0.1, 0.2]}, "deflection_m", "should rise from 0"),
    ({"deflection_m": [-0.2, -0.1, 0.0]}, "deflection_m", "should rise from 0"),
    ({"deflection_m": [0.01 * k for k in range(65)]}, "deflection_m", "more than 64"),
    ({"force_N": [[0.0, 1.0, 2.0]] * 2}, "force_N", "has 2 rows, dynamic_pressure_Pa 1"),
    ({"force_N": [[0.0, 1.0]]}, "force_N", "has 2 values at 0 Pa, deflection_m 3"),
    ({"force_N": [[5.0, 6.0, 7.0]]}, "force_N", "is 5 N at neutral, at 0 Pa; give 0 there"),
    ({"force_N": [[0.0, 30.0, 20.0]]}, "force_N", "falls between 0.05 and 0.1 m at 0 Pa"),
    ({"force_N": [[0.0, 10.0, 560.0]]}, "force_N", "K·G_T = 1 at 0 Pa between 0.05 and 0.1 m"),
    ({"force_N": [[0.0, 600.0, 620.0]]}, "force_N", "K·G_T = 1.1 at 0 Pa between 0 and 0.05 m"),
    (
        {"dynamic_pressure_Pa": [0.0, 9.0], "force_N": [[0.0, 10.0, 20.0], [0.0, 10.0, 560.0]]},
        "force_N",
        "K·G_T = 1 at 9 Pa between 0.05 and 0.1 m",
    ),
]


@pytest.mark.parametrize(("wrong", "key", "problem"), WRONG)
def test_a_wrong_curve_is_one_line(wrong: dict[str, Any], key: str, problem: str) -> None:
    schedule: dict[str, Any] = {
        "dynamic_pressure_Pa": [0.0],
        "deflection_m": [0.0, 0.05, 0.1],
        "force_N": [[0.0, 30.0, 50.0]],
    }
    table: dict[str, Any] = {key: value for key, value in BENCH.items() if key != "controls"}
    given = {k: v for k, v in (schedule | wrong).items() if v is not None}
    data = BENCH["controls"]["column"] | {"schedule": given}
    with pytest.raises(InputError) as refused:
        rig_from_table(table | {"controls": {"column": data}}, "test")
    assert refused.value.key == f"{SCHEDULE}.{key}"
    assert problem in refused.value.problem


def test_the_guard_of_a_segment_is_the_hosts_bend_times_its_slope_below_one() -> None:
    """K̂ = 2⁻¹³ m/N; 8192 N/m is refused, and a little less is not, however soft the structure."""
    bends = {"bend_m_per_N": 4e-4, "controls.column.compensation.bend_m_per_N": 2.0**-13}
    nodes = [0.0, 0.0625, 0.125]
    below = curved(nodes, [[0.0, 511.9, 600.0]], bends)
    assert below.controls["column"].schedule.curved
    with pytest.raises(InputError, match="stiffer than the structure") as refused:
        curved(nodes, [[0.0, 512.0, 600.0]], bends)
    assert refused.value.key == f"{SCHEDULE}.force_N"


def test_a_schedule_of_neither_kind_is_refused() -> None:
    data = BENCH["controls"]["column"] | {"schedule": {"dynamic_pressure_Pa": [0.0]}}
    with pytest.raises(InputError, match="is missing") as refused:
        rig_from_table(BENCH | {"controls": {"column": data}}, "test")
    assert refused.value.key == f"{SCHEDULE}.total_gradient_N_per_m"
