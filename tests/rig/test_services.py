"""The loader's services, each by its closed form, led by a run's events on a bench."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.flight.conditions import Conditions
from coupled.flight.event import Event
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile
from coupled.flight.pilot import ForceTable, Pilot, Step
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.packing import pack
from coupled.rig.rigfile import read_rig
from coupled.rig.serving import (
    SERVICES,
    check_service,
    copy_service_rows,
    held_force,
    service_channels,
    service_command,
    services_of,
    set_service,
)
from coupled.schema import build
from tests.support.rigs import bench

G, PRESSURE = 560.0, 1500.0  # N/m as set at that q̄, below
PLACE = "controls.column"
STRAIGHT = {
    "bend_m_per_N": 0.0,
    "damping_N_s_per_m": 150.0,
    f"{PLACE}.compensation.bend_m_per_N": 0.0,
    f"{PLACE}.schedule.total_gradient_N_per_m": [G, G],
}


def flown(
    services: dict[str, float] | None = None,
    events: dict[str, dict[str, Any]] | None = None,
    force_N: float = 20.0,
    seconds: float = 4.0,
    rig: dict[str, Any] | None = None,
    pilot: Pilot | None = None,
) -> Record:
    """Return a bench's record with services, the events that lead them, and a pilot.

    Unless a pilot is given, a force is held from 0.5 s on.
    """
    given = {f"{PLACE}.services.{key}": value for key, value in (services or {}).items()}
    whole = bench({**STRAIGHT, **given, **(rig or {})})
    found = {
        name: build(Event, {"control": "column", "at_s": 2.0, "to": 1.0, **keys}, "test", name)
        for name, keys in (events or {}).items()
    }
    at = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[PRESSURE])
    pull = pilot or Step(force_N=force_N, start_s=0.5)
    conditions = Conditions(event=found)
    return fly(Manoeuvre(whole, {"column": pull}, seconds, bench=at, conditions=conditions))


def at(record: Record, name: str, time_s: float) -> float:
    return float(record[f"column_{name}"][round(time_s * 100.0)])


def test_a_trim_moves_the_neutral_and_the_breakout_with_it() -> None:
    events = {"trim": {"service": "trim_m", "to": 0.03, "over_s": 0.5}}
    record = flown({}, events, seconds=6.0)
    assert at(record, "computed_m", 1.9) == pytest.approx(20.0 / G, rel=1e-2)
    assert at(record, "trim_m", 2.25) == pytest.approx(0.015, abs=1e-9)
    assert at(record, "computed_m", 5.9) == pytest.approx(0.03 + 20.0 / G, rel=1e-4)
    # with a breakout of 25 N the same hand does not leave either neutral
    held = flown({}, events, rig={"breakout_N": 25.0}, seconds=6.0)
    assert at(held, "computed_m", 1.9) == 0.0
    assert at(held, "computed_m", 5.9) == pytest.approx(0.03, abs=1e-6)
    free = flown({}, events, 0.0, seconds=6.0, rig={"breakout_N": 25.0})
    assert at(free, "computed_m", 5.9) == pytest.approx(0.03, abs=1e-6)


def test_a_service_is_led_from_where_it_stands() -> None:
    """Trimmed to 0.04 m at once, and from there to 0.02 m evenly over 1 s."""
    events = {
        "there": {"service": "trim_m", "to": 0.04, "at_s": 0.5},
        "back": {"service": "trim_m", "to": 0.02, "at_s": 2.0, "over_s": 1.0},
    }
    record = flown({}, events, 0.0)
    found = [at(record, "trim_m", time_s) for time_s in (1.9, 2.25, 2.5, 2.75, 3.5)]
    assert found == pytest.approx([0.04, 0.035, 0.03, 0.025, 0.02], abs=3e-4)


@pytest.mark.parametrize("multiplier", ["hybrid", "digital"])
def test_f_mod_acts_about_the_trim(multiplier: str) -> None:
    rig = {f"{PLACE}.schedule.total_gradient_N_per_m": [1000.0, 1000.0], "multiplier": multiplier}
    record = flown({}, {"trim": {"service": "trim_m", "to": 0.03}}, rig=rig)
    away = at(record, "computed_m", 3.9) - 0.03
    assert away == pytest.approx(0.02, rel=1e-3)
    assert at(record, "modifying_force_N", 3.9) == pytest.approx(440.0 * away, rel=1e-6)


def test_a_trim_release_leaves_the_control_free_and_keeps_where_it_ends() -> None:
    """Released: m·v' + c·v = F, no spring and no breakout; then x₀ is where it came to rest."""
    events = {
        "press": {"service": "trim_release", "at_s": 0.2},
        "let go": {"service": "trim_release", "at_s": 1.2, "to": 0.0},
    }
    record = flown({}, events, 5.0, 4.0, rig={"breakout_N": 3.0})
    speed = (at(record, "computed_m", 1.2) - at(record, "computed_m", 1.0)) / 0.2
    assert speed == pytest.approx(5.0 / 150.0, rel=1e-3)
    there = at(record, "computed_m", 1.2)
    assert at(record, "trim_m", 3.9) == pytest.approx(there, abs=2e-5)  # a substep's way
    assert at(record, "computed_m", 3.9) == pytest.approx(there + 2.0 / G, rel=2e-3)


RELEASED = {"press": {"service": "trim_release", "at_s": 0.2}}


def test_a_released_trim_keeps_its_damper() -> None:
    """m·v' + (c + c_r)·v = F: the speed is F/(c + c_r)."""
    record = flown({"trim_release_damping_N_s_per_m": 250.0}, RELEASED, 5.0, 2.0)
    speed = (at(record, "computed_m", 1.8) - at(record, "computed_m", 1.4)) / 0.4
    assert speed == pytest.approx(5.0 / 400.0, rel=1e-3)


def test_a_released_trim_keeps_a_spring_about_the_old_neutral() -> None:
    """x = x_r + F/k_r, and x₀ = δc; let go of the release, x₀ stays there."""
    events = {
        "trim": {"service": "trim_m", "to": 0.02, "at_s": 0.05},
        **RELEASED,
        "let go": {"service": "trim_release", "at_s": 6.0, "to": 0.0},
    }
    kept = {"trim_release_gradient_N_per_m": 300.0}
    record = flown(kept, events, 3.0, 9.0)
    begun = at(record, "trim_m", 0.2)
    assert at(record, "computed_m", 5.9) == pytest.approx(begun + 3.0 / 300.0, rel=1e-2)
    assert at(record, "trim_m", 5.9) == pytest.approx(at(record, "computed_m", 5.9), abs=1e-5)
    assert at(record, "service_force_N", 5.9) == pytest.approx(-3.0, rel=1e-2)
    assert at(record, "trim_m", 8.9) == pytest.approx(at(record, "computed_m", 6.0), abs=1e-4)


def test_each_release_keeps_its_spring_about_its_own_neutral() -> None:
    events = {
        **RELEASED,
        "let go": {"service": "trim_release", "at_s": 4.0, "to": 0.0},
        "again": {"service": "trim_release", "at_s": 5.0},
    }
    record = flown({"trim_release_gradient_N_per_m": 200.0}, events, 3.0, 10.0)
    second = at(record, "trim_m", 4.99)
    assert at(record, "computed_m", 9.9) == pytest.approx(second + 3.0 / 200.0, rel=1e-2)


DRIVEN = {
    "autopilot_stiffness_N_per_m": 4000.0,
    "autopilot_damping_N_s_per_m": 200.0,
    "override_N": 50.0,
}


def test_an_autopilot_holds_the_control_up_to_its_override() -> None:
    """x = x_a + (F − G·x_a)/(k + G) below the override, (F + 50)/G beyond, led back from there."""
    events = {
        "engage": {"service": "autopilot", "at_s": 0.1},
        "turn": {"service": "autopilot_m", "to": 0.02, "at_s": 2.0, "over_s": 0.5},
    }
    record = flown(DRIVEN, events, seconds=5.0)
    assert at(record, "computed_m", 1.9) == pytest.approx(20.0 / (4000.0 + G), rel=1e-4)
    turned = 0.02 + (20.0 - G * 0.02) / (4000.0 + G)
    assert at(record, "computed_m", 4.9) == pytest.approx(turned, rel=1e-4)
    strong = flown(DRIVEN, {"engage": {"service": "autopilot", "at_s": 0.1}}, 120.0, 5.0)
    assert at(strong, "computed_m", 4.9) == pytest.approx((120.0 - 50.0) / G, rel=1e-3)
    assert at(strong, "service_force_N", 4.9) == -50.0


def test_an_autopilot_lets_go_of_a_hand_that_holds_on() -> None:
    events = {"engage": {"service": "autopilot", "at_s": 0.1}}
    held = {**DRIVEN, "override_time_s": 1.0}
    record = flown(held, events, 60.0, 6.0)
    assert at(record, "autopilot", 1.5) == 1.0
    assert at(record, "autopilot", 1.7) == 0.0
    assert at(record, "computed_m", 5.9) == pytest.approx(60.0 / G, rel=1e-3)
    assert at(flown(held, events, 45.0), "autopilot", 3.9) == 1.0


def test_a_hand_that_lets_go_in_between_has_to_hold_for_the_whole_time_again() -> None:
    """Of 1 s that an override takes: 0.7 s, a pause, 0.7 s do not; 1.2 s at a stretch do."""
    held = {**DRIVEN, "override_time_s": 1.0}
    events = {"engage": {"service": "autopilot", "at_s": 0.1}}
    times = [0.0, 0.5, 0.51, 1.2, 1.21, 1.7, 1.71, 2.4, 2.41, 5.0]
    forces = [0.0, 0.0, 60.0, 60.0, 0.0, 0.0, 60.0, 60.0, 0.0, 0.0]
    twice = ForceTable(time_s=times, force_N=forces)
    assert at(flown(held, events, pilot=twice), "autopilot", 3.9) == 1.0
    times, forces = [0.0, 0.5, 0.51, 1.71, 1.72, 5.0], [0.0, 0.0, 60.0, 60.0, 0.0, 0.0]
    once = ForceTable(time_s=times, force_N=forces)
    assert at(flown(held, events, pilot=once), "autopilot", 3.9) == 0.0


def test_an_autopilot_that_is_engaged_again_is_held_against_for_the_whole_time_again() -> None:
    """60 N from 0.5 s on: it disconnects at 1.5 s; engaged again at 2 s, it disconnects at 3 s."""
    held = {**DRIVEN, "override_time_s": 1.0}
    engage = {"service": "autopilot"}
    events = {"engage": {**engage, "at_s": 0.1}, "again": {**engage, "at_s": 2.0}}
    record = flown(held, events, 60.0)
    stands = {time_s: at(record, "autopilot", time_s) for time_s in (1.3, 1.9, 2.1, 2.8, 3.2)}
    assert stands == {1.3: 1.0, 1.9: 0.0, 2.1: 1.0, 2.8: 1.0, 3.2: 0.0}


def test_an_autopilot_engages_where_the_control_is() -> None:
    record = flown(DRIVEN, {"engage": {"service": "autopilot"}})
    assert at(record, "computed_m", 3.9) == pytest.approx(at(record, "computed_m", 2.0), rel=3e-3)


OTHER = {
    "other_mass_kg": 4.0,
    "other_damping_N_s_per_m": 150.0,
    "other_gradient_N_per_m": 300.0,
    "other_share": 0.5,
    "link_stiffness_N_per_m": 8000.0,
    "link_damping_N_s_per_m": 100.0,
    "disconnect_N": 60.0,
}
IN_ROW = 300.0 * 8000.0 / 8300.0  # the other side's spring through the link, N/m


def test_two_sides_share_the_force_and_the_surface() -> None:
    record = flown(OTHER)
    x = at(record, "computed_m", 3.9)
    assert x == pytest.approx(20.0 / (G + IN_ROW), rel=1e-3)
    other = x * 8000.0 / 8300.0
    assert at(record, "other_m", 3.9) == pytest.approx(other, rel=1e-3)
    assert at(record, "link_force_N", 3.9) == pytest.approx(300.0 * other, rel=1e-3)
    assert at(record, "asked_m", 3.9) == pytest.approx(0.5 * (x + other), rel=1e-3)
    travel = 0.1778
    assert at(record, "surface_norm", 3.9) == pytest.approx(-0.5 * (x + other) / travel, rel=1e-3)
    # the other pilot's 20 N alone
    events = {"pull": {"service": "other_force_N", "to": 20.0, "at_s": 0.5}}
    alone = flown(OTHER, events, 0.0)
    assert at(alone, "other_m", 3.9) == pytest.approx(
        20.0 / (300.0 + 8000.0 * G / (8000.0 + G)), rel=1e-3
    )


def test_the_other_sides_spring_acts_about_the_trim() -> None:
    """m₂·y'' + c₂·y' + G₂·(y − x₀) = F_l: trimmed and hands off, both sides rest at x₀."""
    trim = {"trim": {"service": "trim_m", "to": 0.03, "over_s": 0.5, "at_s": 0.5}}
    record = flown(OTHER, trim, 0.0, seconds=5.0)
    assert at(record, "computed_m", 4.9) == pytest.approx(0.03, rel=1e-3)
    assert at(record, "other_m", 4.9) == pytest.approx(0.03, rel=1e-3)
    assert at(record, "link_force_N", 4.9) == pytest.approx(0.0, abs=0.02)


def test_a_jam_of_the_other_side_is_broken_by_the_disconnect_and_half_the_surface_is_left() -> None:
    """Held at 0: F = (G + k)·x until the link carries 60 N; then G·x, and half of the surface."""
    jam = {"jam": {"service": "other_jammed", "at_s": 0.1}}
    record = flown(OTHER, jam, 50.0)
    assert at(record, "disconnected", 3.9) == 0.0
    assert at(record, "computed_m", 3.9) == pytest.approx(50.0 / (G + 8000.0), rel=1e-3)
    record = flown(OTHER, jam, 80.0)
    x = at(record, "computed_m", 3.9)
    assert at(record, "disconnected", 3.9) == 1.0
    assert at(record, "link_force_N", 3.9) == 0.0
    assert x == pytest.approx(80.0 / G, rel=1e-3)
    assert at(record, "asked_m", 3.9) == pytest.approx(0.5 * x, rel=1e-6)


def test_a_disconnect_lets_each_side_go_its_way() -> None:
    for to in (1.0, 0.51):  # a switch is on above one half
        record = flown(OTHER, {"open": {"service": "disconnected", "to": to}}, seconds=8.0)
        assert at(record, "computed_m", 7.9) == pytest.approx(20.0 / G, rel=1e-3)
        assert at(record, "other_m", 7.9) == pytest.approx(0.0, abs=1e-4)


BENT = {"bend_m_per_N": 9e-5, f"{PLACE}.compensation.bend_m_per_N": 9e-5}


def test_a_jam_holds_control_and_surface_whatever_the_structure_gives() -> None:
    events = {
        "jam": {"service": "jammed", "at_s": 0.2},
        "free": {"service": "jammed", "at_s": 3.0, "to": 0.0},
    }
    record = flown({}, events, 40.0, 6.0, rig=BENT)
    held = slice(20, 300)
    for name in ("computed_m", "surface_norm", "asked_m", "stop"):
        assert not record[f"column_{name}"][held].any()
    pushed = flown({}, {"jam": {"service": "jammed", "at_s": 0.2}}, -40.0)
    assert not pushed["column_computed_m"].any()
    assert not pushed["column_stop"].any()  # a jam is no stop
    assert at(record, "deflection_m", 2.9) == pytest.approx(9e-5 * 40.0, rel=1e-6)
    assert at(record, "estimate_m", 2.9) == pytest.approx(9e-5 * 40.0, rel=1e-6)
    assert at(record, "asked_m", 5.9) == pytest.approx(at(record, "deflection_m", 5.9), rel=1e-3)
    assert at(record, "deflection_m", 5.9) == pytest.approx(40.0 / G, rel=1e-3)


def test_a_jam_keeps_a_moving_control_where_it_was() -> None:
    record = flown({}, {"jam": {"service": "jammed", "at_s": 0.6}}, 40.0)
    there = at(record, "computed_m", 0.6)
    assert 0.0 < there < 0.5 * 40.0 / G
    assert at(record, "computed_m", 3.9) == there
    assert at(record, "surface_norm", 3.9) == at(record, "surface_norm", 0.6)


def test_a_jam_gives_way_to_what_it_does_not_withstand() -> None:
    for force, breaks in ((30.0, False), (40.0, True)):
        record = flown({"jam_breaks_N": 35.0}, {"jam": {"service": "jammed", "at_s": 0.2}}, force)
        assert at(record, "jammed", 3.9) == float(not breaks)
        wanted = force / G if breaks else 0.0
        assert at(record, "computed_m", 3.9) == pytest.approx(wanted, rel=1e-3)


def test_a_shaker_shakes_by_its_force_over_the_controls_impedance() -> None:
    w = 2.0 * math.pi * 8.0
    services = {"shaker_N": 12.0, "shaker_frequency_Hz": 8.0}
    record = flown(services, {"on": {"service": "shaker", "at_s": 0.5}}, 0.0, 3.0)
    late = record.time_s > 2.0
    basis = np.column_stack((np.sin(w * record.time_s[late]), np.cos(w * record.time_s[late])))
    found = np.linalg.lstsq(basis, record["column_computed_m"][late], rcond=None)[0]
    wanted = 12.0 / abs(complex(G - 4.0 * w * w, 150.0 * w))
    assert math.hypot(*found) == pytest.approx(wanted, rel=2e-3)
    assert not record["column_service_force_N"][record.time_s < 0.5].any()
    assert np.abs(record["column_service_force_N"]).max() == pytest.approx(12.0, rel=0.01)


def test_a_pusher_comes_over_its_rise_and_goes_as_it_came() -> None:
    services = {"pusher_N": 80.0, "pusher_rise_s": 0.5}
    events = {
        "on": {"service": "pusher", "at_s": 1.0},
        "off": {"service": "pusher", "at_s": 2.5, "to": 0.0},
    }
    record = flown(services, events, 0.0)
    assert at(record, "service_force_N", 1.25) == pytest.approx(-40.0, abs=2.0)
    assert at(record, "service_force_N", 2.4) == -80.0
    assert at(record, "computed_m", 2.5) == pytest.approx(-80.0 / G, rel=0.02)
    assert at(record, "service_force_N", 3.9) == 0.0


def test_a_soft_stop_is_a_second_spring_and_damps_on_the_way_out() -> None:
    services = {"soft_stop_m": 0.02, "soft_stop_stiffness_N_per_m": 3000.0}
    for side in (1.0, -1.0):
        record = flown(services, force_N=side * 40.0)
        x = side * (40.0 + 3000.0 * 0.02) / (G + 3000.0)
        assert at(record, "computed_m", 3.9) == pytest.approx(x, rel=1e-3)
    damped = flown({**services, "soft_stop_damping_N_s_per_m": 400.0}, force_N=40.0)
    assert damped["column_computed_m"].max() < record_max(flown(services, force_N=40.0))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_soft_stop_does_not_damp_the_way_back(side: float) -> None:
    """Let go in the stop: m·x'' + c·x' + G·x + k·(x − s) = 0, without the stop's own damping.

    From rest the solution is x = x_e + (x_0 − x_e)·exp(−a·t)·(cos(w·t) + (a/w)·sin(w·t)), with
    x_e = k·s/(G + k), a = c/(2m) and w² = (G + k)/m − a², as long as x > s.
    """
    mass, damping, stiffness, begins = 4.0, 150.0, 3000.0, 0.02
    services = {
        "soft_stop_m": begins,
        "soft_stop_stiffness_N_per_m": stiffness,
        "soft_stop_damping_N_s_per_m": 400.0,
    }
    let_go = Step(force_N=side * 60.0, start_s=0.5, duration_s=3.0, rise_s=0.0)
    record = flown(services, pilot=let_go)
    start = (60.0 + stiffness * begins) / (G + stiffness)
    centre = stiffness * begins / (G + stiffness)
    a = damping / (2.0 * mass)
    w = math.sqrt((G + stiffness) / mass - a * a)
    t = np.arange(0.0, 0.05, 0.01)
    wave = np.exp(-a * t) * (np.cos(w * t) + a / w * np.sin(w * t))
    wanted = centre + (start - centre) * wave
    assert np.all(wanted > begins)
    rows = np.searchsorted(record.time_s, 3.5 - 1e-9) + np.arange(len(t))
    found = side * record["column_computed_m"][rows]
    assert found == pytest.approx(wanted, abs=0.01 * (start - begins))


def record_max(record: Record) -> float:
    return float(record["column_computed_m"].max())


def test_hinge_moments_stiffen_with_pressure_and_an_envelope_pushes_back() -> None:
    record = flown({"hinge_surface_N_per_Pa": 0.02})
    stiffened = G + PRESSURE * 0.02 / 0.1778
    assert at(record, "computed_m", 3.9) == pytest.approx(20.0 / stiffened, rel=1e-3)
    # A bench stands at 1 g: 0.4 g beyond 0.6 are against a pull, 0.3 g short of 1.3 against a push.
    above = {"envelope_above_g": 0.6, "envelope_N_per_g": 30.0}
    below = {"envelope_below_g": 1.3, "envelope_push_N_per_g": 50.0}
    within = {**above, **below, "envelope_above_g": 1.1, "envelope_below_g": 0.9}
    for given, added in ((above, -12.0), (below, 15.0), ({**above, **below}, 3.0), (within, 0.0)):
        for force in (20.0, -20.0):
            record = flown(given, force_N=force)
            assert at(record, "computed_m", 3.9) == pytest.approx((force + added) / G, rel=1e-3)


def test_the_hinge_moment_follows_the_change_of_the_angle_of_attack() -> None:
    """−q̄·h_α·(α − α₀): none in trim, whatever α₀ is, and held over each frame of the flight."""
    share = 0.02
    rig = read_rig(shipped_rigs()["t37"])
    rig = rig.changed({f"{PLACE}.services.hinge_alpha_N_per_Pa_rad": share})
    record = fly(Manoeuvre(rig, {"column": Step(force_N=40.0, start_s=0.5)}, 2.0))
    alpha, pressure_Pa = record["alpha_rad"], record["dynamic_pressure_Pa"]
    assert abs(alpha[0]) > 0.01
    wanted = -share * pressure_Pa * (alpha - alpha[0])
    force = record["column_service_force_N"]
    at_rest = record.time_s < 0.45
    assert np.all(np.abs(force[at_rest]) < 0.01 * np.max(np.abs(wanted)))
    assert np.max(np.abs(wanted)) > 5.0
    # A row holds the force over the frame before it.
    assert force[1:] == pytest.approx(wanted[:-1], abs=1e-9)
    replayed = held_force(rig, record, "column")
    assert replayed is not None
    assert replayed == pytest.approx(wanted, abs=1e-12)


def test_a_feel_that_fails_leaves_its_share_of_the_gradient() -> None:
    record = flown({}, {"fail": {"service": "feel_lost", "to": 0.6, "over_s": 0.5}}, 10.0, 9.0)
    assert at(record, "gradient_N_per_m", 1.9) == G
    assert at(record, "gradient_N_per_m", 8.9) == pytest.approx(0.4 * G)
    assert at(record, "computed_m", 8.9) == pytest.approx(10.0 / (0.4 * G), rel=1e-3)


def test_a_feel_that_fails_leaves_its_share_of_both_segments() -> None:
    """0.4·(G₁·δ₁ + G₂·(δ − δ₁)) = F beyond the break."""
    second, at_m = 900.0, 0.01
    segments = {
        f"{PLACE}.schedule.second_gradient_N_per_m": [second, second],
        f"{PLACE}.schedule.break_deflection_m": at_m,
    }
    fails = {"fail": {"service": "feel_lost", "to": 0.6, "over_s": 0.5}}
    record = flown({}, fails, 10.0, 9.0, segments)
    beyond = (10.0 / 0.4 - G * at_m) / second
    assert at(record, "computed_m", 8.9) == pytest.approx(at_m + beyond, rel=1e-3)


def test_inactive_services_change_no_byte_of_the_record() -> None:
    """Every number of the section given, and nothing led or reached: the same flight."""
    plain = flown(force_N=20.0)
    services = {**DRIVEN, "shaker_N": 10.0, "pusher_N": 50.0, "soft_stop_m": 0.17}
    services |= {"jam_breaks_N": 5.0, "soft_stop_stiffness_N_per_m": 1e4, "envelope_above_g": 2.0}
    services |= {"envelope_below_g": 0.5, "envelope_push_N_per_g": 20.0}
    services |= {"shaker_alpha_rad": 0.2, "pusher_alpha_rad": 0.3}
    given = flown({**services, "envelope_N_per_g": 20.0})
    assert given.channels[: len(plain.channels)] == plain.channels
    assert given.channels[len(plain.channels) :] == service_channels("column")
    assert np.array_equal(given.data[:, : len(plain.channels)], plain.data)


def test_a_flying_rig_is_led_and_read_by_one_function() -> None:
    controls = pack(bench(STRAIGHT))
    assert not controls["state"]["services"]["on"][0]
    for service in services_of("column"):
        set_service(controls, ["column"], "column", service, 0.5)
        assert service_command(controls, ["column"], "column", service) == 0.5
    assert controls["state"]["services"]["on"][0]
    row = np.ones((1, len(service_channels("column"))))
    copy_service_rows(controls, ["column"], ["column"], row)
    assert not row.any()  # nothing is recorded before the first frame
    assert "trim_rad" in services_of("wheel")
    assert len(services_of("wheel")) == len(SERVICES)


def test_only_an_autopilot_that_engages_takes_the_place_where_the_control_is() -> None:
    controls = pack(bench(STRAIGHT))
    state = controls["state"][0]
    state["loader"]["computed"] = 0.03

    def holds_at(service: str, value: float) -> float:
        set_service(controls, ["column"], "column", service, value)
        return service_command(controls, ["column"], "column", "autopilot_m")

    assert holds_at("autopilot_m", 0.01) == 0.01
    assert holds_at("shaker", 1.0) == 0.01
    assert holds_at("autopilot", 0.5) == 0.01  # half is not engaged
    assert holds_at("autopilot", 1.0) == 0.03
    state["loader"]["computed"] = 0.04
    assert holds_at("autopilot", 0.9) == 0.03  # engaged already
    assert holds_at("autopilot", 0.0) == 0.03


def test_a_switch_is_led_from_0_to_1_and_a_place_within_the_travel() -> None:
    given = {**DRIVEN, **OTHER, "shaker_N": 1.0, "pusher_N": 1.0}
    rig = bench({**STRAIGHT, **{f"{PLACE}.services.{key}": to for key, to in given.items()}})
    travel = rig.controls["column"].travel
    switches = {"trim_release", "autopilot", "disconnected", "jammed", "other_jammed"}
    switches |= {"shaker", "pusher", "feel_lost"}
    ends = dict.fromkeys(switches, (0.0, 1.0))
    ends |= dict.fromkeys(("trim_m", "autopilot_m"), (-travel, travel))
    for service in services_of("column"):
        low, high = ends.get(service, (-1e3, 1e3))
        for to in (low, high):
            check_service(rig, "column", service, to, "test", "event.it")
        for to in (low - 0.05, high + 0.05) if service in ends else ():
            with pytest.raises(InputError, match=r"event\.it\.to"):
                check_service(rig, "column", service, to, "test", "event.it")


@pytest.mark.parametrize(
    ("event", "says"),
    [
        ({"service": "jamed"}, "event.it.service: no 'jamed'; did you mean jammed"),
        ({"service": "shaker"}, "does nothing without controls.column.services.shaker_N"),
        ({"service": "trim_m", "to": 0.5}, "beyond the control's travel"),
        ({"service": "jammed", "to": 2.0}, "from 0 to 1"),
        ({"service": "jammed", "control": "wheel"}, "the rig has no wheel"),
    ],
)
def test_an_event_that_a_service_cannot_follow_is_refused(event: dict[str, Any], says: str) -> None:
    with pytest.raises(InputError, match=says):
        flown({}, {"it": event})
