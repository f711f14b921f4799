"""Speed and pitch attitude are judged in segments that restart as measured."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.conditions import Conditions, condition_wrappers
from coupled.flight.weather import Wind
from coupled.gap.chain import Part
from coupled.gap.effects.effect import Effect, Parameter, Signature
from coupled.gap.prepare import prepare
from coupled.gap.search.case import Case
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Output
from coupled.gap.stages.airframe import airframe_outputs
from coupled.gap.stages.openloop import NEEDS, SLOW
from coupled.record.channels import motion_channels
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig
from tests.support.ownlogs import manoeuvre

CONTROLS = ("column", "wheel", "pedals")
DRAG = Parameter("factor", "flight.drag", "factor", 0.1, 10.0, (1.1,))


@pytest.fixture(scope="module")
def rig() -> Rig:
    return nominal_rig(flown=True)


@pytest.fixture(scope="module")
def healthy(rig: Rig, tmp_path_factory: pytest.TempPathFactory) -> Record:
    return made(tmp_path_factory.mktemp("healthy"), rig, {}, seed=3)


def slow(outputs: list[Output]) -> dict[str, Output]:
    return {output.channel: output for output in outputs if output.channel in SLOW}


def without(record: Record, *names: str) -> Record:
    kept = [name for name in record.channels if name not in names]
    data = np.column_stack([record[name] for name in kept])
    return Record(tuple(kept), data, record.manifest)


@pytest.mark.parametrize("wind_m_per_s", [0.0, 6.0])
def test_an_aircraft_put_into_its_own_state_flies_on(rig: Rig, wind_m_per_s: float) -> None:
    names = motion_channels(CONTROLS, flown=True)
    asked = manoeuvre(8.0)

    def aircraft() -> JSBSimAirframe:
        assert rig.flight is not None
        ends = [0.0, wind_m_per_s, wind_m_per_s]
        wind = Conditions(wind=Wind(time=[0.0, 1.5, 9.0], along=ends))
        wrappers = condition_wrappers(wind, "run", 1.0 / 120.0, 0) if wind_m_per_s else []
        given = (rig.flight, 1.0 / 120.0, CONTROLS, [aircraft_folder()])
        return make_aircraft(*given, conditions=wrappers)

    def fly(restarted: bool) -> np.ndarray:
        flying, rows = aircraft(), []
        for k, commands in enumerate(asked.tolist()):
            if restarted and k and k % 240 == 0:
                before = np.array(flying.motion())
                flying.put(dict(zip(names, flying.motion(), strict=True)))
                np.testing.assert_allclose(flying.motion()[3:8], before[3:8], rtol=1e-6, atol=2e-5)
            rows.append(flying.motion())
            flying.step(tuple(commands))
        return np.array(rows)

    plain, again = fly(restarted=False), fly(restarted=True)
    for name in (*NEEDS, "altitude_m"):
        at = names.index(name)
        off = float(np.max(np.abs(again - plain)[:, at]))
        assert off < 1e-3 * float(np.ptp(plain[:, at])), name


def test_a_healthy_record_leaves_noise_in_speed_and_attitude(rig: Rig, healthy: Record) -> None:
    found = slow(airframe_outputs(rig, healthy))
    assert set(found) == set(SLOW)
    for output in found.values():
        assert 0.5 < output.gap(rig) < output.limit


def test_what_decelerates_shows_in_speed_and_attitude_alone(rig: Rig, healthy: Record) -> None:
    """0.1 m/s² less than the model has: 1 % of its weight, which no rate shows."""
    data = healthy.data.copy()
    data[:, healthy.channels.index(SLOW[0])] -= 0.1 * healthy.time_s
    outputs = airframe_outputs(rig, Record(healthy.channels, data))
    shown = {one.channel for one in outputs if one.gap(rig) > one.limit}
    assert SLOW[0] in shown <= set(SLOW)


def test_drag_is_judged_by_speed_and_attitude(
    rig: Rig, tmp_path_factory: pytest.TempPathFactory
) -> None:
    real = rig.changed({"flight.drag": 1.3})
    record = made(tmp_path_factory.mktemp("drag"), real, {}, seed=3)
    found = slow(airframe_outputs(rig, record))
    assert any(output.gap(rig) > output.limit for output in found.values())
    assert all(output.gap(real) < output.limit for output in found.values())
    drag = Effect("drag", "airframe", (DRAG,), Signature("", ""))
    fit = Problem(Case(rig, "column", list(found.values()))).fit((drag,))
    assert fit.low["drag.factor"] < 1.3 < fit.high["drag.factor"]
    assert fit.values["drag.factor"] == pytest.approx(1.3, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SLOW, "alpha_rad"])
def test_a_record_without_a_state_says_what_is_not_judged(
    rig: Rig, healthy: Record, name: str
) -> None:
    """What is judged by rates stays as it is."""
    record = without(healthy, name)
    outputs = airframe_outputs(rig, record)
    assert not slow(outputs)
    before = {one.channel: one.gap(rig) for one in airframe_outputs(rig, healthy)}
    for output in outputs:
        assert output.gap(rig) == pytest.approx(before[output.channel], rel=0.02)
    said = f"Without {name}, speed and attitude are not judged: they show drag and thrust."
    assert prepare(rig, {"r": record}, Part("column")).left_out == (said,)


@pytest.mark.slow
def test_a_throttle_that_moves_leaves_drag_and_thrust_unjudged(rig: Rig, healthy: Record) -> None:
    """The model's stays as in trim, if the channel is not known to be its lever."""
    for moved, judged in ((0.0, set(SLOW)), (0.2, set())):
        throttle = 0.5 + moved * (healthy.time_s > 5.0)
        names = (*healthy.channels, "engine_throttle")
        record = Record(names, np.column_stack((healthy.data, throttle)), healthy.manifest)
        assert set(slow(airframe_outputs(rig, record))) == judged
        (said,) = prepare(rig, {"r": record}, Part("column")).left_out or ("",)
        assert ("drag and thrust, cannot be judged" in said) == (moved > 0.0)


@pytest.mark.slow
def test_a_complete_record_says_nothing_of_the_kind(rig: Rig, healthy: Record) -> None:
    assert prepare(rig, {"r": healthy}, Part("column")).left_out == ()


@pytest.mark.slow
def test_late_stamps_of_the_motion_delay_its_restarts_too(rig: Rig, healthy: Record) -> None:
    """The motion of a record, read three frames late."""
    data, motion = healthy.data.copy(), [*NEEDS, "load_factor", "altitude_m"]
    for name in motion:
        at = healthy.channels.index(name)
        data[3:, at] = data[:-3, at]
    late = rig.changed({"flight.motion_stamp_s": 3.0 / 120.0})
    found = slow(airframe_outputs(rig, Record(healthy.channels, data)))
    assert found["pitch_rad"].gap(rig) > found["pitch_rad"].limit
    assert all(output.gap(late) < output.limit for output in found.values())


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 2])
def test_an_effect_changes_a_flight_of_wide_steps_nearly_as_one_of_its_own(
    rig: Rig, healthy: Record, steps: int
) -> None:
    mine = rig.changed({"flight.steps_per_frame": steps})
    other = mine.changed({"flight.pitch_damping": 1.1, "flight.drag": 1.1})
    moved = {one.channel: one for one in airframe_outputs(mine, healthy)}
    for name in ("pitch_rate_rad_per_s", "load_factor", *SLOW):
        exact = moved[name].residual(other) - moved[name].residual(mine)
        wide = moved[name].change(mine, other)
        off = np.linalg.norm(wide - exact) / np.linalg.norm(exact)
        assert 0.0 < off < 0.2, name
