"""Where the fit of a contact starts: by a search that hollows do not hold."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.anew import with_contact_anew
from coupled.gap.search.case import Case
from coupled.gap.search.contact import allowing_for_contact, contact_start
from coupled.gap.search.fit import Fit
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import GUILTY_FROM, MISMATCH
from coupled.rig.rig import Rig
from tests.support.rigs import bench


@pytest.mark.parametrize("length", [2.3e-5, 1.4e-4, 5e-4])
@pytest.mark.parametrize("share", [0.0, 0.45, 0.95])
def test_a_contact_is_found_between_hollows(length: float, share: float) -> None:
    """Of a bowl with ripples, whose slopes lead from no start of a grid to its least."""

    def left(tried: float, part: float) -> float:
        far, off = math.log(tried / length), part - share
        ripples = 0.02 * (math.sin(80.0 * far) ** 2 + math.sin(60.0 * off) ** 2)
        return 1.0 + far**2 + 2.0 * off**2 + ripples

    found = contact_start(left, 5e-4, 0.95)
    assert found[0] == pytest.approx(length, rel=0.15)
    assert found[1] == pytest.approx(share, abs=0.12)
    assert left(*found) < 1.05


def test_a_contact_stays_within_its_bounds() -> None:
    assert contact_start(lambda length, share: -length - share, 5e-4, 0.95) == (5e-4, 0.95)
    assert contact_start(lambda length, share: length + share, 5e-4, 0.95) == (5e-7, 0.0)


@pytest.mark.parametrize(
    ("stage", "friction_N", "stiffness_N_per_m", "allowed"),
    [
        ("loader", 12.0, 0.0, True),
        ("loader", 12.0, 1e5, False),
        ("loader", 0.0, 0.0, False),
        ("linkage", 12.0, 0.0, False),
    ],
)
def test_how_filed_friction_yields_is_known_as_well_as_an_effects_physics(
    stage: str, friction_N: float, stiffness_N_per_m: float, allowed: bool
) -> None:
    """Where the file says how far its friction yields, no more than noise may remain."""
    key = "controls.column.loader.friction"
    rig = bench({f"{key}_N": friction_N, f"{key}_stiffness_N_per_m": stiffness_N_per_m})
    gap = Output(stage, "x", np.full(2400, 21.0), lambda rig: np.zeros(2400), 1.0, 120.0)
    found = allowing_for_contact(gap, rig, "column")
    assert found.limit == pytest.approx(1.0 + 20.0 * MISMATCH if allowed else GUILTY_FROM)


def test_a_contact_is_sought_anew_beside_what_it_was_found_without() -> None:
    """A deflection's scale was found beside a contact that had made up for it, and stayed there.

    1.6 floors were left where 1.0 can be, and a scale of the force was found in them.
    """
    nominal = bench({"friction_N": 4.0})
    true_m = 2e-4
    wave = np.sin(0.1 * np.arange(2400))
    noise = np.random.default_rng(1).normal(size=2400)

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        stiffness = rig.controls["column"].loader.friction_stiffness
        return np.asarray((3.0 * math.log(4.0 / stiffness / true_m) if stiffness else 9.0) * wave)

    case = Case(nominal, "column", [Output("loader", "x", noise, predict, 1.0, 120.0)])
    best = case.fit(())
    length = case.contact[0].value_key(case.contact[0].free[0])
    hollow = nominal.changed({"controls.column.loader.friction_stiffness_N_per_m": 4.0 / 6e-6})
    held = replace(best, rig=hollow, values={**best.values, length: 6e-6}, cost=1e6)
    assert case.gaps(held.rig)["loader"] > 2.0
    found = with_contact_anew(case, held)
    assert found.values[length] == pytest.approx(true_m, rel=0.1)
    assert case.gaps(found.rig)["loader"] < 1.1
    # Within its limit it stays as it was found, though another may leave less.
    within = replace(found, cost=1e6)
    assert with_contact_anew(case, within) is within


def test_a_breakaway_in_a_hollow_is_begun_anew_higher(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a withheld record one of 6.1 N above 3.5 N left six floors, and one of 7.8 N only 1.7."""
    nominal, law = bench({"friction_N": 0.0}), BY_NAME["stribeck_friction"]
    true_N = 4.4
    first, second = np.sin(np.outer([0.1, 0.17], np.arange(2400)))
    noise = np.random.default_rng(1).normal(size=2400)
    key = law.value_key(next(p for p in law.free if p.above))
    level = law.value_key(law.free[0])

    def predict(rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        loader = rig.controls["column"].loader
        height = (loader.breakaway or 0.0) - loader.friction
        left = min(4.0 * abs(height - true_N), 1.5 + 8.0 * abs(height - 2.6))
        return np.asarray(left * first + (loader.friction - 3.5) * second)

    case = Case(nominal, "column", [Output("loader", "x", noise, predict, 1.0, 120.0)])
    held = case.fit((law,), start={level: 3.5, key: 6.1})
    assert held.values[key] - held.values[level] == pytest.approx(2.6, abs=0.1)
    starts, fit = list[Mapping[str, float]](), Case.fit

    def seen(self: Case, effects: Sequence[Effect], start: Mapping[str, float]) -> Fit:
        starts.append(start)
        return fit(self, effects, start=start)

    monkeypatch.setattr(Case, "fit", seen)
    found = with_contact_anew(case, held)
    contact = {one.value_key(p) for one in case.contact for p in one.free}
    assert contact
    assert contact <= held.values.keys()
    assert [contact & start.keys() for start in starts] == [set(), set()]  # sought anew by both
    assert found.values[key] - found.values[level] == pytest.approx(true_N, abs=0.1)
    assert case.gaps(found.rig)["loader"] < 1.1
