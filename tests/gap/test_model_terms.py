"""Faults of an aircraft's roll and yaw, as effects of the library and as functions of its model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.flight.airframe import main_file
from coupled.flight.altered import parts_of
from coupled.gap.chain import Part
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.airframe import AIRFRAME, term
from coupled.gap.effects.effect import Effect, apply, value_of
from coupled.gap.effects.library import BY_NAME, EFFECTS
from coupled.gap.findings.flown import fly_force
from coupled.gap.findings.proposal import ProposedTest, in_one_line, next_tests
from coupled.gap.prepare import prepare, readers_of
from coupled.gap.search.beam import search_sets
from coupled.gap.search.case import Case
from coupled.gap.search.found import Candidate, Choice, Fit, Found
from coupled.gap.signals.output import Output
from coupled.gap.stages.tried import tried_effects, untried_terms, with_terms
from coupled.gap.thresholds import RIVAL_GAIN
from coupled.record.channels import LATERAL
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.schema import changed
from tests.support.airframes import flown, motion_of, noisy, pulses
from tests.support.commands import coupled as command
from tests.support.gaps import know_only
from tests.support.models import edited_model
from tests.support.rigs import bench

CLP = "aero/coefficient/Clp"
SIZES = {"center_of_gravity": 0.08, "mass": 1.1, "lift_slope": 0.9}
SIZES |= {"pitching_moment": 0.01, "lift_offset": 0.05}
SIZES |= {"yawing_moment": 0.002, "side_force": 0.02}


@pytest.fixture(scope="module")
def cessna() -> Rig:
    return read_rig(shipped_rigs()["c172p"])


@pytest.fixture(scope="module")
def worn(cessna: Rig, tmp_path_factory: pytest.TempPathFactory) -> Record:
    """A record of 14 s of a c172p whose C_lp is 0.702 of the model's, by its XML."""
    return flown(tmp_path_factory.mktemp("models"), cessna, CLP, 0.702, 14.0)


def searched(rig: Rig, record: Record, library: Sequence[Effect]) -> Choice:
    """Return the set of some effects that explains a record's surfaces and motion."""
    case = prepare(rig, {"r": motion_of(record)}, Part("column")).case
    return search_sets(replace(case, outputs_with_noise_of=None), library)[1]


@pytest.mark.slow
def test_an_unexplained_airframe_says_that_sets_of_its_functions_were_not_tried(
    cessna: Rig, worn: Record, monkeypatch: pytest.MonkeyPatch
) -> None:
    know_only(monkeypatch, [BY_NAME["drag"]])
    alone = cessna.changed({"controls": {}, "noise": {}, "flight.terms.aero/coefficient/Cmq": 0.5})
    found = diagnose(alone, {"r": motion_of(worn)})
    assert found.verdict == "unexplained"
    assert "several of the model's own functions at once (--terms)" in found.summary
    assert untried_terms([term(CLP, "ROLL")], alone) == ""
    assert untried_terms(EFFECTS, bench()) == ""


def without(record: Record, name: str) -> Record:
    at = [i for i, channel in enumerate(record.channels) if channel != name]
    return Record(tuple(record.channels[i] for i in at), record.data[:, at], record.manifest)


@pytest.mark.slow
def test_a_wrong_roll_damping_is_named_among_its_rivals(cessna: Rig, worn: Record) -> None:
    names = ("roll_damping", "dihedral_effect", "roll_inertia", "aileron_effectiveness")
    found = searched(cessna, worn, [BY_NAME[name] for name in names])
    (step,) = found.steps
    assert step.effect.name == "roll_damping" and not step.rivals
    low, high = (ends["roll_damping.factor"] for ends in (found.fit.low, found.fit.high))
    assert low < 0.702 < high
    assert found.fit.values["roll_damping.factor"] == pytest.approx(0.702, abs=0.01)


def test_the_functions_with_a_hundredth_of_their_axis_replace_the_factors(
    cessna: Rig, worn: Record
) -> None:
    found = with_terms(EFFECTS, cessna, {"r": motion_of(worn)})
    terms = {effect.of for effect in found if effect.of}
    assert {CLP, "aero/coefficient/Clb", "aero/coefficient/Cnr", "aero/coefficient/CDo"} <= terms
    assert not terms & {"aero/coefficient/CDDf", "aero/coefficient/CLadot", "aero/function/kCLge"}
    names = {effect.name for effect in found}
    assert names >= {"thrust", "mass", "roll_inertia", "center_of_gravity", "backlash"}
    assert not names & {"roll_damping", "drag", "elevator_effectiveness", "lift_slope"}


def test_a_wrong_function_is_named_with_its_property(cessna: Rig, worn: Record) -> None:
    rivals = [term(f"aero/coefficient/{name}", "ROLL") for name in ("Clp", "Clb", "ClDa", "Clr")]
    found = searched(cessna, worn, rivals)
    (step,) = found.steps
    assert (step.effect.of, step.rivals) == (CLP, ())
    assert found.fit.rig.flight is not None
    assert found.fit.rig.flight.terms == {CLP: pytest.approx(0.702, abs=0.01)}


@pytest.mark.parametrize("name", [CLP, "mass"])
def test_within_the_noise_only_a_function_of_the_model_is_named(name: str) -> None:
    """It is tried there since a user asks for it; another effect is not."""
    shape, noise = np.random.default_rng(9).normal(size=(2, 3000))

    def predict(rig: Rig) -> NDArray[np.float64]:
        assert rig.flight is not None
        size = rig.flight.mass if name == "mass" else rig.flight.terms.get(CLP, 1.0)
        return np.asarray(2.0 * (size - 1.0) * shape)

    measured = 0.5 * shape + noise
    output = Output("airframe", "roll_rate_rad_per_s", measured, predict, 1.0, 120.0)
    case = Case(read_rig(shipped_rigs()["c172p"]), "wheel", [output])
    found = search_sets(case, [term(CLP, "ROLL"), BY_NAME["mass"]])[1]
    assert [step.effect.of for step in found.steps] == ([CLP] if name == CLP else [])


def test_functions_that_act_alike_are_a_group_with_names_as_in_the_model() -> None:
    """Two functions of a moment, whose signatures differ by less than the noise."""
    first, second, noise = np.random.default_rng(8).normal(size=(3, 3000))
    names = ("aero/moment/Roll_damp", "aero/moment/Roll_yaw")

    def predict(rig: Rig) -> NDArray[np.float64]:
        assert rig.flight is not None
        one, other = (rig.flight.terms.get(name, 1.0) - 1.0 for name in names)
        return np.asarray(40.0 * (one * first + other * (first + 0.001 * second)))

    rate = "roll_rate_rad_per_s"
    output = Output("airframe", rate, -12.0 * first + noise, predict, 1.0, 120.0)
    case = Case(read_rig(shipped_rigs()["c172p"]), "wheel", [output])
    found = search_sets(case, [term(name, "ROLL") for name in names])[1]
    (step,) = found.steps
    assert {step.effect.of, *(rival.effect.of for rival in step.rivals)} == {*names}
    pair = (step.effect.name, step.rivals[0].effect.name)
    said = in_one_line([ProposedTest("steps that are held of ±8 N on the wheel", pair, 50.0)], ())
    assert "aero/moment/Roll_damp" in said and "aero/moment/Roll_yaw" in said


@pytest.mark.slow
def test_the_manoeuvre_that_separates_two_functions_moves_the_control_that_does(
    cessna: Rig,
) -> None:
    record = fly_force(noisy(cessna), {"wheel": pulses(cessna, 14.0)["wheel"]}, seed=3)
    terms = [term(f"aero/coefficient/{name}", "ROLL") for name in ("Clp", "Clb")]
    known = [
        (values := {one.value_key(one.free[0]): 0.7}, apply(cessna, "column", [one], values))
        for one in terms
    ]
    fits = [
        Fit((one,), values, values, values, (), rig)
        for one, (values, rig) in zip(terms, known, strict=True)
    ]
    step = Found(terms[0], 9.0, 0.5, (Candidate(9.0, terms[1], fits[1]),))
    choice = Choice((step,), fits[0], fits[0], {}, ())
    best, *_ = next_tests(cessna, record, "column", choice)
    assert "on the wheel" in best.text
    assert best.gain > 2.0 * RIVAL_GAIN
    assert best.rivals == (terms[0].name, terms[1].name)


def test_a_term_of_a_rig_file_is_scaled_further(cessna: Rig) -> None:
    rig = cessna.changed({f"flight.terms.{CLP}": 0.5})
    effect = term(CLP, "ROLL")
    twice = apply(rig, "wheel", [effect], {effect.value_key(effect.free[0]): 2.0})
    assert value_of(twice, "wheel", f"flight.terms.{CLP}") == 1.0
    assert value_of(cessna, "wheel", f"flight.terms.{CLP}") == 1.0
    assert effect.free[0].unit(rig, "wheel") == ""


def test_an_effect_of_a_part_that_the_model_lacks_is_not_tried(
    cessna: Rig, worn: Record, tmp_path: Path
) -> None:
    def unyawed(aerodynamics: ElementTree.Element) -> None:
        for axis in aerodynamics.findall("axis"):
            for function in axis.findall("function"):
                if function.get("name") == "aero/coefficient/Cnda":
                    axis.remove(function)

    edited_model(tmp_path, "c172p", unyawed)
    assert cessna.flight is not None
    flight = changed(cessna.flight, {"model_folder": str(tmp_path)}, "r", "flight")
    parts = parts_of(main_file(flight))
    assert "adverse_yaw" not in parts and "yaw_damping" in parts
    own, motion = cessna.changed({"flight": flight}), motion_of(worn)
    rate = motion["yaw_rate_rad_per_s"]
    output = Output("airframe", "yaw_rate_rad_per_s", rate, lambda _: rate, 1.0, 120.0)

    def tried(rig: Rig) -> set[str]:
        readers = readers_of({"r": rig}, {"r": motion}, "column")
        return {effect.name for effect in tried_effects(EFFECTS, readers, [output])}

    assert tried(cessna) - tried(own) == {"adverse_yaw"}


def test_effects_of_lateral_motion_are_tried_where_it_moves(cessna: Rig, worn: Record) -> None:
    motion = motion_of(worn)
    data = motion.data.copy()
    at = [motion.channels.index(name) for name in LATERAL]
    data[:, at] = np.random.default_rng(3).normal(0.0, 3e-4, (len(data), len(at)))
    still = Record(motion.channels, data)
    output = Output("airframe", "x", data[:, 0], lambda _: data[:, 0], 1.0, 120.0)
    every = [*EFFECTS, term(CLP, "ROLL"), term("aero/coefficient/Cmq", "PITCH")]

    def tried(record: Record) -> set[str]:
        readers = readers_of({"r": cessna}, {"r": record}, "column")
        return {effect.name for effect in tried_effects(every, readers, [output])}

    lateral = {effect.name for effect in AIRFRAME if effect.needs} - {"vertical_gust"}
    assert len(lateral) == 13
    assert tried(motion) - tried(still) == {*lateral, f"term {CLP}"}


def test_terms_that_cannot_be_tried_are_refused(cessna: Rig, worn: Record, tmp_path: Path) -> None:
    motion = motion_of(worn)

    def refused(rig: Rig, record: Record) -> str:
        with pytest.raises(InputError) as caught:
            with_terms(EFFECTS, rig, {"a.csv": record})
        return str(caught.value)

    with pytest.raises(InputError, match="--terms: the rig has no aircraft; leave it out"):
        diagnose(bench(), {"a.csv": motion}, terms=True)
    assert refused(cessna, without(motion, "pitch_rate_rad_per_s")) == (
        "a.csv: --terms: the record lacks pitch_rate_rad_per_s, which the airframe needs"
    )

    def unnamed(aerodynamics: ElementTree.Element) -> None:
        for function in list(aerodynamics.iter("function")):
            function.attrib.pop("name", None)

    edited_model(tmp_path, "c172p", unnamed)
    own = cessna.changed({"flight.model_folder": str(tmp_path)})
    assert refused(own, motion) == (
        "c172p: --terms: c172p has no named aerodynamic functions; leave it out"
    )
    wrong = cessna.changed({"flight.terms.aero/coefficient/ClP_": 0.7})
    with pytest.raises(InputError, match="did you mean aero/coefficient/Clp"):
        diagnose(wrong, {"a.csv": motion}, terms=True)


def test_a_term_that_the_model_lacks_is_refused_with_the_rigs_name(
    cessna: Rig, worn: Record
) -> None:
    """It once was a fault of "rig", which no file is called."""
    wrong = cessna.changed({"flight.terms.aero/coefficient/Clpp": 0.7})
    with pytest.raises(InputError, match=r"^c172p: flight\.terms\..*did you mean .*Clp\?"):
        diagnose(wrong, {"r": worn})


def test_the_option_is_refused_for_a_folder_of_records(tmp_path: Path) -> None:
    done = command(tmp_path, "diagnose", ".", "--output", "out", "--terms")
    assert done.returncode == 2
    assert "--terms: is for records of one rig, not for a folder" in done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("terms", [False, True])
def test_the_whole_diagnosis_names_it_alone_and_its_rig_closes_the_gap(
    cessna: Rig, worn: Record, tmp_path: Path, terms: bool
) -> None:
    found = diagnose(cessna, {"worn.csv": worn}, "wheel", terms=terms)
    table = found.as_dict()
    assert table["verdict"] == "effect" and table["rivals"] == []
    (effect,) = table["effects"]
    assert (effect["name"], effect["stage"]) == ("term" if terms else "roll_damping", "airframe")
    factor = effect["parameters"]["factor"]
    assert factor["low"] < 0.702 < factor["high"]
    assert factor["value"] == pytest.approx(0.702, abs=0.01)
    assert effect["parameters"].get("property", {}).get("value") == (CLP if terms else None)
    found.improved.save(tmp_path / "new.toml")
    flight = read_rig(tmp_path / "new.toml").flight
    assert flight is not None
    value = flight.terms[CLP] if terms else flight.roll_damping
    assert value == pytest.approx(factor["value"])
    closed = {one.channel: one for one in found.closed_loop or ()}
    roll = closed["roll_rate_rad_per_s"]
    assert roll.after < 0.1 * roll.before
    assert (CLP if terms else "Roll damping") in found.summary
    assert found.shrink.closed is not None and found.shrink.closed > 0.97


@pytest.mark.slow
def test_the_drift_after_a_restart_is_not_taken_for_more_wrong_functions(tmp_path: Path) -> None:
    """A wrong lift of a T-37's elevator explains all; thrust and damping would take the drift."""
    rig = read_rig(shipped_rigs()["t37"])
    record = motion_of(flown(tmp_path, rig, "aero/coefficient/CLde", 0.8))
    found = diagnose(rig, {"r": record}, terms=True)
    (effect,) = found.effects
    (factor,) = effect.parameters
    assert (found.verdict, effect.of) == ("effect", "aero/coefficient/CLde")
    assert factor.low is not None and factor.high is not None
    assert factor.low < 0.8 < factor.high


@pytest.mark.slow
@pytest.mark.parametrize(("model", "name"), [("c172p", "CYp"), ("737", "CDde")])
def test_a_faint_function_is_named_where_the_motion_is_within_its_noise(
    tmp_path: Path, model: str, name: str
) -> None:
    """A 737's drag shows most in its trim, beside which the slopes of the flight are an eighth."""
    rig, of = read_rig(shipped_rigs()[model]), f"aero/coefficient/{name}"
    found = diagnose(rig, {"r": motion_of(flown(tmp_path, rig, of, 0.7))}, "column", terms=True)
    (effect,) = found.effects
    (factor,) = effect.parameters
    assert (found.verdict, effect.of, found.rivals) == ("effect", of, ())
    assert factor.low is not None and factor.high is not None
    assert factor.low < 0.7 < factor.high


@pytest.mark.slow
@pytest.mark.parametrize("model", ["c172p", "737", "t37"])
def test_no_function_of_a_right_model_is_named(model: str) -> None:
    rig = read_rig(shipped_rigs()[model])
    record = motion_of(fly_force(noisy(rig), pulses(rig), seed=3))
    found = diagnose(rig, {"r": record}, "column", terms=True)
    assert (found.verdict, found.effects) == ("no_gap", ())


@pytest.mark.slow
@pytest.mark.parametrize("name", [effect.name for effect in AIRFRAME if "gust" not in effect.name])
def test_each_factor_is_named_at_its_size(cessna: Rig, name: str) -> None:
    """By surfaces and motion alone, within 3 standard errors: 14 sizes are tested.

    Of three samples of the propagated error, an interval is 1.6 times as wide as of many.
    """
    effect = BY_NAME[name]
    key = effect.value_key(effect.free[0])
    value = SIZES.get(name, 0.8)
    real = apply(noisy(cessna), "column", [effect], {key: value})
    record = fly_force(real, pulses(cessna), seed=3)
    found = searched(cessna, record, [one for one in AIRFRAME if "gust" not in one.name])
    (step,) = found.steps
    assert step.effect.name == name and not step.rivals
    error = (found.fit.high[key] - found.fit.low[key]) / (2.0 * 1.96)
    assert abs(found.fit.values[key] - value) < 3.0 * error < 0.05
