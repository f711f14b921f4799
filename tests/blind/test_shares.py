"""What each effect truly holds of a gap, and which readings of it are the same law."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.blind.trials.deck import read_deck
from coupled.blind.trials.readings import same_law
from coupled.blind.trials.shares import _judged, _shared
from coupled.blind.trials.trial import Plan, draw_trial
from coupled.gap.signals.output import Output
from tests.support.rigs import bench


def test_shares_of_two_that_add_up_and_of_two_that_overlap() -> None:
    a, b, both, none = frozenset("a"), frozenset("b"), frozenset("ab"), frozenset[str]()
    found = _shared(both, {none: 1.0, a: 4.0, b: 7.0, both: 10.0})
    assert found == pytest.approx({"a": 0.3, "b": 0.6})  # and noise a tenth
    # Together they leave what either leaves alone: they share it.
    assert _shared(both, {none: 1.0, a: 10.0, b: 10.0, both: 10.0}) == pytest.approx(
        {"a": 0.45, "b": 0.45}
    )
    # What the rig has besides, here three floors² more, is no part of the gap.
    besides = _shared(both, {none: 4.0, a: 7.0, b: 10.0, both: 13.0})
    assert besides == pytest.approx({"a": 0.3, "b": 0.6})
    # A floor taken for 1.7 times as high as the noise is says nothing of what an effect holds.
    quiet = _shared(a, {none: 0.36, a: 1.44})
    assert quiet == pytest.approx({"a": 0.75})


def test_a_stage_without_an_output_is_judged_where_its_effects_show() -> None:
    """A loader that has a gap of its own is no part of what the transducer's zero holds."""
    still = np.zeros(2400)
    noise = np.random.default_rng(1).normal(0.0, 1.0, 2400)
    outputs = [
        Output(name, name, gap * noise, lambda rig: still, 1.0, 120.0)
        for name, gap in (("loader", 3.0), ("linkage", 2.0))
    ]
    seen = _judged("sensing", outputs, bench({}), frozenset(["deflection_zero"]))
    assert [output.stage for output in seen] == ["linkage"]
    both = _judged("sensing", outputs, bench({}), frozenset(["force_scale"]))
    assert [output.stage for output in both] == ["loader", "linkage"]


def test_friction_that_yields_is_friction() -> None:
    [one] = same_law(["coulomb_friction"])
    assert one.names == ("presliding_friction",)
    assert one.sure
    [other] = same_law(["bend", "coulomb_friction"])
    assert other.names == ("bend", "presliding_friction")
    assert other.stages == ("linkage", "loader")
    assert not list(same_law(["bend", "inertia"]))
    assert not list(same_law(["digital_multiplier", "inertia"]))  # the one has no number


@pytest.mark.parametrize(
    ("pair", "whole"),
    [
        (["bend", "structural_mode"], "structural_mode"),
        (["servo_tuning", "servo_delay"], "servo_tuning"),
        (["backlash", "soft_backlash"], "soft_backlash"),
    ],
)
def test_an_effect_that_sets_the_other_s_number_too_is_both(pair: list[str], whole: str) -> None:
    """One trial held a bend of 44 μm/N and a mode with 41: the twin has one bend, the last."""
    assert [(one.names, one.sure) for one in same_law(pair)] == [((whole,), True)]


@pytest.mark.slow
def test_a_force_read_with_a_zero_is_an_offset_where_nothing_bends() -> None:
    deck = read_deck(2)
    rigid = {"bench-rigid": deck.rigs["bench-rigid"]}
    for names, other in ((["force_zero"], "force_offset"), (["inertia"], None)):
        plan = Plan("single", tuple(names))
        truth = draw_trial(np.random.default_rng(5), plan, deck, rigid).truth
        assert truth.not_distinguished == ({other} if other else set())
        [shares] = truth.budget.values()
        assert 0.0 < shares[names[0]] < 1.0
