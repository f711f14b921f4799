"""Comparisons at stops, breakouts and services, against closed forms of the statics."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coupled
from coupled.authority.compare import Comparison, Flight, compare, fly_and_judge, judge
from coupled.authority.figures import named
from coupled.authority.maps import loss_maps
from coupled.calibration.assumedscales import outdated_bends
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile, configure
from coupled.flight.pilot import Pilot
from coupled.flight.runfile import read_run
from coupled.plots.flights import draw_comparison
from coupled.record.channels import ControlName
from coupled.rig.standalone import run_control
from coupled.rig.statics import static_line, static_point
from tests.support.commands import ROOT
from tests.support.commands import coupled as command
from tests.support.joined import joined
from tests.support.rigs import G_STIFF, K_REPORT, bench

CASES = ROOT / "tests" / "data" / "cases"
STATIC = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[3000.0])
LOADER = "controls.column.loader."
SENSING = "controls.column.sensing."
HOST = "controls.column.compensation."
PULL_m = 0.0508


# A surface at its stop


def pulled(deflection_m: float, **terms: Any) -> Comparison:
    """Return a c172p's flights at 27 m/s, held so far: its trim takes a quarter of the travel."""
    case = read_run(str(CASES / "saturated-surface" / "run.toml"))[0]
    pilot = coupled.Clamp(deflection_m=deflection_m, duration_s=2.0, rise_s=0.2)
    return compare([replace(case, pilots={"column": pilot}, **terms)])


def test_a_hand_at_rest_is_stated_under_the_empty_table() -> None:
    """The table was empty, without a reason."""
    idle = Manoeuvre(bench(), {"column": coupled.Step(force_N=0.0)}, 1.0, bench=STATIC)
    assert compare([idle]).remarks() == [
        "No hand moves or loads the column, so nothing is measured."
    ]


def held_rad(flight: Flight) -> float:
    """Return the elevator's mean position about trim while the column is held, rad."""
    elevator, time_s = flight.record["elevator_rad"], flight.record.time_s
    return float(np.mean(elevator[(time_s > 2.2) & (time_s < 2.9)]) - elevator[0])


def test_a_surface_at_its_stop_loses_nothing() -> None:
    found = pulled(0.095)
    stop_rad = held_rad(found.flight("rigid"))
    for flight in found:
        assert held_rad(flight) == pytest.approx(stop_rad, abs=1e-12)
        figures = flight.outcome
        assert figures.loss == pytest.approx(0.0, abs=1e-9)
        assert figures.loss_closed_form == pytest.approx(0.0, abs=1e-9)
        # By the record itself: the first command whose position is that of the stop.
        at = flight.record["elevator_rad"][1:] == flight.record["elevator_rad"].min()
        met = -flight.record["column_surface_norm"][:-1][at].max()
        before = -flight.record["column_surface_norm"][:-1][~at].min()
        assert figures.surface_stop_norm is not None
        assert before <= -figures.surface_stop_norm <= met
        assert figures.asked_norm == figures.reached_norm == figures.surface_stop_norm
    [said] = found.remarks()
    assert "The elevator is at its stop" in said
    assert "74.9 % of the column's travel, at -28.0°" in said
    assert "elevator at its stop" in {
        text.get_text() for legend in draw_comparison(found).legends for text in legend.get_texts()
    }


def test_short_of_the_stop_the_loss_is_what_the_surface_lacks() -> None:
    """80 % of travel is commanded and 75 % available; uncompensated 74 % is reached."""
    found = pulled(0.0802)
    rigid, bent = found.flight("rigid"), found.flight("uncompensated")
    assert rigid.outcome.surface_stop_norm is not None
    assert held_rad(bent) > held_rad(rigid)
    lacks = 1.0 - held_rad(bent) / held_rad(rigid)
    assert 0.005 < lacks < 0.02
    assert bent.outcome.loss == pytest.approx(lacks, abs=1e-3)
    assert bent.outcome.loss_closed_form == pytest.approx(lacks, abs=5e-3)  # without friction


def test_a_flight_that_meets_no_stop_names_none() -> None:
    found = pulled(0.05)
    assert found.remarks() == []
    assert all(flight.outcome.surface_stop_norm is None for flight in found)
    assert found.loss("uncompensated") > 0.05


@pytest.mark.parametrize(
    ("by", "lost"),
    [({0.1: 0.3}, False), ({3.2: 0.3}, True), ({0.1: 0.3, 3.2: -0.3}, False)],
    ids=["before", "after", "to and back"],
)
def test_the_stop_is_that_of_the_trim_while_the_control_is_held(
    by: dict[float, float], lost: bool
) -> None:
    """The trim moves by 30 % of the travel before the pull, after it, or back again; 60 % are held.

    Of the trim's 75 % 45 are left, so that nothing is lost where it has moved before.
    """
    event = {
        f"at{i}": {"trim": "column", "by_norm": norm, "at_s": at, "over_s": 0.1}
        for i, (at, norm) in enumerate(by.items())
    }
    case = read_run(str(CASES / "saturated-surface" / "run.toml"))[0]
    pilot = coupled.Clamp(deflection_m=0.06, start_s=0.5, duration_s=2.4, rise_s=0.2)
    found = coupled.compare(
        case.rig,
        column=pilot,
        duration_s=4.0,
        event=event,
        configurations=["rigid", "uncompensated"],
    )
    assert (found.loss("uncompensated") > 0.03) is lost
    stop = found.flight("rigid").outcome.surface_stop_norm
    assert (stop is None) is lost


def test_a_surface_that_comes_to_its_stop_while_the_control_is_held_loses_nothing() -> None:
    """The c172p's wheel at 1.39 of 1.40 rad: its friction lets it settle over the first frames."""
    found = coupled.compare(
        coupled.load_rig("c172p"),
        wheel=coupled.Clamp(deflection_rad=1.39, duration_s=3.0),
        duration_s=5.0,
        configurations=["rigid", "uncompensated"],
    )
    rigid, bent = (found.flight(name) for name in ("rigid", "uncompensated"))
    late = bent.record.time_s > 3.0
    assert np.ptp(bent.record["aileron_rad"][late & (bent.record.time_s < 3.9)]) == 0.0
    assert bent.record["aileron_rad"].max() == rigid.record["aileron_rad"].max()
    assert bent.outcome.surface_stop_norm == rigid.outcome.surface_stop_norm
    assert bent.outcome.loss == pytest.approx(0.0, abs=1e-4)
    assert bent.outcome.loss_closed_form == pytest.approx(0.0, abs=1e-9)


def test_an_aircraft_with_laws_of_its_own_has_no_known_stop() -> None:
    rig = coupled.load_rig("c172p").changed({"flight.direct_controls": False})
    flight = coupled.fly(rig, column=coupled.Clamp(deflection_m=0.09), duration_s=2.0)
    assert "surface_stops" not in flight.record.manifest
    assert flight.outcome.surface_stop_norm is None


# The true deflection, and the closed form of what is flown


STATICS: dict[str, dict[str, Any]] = {
    "S1 of the electronics": {SENSING + "computed_scale": 1.15},
    "S1 as read": {SENSING + "deflection_scale": 1.15},
    "S2": {SENSING + "modifying_scale": 0.9},
    "S3": {SENSING + "force_scale": 1.1},
    "zero of F": {SENSING + "force_zero_N": 30.0},
    "zero of δ": {SENSING + "deflection_zero_m": 0.01},
    "drift of S1": {SENSING + "scale_drift_per_s": 0.01},
    "offset": {LOADER + "offset_N": 20.0},
    "offset of the multiplier": {LOADER + "multiplier_offset_N": 20.0},
    "drift of the multiplier": {LOADER + "multiplier_drift_N_per_s": 2.0},
    "limit": {LOADER + "force_limit_N": 40.0, LOADER + "breakout_N": 9.0},
    "cubic": {LOADER + "cubic_N_per_m3": 3e4},
    "ripple": {LOADER + "ripple_N": 3.0, LOADER + "ripple_period_m": 0.04},
    "limited bend": {LOADER + "bend_limit_m": 0.012},
    "softer push": {LOADER + "bend_push_m_per_N": 2e-4},
    "soft play": {LOADER + "play_m": 0.004, LOADER + "play_stiffness_N_per_m": 2e4},
    "arc": {LOADER + "arc_geometry": True, "controls.column.length_m": 0.2},
    "G_B as assumed": {HOST + "basic_gradient_N_per_m": 500.0},
    "F_BO as assumed": {HOST + "breakout_N": 4.0, LOADER + "breakout_N": 9.0},
    "K̂": {HOST + "bend_m_per_N": 5e-5},
    "pressure scale": {"controls.column.schedule.pressure_scale": 0.8},
    "slope": {"controls.column.schedule.slope": 0.9},
    "stretch": {"controls.column.rigging.stretch_loss_per_Pa": 3e-5},
    "rigging": {"controls.column.rigging.offset_norm": 0.02},
    "stops": {LOADER + "stop_aft_m": 0.041, LOADER + "stop_forward_m": 0.0405},
    "gradient's converter": {
        **{SENSING + "word_length_bits": 12, SENSING + "full_scale_V": 100.0},
        **{SENSING + "s1_V_per_m": 500.0, SENSING + "s2_V_per_N": 0.4, SENSING + "s3_V_per_N": 0.2},
    },
}


@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("name", STATICS)
def test_the_closed_form_is_what_is_flown(name: str, side: float, multiplier: str) -> None:
    """All that is there at rest is in both: loss and felt ratio of a clamp, on either side."""
    rig = bench({**STATICS[name], LOADER + "multiplier": multiplier})
    clamp = coupled.Clamp(deflection_m=side * PULL_m, start_s=0.2)
    manoeuvre = Manoeuvre(rig, {"column": clamp}, 5.0, bench=STATIC)
    for configuration in ("uncompensated", "compensated"):
        flown = fly_and_judge(manoeuvre.configured(configuration), configuration)
        # A drift goes on, a hand presses slowly into a limit or a stop, and readings have steps.
        slow = {"limit": 5e-4, "stops": 1e-3}
        loose = {"drift of S1": 1e-3, "drift of the multiplier": 1e-3, **slow}
        figures, within = flown.outcome, {**loose, "gradient's converter": 2e-3}.get(name, 2e-4)
        assert figures.loss == pytest.approx(figures.loss_closed_form, abs=within)
        assert figures.felt_ratio == pytest.approx(figures.felt_ratio_closed_form, abs=within)
        short = 1e-2 if name == "stops" else 3e-3
        assert figures.hand_travel_norm == pytest.approx(side * PULL_m / 0.1778, rel=short)


@pytest.mark.parametrize("key", ["deflection_zero_m", "arc"])
def test_no_transducer_changes_what_is_lost(key: str) -> None:
    """δ = 0.0508 m, whatever its transducer reads: K·G/(1 + K·G) is lost, uncompensated."""
    share = K_REPORT * G_STIFF
    changes = STATICS["arc"] if key == "arc" else {SENSING + key: 0.01}
    clamp = coupled.Clamp(deflection_m=PULL_m, start_s=0.2)
    manoeuvre = Manoeuvre(bench(changes), {"column": clamp}, 5.0, bench=STATIC)
    found = compare([replace(manoeuvre, configurations=("uncompensated", "compensated"))])
    assert found.loss("uncompensated") == pytest.approx(share / (1.0 + share), abs=1e-4)
    assert found.felt_ratio("uncompensated") == pytest.approx(1.0 / (1.0 + share), abs=1e-4)
    assert found.loss("compensated") == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize("scale", ["computed_scale", "deflection_scale"])
def test_a_digital_product_is_made_of_what_the_host_reads(scale: str) -> None:
    """F = G_B·δc + ΔG·S·δc, δ = δc + K·F; the map, the closed form and the flight have it."""
    rig = bench({LOADER + "multiplier": "digital", SENSING + scale: 1.15})
    on_computed = G_STIFF / (1.0 - K_REPORT * G_STIFF)
    slope = 560.0 + 1.15 * (on_computed - 560.0)
    computed = PULL_m / (1.0 + K_REPORT * slope)
    lost = 1.0 - (1.15 * computed + K_REPORT * slope * computed) / PULL_m
    point = static_point(rig, "column", 3000.0, PULL_m)
    assert point.force[0] == pytest.approx(slope * computed, rel=1e-12)
    assert 1.0 - point.estimate[0] / PULL_m == pytest.approx(lost, rel=1e-12)
    [drawn] = [each for each in loss_maps(rig, "column") if each.configuration == "compensated"]
    assert drawn.loss[-1, np.argmin(np.abs(drawn.deflection - PULL_m))] == pytest.approx(
        lost, abs=1e-4
    )
    manoeuvre = Manoeuvre(rig, {"column": coupled.Clamp(deflection_m=PULL_m)}, 5.0, bench=STATIC)
    flown = fly_and_judge(manoeuvre.configured("compensated"), "compensated").outcome
    assert flown.loss == pytest.approx(lost, abs=2e-4)
    assert flown.felt_ratio == pytest.approx(slope * computed / (G_STIFF * PULL_m), abs=2e-4)


def test_a_bob_weight_bends_the_structure_in_the_closed_form_too() -> None:
    heavy = {LOADER + "bob_weight_N_per_g": 60.0, LOADER + "friction_N": 0.0}
    rig = coupled.load_rig("c172p").changed(heavy)
    clamp = coupled.Clamp(deflection_m=0.04, start_s=0.2)
    figures = coupled.fly(rig, column=clamp, duration_s=2.0, configuration="uncompensated").outcome
    assert abs((figures.peak_load_factor or 1.0) - 1.0) > 0.5
    assert figures.loss == pytest.approx(figures.loss_closed_form, abs=4e-3)


def test_a_leak_of_another_force_is_in_the_closed_form() -> None:
    """A tenth of the wheel's 60 N pulls the column, too: F = G·δ − (1 − K·G)·6 N."""
    rig = joined({LOADER + "crosstalk": 0.1}, {"reciprocal": False})
    clamp, pull = coupled.Clamp(deflection_m=PULL_m), coupled.Step(force_N=60.0)
    pilots: dict[ControlName, Pilot] = {"column": clamp, "wheel": pull}
    manoeuvre = Manoeuvre(rig, pilots, 5.0, bench=STATIC).configured("compensated")
    found = fly_and_judge(manoeuvre, "compensated").outcome
    wanted = 1.0 - (1.0 - K_REPORT * G_STIFF) * 6.0 / (G_STIFF * PULL_m)
    assert found.felt_ratio_closed_form == pytest.approx(wanted, abs=1e-4)
    assert found.felt_ratio == pytest.approx(found.felt_ratio_closed_form, abs=1e-3)


# A loader that is held: in its breakout, at its stop


@pytest.mark.parametrize("deflection", [1e-4, 1e-3, -1.5e-3])
def test_within_the_breakout_the_point_is_that_of_the_structure_alone(deflection: float) -> None:
    """δc = 0, F = δ/K and δ̂ = K̂·F, as a loader at rest under that force."""
    rig = bench({LOADER + "breakout_N": 20.0})
    point = static_point(rig, "column", 3000.0, deflection)
    assert point.deflection[0] == pytest.approx(deflection, rel=1e-12)
    assert point.computed[0] == 0.0
    assert point.force[0] == pytest.approx(deflection / K_REPORT, rel=1e-12)
    assert point.estimate[0] == pytest.approx(deflection, rel=1e-12)
    nodes = np.full(200 * rig.substeps + 1, point.force[0])
    held = run_control(rig, "column", nodes, np.full(200, 3000.0))
    assert held.deflection[-1] == pytest.approx(deflection, rel=1e-12)
    assert held.computed[-1] == 0.0


@pytest.mark.parametrize("share", [0.3, 0.999, 1.001, 1.5, 40.0])
def test_a_point_has_the_deflection_that_is_asked_for(share: float) -> None:
    """Either side of where the loader leaves its breakout, and it is on the line beyond."""
    for changes in ({}, STATICS["offset"], STATICS["limited bend"], STATICS["soft play"]):
        rig = bench({LOADER + "breakout_N": 20.0, **changes})
        asked = share * K_REPORT * 20.0 / (1.0 - K_REPORT * G_STIFF)
        for wanted in (asked, -asked):
            point = static_point(rig, "column", 3000.0, wanted)
            still = changes == STATICS["soft play"] and point.force[0] == pytest.approx(0.0)
            assert still or point.deflection[0] == pytest.approx(wanted, rel=1e-9)
            if point.computed[0]:
                line = static_line(rig, "column", 3000.0, point.computed)
                assert line.deflection[0] == pytest.approx(wanted, rel=1e-9)
                assert line.force[0] == pytest.approx(point.force[0], rel=1e-12)


@pytest.mark.parametrize("offset_N", [0.0, 12.0])
@pytest.mark.parametrize("share", [-0.9, -0.2, 0.0, 0.5])
def test_between_the_contacts_of_a_play_the_grip_stands_where_it_is(
    offset_N: float, share: float
) -> None:
    """F = 0 where G·δc = F_offset, and any δ of δc ± play/2."""
    soft = {LOADER + "play_m": 0.004, LOADER + "play_stiffness_N_per_m": 1e4}
    rig = bench({**soft, LOADER + "offset_N": offset_N, LOADER + "bend_m_per_N": 0.0})
    rig = configure(rig, "uncompensated")
    computed = offset_N / G_STIFF
    deflection = computed + share * 0.002
    point = static_point(rig, "column", 3000.0, deflection)
    assert point.deflection[0] == pytest.approx(deflection, abs=1e-15)
    assert point.force[0] == pytest.approx(0.0, abs=1e-9)
    assert point.estimate[0] == pytest.approx(computed, abs=1e-12)
    assert point.specified[0] == pytest.approx(G_STIFF * deflection, abs=1e-12)


def test_at_its_stop_the_structure_takes_what_the_hand_adds() -> None:
    """Beyond travel + K·F the loader stands at its stop, and F = (δ − travel)/K."""
    rig = bench()
    point = static_point(rig, "column", 3000.0, 0.25)
    assert point.computed[0] == 0.1778
    assert point.force[0] == pytest.approx((0.25 - 0.1778) / K_REPORT, rel=1e-9)
    rigid = static_point(configure(rig, "rigid"), "column", 3000.0, 0.1778 * (1.0 + 1e-12))
    assert rigid.force[0] == pytest.approx(G_STIFF * 0.1778, rel=1e-9)


@pytest.mark.parametrize(("side", "stop_m"), [(1.0, 0.03), (-1.0, 0.025)])
def test_at_a_stop_within_the_travel_the_structure_takes_the_rest(
    side: float, stop_m: float
) -> None:
    """F = (δ − stop)/K on either side; uncompensated, 1 − stop/δ of the command is lost."""
    stops = {LOADER + "stop_aft_m": 0.03, LOADER + "stop_forward_m": 0.025}
    rig = configure(bench(stops), "uncompensated")
    point = static_point(rig, "column", 3000.0, side * PULL_m)
    assert point.computed[0] == side * stop_m
    assert point.force[0] == pytest.approx(side * (PULL_m - stop_m) / K_REPORT, rel=1e-9)
    assert point.estimate[0] == side * stop_m


def test_a_map_has_the_stop_within_the_travel() -> None:
    rig = bench({LOADER + "stop_aft_m": 0.03})
    maps = {each.configuration: each for each in loss_maps(rig, "column")}
    bent = maps["uncompensated"]
    beyond = bent.deflection > 0.04
    assert bent.loss[-1, beyond] == pytest.approx(1.0 - 0.03 / bent.deflection[beyond], abs=1e-9)
    assert maps["compensated"].loss[-1] == pytest.approx(0.0, abs=1e-9)
    rigid = bench({LOADER + "stop_aft_m": 0.03, LOADER + "bend_m_per_N": 0.0})
    [held] = [each for each in loss_maps(rigid, "column") if each.configuration == "uncompensated"]
    assert np.isnan(held.loss[-1, held.deflection > 0.031]).all()  # the grip does not go so far
    assert held.loss[-1, held.deflection < 0.029] == pytest.approx(0.0, abs=1e-9)


# A pull within breakout and friction


@pytest.fixture(scope="module")
def within() -> Comparison:
    """Return pulls of 15 and 40 N on a column with 38 N of breakout and 12 N of friction."""
    cases = read_run(str(CASES / "pull-within-breakout" / "a320-run.toml"))
    return compare([replace(case, duration_s=3.0) for case in cases])


def test_a_pull_within_breakout_and_friction_has_no_shares(within: Comparison) -> None:
    for flight in within:
        figures = flight.outcome.as_dict()
        assert figures["loader_rests"]
        for name in ("asked_norm", "reached_norm", "loss", "felt_ratio"):
            assert figures[name] is None
        assert figures["force_N"] == pytest.approx(15.0 if flight.outcome.case == "slow" else 40.0)
    [said] = within.remarks()
    assert "stays within breakout (38 N) and friction (12 N): 15 N (slow); 40 N (fast)" in said
    assert "3.37 lb (slow)" in within.remarks("us")[0]
    assert "nan" not in repr(within)


def test_the_table_says_so_in_place_of_shares(tmp_path: Path) -> None:
    shutil.copytree(CASES / "pull-within-breakout", tmp_path, dirs_exist_ok=True)
    done = command(tmp_path, "compare", "a320-run.toml", "--json", "t.json", "--report", "r.html")
    assert done.returncode == 0, done.stderr
    assert "authority lost" not in done.stdout
    assert "felt / specified" not in done.stdout
    assert "The loader does not move" in " ".join(done.stdout.split())
    assert "The loader does not move" in (tmp_path / "r.html").read_text(encoding="utf-8")
    assert all(row["loss"] is None for row in json.loads((tmp_path / "t.json").read_text()))


@pytest.mark.parametrize("stiffness", [0.0, 2e5])
@pytest.mark.parametrize(("force_N", "rests"), [(49.0, True), (60.0, False)])
def test_what_moves_the_loader_has_shares(force_N: float, rests: bool, stiffness: float) -> None:
    """With rigid friction, and with one whose contact yields by 12 N/stiffness before it slips."""
    dry = {"breakout_N": 38.0, "friction_N": 12.0, "friction_stiffness_N_per_m": stiffness}
    noisy = {"noise.column_computed_m": 1e-6}
    rig = configure(
        bench({**{LOADER + key: value for key, value in dry.items()}, **noisy}), "rigid"
    )
    manoeuvre = Manoeuvre(rig, {"column": coupled.Step(force_N=force_N)}, 3.0, bench=STATIC)
    found = fly_and_judge(manoeuvre).outcome
    assert found.loader_rests is rests
    assert np.isfinite(found.loss) is not rests


def test_a_breakout_that_the_host_raises_is_said() -> None:
    """The host adds K·G·F_BO to 9 N of breakout: 9.2 N move the loader without that correction."""
    manoeuvre = Manoeuvre(
        bench({LOADER + "breakout_N": 9.0}),
        {"column": coupled.Step(force_N=9.2)},
        3.0,
        bench=STATIC,
        configurations=("uncompensated", "compensated"),
    )
    [said] = compare([manoeuvre]).remarks()
    assert "9.2 N (compensated), where the correction of the gradient raises the breakout." in said


def test_where_a_service_holds_the_control_nothing_is_felt() -> None:
    """The shipped run: the hand lets go, and the trim keeps the stick where it was left."""
    [case] = read_run(str(ROOT / "runs" / "force-trim.toml"))
    outcome = fly_and_judge(case).outcome
    assert np.isnan(outcome.felt_ratio)
    assert outcome.hand_travel_norm > 0.15


def test_the_specified_force_acts_about_the_trim() -> None:
    """A T-37's stick trimmed to 1 cm and held at 3 cm: two thirds of the force about neutral."""
    rig = coupled.load_rig("t37").changed({LOADER + "friction_N": 0.0})
    trim = {"service": "trim_m", "control": "column", "to": 0.01, "at_s": 0.0}
    held = coupled.Clamp(deflection_m=0.03, start_s=0.5, duration_s=2.5)
    found = coupled.compare(
        rig, column=held, duration_s=3.0, event={"trim": trim}, configurations=["rigid"]
    )
    assert found.felt_ratio("rigid") == pytest.approx(1.0, abs=0.01)


def test_a_jam_is_no_breakout() -> None:
    rig = coupled.load_rig("t37")
    jam = {"service": "jammed", "control": "column", "to": 1.0, "at_s": 0.0}
    pull = coupled.Step(force_N=60.0, start_s=0.5)
    flight = coupled.fly(rig, column=pull, duration_s=2.0, event={"jam": jam})
    assert not flight.outcome.loader_rests


# A correction by a K̂ of 0


@pytest.fixture(scope="module")
def useless() -> Comparison:
    rig = bench({HOST + "bend_m_per_N": 0.0})
    manoeuvre = Manoeuvre(rig, {"column": coupled.Clamp(deflection_m=PULL_m)}, 3.0, bench=STATIC)
    return compare([manoeuvre])


def test_a_correction_by_nothing_is_named_so(useless: Comparison) -> None:
    assert useless.loss("compensated") == pytest.approx(useless.loss("uncompensated"), abs=1e-9)
    heads = [named(flight) for flight in useless]
    assert heads[:2] == ["rigid", "uncompensated"]
    assert heads[2:] == [f"{flight.configuration} (K̂ = 0)" for flight in useless[2:]]
    [said] = useless.remarks()
    assert "nothing is corrected, since the host's K̂ is 0" in said
    assert "controls.column.compensation.bend_m_per_N" in said
    figure = draw_comparison(useless)
    ticks = [text.get_text() for text in figure.axes[2].get_xticklabels()]
    assert [tick.endswith("K̂ = 0") for tick in ticks] == [False, False, True, True, True]


def test_a_structure_that_bends_under_a_push_alone_is_named_by_that() -> None:
    bends = {LOADER + "bend_m_per_N": 0.0, LOADER + "bend_push_m_per_N": 2e-4}
    rig = bench({**bends, HOST + "bend_m_per_N": 0.0})
    push = Manoeuvre(rig, {"column": coupled.Clamp(deflection_m=-PULL_m)}, 2.0, bench=STATIC)
    found = compare([replace(push, configurations=("compensated",))])
    assert "the structure's K is 0.0002 m/N" in " ".join(found.remarks())


def test_a_rigid_structure_and_a_known_bend_need_no_such_word() -> None:
    for changes in ({}, {LOADER + "bend_m_per_N": 0.0, HOST + "bend_m_per_N": 0.0}):
        pilot = coupled.Clamp(deflection_m=PULL_m)
        found = compare([Manoeuvre(bench(changes), {"column": pilot}, 2.0, bench=STATIC)])
        assert found.remarks() == []


def test_an_improved_rig_offers_the_bend_that_was_found() -> None:
    filed = bench()
    softer = filed.changed({LOADER + "bend_m_per_N": 1.5e-4})
    [said] = outdated_bends(filed, softer)
    assert "K̂ is stale" in said
    assert said.endswith("controls.column.compensation.bend_m_per_N = 0.00015")
    assert outdated_bends(filed, filed.changed({LOADER + "friction_N": 3.0})) == []
    assert outdated_bends(filed, softer.changed({HOST + "bend_m_per_N": 1.5e-4})) == []
    off = configure(softer, "uncompensated")
    assert outdated_bends(configure(filed, "uncompensated"), off) == []


# A force that moves the hand further, and the surface as far


def test_a_low_calibration_is_said_to_move_the_hand_further() -> None:
    """Under a force, of a host whose S₁ is from a low gradient, beside the others."""
    manoeuvre = Manoeuvre(bench(), {"column": coupled.Step(force_N=60.0)}, 3.0, bench=STATIC)
    asked = replace(manoeuvre, configurations=("rigid", "calibrated low", "compensated"))
    [said] = compare([asked]).remarks()
    assert "The pilot holds a force. Calibrated low, the hand moves" in said
    both = replace(manoeuvre, configurations=("rigid", "uncompensated", "calibrated low"))
    [said] = compare([both]).remarks()
    assert "Uncompensated, the hand moves" in said
    assert "the surface moves about as far" in said
    assert "Likewise calibrated low" in said


@pytest.mark.parametrize("kind", ["force", "deflection"])
def test_a_sweep_says_what_its_losses_are_shares_of(kind: str, tmp_path: Path) -> None:
    pilot = {
        "force": 'kind = "step"\nforce_N = 60.0',
        "deflection": 'kind = "clamp"\ndeflection_m = 0.05',
    }
    run = 'name = "pull"\ncard = "A pull."\nrig = "report-column"\nduration_s = 1.0\n'
    (tmp_path / "pull.toml").write_text(f"{run}[pilot.column]\n{pilot[kind]}\n")
    bends = f'[[vary]]\nkey = "rig.{LOADER}bend_m_per_N"\nvalues = [1e-5, 9e-5]\n'
    flown = 'name = "s"\nrun = "pull.toml"\nconfigurations = ["rigid", "uncompensated"]\n'
    (tmp_path / "s.toml").write_text(flown + bends)
    done = command(tmp_path, "sweep", "s.toml", "-j", "1")
    assert done.returncode == 0, done.stderr
    assert ("The loss is a share of the hand's command" in " ".join(done.stdout.split())) is (
        kind == "force"
    )


@pytest.mark.parametrize("system", ["si", "us"])
def test_travels_that_differ_are_written_apart(system: Any) -> None:
    """8 N on a T-37's stick move it by 4.8 mm, and by 0.7 mm more on the bent structure."""
    found = coupled.compare(
        coupled.load_rig("t37"), column=coupled.Step(force_N=8.0, duration_s=3.0), duration_s=4.0
    )
    [said] = found.remarks(system)
    words = said.split()
    unit = {"si": "mm", "us": "in"}[system]
    bent, rigid = (float(words[i - 1]) for i, word in enumerate(words) if word.strip(",") == unit)
    assert bent > rigid


def test_a_sweep_says_that_a_correction_corrects_nothing() -> None:
    bends = {"key": f"rig.{LOADER}bend_m_per_N", "values": [1e-5, 9e-5]}
    flown: dict[str, Any] = {"name": "s", "run": "appendix-c", "configurations": ["compensated"]}
    zero = {"key": f"rig.{HOST}bend_m_per_N", "values": [0.0]}
    for vary, said in (([bends, zero], True), ([bends], False)):
        found = coupled.sweep({**flown, "vary": vary}, workers=1)
        assert any("K̂ is 0" in each for each in found.remarks) is said


# The reach of a hand


STRUCTURES: dict[str, dict[str, Any]] = {
    "plain": {},
    "hysteresis": {"bend_hysteresis_share": 0.5, "bend_hysteresis_width_N": 60.0},
    "mode at 2 Hz": {"bend_frequency_Hz": 2.0},
    "mode at 8 Hz": {"bend_frequency_Hz": 8.0},
    "undamped mode": {"bend_frequency_Hz": 3.0, "bend_damping_ratio": 0.0},
    "limited bend": {"bend_limit_m": 0.01},
    "softer push": {"bend_push_m_per_N": 3e-4},
    "rigid push": {"bend_push_m_per_N": 0.0},
    "play": {"play_m": 0.004},
    "soft play": {"play_m": 0.004, "play_stiffness_N_per_m": 1e4},
    "soft play alone": {"play_m": 0.004, "play_stiffness_N_per_m": 1e4, "bend_m_per_N": 0.0},
    "dry": {"friction_N": 10.0, "breakout_N": 20.0},
    "all": {
        **{"bend_hysteresis_share": 0.5, "bend_hysteresis_width_N": 60.0, "play_m": 0.004},
        **{"play_stiffness_N_per_m": 1e4, "bend_frequency_Hz": 5.0, "friction_N": 5.0},
    },
}
PUSHES: dict[str, Any] = {
    "step": coupled.Step(force_N=300.0, duration_s=3.0, reach_m=0.12),
    "pushed": coupled.Step(force_N=-500.0, rise_s=0.0, reach_m=0.12),
    "sweep": coupled.FrequencySweep(
        force_N=400.0, low_Hz=0.2, high_Hz=3.0, duration_s=4.0, reach_m=0.12
    ),
    "3211": coupled.ThreeTwoOneOne(force_N=350.0, unit_s=0.4, reach_m=0.12),
}


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("push", PUSHES)
def test_a_grip_does_not_pass_its_reach(structure: str, push: str) -> None:
    rig = bench({LOADER + key: value for key, value in STRUCTURES[structure].items()})
    record = fly(Manoeuvre(rig, {"column": PUSHES[push]}, 5.0, bench=STATIC))
    far = np.abs(record["column_deflection_m"]).max()
    assert far <= 0.12 + 1e-9
    assert far > 0.1199


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("structure", [s for s in STRUCTURES if s not in ("play", "undamped mode")])
def test_at_its_reach_the_grip_stands_where_the_statics_have_it(
    structure: str, side: float
) -> None:
    """Under a larger force, F is the static force at δ = r, and the loader is at rest there."""
    rig = bench({LOADER + key: value for key, value in STRUCTURES[structure].items()})
    push = coupled.Step(force_N=600.0 * side, reach_m=0.12)
    record = fly(Manoeuvre(rig, {"column": push}, 8.0, bench=STATIC))
    assert record["column_deflection_m"][-1] == pytest.approx(side * 0.12, rel=1e-6)
    loader = rig.controls["column"].loader
    # Friction and hysteresis are bands about the statics.
    lost = loader.bend_hysteresis_share * loader.bend * 0.5 * loader.bend_hysteresis_width
    wanted = static_point(rig, "column", 3000.0, side * 0.12)
    band = 1e-3 * abs(wanted.force[0]) + loader.friction + G_STIFF * lost
    assert record["column_force_N"][-1] == pytest.approx(wanted.force[0], abs=band)
    computed = record["column_computed_m"][-1]
    assert computed == pytest.approx(wanted.computed[0], abs=1e-5 + band / G_STIFF)


def test_grips_on_one_structure_do_not_pass_their_reach() -> None:
    """A jump of the wheel's force bends the column too, whose grip is at its reach."""
    pilots: dict[ControlName, Pilot] = {
        "column": coupled.Step(force_N=400.0, reach_m=0.1),
        "wheel": coupled.Doublet(force_N=90.0, half_period_s=0.6, rise_s=0.0, start_s=2.0),
    }
    record = fly(Manoeuvre(joined(), pilots, 5.0, bench=STATIC))
    grip = record["column_deflection_m"]
    assert grip.max() <= 0.1 + 1e-9
    assert np.ptp(record["column_force_N"][record.time_s > 2.0]) > 5.0
    assert grip[190] == pytest.approx(0.1, abs=1e-6)


def test_a_record_without_stops_is_judged_by_its_commands() -> None:
    """As one read from a file of an older version: the command itself is what is reached."""
    flight = pulled(0.095, configurations=("uncompensated",))[0]
    assert isinstance(flight, Flight)
    old = {k: v for k, v in flight.record.manifest.items() if k != "surface_stops"}
    found = judge(flight.manoeuvre, "uncompensated", replace(flight.record, manifest=old))
    assert found.surface_stop_norm is None
    assert found.loss == pytest.approx(0.081, abs=1e-3)
