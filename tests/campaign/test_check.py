"""Expectations: judged by closed forms, refused where they mean nothing, and those shipped hold."""

from __future__ import annotations

import json
import typing
from dataclasses import fields, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from coupled.authority.compare import Flight, Outcome
from coupled.campaign.check import check_run, read_expecting
from coupled.campaign.standards import judge_standard
from coupled.campaign.tolerances import sustained_force
from coupled.campaign.verdict import judge_expectation
from coupled.errors import InputError
from coupled.flight.expectation import Expect, Figure, Standard, UnjudgedError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile, configure
from coupled.flight.pilot import PILOTS
from coupled.flight.runfile import read_run
from coupled.record.record import Record
from coupled.resources import shipped_runs
from coupled.schema import build
from tests.support.commands import coupled, files
from tests.support.rigs import G_STIFF, bench
from tests.support.runs import PUSH


def written(folder: Path, *expectations: str, text: str = PUSH) -> Path:
    path = folder / "push.toml"
    path.write_text(text + "".join(f"\n[[expect]]\n{each}\n" for each in expectations))
    return path


def expect(**keys: Any) -> Expect:
    return build(Expect, keys, "test", "")


def flight(values: Any, ended: bool = False) -> Flight:
    """Return a flight of 10 Hz over 1 s whose one channel, `x`, is as given."""
    x = np.asarray(values, dtype=float)
    manifest = {"ended_early": {"reason": "test", "time_s": 0.1 * len(x)} if ended else None}
    record = Record(
        ("time_s", "x", "column_force_N", "column_hand_force_N"),
        np.column_stack((0.1 * np.arange(len(x)), x, 11.0 * x, 10.0 * x)),  # S₃ is 10 % off
        manifest,
    )
    figures: dict[str, Any] = dict.fromkeys((f.name for f in fields(Outcome)), 0.25)
    why = "test at 0.10 s" if ended else ""
    outcome = Outcome(**{**figures, "ended_early": why, "time_to_attitude_s": None})
    manoeuvre = replace(read_run("appendix-c")[0], duration_s=1.0)
    return Flight(manoeuvre, "rigid", record, outcome)


RISE = np.linspace(0.0, 0.9, 10)


@pytest.mark.parametrize(("text", "share"), [("1 %", 0.01), ("-2.5%", -0.025), (" .5 % ", 0.005)])
def test_a_share_may_be_written_in_per_cent(text: str, share: float) -> None:
    assert expect(measure="loss", most=text).bounds == (None, share)
    assert expect(channel="column_surface_norm", least=text).bounds == (share, None)
    within = expect(measure="felt_ratio", **{"is": "100 %", "within": "2 %"}).bounds
    assert within == pytest.approx((0.98, 1.02))


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"measure": "loss", "most": 1}, 'is a share, .* "1 %" for one per cent, is 1'),
        ({"measure": "loss_closed_form", "least": -1.5}, "is a share"),
        ({"measure": "loss", "is": 0.1, "within": 1.0}, "is a share"),
        ({"measure": "force_N", "most": "1 %"}, "should be a number, without quotes"),
        ({"measure": "loss", "most": "0.01"}, "should be a number, without quotes"),
        ({"channel": "pitch_rad", "most": "1 %"}, "should be a number, without quotes"),
    ],
)
def test_a_share_that_was_meant_in_per_cent_is_refused(keys: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        expect(**keys)


@pytest.mark.parametrize(
    ("keys", "value", "margin"),
    [
        ({"at_s": 0.25, "is": 0.2, "within": 0.1}, 0.25, 0.05),
        ({"most": 1.0}, 0.9, 0.1),
        ({"least": 0.1}, 0.0, -0.1),
        ({"least": -0.3, "most": 1.0}, 0.9, 0.1),
        ({"from_s": 0.2, "to_s": 0.5, "least": 0.1}, 0.2, 0.1),
        ({"take": "mean", "is": 0.5, "within": 0.2}, 0.45, 0.15),
        ({"take": "greatest", "least": 0.8}, 0.9, 0.1),
        ({"take": "lowest", "most": 0.8}, 0.0, 0.8),
        ({"take": "last", "least": 1.0}, 0.9, -0.1),
        ({"reaches": 0.33, "by_s": 0.5}, 0.33, 0.17),
        ({"reaches": 0.4, "by_s": 0.5, "not_before_s": 0.45}, 0.4, -0.05),
        ({"reaches": 0.9, "by_s": 0.95}, 0.9, 0.05),
    ],
)
def test_a_channel_is_judged_by_its_closed_form(
    keys: dict[str, Any], value: float, margin: float
) -> None:
    verdict = judge_expectation(expect(channel="x", **keys), flight(RISE), None)
    assert verdict.value == pytest.approx(value, abs=1e-12)
    assert verdict.margin == pytest.approx(margin, abs=1e-12)
    assert verdict.passed == (margin > 0.0)


def test_a_difference_is_taken_row_by_row() -> None:
    looked_at = expect(channel="x", minus="rigid", **{"is": 0.0, "within": 0.5})
    verdict = judge_expectation(looked_at, flight(2.0 * RISE), flight(RISE))
    assert verdict.value == pytest.approx(0.9)
    assert not verdict.passed
    measured = expect(measure="loss", minus="rigid", most=0.1)
    assert judge_expectation(measured, flight(RISE), flight(RISE)).value == 0.0


@pytest.mark.parametrize(
    ("keys", "ended", "says"),
    [
        ({"channel": "x", "reaches": 2.0, "by_s": 0.5}, False, "never reached; at last it is 0.9"),
        ({"channel": "x", "most": 5.0}, True, "ended early: test"),
        ({"channel": "x", "at_s": 0.95, "most": 5.0}, True, "ended early: test"),
        ({"channel": "x", "from_s": 0.91, "to_s": 0.92, "most": 5.0}, False, "no row"),
        ({"measure": "loss", "most": 0.5}, True, "ended early: test"),
        ({"measure": "time_to_attitude_s", "most": 5.0}, False, "no such figure"),
    ],
)
def test_an_expectation_that_cannot_be_judged_has_its_reason(
    keys: dict[str, Any], ended: bool, says: str
) -> None:
    with pytest.raises(UnjudgedError, match=says):
        judge_expectation(expect(**keys), flight(RISE, ended), None)


def test_rows_before_an_early_end_are_judged() -> None:
    kept = expect(channel="x", to_s=0.5, most=1.0)
    assert judge_expectation(kept, flight(RISE, ended=True), None).passed
    reached = expect(channel="x", reaches=0.45, by_s=0.5)
    assert judge_expectation(reached, flight(RISE, ended=True), None).passed


LBF = 4.4482216

# 14 CFR 25.143(d) as printed, lbf: two hands, one hand, long-term.
PRINTED = {"column": (75, 50, 10), "wheel": (50, 25, 5), "pedals": (150, 150, 20)}
DURATIONS: tuple[Standard, ...] = (
    "25.143(d) two hands",
    "25.143(d) one hand",
    "25.143(d) long-term",
)


def held(lbf: float, seconds: float, control: str = "column", least_s: float = 30.0) -> Flight:
    """Return a flight of 10 Hz in which a force is held for so long, and none for the rest."""
    base = flight(RISE)
    rows = round(10.0 * max(seconds, least_s))
    time = 0.1 * np.arange(rows)
    force = np.where(time < seconds - 1e-9, lbf * LBF, 0.0)
    record = Record(
        ("time_s", f"{control}_hand_force_N"),
        np.column_stack((time, force)),
        {"ended_early": None},
    )
    return replace(base, record=record)


@pytest.mark.parametrize("control", ["column", "wheel", "pedals"])
@pytest.mark.parametrize("which", [0, 1])
def test_short_term_forces_are_those_of_25_143(control: Any, which: int) -> None:
    """A second of 1 % less than what is printed passes, of 1 % more does not."""
    limit = PRINTED[control][which]
    for share, passes in ((0.99, True), (1.01, False)):
        figure = judge_standard(DURATIONS[which], control, held(share * limit, 1.0, control), None)
        assert figure.value == pytest.approx(share * limit * LBF)
        assert figure.least is None
        assert figure.most == pytest.approx(limit * LBF, rel=1e-6)
        assert (figure.value <= limit * LBF) is passes
        assert figure.note == ""


@pytest.mark.parametrize("control", ["column", "wheel", "pedals"])
@pytest.mark.parametrize("which", [0, 1, 2])
def test_what_is_held_for_long_is_held_against_the_long_term_limit(
    control: Any, which: int
) -> None:
    """Well within the short-term limit, and held for 25 s: 1 % over the long-term one fails."""
    limit = PRINTED[control][2]
    for share, passes in ((0.99, True), (1.01, False)):
        figure = judge_standard(DURATIONS[which], control, held(share * limit, 25.0, control), None)
        assert figure.value == pytest.approx(share * limit * LBF)
        assert figure.most == pytest.approx(limit * LBF, rel=1e-6)
        assert (figure.value <= limit * LBF) is passes
        assert "long-term" in figure.note


def test_a_peak_that_passes_may_be_held_for_too_long() -> None:
    """50 lbf with two hands is short-term; held for 27 s it is not."""
    short = judge_standard("25.143(d) two hands", "column", held(50.0, 2.0, least_s=60.0), None)
    assert short.value < (short.most or 0.0)
    for force in (held(50.0, 27.0, least_s=60.0), held(-50.0, 27.0, least_s=60.0)):
        long = judge_standard("25.143(d) two hands", "column", force, None)
        assert long.value == pytest.approx(50.0 * LBF)
        assert long.most == pytest.approx(10.0 * LBF, rel=1e-6)


def test_a_moment_of_ease_does_not_start_the_time_anew() -> None:
    force = np.full(300, 40.0)
    force[150] = 0.0
    assert sustained_force(force, 0.1) == pytest.approx(40.0 * 199.0 / 200.0)
    assert sustained_force(np.where(np.arange(300) % 2, 40.0, -40.0), 0.1) == pytest.approx(40.0)
    assert sustained_force(np.full(100, 40.0), 0.1) == 0.0  # 10 s are no long term


def test_a_small_pitch_input_is_one_of_half_to_two_degrees_a_second() -> None:
    """Table A2A, 2.b.4: ±0.15°/s or ±20 % of the peak rate, for 0.5 to 2°/s."""

    def peaking(deg_per_s: float) -> Flight:
        base = flight(RISE)
        rate = np.radians(deg_per_s)
        return replace(base, outcome=replace(base.outcome, peak_rate_rad_per_s=rate))

    for rigid, allowed in ((0.6, 0.15), (1.5, 0.3)):
        figure = judge_standard("Part 60 2.b.4 rate", None, peaking(1.0), peaking(rigid))
        assert figure.value == pytest.approx(np.radians(1.0))
        assert figure.least == pytest.approx(np.radians(rigid - allowed))
        assert figure.most == pytest.approx(np.radians(rigid + allowed))
    for rigid in (0.4, 2.1, 14.0):
        with pytest.raises(UnjudgedError, match=r"2\.b\.4 is for 0\.5 to 2 °/s"):
            judge_standard("Part 60 2.b.4 rate", None, peaking(rigid), peaking(rigid))
        assert judge_standard("rate against rigid", None, peaking(rigid), peaking(rigid)).most
    wheel = replace(peaking(1.0), manoeuvre=read_run("roll-authority")[0])
    with pytest.raises(UnjudgedError, match="not for the wheel"):
        judge_standard("Part 60 2.b.4 rate", None, wheel, wheel)


def test_a_rate_to_the_other_side_and_none_at_all_are_judged_alike() -> None:
    def peaking(rate: float | None) -> Flight:
        base = flight(RISE)
        return replace(base, outcome=replace(base.outcome, peak_rate_rad_per_s=rate))

    down = judge_standard("rate against rigid", None, peaking(-0.5), peaking(-0.4))
    assert down.value == -0.5
    assert (down.least, down.most) == pytest.approx((-0.48, -0.32))
    still = judge_standard("rate against rigid", None, peaking(None), peaking(None))
    allowed = np.radians(0.15)
    assert (still.value, still.least, still.most) == pytest.approx((0.0, -allowed, allowed))


def test_how_long_a_force_is_held_does_not_hang_on_when_the_record_starts() -> None:
    early = held(50.0, 27.0, least_s=60.0)
    data = early.record.data.copy()
    data[:, 0] += 100.0
    late = replace(early, record=replace(early.record, data=data))
    one, other = (judge_standard("25.143(d) two hands", "column", f, None) for f in (early, late))
    assert one == other
    for rows in (1, 2):
        short = replace(early, record=replace(early.record, data=data[:rows]))
        figure = judge_standard("25.143(d) two hands", "column", short, None)
        assert figure.value == pytest.approx(50.0 * LBF)
    assert figure.note == ""


def test_a_held_force_may_be_off_the_specified_one_by_a_tenth_or_five_pounds() -> None:
    """A clamp on a rigid bench holds the specified force; 2.a allows it ±10 % or ±5 lbf."""
    for deflection, allowed in ((0.05, 5.0 * LBF), (0.16, 0.1 * G_STIFF * 0.16)):
        settings = {"kind": "clamp", "deflection_m": deflection}
        clamp = build(PILOTS["clamp"], settings, "t", "pilot.column")
        profile = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[3000.0])
        held_there = Manoeuvre(configure(bench(), "rigid"), {"column": clamp}, 8.0, bench=profile)
        flown = replace(flight(RISE), manoeuvre=held_there, record=fly(held_there))
        figure = judge_standard("Part 60 2.a force", None, flown, None)
        specified = G_STIFF * deflection
        assert figure.value == pytest.approx(specified, rel=1e-3)
        assert figure.least == pytest.approx(specified - allowed, rel=1e-3)
        assert figure.most == pytest.approx(specified + allowed, rel=1e-3)


def test_every_figure_of_a_comparison_may_be_expected() -> None:
    numbers = [f.name for f in fields(Outcome) if "float" in str(f.type)]
    assert list(typing.get_args(Figure)) == numbers


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(shipped_runs()))
def test_what_a_shipped_run_expects_holds(name: str) -> None:
    verdicts = check_run(read_expecting(name))
    assert verdicts
    assert [v for v in verdicts if not v.passed] == []


def test_only_flights_with_an_expectation_are_flown(tmp_path: Path) -> None:
    path = written(tmp_path, 'measure = "loss"\nconfiguration = "compensated"\nmost = 0.1')
    seen = set()
    check_run(read_expecting(str(path)), lambda label, done, total: seen.add((label, total)))
    assert {label for label, _ in seen} == {"push, compensated"}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('channel = "colum_force_N"\nmost = 1.0', "expect[0].channel: no 'colum_force_N'; did"),
        ('measure = "los"\nmost = 1.0', "expect[0].measure: input should be"),
        ('standard = "25.143"', "expect[0].standard: input should be"),
        ("most = 1.0", "expect[0]: give one of channel, measure and standard"),
        ('measure = "loss"', "expect[0]: has no bound"),
        ('measure = "loss"\nis = 0.5', "expect[0]: give is and within together"),
        ('measure = "loss"\nis = 0.5\nwithin = 0.1\nleast = 0.0', "not both"),
        ('measure = "loss"\nleast = 0.5\nmost = 0.0', "nothing is at least 0.5 and at most 0"),
        ('measure = "loss"\nmost = 0.5\nat_s = 1.0', "at_s: cannot be given with measure"),
        ('channel = "time_s"\nmost = 1.0\nat_s = 3.0', "at_s: is 3; give less than duration_s = 2"),
        ('channel = "time_s"\nmost = 1.0\nfrom_s = 1.0\nto_s = 0.5', "must be after from_s"),
        ('channel = "time_s"\nreaches = 1.0', "reaches needs by_s"),
        ('channel = "time_s"\nby_s = 1.0', "by_s: needs the level"),
        ('channel = "time_s"\nmost = 1.0\ncase = "x"', "case: no 'x'; known: push"),
        ('measure = "loss"\nmost = 0.5\nconfiguration = "gradient only"', "flies no 'gradient on"),
        (
            'measure = "loss"\nmost = 0.5\nminus = "rigid"\nconfiguration = "rigid"',
            "compares rigid with itself",
        ),
        ('standard = "25.143(d) one hand"\ncontrol = "wheel"', "control: the rig has no wheel"),
        ('standard = "25.143(d) one hand"\nmost = 1.0', "most: cannot be given with standard"),
        ('standard = "Part 60 2.b.4 rate"', "standard: the rig has no aircraft"),
        ('channel = "time_s"\nmost_N = 1.0', "expect[0].most_N: "),
    ],
)
def test_an_expectation_that_means_nothing_is_one_line(
    tmp_path: Path, text: str, says: str
) -> None:
    with pytest.raises(InputError) as fault:
        read_run(str(written(tmp_path, text)))
    assert says in str(fault.value)
    assert "\n" not in str(fault.value)


def test_check_tells_pass_and_fail_and_writes_junit(tmp_path: Path) -> None:
    written(
        tmp_path,
        'measure = "force_N"\nis = 40.0\nwithin = 0.5',
        'measure = "force_N"\nconfiguration = "rigid"\nmost = 30.0',
        'channel = "column_force_N"\nconfiguration = "rigid"\nreaches = 50.0\nby_s = 1.0',
    )
    (tmp_path / "a").mkdir()
    done = coupled(tmp_path, "check", "push.toml", "--junit", "a/j.xml", "--json", "t.json")
    assert done.returncode == 1
    assert done.stderr == ""
    assert "2 of 4 expectations hold" in done.stdout
    assert done.stdout.count("FAIL") == 2
    assert files(tmp_path) == {"push.toml", "a/j.xml", "t.json"}
    suite = ElementTree.parse(tmp_path / "a/j.xml").getroot().find("testsuite")
    assert suite is not None
    assert suite.attrib == {"name": "push", "tests": "4", "failures": "1", "errors": "1"}
    failure, error = suite.find(".//failure"), suite.find(".//error")
    assert failure is not None
    assert error is not None
    assert failure.get("message") == "40 N (wanted ≤ 30 N), margin -10 N"
    assert (error.get("message") or "").startswith("never reached; at last it is 40")
    rows = json.loads((tmp_path / "t.json").read_text())
    assert [row["passed"] for row in rows] == [True, True, False, False]
    assert rows[2]["margin"] == pytest.approx(-10.0)
    written(tmp_path, 'measure = "force_N"\nis = 40.0\nwithin = 0.5')
    assert coupled(tmp_path, "check", "push.toml").returncode == 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ["check", "push.toml"],
            "push.toml: expect: is missing: without one there is nothing to check",
        ),
        (["check", "capture", "capture"], "capture: two of the runs given have this name"),
        (["check", "capture", "--junit", "push.toml/x.xml"], "cannot be written there"),
    ],
)
def test_an_invalid_check_is_refused_in_one_line(
    tmp_path: Path, words: list[str], says: str
) -> None:
    written(tmp_path)
    done = coupled(tmp_path, *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.count("\n") == 1
    assert says in done.stderr
    assert files(tmp_path) == {"push.toml"}
