"""The Augmentor Wing aircraft: trims, modes, spring tab, and what its files are made of."""

from __future__ import annotations

import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from scipy.signal import lsim

from coupled.errors import InputError
from coupled.flight.airframe import JSBSimAirframe, packaged_models
from coupled.flight.directcontrols import check_direct_controls
from coupled.record.channels import ELEVATOR, LONGITUDINAL, PITCH, motion_channels
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight
from coupled.schema import changed
from coupled.units import KNOT_m_per_s
from tests.support.awjsra import CLEAN, HOME, RIG, script, trimmed, validation

FRAME = 1 / 120
CONTROLS = ["column", "wheel", "pedals"]
assert RIG.flight is not None
APPROACH = RIG.flight
TAB = {"direct_controls": False, "properties": {**APPROACH.properties, "fcs/spring-tab-on": 1.0}}


def but(flight: Flight, **changes: Any) -> Flight:
    """Return an aircraft with some values replaced, by the keys of a rig file."""
    return changed(flight, changes, "awjsra", "flight")


def at(knots: float, path_deg: float, properties: dict[str, float], **more: Any) -> Flight:
    return but(
        APPROACH,
        calibrated_airspeed_m_per_s=knots * KNOT_m_per_s,
        flight_path_rad=math.radians(path_deg),
        properties={**APPROACH.properties, **properties},
        **more,
    )


def airframe(flight: Flight, record: tuple[str, ...] = ()) -> JSBSimAirframe:
    return JSBSimAirframe(flight, FRAME, CONTROLS, [aircraft_folder()], record=record)


def test_the_published_approach_takes_the_published_thrust() -> None:
    read = ("aero/hot-thrust-lbs", "inertia/weight-lbs", "fcs/flap-pos-deg", "fcs/nozzle-pos-deg")
    thrust, weight, flap, nozzle = airframe(APPROACH, read).extra()
    assert thrust == pytest.approx(7160.0, rel=0.01)
    assert (weight, flap, nozzle) == pytest.approx((40_000.0, 65.0, 87.7), rel=1e-4)


FLIGHTS = {
    "approach": APPROACH,
    "approach at 70 kt": at(70.0, -7.5, {}),
    "level at 50 kt, the schedule's lowest": at(50.0, 0.0, {"fcs/nozzle-cmd-deg": 50.0}),
    "level at 60 kt": at(60.0, 0.0, {"fcs/nozzle-cmd-deg": 40.0}),
    "half flap at 80 kt": at(80.0, -3.0, {"fcs/flap-cmd-norm": 0.4, "fcs/nozzle-cmd-deg": 60.0}),
    "clean at 100 kt": at(100.0, 0.0, CLEAN),
    "clean at 130 kt": at(130.0, 0.0, CLEAN),
    "clean at 160 kt": at(160.0, 0.0, CLEAN, altitude_m=1500.0),
}


@pytest.mark.parametrize("name", list(FLIGHTS))
def test_the_aircraft_trims_and_flies_level_hands_off(name: str) -> None:
    flight = FLIGHTS[name]
    flown = airframe(flight)
    channels = motion_channels(CONTROLS, flown=True)
    start = dict(zip(channels, flown.motion(), strict=True))
    seconds = 20
    for _ in range(seconds * 120):
        flown.step((0.0, 0.0, 0.0))
    end = dict(zip(channels, flown.motion(), strict=True))
    speed = start["true_airspeed_m_per_s"]
    assert end["true_airspeed_m_per_s"] == pytest.approx(speed, rel=0.02)
    assert end["pitch_rad"] == pytest.approx(start["pitch_rad"], abs=0.01)
    assert end["roll_rad"] == pytest.approx(0.0, abs=0.002)
    climb = (end["altitude_m"] - start["altitude_m"]) / (seconds * speed)
    assert math.asin(climb) == pytest.approx(flight.flight_path, abs=0.005)


@pytest.mark.parametrize(
    ("flight", "says"),
    [
        (at(30.0, 0.0, {}), "backwards and .* downwards remain with the throttle full"),
        (at(60.0, 20.0, {}), "does not trim on flight_path_rad"),
        (at(60.0, 0.0, {}), "does not trim level"),
    ],
)
def test_what_cannot_be_trimmed_is_one_line(flight: Flight, says: str) -> None:
    with pytest.raises(InputError, match=says) as caught:
        airframe(flight)
    assert caught.value.key == "flight.calibrated_airspeed_m_per_s"
    assert "\n" not in str(caught.value)


def test_newton_and_jsbsims_own_trim_agree_where_both_can() -> None:
    clean = at(140.0, 0.0, CLEAN)
    own = airframe(but(clean, trim="jsbsim")).motion()
    count = len(LONGITUDINAL)
    assert airframe(clean).motion()[:count] == pytest.approx(own[:count], abs=2e-3, rel=2e-4)


def in_tables(name: str) -> str:
    page = (HOME / "validation.md").read_text(encoding="utf-8")
    held = re.search(rf"<!-- {name} -->\n(.*?)\n<!-- end -->", page, re.DOTALL)
    assert held is not None
    return held.group(1)


def test_published_against_flown_is_within_its_aims_and_as_the_page_says() -> None:
    validate = validation()
    found = list(validate.rows(RIG))
    assert len(found) == 21
    for row in found:  # what was neither fitted nor chosen for is missed, and the table says so
        assert row.met == (row.rests_on != "roots"), row
    slow = next(row for row in found if "slow" in row.what)
    assert validate.flown_root(RIG) == pytest.approx(slow.flown, rel=0.03)
    assert in_tables("validate") == validate.report()


def test_the_gradient_of_the_published_roots() -> None:
    """57.2 lb/g times V/g·Mδ·(1/Th2)/(λ1·λ2): 0.0666 g/in at 60 kt, all of TM X-62,144."""
    gradient = validation().gradient_of_the_roots()
    assert gradient == pytest.approx(57.2 * 101.27 / 32.174 * 0.0425 * 0.37 / 0.744, rel=1e-3)
    assert gradient == pytest.approx(3.8, abs=0.05)


def fitting() -> ModuleType:
    validation()
    return script("fit")


def test_the_fits_tables_were_made_from_the_files_that_are_here() -> None:
    """After any change of them: `python aircraft/awjsra/fit.py`, with and without --leave-out."""
    assert f"Made from inputs {fitting().inputs()}." in in_tables("leave-out")


def percents(table: str) -> list[list[float]]:
    """Return the percentages of each row of a Markdown table."""
    rows = [line for line in table.splitlines() if line.startswith("|") and " %" in line]
    return [[float(x) / 100.0 for x in re.findall(r"([+-]?\d+) %", row)] for row in rows]


def without_percents(table: str) -> str:
    """Return a table with its percentages left out."""
    return re.sub(r"[+-]?\d+ %", "%", table)


@pytest.mark.slow
def test_the_fit_finds_the_models_numbers_and_says_what_determines_them() -> None:
    fit = fitting()
    found = fit.fit()
    in_model = [trimmed()[f"awjsra/{name}"] for name in fit.HELD]
    assert found.values == pytest.approx(in_model, abs=6e-4)  # three decimals are kept
    assert in_tables("determined") == fit.determined(found)
    held, made = in_tables("numbers"), fit.numbers().rpartition("\n\n")[0]
    assert without_percents(held) == without_percents(made)
    for new, old in zip(percents(made), percents(held), strict=True):
        assert new == pytest.approx(old, abs=0.0101)  # 68.4999 % here is 68.5001 % elsewhere
    # What is assumed beside the rows only ever adds
    assert np.all(found.rows_alone <= found.unassumed)
    assert np.all(found.unassumed <= found.shares)


@pytest.mark.slow
@pytest.mark.parametrize(
    "what", ["phugoid frequency, rad/s", "pitch numerator root, low, rad/s", "its M/Z, rad/ft"]
)
def test_a_row_left_out_is_missed_or_met_as_the_page_says(what: str) -> None:
    """Three of the rows; `fit.py --leave-out` makes all, from the files that the page names."""
    fit = fitting()
    row = next(row for row in fit.modelled(fit.fit(what).values) if row.what == what)
    held = next(line for line in in_tables("leave-out").splitlines() if what in line)
    assert row.off == pytest.approx(percents(held)[0][1], abs=0.02, rel=0.02)
    assert row.met == ("**missed**" not in held)


@pytest.mark.slow
def test_trims_elsewhere_are_as_the_page_says() -> None:
    validation()
    assert in_tables("elsewhere") == script("elsewhere").table()


def test_the_spring_tab_is_the_published_equation() -> None:
    """A step of the column on the tab, against the equation by another integrator."""
    flight = but(APPROACH, **TAB)
    flown = airframe(flight, ("aero/qbar-psf", "fcs/tab-command-rad"))
    pressure = flown.extra()[0]
    place = ELEVATOR
    start, command = flown.motion()[place], flown.extra()[1]
    found = []
    for _ in range(120):
        flown.step((-0.1, 0.0, 0.0))
        found.append(flown.motion()[place] - start)
    step = flown.extra()[1] - command
    spring = (13.35 + 17.44 * pressure) / (1.0 + 0.108 * pressure)
    stiffness = 2.04 * pressure + spring
    times = FRAME * np.arange(121)
    equation = ([spring], [1.0, 0.332 * pressure, stiffness])
    wanted = lsim(equation, np.full(121, step), times)[1][1:]
    assert np.max(np.abs(np.array(found) - wanted)) < 0.05 * abs(wanted[-1])
    assert wanted.min() / wanted[-1] > 1.3  # it overshoots


@pytest.mark.parametrize(
    ("flight", "pressure_psf", "ratio"),
    [
        (at(60.0, -7.5, {}), 12.2, 0.80),
        (at(99.9, 0.0, CLEAN), 33.8, 0.65),
        (at(171.8, 0.0, CLEAN), 100.0, 0.42),
    ],
)
def test_the_tabs_elevator_falls_with_pressure_as_published(
    flight: Flight, pressure_psf: float, ratio: float
) -> None:
    properties = {**flight.properties, "fcs/spring-tab-on": 1.0}
    flight = but(flight, properties=properties, direct_controls=False)
    flown = airframe(flight, ("fcs/elevator-pos-rad", "fcs/tab-command-rad", "aero/qbar-psf"))
    elevator, command, pressure = flown.extra()
    assert pressure == pytest.approx(pressure_psf, rel=0.01)
    assert elevator / command == pytest.approx(ratio, abs=0.006)


def test_both_drives_put_the_elevator_at_one_place_in_the_approach() -> None:
    place = ELEVATOR
    ends = []
    for flight in (APPROACH, but(APPROACH, **TAB)):
        flown = airframe(flight)
        start = flown.motion()[place]
        for _ in range(240):
            flown.step((-0.05, 0.0, 0.0))
        ends.append(flown.motion()[place] - start)
    assert ends[1] == pytest.approx(ends[0], rel=0.02)


def test_surfaces_with_dynamics_of_their_own_have_to_be_asked_for() -> None:
    options = {"fcs/spring-tab-on": 1.0, "fcs/rate-limits-on": 1.0}
    flight = at(60.0, -7.5, options)
    where = {"models": [aircraft_folder()]}
    with pytest.raises(InputError, match="no direct controls"):
        check_direct_controls(flight, FRAME, CONTROLS, **where)
    indirect = but(flight, direct_controls=False)
    check_direct_controls(indirect, FRAME, CONTROLS, **where)
    flown = airframe(indirect, ("fcs/left-aileron-pos-rad", "fcs/rudder-pos-rad"))
    for _ in range(12):
        flown.step((0.0, 1.0, 1.0))
    moved = [math.degrees(abs(angle)) for angle in flown.extra()]
    assert moved == pytest.approx([3.0, 5.0], rel=1e-3)  # 30 and 50 °/s for 0.1 s


def test_nozzles_and_flaps_go_at_the_published_rates_and_stops() -> None:
    code = """
import jsbsim
base = jsbsim.FGJSBBase(); base.debug_lvl = 0
fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
fdm.set_aircraft_path(%r)
fdm.load_model("awjsra")
fdm["ic/h-sl-ft"], fdm["ic/vc-kts"] = 3000.0, 100.0
fdm.run_ic()
fdm["fcs/flap-cmd-norm"], fdm["fcs/nozzle-cmd-deg"] = 1.0, 200.0
start = fdm["fcs/flap-pos-deg"], fdm["fcs/nozzle-pos-deg"]
for _ in range(60): fdm.run()
print(fdm["fcs/flap-pos-deg"] - start[0], fdm["fcs/nozzle-pos-deg"] - start[1])
for _ in range(2400): fdm.run()
print(fdm["fcs/flap-pos-deg"], fdm["fcs/nozzle-pos-deg"])
"""
    done = subprocess.run(
        [sys.executable, "-c", code % str(HOME.parent)],
        check=True,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.stderr == ""
    rates, stops = (list(map(float, line.split())) for line in done.stdout.splitlines())
    assert rates == pytest.approx([2.0, 45.0], rel=0.03)  # 4 and 90 °/s for half a second
    assert stops == pytest.approx([75.0, 116.0])


def test_the_wheels_may_touch_only_where_the_rig_says_so() -> None:
    low = but(APPROACH, altitude_m=12.0)
    ends = {}
    for landing in (False, True):
        flown = airframe(but(low, landing=landing), ("gear/wow",))
        while not flown.extra()[0]:
            flown.step((0.0, 0.0, 0.0))
        ends[landing] = flown.trouble()
    assert ends == {False: "the aircraft met the ground", True: ""}


def test_a_tail_that_strikes_is_no_landing() -> None:
    flown = airframe(but(APPROACH, altitude_m=12.0, landing=True))
    for _ in range(600):
        flown.step((-0.8, 0.0, 0.0))
        if flown.trouble():
            break
    assert flown.trouble() == "the aircraft met the ground"
    assert flown.motion()[PITCH] > math.radians(12.0)


def test_the_elevator_in_the_approach_is_as_published() -> None:
    commands, positions = airframe(APPROACH).surface_map()
    at_trim = float(np.interp(0.0, commands, positions))
    assert at_trim == pytest.approx(math.radians(-5.0), abs=0.005)
    assert (positions.min(), positions.max()) == pytest.approx(
        (math.radians(-25.0), math.radians(15.0))
    )


def test_the_model_loads_and_flies_without_output(tmp_path: Path) -> None:
    code = """
from coupled.flight.runfile import read_run
from coupled.flight.loop import fly
record = fly(read_run("worst-case")[0])
assert len(record) > 100
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        check=False,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=120,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert list(tmp_path.iterdir()) == []


TAKES = {  # how many arguments a function of JSBSim's takes, at least and at most
    **dict.fromkeys(("product", "sum", "min", "max", "and"), (2, 99)),
    **dict.fromkeys(("difference", "quotient", "pow", "gt"), (2, 2)),
    **dict.fromkeys(("sqrt", "sin", "cos"), (1, 1)),
    "ifthen": (3, 3),
    **dict.fromkeys(("value", "property"), (0, 0)),
}


def check_function(element: ET.Element) -> None:
    """Check a function's body: known words, each with as many arguments as it takes."""
    if element.tag == "table":
        assert {child.tag for child in element} == {"independentVar", "tableData"}
        return
    low, high = TAKES[element.tag]
    assert low <= len(element) <= high, ET.tostring(element)
    for child in element:
        check_function(child)


def shapes(element: ET.Element) -> Iterator[tuple[str, str]]:
    """Yield (parent, child) and (element, @attribute) of all that is no function's body."""
    yield from ((element.tag, f"@{name}") for name in element.attrib)
    if element.tag != "function":
        for child in element:
            yield (element.tag, child.tag)
            yield from shapes(child)


def test_every_element_stands_where_jsbsims_own_aircraft_have_it() -> None:
    """JSBSim's schema does not come with its Python package; its aircraft do."""
    root = next(iter(packaged_models().values())).parent
    known: set[tuple[str, str]] = set()
    for path in [*root.glob("aircraft/**/*.xml"), *root.glob("engine/*.xml")]:
        try:
            known |= set(shapes(ET.parse(path).getroot()))
        except ET.ParseError:
            continue
    for path in HOME.rglob("*.xml"):
        tree = ET.parse(path).getroot()
        assert set(shapes(tree)) <= known, (path, sorted(set(shapes(tree)) - known))
        for function in tree.iter("function"):
            body = [child for child in function if child.tag != "description"]
            assert len(body) == 1
            check_function(body[0])


def test_the_sections_stand_in_the_schemas_order() -> None:
    order = ["fileheader", "metrics", "mass_balance", "ground_reactions", "propulsion"]
    order += ["system"] * 6 + ["flight_control", "aerodynamics"]
    assert [section.tag for section in ET.parse(HOME / "awjsra.xml").getroot()] == order
