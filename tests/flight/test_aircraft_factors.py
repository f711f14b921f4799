"""The factors on an aircraft's forces, moments and inertia, against closed forms and edited models.

Each is flown on seven models of four kinds: light, transport, fighter and powered lift.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft, make_unchecked
from coupled.flight.altered import ALTERATIONS, UNALTERED
from coupled.flight.gusts import Gusts, dryden
from coupled.flight.loading import INERTIAS
from coupled.record.channels import motion_channels
from coupled.resources import aircraft_folder, shipped_rigs
from coupled.rig.parameters import Flight
from coupled.rig.rigfile import read_rig
from coupled.schema import changed
from tests.support.models import edited_model, multiplied

FRAME = 1 / 120
CONTROLS = ("column", "wheel", "pedals")
CHANNELS = motion_channels(CONTROLS, flown=True)
GEAR_UP = {"gear/gear-cmd-norm": 0.0}
Floats = NDArray[np.float64]


def _shipped(name: str) -> Flight:
    flight = read_rig(shipped_rigs()[name]).flight
    assert flight is not None
    return flight


FLIGHTS = {
    **{name: _shipped(name) for name in ("c172p", "737", "b747", "t37", "awjsra")},
    "a320": Flight(
        model="A320",
        altitude=3000.0,
        calibrated_airspeed=130.0,
        properties=GEAR_UP,
        direct_controls=False,
    ),
    "f16": Flight(model="f16", altitude=3000.0, calibrated_airspeed=200.0, direct_controls=False),
}
# Any other value than the neutral one.
OTHER = {
    **dict.fromkeys([*(a.part.name for a in ALTERATIONS), *INERTIAS, "mass"], 0.7),
    "pitching_moment": 0.01,
    "lift_offset": 0.01,
    "yawing_moment": 0.001,
    "side_force": 0.01,
    "cg_aft_m": 0.1,
    "gust_rms_m_per_s": 1.0,
    "lateral_gust_rms_m_per_s": 1.0,
}
WITHOUT_ADVERSE_YAW = ("737", "a320")


def flying(
    name: str,
    changes: dict[str, Any],
    frames: int = 60,
    commands: tuple[float, float, float] = (-0.05, 0.05, 0.05),
) -> Floats:
    """Return the motion under a pulse of all controls, shape (frames, channels)."""
    flight = changed(FLIGHTS[name], changes, name, "flight")
    aircraft = make_aircraft(flight, FRAME, CONTROLS, [aircraft_folder()])
    found = []
    for k in range(frames):
        found.append(aircraft.motion())
        aircraft.step(commands if k < frames // 2 else (0.0, 0.0, 0.0))
    return np.array(found)


def in_trim(name: str, changes: dict[str, Any], record: Sequence[str]) -> Floats:
    """Return properties in trim."""
    flight = changed(FLIGHTS[name], changes, name, "flight")
    models = [aircraft_folder()]
    return np.array(make_aircraft(flight, FRAME, CONTROLS, models, record=record).extra())


@pytest.mark.parametrize("name", FLIGHTS)
def test_every_factor_flies_on_every_model(name: str) -> None:
    nominal = flying(name, {})
    for key, value in OTHER.items():
        if key == "adverse_yaw" and name in WITHOUT_ADVERSE_YAW:
            with pytest.raises(InputError, match="has no yawing moment due to the ailerons"):
                flying(name, {key: value})
            continue
        found = flying(name, {key: value})
        assert np.all(np.isfinite(found)), key
        # A 747's C_nδa is zero.
        moved = not np.array_equal(found, nominal)
        assert moved or (name, key) == ("b747", "adverse_yaw"), key


@pytest.mark.parametrize("name", FLIGHTS)
def test_neutral_factors_change_no_byte(name: str) -> None:
    assert set(OTHER) - {"cg_aft_m"} == set(UNALTERED) - {"terms"}
    assert flying(name, dict(UNALTERED)).tobytes() == flying(name, {}).tobytes()


@pytest.mark.parametrize(
    ("key", "function"),
    [
        ("roll_damping", "/Clp"),
        ("yaw_damping", "/Cnr"),
        ("dihedral_effect", "/Clb"),
        ("directional_stability", "/Cnb"),
        ("side_force_slope", "/CYb"),
        ("adverse_yaw", "/Cnda"),
    ],
)
def test_a_lateral_derivative_is_that_of_an_edited_model(
    tmp_path: Path, key: str, function: str
) -> None:
    flight = FLIGHTS["c172p"]
    models = edited_model(tmp_path, "c172p", multiplied({function: 0.7}))
    edited = make_unchecked(flight, FRAME, CONTROLS, [models])
    wanted = []
    for k in range(60):
        wanted.append(edited.motion())
        edited.step((-0.05, 0.05, 0.05) if k < 30 else (0.0, 0.0, 0.0))
    found, nominal = flying("c172p", {key: 0.7}), flying("c172p", {})
    scale = np.ptp(nominal, axis=0) + 1e-6
    assert np.max(np.abs(found - wanted) / scale) < 1e-9
    assert np.max(np.abs(nominal - wanted) / scale) > 1e-3


def test_less_roll_damping_gives_a_higher_steady_roll_rate() -> None:
    """p = −C_lδa·δa/C_lp·2V/b if only the roll is free: no dihedral, a large yaw inertia."""
    rolling = {"dihedral_effect": 0.0, "yaw_inertia": 10.0}
    rate = CHANNELS.index("roll_rate_rad_per_s")
    steady = [
        flying("t37", {**rolling, "roll_damping": factor}, 960, (0.0, 0.03, 0.0))[479, rate]
        for factor in (1.0, 0.7)
    ]
    assert steady[1] / steady[0] == pytest.approx(1.0 / 0.7, rel=0.04)


@pytest.mark.parametrize(
    ("key", "command", "channel"),
    [
        ("aileron_effectiveness", (0.0, 0.05, 0.0), "roll_rate_rad_per_s"),
        ("rudder_effectiveness", (0.0, 0.0, 0.05), "yaw_rate_rad_per_s"),
    ],
)
@pytest.mark.parametrize("name", ["c172p", "t37", "awjsra"])
def test_a_surface_does_more_or_less_about_its_trim(
    name: str, key: str, command: tuple[float, float, float], channel: str
) -> None:
    """The trim and the surface stay; the rate after two frames is the factor times the nominal."""
    found, nominal, still = (
        flying(name, changes, 6, moved)
        for changes, moved in (({key: 0.6}, command), ({}, command), ({}, (0.0, 0.0, 0.0)))
    )
    at, surface = CHANNELS.index(channel), CHANNELS.index(f"{key.partition('_')[0]}_rad")
    assert np.array_equal(found[0], nominal[0])
    assert np.array_equal(found[:, surface], nominal[:, surface])
    moved, wanted = found[2, at] - still[2, at], nominal[2, at] - still[2, at]
    assert moved == pytest.approx(0.6 * wanted, rel=0.02)


@pytest.mark.parametrize("name", FLIGHTS)
def test_a_moment_of_inertia_is_scaled_alone(name: str) -> None:
    pairs = ("xx", "yy", "zz", "xy", "xz", "yz")
    record = [f"inertia/i{pair}-slugs_ft2" for pair in pairs]
    record += ["inertia/weight-lbs", *(f"inertia/cg-{axis}-in" for axis in "xyz")]
    nominal = in_trim(name, {}, record)
    for at, key in enumerate(INERTIAS):
        wanted = nominal.copy()
        wanted[at] *= 1.3
        scale = np.array([*[nominal[1]] * 6, nominal[6], 1.0, 1.0, 1.0])
        assert np.abs(in_trim(name, {key: 1.3}, record) - wanted) / scale == pytest.approx(
            0, abs=1e-9
        )


def test_the_initial_angular_acceleration_is_inverse_to_the_inertia() -> None:
    rate = CHANNELS.index("pitch_rate_rad_per_s")
    fast, slow = (
        np.diff(flying("737", {"pitch_inertia": factor}, 6, (-0.05, 0.0, 0.0))[:, rate])[1]
        for factor in (1.0, 1.25)
    )
    assert slow / fast == pytest.approx(1.0 / 1.25, rel=0.02)


def test_an_impossible_inertia_is_refused() -> None:
    with pytest.raises(
        InputError, match=r"flight\.roll_inertia: .*not positive definite"
    ) as caught:
        in_trim("737", {"roll_inertia": 1e-4}, [])
    assert str(caught.value).endswith("choose a larger factor")


def test_drag_is_that_of_an_edited_model_and_takes_as_much_thrust(tmp_path: Path) -> None:
    def edit(aerodynamics: ET.Element) -> None:
        (axis,) = [a for a in aerodynamics.findall("axis") if a.get("name") == "DRAG"]
        for function in axis.findall("function"):
            product = function.find("product")
            assert product is not None
            ET.SubElement(product, "value").text = "1.2"

    record = ("forces/fwx-aero-lbs", "forces/fbx-prop-lbs")
    models = [edited_model(tmp_path, "737", edit)]
    edited = make_unchecked(FLIGHTS["737"], FRAME, CONTROLS, models, record=record)
    found, nominal = (in_trim("737", {"drag": drag}, record) for drag in (1.2, 1.0))
    assert found == pytest.approx(edited.extra(), rel=1e-9)
    assert abs(found[0]) == pytest.approx(1.2 * abs(nominal[0]), rel=0.01)
    assert found[1] / nominal[1] == pytest.approx(1.2, rel=0.01)


def test_drag_decelerates_by_the_added_drag_over_the_mass() -> None:
    """ΔD·cos α/m along the nose, in the step in which the factor changes."""
    record = ("accelerations/udot-ft_sec2", "forces/fwx-aero-lbs", "inertia/mass-slugs")
    flight = changed(FLIGHTS["737"], {"drag": 1.2}, "737", "flight")
    aircraft = make_aircraft(flight, FRAME, CONTROLS, record=(*record, "aero/alpha-rad"))
    aircraft.step((0.0, 0.0, 0.0))
    before, drag, mass, alpha = aircraft.extra()
    aircraft.lever("coupled/drag/factor").set(1.7)
    aircraft.step((0.0, 0.0, 0.0))
    slower = aircraft.extra()[0]
    assert slower - before == pytest.approx(-0.5 / 1.2 * abs(drag) * np.cos(alpha) / mass, rel=1e-3)


@pytest.mark.parametrize("name", ["c172p", "737", "awjsra"])
def test_thrust_scales_the_force_and_the_moment_of_the_engines(name: str) -> None:
    ways = [("forces/fb", way, "lbs") for way in "xyz"] + [("moments/", w, "lbsft") for w in "lmn"]
    own, more = (
        [f"{head}{way}-{what}-{unit}" for head, way, unit in ways] for what in ("prop", "external")
    )
    values = in_trim(name, {"thrust": 0.7}, [*own, *more])
    size = np.max(np.abs(values[:6]))
    assert np.abs(values[6:] + 0.3 * values[:6]) / size == pytest.approx(0.0, abs=1e-9)
    if name == "737":  # the trim makes up for it
        nominal = in_trim(name, {}, own)
        assert 0.7 * values[0] == pytest.approx(nominal[0], rel=1e-3)


def test_a_centre_of_gravity_further_aft_moves_the_trim_moment() -> None:
    """By N·Δx, N the aerodynamic force normal to the fuselage, nearly m·g."""
    flight, shift_m = FLIGHTS["t37"], 0.05
    record = ("moments/m-aero-lbsft", "forces/fbz-aero-lbs", "inertia/weight-lbs")
    aircraft = make_aircraft(flight, FRAME, CONTROLS, record=record)
    before, normal, weight = aircraft.extra()
    point = aircraft.lever("metrics/aero-rp-x-in")
    shifted = make_aircraft(changed(flight, {"cg_aft_m": shift_m}, "t37", "flight"), FRAME)
    moved_in = point.read() - shifted.lever("metrics/aero-rp-x-in").read()
    point.set(point.read() - moved_in)
    aircraft.step((0.0, 0.0, 0.0))
    after = aircraft.extra()[0]
    assert moved_in == pytest.approx(shift_m / 0.0254)
    assert after - before == pytest.approx(-normal * moved_in / 12.0, rel=0.02)
    assert -normal == pytest.approx(weight, rel=0.02)


def test_lateral_gusts_blow_across_the_heading() -> None:
    """v m/s of air from the left turn the sideslip by −v/V before the aircraft follows."""
    flight = changed(FLIGHTS["t37"], {"lateral_gust_rms_m_per_s": 4.0}, "t37", "flight")
    names = ("atmosphere/gust-north-fps", "atmosphere/gust-east-fps", "attitude/psi-rad")
    aircraft = make_aircraft(
        flight, FRAME, CONTROLS, gusts=Gusts(flight, FRAME, 3), record=(*names, "aero/beta-rad")
    )
    speed_m_per_s = aircraft.motion()[CHANNELS.index("true_airspeed_m_per_s")]
    drawn = dryden(4.0, 150.0, speed_m_per_s, FRAME, 3, 98)
    for k in range(240):
        heading = aircraft.extra()[2]
        aircraft.step((0.0, 0.02, 0.0))
        wanted, (north, east, _, sideslip) = next(drawn), aircraft.extra()
        assert 0.3048 * np.hypot(north, east) == pytest.approx(abs(wanted))
        assert 0.3048 * (east * np.cos(heading) - north * np.sin(heading)) == pytest.approx(wanted)
        if k == 5:
            assert sideslip == pytest.approx(-wanted / speed_m_per_s, rel=0.3)


@pytest.mark.parametrize(
    ("key", "trim", "control", "channel"),
    [
        ("elevator_effectiveness", "pitch", 0, "pitch_rate_rad_per_s"),
        ("aileron_effectiveness", "roll", 1, "roll_rate_rad_per_s"),
        ("rudder_effectiveness", "yaw", 2, "yaw_rate_rad_per_s"),
    ],
)
def test_a_moved_trim_acts_in_full(key: str, trim: str, control: int, channel: str) -> None:
    """A factor counts from the trim, so a trim moved in flight has the nominal effect."""
    found = []
    for changes in ({}, {key: 0.5}):
        flight = changed(FLIGHTS["t37"], changes, "t37", "flight")
        aircraft = make_aircraft(flight, FRAME, CONTROLS)
        lever = aircraft.lever(f"fcs/{trim}-trim-cmd-norm")
        lever.set(lever.read() + 0.05)
        for _ in range(60):
            aircraft.step((0.0, 0.0, 0.0))
        found.append(aircraft.motion()[CHANNELS.index(channel)])
    assert found[1] == pytest.approx(found[0], rel=1e-3), control
