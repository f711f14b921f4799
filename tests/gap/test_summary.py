"""The sentences of a diagnosis: what they say follows from its numbers."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coupled.gap.findings.budget import ChannelShrink, Share, Shrink, StageBudget
from coupled.gap.findings.result import (
    EffectResult,
    Findings,
    ParameterEstimate,
    StageResult,
    Verdict,
)
from coupled.gap.findings.summary import changed, closes, in_time, summary
from coupled.gap.search.course import Bounds, Course

FRICTION = EffectResult(
    "coulomb_friction",
    "loader",
    0.3,
    (ParameterEstimate("friction_N", 4.0, 3.0, 5.0, "loader.friction_N", "N", 0.0, 4.0, 3.0, 5.0),),
)
LOADER = StageResult("loader", 400.0, 400.0, 1.2, 1.1, guilty=True)


def share(name: str, value: float) -> Share:
    return Share(name, value, value, value)


def said(verdict: Verdict, left: float, explained: float, *effects: EffectResult) -> str:
    shares = tuple(share(effect.name, explained / len(effects)) for effect in effects)
    noise = 1.0 / 400.0**2
    rest = share("unexplained", 1.0 - noise - explained)
    budget = StageBudget("loader", shares, rest, share("noise", noise))
    stage = replace(LOADER, left=left)
    found = Findings("column", verdict, (stage,), effects, (), (), (budget,) if effects else ())
    return summary(
        found, Shrink(ChannelShrink("column_computed_m", 1.0, 0.1, 0.1, 4), ()), "", "", ""
    )


def test_the_first_sentence_of_an_unexplained_gap_has_the_shares_of_its_effects() -> None:
    text = said("unexplained", 5.0, 0.995, FRICTION)
    assert "Coulomb friction, 0 → 4 N (+4), would explain 99.5 %" in text
    assert "no effect of the library explains" not in text
    sure = said("unexplained", 300.0, 0.4, replace(FRICTION, probability=0.8))
    assert "The certain effects explain less than half of the gap." in sure


def test_an_unexplained_gap_begins_with_the_doubt_about_its_effects() -> None:
    """The first words named an effect of probability 0.00 as what explains the gap."""
    begins = "A gap in the loader without a certain cause: "
    text = said("unexplained", 5.0, 0.995, replace(FRICTION, probability=0.0))
    assert text.startswith(f"{begins}the effect has a probability of 0.00. Coulomb friction")
    two = said("unexplained", 5.0, 0.995, FRICTION, OFFSET)
    assert two.startswith(f"{begins}no effect has more than a probability of 0.30.")
    assert " explains " not in text + two


def test_a_gap_without_effects_is_said_to_have_none() -> None:
    text = said("unexplained", 400.0, 0.0)
    assert text.startswith("A gap in the loader that no effect of the library explains.")


@pytest.mark.parametrize(("left", "noise"), [(1.1, True), (7.8, False)])
def test_what_remains_is_noise_only_within_the_limit_of_noise(left: float, noise: bool) -> None:
    text = said("effect", left, 0.999, replace(FRICTION, probability=0.9))
    assert ("the remaining residual is noise" in text) is noise
    assert ("7.8 times the noise floor" in text) is not noise


@pytest.mark.parametrize(
    ("low", "stretches", "ends"),
    [(0.7, 2, "too few stretches for an interval"), (0.5, 2, "50 to 70 %"), (0.7, 9, "70 to 70 %")],
)
def test_one_stretch_is_no_interval(low: float, stretches: int, ends: str) -> None:
    channel = ChannelShrink("x_m", 1.0, 0.37, 0.1, stretches, 0.7, low, 0.7, stretches > 8)
    assert ends in closes(Shrink(channel, ()))


OFFSET = replace(
    FRICTION, name="force_offset", parameters=(replace(FRICTION.parameters[0], unit="Nm"),)
)


def text_of(
    budget: StageBudget, *effects: EffectResult, rivals: tuple[tuple[str, ...], ...] = ()
) -> str:
    found = Findings("column", "mostly", (LOADER,), effects, rivals, (), (budget,))
    shrink = Shrink(ChannelShrink("column_computed_m", 1.0, 0.1, 0.1, 4), ())
    return summary(found, shrink, "", "", "")


def test_an_effect_that_acts_only_beside_another_has_no_share_of_its_own() -> None:
    """Shapley's share of one may be negative, and that of the other over 100 %."""
    shares = (share("coulomb_friction", 1.08), share("force_offset", -0.18))
    budget = StageBudget("loader", shares, share("unexplained", 0.1), share("noise", 0.0))
    text = text_of(budget, replace(FRICTION, probability=0.9), OFFSET)
    assert text.startswith("Coulomb friction, 0 → 4 N (+4) with force offset, 0 → 4 Nm (+4),")
    assert "explains 90 % of the loader's gap" in text
    assert "-18" not in text


def test_a_doubtful_effect_would_explain_what_it_may_not() -> None:
    """Before the sentence on the gear, a drag at 0.00 explained 100 % of the gap."""
    text = said("ambiguous", 1.1, 0.995, replace(FRICTION, probability=0.0))
    assert "would explain 99.5 %" in text
    assert " explains " not in text
    assert " explains " in said("effect", 1.1, 0.995, replace(FRICTION, probability=0.9))


def test_a_number_is_set_only_where_its_effect_is_credible() -> None:
    shares = (share("coulomb_friction", 0.8), share("force_offset", 0.1))
    budget = StageBudget("loader", shares, share("unexplained", 0.1), share("noise", 0.0))
    text = text_of(budget, replace(FRICTION, probability=0.9), OFFSET)
    assert text.count("Set ") == 1
    assert "Probabilities: coulomb friction 0.90, force offset 0.30." in text


@pytest.mark.parametrize(("probability", "numbers"), [(0.35, 2), (0.0, 1)])
def test_a_number_is_set_where_an_effect_is_credible_with_its_alternatives(
    probability: float, numbers: int
) -> None:
    """A pitch stiffness of probability 0.00 was to be set, for its alternative, in turbulence."""
    shares = (share("coulomb_friction", 0.8), share("force_offset", 0.1))
    budget = StageBudget("loader", shares, share("unexplained", 0.1), share("noise", 0.0))
    effects = replace(FRICTION, probability=0.9), replace(OFFSET, probability=probability)
    text = text_of(budget, *effects, rivals=(("force_offset", "breakout"),))
    assert text.count("Set ") == numbers


@pytest.mark.parametrize("shown_in", [("loader",), ()])
def test_a_stage_without_a_residual_of_its_own_is_not_said_to_leave_noise(
    shown_in: tuple[str, ...],
) -> None:
    """It shows in the loader, whose sentence has the same effects."""
    scale = replace(FRICTION, name="force_scale", stage="sensing", probability=0.9)
    sensing = StageResult("sensing", 10.0, guilty=True, shown_in=shown_in)
    shares = (share("force_scale", 0.8),)
    rest, noise = share("unexplained", 0.2), share("noise", 0.0)
    budgets = tuple(StageBudget(n, shares, rest, noise) for n in ("loader", "sensing"))
    stages = (replace(LOADER, left=1.1), sensing)
    found = Findings("column", "mostly", stages, (scale,), (), (), budgets)
    shrink = Shrink(ChannelShrink("column_computed_m", 1.0, 0.1, 0.1, 4), ())
    text = summary(found, shrink, "", "", "")
    assert ("of the sensing's gap; 20 % remains." in text) is not bool(shown_in)
    assert "sensing's gap; the remaining residual is noise" not in text


@pytest.mark.parametrize(
    ("rate", "words"),
    [
        ((0.001, 0.0005, 0.0015), "at 6 % a minute (3 to 9)"),
        ((-0.0793, -0.09, -0.07), "changes by more than its own size within a minute"),
        ((0.001, -0.001, 0.003), ""),
    ],
)
def test_a_rate_is_checked_before_it_is_said(rate: tuple[float, float, float], words: str) -> None:
    factor = replace(FRICTION.parameters[0], name="factor", relative=True)
    course = Course("grows", rate_per_s=Bounds(*rate))
    text = in_time(replace(FRICTION, parameters=(factor,), course=course))
    assert words in text
    assert bool(text) is bool(words)


@pytest.mark.parametrize("control", [None, "column"])
def test_a_change_is_that_of_the_rig_written(control: str | None) -> None:
    """With curves the certain effects are fitted again: friction was 15 N, then 10.85, now 18."""
    head = "controls.column." if control else ""
    friction = ParameterEstimate(
        "friction_N", 10.85, 5.0, 16.0, "loader.friction_N", "N", 15.0, 10.85
    )
    damping = ParameterEstimate(
        "factor", 1.5, 1.1, 1.9, "loader.damping_N_s_per_m", "N·s/m", 120.0, 180.0, relative=True
    )
    found = [EffectResult("friction", "loader", 0.89, (friction, damping), control=control)]
    again = {("controls", "column", "loader", "friction_N"): 18.0, ("frame_rate_Hz",): 60.0}
    assert changed(found, {}) == [
        f"{head}loader.friction_N 15 → 10.85 N (-4.15)",
        f"{head}loader.damping_N_s_per_m 120 → 180 N·s/m (+50 %)",
    ]
    assert changed(found, again)[0] == f"{head}loader.friction_N 15 → 18 N (+3)"
