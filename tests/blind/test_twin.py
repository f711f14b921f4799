"""The twin against closed forms, and against the library's flight of the same force."""

from __future__ import annotations

import itertools
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from coupled.blind.trials.measure import stage_gaps
from coupled.blind.trials.rigs import random_rig
from coupled.blind.twin.effects import EFFECTS, dryden
from coupled.blind.twin.excitation import SHAPES, pilot_force, pilot_shape
from coupled.blind.twin.kernel import NODES
from coupled.blind.twin.kinds import Clean, Draw, Kind
from coupled.blind.twin.outsiders import OUTSIDERS
from coupled.blind.twin.revision2 import REVISION_2
from coupled.blind.twin.setting import (
    NOISE,
    Installed,
    Setting,
    draw_setting,
    fly_clean,
    with_other,
)
from coupled.blind.twin.twin import STIFF, airframe, fly_twin, nominal_twin
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile
from coupled.flight.pilot import ForceTable
from coupled.gap.effects.library import BY_NAME
from coupled.record.channels import ALPHA, SPEED
from coupled.record.record import Record
from coupled.rig.replay import replay_linkage
from tests.support.twin import POOL, STEP_N, WITHOUT_TWIN, alone, nodes, plain, stepped

ALL_EFFECTS = (*EFFECTS, *REVISION_2)


def test_a_step_answers_as_mass_spring_and_damper_do() -> None:
    rig, twin = plain()
    record = alone(rig, twin, stepped(2.0))
    m, c, g = (twin.get(name) for name in ("mass", "damping", "basic_gradient"))
    decay, rate = c / (2 * m), np.sqrt(g / m - (c / (2 * m)) ** 2)
    t = record.time_s - 0.5 / 120 / NODES  # the step takes a node to rise
    expected = (
        STEP_N / g * (1 - np.exp(-decay * t) * (np.cos(rate * t) + decay / rate * np.sin(rate * t)))
    )
    assert np.max(np.abs(record["column_computed_m"] - expected)[2:]) < 3e-7


def test_friction_leaves_a_band_as_wide_as_it_is() -> None:
    rig, twin = plain()
    twin.set(running=3.0, breakaway=3.0, stribeck_rate=0.002, bristle=3e6, bristle_damping=1000.0)
    t = np.arange(40 * 120 * NODES + 1) / (120 * NODES)
    record = alone(rig, twin, 20.0 * np.sin(2 * np.pi * t / 20.0))
    g = twin.get("basic_gradient")
    rates = np.gradient(record["column_computed_m"])
    left = record["column_force_N"] - g * record["column_computed_m"]
    moving = np.abs(rates) > 0.3 * np.max(np.abs(rates))
    drag = twin.get("damping") * rates * 120
    drag += twin.get("mass") * np.gradient(rates) * 120**2
    np.testing.assert_allclose((left - drag)[moving], 3.0 * np.sign(rates[moving]), atol=0.05)


def test_a_preload_holds_and_then_gives_way() -> None:
    rig, twin = plain()
    twin.set(breakout=9.0)
    rise = np.minimum(np.arange(2 * 120 * NODES + 1) / (120 * NODES), 1.0)
    held = alone(rig, twin, 8.5 * rise)
    assert np.max(np.abs(held["column_computed_m"])) < 5e-6
    freed = alone(rig, twin, stepped(5.0, 20.0))
    assert freed["column_computed_m"][-1] == pytest.approx(
        11.0 / twin.get("basic_gradient"), rel=1e-4
    )


def test_the_linkage_has_servo_play_and_bend() -> None:
    rig, twin = plain()
    twin.set(play=1e-3, bend=1e-4)
    record = alone(rig, twin, stepped(4.0))
    peak = np.max(record["column_computed_m"])  # the servo follows it within its lag
    assert record["column_deflection_m"][-1] == pytest.approx(peak - 5e-4 + 1e-4 * STEP_N, abs=2e-3)
    twin.set(play=0.0, bend_limit=5e-4)
    record = alone(rig, twin, stepped(4.0))
    bent = record["column_deflection_m"][-1] - record["column_computed_m"][-1]
    assert bent == pytest.approx(5e-4 * np.tanh(1e-4 * STEP_N / 5e-4), rel=1e-3)


def test_a_late_force_is_late() -> None:
    rig, twin = plain()
    prompt = alone(rig, twin, stepped(2.0))["column_computed_m"]
    twin.set(delay=6 / 120)
    late = alone(rig, twin, stepped(2.0))["column_computed_m"]
    np.testing.assert_allclose(late[6:], prompt[:-6], atol=1e-9)


@pytest.mark.parametrize("late_s", [6 / 120, 6.5 / 120])
def test_a_servo_with_a_dead_time_moves_as_it_would_but_later(late_s: float) -> None:
    """δ is that of a prompt servo the dead time ago; δc, ahead of the servo, is the same."""
    rig, twin = plain()
    rise = np.minimum(nodes(2.0) / 1.5, 1.0) ** 3 * STEP_N
    prompt = alone(rig, twin, rise)
    twin.set(servo_delay=late_s)
    late = alone(rig, twin, rise)
    np.testing.assert_array_equal(late["column_computed_m"], prompt["column_computed_m"])
    ago = CubicSpline(prompt.time_s, prompt["column_deflection_m"])(prompt.time_s - late_s)
    expected = np.where(prompt.time_s > late_s, ago, 0.0)
    np.testing.assert_allclose(late["column_deflection_m"], expected, atol=2e-8)


def test_the_gust_has_its_strength_and_its_length() -> None:
    found = np.array([dryden(7200, 120.0, 1.5, 2.0, seed)[240:] for seed in range(60)])
    assert np.sqrt(np.mean(found**2)) == pytest.approx(1.5, rel=0.1)
    lag = 120  # 1 s: Dryden's correlation e^(−τ/T)·(1 − τ/2T)
    alike = np.mean(found[:, lag:] * found[:, :-lag]) / np.mean(found**2)
    assert alike == pytest.approx(np.exp(-0.5) * 0.75, abs=0.1)


def test_rising_air_raises_alpha() -> None:
    rig = POOL["c172p-rigid"]
    assert rig.flight is not None
    craft = airframe(rig.flight, 1 / 120)
    before = craft.motion()
    craft.set_gust(2.0)
    for _ in range(3):
        craft.step((0.0, 0.0, 0.0))
    assert craft.motion()[ALPHA] - before[ALPHA] == pytest.approx(2.0 / before[SPEED], rel=0.15)


@pytest.mark.parametrize("name", ["bench-compensated", "c172p-compensated", "737-uncompensated"])
def test_the_rig_flies_as_the_twin_does(tmp_path: Path, name: str) -> None:
    rig = POOL[name]
    frames = 20 * 120
    rng = np.random.default_rng(6)
    shape = SHAPES["steps"](rng, np.arange(frames * NODES + 1) / (120 * NODES))
    force = pilot_force(rig, shape, 25.0)
    t = np.arange(len(force)) / (120 * NODES)
    rows = "".join(f"{a:.10f},{b:.9f}\n" for a, b in zip(t, force, strict=True))
    (tmp_path / "force.csv").write_text("time_s,column_force_N\n" + rows)
    flown = rig.flight is not None
    profile = PressureProfile(time_s=[0.0, 20.0], dynamic_pressure_Pa=[300.0, 2900.0])
    pilot = ForceTable(file=str(tmp_path / "force.csv"))
    theirs = fly(Manoeuvre(rig, {"column": pilot}, 20.0, bench=None if flown else profile))
    q = None if flown else np.interp(np.arange(frames) / 120, [0.0, 20.0], [300.0, 2900.0])
    ours = fly_twin(
        rig, nominal_twin(rig), force, frames, q, np.zeros((frames, 14 if flown else 7))
    )
    for channel in ours.channels[1:]:
        left = np.sqrt(np.mean((ours[channel] - theirs[channel]) ** 2))
        # F_mod's ΔG, and what the noise of δc does to it, is the sensor's measure there.
        level = NOISE[channel][0] or {"column_estimate_m": 4e-5}.get(channel, 1.0)
        assert left < 0.25 * level, channel
        if not (rig.controls["column"].loader.friction and flown):
            assert left < 0.1 * level, channel


@pytest.mark.slow
def test_clean_records_stand_at_their_floors() -> None:
    for name, seed in itertools.product(
        ("bench-compensated", "c172p-rigid", "t37-compensated"), (1, 2)
    ):
        begun = fly_clean(draw_setting(np.random.default_rng(seed), POOL[name]))
        assert begun is not None
        gaps = stage_gaps(POOL[name], begun[1].record)
        assert max(gaps.values()) < 1.2, (name, gaps)


def test_shapes_are_smooth_and_bounded() -> None:
    for seed in range(12):
        shape, _ = pilot_shape(np.random.default_rng(seed), 2400, 120.0)
        assert np.max(np.abs(shape)) <= 1.3
        assert shape[0] == shape[-1] == 0.0
        assert np.max(np.abs(np.diff(shape))) * 120 * NODES < 60.0


def test_drawn_rigs_can_be_flown_and_written() -> None:
    for seed in range(6):
        rig = random_rig(np.random.default_rng(seed), "rig-01", POOL)
        loader = rig.controls["column"].loader
        most = max(rig.controls["column"].schedule.total_gradient)
        assert loader.bend * most <= 0.61


def test_every_effect_of_the_library_has_its_twin() -> None:
    kinds = {kind.name: kind for kind in ALL_EFFECTS}
    assert set(BY_NAME) - WITHOUT_TWIN == set(BY_NAME) & set(kinds)
    for name in set(BY_NAME) - WITHOUT_TWIN:
        assert kinds[name].stage == BY_NAME[name].stage
    stages = [kind.stage for kind in OUTSIDERS]
    for stage in ("loader", "linkage", "surface", "airframe", "schedule"):
        assert stages.count(stage) >= 2


# What a fit frees besides, and no key of a trial holds.
FITTED_TOO = {"stribeck_m_per_s", "elastic_share", "phase_rad", "damping_ratio"}


@pytest.mark.parametrize("kind", [*ALL_EFFECTS, *OUTSIDERS], ids=lambda kind: kind.name)
def test_a_kind_acts_and_says_what_it_put_in(kind: Kind) -> None:
    name = "c172p-compensated" if kind.flown else "bench-compensated"
    begun = _clean(name, kind.other)
    assert begun is not None
    setting, clean = begun
    size = (kind.least * kind.most) ** 0.5 if kind.least < kind.most else kind.most
    draw = Draw(1.0, (0.5, 0.5, 0.5), 5)
    flown = setting.fly(clean, [Installed(kind, size, draw)])
    record, [values] = flown.record, flown.parameters
    assert any(np.any(record[c] != clean.record[c]) for c in record.channels)
    assert all(np.isfinite(v) for v in values.values())
    if kind.name in BY_NAME and kind in ALL_EFFECTS:
        wanted = {p.name.format(d="m") for p in BY_NAME[kind.name].free}
        assert wanted - set(values) <= FITTED_TOO
    assert np.all(np.isfinite(record.data))


@cache
def _clean(name: str, other: bool) -> tuple[Setting, Clean] | None:
    """Return a short clean flight of a rig: all kinds that it may show are put into one."""
    settings = (draw_setting(np.random.default_rng(seed), POOL[name]) for seed in itertools.count())
    setting = next(each for each in settings if each.frames < 2800)
    return fly_clean(with_other(np.random.default_rng(3), setting) if other else setting)


def test_a_clean_record_has_the_duration_speed_and_spread_of_its_motion() -> None:
    rig = POOL["bench-rigid"]
    t = np.arange(1200) / 120
    data = np.column_stack((t, 3.0 * t))
    clean = Clean(rig, Record(("time_s", "column_computed_m"), data), STIFF)
    assert clean.seconds == pytest.approx(10.0)
    assert clean.speed("column_computed_m") == pytest.approx(3.0)
    assert clean.spread("column_computed_m") == pytest.approx(0.96 * 30.0, rel=0.01)


@pytest.mark.parametrize(
    ("twins", "rigs"),
    [
        ({"servo_push": 0.4}, {"servo_acceleration_limit_m_per_s2": 0.4}),
        (
            {"servo_delay": 0.03, "servo_rate": 2.0 * np.pi * 9.0, "servo_ratio": 0.9},
            {"servo_delay_s": 0.03, "servo_frequency_Hz": 9.0, "servo_damping_ratio": 0.9},
        ),
    ],
    ids=["acceleration limit", "tuning"],
)
def test_the_twins_servo_is_the_rigs_by_another_integrator(
    twins: dict[str, float], rigs: dict[str, float]
) -> None:
    """Driven by the twin's δc, the rig's servo goes where the twin's does."""
    rig, twin = plain()
    twin.set(**twins)
    t = nodes(8.0)
    record = alone(rig, twin, STEP_N * np.sin(2.0 * np.pi * (0.2 + 0.15 * t) * t))
    real = rig.changed({f"controls.column.loader.{key}": value for key, value in rigs.items()})
    moved, force = record["column_computed_m"], record["column_force_N"]
    off = [
        float(np.std(replay_linkage(one, "column", moved, force) - record["column_deflection_m"]))
        for one in (rig, real)
    ]
    assert off[0] > 1e-5
    assert off[1] < 0.02 * off[0]
