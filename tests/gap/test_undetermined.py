"""Intervals that contain the neutral value, and numbers at a bound."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.answer import effects_of, has_size
from coupled.gap.findings.result import ParameterEstimate
from coupled.gap.search.case import Case
from coupled.gap.search.fit import fit_alone
from coupled.gap.search.found import Choice, Fit, Found
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import CERTAIN, UNDERSTATED
from coupled.rig.rig import Rig
from tests.support.pendulum import moved_rig
from tests.support.rigs import bench

NUMBER = ParameterEstimate("x", 1.0, 0.5, 1.5, "loader.x", "N", 0.0, 1.0, 0.5, 1.5, "", False)


@pytest.mark.parametrize(
    ("name", "intervals", "sized"),
    [
        ("coulomb_friction", [(0.2, 3.0)], True),
        ("coulomb_friction", [(-0.1, 3.0)], False),
        ("coulomb_friction", [(None, 3.0)], False),
        ("gradient_error", [(0.9, 1.1)], False),
        ("gradient_error", [(1.01, 1.1)], True),
        ("asymmetric_friction", [(-1.0, 1.0), (0.2, 3.0)], True),
        ("arc_geometry", [], True),
    ],
)
def test_an_effect_has_a_size_where_an_interval_excludes_the_neutral_value(
    name: str, intervals: list[tuple[float | None, float | None]], sized: bool
) -> None:
    case, effect = Case(bench(), "column", []), BY_NAME[name]
    numbers = [replace(NUMBER, low=low, high=high) for low, high in intervals]
    assert has_size(effect, case, numbers) == sized


@pytest.mark.parametrize(
    ("name", "filed", "shape", "sized"),
    [
        ("gravity", {"gravity_N": 20.0}, [(0.08, 0.12)], True),
        ("gravity", {"gravity_N": 20.0}, [(-0.02, 0.12)], False),
        ("gravity", {}, [(0.08, 0.12)], False),
        ("relaxation", {"relaxing_stiffness_N_per_rad": 90.0}, [(2.0, 4.0)], True),
        ("presliding_friction", {"friction_N": 2.0}, [(1e3, 2e3), (0.4, 0.6)], False),
    ],
)
def test_the_shape_of_a_filed_size_may_be_the_fault(
    name: str, filed: dict[str, float], shape: list[tuple[float, float]], sized: bool
) -> None:
    """A filed weight at a wrong angle was unexplained, since the weight itself was right."""
    rig = moved_rig().changed({f"controls.wheel.loader.{k}": v for k, v in filed.items()})
    numbers = [replace(NUMBER, low=low, high=high) for low, high in [(-0.1, 0.1), *shape]]
    assert has_size(BY_NAME[name], Case(rig, "wheel", []), numbers) == sized


@pytest.mark.parametrize(
    ("name", "value", "half", "low"),
    [
        ("force_scale", 0.8, 2.0, 0.0),
        ("coulomb_friction", 1.0, 3.0, 0.0),
        ("force_offset", 1.0, 3.0, -2.0),
    ],
)
def test_the_interval_of_what_cannot_be_negative_ends_at_zero(
    name: str, value: float, half: float, low: float
) -> None:
    effect = BY_NAME[name]
    (key,) = (effect.value_key(p) for p in effect.free)
    ends = ({key: value - half / UNDERSTATED}, {key: value + half / UNDERSTATED})
    rig = bench()
    fit = Fit((effect,), {key: value}, *ends, (), rig)
    choice = Choice((Found(effect, 10.0, 0.9, ()),), fit, replace(fit, effects=()))
    (found,) = effects_of(Case(rig, "column", []), choice, [], [])
    assert found.parameters[0].low == pytest.approx(low)
    assert found.parameters[0].high == pytest.approx(value + half)
    assert found.probability < CERTAIN


def test_a_number_that_ends_at_a_bound_is_the_bound() -> None:
    """A descent ends 1e-9 of the scale beside it, which no one wants to read or to set."""
    shape = np.random.default_rng(4).normal(size=600)
    effect: Effect = BY_NAME["breakout"]

    def predict(rig: Rig) -> np.ndarray:
        return np.asarray(rig.controls["column"].loader.breakout * shape)

    output = Output("loader", "x", -shape, predict, 0.1, 120.0)
    fit = fit_alone(bench(), "column", [output], [effect])
    assert [*fit.values.values()] == [0.0]
