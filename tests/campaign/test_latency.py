"""Latency after Part 60, 4.a: what is put into the chain is read out, and too much of it fails."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.authority.compare import fly_and_judge
from coupled.campaign.check import check_run
from coupled.campaign.latency import AT_ONCE, FRAMES_LATE, fly_undelayed, latency_s
from coupled.campaign.standards import judge_standard
from coupled.flight.expectation import UnjudgedError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import CONFIGURATIONS, Manoeuvre
from coupled.flight.pilot import Clamp, Step
from coupled.flight.runfile import read_run
from coupled.flight.weather import Turbulence
from coupled.record.channels import CONTROL_NAMES, RATE, ControlName, unit_of
from coupled.rig import parameters
from coupled.schema import Section, build, file_keys

Floats = NDArray[np.float64]
AXES = dict(zip(("pitch", "roll", "yaw"), CONTROL_NAMES, strict=True))
FRAME_s = 1.0 / 120.0


def case(axis: str, changes: dict[str, Any] | None = None) -> Manoeuvre:
    """Return the shipped run's case of an axis, its rig in one piece, and changed on that axis."""
    run = next(each for each in read_run("latency") if each.label == axis)
    d = unit_of(AXES[axis])
    here = {f"controls.{AXES[axis]}.{k.format(d=d)}": v for k, v in (changes or {}).items()}
    return replace(run, rig=run.configured("rigid").rig.changed(here))


def latency(run: Manoeuvre) -> float:
    control = AXES[run.label]
    return latency_s(control, fly_and_judge(run, "rigid"), fly_undelayed(run))


@pytest.mark.parametrize("axis", AXES)
def test_a_host_adds_a_frame_and_a_half(axis: str) -> None:
    """Half a frame while the command is held, one in JSBSim; the aircraft itself drops out."""
    assert latency(case(axis)) == pytest.approx(FRAMES_LATE * FRAME_s, abs=8e-4)
    slow = replace(case(axis), rig=case(axis).rig.changed({"frame_rate_Hz": 40.0}))
    assert latency(slow) == pytest.approx(FRAMES_LATE / 40.0, abs=4e-3)


@pytest.mark.parametrize(
    ("axis", "changes", "added_s"),
    [
        ("pitch", {"loader.delay_s": 0.05}, 0.05),
        ("roll", {"sensing.gauge_delay_s": 0.03}, 0.03),
        ("yaw", {"sensing.computed_skew_s": 0.006}, 0.006),
        ("roll", {"loader.delay_s": 0.07, "sensing.gauge_delay_s": 0.04}, 0.11),
        ("yaw", {"loader.servo_frequency_Hz": 3.0}, 0.0),  # δc is read ahead of the servo
        ("pitch", {"loader.servo_delay_s": 0.05}, 0.0),
    ],
)
def test_a_delay_in_the_chain_is_read_out(
    axis: str, changes: dict[str, float], added_s: float
) -> None:
    added = latency(case(axis, changes)) - latency(case(axis))
    assert added == pytest.approx(added_s, abs=1e-3)


def test_a_lag_of_the_surface_is_a_delay_to_what_is_slow_beside_it() -> None:
    """A lag τ makes of a rate that grows as t² one that is later by τ, at most."""
    added = latency(case("pitch", {"rigging.lag_s": 0.02})) - latency(case("pitch"))
    assert 0.01 < added < 0.02


def test_a_smaller_answer_is_not_a_later_one() -> None:
    """Without corrections the structure takes 20 % of the stick; that is no latency."""
    run = next(each for each in read_run("latency") if each.label == "pitch")
    bent, rigid = (latency(run.configured(name)) for name in CONFIGURATIONS[1::-1])
    assert bent == pytest.approx(rigid, abs=5e-4)


@pytest.mark.parametrize(("axis", "read_s"), [("pitch", 0.177), ("yaw", 0.158)])
def test_what_the_structure_bends_is_not_late_with_the_loader(axis: str, read_s: float) -> None:
    """A late loader's answer is that of K·F at once and that of δc late, one upon the other.

    The grip is further by K·F as soon as it is pushed, and the host's K̂·F says so. A loader
    too heavy to move gives the answer to K·F alone. Two parts have no one delay: the 5 % are
    met later than by the delay, or sooner, as the first part has it. In yaw six rounds of looking
    for the answer's own second are not enough: they read 149 ms, which would pass.
    """
    delay_s, control = 0.15, AXES[axis]
    run = next(each for each in read_run("latency") if each.label == axis)
    run = run.configured("compensated")

    def answer(changes: dict[str, float]) -> Floats:
        here = {f"controls.{control}.loader.{key}": value for key, value in changes.items()}
        record = fly(replace(run, rig=run.rig.changed(here)))
        rate = record[RATE[control]][record.time_s <= 1.2]  # the second that a latency looks at
        return np.asarray(rate - rate[0])

    bent, prompt = answer({"mass_kg": 1e7}), answer({})
    frames = round(delay_s / FRAME_s)
    waits = np.concatenate((np.zeros(frames), (prompt - bent)[:-frames]))
    late = answer({"delay_s": delay_s})
    assert np.max(np.abs(late - (bent + waits))) < 1e-4 * np.max(np.abs(late))
    key = f"controls.{control}.loader.delay_s"
    slow = replace(run, rig=run.rig.changed({key: delay_s}))
    read = latency_s(control, fly_and_judge(slow), fly_undelayed(slow))
    assert read == pytest.approx(read_s, abs=1e-3)


@pytest.mark.parametrize("axis", AXES)
def test_a_rig_that_is_too_late_fails_its_axis_and_no_other(axis: str) -> None:
    key = f"controls.{AXES[axis]}.loader.delay_s"
    runs = [replace(each, rig=each.rig.changed({key: 0.15})) for each in read_run("latency")]
    runs = [replace(each, configurations=("rigid",)) for each in runs]
    verdicts = {verdict.case: verdict for verdict in check_run(runs)}
    assert {label: verdict.passed for label, verdict in verdicts.items()} == {
        label: label != axis for label in AXES
    }
    assert verdicts[axis].value == pytest.approx(0.15 + FRAMES_LATE * FRAME_s, abs=2e-3)


def test_each_level_has_its_limit() -> None:
    run = case("roll", {"loader.delay_s": 0.12})
    flight, undelayed = fly_and_judge(run), fly_undelayed(run)
    limits = {150: True, 300: True, 100: False}
    for limit, passes in limits.items():
        standard: Any = f"Part 60 4.a latency {limit} ms"
        figure = judge_standard(standard, "wheel", flight, undelayed)
        assert figure.most == limit / 1000.0
        assert (figure.value <= figure.most) == passes


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"pilots": {"column": Clamp(deflection_m=0.01)}}, "a force on the column"),
        ({"pilots": {"wheel": Step(force_N=10)}}, "a force on the column"),
        ({"pilots": {"column": Step(force_N=0)}}, "no force acts on the column"),
        ({"duration_s": 1.5}, "lacks 1 s after the command"),
    ],
)
def test_a_flight_without_a_latency_test_is_not_judged(changed: dict[str, Any], says: str) -> None:
    run = replace(case("pitch"), **changed)
    with pytest.raises(UnjudgedError, match=says):
        latency(run)


def test_latency_is_not_measured_in_moving_air() -> None:
    air = build(Turbulence, {"wind_at_6m_m_per_s": 5.0}, "test", "")
    run = case("pitch")
    run = replace(run, conditions=run.conditions.model_copy(update={"turbulence": air}))
    with pytest.raises(UnjudgedError, match="still air"):
        latency(run)


SECTIONS: dict[str, type[Section]] = {
    "loader": parameters.Loader,
    "schedule": parameters.Schedule,
    "compensation": parameters.Compensation,
    "sensing": parameters.Sensing,
    "rigging": parameters.Rigging,
}
# Of the grip alone; a lead, where the list leaves none; a spring's memory, which is feel; and the
# recorder's stamps, which are in the reference's record as well.
NOT_LATE = {"loader.servo_frequency_Hz", "loader.servo_delay_s", "compensation.force_lead_lag_s"}
NOT_LATE |= {"loader.relaxing_time_s", "sensing.force_stamp_s", "sensing.hum_frequency_Hz"}


@pytest.mark.parametrize("control", CONTROL_NAMES)
def test_the_reference_leaves_out_whatever_takes_time(control: ControlName) -> None:
    """Each key of a control in seconds or hertz is in the list, or causes no delay."""
    for name, section in SECTIONS.items():
        for key in file_keys(section, "{d}"):
            takes_time = key.endswith(("_Hz", "_s")) and not key.endswith("per_s")
            if takes_time and f"{name}.{key}" not in NOT_LATE:
                assert f"{name}.{key}" in AT_ONCE, key


@pytest.mark.parametrize("control", CONTROL_NAMES)
def test_the_reference_is_a_rig_that_says_nothing_of_it(control: ControlName) -> None:
    """Where nothing takes time, a key has the value that it has where the file leaves it out."""
    d = unit_of(control)
    for place, at_once in AT_ONCE.items():
        name, key = place.format(d=d).split(".")
        section = SECTIONS[name]
        assert section.model_fields[file_keys(section, d)[key]].default == at_once, key
