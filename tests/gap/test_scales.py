"""Starts and bounds in the scale of a machine: the same record in other units, the same answer."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.effects.settings import Scales, in_scale
from coupled.gap.findings.proposal import next_tests
from coupled.gap.search.fit import fit_alone
from coupled.gap.search.found import Candidate, Choice, Fit, Found
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import RIVAL_GAIN
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.joined import joined
from tests.support.machines import plain_rig, recorded

TIME_s = np.arange(600) / 100.0
NAMES = ("time_s", "column_force_N", "column_deflection_m")
LARGE = st.floats(10.0, 1e6)


def machine(force: float, friction_N: float = 14.0) -> tuple[Rig, Record]:
    """Return a damper whose motion is imposed, with dry friction; all forces times `force`."""
    rng = np.random.default_rng(2)
    place = 0.04 * np.sin(4.0 * TIME_s) + 0.01 * np.sin(11.0 * TIME_s)
    speed = np.gradient(place, TIME_s)
    pull = 100.0 * speed + friction_N * np.sign(speed) + rng.normal(0.0, 0.05, len(place))
    read = (TIME_s, force * pull, place + rng.normal(0.0, 1e-6, len(place)))
    numbers = {"mass_kg": 0.01 * force, "damping_N_s_per_m": 100.0 * force}
    rig = plain_rig(100.0, {**numbers, "servo_frequency_Hz": 0.0})
    rig = rig.changed({"controls.column.drive": "displacement"})
    return rig, Record(NAMES, np.column_stack(read))


def reader_of(rig: Rig, record: Record) -> Reader:
    return Reader(rig, record, "column", surface_points)


def test_the_scale_of_a_sine_is_its_rms_and_its_rate() -> None:
    place, turn = 0.02 * np.sin(5.0 * TIME_s), 5.0
    data = np.column_stack((TIME_s, 3.0 * np.cos(5.0 * TIME_s), place))
    scales = Scales.of([reader_of(machine(1.0)[0], Record(NAMES, data))])
    assert scales is not None
    assert scales.force_N == pytest.approx(3.0 / np.sqrt(2.0), rel=0.02)
    assert scales.way == pytest.approx(0.02 / np.sqrt(2.0), rel=0.02)
    assert scales.time_s == pytest.approx(1.0 / turn, rel=0.02)
    force, way, time = scales.force_N, scales.way, scales.time_s
    sizes = {"N·s/m": force * time / way, "kg": force * time**2 / way, "N/m³": force / way**3}
    assert {unit: scales.size(unit) for unit in sizes} == pytest.approx(sizes)
    assert scales.size("°C") is scales.size("g") is None


def test_the_library_is_as_it_is_for_a_machine_like_a_column() -> None:
    rig = machine(1.0)[0]
    same = in_scale(EFFECTS, Scales(12.0, 0.03, 0.3), rig, "column")
    for one, other in zip(EFFECTS, same, strict=True):
        for p, q in zip(one.parameters, other.parameters, strict=True):
            assert (p.low, p.high, p.starts) == (q.low, q.high, q.starts)


@pytest.mark.parametrize("way", [0.1, 0.3, 1.2])
def test_a_wheel_turns_ten_times_as_many_rad_as_a_column_moves_m(way: float) -> None:
    rig = joined()
    wheels = in_scale(EFFECTS, Scales(12.0, way, 0.3), rig, "wheel")
    scaled = {one.name: one.free[0] for one in wheels if one.free}
    for name, power in (("backlash", 1), ("bend", 1), ("cubic_stiffness", -3), ("inertia", 0)):
        column, wheel = BY_NAME[name].free[0], scaled[name]
        assert wheel.starts == pytest.approx([10.0**power * start for start in column.starts])
        assert wheel.high == pytest.approx(10.0**power * column.high)


@pytest.mark.parametrize("way", [1e-3, 0.03, 1.0])
def test_a_filed_bend_starts_near_its_own_size_whatever_the_motion(way: float) -> None:
    """Of a record with brief pushes it started at 3e-6 m/N for 2e-4, and was not found."""
    rig = machine(1.0)[0].changed({"controls.column.loader.bend_m_per_N": 8e-5})
    (bend,) = in_scale([BY_NAME["bend"]], Scales(12.0, way, 0.3), rig, "column")
    assert 4e-5 < bend.free[0].starts[0] < 1.6e-4


@settings(deadline=None, max_examples=25)
@given(LARGE)
def test_starts_go_with_the_unit_of_force(force: float) -> None:
    rig, large = machine(1.0)[0], Scales(20.0 * force, 0.03, 0.3)
    scaled = {one.name: one for one in in_scale(EFFECTS, large, rig, "column")}
    for name, powers in (("coulomb_friction", 1), ("cubic_stiffness", 1), ("backlash", 0)):
        before, after = (effect.free[0] for effect in (BY_NAME[name], scaled[name]))
        assert after.starts == pytest.approx([force**powers * s for s in before.starts])
        assert after.high >= force**powers * before.high * (1 - 1e-12)


@pytest.mark.parametrize("force", [1e-3, 0.1, 1.0, 10.0, 1e3, 1e5])
def test_friction_is_found_over_eight_decades_of_force(force: float) -> None:
    """The same record with all forces in other units: the same friction, in those units."""
    rig, record = machine(force)
    reader = reader_of(rig, record)
    outputs = reader.outputs()
    effects = in_scale([BY_NAME["coulomb_friction"]], Scales.of([reader]), rig, "column")
    found = fit_alone(rig, "column", outputs, effects)
    (value,) = found.values.values()
    assert not found.at_bound
    assert value / force == pytest.approx(14.0, rel=0.02)


@pytest.mark.slow
def test_a_test_is_proposed_by_the_sensors_that_the_record_has() -> None:
    """Scales of force and of δc were to be told apart by a transducer that the bench lacks."""
    rig = plain_rig(100.0, {"mass_kg": 1.0, "damping_N_s_per_m": 30.0}, 500.0)
    effect, other = BY_NAME["deflection_scale"], BY_NAME["force_scale"]
    fits = []
    for one, factor in ((effect, 1.0 / 1.1), (other, 1.1)):
        value = {one.value_key(one.free[0]): factor}
        fits.append(Fit((one,), value, {}, {}, (), apply(rig, "column", [one], value)))
    step = Found(effect, 9.0, 0.5, (Candidate(9.0, other, fits[1]),))
    times = np.arange(1000) / 100.0
    noise = np.random.default_rng(3).standard_normal((3, len(times)))
    pull, place, grip = 20.0 * np.sin(times), 0.04 * np.sin(times), 0.04 * np.sin(times)
    channels = {"force_N": pull + 0.05 * noise[0], "computed_m": place + 1e-5 * noise[1]}
    gains = []
    for more in ({}, {"deflection_m": grip + 1e-5 * noise[2]}):
        record = recorded(100.0, **channels, **more)
        tests = next_tests(rig, record, "column", Choice((step,), fits[0], fits[0], {}, ()))
        gains.append(max(test.gain for test in tests))
    assert gains[0] < RIVAL_GAIN < gains[1]
