"""Adverse conditions: each acts as its closed form or its mirror image predicts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.loop import fly, make_airframe
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.runfile import read_run
from coupled.record.channels import ALPHA, ELEVATOR, PRESSURE, SPEED
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.units import POUND_N, FOOT_m

RUN = """
name = "adverse"
card = "A test."
rig = "{rig}"
duration_s = {duration}
seed = {seed}
record_properties = {extra}

[pilot.column]
kind = "step"
force_N = 0.0

{conditions}
"""
AIR = [f"atmosphere/total-wind-{way}-fps" for way in ("north", "east", "down")]


def scenario(
    folder: Path,
    conditions: str,
    rig: str = "report-column",
    extra: list[str] | None = None,
    duration: float = 4.0,
    seed: int = 3,
) -> Manoeuvre:
    path = folder / "adverse.toml"
    text = RUN.format(
        conditions=conditions, rig=rig, extra=extra or [], duration=duration, seed=seed
    )
    path.write_text(text, encoding="utf-8")
    return read_run(str(path))[0]


def flown(folder: Path, conditions: str, **more: Any) -> Record:
    return fly(scenario(folder, conditions, **more))


def test_a_gust_is_one_minus_cosine_of_its_velocity(tmp_path: Path) -> None:
    gust = "at_s = 1.0\nrise_s = 0.5\nhold_s = 0.3\nfall_s = 1.0\n"
    gust += "along_m_per_s = 2.0\nacross_m_per_s = -1.0\nup_m_per_s = 3.0\n"
    record = flown(tmp_path, "[gust]\n" + gust, extra=AIR)
    # Row k is what holds at t_k, after the air of the frame before it.
    t = record.time_s - 1.0 - record.time_s[1]
    up, down = np.clip(t / 0.5, 0.0, 1.0), np.clip((t - 0.8) / 1.0, 0.0, 1.0)
    share = 0.5 * (1.0 - np.cos(np.pi * up)) - 0.5 * (1.0 - np.cos(np.pi * down))
    share[t > 1.8] = 0.0
    for name, speed in zip(AIR, (2.0, -1.0, -3.0), strict=True):
        assert record[name] * FOOT_m == pytest.approx(speed * share, abs=0.02)
    # An updraught of 3 m/s at 154 m/s, less what the aircraft rises with it meanwhile.
    lifted = record["alpha_rad"][120:180].max() - record["alpha_rad"][119]
    assert 0.4 * 3.0 / 154.0 < lifted < 3.0 / 154.0


def test_a_gust_has_the_earths_axes_and_not_the_bodys(tmp_path: Path) -> None:
    """Met in a descent, nose down, a gust straight up has no part along the flight."""
    gust = "[gust]\nat_s = 0.5\nrise_s = 0.2\nhold_s = 5.0\nup_m_per_s = 5.0\n"
    descent = scenario(tmp_path, gust, rig="t37", extra=AIR, duration=1.5)
    rig = descent.rig.changed({"flight.flight_path_rad": -0.1})
    record = fly(replace(descent, rig=rig))
    assert record["pitch_rad"].max() < -0.04
    north, east, down = (record[name][-1] * FOOT_m for name in AIR)
    assert (north, east, down) == pytest.approx((0.0, 0.0, -5.0), abs=0.05)


@pytest.mark.parametrize(("model", "number"), [("milspec", 3.0), ("tustin", 4.0)])
def test_turbulence_is_of_the_model_that_is_named(
    tmp_path: Path, model: str, number: float
) -> None:
    """By JSBSim's FGWinds: 3 is ttMilspec, 4 is ttTustin."""
    table = f'[turbulence]\nmodel = "{model}"\nwind_at_6m_m_per_s = 5.0\nseverity = 3\n'
    record = flown(tmp_path, table, extra=["atmosphere/turb-type"], duration=0.2)
    assert record["atmosphere/turb-type"][-1] == number


@pytest.mark.parametrize("model", ["milspec", "tustin"])
def test_turbulence_comes_from_the_seed_and_grows_with_the_wind(tmp_path: Path, model: str) -> None:
    def air(wind: float, seed: int) -> np.ndarray:
        table = f'[turbulence]\nmodel = "{model}"\nwind_at_6m_m_per_s = {wind}\nseverity = 3\n'
        low = scenario(tmp_path, table, extra=AIR, duration=20.0, seed=seed)
        rig = low.rig.changed({"flight.altitude_m": 200.0})
        return fly(replace(low, rig=rig)).data[:, -3:]

    one, again, other, double = air(5.0, 1), air(5.0, 1), air(5.0, 2), air(10.0, 1)
    assert np.array_equal(one, again)
    assert not np.array_equal(one, other)
    # MIL-F-8785C below 1000 ft: σ_w = 0.1 of the wind at 20 ft, so it doubles with it.
    assert np.std(double[:, 2]) == pytest.approx(2.0 * np.std(one[:, 2]), rel=0.02)
    # 20 s are some 15 lengths of the spectrum, so that their rms is known to a third.
    assert np.std(one[:, 2]) * FOOT_m == pytest.approx(0.1 * 5.0, rel=0.5)


def test_a_trim_that_runs_away_is_held_by_as_much_column(tmp_path: Path) -> None:
    event = '[event.runaway]\nat_s = 1.0\nover_s = 0.5\ntrim = "column"\nby_norm = -0.1\n'
    moved = flown(tmp_path, event)
    still = flown(tmp_path, "")
    assert np.array_equal(moved.data[:121], still.data[:121])
    assert moved["pitch_rate_rad_per_s"][180] < -0.01  # nose-down
    held = scenario(tmp_path, event)
    airframe, trimmed = make_airframe(held), make_airframe(scenario(tmp_path, ""))
    for k in range(240):
        gone = -0.1 * min(max((k / 120 - 1.0) / 0.5, 0.0), 1.0)
        airframe.step((gone, 0.0, 0.0))  # pulled as far: JSBSim's elevator is nose up negative
        trimmed.step((0.0, 0.0, 0.0))
        assert airframe.motion() == pytest.approx(trimmed.motion(), rel=1e-6, abs=1e-6)


def test_two_events_may_move_one_trim(tmp_path: Path) -> None:
    there = '[event.a]\nat_s = 1.0\ntrim = "column"\nby_norm = -0.2\n'
    back = '[event.b]\nat_s = 1.5\nover_s = 1.0\ntrim = "column"\nby_norm = 0.2\n'
    trim = "fcs/pitch-trim-cmd-norm"
    record = flown(tmp_path, there + back, extra=[trim])
    away = record[trim] - record[trim][0]
    assert away[[100, 130, 240, 400]] == pytest.approx([0.0, 0.2, 0.1, 0.0], abs=2e-3)


@pytest.mark.parametrize(
    ("rig", "engine", "angle"),
    # The jets of awjsra's engines point down: it banks to the side that is carried no more.
    [("737", 1, "psi"), ("b747", 3, "psi"), ("t37", 0, "psi"), ("awjsra", 1, "phi")],
)
def test_an_engine_that_stops_turns_the_aircraft_to_its_side(
    tmp_path: Path, rig: str, engine: int, angle: str
) -> None:
    number = f"[{engine}]" if engine else ""
    names = [f"propulsion/engine{number}/thrust-lbs", f"attitude/{angle}-rad"]
    record = flown(
        tmp_path, f"[event.out]\nat_s = 1.0\nengine_out = {engine}\n", rig=rig, extra=names
    )
    thrust, angles = record[names[0]], np.unwrap(record[names[1]])
    assert thrust[100] > 100.0
    assert abs(thrust[-1]) < 0.05 * thrust[100]
    turned = angles[-1] - angles[0]  # the right one: to the right
    assert turned > 1e-3 if engine else turned < -1e-3


def test_a_piston_engine_stops_too(tmp_path: Path) -> None:
    thrust = "propulsion/engine/thrust-lbs"
    out = flown(tmp_path, "[event.out]\nat_s = 1.0\nengine_out = 0\n", rig="c172p", extra=[thrust])
    assert out[thrust][100] > 100.0
    assert out[thrust][-1] < 0.0  # the propeller turns on, and brakes


def test_a_property_is_led_to_its_value(tmp_path: Path) -> None:
    throttle = "fcs/throttle-cmd-norm"
    event = f'[event.cut]\nat_s = 1.0\nover_s = 2.0\nproperty = "{throttle}"\nto = 0.0\n'
    record = flown(tmp_path, event, extra=[throttle])
    start = record[throttle][0]
    assert record[throttle][[100, 240, 400]] == pytest.approx([start, 0.5 * start, 0.0], abs=5e-3)
    assert record["true_airspeed_m_per_s"][-1] < record["true_airspeed_m_per_s"][0] - 0.5


def test_ice_on_the_flaps_brakes_by_its_drag(tmp_path: Path) -> None:
    """A model's own coefficient, led up: m·V' = −q̄·S·ΔC_D·sin²(flap) at once, of 40,000 lb."""
    event = '[event.ice]\nat_s = 1.0\nproperty = "awjsra/flap-drag"\nto = 0.366\n'
    iced, clean = flown(tmp_path, event, rig="awjsra"), flown(tmp_path, "", rig="awjsra")
    area, mass = 865.0 * FOOT_m**2, 40_000.0 * POUND_N / 9.80665
    drag = clean["dynamic_pressure_Pa"][120] * area * 0.2 * np.sin(np.radians(65.0)) ** 2
    slower = clean["true_airspeed_m_per_s"] - iced["true_airspeed_m_per_s"]
    assert slower[120] == pytest.approx(0.0, abs=1e-9)
    assert slower[180] == pytest.approx(0.5 * drag / mass, rel=0.05)


def loaded(rig: str, **changes: float) -> JSBSimAirframe:
    nominal = read_run({"737": "pull-up-737", "awjsra": "awjsra-shear"}[rig])[0].rig
    flight = nominal.changed({f"flight.{key}": value for key, value in changes.items()}).flight
    assert flight is not None
    return make_aircraft(flight, 1 / 120, ("column",), [aircraft_folder()])


def test_a_centre_of_gravity_further_aft_takes_nose_down_elevator() -> None:
    """ΔC_m = C_N·Δx/c̄ for a normal force that is the weight, over C_mδ = −1.2 (less with Mach)."""
    shift = 0.3
    before, after = loaded("737"), loaded("737", cg_aft_m=shift)
    start, end = before.motion(), after.motion()
    q, speed, alpha = start[PRESSURE], start[SPEED], start[ALPHA]
    weight = 107_000 * POUND_N
    normal = weight * np.cos(alpha) / (q * 1171.0 * FOOT_m**2)
    power = 1.2 - 0.45 * speed / 328.6  # the model's table against Mach, at 3000 m
    moved = end[ELEVATOR] - start[ELEVATOR]
    # The stabilising 0.6 by which the model's C_m falls with α acts where α has changed.
    moved += 0.6 * (end[ALPHA] - alpha) / power
    assert moved == pytest.approx(normal * shift / (12.31 * FOOT_m) / power, rel=0.03)


def test_fuel_is_mass(tmp_path: Path) -> None:
    weight = "inertia/weight-lbs"
    run = scenario(tmp_path, "", rig="737", extra=[weight], duration=0.1)
    found = {}
    for fuel in (0.5, 1.0):
        rig = run.rig.changed({"flight.fuel": fuel})
        found[fuel] = fly(replace(run, rig=rig))[weight][0]
    assert found[1.0] - found[0.5] == pytest.approx(0.5 * (found[1.0] - 83_000.0), rel=1e-3)


@pytest.mark.parametrize(
    ("conditions", "key", "says"),
    [
        ("[gust]\nat_s = 1.0\nrise_s = 1.0", "gust", "moves no air"),
        ("[gust]\nat_s = 1.0\nup_m_per_s = 1.0", "gust.rise_s", "is missing"),
        ("[gust]\nat_s = 1.0\nrise_s = 0.0\nup_m_per_s = 1.0", "gust.rise_s", "greater than 0"),
        ("[turbulence]\nseverity = 9\nwind_at_6m_m_per_s = 3.0", "turbulence.severity", "7"),
        ('[turbulence]\nmodel = "x"\nwind_at_6m_m_per_s = 3.0', "turbulence.model", "'milspec'"),
        ("event = 3", "event", "[event.NAME]"),
        ("[event.a]\nat_s = 1.0", "event.a", "one of engine_out, trim, property and service"),
        ('[event.a]\nat_s = 1.0\ntrim = "column"', "event.a.by_norm", "is given with trim"),
        ("[event.a]\nat_s = 1.0\nengine_out = 0\nto = 1.0", "event.a.to", "with property"),
        ("[event.a]\nat_s = 1.0\nover_s = 1.0\nengine_out = 0", "event.a.over_s", "at once"),
        ("[event.a]\nat_kt = 1.0\nengine_out = 0", "event.a.at_kt", "at_s"),
    ],
)
def test_a_fault_is_one_line_with_its_key(
    tmp_path: Path, conditions: str, key: str, says: str
) -> None:
    text = RUN.replace("[pilot", conditions + "\n[pilot") if "event = " in conditions else ""
    path = tmp_path / "adverse.toml"
    with pytest.raises(InputError) as caught:
        if text:
            path.write_text(text.format(conditions="", rig="737", extra=[], duration=1, seed=1))
            read_run(str(path))
        scenario(tmp_path, conditions)
    assert caught.value.key == key
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("event", "key", "says"),
    [
        ("engine_out = 2", "event.a.engine_out", "no such engine"),
        ('property = "fcs/flaps"\nto = 1.0', "event.a.property", "none is created"),
        ('property = "inertia/mass-slugs"\nto = 1.0', "event.a.property", "does not let"),
        ('property = "simulation/dt"\nto = 1.0', "event.a.property", "not set in flight"),
    ],
)
def test_a_condition_that_the_model_lacks_is_refused_before_the_flight(
    tmp_path: Path, event: str, key: str, says: str
) -> None:
    with pytest.raises(InputError) as caught:
        flown(tmp_path, f"[event.a]\nat_s = 1.0\n{event}\n")
    assert caught.value.key == key
    assert says in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "key", "says"),
    [({"fuel": 50.0}, "flight.fuel", "is more than the tanks"), ({"cg_aft_m": 4.0}, "flight", "")],
)
def test_an_impossible_load_is_refused(changes: dict[str, float], key: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        loaded("awjsra", **changes)
    assert caught.value.key.startswith(key)
    assert says in str(caught.value)
