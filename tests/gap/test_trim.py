"""Where a record's aircraft was trimmed, and what is held against the model's own trim."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.gap.effects.airframe import term
from coupled.gap.effects.effect import apply
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.flown import fly_force
from coupled.gap.search.case import Case
from coupled.gap.search.fit import fit_alone
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import TRIM, Output, white
from coupled.gap.stages.airframe import airframe_outputs
from coupled.gap.stages.openloop import SLOW, Moved, about, command_of, fly_open_loop
from coupled.gap.stages.surfaces import WEIGHED, _constant, own_trim, surface_points, trim_of
from coupled.record.channels import ELEVATOR
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support import threecontrols
from tests.support.airframes import motion_of, noisy, pulses
from tests.support.gaps import made, nominal_rig
from tests.support.models import edited_model

POINTS = (np.array([-1.0, -0.25, 1.0]), np.array([-0.25, 0.05, 0.3]))  # a kink off trim
FILED = 0.1  # where the surface stands at no command


@pytest.fixture(scope="module")
def rig() -> Rig:
    return nominal_rig(True)


def real(rig: Rig, name: str, factor: float) -> Rig:
    return apply(rig, "column", [BY_NAME[name]], {f"{name}.factor": factor})


@pytest.mark.parametrize(("trim", "own"), [(0.1, 0.1), (0.1, -0.1), (-0.15, 0.12)])
def test_a_surface_moves_by_as_much_about_another_trim(trim: float, own: float) -> None:
    """Whatever the map between: position = own trim + (measured − its trim)."""
    change = np.array([0.0, 0.03, -0.06, 0.02])
    commands = Moved("elevator_rad", trim + change, POINTS, trim, FILED).commands(own)
    held = command_of(np.array([own]), POINTS)[0]  # by the trim, which the aircraft adds
    assert np.interp(held + commands, *POINTS) == pytest.approx(own + change, abs=1e-12)
    assert commands[0] == pytest.approx(0.0, abs=1e-12)
    assert about(own, FILED, POINTS) == pytest.approx(held, abs=1e-12)


@pytest.mark.parametrize(
    ("own", "off"),
    [
        (0.102, 0.0),
        (0.0971, 0.0),
        (0.1045, 0.0045),
        (0.0955, -0.0045),
        (0.106, 0.006),
        (0.09, -0.01),
    ],
)
def test_a_trim_within_the_error_of_the_measured_one_is_that_of_the_record(
    own: float, off: float
) -> None:
    """A surface is then flown where it was measured; beyond the error, about its own trim."""
    measured = 0.1 + np.array([0.0, 0.03, -0.06, 0.02])
    surface = Moved("elevator_rad", measured, POINTS, 0.1, FILED, 0.003)
    held = command_of(np.array([own]), POINTS)[0]
    flown = np.interp(held + surface.commands(own), *POINTS)
    assert flown == pytest.approx(measured + off, abs=1e-12)


@pytest.mark.slow
def test_the_error_of_a_trim_puts_no_barrier_before_the_right_model() -> None:
    """At 0.9 the residual once was larger than at 1, and no search passed that."""
    filed, name = noisy(read_rig(shipped_rigs()["t37"])), "aero/coefficient/CLde"
    real = filed.changed({f"flight.terms.{name}": 0.7})
    outputs = airframe_outputs(filed, motion_of(fly_force(real, pulses(filed, 40.0), seed=3)))
    rigs = [filed.changed({f"flight.terms.{name}": one}) for one in (1.0, 0.95, 0.9, 0.87)]
    squares = [sum(out.gap(rig) ** 2 for out in outputs) for rig in rigs]
    assert squares == sorted(squares, reverse=True)


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "seed"), [(0.85, 3), (1.2, 4)])
def test_the_right_aircraft_meets_the_motion_and_attitude_of_another_trim(
    tmp_path: Path, rig: Rig, factor: float, seed: int
) -> None:
    """With floors of the filed rig. By the error of its trim, its attitude once was 3.8 off."""
    record = made(tmp_path, rig, {"lift_slope": {"factor": factor}}, seed)
    right = real(rig, "lift_slope", factor)
    gaps = {out.channel: out.gap(right) for out in airframe_outputs(rig, record)}
    assert {"pitch_rate_rad_per_s", *SLOW} <= gaps.keys()
    assert max(gaps.values()) < 1.1


@pytest.mark.parametrize("seed", [4, pytest.param(3, marks=pytest.mark.slow)])
def test_a_term_that_moves_the_trim_is_fitted_within_its_interval(seed: int) -> None:
    """A fit from afar once ended beside the record's trim, 0.025 off with an error of 0.011."""
    filed, name = noisy(read_rig(shipped_rigs()["737"])), "aero/coefficient/CD0"
    real = filed.changed({f"flight.terms.{name}": 0.7})
    record = motion_of(fly_force(real, pulses(filed, 20.0), seed=seed))
    fitted = fit_alone(filed, "column", airframe_outputs(filed, record), [term(name, "DRAG")])
    ((key, value),) = fitted.values.items()
    assert fitted.low[key] < 0.7 < fitted.high[key]
    assert value == pytest.approx(0.7, abs=0.005)


def test_the_right_aircraft_meets_the_lateral_motion_of_another_trim() -> None:
    """Its aileron and rudder trim elsewhere, too: its yaw rate once was 30 noise floors off."""
    filed = noisy(read_rig(shipped_rigs()["c172p"]))
    record = threecontrols.flown(filed, {"flight.drag": 1.3}, 12.0, pedals=160.0)
    right = filed.changed({"flight.drag": 1.3})
    gaps = {out.channel: out.gap(right) for out in airframe_outputs(filed, record)}
    assert {"roll_rate_rad_per_s", "yaw_rate_rad_per_s", "sideslip_rad"} <= gaps.keys()
    assert max(gaps.values()) < 1.2


@pytest.mark.parametrize(("change", "factor"), [("mass", 1.15), ("pitch_stiffness", 0.8)])
def test_a_trim_is_measured_although_a_command_moves_the_surface_by_less_there(
    change: str, factor: float
) -> None:
    """A T-37's elevator goes up by 0.35 rad and down by 0.3; the trim was 13 errors off."""
    filed = noisy(read_rig(shipped_rigs()["t37"]))
    right = filed.changed({f"flight.{change}": factor})
    record = threecontrols.flown(filed, {f"flight.{change}": factor}, 20.0, pedals=160.0)
    trim = trim_of(filed, record, "column")
    assert trim is not None
    assert abs(trim.measured - own_trim(right, "column")) < 3.0 * trim.error
    gaps = {out.channel: out.gap(right) for out in airframe_outputs(filed, record)}
    assert max(gaps.values()) < 1.1


def test_a_model_in_its_own_trim_stays_there_by_surfaces_that_do_not_move(rig: Rig) -> None:
    """Heavier by 10 %, held where a lighter one's elevator stood."""
    heavy = real(rig, "mass", 1.1)
    assert heavy.flight is not None
    at = own_trim(rig, "column")
    still = Moved("elevator_rad", np.full(600, at), surface_points(rig, "column"), at, at)
    flown = fly_open_loop(heavy.flight, 120.0, ["column"], [still], ["pitch_rate_rad_per_s"])
    assert flown.trim[0] == own_trim(heavy, "column")
    assert np.max(np.abs(flown.motion)) < 1e-3
    assert abs(flown.trim[0] - at) > 1e-3


@pytest.mark.parametrize(
    ("values", "elsewhere"),
    [
        ({}, False),
        ({"mass": {"factor": 1.1}}, True),
        ({"mass": {"factor": 1.006}}, True),  # the trim moves by two thirds of the noise
        ({"pitch_stiffness": {"factor": 0.8}}, True),
        ({"rigging_offset": {"offset_norm": 0.001}}, False),
        ({"rigging_offset": {"offset_norm": 0.02}}, False),
        ({"mass": {"factor": 1.1}, "rigging_offset": {"offset_norm": -0.03}}, True),
    ],
    ids=[
        "as filed",
        "mass",
        "small mass",
        "stiffness",
        "small offset",
        "offset",
        "mass and offset",
    ],
)
def test_a_trim_is_distinguished_from_an_offset(
    tmp_path: Path, rig: Rig, values: dict[str, dict[str, float]], elsewhere: bool
) -> None:
    record = made(tmp_path, rig, values, 4)
    found = trim_of(rig, record, "column")
    assert found is not None
    place = own_trim(rig, "column")
    if elsewhere:
        name, numbers = next(iter(values.items()))
        place = own_trim(real(rig, name, numbers["factor"]), "column")
    assert found.position == pytest.approx(place, abs=1e-9 if not elsewhere else 4 * found.error)
    assert (found.position != own_trim(rig, "column")) is elsewhere
    assert (found.jump != 0.0) is ("rigging_offset" in values)


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [("surface_lag", "lag_s", 0.05), ("cable_stretch", "loss_per_Pa", 5e-5)],
)
@pytest.mark.parametrize("motion", [True, False], ids=["with motion", "without"])
def test_what_a_surface_lacks_of_its_command_is_no_other_trim(
    tmp_path: Path, rig: Rig, name: str, parameter: str, value: float, motion: bool
) -> None:
    """Where the command moves at once: the mean over the first second is 14 of its errors off."""
    whole = made(tmp_path, rig, {name: {parameter: value}}, 4)
    kept = [i for i, one in enumerate(whole.channels) if motion or one not in WEIGHED]
    record = Record(tuple(whole.channels[i] for i in kept), whole.data[:, kept])
    found = trim_of(rig, record, "column")
    assert found is not None
    own = own_trim(rig, "column")
    assert (found.position, found.jump) == (own, 0.0)
    assert abs(found.measured - own) < 3.0 * found.error < 3e-4


@pytest.mark.parametrize(
    ("off_rad", "lag_s", "sure"), [(6e-3, 0.0, True), (0.0, 0.15, False), (0.0, 0.0, False)]
)
def test_what_stands_before_the_command_has_moved_is_a_trim(
    off_rad: float, lag_s: float, sure: bool
) -> None:
    """Where the command is a ramp from the first frame on, no fit tells a constant from a lag."""
    rate, noise = -0.01, 2e-4
    time = np.arange(1, 120) / 120.0
    ordered = rate * time
    late = -rate * lag_s * -np.expm1(-time / max(lag_s, 1e-9))
    left = off_rad + late + np.random.default_rng(9).normal(0.0, noise, len(time))
    (found, error), _ = _constant(left, ordered, noise)
    assert (abs(found) > 4.0 * error) is sure
    if sure:
        assert (found, error) == pytest.approx((off_rad, noise / len(time) ** 0.5), rel=0.02)


def test_the_trim_is_an_output_that_the_right_model_meets(tmp_path: Path, rig: Rig) -> None:
    record = made(tmp_path, rig, {"mass": {"factor": 1.1}}, 4)
    (output,) = [out for out in airframe_outputs(rig, record) if out.channel == TRIM]
    heavy = real(rig, "mass", 1.1)
    assert output.gap(rig) > 1.5
    assert output.gap(heavy) < 0.5
    assert heavy.flight is not None
    aircraft = make_aircraft(heavy.flight, 1.0 / rig.frame_rate)
    assert np.all(output.predict(heavy) == aircraft.motion()[ELEVATOR])


def test_without_the_command_the_first_rows_show_the_trim(tmp_path: Path, rig: Rig) -> None:
    whole = made(tmp_path, rig, {"mass": {"factor": 1.1}}, 4)
    kept = [i for i, name in enumerate(whole.channels) if name != "column_estimate_m"]
    record = Record(tuple(whole.channels[i] for i in kept), whole.data[:, kept])
    found = trim_of(rig, record, "column")
    assert found is not None
    assert found.position == found.measured
    assert abs(found.position - own_trim(real(rig, "mass", 1.1), "column")) < 4.0 * found.error
    assert found.error < 0.9 * white(record["elevator_rad"])
    at = record.channels.index("elevator_rad")
    moving = record.data.copy()
    moving[:, at] += 0.05 * record.time_s  # it moves from the start
    found = trim_of(rig, Record(record.channels, moving), "column")
    assert found is not None
    assert abs(found.position - own_trim(real(rig, "mass", 1.1), "column")) < 4.0 * found.error


def test_without_motion_a_small_offset_is_the_surfaces(tmp_path: Path, rig: Rig) -> None:
    """Whatever the noise of the first row, of half a milliradian; a large one is seen there."""
    whole = made(tmp_path, rig, {"rigging_offset": {"offset_norm": 0.001}}, 4)
    kept = [i for i, name in enumerate(whole.channels) if name not in WEIGHED]
    data = whole.data[:, kept].copy()
    record = Record(tuple(whole.channels[i] for i in kept), data)
    own = own_trim(rig, "column")
    for first, elsewhere in ((2e-4, False), (2e-3, True)):
        data[:, record.channels.index("elevator_rad")] += 0.0 if first < 1e-3 else first
        data[0, record.channels.index("elevator_rad")] = own + first
        found = trim_of(rig, record, "column")
        assert found is not None
        assert (found.position != own) is elsewhere


def test_an_aircraft_that_does_not_trim_is_far_off_and_no_fault(tmp_path: Path, rig: Rig) -> None:
    record = made(tmp_path, rig, {}, 4)
    outputs = airframe_outputs(rig, record)
    far = real(rig, "mass", 3.0)
    assert all(output.gap(far) > 100.0 for output in outputs)


@pytest.mark.slow
def test_a_mass_is_fitted_where_the_model_soon_ceases_to_trim(tmp_path: Path, rig: Rig) -> None:
    """A T-37 without lift at no angle of attack trims at up to 1.105 of its weight here."""

    def edit(aerodynamics: ET.Element) -> None:
        (lift,) = [
            f for f in aerodynamics.iter("function") if f.get("name", "").endswith("CLalpha")
        ]
        (data,) = list(lift.iter("tableData"))
        rows = [[float(x) for x in line.split()] for line in (data.text or "").split("\n")]
        data.text = "\n".join(f"{row[0]} {row[1] - 0.08}" for row in rows if row)

    models = edited_model(tmp_path, "T37", edit)
    weak = rig.changed({"flight.model_folder": str(models)})
    record = made(tmp_path, weak, {"mass": {"factor": 1.05}}, 4)
    found = Problem(Case(weak, "column", airframe_outputs(weak, record))).fit([BY_NAME["mass"]])
    assert found.values["mass.factor"] == pytest.approx(1.05, abs=2e-3)
    with pytest.raises(InputError, match="does not trim"):
        own_trim(real(weak, "mass", 1.15), "column")


def test_another_trim_position_is_not_lower_noise() -> None:
    """With the play found the trim is elsewhere: the old place stood 16 floors off."""
    rig, noise = nominal_rig(False), np.random.default_rng(2).normal(0.0, 2.0, 2400)
    first = Output("airframe", TRIM, noise, lambda rig: np.zeros(2400), 1.0, 120.0)
    elsewhere = replace(first, measured=noise + 1.0, floor=0.1)
    assert (
        Case(
            rig, "column", [first], outputs_with_noise_of=lambda other: [elsewhere]
        ).with_lower_noise(rig)
        is None
    )
    quieter = replace(first, floor=0.1)
    alike = Case(
        rig, "column", [first], outputs_with_noise_of=lambda other: [quieter]
    ).with_lower_noise(rig)
    assert alike is not None
    assert alike.outputs[0].floor == 0.1


def test_an_offset_that_hides_another_trim_is_found(tmp_path: Path, rig: Rig) -> None:
    """The offset moves the surface back to where the nominal aircraft trims."""
    here = own_trim(rig, "column")
    there = own_trim(real(rig, "mass", 1.1), "column")
    points = surface_points(rig, "column")
    assert points is not None
    back = command_of(np.array([here, there]), points)
    offset = float(back[0] - back[1])
    values = {"mass": {"factor": 1.1}, "rigging_offset": {"offset_norm": offset}}
    record = made(tmp_path, rig, values, 4)
    found = trim_of(rig, record, "column")
    assert found is not None
    assert found.position == pytest.approx(there, abs=4 * found.error)
    assert abs(there - here) > 8 * found.error
    assert found.position + found.jump == pytest.approx(here, abs=1e-4)


def test_a_wrong_first_row_is_no_other_trim(tmp_path: Path, rig: Rig) -> None:
    """The aircraft flies as if it had been in the nominal trim."""
    record = made(tmp_path, rig, {}, 4)
    data = record.data.copy()
    data[0, record.channels.index("elevator_rad")] += 0.01
    found = trim_of(rig, replace(record, data=data), "column")
    assert found is not None
    assert found.position == own_trim(rig, "column")
    assert found.jump == 0.0
