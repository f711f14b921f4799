"""An effect that is another's law in a limit is asked wherever that one was found."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import value_of
from coupled.gap.effects.library import BY_NAME, EFFECTS, ONE_LAW
from coupled.gap.search.case import Case
from coupled.gap.search.gain import Candidate
from coupled.gap.search.onelaw import same_in_a_limit
from coupled.gap.search.rivals import Found
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import RIVAL_GAIN
from coupled.rig.rig import Rig
from tests.support.gaps import made, nominal_rig
from tests.support.rigs import bench

FRAMES = 3000
FIRST, SECOND, NOISE = np.random.default_rng(8).normal(size=(3, FRAMES))
DAMPING, LAG = BY_NAME["viscous_damping"], BY_NAME["modifying_lag"]
NOMINAL = bench()


def case(apart: float, lag_s: float, factor: float = 1.0) -> Case:
    """Return the case of a lag that is a damping but for so much of another motion."""

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        loader = rig.controls["column"].loader
        damping = loader.damping / NOMINAL.controls["column"].loader.damping - 1.0
        late = -100.0 * loader.modifying_lag
        return np.asarray(10.0 * (damping * FIRST + late * (FIRST + apart * SECOND)))

    values = {"viscous_damping.factor": factor, "modifying_lag.lag_s": lag_s}
    real = NOMINAL.changed(
        {
            "controls.column.loader.modifying_lag_s": values["modifying_lag.lag_s"],
            "controls.column.loader.damping_N_s_per_m": factor
            * NOMINAL.controls["column"].loader.damping,
        }
    )
    measured = predict(real) + NOISE
    return Case(NOMINAL, "column", [Output("loader", "x", measured, predict, 1.0, 120.0)])


@pytest.mark.parametrize(
    ("apart", "lag_s", "factor", "named"),
    [
        (0.0, 0.005, 1.0, {"viscous_damping", "modifying_lag"}),
        (0.0, 0.0, 0.5, {"viscous_damping", "modifying_lag"}),
        (0.5, 0.005, 1.0, {"modifying_lag"}),
        (0.5, 0.0, 0.5, {"viscous_damping"}),
    ],
)
def test_all_of_the_record_says_which_of_two_it_is_or_leaves_both(
    apart: float, lag_s: float, factor: float, named: set[str]
) -> None:
    """Half a record named a damping, with 0.97, for a lag that no record could tell from it."""
    made_case = case(apart, lag_s, factor)
    current = made_case.fit((DAMPING,))
    step, last = same_in_a_limit(made_case, EFFECTS, current, Found(DAMPING, 50.0, 0.97, ()))
    assert {step.effect.name, *(rival.effect.name for rival in step.rivals)} == named
    assert last.effects == (step.effect,)
    assert step.probability == pytest.approx(0.5 if len(named) == 2 else 0.97, abs=0.03)


def test_of_two_that_are_one_law_the_one_that_machines_have_is_named() -> None:
    """A force felt late, where it was found as one that is stamped early."""
    delay, skew = BY_NAME["transport_delay"], BY_NAME["force_skew"]

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        late = [value_of(rig, "column", one.free[0].key) for one in (delay, skew)]
        return np.asarray(1e3 * (late[0] - late[1]) * FIRST)

    outputs = [Output("loader", "x", 5.0 * FIRST + NOISE, predict, 1.0, 120.0)]
    made_case = Case(NOMINAL, "column", outputs)
    current = made_case.fit((skew,))
    step, last = same_in_a_limit(made_case, EFFECTS, current, Found(skew, 50.0, 0.97, ()))
    assert step.effect is delay
    assert [rival.effect for rival in step.rivals] == [skew]
    assert last.values[delay.value_key(delay.free[0])] == pytest.approx(0.005, rel=0.1)


def test_a_rival_of_half_a_record_counts_once() -> None:
    """It is asked of all of the record, which has the last word."""
    made_case = case(0.5, 0.0, 0.5)
    current = made_case.fit((DAMPING,))
    rival = Candidate(49.0, LAG, made_case.fit((LAG,), "fitted"))
    before = Found(DAMPING, 50.0, 1.0 / (1.0 + np.exp(-1.0)), (rival,))
    step, _ = same_in_a_limit(made_case, EFFECTS, current, before)
    assert not step.rivals
    assert step.probability > 0.98


def test_none_is_asked_that_was_found_as_well_or_is_not_tried() -> None:
    made_case = case(0.5, 0.005, 0.8)
    both = made_case.fit((DAMPING, LAG))
    step = Found(DAMPING, 50.0, 0.97, ())
    assert same_in_a_limit(made_case, EFFECTS, both, step) == (step, both)
    alone = made_case.fit((DAMPING,))
    without = [effect for effect in EFFECTS if effect is not LAG]
    assert same_in_a_limit(made_case, without, alone, step) == (step, alone)
    other = replace(step, effect=BY_NAME["inertia"])
    assert same_in_a_limit(made_case, EFFECTS, alone, other) == (other, alone)


def test_each_pair_has_as_many_numbers() -> None:
    """Neither can bend farther than the other: what is likelier by RIVAL_GAIN is the right one."""
    assert RIVAL_GAIN > 0.0
    for one, other in ONE_LAW:
        assert len(BY_NAME[one].free) == len(BY_NAME[other].free) == 1


@pytest.mark.slow
@pytest.mark.parametrize("compensates", [False, True])
def test_a_force_felt_late_is_named_before_one_that_is_stamped_early(
    tmp_path: Path, compensates: bool
) -> None:
    """Where nothing bends they are one law, but for what the host makes of the force it read."""
    rigid = nominal_rig(False).changed(
        {
            "controls.column.loader.bend_m_per_N": 0.0,
            "controls.column.compensation.deflection": compensates,
        }
    )
    late = {"transport_delay": {"delay_s": 0.004}}
    found = diagnose(rigid, {"r.csv": made(tmp_path, rigid, late, 3)})
    assert found.effects[0].name == "transport_delay"
    assert found.effects[0].value == pytest.approx(0.004, rel=0.15)
    assert found.verdict == ("effect" if compensates else "ambiguous")
    assert found.rivals == (() if compensates else (("transport_delay", "force_skew"),))
