"""Forces that bend a common structure at other controls, and structures that cannot be."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import coupled
from coupled.errors import InputError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import configure
from coupled.flight.runfile import read_run
from coupled.rig import linkage
from coupled.rig.declaration import Hand
from coupled.rig.frame import CHANNELS_PER_CONTROL, step_frame
from coupled.rig.packing import pack
from coupled.rig.replay import replay_compensation, replay_linkage
from coupled.rig.rig import Rig
from coupled.rig.rigfile import rig_from_table
from coupled.rig.rigwrite import rig_text
from coupled.rig.statics import static_line, static_point
from coupled.rig.structure import Structure, whole
from coupled.schema import loads_toml
from tests.support.joined import BETWEEN, FULL, RADIUS, STRUCTURE, joined
from tests.support.rigs import G_STIFF, K_REPORT, bench

Floats = np.ndarray


def rig_with(structure: dict[str, Any], changes: dict[str, Any]) -> Rig:
    """Return the joined bench with another structure, changed at once with the rest."""
    return joined({**changes, "structure": structure})


def settled(rig: Rig, column_N: float, wheel_N: float, pressure: float = 3000.0) -> Floats:
    """Return the last row's channels, shape (2, 9), after 6 s of forces held."""
    packed, frames = pack(rig), round(6.0 * rig.frame_rate)
    script = np.zeros((2, 2, frames * rig.substeps + 1))
    script[:, 0] = np.array([[column_N], [wheel_N]])
    record = np.zeros((frames, 2 + 2 * CHANNELS_PER_CONTROL))
    for k in range(frames):
        step_frame(packed, script, record, k, (pressure,), 1.0)
    return record[-1, 1:-1].reshape(2, CHANNELS_PER_CONTROL)


def test_every_force_bends_at_every_control() -> None:
    rig = joined()
    (column, wheel) = settled(rig, 150.0, 60.0)
    assert column[2] - column[1] == pytest.approx(K_REPORT * 150.0 + BETWEEN * 60.0, rel=1e-9)
    assert wheel[2] - wheel[1] == pytest.approx(8e-4 * 60.0 + BETWEEN / RADIUS * 150.0, rel=1e-9)


def test_the_structure_follows_the_force_without_delay() -> None:
    """At every frame, also while both forces move, to the last bit of the sum."""
    rig = joined()
    packed, frames = pack(rig), 100
    times = np.arange(frames * rig.substeps + 1) / (rig.frame_rate * rig.substeps)
    script = np.zeros((2, 2, len(times)))
    script[0, 0], script[1, 0] = 100.0 * np.sin(5.0 * times), 50.0 * np.cos(7.0 * times)
    record = np.zeros((frames, 2 + 2 * CHANNELS_PER_CONTROL))
    for k in range(frames):
        step_frame(packed, script, record, k, (0.0,), 1.0)
    alone = rig.changed({"structure.column_by_wheel_m_per_N": 0.0, "structure.reciprocal": False})
    other = pack(alone)
    apart = np.zeros_like(record)
    for k in range(frames):
        step_frame(other, script, apart, k, (0.0,), 1.0)
    wheel = record[:, 1 + CHANNELS_PER_CONTROL]
    assert record[:, 3] - apart[:, 3] == pytest.approx(BETWEEN * wheel, abs=1e-15)


def test_a_structure_without_terms_changes_no_bit() -> None:
    """Joined or not, the same numbers: the order of the nodes does not matter without terms."""
    rig = joined(structure={"column_by_wheel_m_per_N": 1e-300 * 0.0})
    assumed = joined(structure={}, assumed={"column_by_wheel_m_per_N": 1e-5}).changed(
        {"controls.column.compensation.deflection": False}
    )
    plain = rig.changed({"controls.column.compensation.deflection": False})
    assert np.array_equal(settled(plain, 150.0, 60.0), settled(assumed, 150.0, 60.0))


def test_a_flight_is_the_same_node_by_node_together_or_control_by_control() -> None:
    """Controls that a structure joins are integrated together; 1e-30 m/N joins, and bends none."""
    run = replace(read_run("three-controls")[0], duration_s=10.0)
    rig = run.rig.changed({f"controls.{name}.loader.friction_N": 3.0 for name in run.rig.controls})
    # The column's grip comes to its reach.
    pilots = {**run.pilots, "column": run.pilots["column"].model_copy(update={"reach_m": 0.01})}
    run = replace(run, rig=rig, pilots=pilots)

    joining = rig.changed({"structure.column_by_pedals_m_per_N": 1e-30})
    assert [pack(one)["parameters"]["crossing"]["joined"].any() for one in (rig, joining)] == [
        False,
        True,
    ]
    apart, together = fly(run), fly(replace(run, rig=joining))
    for name in rig.controls:
        assert np.ptp(apart[f"{name}_hand_force_N"]) > 10.0
    assert np.ptp(apart["column_deflection_m"]) == pytest.approx(0.02, rel=1e-9)
    assert together.channels == apart.channels
    np.testing.assert_allclose(together.data, apart.data, rtol=0.0, atol=1e-24)


@pytest.mark.parametrize(
    ("assumed", "left"), [({}, BETWEEN), ({"column_by_wheel_m_per_N": 2e-5}, 1e-5), (FULL, 0.0)]
)
def test_the_host_adds_what_it_assumes_of_the_others(assumed: dict[str, Any], left: float) -> None:
    rig = joined(assumed=assumed)
    column, _ = settled(rig, 150.0, 60.0)
    assert column[2] - column[3] == pytest.approx(left * 60.0, abs=1e-12)
    off = joined({"controls.column.compensation.deflection": False}, assumed=assumed)
    column, _ = settled(off, 150.0, 60.0)
    assert column[3] == pytest.approx(column[1], rel=1e-12)


def test_the_host_adds_the_force_as_it_reads_it() -> None:
    rig = joined({"controls.wheel.sensing.force_scale": 1.1}, assumed=FULL)
    column, _ = settled(rig, 150.0, 60.0)
    assert column[3] - column[2] == pytest.approx(0.1 * BETWEEN * 60.0, rel=1e-6)


def test_the_host_adds_the_force_that_the_gauge_has() -> None:
    """The wheel's gauge has a slow amplifier, so the host adds its force late."""
    slow = {"gauge_frequency_Hz": 0.01, "gauge_order": "first"}
    changes = {f"controls.wheel.sensing.{key}": value for key, value in slow.items()}
    column, wheel = settled(joined(changes, assumed=FULL), 150.0, 60.0)
    assert 0.0 < wheel[0] < 30.0  # F as the gauge has it, after 6 s
    assert column[3] - column[1] == pytest.approx(
        K_REPORT * column[0] + BETWEEN * wheel[0], rel=1e-9
    )


def test_losses_of_joined_controls_are_those_of_eq_7a_for_a_matrix() -> None:
    """A bench flown against K·G·δ, with what each loader holds."""
    rig = joined(
        {
            "controls.column.compensation.deflection": False,
            "controls.wheel.compensation.deflection": False,
        }
    )
    column, wheel = settled(rig, 150.0, 60.0)
    seen = np.array([column[2], wheel[2]])
    felt = np.array([150.0, 60.0]) / seen
    lost = seen - np.array([column[3], wheel[3]])
    controls = {str(name): control for name, control in rig.controls.items()}
    assert lost == pytest.approx(whole(controls, rig.structure) @ (felt * seen), rel=1e-9)


def test_felt_forces_of_joined_controls() -> None:
    """F = (1 + g·K)⁻¹·g·δ: with the diagonal known, G·(δ − Σ K_ij·F_j)."""
    rig = joined()
    column, wheel = settled(rig, 150.0, 60.0)
    controls = {str(name): control for name, control in rig.controls.items()}
    gradient = np.array([G_STIFF, 90.0])
    bends = whole(controls, rig.structure)
    on_computed = gradient / (1.0 - np.diag(bends) * gradient)
    seen = np.array([column[2], wheel[2]])
    left = np.eye(2) + on_computed[:, None] * bends
    found = np.linalg.solve(left, on_computed * seen)
    assert found == pytest.approx([150.0, 60.0], rel=1e-6)
    shifted = gradient[0] * (seen[0] - BETWEEN * 60.0)
    assert shifted == pytest.approx(150.0, rel=1e-6)


def test_the_static_line_holds_with_forces_on_the_others() -> None:
    rig = joined(assumed={"column_by_wheel_m_per_N": 2e-5})
    column, _ = settled(rig, 150.0, 60.0)
    line = static_line(rig, "column", 3000.0, np.array([column[1]]), {"wheel": 60.0})
    assert line.force[0] == pytest.approx(150.0, rel=1e-6)
    assert line.deflection[0] == pytest.approx(column[2], rel=1e-9)
    assert line.estimate[0] == pytest.approx(column[3], rel=1e-9)
    point = static_point(rig, "column", 3000.0, column[2], {"wheel": 60.0})
    assert point.computed[0] == pytest.approx(column[1], rel=1e-9)
    opposite = static_point(rig, "column", 3000.0, 0.001, {"wheel": 60.0})
    assert opposite.deflection[0] == pytest.approx(0.001, rel=1e-9)
    assert opposite.force[0] < 0.0


@pytest.mark.parametrize("stiffness", [1e4, 1e7, 1e10])
def test_two_stiff_clamps_on_one_structure_are_stable(stiffness: float) -> None:
    """Between loaders at rest, at 0.95 of what positive definiteness allows: F = K⁻¹·δ."""
    most = 0.95 * float(np.sqrt(K_REPORT * 8e-4 * RADIUS))
    between = {
        "column_by_wheel_m_per_N": most,
        "wheel_by_column_rad_per_N": most / RADIUS,
        "reciprocal": True,
    }
    still = {
        f"controls.{name}.loader.{key}{end}": 1e12
        for name, d in (("column", "m"), ("wheel", "rad"))
        for key, end in (("mass", "_kg"), ("damping", f"_N_s_per_{d}"))
    }
    soft = {"controls.column.schedule.total_gradient_N_per_m": [560.0, 560.0]}
    soft |= {"controls.wheel.schedule.total_gradient_N_per_rad": [30.0, 30.0]}
    rig = rig_with(between, {**still, **soft})
    hand = Hand(stiffness=stiffness)
    packed, frames = pack(rig, {"column": hand, "wheel": hand}), 300
    script = np.zeros((2, 2, frames * rig.substeps + 1))
    ramp = np.minimum(np.linspace(0.0, 3.0, script.shape[2]), 1.0)
    script[:, 1] = np.array([[0.005], [0.04]]) * ramp
    record = np.zeros((frames, 2 + 2 * CHANNELS_PER_CONTROL))
    for k in range(frames):
        step_frame(packed, script, record, k, (0.0,), 1.0)
    controls = {str(name): control for name, control in rig.controls.items()}
    bends = whole(controls, rig.structure) + np.eye(2) / stiffness
    wanted = np.linalg.solve(bends, [0.005, 0.04])
    assert record[-1, [1, 1 + CHANNELS_PER_CONTROL]] == pytest.approx(wanted, rel=1e-5)


def test_clamps_on_moving_loaders_settle() -> None:
    """Hands of 10 kN/m on loaders that move, at half of what positive definiteness allows."""
    most = 0.5 * float(np.sqrt(K_REPORT * 8e-4 * RADIUS))
    rig = rig_with(
        {"column_by_wheel_m_per_N": most, "wheel_by_column_rad_per_N": most / RADIUS},
        {"controls.column.schedule.total_gradient_N_per_m": [560.0, 560.0]},
    )
    hands = {
        "column": Hand(stiffness=1e4, damping=100.0),
        "wheel": Hand(stiffness=1e3, damping=10.0),
    }
    packed, frames = pack(rig, hands), 600
    script = np.zeros((2, 2, frames * rig.substeps + 1))
    script[:, 1] = np.array([[0.05], [0.4]]) * np.minimum(np.linspace(0.0, 6.0, script.shape[2]), 1)
    record = np.zeros((frames, 2 + 2 * CHANNELS_PER_CONTROL))
    for k in range(frames):
        step_frame(packed, script, record, k, (0.0,), 1.0)
    assert np.ptp(record[-50:, [1, 1 + CHANNELS_PER_CONTROL]], axis=0) == pytest.approx(0, abs=1e-3)


def test_a_record_of_joined_controls_shows_a_linkage_gap_to_a_diagonal_rig() -> None:
    rig = joined()
    column, _ = settled(rig, 150.0, 60.0)
    held = {name: np.full(400, value) for name, value in (("c", column[1]), ("f", 150.0))}
    others = {"wheel": np.full(400, 60.0)}
    seen = replay_linkage(rig, "column", held["c"], held["f"], others)
    assert seen[-1] == pytest.approx(column[2], rel=1e-9)
    apart = rig.changed({"structure": type(rig.structure)()})
    assert column[2] - replay_linkage(apart, "column", held["c"], held["f"], others)[-1] == (
        pytest.approx(BETWEEN * 60.0, rel=1e-9)
    )
    host = joined(assumed=FULL)
    estimate = replay_compensation(host, "column", held["c"], held["f"], others)
    assert estimate[-1] == pytest.approx(column[2], rel=1e-9)


@pytest.mark.parametrize(
    ("structure", "problem"),
    [
        (
            {"column_by_pedals_m_per_N": 1e-5},
            r"structure\.column_by_pedals_m_per_N: the rig has no",
        ),
        (
            {"column_by_wheel_m_per_N": 1e-4, "wheel_by_column_rad_per_N": 8e-4},
            r"structure: the compliance of column, wheel is not positive definite",
        ),
        (
            {**STRUCTURE, "wheel_by_column_rad_per_N": 1.5e-4},
            r"structure\.wheel_by_column_rad_per_N: is 0\.00015; .* reciprocal: 0\.00012",
        ),
        ({"column_by_wheel_rad_per_N": 1e-5}, "wrong unit: give column_by_wheel_m_per_N"),
    ],
)
def test_a_structure_that_cannot_be_is_refused_by_name(
    structure: dict[str, Any], problem: str
) -> None:
    with pytest.raises(InputError, match=problem):
        joined(structure=structure)


def test_reciprocity_is_checked_only_where_asked_for() -> None:
    free = {**STRUCTURE, "wheel_by_column_rad_per_N": 1.5e-4, "reciprocal": False}
    assert joined(structure=free).structure.wheel_by_column == 1.5e-4


def test_gradients_are_bounded_by_the_eigenvalue() -> None:
    """K·G_T of each control is below 1, and their structure still refuses both together."""
    stiff = {"controls.wheel.schedule.total_gradient_N_per_rad": [30.0, 1.0]}
    at = 0.9 / K_REPORT
    changes = {"controls.column.schedule.total_gradient_N_per_m": [560.0, at], **stiff}
    assert joined(changes).controls["column"].schedule.total_gradient[-1] == at
    both = {**changes, "controls.wheel.schedule.total_gradient_N_per_rad": [30.0, 0.9 / 8e-4]}
    rigid = joined({"structure": {}})
    assert rigid.changed(both).structure.stands_apart
    with pytest.raises(InputError, match=r"structure: K·G_T has the eigenvalue 1\.\d+ at 3000 Pa"):
        joined(both)


def test_a_stiffening_bend_does_not_join() -> None:
    with pytest.raises(InputError, match=r"loader\.bend_limit_m: a structure that joins"):
        joined({"controls.column.loader.bend_limit_m": 0.02})


def test_a_structure_is_written_as_it_is_read() -> None:
    rig = joined(assumed=FULL)
    assert rig_from_table(loads_toml(rig_text(rig), "again"), "again") == rig
    assert "[structure.assumed]" in rig_text(rig)
    assert "structure" not in rig_text(bench())


def test_the_rigid_configuration_has_no_structure() -> None:
    rigid = configure(joined({"controls.column.loader.bend_push_m_per_N": 9e-5}), "rigid")
    assert rigid.structure.stands_apart
    column, _ = settled(rigid, -150.0, 60.0)
    assert column[2] == pytest.approx(column[1], rel=1e-12)
    assert joined().only("column").structure.stands_apart
    assert coupled.load_rig("t37").structure.stands_apart


def test_a_force_within_the_plays_width_of_the_carried_one_moves_only_the_elastic_share() -> None:
    """Before the node's force is carried: share s lags by half the width, to either side."""
    share, width, force = 0.4, 20.0, 30.0
    packed = pack(bench({"bend_hysteresis_share": share, "bend_hysteresis_width_N": width}))
    p, s = packed["parameters"][0]["linkage"], packed["state"][0]["linkage"]
    for side in (1.0, -1.0):
        s["carried"] = 0.0
        found = linkage.deflection(p, s, side * force)
        lagged = force - share * 0.5 * width
        assert found == pytest.approx(side * K_REPORT * lagged, rel=1e-12)
        near = linkage.deflection(p, s, side * 0.4 * width)  # nothing of the play is taken up
        assert near == pytest.approx(side * K_REPORT * (1.0 - share) * 0.4 * width, rel=1e-12)


def test_a_structure_need_not_be_reciprocal_unless_it_is_asked_for() -> None:
    assert not Structure().reciprocal
