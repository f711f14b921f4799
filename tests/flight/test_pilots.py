"""Pilots who close the loop: the loop is as they set it, and the arm and its strength are real."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import coupled
from coupled.errors import InputError
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import (
    Attitude,
    Clamp,
    Doublet,
    ForceTable,
    FrequencySweep,
    Pilot,
    Ramp,
    Step,
    ThreeTwoOneOne,
    Track,
)
from coupled.flight.pilot.crossover import (
    Compensation,
    CompensationFilter,
    Delay,
    Remnant,
    adapt,
    compensation_response,
    delay_response,
)
from coupled.flight.response import elevator_response
from coupled.flight.runfile import read_run
from coupled.record.channels import ControlName, motion_channels
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig

RUN = """
name = "test"
card = "A test."
rig = "{rig}"
duration_s = {duration}
seed = 3

[pilot.{control}]
kind = "track"
{pilot}

[[case]]
label = "without dry friction"
[case.rig]
{smooth}
"""
_PERIOD_s = 60.0
_SLIP = "sine_rad = 0.0005\nintegral_rad_per_s = 3.0"
_PATH = "sine_rad = 0.001\nintegral_rad_per_s = 1.0"


def manoeuvre(
    folder: Path,
    pilot: str,
    rig: str = "report-column",
    duration: float = 6,
    control: ControlName = "column",
) -> Manoeuvre:
    path = folder / "test.toml"
    dry = ("friction_N", "breakaway_N", "breakout_N")
    smooth = "\n".join(f'"controls.{control}.loader.{key}" = 0.0' for key in dry)
    path.write_text(
        RUN.format(duration=duration, pilot=pilot, rig=rig, control=control, smooth=smooth),
        encoding="utf-8",
    )
    return read_run(str(path))[0]


def measured(record: Record, flown: NDArray[np.float64], pilot: Track) -> tuple[float, float]:
    """Return crossover in rad/s and phase margin in rad of the open loop, Y/(R − Y).

    From the amplitudes at the sines of the target over the record's last whole period.
    """
    rows = round(_PERIOD_s / record.time_s[1])
    t = record.time_s[-rows:]
    waves = [wave(rate * t) for rate in pilot.sine_rates_rad_per_s for wave in (np.sin, np.cos)]
    basis = np.column_stack((np.ones(rows), t - t.mean(), *waves))

    def amplitudes(signal: NDArray[np.float64]) -> NDArray[np.complex128]:
        found: NDArray[np.float64] = np.linalg.lstsq(basis, signal[-rows:], rcond=None)[0][2:]
        return found[::2] + 1j * found[1::2]

    y, r = amplitudes(flown), amplitudes(pilot.target(record.time_s))
    loop = y / (r - y)
    rates = np.log(pilot.sine_rates_rad_per_s)
    at = np.interp(0.0, -np.log(np.abs(loop)), rates)
    margin = np.pi + np.interp(at, rates, np.unwrap(np.angle(loop)))
    return float(np.exp(at)), float((margin + np.pi) % (2 * np.pi) - np.pi)


def sines(crossover: float) -> list[float]:
    base = 2.0 * np.pi / _PERIOD_s
    return [round(crossover * f / base) * base for f in (0.5, 0.8, 1.0, 1.25, 2.0)]


LOOPS = [
    ("report-column", "column", "pitch", 2.0, 0.7, "sine_rad = 0.0002"),
    ("737", "wheel", "roll", 1.5, 0.7, "sine_rad = 0.002"),
]
MORE_LOOPS = [
    ("report-column", "column", "flight_path", 0.7, 0.9, _PATH),
    ("t37", "pedals", "sideslip", 0.5, 1.0, _SLIP),
    ("report-column", "column", "pitch", 3.0, 0.5, "sine_rad = 0.0002"),
    ("awjsra", "column", "pitch", 1.5, 0.7, "sine_rad = 0.001"),
    ("report-column", "column", "airspeed", 0.25, 0.8, "sine_m_per_s = 0.1"),
    ("737", "wheel", "roll", 1.5, 0.7, "sine_rad = 0.002\narm_mass_kg = 0.36"),
    ("737", "wheel", "heading", 0.3, 0.9, "sine_rad = 0.001"),
    ("737", "pedals", "heading", 0.3, 0.7, "sine_rad = 0.0002"),
    ("737", "pedals", "sideslip", 0.3, 1.0, _SLIP),
]


@pytest.mark.parametrize(
    ("rig", "control", "what", "crossover", "margin", "size"),
    [*LOOPS, *(pytest.param(*loop, marks=pytest.mark.slow) for loop in MORE_LOOPS)],
)
def test_the_loop_crosses_over_as_set(
    tmp_path: Path,
    rig: str,
    control: ControlName,
    what: str,
    crossover: float,
    margin: float,
    size: str,
) -> None:
    rates = [float(rate) for rate in sines(crossover)]
    pilot = f'what = "{what}"\ncrossover_rad_per_s = {crossover}\nphase_margin_rad = {margin}\n'
    pilot += f"sine_rates_rad_per_s = {rates}\n{size}\n"
    wait = 60.0 if what in ("airspeed", "heading") else 20.0
    flown = manoeuvre(tmp_path, pilot, rig, 1.0 + wait + _PERIOD_s, control)
    record = fly(flown.configured("rigid"))
    assert record.manifest["ended_early"] is None
    climb = np.diff(record["altitude_m"], prepend=record["altitude_m"][0]) / record.time_s[1]
    seen = {
        "pitch": record["pitch_rad"],
        "flight_path": np.arcsin(climb / record["true_airspeed_m_per_s"]),
        "airspeed": record["true_airspeed_m_per_s"],
    }
    if control != "column":
        seen |= {"roll": record["roll_rad"], "heading": np.unwrap(record["heading_rad"])}
        seen["sideslip"] = record["sideslip_rad"]
    pilots = flown.pilots[control]
    assert isinstance(pilots, Track)
    found, left = measured(record, seen[what], pilots)
    print(f"{rig} {what}: {found:.3f} of {crossover} rad/s, {left:.3f} of {margin} rad")
    # Small sines: the T-37's tables have kinks, which larger ones feel.
    assert found == pytest.approx(crossover, rel=0.01)
    assert left == pytest.approx(margin, abs=0.015)


@pytest.mark.parametrize(("control", "channel"), [("wheel", "roll_rad"), ("pedals", "heading_rad")])
def test_an_attitude_is_captured_with_the_control_that_has_it(
    control: ControlName, channel: str
) -> None:
    gains = {"wheel": (120.0, 60.0, 20.0), "pedals": (1500.0, 1500.0, 300.0)}[control]
    proportional, rate, integral = gains
    pilot = Attitude(
        change_rad=0.1,
        gain_N_per_rad=proportional,
        rate_gain_N_s_per_rad=rate,
        integral_gain_N_per_rad_s=integral,
    )
    rig = smooth_rig("737", control)
    record = fly(Manoeuvre(rig, {control: pilot}, 40.0)).data
    names = motion_channels(list(rig.controls), flown=True)
    angle = record[:, names.index(channel) - len(names)]
    moved = np.unwrap(angle) - angle[0]
    assert moved[-200:].mean() == pytest.approx(0.1, abs=0.02)
    assert np.ptp(moved[-200:]) < 0.02


def smooth_rig(name: str, control: ControlName) -> Rig:
    dry = ("friction_N", "breakaway_N", "breakout_N")
    rig = read_rig(shipped_rigs()[name])
    return rig.changed({f"controls.{control}.loader.{key}": 0.0 for key in dry})


@pytest.mark.parametrize("element", [0.3 * np.exp(-2.9j), 7.0 * np.exp(-1.3j), np.exp(2.6j)])
@pytest.mark.parametrize("integral", [0.0, 0.2])
def test_gain_and_lead_or_lag_meet_frequency_and_margin(element: complex, integral: float) -> None:
    found = adapt(element, 2.0, 0.7, integral, 1 / 60)
    assert isinstance(found, Compensation)
    assert min(found.lead_s, found.lag_s) == 0.0
    loop = element * compensation_response(found, 1 / 60, 2.0)
    assert loop == pytest.approx(np.exp(1j * (0.7 - np.pi)), abs=1e-9)


def test_compensation_and_delay_do_what_they_say_at_a_frequency() -> None:
    h, rate = 1 / 100, 3.0
    pilot = Compensation(2.0, 0.4, 0.0, 0.0)
    acting, late = CompensationFilter(pilot, h), Delay(0.123, h)
    wave = np.sin(rate * h * np.arange(4000))
    out = np.array([acting(late(float(value))) for value in wave])
    t = h * np.arange(4000)[-2000:]
    basis = np.column_stack((np.sin(rate * t), np.cos(rate * t)))
    a, b = np.linalg.lstsq(basis, out[-2000:], rcond=None)[0]
    expected = compensation_response(pilot, h, rate) * delay_response(0.123, h, rate)
    assert a + 1j * b == pytest.approx(expected, rel=1e-6)
    assert np.angle(delay_response(0.123, h, rate)) == pytest.approx(-0.369, rel=1e-3)


def test_a_stiffer_feel_or_arm_gives_the_pilot_less(tmp_path: Path) -> None:
    """The muscle's command works on feel and arm in parallel, and the bend gives the arm way."""
    steady = "crossover_rad_per_s = 2.0\nchange_rad = 0.01"
    peaks = {}
    for arm in (0.0, 4000.0):
        flown = manoeuvre(tmp_path, f"{steady}\narm_stiffness_N_per_m = {arm}")
        rigid = fly(flown.configured("rigid"))["pitch_rad"]
        bent = fly(flown.configured("uncompensated"))["pitch_rad"]
        peaks[arm] = float(np.ptp(bent) / np.ptp(rigid))
    assert peaks[0.0] == pytest.approx(1.0, abs=0.01)  # a hand that only pushes loses nothing
    assert peaks[4000.0] < 0.98


def test_strength_is_limited_and_does_not_last(tmp_path: Path) -> None:
    limits = "force_limit_N = 40.0\nlasting_force_N = 15.0\nendurance_s = 2.0"
    far = f"crossover_rad_per_s = 2.0\nchange_rad = 0.8\nintegral_rad_per_s = 0.5\n{limits}"
    record = fly(manoeuvre(tmp_path, far, duration=5.0))
    force, t = np.abs(record["column_force_N"]), record.time_s
    assert force.max() == pytest.approx(40.0, abs=1e-9)
    full = np.flatnonzero(force > 39.999)
    assert t[full[-1]] - t[full[0]] == pytest.approx(2.0, abs=0.1)
    assert force[full[-1] + 2] == pytest.approx(15.0, abs=1e-9)


def test_the_remnant_comes_from_the_seed_and_has_its_size(tmp_path: Path) -> None:
    noise = Remnant(0.01, 0.1, 0.01, 1)
    made = np.array([noise(1.0) for _ in range(200_000)])
    # Covariance π·ρ through a lag τ: variance π·ρ/(2τ).
    assert np.std(made[2000:]) == pytest.approx(np.sqrt(np.pi * 0.01 / 0.2), rel=0.05)
    pilot = "crossover_rad_per_s = 2.0\nchange_rad = 0.02\nremnant = 0.01"
    one, two = (fly(manoeuvre(tmp_path, pilot))["column_force_N"] for _ in range(2))
    quiet = fly(manoeuvre(tmp_path, pilot.replace("0.01", "0.0")))["column_force_N"]
    assert np.array_equal(one, two)
    assert not np.array_equal(one, quiet)


def test_far_above_the_short_period_pitch_falls_by_four_an_octave() -> None:
    flown = read_run("worst-case-t37")[0]
    assert flown.rig.flight is not None
    slow, fast = (
        elevator_response(flown.rig.flight, 1 / 120, ("column",), flown.rig_file, rate).pitch
        for rate in (25.0, 50.0)
    )
    assert abs(slow / fast) == pytest.approx(4.0, rel=0.1)


@pytest.mark.parametrize(
    ("pilot", "key", "says"),
    [
        ("crossover_rad_per_s = 2.0\nchange_m_per_s = 3.0", "change_m_per_s", "no target"),
        (
            "crossover_rad_per_s = 2.0\nsine_rates_rad_per_s = [900.0]",
            "sine_rates_rad_per_s",
            "frame rate",
        ),
        ("crossover_rad_per_s = 9.0", "crossover_rad_per_s", "of lead"),
        (
            'what = "roll"\ncrossover_rad_per_s = 1.0',
            "what",
            "roll is not followed with the column",
        ),
        (
            "crossover_rad_per_s = 2.0\nroll_crossover_rad_per_s = 1.0",
            "roll_crossover_rad_per_s",
            "is not used for pitch",
        ),
        (
            "crossover_rad_per_s = 2.0\narm_stiffness_N_per_rad = 9.0",
            "arm_stiffness_N_per_rad",
            "unit",
        ),
        ("crossover = 2.0", "crossover", "crossover_rad_per_s"),
    ],
)
def test_a_pilot_who_cannot_be_is_refused(tmp_path: Path, pilot: str, key: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        fly(manoeuvre(tmp_path, pilot))
    assert f"pilot.column.{key}" in str(caught.value)
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "pilot",
    [
        Step(force_N=9.0, start_s=3.0),
        Ramp(force_N=9.0, ramp_s=1.0, start_s=3.0),
        Doublet(force_N=9.0, half_period_s=1.0, start_s=3.0),
        ThreeTwoOneOne(force_N=9.0, unit_s=1.0, start_s=3.0),
        FrequencySweep(force_N=9.0, duration_s=1.0, start_s=3.0),
        Clamp(deflection_m=0.01, start_s=3.0),
        ForceTable(time_s=[1.0, 2.0], force_N=[0.0, 9.0], start_s=2.0),
        Attitude(gain_N_per_rad=9.0, start_s=3.0),
        Track(crossover_rad_per_s=1.5, start_s=3.0),
    ],
)
def test_a_pilot_who_begins_after_the_end_is_refused(pilot: Pilot) -> None:
    with pytest.raises(InputError, match=r"start_s: is 3; give less than duration_s = 3") as error:
        coupled.fly("report-column", column=pilot, duration_s=3.0)
    assert error.value.key == "pilot.column.start_s"
