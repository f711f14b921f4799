"""True shares of the effects in the residual power, and effects that are the same law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from coupled.blind.trials.deck import read_deck
from coupled.blind.trials.make import Numbers, make_one
from coupled.blind.trials.readings import same_law
from coupled.blind.trials.shares import (
    effects_shown,
    judged_outputs,
    share_power,
    shares_of_outputs,
)
from coupled.blind.trials.trial import Plan, draw_trial, plans
from coupled.blind.twin.setting import draw_setting
from coupled.gap.signals.output import Output
from tests.support.rigs import bench


def test_shares_of_two_that_add_up_and_of_two_that_overlap() -> None:
    a, b, both, none = frozenset("a"), frozenset("b"), frozenset("ab"), frozenset[str]()
    found = share_power(both, {none: 1.0, a: 4.0, b: 7.0, both: 10.0})
    assert found == pytest.approx({"a": 0.3, "b": 0.6})  # and noise a tenth
    # Together they leave what either leaves alone: they share it.
    assert share_power(both, {none: 1.0, a: 10.0, b: 10.0, both: 10.0}) == pytest.approx(
        {"a": 0.45, "b": 0.45}
    )
    # What the rig has besides, here three floors² more, is no part of the gap.
    besides = share_power(both, {none: 4.0, a: 7.0, b: 10.0, both: 13.0})
    assert besides == pytest.approx({"a": 0.3, "b": 0.6})
    # A floor taken for 1.7 times as high as the noise is says nothing of what an effect holds.
    quiet = share_power(a, {none: 0.36, a: 1.44})
    assert quiet == pytest.approx({"a": 0.75})


def test_a_stage_without_an_output_is_judged_where_its_effects_show() -> None:
    """The residual of the loader does not enter the share of the transducer's zero."""
    still = np.zeros(2400)
    noise = np.random.default_rng(1).normal(0.0, 1.0, 2400)
    outputs = [
        Output(name, name, gap * noise, lambda rig: still, 1.0, 120.0)
        for name, gap in (("loader", 3.0), ("linkage", 2.0))
    ]
    seen = judged_outputs("sensing", outputs, bench({}), frozenset(["deflection_zero"]))
    assert [output.stage for output in seen] == ["linkage"]
    both = judged_outputs("sensing", outputs, bench({}), frozenset(["force_scale"]))
    assert [output.stage for output in both] == ["loader", "linkage"]


def test_an_effect_that_only_moves_a_stage_s_input_has_no_share_of_it() -> None:
    still = np.zeros(2400)
    surface = Output("surface", "elevator_rad", still, lambda rig: still, 1.0, 120.0)
    both = frozenset(("surface_rate_limit", "viscous_damping"))
    assert effects_shown([surface], both) == {"surface_rate_limit"}
    # An effect outside the library has no outputs of its own.
    assert effects_shown([surface], frozenset(["flutter"])) == {"flutter"}
    rate, damping = frozenset(["surface_rate_limit"]), frozenset(["viscous_damping"])
    none = frozenset[str]()
    noise = np.random.default_rng(1).normal(0.0, 1.0, 2400)
    noise /= np.sqrt(np.mean(noise**2))
    sizes = {both: 4.0, damping: 2.0, rate: 3.0, none: 1.0}

    outputs = {
        had: [Output("surface", "elevator_rad", size * noise, lambda rig: still, 1.0, 120.0)]
        for had, size in sizes.items()
    }
    assert shares_of_outputs(bench({}), outputs, ["surface"], apart=True) == {
        "surface": pytest.approx({"surface_rate_limit": 12.0 / 13.0})
    }
    assert set(shares_of_outputs(bench({}), outputs, ["surface"])["surface"]) == both


def test_the_known_rig_has_the_drawn_contact_and_stamps() -> None:
    deck = read_deck(4)
    assert (deck.effects, deck.outsiders, deck.realism) == (
        read_deck(3).effects,
        read_deck(3).outsiders,
        read_deck(3).realism,
    )
    rig = deck.rigs["b747-rigid"].changed({"controls.column.loader.friction_N": 3.0})
    drawn = draw_setting(np.random.default_rng(2), rig, deck.realism)
    late = replace(drawn.conditions, force_skew_s=2e-4, motion_skew_s=3e-4)
    drawn = replace(drawn, conditions=late)
    assert drawn.known is rig  # as the first versions have it
    known = replace(drawn, built=True).known
    column, length_m = known.controls["column"], drawn.conditions.presliding_m
    assert length_m is not None
    assert column.loader.friction_stiffness == pytest.approx(3.0 / length_m)
    assert column.loader.friction_elastic_share == drawn.conditions.elastic_share
    assert column.sensing.force_stamp == 2e-4
    assert known.flight is not None
    assert known.flight.motion_stamp == 3e-4
    smooth = replace(drawn, rig=rig.changed({"controls.column.loader.friction_N": 0.0}), built=True)
    assert smooth.known.controls["column"].loader.friction_stiffness == 0.0


@pytest.mark.slow
def test_conditions_of_the_rig_take_no_share_of_an_effect() -> None:
    """Of a gap of 4.1 floors a gradient holds 0.96. By the nominal rig it was 0.47: contact and
    gradient make up for each other in part, and what the contact leaves alone was taken off whole.
    """
    for version, low, high in ((3, 0.45, 0.50), (4, 0.95, 0.97)):
        numbers = Numbers(2035, 600, 24, version)
        deck = read_deck(version)
        plan = plans(np.random.default_rng([2035, 1]), 600, deck)[114]
        _, truth, _ = make_one(numbers, 114, plan)
        assert truth.names == {"gradient_error"}
        assert low < truth.budget["loader"]["gradient_error"] < high


@pytest.mark.slow
def test_a_reading_begins_at_the_true_numbers() -> None:
    """At 120 frames a second a mode of 54 Hz equals a bend; the fit starts at the true values.

    A fit from other values ended at 3.5 Hz, where the mode fits noise.
    """
    numbers = Numbers(2035, 600, 24, 4)
    plan = plans(np.random.default_rng([2035, 1]), 600, read_deck(4))[43]
    _, truth, _ = make_one(numbers, 43, plan)
    assert truth.names == {"structural_mode"}
    assert [(one.names, one.sure) for one in truth.readings] == [(("bend",), True)]


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
        [held] = truth.budget.values()
        assert 0.0 < held[names[0]] < 1.0
