"""Logs of other programs, imported without a map, and diagnosed by a rig of an aircraft alone."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupled import diagnose as judge
from coupled import fit, load_rig
from coupled.errors import InputError, joined
from coupled.gap.chain import Part
from coupled.gap.checks import (
    at_rate_of,
    check_moved_by_pilot,
    density_of,
    motion_alone,
    not_in_trim,
    other_air,
    trimmed,
    unmeasured_trim,
)
from coupled.gap.diagnose import diagnose, findings
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.flown import fly_force
from coupled.gap.findings.hints import late_channels, still_surfaces, unknown_conditions
from coupled.gap.findings.where import lone_channel
from coupled.gap.prepare import finely_stepped, prepare
from coupled.gap.search.beam import search_sets
from coupled.gap.search.histories import search
from coupled.gap.signals.output import TRIM
from coupled.gap.stages.airframe import airframe_outputs, unjudged_axes
from coupled.gap.stages.openloop import is_throttled
from coupled.record.channels import LATERAL, RATE, SURFACES
from coupled.record.importing.convert import import_log
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.airframes import motion_of, noisy, pulses
from tests.support.commands import coupled
from tests.support.ownlogs import OF_THE_GUIDE, PROPERTIES, flightgear_log, flown
from tests.support.rigs import bench

AIRFRAME = Part("column", own=False)
_RATES = ("yaw_rate_rad_per_s", "roll_rate_rad_per_s")


def alone(name: str = "c172p") -> Rig:
    """Return a shipped rig without its controls."""
    return read_rig(shipped_rigs()[name]).changed({"controls": {}, "noise": {}})


def without(record: Record, *names: str) -> Record:
    kept = [name for name in record.channels if name not in names]
    data = np.column_stack([record[name] for name in kept])
    return Record(tuple(kept), data, record.manifest)


def with_noise(record: Record) -> Record:
    """Return a record with noise of 2e-4 SI on each channel but time."""
    noise = np.random.default_rng(6).normal(scale=2e-4, size=record.data.shape)
    noise[:, 0] = 0.0
    return Record(record.channels, record.data + noise, record.manifest)


def factor(found: Diagnosis, name: str) -> tuple[float, float, float]:
    """Return the only effect's factor with its interval, after a check of its name."""
    (effect,) = found.effects
    (number,) = effect.parameters
    assert (found.verdict, effect.name) == ("effect", name)
    assert number.low is not None and number.high is not None
    return number.low, number.value, number.high


@pytest.mark.slow
def test_a_log_of_jsbsim_shows_what_was_edited_in_its_model(tmp_path: Path) -> None:
    log, _ = flown(tmp_path, {"/Cmq": 0.7}, 16.0, rate_Hz=30.0)
    alone().save(tmp_path / "air.toml")
    done = coupled(tmp_path, "import", log.name, "-o", "r.csv")
    assert (done.returncode, done.stderr) == (0, "")
    words = ("diagnose", "r.csv", "--rig", "air.toml", "--improve", "new.toml")
    done = coupled(tmp_path, *words, "--json", "found.json")
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "found.json").read_text())
    assert (found["verdict"], list(found["stages"])) == ("effect", ["airframe"])
    assert "calibrated_airspeed_m_per_s 46.3 → 52" in found["trim"]
    (effect,) = found["effects"]
    number = effect["parameters"]["factor"]
    assert effect["name"] == "pitch_damping"
    assert number["low"] < 0.7 < number["high"]
    assert number["value"] == pytest.approx(0.7, abs=0.01)
    improved = load_rig(tmp_path / "new.toml")
    assert improved == alone().changed({"flight.pitch_damping": improved["flight.pitch_damping"]})
    assert improved["flight.pitch_damping"] == pytest.approx(number["value"])


@pytest.mark.slow
def test_a_log_of_flightgear_shows_what_was_edited_in_its_model(tmp_path: Path) -> None:
    _, rows = flown(tmp_path, {"/Cmalpha": 0.8}, 16.0)
    record, account = import_log(flightgear_log(tmp_path / "fg.csv", rows))
    assert (account.clock.frame_rate_Hz, account.unmapped) == (60.0, ())
    found = diagnose(alone(), {"log": record})
    assert (found.nominal.frame_rate, found.nominal["flight.steps_per_frame"]) == (60.0, 2)
    assert (found.closed_loop, found.in_flight, found.next_test) == (None, None, "")
    low, value, high = factor(found, "pitch_stiffness")
    assert low < 0.8 < high
    assert value == pytest.approx(0.8, abs=0.01)


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Record:
    """Return the record of a log of the model as it is, with all controls moved."""
    log, _ = flown(tmp_path_factory.mktemp("healthy"), {}, 12.0)
    return import_log(log)[0]


def test_a_log_of_the_same_model_has_no_gap(healthy: Record) -> None:
    assert np.ptp(healthy["roll_rad"]) > 0.05
    found = diagnose(alone(), {"log": healthy})
    assert found.verdict == "no_gap"
    assert "No gap in the airframe: every stage that could be judged" in found.summary
    assert repr(found) == "Diagnosis(c172p, airframe: no_gap)"


def test_a_log_that_starts_on_the_ground_is_refused(healthy: Record) -> None:
    """The rig file was to blame: its model did not trim at the altitude of the ground."""
    data, at = healthy.data.copy(), healthy.channels.index("true_airspeed_m_per_s")
    data[:, at] *= np.minimum(healthy.time_s / 8.0, 1.0)
    with pytest.raises(InputError, match=r"log: true_airspeed.*: starts at 3.* on the ground"):
        diagnose(alone(), {"log": Record(healthy.channels, data)})


@pytest.mark.parametrize("first", [900, 300])
def test_a_filled_dropout_in_all_channels_ends_what_is_judged(healthy: Record, first: int) -> None:
    """The surfaces in it are unknown: 0.3 s gave a gap that no effect explains, after 102 s."""
    record = with_noise(healthy)
    record.data[first : first + 40, 1:] = record.data[first, 1:]
    prepared = prepare(alone(), {"log": record}, AIRFRAME)
    said = [words for words in prepared.left_out if "log repeat all channels" in words]
    if first < 600:  # before it too little, and after it no trim
        assert (len(prepared.records["log"]), said) == (len(record), [])
        return
    assert len(prepared.records["log"]) == first + 1
    assert "it is judged from 0.00 to 7.50 s only" in said[0]
    assert max(prepared.case.gaps(prepared.case.nominal).values()) < 1.2


def test_a_log_to_the_east_is_flown_to_the_east(tmp_path: Path) -> None:
    """The Earth turns: an aircraft is lighter by 2·Ω·v there, 8e-4 of its weight at 55 m/s."""
    properties = (*PROPERTIES, "attitude/psi-rad")
    log, _ = flown(tmp_path, {}, 9.0, properties=properties, heading_deg=90.0)
    record = import_log(log)[0]
    rig = trimmed(alone(), {"log": record})[0]["log"]
    off = {one.channel: one.measured - one.predict(rig) for one in airframe_outputs(rig, record)}
    assert np.abs(off["load_factor"]).max() < 2e-4
    assert np.abs(off["pitch_rate_rad_per_s"]).max() < 1e-5


def test_surfaces_that_jump_between_the_rows_are_no_fault(tmp_path: Path) -> None:
    log, _ = flown(tmp_path, {}, 9.0, rate_Hz=60.0, by_hand=False)
    records = {"log": with_noise(import_log(log)[0])}
    rig = trimmed(at_rate_of(alone(), records), records)[0]["log"]
    for output in airframe_outputs(rig, records["log"]):
        off = output.measured - output.predict(rig)
        assert np.sqrt(np.mean(off**2)) < 1.2 * output.floor, output.channel


@pytest.mark.slow
@pytest.mark.parametrize(
    ("function", "name", "factor"), [("/Cmq", "pitch_damping", 0.0), ("/Cnda", "adverse_yaw", -1.0)]
)
def test_a_missing_or_reversed_derivative_is_found_beside_jumps(
    tmp_path: Path, function: str, name: str, factor: float
) -> None:
    log, _ = flown(tmp_path, {function: factor}, 12.0, rate_Hz=60.0, by_hand=False)
    records = {"log": with_noise(import_log(log)[0])}
    case = prepare(alone(), records, AIRFRAME).case
    library = [BY_NAME[one] for one in (name, "motion_skew")]
    found = search_sets(replace(case, outputs_with_noise_of=None), library)[1]
    assert [step.effect.name for step in found.steps] == [name]
    assert found.fit.values[f"{name}.factor"] == pytest.approx(factor, abs=0.05)


def test_when_a_surface_steps_between_two_rows_is_not_known(tmp_path: Path) -> None:
    """A late or early time stamp of the motion, at 0.85, was the answer for a healthy model."""
    log, _ = flown(tmp_path, {}, 9.0, properties=OF_THE_GUIDE, controls=1, by_hand=False)
    whole = import_log(log)[0]
    noise = 1e-3 * np.random.default_rng(1).standard_normal(whole.data.shape)
    noise[:, 0] = 0.0
    data = (whole.data + noise)[::2]  # a script's steps act just after a row, or just before
    found = diagnose(alone(), {"log": Record(whole.channels, data)})
    assert found.verdict == "no_gap"


def test_the_lateral_motion_is_compared_if_aileron_and_rudder_are_recorded(healthy: Record) -> None:
    def compared(record: Record) -> set[str]:
        return {output.channel for output in airframe_outputs(alone(), record)}

    assert {"roll_rate_rad_per_s", "sideslip_rad"} < compared(healthy)
    assert compared(without(healthy, "rudder_rad")) == {
        *("pitch_rate_rad_per_s", "alpha_rad", "load_factor", "elevator_trim_rad"),
        *("true_airspeed_m_per_s", "pitch_rad"),
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "other"),
    [("rudder_rad", ""), ("yaw_rate_rad_per_s", ""), ("alpha_rad", "sideslip_rad")],
)
def test_a_reversed_or_exchanged_channel_is_named(tmp_path: Path, name: str, other: str) -> None:
    """It was a gap that no effect explains, after a search of up to 46 s."""
    record, _ = import_log(flown(tmp_path, {"/Cmq": 0.7}, 16.0, rate_Hz=30.0)[0])
    data = record.data.copy()
    if other:
        pair = [record.channels.index(one) for one in (name, other)]
        data[:, pair] = data[:, pair[::-1]]
    else:
        data[:, record.channels.index(name)] *= -1.0
    question = f"is it exchanged with {other}" if other else "is its sign reversed"
    with pytest.raises(InputError, match=rf"log: {name}: {question}\? So read, the record fits"):
        diagnose(alone(), {"log": Record(record.channels, data)})


def test_a_log_that_starts_in_a_manoeuvre_is_named(healthy: Record) -> None:
    """It was a gap of 195 floors, for which no sentence gave a reason."""
    assert not_in_trim(healthy, "log") == ""
    begun = Record(healthy.channels, healthy.data[healthy.time_s > 1.5])
    words = not_in_trim(begun, "log")
    assert words.startswith("log does not start in trim")
    assert "pitch_rate_rad_per_s starts at" in words
    (said,) = (one for one in prepare(alone(), {"log": begun}, AIRFRAME).left_out if "trim" in one)
    assert said == words


def test_a_sensor_of_the_motion_that_holds_its_values_is_named(healthy: Record) -> None:
    """Air data of a bus of 20 Hz in a log of 120 rows a second was a gap without any reason."""
    noisy_one = with_noise(healthy)
    data, at = noisy_one.data.copy(), healthy.channels.index("alpha_rad")
    data[:, at] = data[np.arange(len(data)) // 6 * 6, at]
    every, held = (Record(healthy.channels, one) for one in (noisy_one.data, data))
    said = [prepare(alone(), {"log": one}, AIRFRAME) for one in (every, held)]
    assert not any("holds each value" in words for words in said[0].left_out)
    (words,) = (words for words in said[1].left_out if "holds each value" in words)
    assert words.startswith("alpha_rad of log holds each value over 6 rows")


def test_a_trim_that_no_channel_shows_is_named_beside_a_gap(healthy: Record) -> None:
    """A flight at 52 m/s, by a file of 46, was another mass and another pitch inertia."""
    lacking = without(healthy, "true_airspeed_m_per_s")
    words = unmeasured_trim(alone(), {"log": lacking})
    assert "calibrated_airspeed_m_per_s 46.3, altitude_m 1500" in words
    assert unmeasured_trim(alone(), {"log": healthy}) == ""
    made = prepare(alone(), {"log": lacking}, AIRFRAME)
    assert words in findings(made, *search(made.case, [])).left_out


@pytest.mark.parametrize(("names", "told"), [(_RATES[:1], True), (_RATES, False)])
def test_a_channel_that_alone_has_a_gap_is_named(
    healthy: Record, names: tuple[str, ...], told: bool
) -> None:
    """A gyro with a scale was a gap of the airframe, without the name of its channel."""
    scales = np.array([1.3 if name in names else 1.0 for name in healthy.channels])
    data = healthy.data * scales
    data[:, 1:] += np.random.default_rng(1).normal(0.0, 1e-3, data[:, 1:].shape)
    record = Record(healthy.channels, data)
    rig = trimmed(at_rate_of(alone(), {"log": record}), {"log": record})[0]["log"]
    outputs = airframe_outputs(rig, record)
    words = lone_channel(outputs, rig)
    assert ("Of the motion yaw_rate_rad_per_s alone has a gap" in words) is told
    assert (words != "") is told


def test_rates_that_are_late_are_named_with_their_delay(healthy: Record) -> None:
    """Rates 100 ms late were a gap of 42 noise floors that no effect explains, without a hint."""
    record, late = with_noise(healthy), healthy.time_s - 0.1
    for name in RATE.values():
        record.data[:, record.channels.index(name)] = np.interp(late, healthy.time_s, record[name])
    prepared = prepare(alone(), {"log": record}, AIRFRAME)
    words = findings(prepared, *search(prepared.case, [])).left_out
    each = [f"{RATE[name]} (0.1 s)" for name in ("column", "wheel", "pedals")]
    assert f"{joined(each)} are late, relative to the model: check the time stamps." in words
    assert late_channels(prepared.case.outputs, prepared.case.nominal) in words


@pytest.mark.slow
def test_a_wrong_damping_or_a_right_model_is_not_late(tmp_path: Path, healthy: Record) -> None:
    log, _ = flown(tmp_path, {"/Cmq": 0.5}, 12.0)
    for record in (healthy, import_log(log)[0]):
        case = prepare(alone(), {"log": with_noise(record)}, AIRFRAME).case
        assert late_channels(case.outputs, case.nominal) == ""


@pytest.mark.slow
def test_an_elevator_that_stands_still_is_named_beside_a_gap(healthy: Record) -> None:
    record, at = with_noise(healthy), healthy.channels.index("elevator_rad")
    assert still_surfaces([record]) == ""
    record.data[:, at] = record.data[0, at]
    prepared = prepare(alone(), {"log": record}, AIRFRAME)
    words = findings(prepared, *search(prepared.case, [])).left_out
    assert "elevator_rad never changes: is a sensor stuck?" in words


def test_a_small_offset_of_a_lone_channel_is_named(healthy: Record) -> None:
    """An accelerometer's zero of twice its noise floor was unexplained, without its name."""
    data = healthy.data.copy()
    data[:, healthy.channels.index("load_factor")] += 4e-3
    data[:, 1:] += np.random.default_rng(1).normal(0.0, 1e-3, data[:, 1:].shape)
    record = Record(healthy.channels, data)
    rig = trimmed(at_rate_of(alone(), {"log": record}), {"log": record})[0]["log"]
    outputs = airframe_outputs(rig, record)
    assert max(one.gap(rig) for one in outputs) < 2.5
    assert "Of the motion load_factor alone has a gap" in lone_channel(outputs, rig)


def test_air_of_another_density_is_named(healthy: Record) -> None:
    """A hot day, or an altitude above the ground, was a mass and three inertias of 0.89 each."""
    rig = trimmed(at_rate_of(alone(), {"log": healthy}), {"log": healthy})[0]["log"]
    standard = 1.0902 * 0.5 * healthy["true_airspeed_m_per_s"] ** 2  # at 1200 m

    def measured(density: float) -> float:
        data = np.column_stack([healthy.data, density * standard])
        return density_of(rig, Record((*healthy.channels, "dynamic_pressure_Pa"), data))

    assert measured(1.0) == density_of(rig, healthy) == 1.0
    assert measured(0.94) == pytest.approx(0.94, rel=1e-3)
    assert other_air(1.0, "log") == ""
    assert "the density of the air is 0.940 times the model's" in other_air(0.94, "log")


def test_a_fault_of_the_forces_is_not_judged_by_an_aircraft_alone(healthy: Record) -> None:
    forced = Record(
        (*healthy.channels, "column_force_N", "column_computed_m"),
        np.column_stack([healthy.data, np.ones((len(healthy), 2))]),
    )
    assert motion_alone({"log": forced})["log"].channels == healthy.channels


def test_a_stuck_elevator_is_no_gap_of_the_trim(healthy: Record) -> None:
    """The model's trim has the error of the measured airspeed, however quiet the elevator is."""
    data = healthy.data.copy()
    speed, elevator = map(healthy.channels.index, ("true_airspeed_m_per_s", "elevator_rad"))
    data[:, speed] += np.random.default_rng(6).normal(scale=0.1, size=len(data))
    data[:, elevator] = data[0, elevator]
    stuck = Record(healthy.channels, data)
    rig = trimmed(alone(), {"log": stuck})[0]["log"]
    outputs = {one.channel: one for one in airframe_outputs(rig, stuck)}
    gaps = {name: float(np.std(one.residual(rig))) for name, one in outputs.items()}
    assert abs(float(np.mean(outputs[TRIM].residual(rig)))) < 1.0
    assert gaps["pitch_rate_rad_per_s"] > 10.0


def test_a_vane_that_stands_still_is_named(healthy: Record) -> None:
    data = healthy.data.copy()
    data[:, healthy.channels.index("sideslip_rad")] = 0.0
    stuck = Record(healthy.channels, data)
    said = [unjudged_axes(airframe_outputs(alone(), one), [one]) for one in (healthy, stuck)]
    assert said == [[], ["sideslip_rad never changes: it is not judged."]]


def test_a_throttle_that_moves_is_seen_by_an_aircraft_alone(healthy: Record) -> None:
    """Its channel was left out, and so the speed judged by the throttle in trim."""
    throttle = 0.5 + 0.2 * (healthy.time_s > 5.0)

    def throttled(name: str) -> bool:
        given = Record((*healthy.channels, name), np.column_stack([healthy.data, throttle]))
        return is_throttled(motion_alone({"log": given})["log"])

    assert throttled("throttle_percent")
    assert not throttled("throttle_norm")  # the model's is moved alike


def test_levers_that_a_log_does_not_have_are_named(healthy: Record) -> None:
    assert "throttle_norm, flap_norm and gear_norm" in unknown_conditions([healthy])
    given = Record(
        (*healthy.channels, "throttle_1_norm"),
        np.column_stack([healthy.data, np.full(len(healthy), 0.7)]),
    )
    assert ": flap_norm and gear_norm. " in unknown_conditions([given])
    manifest = {"rig": {"flight": {"model": "c172p"}}}
    assert unknown_conditions([Record(healthy.channels, healthy.data, manifest)]) == ""


def test_what_no_lever_shows_of_a_flight_is_named_beside_all_levers(healthy: Record) -> None:
    levers = ("throttle_norm", "flap_norm", "gear_norm")
    given = Record(
        (*healthy.channels, *levers), np.column_stack([healthy.data, np.zeros((len(healthy), 3))])
    )
    words = unknown_conditions([given])
    assert "engine failure, wind shear or turbulence" in words and "Not recorded" not in words


def test_a_rig_takes_the_frame_rate_of_a_log_and_keeps_its_own_steps(healthy: Record) -> None:
    def rate_of(every: int) -> tuple[float, int]:
        slow = Record(healthy.channels, healthy.data[::every])
        rig = at_rate_of(alone(), {"slow": slow})
        return rig.frame_rate, rig["flight.steps_per_frame"]

    assert [rate_of(every) for every in (1, 2, 5)] == [(120.0, 1), (60.0, 2), (24.0, 5)]


@pytest.mark.parametrize("name", ["elevator_rad", "pitch_rate_rad_per_s"])
def test_a_log_without_elevator_or_pitch_rate_is_refused(healthy: Record, name: str) -> None:
    with pytest.raises(InputError, match=f"log: {name}: is missing; the rig has an aircraft only"):
        diagnose(alone(), {"log": without(healthy, name)})


def test_an_elevator_moved_by_control_laws_is_refused(healthy: Record) -> None:
    fighter = alone().changed(
        {
            "flight": {
                "model": "f16",
                "altitude_m": 3000.0,
                "calibrated_airspeed_m_per_s": 150.0,
                "direct_controls": False,
            }
        }
    )
    lacking = without(healthy, "true_airspeed_m_per_s")
    with pytest.raises(InputError, match=r"flight\.model: f16 has control laws.*controls\.column"):
        diagnose(fighter, {"log": lacking})


def test_what_an_aircraft_alone_cannot_be_asked_is_refused(healthy: Record) -> None:
    with pytest.raises(InputError, match="--control: the rig is an aircraft alone"):
        diagnose(alone(), {"log": healthy}, "wheel")
    with pytest.raises(InputError, match="log 2: is a duplicate"):
        judge(alone(), {"log": healthy, "log 2": healthy})
    with pytest.raises(InputError, match="is a duplicate"):
        judge(alone(), {"log": healthy}, healthy={"well": healthy})


@pytest.mark.slow
def test_a_number_of_an_aircraft_alone_is_fitted_at_the_rate_of_the_log(healthy: Record) -> None:
    slow = Record(healthy.channels, healthy.data[::2])
    (number,) = fit(alone(), slow, free=["flight.pitch_damping"]).numbers
    assert number.half is not None
    assert abs(number.found - 1.0) < number.half < 0.05
    with pytest.raises(InputError, match=r"--free: the rig has an aircraft only: give its keys"):
        fit(alone(), slow)
    with pytest.raises(InputError, match=r"--free: loader\.mass_kg: the rig has no column"):
        fit(alone(), slow, free=["loader.mass_kg"])


def test_terms_without_an_aircraft_are_refused(healthy: Record) -> None:
    with pytest.raises(InputError, match="--terms: the rig has no aircraft"):
        diagnose(bench({}), {"log": healthy}, terms=True)


def test_a_log_that_was_imported_beside_a_rig_is_trimmed_as_it_begins(tmp_path: Path) -> None:
    """The rig of an import is what the log was compared with, not what was flown."""
    log = Path(__file__).parents[1] / "data" / "JSBout.csv"
    record, account = import_log(log, None, alone())
    assert account.clock.frame_rate_Hz == 30.0  # an aircraft alone has no host whose frames count
    manifest = {"rig": json.loads(alone().model_dump_json()), "imported_from": log.name}
    known = Record(record.channels, record.data, manifest)
    trims, said = trimmed(at_rate_of(alone(), {"log": known}), {"log": known})
    flight = trims["log"].flight
    assert flight is not None and flight.calibrated_airspeed == pytest.approx(52.0, abs=1.0)
    assert "the first rows of log" in said


def test_a_rudder_that_a_yaw_damper_moves_is_led_to_where_it_was_measured() -> None:
    """Without the pedals' command: the model's damper alone left 228 floors in the roll rate."""
    jet = read_rig(shipped_rigs()["737"])
    record = fly_force(noisy(jet), {"pedals": pulses(jet, 16.0)["pedals"]}, seed=3)
    motion = motion_of(record)
    assert float(np.ptp(motion["rudder_rad"])) > 0.02
    outputs = airframe_outputs(jet, motion)
    assert {"roll_rate_rad_per_s", "yaw_rate_rad_per_s"} <= {one.channel for one in outputs}
    assert "rudder_rad" not in {one.channel for one in outputs}
    assert all(one.gap(jet) < one.limit for one in outputs)


def test_an_aircraft_whose_motion_is_within_its_noise_is_not_judged(healthy: Record) -> None:
    data = healthy.data.copy()
    data[:, 1:] = data[0, 1:] + 1e-3 * (data[:, 1:] - data[0, 1:])
    quiet = without(Record(healthy.channels, data), *LATERAL)
    found = diagnose(alone(), {"log": with_noise(quiet)})
    assert (found.verdict, found.stage("airframe").judged) == ("ambiguous", False)
    assert "Whether the airframe has a gap cannot be decided" in str(found.summary)
    assert "shows little but noise" in found.stage("airframe").why


def test_a_gentle_flight_is_judged_at_noise_of_more_than_a_tenth_of_its_motion(
    healthy: Record,
) -> None:
    """A healthy record of a column had an ambiguous airframe, at 12 %."""
    data = healthy.data.copy()
    data[:, 1:] = data[0, 1:] + 0.015 * (data[:, 1:] - data[0, 1:])
    quiet = with_noise(without(Record(healthy.channels, data), *LATERAL))
    rig = trimmed(at_rate_of(alone(), {"log": quiet}), {"log": quiet})[0]["log"]
    hidden = [one.hidden_gap for one in airframe_outputs(rig, quiet)]
    shares = [one.share for one in hidden if one is not None]
    assert 0.1 < min(shares) < 0.3
    assert not all(one.much for one in hidden if one is not None)


def test_an_axis_that_a_log_does_not_show_is_named(healthy: Record) -> None:
    trims, _ = trimmed(alone(), {"log": healthy})
    rig, noisy_log = trims["log"], with_noise(healthy)
    assert unjudged_axes(airframe_outputs(rig, noisy_log), [noisy_log]) == []
    for lost, named in (
        (SURFACES["wheel"] + "_rad", "aileron_rad"),
        (("roll_rate_rad_per_s", "yaw_rate_rad_per_s", "sideslip_rad"), "roll_rate_rad_per_s, yaw"),
    ):
        less = without(noisy_log, *((lost,) if isinstance(lost, str) else lost))
        (said,) = unjudged_axes(airframe_outputs(rig, less), [less])
        assert said.startswith(f"Without {named}")
        assert said.endswith("the lateral motion is not judged.")
    data = healthy.data.copy()
    for name in LATERAL:
        if name in healthy:
            column = data[:, healthy.channels.index(name)]
            column[:] = column[0] + 1e-3 * (column - column[0])
    still = with_noise(Record(healthy.channels, data))
    said = "The lateral motion hardly exceeds its noise, which may hide its gap."
    assert unjudged_axes(airframe_outputs(rig, still), [still]) == [said]


@pytest.mark.slow
def test_a_rig_of_wide_steps_is_flown_with_those_that_fit_the_log(tmp_path: Path) -> None:
    record = import_log(flown(tmp_path, {"/Clp": 0.9}, 8.0, rate_Hz=40.0)[0])[0]
    trims, _ = trimmed(alone().changed({"frame_rate_Hz": 40.0}), {"log": record})
    finer, said = finely_stepped(trims, {"log": record})
    assert finer["log"]["flight.steps_per_frame"] == 3
    assert "3 steps a frame, which fit better than the 1 of the rig file" in said
    assert finely_stepped(finer, {"log": record}) == (finer, "")
    # The log of a simulation with a step per row.
    data = record.data.copy()
    for output in airframe_outputs(trims["log"], record):
        if output.channel in record:
            own = output.measured - output.floor * output.residual(trims["log"])
            data[:, record.channels.index(output.channel)] = own
    coarse = Record(record.channels, data)
    assert finely_stepped(trims, {"log": coarse}) == (trims, "")
    named = Record(record.channels, record.data, {"rig": {"name": "own"}})
    assert finely_stepped(trims, {"log": named}) == (trims, "")


def test_a_surface_whose_position_stays_at_rest_in_the_model_is_refused(healthy: Record) -> None:
    flight = {"model": "T38", "altitude_m": 6096.0, "calibrated_airspeed_m_per_s": 205.8}
    rig = alone().changed({f"flight.{key}": value for key, value in flight.items()})
    with pytest.raises(InputError, match=r"T38 does not move fcs/elevator-pos-rad.* in log;"):
        check_moved_by_pilot(rig, {"log": healthy})
    still = healthy.data.copy()
    still[:, [healthy.channels.index(f"{name}_rad") for name in SURFACES.values()]] = 0.0
    check_moved_by_pilot(rig, {"log": Record(healthy.channels, still)})
    check_moved_by_pilot(alone(), {"log": healthy})
