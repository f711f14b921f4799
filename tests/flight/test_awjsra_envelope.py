"""The Augmentor Wing aircraft away from its approach: upsets, an engine out, the ground."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from tests.support.awjsra import CLEAN, HOME, LEVERS, fly, place, trimmed

CONTROLS = ("fcs/elevator-cmd-norm", "fcs/aileron-cmd-norm", "fcs/rudder-cmd-norm")


@pytest.mark.parametrize(
    ("alpha_deg", "beta_deg"),
    [(-15.0, 0.0), (15.0, 0.0), (35.0, 0.0), (60.0, 0.0), (4.0, 15.0), (4.0, -15.0)],
)
@pytest.mark.parametrize("clean", [False, True], ids=["approach", "clean at 130 kt"])
def test_the_aircraft_recovers_from_an_upset_hands_off(
    alpha_deg: float, beta_deg: float, clean: bool
) -> None:
    level = {"calibrated_airspeed_m_per_s": 66.9, "flight_path_rad": 0.0} if clean else {}
    fdm = trimmed(CLEAN if clean else {}, altitude_m=1800.0, **level)
    trim_deg, knots = fdm["aero/alpha-deg"], fdm["velocities/vc-kts"]
    place(fdm, alpha__deg=alpha_deg, beta__deg=beta_deg)
    assert fdm["aero/alpha-deg"] == pytest.approx(alpha_deg, abs=0.1)
    assert fdm["aero/beta-deg"] == pytest.approx(beta_deg, abs=0.1)
    fly(fdm, 60.0)
    assert fdm["aero/alpha-deg"] == pytest.approx(trim_deg, abs=2.5)
    assert fdm["aero/beta-deg"] == pytest.approx(0.0, abs=1.0)
    assert fdm["velocities/vc-kts"] == pytest.approx(knots, rel=0.12)
    assert abs(fdm["attitude/phi-deg"]) < 5.0


@pytest.mark.parametrize("seed", range(6))
def test_random_control_inputs_leave_a_bounded_state(seed: int) -> None:
    """A minute of random controls and levers: finite, no tumbling, no energy out of nothing."""
    random = np.random.default_rng(seed)
    fdm = trimmed()
    place(
        fdm,
        {"fcs/flap-cmd-norm": random.random(), "fcs/nozzle-cmd-deg": random.uniform(18.5, 116.0)},
        alpha__deg=random.uniform(-20.0, 30.0),
        beta__deg=random.uniform(-15.0, 15.0),
        phi__deg=random.uniform(-60.0, 60.0),
        vc__kts=random.uniform(45.0, 160.0),
        h__sl__ft=13_000.0,
    )
    watched = ("velocities/p-rad_sec", "velocities/q-rad_sec", "velocities/r-rad_sec")
    for _ in range(60):
        for name in CONTROLS:
            fdm[name] = float(np.clip(random.normal(0.0, 0.5), -1.0, 1.0))
        if random.random() < 0.2:
            fdm[LEVERS[random.integers(2)]] = random.random()
            fdm["fcs/nozzle-cmd-deg"] = random.uniform(0.0, 130.0)
        before, thrust = energy(fdm), 0.0
        for _ in range(120):
            fdm.run()
            thrust = max(thrust, 1.5 * fdm["aero/hot-thrust-lbs"])  # with the cold jets'
            assert max(abs(fdm[name]) for name in watched) < 3.0
            assert 20.0 < fdm["velocities/vt-fps"] < 600.0
        # In a second no more than its jets can do along the path; fuel burnt is weight lost
        assert energy(fdm) - before < 1.05 * thrust * fdm["velocities/vt-fps"] + 3e4


def energy(fdm: Any) -> float:
    """Return height and speed as energy, lb·ft."""
    speed, weight = fdm["velocities/vt-fps"], fdm["inertia/weight-lbs"]
    return float(weight * (fdm["position/h-sl-ft"] + speed * speed / 64.35))


@pytest.mark.parametrize(
    ("command", "value", "surface", "angle_deg", "turns"),
    [
        ("elevator", -1.0, "elevator", -25.0, "q"),
        ("elevator", 1.0, "elevator", 15.0, "-q"),
        ("aileron", 1.0, "left-aileron", 17.0, "p"),
        ("aileron", -1.0, "right-aileron", 17.0, "-p"),
        ("rudder", 1.0, "rudder", 25.0, "-r"),
        ("rudder", -1.0, "rudder", -25.0, "r"),
    ],
)
def test_full_controls_are_the_published_travel_and_turn_it_their_way(
    command: str, value: float, surface: str, angle_deg: float, turns: str
) -> None:
    """The elevator's and ailerons' trailing edges down are positive, the rudder's to the left."""
    fdm = place(trimmed(), {f"fcs/{command}-cmd-norm": value})
    assert fdm[f"fcs/{surface}-pos-rad"] == pytest.approx(math.radians(angle_deg), rel=1e-6)
    sign = -1.0 if turns.startswith("-") else 1.0
    assert sign * fdm[f"accelerations/{turns[-1]}dot-rad_sec2"] > 0.03


def test_without_rate_limits_the_surfaces_are_there_at_once() -> None:
    fdm = trimmed()
    fdm["fcs/aileron-cmd-norm"] = fdm["fcs/rudder-cmd-norm"] = 0.5
    fdm.run()
    fdm.run()
    found = fdm["fcs/left-aileron-pos-rad"], fdm["fcs/rudder-pos-rad"]
    assert found == pytest.approx((math.radians(8.5), math.radians(12.5)), rel=1e-6)


def test_the_ailerons_droop_with_the_flap() -> None:
    fdm = place(trimmed(), {"fcs/flap-cmd-norm": 1.0})
    assert fdm["fcs/aileron-droop-rad"] == pytest.approx(math.radians(30.0), rel=1e-6)


@pytest.mark.parametrize(("asked_deg", "stands_deg"), [(0.0, 18.5), (60.0, 60.0), (180.0, 116.0)])
def test_the_nozzles_stop_where_published(asked_deg: float, stands_deg: float) -> None:
    fdm = place(trimmed(), {"fcs/nozzle-cmd-deg": asked_deg})
    assert fdm["fcs/nozzle-pos-deg"] == pytest.approx(stands_deg, abs=0.01)
    for engine in range(2):
        turned = math.degrees(fdm[f"propulsion/engine[{engine}]/pitch-angle-rad"])
        assert turned == pytest.approx(stands_deg, abs=0.01)


def test_an_engine_out_in_the_approach_is_held_by_the_wheel() -> None:
    fdm = trimmed(altitude_m=1000.0)
    fdm.run()
    thrust = fdm["propulsion/engine[1]/thrust-lbs"]
    place(fdm, {LEVERS[1]: 0.0})
    lost = thrust - fdm["propulsion/engine[1]/thrust-lbs"]
    # What lifts 14 ft out no longer does, on an inertia of 380,000 slug·ft²
    wanted = lost * math.sin(math.radians(87.7)) * 14.0 / 380_000.0
    assert fdm["accelerations/pdot-rad_sec2"] == pytest.approx(wanted, rel=0.02)
    place(fdm, {"fcs/aileron-cmd-norm": -1.0})
    assert fdm["accelerations/pdot-rad_sec2"] < -0.02


def test_the_stall_gives_way_to_a_push() -> None:
    """Clean and idle, the column right back: it slows to its greatest lift, and recovers."""
    fdm = trimmed(CLEAN, altitude_m=2500.0, calibrated_airspeed_m_per_s=60.0, flight_path_rad=0.0)
    trim = fdm["fcs/elevator-cmd-norm"]
    greatest = 0.0
    fdm["fcs/elevator-cmd-norm"] = -1.0
    for lever in LEVERS:
        fdm[lever] = 0.0
    for _ in range(120 * 20):
        fdm.run()
        force = fdm["forces/fbz-aero-lbs"] / fdm["aero/qbar-psf"] / 865.0
        greatest = max(greatest, -force)
    assert greatest == pytest.approx(2.2, abs=0.3)  # regression: no stall figure is at hand
    assert fdm["aero/alpha-deg"] > 20.0
    fdm["fcs/elevator-cmd-norm"] = min(1.0, trim + 0.4)
    fly(fdm, 8.0)
    assert abs(fdm["aero/alpha-deg"]) < 12.0


@pytest.mark.parametrize(("sink_fps", "most_g"), [(4.6, 1.8), (13.0, 3.2)])
def test_the_gear_takes_its_sink_rate(sink_fps: float, most_g: float) -> None:
    fdm = trimmed()
    speed = fdm["velocities/vt-fps"]
    path_deg = -math.degrees(math.asin(sink_fps / speed))
    place(fdm, h__agl__ft=9.7, theta__deg=4.0, gamma__deg=path_deg)
    greatest, stroke = 0.0, 0.0
    for _ in range(360):
        fdm.run()
        greatest = max(greatest, fdm["accelerations/Nz"])
        stroke = max(stroke, fdm["gear/unit[1]/compression-ft"])
    assert 1.3 < greatest < most_g
    assert stroke < 2.0


def test_the_aircraft_stands_on_its_wheels_and_takes_off() -> None:
    fdm = trimmed()
    brakes = {"fcs/left-brake-cmd-norm": 1.0, "fcs/right-brake-cmd-norm": 1.0}
    idle = dict.fromkeys(LEVERS, 0.0)
    levers = {**brakes, **idle, "fcs/nozzle-cmd-deg": 18.5, "fcs/flap-cmd-norm": 0.4}
    place(fdm, levers, vt__kts=0.0, h__agl__ft=8.3, theta__deg=1.0)
    fly(fdm, 10.0)
    assert fdm["accelerations/Nz"] == pytest.approx(1.0, abs=0.02)
    assert fdm["attitude/theta-deg"] == pytest.approx(1.1, abs=0.5)
    assert abs(fdm["velocities/vg-fps"]) < 0.05
    for name in brakes:
        fdm[name] = 0.0
    for lever in LEVERS:
        fdm[lever] = 1.0
    seconds = 0
    while fdm["position/h-agl-ft"] < 50.0 and seconds < 40:
        if fdm["velocities/vc-kts"] > 75.0:
            fdm["fcs/elevator-cmd-norm"] = -0.35
        fly(fdm, 1.0)
        seconds += 1
    assert seconds < 30
    assert abs(fdm["attitude/phi-deg"]) < 0.1
    assert abs(fdm["aero/beta-deg"]) < 0.1


def test_at_full_power_on_the_brakes_it_stands_still() -> None:
    """No wind gives the air's forces a direction; what the nozzles lift is taken off the wheels."""
    fdm = trimmed()
    levers = {"fcs/left-brake-cmd-norm": 1.0, "fcs/right-brake-cmd-norm": 1.0}
    levers |= dict.fromkeys(LEVERS, 1.0)
    place(fdm, {**levers, "fcs/nozzle-cmd-deg": 90.0}, vt__kts=0.0, h__agl__ft=8.5, theta__deg=1.0)
    fly(fdm, 20.0)
    felt = []
    for _ in range(600):
        fdm.run()
        felt.append(fdm["accelerations/Nz"])
    assert felt == pytest.approx([1.0] * 600, abs=0.02)
    assert abs(fdm["velocities/vg-fps"]) < 0.05


def test_thrust_takes_seconds_to_come_and_go() -> None:
    fdm = trimmed()
    fdm.run()
    start = fdm["aero/hot-thrust-lbs"]
    for lever in LEVERS:
        fdm[lever] = 0.0
    fly(fdm, 0.5)
    assert 0.3 * start < fdm["aero/hot-thrust-lbs"] < 0.8 * start
    fly(fdm, 3.0)
    idle = fdm["aero/hot-thrust-lbs"]
    assert idle == pytest.approx(0.05 * 11_000.0, rel=0.12)  # less the altitude's share
    for lever in LEVERS:
        fdm[lever] = 1.0
    fly(fdm, 1.0)
    assert fdm["aero/hot-thrust-lbs"] < 3_000.0
    fly(fdm, 3.0)
    assert fdm["aero/hot-thrust-lbs"] == pytest.approx(20.0 * idle, rel=0.03)


def test_jsbsim_loads_the_model_without_a_warning() -> None:
    """At JSBSim's debug level, which lists what it loads, there is no warning."""
    code = """
import sys, jsbsim
fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
fdm.set_aircraft_path(sys.argv[1])
assert fdm.load_model("awjsra") and fdm.run_ic()
for _ in range(10): fdm.run()
"""
    done = subprocess.run(
        [sys.executable, "-c", code, str(HOME.parent)],
        check=True,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stderr == ""
    assert "Reading Aircraft Configuration File: Augmentor Wing" in done.stdout
    for word in ("warning", "error", "beta release", "not fly", "could not", "does not exist"):
        assert word not in done.stdout.lower()
