"""Whether a machine changed: the test's error rate and power, and simulated machines."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from scipy import stats

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.changed import Comparison, Interval, compare
from coupled.gap.findings.healthy import beside_healthy
from coupled.gap.findings.result import StageResult
from coupled.gap.signals.output import Output
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.gaps import know_only
from tests.support.machines import plain_rig


def alarms(healthy: int, tested: int, chance: float, change: float, draws: int = 4000) -> float:
    """Return how often a change, in standard deviations between records, is shown."""
    rng = np.random.default_rng(healthy)
    every = rng.normal(size=(draws, healthy + tested))
    shown = 0
    for row in every:
        shown += Interval.of(row[:healthy], row[healthy:] + change, chance).changed
    return shown / draws


def test_the_interval_is_students_test_with_the_scatter_of_the_healthy_alone() -> None:
    """Of one record against n: t = (x − mean)/(s·√(1 + 1/n)), by scipy's quantile."""
    well, now = np.array([1.0, 2.0, 4.0, 3.0]), np.array([9.0])
    found = Interval.of(well, now, 0.02)
    assert found.difference == pytest.approx(6.5)
    assert found.scatter == pytest.approx(np.std(well, ddof=1))
    wanted = stats.t.ppf(0.99, 3) * np.std(well, ddof=1) * np.sqrt(1.0 + 1.0 / 4.0)
    assert found.limit == pytest.approx(wanted)
    assert found.changed is bool(wanted < 6.5)


@pytest.mark.parametrize(("healthy", "tested"), [(3, 1), (8, 1), (20, 1), (5, 3)])
def test_a_false_alarm_is_as_rare_as_stated(healthy: int, tested: int) -> None:
    assert alarms(healthy, tested, 0.05, 0.0) == pytest.approx(0.05, abs=0.012)


@pytest.mark.parametrize(("healthy", "tested"), [(4, 1), (12, 1), (6, 2)])
def test_the_stated_size_is_shown_as_often_as_stated(healthy: int, tested: int) -> None:
    """The stated size goes with the scatter of the records at hand: here it is set to 1."""
    well = np.random.default_rng(1).normal(size=healthy)
    well /= np.std(well, ddof=1)
    size = Interval.of(well, np.zeros(tested), 0.01).shown
    assert alarms(healthy, tested, 0.01, size) == pytest.approx(0.9, abs=0.02)


def test_one_healthy_record_shows_no_scatter() -> None:
    found = Interval.of(np.array([1.0]), np.array([100.0]), 0.01)
    assert not found.changed
    assert found.shown == np.inf


SCREW = {"mass_kg": 5.0, "damping_N_s_per_m": 400.0, "servo_frequency_Hz": 0.0}


def screw(
    day: int,
    friction: float = 1.0,
    spread: float = 1.0,
    scale: float = 1.0,
    damping: float = 1.0,
    offset_N: float = 0.0,
) -> Record:
    """Return a record of a ball screw: a motion that is imposed, and the force of its motor.

    From day to day friction and damping differ by 1 %; a ripple of the balls and a load
    that depends on the position are in no rig. `scale` is that of force and motion.
    """
    rng = np.random.default_rng(100 + day)
    time = np.arange(1200) / 100.0
    place = 0.1 * np.sin(0.8 * np.pi * time) + 0.03 * np.sin(2.2 * np.pi * time)
    speed, gained = (np.gradient(x, time) for x in (place, np.gradient(place, time)))
    dry = 60.0 * friction * (1.0 + 0.01 * rng.normal()) * np.tanh(speed / 2e-3)
    dry *= 1.0 + 0.2 * np.sin(place / 0.012)
    viscous = 500.0 * damping * (1.0 + 0.01 * rng.normal()) * speed + 300.0 * place**2
    force = offset_N + 5.0 * gained + viscous + dry + spread * rng.normal(0.0, 2.0, len(time))
    names = ("time_s", "column_force_N", "column_deflection_m")
    read = (time, scale * force, scale * (place + rng.normal(0.0, 2e-6, len(time))))
    return Record(names, np.column_stack(read))


def screw_rig() -> Rig:
    """Return a rig that lacks most of that."""
    return plain_rig(100.0, SCREW).changed({"controls.column.drive": "displacement"})


def outputs_of(records: Sequence[Record]) -> list[Output]:
    rig = screw_rig()
    readers = [Reader(rig, one, "column", surface_points, i) for i, one in enumerate(records)]
    return [output for reader in readers for output in reader.outputs()]


def compared(well: Sequence[Record], now: Sequence[Record]) -> Comparison:
    known = outputs_of_the_well() if well is WELL else outputs_of(well)
    rig = screw_rig()
    return compare("column", (well, known, rig), (now, outputs_of(now), rig))


WELL = [screw(day) for day in range(8)]


@cache
def outputs_of_the_well() -> list[Output]:
    return outputs_of(WELL)


@pytest.mark.slow
def test_a_healthy_machine_of_another_day_is_as_it_was() -> None:
    """One in 50 may be called changed: of 12 days one is in a fifth of all tests."""
    days = [compared(WELL, [screw(day)]) for day in range(20, 32)]
    assert sum(bool(one.changed) for one in days) <= 1
    assert not days[0].blind
    assert "is detectable" in days[0].words


@pytest.mark.slow
def test_an_offset_is_shown_below_the_scatter_of_the_friction() -> None:
    """Friction scatters by 0.6 N; an offset of 1 N moves the mean of both directions alone."""
    found = compared(WELL, [screw(30, offset_N=1.0)])
    assert "mean of both directions" in {one.feature for one in found.changed}
    assert "half difference of the directions" not in {one.feature for one in found.changed}


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ({"friction": 1.4}, "half difference"),
        ({"spread": 2.5}, "roughness in"),
        ({"damping": 1.2}, "slope over the speed"),
    ],
)
def test_a_change_by_seven_standard_deviations_is_shown(fault: dict[str, float], said: str) -> None:
    found = compared(WELL, [screw(60, **fault)])
    assert found.stages == ("loader",)
    assert any(said in one.words for one in found.changed)
    assert found.words.startswith("Changed since the healthy records: column_force_N")


def test_another_motion_is_no_change() -> None:
    """Force and its roughness go with the motion, which is larger by 30 %."""
    assert compared(WELL, [screw(60, scale=1.3)]).changed == ()


def test_an_offset_that_the_scatter_hides_is_not_said_to_be_detectable() -> None:
    """Of healthy records with offsets of ± 15 N, of 70 N rms; their friction scatters by 1 %."""
    well = [screw(day, offset_N=15.0 * (-1.0) ** day) for day in range(8)]
    found = compared(well, [screw(60, offset_N=40.0)])
    assert found.changed == ()
    assert found.shown["loader"] > 40.0 / 70.0
    assert found.blind == {"loader"}


@pytest.mark.parametrize(
    ("effect", "faulty"), [("deflection_zero", {"sensing", "loader"}), ("force_zero", {"sensing"})]
)
def test_a_changed_stage_is_faulty_beside_an_effect_that_does_not_show_in_it(
    effect: str, faulty: set[str]
) -> None:
    """Friction has doubled; a zero of δ does not show in the loader, one of the force does."""
    change = compared(WELL, [screw(60, friction=2.0)])
    stages = StageResult("loader", gap=1.0), StageResult("sensing", gap=9.0, guilty=True)
    verdict, known = beside_healthy("effect", stages, [BY_NAME[effect]], frozenset(), change)
    assert {stage.name for stage in known if stage.guilty} == faulty
    assert verdict == ("unexplained" if "loader" in faulty else "effect")


def test_two_healthy_records_show_no_change_of_a_tenth() -> None:
    assert compared(WELL[:2], [screw(60)]).blind == {"loader"}
    assert compared(WELL[:1], [screw(60, friction=3.0)]).changed == ()


@pytest.mark.slow
def test_a_diagnosis_against_healthy_records_names_the_stage_that_changed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With an empty library: what no effect explains is named all the same."""
    know_only(monkeypatch, [])
    well = {f"well{i}": one for i, one in enumerate(WELL)}
    rig = screw_rig()
    same = diagnose(rig, {"r": screw(70)}, healthy=well)
    assert same.verdict == "no_gap"
    assert "is detectable" in same.summary
    found = diagnose(rig, {"r": screw(71, friction=1.4)}, healthy=well)
    assert found.verdict == "unexplained"
    assert found.guilty == ("loader",)
    assert found.as_dict()["healthy"]["changes"][0]["stage"] == "loader"
    assert found.as_dict()["stages"]["loader"]["guilty"]
    assert "Changed since the healthy records: column_force_N" in found.summary
    assert "half difference of the directions" in found.summary


def test_a_verdict_needs_healthy_records_that_would_show_a_change(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    know_only(monkeypatch, [])
    alone = diagnose(screw_rig(), {"r": screw(70)}, healthy={"w": WELL[0]})
    assert alone.verdict == "ambiguous"
    assert "cannot be decided" in alone.summary
    assert alone.as_dict()["healthy"]["shown"] == {"loader": None}
