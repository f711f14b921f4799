"""User models with damaged XML: each flies or is refused in one line; no process crashes."""

from __future__ import annotations

import random
import shutil
from pathlib import Path

import pytest

import coupled
from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import packaged_models
from coupled.rig.parameters import Flight
from coupled.schema import changed
from tests.support.wrong import damaged_xml, unexpected

MODEL = "T37"
FRAME_s = 1 / 120
MALFORMED = b"<function><property>no/such[</property></function>"
# JSBSim 1.3.1 ends the process on the last two; the first is its own line.
FATAL = {
    "a malformed property": (b"</axis>", MALFORMED + b"</axis>"),
    "a huge index": (b"aero/qbar-psf", b"a[99999999]"),
    "words in place of a number": (b"<pitch>", b"<pitch> abc"),
}


def own_model(folder: Path, text: bytes) -> Path:
    """Put a model with another text into a folder of models, and return that folder."""
    shutil.copytree(packaged_models()[MODEL] / MODEL, folder / MODEL, dirs_exist_ok=True)
    (folder / MODEL / f"{MODEL}.xml").write_bytes(text)
    return folder


def as_packaged() -> bytes:
    return (packaged_models()[MODEL] / MODEL / f"{MODEL}.xml").read_bytes()


def fly(folder: Path, **factors: float) -> str:
    """Fly an own model for some frames; return how a fault would look that is no line."""
    filed = Flight(model=MODEL, folder=str(folder), altitude=1500.0, calibrated_airspeed=103.0)
    flight = changed(filed, factors, "rig.toml")
    try:
        made = make_aircraft(flight, FRAME_s, ("column",), (), "rig.toml")
        for _ in range(3):
            made.step((0.0, 0.0, 0.0))
    except Exception as error:
        return unexpected(error)
    return ""


def wrong(folder: Path, count: int, seed: int) -> list[str]:
    """Return what damaged models end in that is no line; every other has a factor on it."""
    rng, found = random.Random(seed), []
    for number in range(count):
        place = own_model(folder / str(number), damaged_xml(as_packaged(), rng))
        factors = {"pitch_damping": 1.2, "mass": 1.1} if number % 2 else {}
        if said := fly(place, **factors):
            found.append(f"{number}: {said}")
        shutil.rmtree(place)
    return found


@pytest.mark.parametrize("fault", FATAL)
def test_a_model_that_ends_jsbsim_is_one_line(tmp_path: Path, fault: str) -> None:
    there, instead = FATAL[fault]
    assert there in as_packaged()
    folder = own_model(tmp_path, as_packaged().replace(there, instead))
    flight = Flight(model=MODEL, folder=str(folder), altitude=1500.0, calibrated_airspeed=103.0)
    with pytest.raises(coupled.InputError) as caught:
        make_aircraft(flight, FRAME_s, ("column",), (), "rig.toml")
    assert str(caught.value).startswith("rig.toml: flight.model: T37 ")
    assert not unexpected(caught.value)


def test_a_model_as_packaged_flies_from_a_folder_of_its_own(tmp_path: Path) -> None:
    folder = own_model(tmp_path, as_packaged())
    flight = Flight(model=MODEL, folder=str(folder), altitude=1500.0, calibrated_airspeed=103.0)
    assert make_aircraft(flight, FRAME_s, ("column",), (), "rig.toml").trouble() == ""


@pytest.mark.parametrize("encoding", [b"no-such", pytest.param(b"utf-16", marks=pytest.mark.slow)])
def test_an_encoding_that_python_does_not_read_is_one_line(tmp_path: Path, encoding: bytes) -> None:
    body = as_packaged()[as_packaged().index(b"<fdm_config") :]
    folder = own_model(tmp_path, b'<?xml version="1.0" encoding="%s"?>' % encoding + body)
    assert fly(folder, pitch_damping=1.2) == ""


def test_a_few_damaged_models_end_in_a_line(tmp_path: Path) -> None:
    assert wrong(tmp_path, 3, seed=1) == []


@pytest.mark.slow
def test_many_damaged_models_end_in_a_line(tmp_path: Path) -> None:
    assert wrong(tmp_path, 80, seed=2) == []
