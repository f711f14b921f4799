"""Factors on a model's aerodynamics: each against a copy of the model edited by hand."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft, make_unchecked
from coupled.flight.airframe import JSBSimAirframe, packaged_models
from coupled.flight.altered import ALTERATIONS
from coupled.flight.modelparts import Part, Term
from coupled.flight.modeltext import functions_of
from coupled.flight.wrapper import Wrapper
from coupled.record.channels import ALPHA, ELEVATOR, LONGITUDINAL, PITCH, PITCH_RATE
from coupled.resources import aircraft_folder, shipped_rigs
from coupled.rig.parameters import Flight
from coupled.rig.rigfile import read_rig
from coupled.schema import changed
from coupled.surveying.survey import chosen_model
from tests.support.models import edited_model, multiplied

FRAME = 1 / 120
FLOWN = [name for name in shipped_rigs() if name != "bench"]
MODELS = ["c172p", "t37", "737", "b747"]
Floats = NDArray[np.float64]


def shipped(name: str, **changes: Any) -> Flight:
    flight = read_rig(shipped_rigs()[name]).flight
    assert flight is not None
    return changed(flight, changes, name, "flight")


def motions(airframe: JSBSimAirframe, size: float = 0.04, frames: int = 240) -> Floats:
    """Return the motion under a doublet of the elevator, shape (frames, channels)."""
    found = []
    for k in range(frames):
        found.append(airframe.motion())
        airframe.step((size if k < 60 else -size if k < 120 else 0.0, 0.0, 0.0))
    return np.array(found)


class Neutral(Wrapper):
    """All parts scalable that a model has, and a term, and none scaled."""

    def __init__(self, model: str) -> None:
        self._model = model

    @property
    def scaled(self) -> tuple[Part, ...]:
        parts = [alteration.part for alteration in ALTERATIONS]
        term = next(iter(functions_of(chosen_model(self._model).path)))
        return (Term(term), *(p for p in parts if (self._model, p.name) != ("737", "adverse_yaw")))


@pytest.mark.parametrize("name", FLOWN)
def test_a_model_that_is_scalable_and_not_scaled_is_as_filed_to_the_bit(name: str) -> None:
    flight, folders = shipped(name), [aircraft_folder()]
    plain = JSBSimAirframe(flight, FRAME, models=folders)
    scalable = JSBSimAirframe(flight, FRAME, models=folders, wrappers=[Neutral(flight.model)])
    assert scalable.has("coupled/pitch_damping/factor")
    assert np.array_equal(motions(plain), motions(scalable))


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("factor", [0.0, 0.53, 2.0])
def test_pitch_damping_is_the_coefficient_of_the_pitch_rate(
    tmp_path: Path, name: str, factor: float
) -> None:
    flight = shipped(name)
    models = edited_model(tmp_path, flight.model, multiplied({"/Cmq": factor}))
    wanted = motions(make_unchecked(flight, FRAME, models=[models]))
    found = motions(make_aircraft(shipped(name, pitch_damping=factor), FRAME))
    nominal = motions(make_aircraft(flight, FRAME))
    scale = np.ptp(nominal, axis=0) + 1e-6
    assert np.max(np.abs(found - wanted) / scale) < 1e-9
    assert np.max(np.abs(nominal - wanted)[:, PITCH_RATE]) > 0.02 * scale[PITCH_RATE]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("factor", [0.7, 1.6])
def test_pitch_stiffness_is_the_coefficient_of_the_angle_of_attack(
    tmp_path: Path, name: str, factor: float
) -> None:
    """It trims with another elevator, and answers as the edited model does."""
    flight = shipped(name)
    models = edited_model(tmp_path, flight.model, multiplied({"/Cmalpha": factor}))
    wanted = motions(make_unchecked(flight, FRAME, models=[models]))
    found = motions(make_aircraft(shipped(name, pitch_stiffness=factor), FRAME))
    nominal = motions(make_aircraft(flight, FRAME))
    scale = np.ptp(nominal, axis=0) + 1e-6
    assert np.max(np.abs(found - wanted) / scale) < 1e-6
    assert abs(found[0, ELEVATOR] - nominal[0, ELEVATOR]) > 1e-3


@pytest.mark.parametrize(
    ("name", "function"),
    [("c172p", "/CLwbh"), ("t37", "/CLalpha"), ("737", "/CLalpha"), ("b747", "/CLalpha")],
)
def test_lift_slope_is_the_lift_beyond_that_at_no_angle_of_attack(
    tmp_path: Path, name: str, function: str
) -> None:
    factor, flight = 0.85, shipped(name)

    def edit(aerodynamics: ET.Element) -> None:
        """Bring each value of the table nearer to the one at no angle of attack."""
        (found,) = [
            f for f in aerodynamics.iter("function") if f.get("name", "").endswith(function)
        ]
        (data,) = list(found.iter("tableData"))
        lines = [[float(x) for x in line.split()] for line in (data.text or "").split("\n")]
        rows = [row for row in lines if row]
        body = [row for row in rows if len(row) == max(map(len, rows))]
        none = [np.interp(0.0, [r[0] for r in body], c) for c in np.array(body).T[1:]]
        for row in body:
            row[1:] = [float(n + factor * (x - n)) for x, n in zip(row[1:], none, strict=True)]
        data.text = "\n".join(" ".join(map(repr, row)) for row in rows)

    models = edited_model(tmp_path, flight.model, edit)
    wanted = motions(make_unchecked(flight, FRAME, models=[models]))
    found = motions(make_aircraft(shipped(name, lift_slope=factor), FRAME))
    nominal = motions(make_aircraft(flight, FRAME))
    scale = np.ptp(nominal, axis=0) + 1e-6
    assert np.max(np.abs(found - wanted) / scale) < 1e-3
    assert abs(found[0, ALPHA] - nominal[0, ALPHA]) > 2e-3


@pytest.mark.parametrize("name", FLOWN)
def test_a_mass_is_carried_by_the_lift_at_the_centre_of_gravity(name: str) -> None:
    """In level trim, upward force = weight; its moments of inertia are those of the model."""
    still = "inertia/iyy-slugs_ft2", "inertia/cg-x-in", "inertia/cg-z-in"
    forces = "forces/fbx-aero-lbs", "forces/fbz-aero-lbs", "forces/fbx-prop-lbs"
    record = ("inertia/weight-lbs", *still, *forces, "forces/fbz-prop-lbs")

    def carried(mass: float) -> Floats:
        flight = shipped(name, mass=mass)
        aircraft = make_aircraft(flight, FRAME, models=[aircraft_folder()], record=record)
        weight, *rest, ax, az, px, pz = aircraft.extra()
        pitch = aircraft.motion()[PITCH]
        up = (ax + px) * np.sin(pitch) - (az + pz) * np.cos(pitch)
        return np.array([weight, up, *rest])

    plain, heavy = carried(1.0), carried(1.1)
    assert heavy[0] == pytest.approx(1.1 * plain[0], rel=1e-9)
    assert heavy[1] == pytest.approx(heavy[0], rel=5e-3)  # of a round earth that turns
    assert heavy[2:] == pytest.approx(plain[2:], rel=1e-6)


def test_fuel_counts_in_the_mass() -> None:
    weight = ("inertia/weight-lbs",)
    dry = make_aircraft(shipped("c172p", fuel=0.5), FRAME, record=weight).extra()[0]
    light = make_aircraft(shipped("c172p", fuel=0.5, mass=0.9), FRAME, record=weight).extra()[0]
    assert light == pytest.approx(0.9 * dry, rel=1e-9)


def test_pitch_damping_reaches_functions_that_the_moment_refers_to(tmp_path: Path) -> None:
    """The Augmentor Wing's tail meets the pitch rate in functions that its lift shares."""
    factor = 0.4

    def edit(aerodynamics: ET.Element) -> None:
        """Write the tail's and the wing's damping down by hand, and leave the tail's lift."""
        named = {f.get("name"): f for f in aerodynamics.iter("function")}
        wing = named["aero/moment/pitch-wing-rate"].find("product")
        assert wing is not None
        ET.SubElement(wing, "value").text = repr(factor)
        axis = next(a for a in aerodynamics.findall("axis") if a.get("name") == "PITCH")
        lost = ET.SubElement(axis, "function", name="aero/moment/pitch-tail-rate-lost")
        product = ET.SubElement(lost, "product")
        # The tail's table is straight over the angles of this flight, its slope 1.
        for value in (-46.3 * 233.0 * 4.32, factor - 1.0):
            ET.SubElement(product, "value").text = repr(value)
        for name in ("aero/qbar-psf", "awjsra/tail-slope", "aero/tail-delay-s"):
            ET.SubElement(product, "property").text = name
        ET.SubElement(product, "property").text = "velocities/q-aero-rad_sec"

    models = edited_model(tmp_path, "awjsra", edit, aircraft_folder())
    wanted = motions(make_unchecked(shipped("awjsra"), FRAME, models=[models]))
    flight = shipped("awjsra", pitch_damping=factor)
    altered = make_aircraft(flight, FRAME, models=[aircraft_folder()])
    scale = np.ptp(wanted, axis=0) + 1e-6
    assert np.max(np.abs(motions(altered) - wanted) / scale) < 1e-6


@pytest.mark.parametrize("name", MODELS)
def test_an_elevator_does_more_or_less_about_its_trim(tmp_path: Path, name: str) -> None:
    """ΔX = e·(X(δ) − X(δ₀)): lift, drag and moment of a copy with e in each and δ₀ made up for."""
    factor, flight = 0.6, shipped(name)
    trim = make_aircraft(flight, FRAME).motion()[ELEVATOR]

    def edit(aerodynamics: ET.Element) -> None:
        """Put δ₀ + e·(δ − δ₀) in the place of δ."""
        seen = ET.Element("function", name="test/elevator-seen")
        total = ET.SubElement(seen, "sum")
        ET.SubElement(total, "value").text = repr((1.0 - factor) * trim)
        product = ET.SubElement(total, "product")
        ET.SubElement(product, "value").text = repr(factor)
        ET.SubElement(product, "property").text = "fcs/elevator-pos-rad"
        for axis in aerodynamics.findall("axis"):
            if axis.get("name") == "DRAG":  # of |δ|: scaled as it is, below
                continue
            for part in axis.iter("property"):
                if (part.text or "").strip() == "fcs/elevator-pos-rad":
                    part.text = "test/elevator-seen"
        aerodynamics.insert(0, seen)

    models = edited_model(tmp_path, flight.model, edit)
    wanted = motions(make_unchecked(flight, FRAME, models=[models]))
    found = motions(make_aircraft(shipped(name, elevator_effectiveness=factor), FRAME))
    nominal = motions(make_aircraft(flight, FRAME))
    scale = np.ptp(nominal, axis=0) + 1e-6
    quick = [
        i for i, n in enumerate(LONGITUDINAL) if "rate" in n or n in ("alpha_rad", "load_factor")
    ]
    assert np.max((np.abs(found - wanted) / scale)[:, quick]) < 5e-3
    assert np.array_equal(found[:, ELEVATOR], nominal[:, ELEVATOR])  # it stands where it is put
    ratio = np.ptp(found[:, PITCH_RATE]) / np.ptp(nominal[:, PITCH_RATE])
    assert ratio == pytest.approx(factor, rel=0.05)


def test_factors_act_together() -> None:
    both = make_aircraft(shipped("c172p", elevator_effectiveness=0.5, pitch_damping=3.0), FRAME)
    damped = make_aircraft(shipped("c172p", pitch_damping=3.0), FRAME)
    # Half the effect of a small command is that of half the command.
    found, wanted = motions(both, 0.02), motions(damped, 0.01)
    rates = found[:, PITCH_RATE], wanted[:, PITCH_RATE]
    assert np.max(np.abs(rates[0] - rates[1])) < 0.03 * np.ptp(rates[1])


def test_a_model_without_such_a_moment_is_refused_by_name(tmp_path: Path) -> None:
    def edit(aerodynamics: ET.Element) -> None:
        for axis in aerodynamics.findall("axis"):
            for function in axis.findall("function"):
                if function.get("name", "").endswith("/Cmq"):
                    axis.remove(function)

    models = edited_model(tmp_path, "c172p", edit)
    flight = shipped("c172p", pitch_damping=0.5)
    with pytest.raises(InputError) as caught:
        make_aircraft(flight, FRAME, models=[models], file="my.toml")
    assert str(caught.value).startswith(
        "my.toml: flight.pitch_damping: c172p has no pitching moment"
    )


def test_the_models_folder_is_left_alone_and_the_temporary_one_cleared(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folder = packaged_models()["737"] / "737"
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    make_aircraft(shipped("737", pitch_damping=0.5), FRAME)
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before
    assert list(tmp_path.iterdir()) == []


def test_a_missing_temporary_folder_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    make_aircraft(shipped("737"), FRAME)  # as filed it needs none
    with pytest.raises(InputError, match="cannot be written to a temporary folder"):
        make_aircraft(shipped("737", pitch_damping=0.5), FRAME)
