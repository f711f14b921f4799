"""The exported aircraft has the rig's load and factors itself, not by its scripts only."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.exporting.alone import fly_alone
from coupled.exporting.comparison import compare
from coupled.exporting.write import DEFLECTION, FORCE, LOSS, Export, Flown, export, put
from coupled.flight.airframe import packaged_models
from coupled.flight.altered import ALTERATIONS
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Step
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.commands import coupled
from tests.support.exported import both

AFT_m, FUEL, DAMPING = 0.06, 0.5, 1.4
LOADED = {
    "flight.cg_aft_m": AFT_m,
    "flight.fuel": FUEL,
    "flight.pitch_damping": DAMPING,
}
INCH_m = 0.0254


def shipped(name: str, changes: dict[str, Any] | None = None) -> Rig:
    return read_rig(shipped_rigs()[name]).changed(changes or {})


def pull(rig: Rig) -> Manoeuvre:
    return Manoeuvre(rig, {"column": Step(force_N=20.0, start_s=0.5)}, 2.0)


def packaged(model: str) -> ElementTree.Element:
    path = packaged_models()[model] / model / f"{model}.xml"
    return ElementTree.parse(path).getroot()


def numbers(folder: Path, made: Export, names: list[str]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return properties of the exported aircraft once JSBSim alone has started it, as filed."""
    put(made.files, folder)
    model = next(iter(folder.glob("aircraft/*"))).name
    script = f"""<?xml version="1.0"?>
    <runscript name="s"><use aircraft="{model}" initialize="i"/><run start="0" end="0.1" dt="0.01">
    </run></runscript>"""
    start = """<?xml version="1.0"?>
    <initialize name="i"><altitude unit="FT">9000</altitude><vc unit="KTS">150</vc></initialize>"""
    (folder / "aircraft" / model / "i.xml").write_text(start)
    (folder / "scripts").mkdir(exist_ok=True)
    (folder / "scripts/s.xml").write_text(script)
    table, _ = fly_alone(folder, "scripts/s.xml", names)
    return np.asarray(table[0])


@pytest.mark.slow
@pytest.mark.parametrize(("rig", "model"), [("t37", "T37"), ("c172p", "c172p")])
def test_an_aircraft_started_by_jsbsim_alone_has_the_rigs_load(
    tmp_path: Path, rig: str, model: str
) -> None:
    """The reference point 6 cm further forward, half of the fuel in every tank, C_mq by 1.4."""
    root = packaged(model)
    point = root.find("metrics/location[@name='AERORP']")
    assert point is not None
    assert point.get("unit") == "IN"
    contents = [float(tank.text or 0.0) for tank in root.findall("propulsion/tank/contents")]
    assert sum(contents) > 0.0
    names = ["metrics/aero-rp-x-in", "coupled/pitch_damping/factor", "coupled/pitch_damping/rest"]
    names += [f"propulsion/tank[{i}]/contents-lbs" for i in range(len(contents))]
    found = numbers(tmp_path, export(shipped(rig, LOADED)), names)
    aft_in = float(point.findtext("x") or 0.0) - AFT_m / INCH_m
    assert found[:3] == pytest.approx([aft_in, DAMPING, 1.0 - DAMPING], rel=1e-6)
    assert found[3:] == pytest.approx([FUEL * each for each in contents], rel=1e-3)  # it runs


def test_a_loaded_aircraft_flies_as_in_our_own_flight_and_its_script_sets_no_load() -> None:
    case = pull(shipped("t37", LOADED))
    made = export(case.rig, [Flown(case, ("compensated",))], check=False)
    (script,) = (text for place, text in made.files.items() if place.parts[0] == "scripts")
    assert b"aero-rp" not in script
    assert b"contents-lbs" not in script
    assert b"pitch_damping" not in script
    ours, alone, said = both(case)
    found = compare(case.configured("compensated"), "compensated", ours, alone)
    assert said == ""
    assert found.deflection <= DEFLECTION
    assert max(found.force, found.modifying_force) <= FORCE
    assert abs(found.loss or 0.0) <= LOSS
    # The trim is the loaded aircraft's: by another load the elevator is elsewhere.
    plain, _, _ = both(pull(shipped("t37")))
    first = [record["elevator_rad"][1] for record in (ours, alone, plain)]
    assert first[1] == pytest.approx(first[0], abs=1e-4)
    assert abs(first[2] - first[0]) > 1e-3


@pytest.mark.slow
def test_a_case_of_another_load_gets_it_by_its_script() -> None:
    """Exported loaded, and flown by a run whose case has the load of the model."""
    loaded = shipped("t37", {"flight.cg_aft_m": AFT_m, "flight.fuel": FUEL})
    case = pull(shipped("t37"))
    made = export(loaded, [Flown(case, ("compensated",))], check=True)
    (found,) = made.beside
    assert found.deflection <= DEFLECTION
    assert found.load_factor is not None
    assert found.load_factor < 1e-3
    same = export(loaded, [Flown(replace(case, rig=loaded), ("compensated",))], check=False)
    scripts = [
        text
        for each in (made, same)
        for place, text in each.files.items()
        if "scripts" in place.parts
    ]
    for name in (b"aero-rp", b"contents-lbs"):
        assert [name in text for text in scripts] == [True, False]


def test_every_exported_factor_flies_as_in_our_own_flight() -> None:
    """Those from zero are in the model, those about the trim in the script; a term as well."""
    factors = {a.part.name: 0.8 if a.part.neutral else 0.01 for a in ALTERATIONS}
    changes: dict[str, Any] = {f"flight.{name}": factor for name, factor in factors.items()}
    changes["flight.terms"] = {"aero/coefficient/Clr": 0.5}
    rig = shipped("t37", changes)
    step = Step(force_N=10.0, start_s=0.5)
    case = Manoeuvre(rig, {"column": step, "wheel": step, "pedals": step}, 2.0)
    made = export(rig, [Flown(case, ("compensated",))], check=False)
    main = made.files[PurePosixPath("aircraft/T37/T37.xml")]
    for stated in (
        '"0.5">coupled/terms/aero/coefficient/Clr/factor<',
        f'"{0.8 - 1.0!r}">coupled/thrust/more<',
        '"0.8">coupled/drag/factor<',
    ):
        assert f"<property value={stated}".encode() in main, stated
    assert [line.partition(" = ")[0] for line in made.scripted if "effectiveness" in line] == [
        f"flight.{surface}_effectiveness" for surface in ("elevator", "aileron", "rudder")
    ]
    ours, alone, said = both(case)
    assert said == ""
    plain, _, _ = both(replace(case, rig=shipped("t37")))
    for name in ("roll_rate_rad_per_s", "yaw_rate_rad_per_s", "pitch_rate_rad_per_s"):
        size = np.ptp(ours[name])
        assert np.max(np.abs(alone[name] - ours[name])) < 0.02 * size, name
        assert np.max(np.abs(plain[name] - ours[name])) > 0.05 * size, name


@pytest.mark.parametrize("key", ["roll_inertia", "lateral_gust_rms_m_per_s"])
def test_what_a_file_cannot_have_is_refused(key: str) -> None:
    with pytest.raises(InputError, match=rf"flight\.{key}: .* not exported.*; leave it at "):
        export(shipped("t37", {f"flight.{key}": 1.1}))


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """Return a folder of models with a copy of the T-37."""
    shutil.copytree(packaged_models()["T37"] / "T37", tmp_path / "T37")
    return tmp_path


def changed(own: Path, old: str, new: str) -> None:
    path = own / "T37/T37.xml"
    text = path.read_text()
    assert len(re.findall(old, text, re.DOTALL)) == 1
    path.write_text(re.sub(old, new, text, flags=re.DOTALL))


def loaded_by(own: Path, **keys: float) -> Export:
    given = {f"flight.{key}": value for key, value in keys.items()}
    return export(shipped("t37", {"flight.model_folder": str(own), **given}), file="mine.toml")


@pytest.mark.slow
def test_only_the_numbers_of_a_model_are_changed(own: Path) -> None:
    """Comments and layout stay; a section in a file of its own is changed there."""
    path = own / "T37/T37.xml"
    section = re.search(r"<propulsion>.*?</propulsion>", path.read_text(), re.DOTALL)
    assert section is not None
    commented = section[0].replace("<contents", "<!-- of 1960 --><contents")
    (own / "T37/Propulsion.xml").write_text(commented)
    changed(own, "<propulsion>.*?</propulsion>", '<propulsion file="Propulsion"/>')
    found = loaded_by(own, fuel=FUEL).files[PurePosixPath("aircraft/T37/Propulsion.xml")]
    contents = re.compile(r"(?<=<contents unit=\"LBS\">)\s*([\d.]+)\s*(?=<)")
    assert contents.search(commented) is not None
    wanted = contents.sub(lambda number: repr(FUEL * float(number[1])), commented)
    assert found.decode() == wanted


@pytest.mark.slow
def test_a_location_in_metres_is_moved_in_metres(own: Path, tmp_path: Path) -> None:
    changed(own, 'name="AERORP" unit="IN"', 'name="AERORP" unit="M"')
    made = loaded_by(own, cg_aft_m=AFT_m)
    (found,) = numbers(tmp_path / "out", made, ["metrics/aero-rp-x-in"])
    assert found == pytest.approx(-AFT_m / INCH_m, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "keys", "says"),
    [
        (
            '<location name="AERORP".*?</location>',
            "",
            {"cg_aft_m": AFT_m},
            r"mine\.toml: flight\.cg_aft_m: T37 has no location AERORP",
        ),
        (
            '(<location name="AERORP".*?</location>)',
            r"\1 \1",
            {"cg_aft_m": AFT_m},
            r"flight\.cg_aft_m: T37 as exported has metrics/aero-rp-x-in = 0, not -2\.36",
        ),
        ("</fdm_config>", "</fdm_config>", {"fuel": 50.0}, r"flight\.fuel: .* tanks of T37 hold"),
    ],
    ids=["no point", "two points", "too much fuel"],
)
def test_a_load_that_the_model_does_not_take_is_refused(
    own: Path, old: str, new: str, keys: dict[str, float], says: str
) -> None:
    changed(own, old, new)
    with pytest.raises(InputError, match=says):
        loaded_by(own, **keys)


@pytest.mark.slow
def test_what_only_the_scripts_set_is_said(tmp_path: Path) -> None:
    rig = shipped_rigs()["t37"].read_text(encoding="utf-8")
    assert "[flight]\n" in rig
    (tmp_path / "rig.toml").write_text(
        rig.replace("[flight]\n", f"[flight]\nelevator_effectiveness = 0.8\ncg_aft_m = {AFT_m}\n")
    )
    done = coupled(tmp_path, "export", "./rig.toml", "--jsbsim", "out")
    assert done.returncode == 0, done.stderr
    readme = (tmp_path / "out/README.md").read_text(encoding="utf-8")
    for said in (done.stderr, readme.partition("## Set by the scripts only")[2]):
        assert "flight.elevator_effectiveness = 0.8" in said
        assert "flight.properties: gear/gear-cmd-norm = 0" in said
        assert "cg_aft" not in said
    assert "a centre of gravity 0.06 m further aft" in readme
