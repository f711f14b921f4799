"""Factors on the named functions of a model's aerodynamics, and their shares in a flight."""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import jsbsim
import numpy as np
import pytest
from numpy.typing import NDArray

import coupled
from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft, make_unchecked
from coupled.flight.airframe import JSBSimAirframe, packaged_models
from coupled.flight.altered import ALTERATIONS
from coupled.flight.loop import fly
from coupled.flight.modelfile import loadable
from coupled.flight.modelparts import NothingToScaleError, Part, Term
from coupled.flight.modeltext import functions_of
from coupled.flight.runfile import read_run
from coupled.resources import shipped_rigs
from coupled.rig.parameters import Flight
from coupled.schema import build
from coupled.surveying.survey import chosen_model, known_models
from tests.support.commands import coupled as command
from tests.support.models import edited_model, multiplied

FRAME = 1 / 120
CONTROLS = ("column", "wheel", "pedals")
C172P = {"model": "c172p", "altitude_m": 1500.0, "calibrated_airspeed_m_per_s": 46.3}
CLP = "aero/coefficient/Clp"


def flight(terms: dict[str, float], **changes: object) -> Flight:
    return build(Flight, {**C172P, "terms": terms, **changes}, "c172p.toml", "flight")


def flown(aircraft: JSBSimAirframe) -> NDArray[np.float64]:
    motions = []
    for k in range(240):
        motions.append(aircraft.motion())
        aircraft.step((-0.05, 0.1, 0.05) if k < 60 else (0.0, -0.1, 0.0))
    return np.array(motions)


def test_a_scaled_term_is_that_of_a_model_edited_by_hand(tmp_path: Path) -> None:
    folder = packaged_models()["c172p"] / "c172p"
    before = {path: path.stat().st_mtime_ns for path in folder.rglob("*")}
    models = edited_model(tmp_path, "c172p", multiplied({"/Clp": 0.702}))
    wanted = flown(make_unchecked(flight({}), FRAME, CONTROLS, [models]))
    found = flown(make_aircraft(flight({CLP: 0.702}), FRAME, CONTROLS))
    nominal = flown(make_aircraft(flight({}), FRAME, CONTROLS))
    assert found == pytest.approx(wanted, rel=1e-12, abs=1e-12)
    assert np.max(np.abs(nominal - wanted)) > 1e-3
    neutral = flown(make_aircraft(flight({CLP: 1.0}), FRAME, CONTROLS))
    assert neutral.tobytes() == nominal.tobytes()
    assert {path: path.stat().st_mtime_ns for path in folder.rglob("*")} == before


def test_a_term_may_be_one_to_which_others_refer() -> None:
    """Twice the ground effect on lift: the trim keeps the wing's lift, at half the coefficient."""
    wing = ("aero/coefficient/CLwbh", "aero/function/kCLge")
    doubled = make_aircraft(flight({wing[1]: 2.0}), FRAME, record=wing).extra()
    plain = make_aircraft(flight({}), FRAME, record=wing).extra()
    assert doubled[1] == pytest.approx(2.0 * plain[1])
    assert doubled[0] == pytest.approx(plain[0], rel=0.1)


def test_a_wrong_term_is_refused_with_the_nearest_name(tmp_path: Path) -> None:
    with pytest.raises(InputError) as caught:
        make_aircraft(flight({"aero/coefficient/ClP_": 0.7}), FRAME, file="my.toml")
    assert str(caught.value) == (
        "my.toml: flight.terms.aero/coefficient/ClP_: c172p has no aerodynamic function"
        " 'aero/coefficient/ClP_'; did you mean aero/coefficient/Clp?"
    )
    with pytest.raises(InputError, match="did you mean"):
        make_aircraft(flight({"aero/coefficient/ClP_": 1.0}), FRAME)
    with pytest.raises(InputError, match=r"vary\[0\]: rig\.flight\.terms\.Clx = 0\.7: T37 has no"):
        coupled.sweep(
            {
                "name": "wrong",
                "run": "pull-up-t37",
                "vary": [{"key": "rig.flight.terms.Clx", "values": [0.7, 1.0]}],
            }
        )
    with pytest.raises(InputError, match=r"flight\.terms\.a: .*less than or equal to 10"):
        flight({"a": 11.0})

    def unnamed(aerodynamics: ElementTree.Element) -> None:
        for element in list(aerodynamics):
            if element.tag == "axis":
                element[:] = []
            elif element.tag == "function":
                aerodynamics.remove(element)

    edited_model(tmp_path, "c172p", unnamed)
    own = flight({CLP: 0.7}, model_folder=str(tmp_path))
    with pytest.raises(InputError, match="c172p has no named aerodynamic functions; leave it out"):
        make_unchecked(own, FRAME)
    with pytest.raises(InputError, match="has no named aerodynamic functions"):
        coupled.terms(tmp_path / "c172p")


def test_the_terms_are_listed_with_axis_and_share(tmp_path: Path) -> None:
    found = coupled.terms("c172p")
    by_axis: dict[str, float] = {}
    for one in found:
        if one.share is not None:
            by_axis[one.axis] = by_axis.get(one.axis, 0.0) + one.share
    assert list(by_axis) == ["DRAG", "SIDE", "LIFT", "ROLL", "PITCH", "YAW"]
    assert list(by_axis.values()) == pytest.approx([1.0] * 6)
    known = {one.term: one for one in found}
    assert known[CLP].axis == "ROLL"
    assert known["aero/coefficient/CDDf"].share == 0.0  # flaps up
    assert (known["aero/function/kCLge"].axis, known["aero/function/kCLge"].share) == ("", None)
    done = command(tmp_path, "terms", "c172p", "--json", "t.json")
    assert json.loads((tmp_path / "t.json").read_text()) == json.loads(json.dumps(found.as_dict()))
    assert len(done.stdout.splitlines()) == len(found) + 2
    frame = found.to_polars()
    assert frame.columns == ["term", "axis", "share"]


def test_the_shares_are_those_of_a_given_run(tmp_path: Path) -> None:
    """RMS of a term over the sum of the RMS in its axis, by the record of the run."""
    run = str(tmp_path / "pull.toml")
    Path(run).write_text(
        'name = "pull"\ncard = "a pull"\nrig = "t37"\nduration_s = 1\n'
        '[pilot.column]\nkind = "step"\nforce_N = 20\n'
    )
    found = {one.term: one for one in coupled.terms("T37", run=run)}
    pitch = [term for term, one in found.items() if one.axis == "PITCH"]
    record = fly(replace(read_run(run)[0], record_properties=tuple(pitch)))
    sizes = {term: float(np.sqrt(np.mean(record[term] ** 2))) for term in pitch}
    for term in pitch:
        assert found[term].share == pytest.approx(sizes[term] / sum(sizes.values()))


def test_the_terms_of_a_variant_are_those_of_its_file(tmp_path: Path) -> None:
    edited_model(tmp_path, "c172p", multiplied({"/Clp": 0.702}))
    variant = tmp_path / "c172p" / "late.xml"
    (tmp_path / "c172p" / "c172p.xml").rename(variant)
    own = 'model = "c172p"\nmodel_folder = "."\nmodel_file = "late"\n'
    text = shipped_rigs()["c172p"].read_text("utf-8").replace('model = "c172p"\n', own)
    (tmp_path / "late.toml").write_text(text)
    (tmp_path / "pull.toml").write_text(
        'name = "pull"\ncard = "a pull"\nrig = "late.toml"\nduration_s = 0.2\n'
        '[pilot.column]\nkind = "step"\nforce_N = 2\n'
    )
    found = coupled.terms(variant, run=tmp_path / "pull.toml")
    assert found.model == "c172p/late"
    assert CLP in {one.term for one in found}
    with pytest.raises(InputError, match="rig: flies c172p/late; give a run of c172p"):
        coupled.terms("c172p", run=tmp_path / "pull.toml")
    with pytest.raises(InputError, match="rig: flies T37; give a run of c172p/late"):
        coupled.terms(variant, run="pull-up-t37")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("c172q",),
            "c172q: is no JSBSim model and no folder of one (NAME/NAME.xml); did you mean",
        ),
        (("c172p", "--run", "pull-up-t37"), "pull-up-t37: rig: flies T37; give a run of c172p"),
        (("c172p", "--run", "appendix-c"), "appendix-c: rig: has no aircraft; give a run of c172p"),
    ],
)
def test_wrong_requests_are_refused(tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    done = command(tmp_path, "terms", *words)
    assert done.returncode == 2
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("model", sorted(set(known_models()) - {"blank"}))
def test_every_model_loads_with_all_its_parts_and_terms_scalable(model: str) -> None:
    """A term that JSBSim shows no property of has no share; ballx alone has one."""
    main, parts = chosen_model(model).path, list[Part]()
    functions = functions_of(main)
    for part in (*map(Term, functions), *(alteration.part for alteration in ALTERATIONS)):
        with suppress(NothingToScaleError), loadable(main, [part]):
            parts.append(part)
    assert len(parts) > len(functions)
    fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    fdm.set_dt(FRAME)
    with loadable(main, parts, 8) as folder:
        fdm.set_aircraft_path(str(folder))
        assert fdm.load_model(model)
    known = {line.rpartition(" (")[0] for line in fdm.query_property_catalog("").split("\n")}
    assert {name for part in parts for name in part.settings(1.0)} <= known
    assert set(functions) - known <= {"aero/dummy1"}
