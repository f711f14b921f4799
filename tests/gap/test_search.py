"""What a search works on: noise as known by other rigs, and where its fits start."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.beam import search_sets
from coupled.gap.search.case import Case
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Output
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig
from tests.support.rigs import bench

FRAMES = 2400


def output(stage: str, gap: float) -> Output:
    """Return an output of a gap that no rig changes."""
    noise = np.random.default_rng(len(stage)).normal(0.0, gap, FRAMES)
    return Output(stage, stage, noise, lambda rig: np.zeros(FRAMES), 1.0, 120.0)


@pytest.mark.parametrize(("changed", "left"), [("flight", 1.0), ("controls", 1.4)])
def test_what_a_surface_stands_off_may_be_where_another_aircraft_trims(
    changed: str, left: float
) -> None:
    """A blind aircraft (seed 501) of 1.17 of the stiffness in pitch had a rigging offset beside."""
    rig = nominal_rig(True)
    keys = {"flight": "flight.pitch_stiffness", "controls": "controls.column.loader.mass_kg"}
    other = rig.changed({keys[changed]: 1.17})
    standing, held = output("surface", 1.4), output("surface", 1.0)
    case = Case(rig, "column", [standing], outputs_with_noise_of=lambda one: [held])
    assert case.gaps(other)["surface"] == pytest.approx(left, rel=0.05)
    assert case.gaps(rig)["surface"] == pytest.approx(1.4, rel=0.05)


@pytest.mark.parametrize(("quiet", "floor"), [(0.3, 0.5), (0.45, 1.0)])
def test_noise_is_the_least_that_a_rig_leaves(quiet: float, floor: float) -> None:
    """Noise of 1 by a rig with a gap, of which 0.87 is its input's: its own part is 0.5."""
    rig: Rig = bench({})
    first = replace(output("linkage", 2.0), smoothed=0.75**0.5)
    ours = math.hypot(quiet, 0.4)
    anew = replace(first, floor=ours, smoothed=0.4 / ours)
    case = Case(rig, "column", [first], outputs_with_noise_of=lambda other: [anew])
    assert first.own == pytest.approx(0.5)
    assert anew.own == pytest.approx(quiet)
    again = case.with_lower_noise(rig)
    assert (again or case).outputs[0].floor == pytest.approx(floor)
    assert again is None or again.gaps(rig)["linkage"] == pytest.approx(2.0 / floor, rel=0.05)


def test_a_contact_is_looked_for_at_lengths_that_a_fit_does_not_come_to() -> None:
    """A control that sticks elsewhere leaves as much for any short contact: no slope leads away."""
    rig = bench({"controls.column.loader.friction_N": 6.0})
    noise = np.random.default_rng(8).normal(0.0, 1.0, FRAMES)

    def moved(one: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        stiffness = one.controls["column"].loader.friction_stiffness
        length = 6.0 / stiffness if stiffness else 0.0
        return np.full(FRAMES, 30.0 if length < 2e-4 else 1e5 * (length - 4e-4))

    case = Case(rig, "column", [Output("loader", "x", noise, moved, 1.0, 120.0)])
    found = Problem(case).fit(())
    assert found.values["setting of the contact."] == pytest.approx(4e-4, rel=0.02)


@pytest.mark.slow
def test_a_servos_dead_time_is_no_slower_servo(tmp_path: Path) -> None:
    """A servo of 0.39 times the frequency leaves 5 % of its gap of 25, within what may be left."""
    nominal = nominal_rig(False)
    late = {"servo_delay": {"delay_s": 0.02, "factor": 1.0}}
    found = diagnose(nominal, {"r.csv": made(tmp_path, nominal, late, 5)})
    assert found.verdict == "effect"
    (effect,) = found.effects
    assert effect.name == "servo_delay"
    delay = effect.parameters[0]
    assert delay.low is not None and delay.high is not None
    assert delay.low < 0.02 < delay.high


def test_a_play_with_a_stiff_contact_is_found(tmp_path: Path) -> None:
    """From softer ones a fit ended at no play at all, with a contact that stood for a bend."""
    rig, soft = nominal_rig(False), BY_NAME["soft_backlash"]
    true = {"play_{d}": 1.45e-4, "stiffness_N_per_{d}": 3.6e5}
    outputs = Reader(rig, made(tmp_path, rig, {soft.name: true}, 3), "column", surface_points)
    case = Case(rig, "column", [one for one in outputs.outputs() if one.stage == "linkage"])
    choice = search_sets(case, [soft, BY_NAME["backlash"], BY_NAME["bend"]])[1]
    assert [step.effect for step in choice.steps] == [soft]
    for p in soft.free:
        assert choice.fit.values[soft.value_key(p)] == pytest.approx(true[p.name], rel=0.2)


@pytest.mark.parametrize(
    ("force_N", "width_N"), [(8.0, 2.0), pytest.param(45.0, 20.0, marks=pytest.mark.slow)]
)
def test_a_bend_with_hysteresis_is_sought_at_widths_of_their_own(
    tmp_path: Path, force_N: float, width_N: float
) -> None:
    """Scanned with the bend, a width of 3.7 N began at 250 N, ended at 0, and a mode was named."""
    rig, loop = nominal_rig(False), BY_NAME["bend_hysteresis"]
    true = {"bend_{d}_per_N": 6e-5, "share": 0.5, "width_N": width_N}
    record = made(tmp_path, rig, {loop.name: true}, 12, force_N)
    outputs = Reader(rig, record, "column", surface_points).outputs()
    case = Case(rig, "column", [one for one in outputs if one.stage == "linkage"])
    found = search_sets(case, [loop])[1].fit
    assert found.values["bend_hysteresis.width_N"] == pytest.approx(width_N, rel=0.3)
    assert found.values["bend_hysteresis.share"] == pytest.approx(0.5, abs=0.1)
