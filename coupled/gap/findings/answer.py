"""The verdict on all effects found, and of each its probability and estimates."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from coupled.gap.chain import stage_of
from coupled.gap.effects.effect import HOST_VALUES, Effect, Parameter, field_of, touched
from coupled.gap.effects.settings import contact, is_dry, settings
from coupled.gap.findings.budget import StageBudget
from coupled.gap.findings.credibility import credibility
from coupled.gap.findings.result import (
    EffectResult,
    ParameterEstimate,
    SettingResult,
    StageResult,
    Verdict,
)
from coupled.gap.noise.lines import other_side
from coupled.gap.search.case import Case
from coupled.gap.search.found import Choice, Fit, Found
from coupled.gap.search.histories import course_in
from coupled.gap.signals.output import Output, stage_gaps
from coupled.gap.stages.stages import Reader
from coupled.gap.thresholds import (
    CERTAIN,
    MOST,
    NEGLIGIBLE,
    NORMAL_95,
    STATED_MOST,
    SURE,
    UNDERSTATED,
    VERY_STRONG,
)
from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig


def verdict_of(
    choice: Choice,
    stages: Sequence[StageResult],
    effects: Sequence[EffectResult],
    budget: Sequence[StageBudget],
) -> Verdict:
    """Return the verdict, from the shares of the certain effects in the faulty stages' gaps.

    An effect without alternative that is not certain counts as unexplained, since it may imitate
    a fault outside the library. `mostly`: residual structure remains, but the certain effects hold
    at least `MOST` of every faulty stage's gap, or of all gaps together. Where no structure remains
    in a stage, alternatives that are certain together hold their share as well. `ambiguous`: no set
    of effects has more than half of the probability, or an effect with alternatives is not certain;
    but not if none of these is credible and the certain effects hold that share.
    """
    faulty = [stage for stage in stages if stage.guilty]
    blamed = {step.effect.stage for step in choice.steps}
    sure = {effect.name for effect in effects if effect.probability >= CERTAIN}
    open_ones, together = doubted(choice, effects), one_is_certain(choice, effects)
    remains = any(s.name not in blamed or s.unexplained for s in faulty)
    known = {one.stage: one for one in budget}
    shares = [
        sum(known[s.name].of(name) for name in (sure if s.unexplained else together))
        if s.name in known
        else 0.0
        for s in faulty
    ]
    left, held = bool(open_ones) or remains, min(shares, default=1.0) >= MOST
    if left and not held and (open_ones or _held_together(faulty, shares) < MOST):
        return "unexplained"
    if not choice.steps:
        # A stage within a large noise floor may hide a gap.
        return "ambiguous" if any(stage.hidden is not None for stage in stages) else "no_gap"
    rivals = {step.effect.name for step in choice.steps if step.rivals}
    open_rivals = rivals - sure if choice.probability > MOST else rivals
    if open_rivals and not (held and sure and rivals <= incredible(choice, effects)):
        return "ambiguous"
    return "mostly" if left or open_rivals else "effect"


def doubted(choice: Choice, effects: Sequence[EffectResult]) -> frozenset[str]:
    """Return the effects without alternative whose probability is below `CERTAIN`."""
    alone = {step.effect.name for step in choice.steps if not step.rivals}
    return frozenset(e.name for e in effects if e.name in alone and e.probability < CERTAIN)


def one_is_certain(choice: Choice, effects: Sequence[EffectResult]) -> frozenset[str]:
    """Return the effects that are certain, alone or together with their alternatives."""
    return frozenset(effect.name for effect in effects) - incredible(choice, effects)


def incredible(choice: Choice, effects: Sequence[EffectResult]) -> frozenset[str]:
    """Return the effects that are not certain even if all alternatives are the same fault."""
    all_of = {step.effect.name: 1 + len(step.rivals) for step in choice.steps}
    return frozenset(e.name for e in effects if e.probability * all_of[e.name] < CERTAIN)


def _held_together(stages: Sequence[StageResult], shares: Sequence[float]) -> float:
    """Return the share that the effects explain of the gaps of all faulty stages together.

    A gap is weighted by its logarithm, since noise floors have no common unit. A stage without an
    output has the gap of its neighbours with the filed rig.
    """
    sizes = [math.log(max(stage.settled or stage.gap or 1.0, 1.0)) for stage in stages]
    held = sum(size * min(share, 1.0) for size, share in zip(sizes, shares, strict=True))
    return held / max(sum(sizes), 1e-300)


def settings_of(
    choice: Choice, rig: Rig, control: ControlName, outputs: Sequence[Output]
) -> tuple[SettingResult, ...]:
    """Return the fitted nuisance parameters, each as a factor on its filed value, or as a delay.

    Without effects they are within their tolerance, as in the judgement of the stages.
    """
    fit = choice.fit if choice.steps else choice.without_effects
    found = []
    for setting in settings(rig, control, outputs).values():
        for p in setting.free:
            key = setting.value_key(p)
            if key in fit.values and p.key.endswith("_stamp_s"):
                name, shown = field_of(rig, control, p.key), stage_of(setting.shows_in[0])
                found.append(SettingResult(name, shown, late_s=fit.values[key]))
            elif key in fit.values and (filed := p.nominal(rig, control)):
                factor = float(p.entered(filed, fit.values[key]) / filed)
                found.append(SettingResult(field_of(rig, control, p.key), setting.stage, factor))
    length = next((one.value_key(one.free[0]) for one in contact(rig, control)), "")
    if is_dry(rig, control) and length in fit.values:
        name = f"friction_yields_{unit_of(control)}"
        found.append(SettingResult(name, "loader", yields=fit.values[length]))
    return tuple(found)


def effects_of(
    case: Case, choice: Choice, readers: Sequence[Reader], stages: Sequence[StageResult]
) -> tuple[EffectResult, ...]:
    """Return the effects found, the largest log-likelihood gain first.

    The probability of an effect falls with its credibility. It is at most `STATED_MOST`, the share
    of correct effects among the most probable ones, and just below `CERTAIN` if the interval of its
    size contains the neutral value. If values cannot be separated, each interval may contain it,
    although they are not all neutral: then the evidence decides.
    """
    by_name = {stage.name: stage for stage in stages}
    records = [reader.record for reader in readers]

    def remains(effect: Effect) -> float:
        others = [other for other in choice.fit.effects if other is not effect]
        without = stage_gaps(touched(case.outputs, [effect]), case.with_only(choice.fit, others))
        judged = ((by_name.get(stage_of(output)), gap) for output, gap in without.items())
        return max((stage.remainder(gap) for stage, gap in judged if stage), default=0.0)

    def result(step: Found) -> EffectResult:
        effect = step.effect
        known = credibility(effect, case, choice.fit, records, remains(effect))
        scatter = 0.0  # relative sampling error of a random quantity, over all records
        if effect.sampled is not None:
            errors = [effect.sampled.error(reader.rig, reader.record) for reader in readers]
            scatter = float(np.sqrt(np.sum(np.square(errors)))) / len(errors)
        numbers = tuple(estimate(choice.fit, effect, p, case, scatter) for p in effect.free)
        together = sum(p.has_neutral for p in effect.free) > 1 and step.gain > VERY_STRONG
        sized = together or has_size(effect, case, numbers)
        most = STATED_MOST if sized else (CERTAIN - NEGLIGIBLE)
        probability = min(step.probability * SURE * known.value, most)
        course = course_in(effect, case, choice.fit, records)
        name, stage = effect.name, effect.stage
        return EffectResult(name, stage, probability, numbers, known, course, effect.of)

    return tuple(result(step) for step in sorted(choice.steps, key=lambda s: -s.gain))


def has_size(effect: Effect, case: Case, numbers: Sequence[ParameterEstimate]) -> bool:
    """Tell whether a value of an effect differs from its neutral value; a limit always does."""
    sizes = effect.deviating(case.nominal, case.control)
    for p, one in zip(effect.free, numbers, strict=True):
        if p not in sizes:
            continue
        none, low, high = p.neutral(case.nominal, case.control), one.low, one.high
        if p.is_limit or not (low is None or low <= none) or not (high is None or none <= high):
            return True
    return not sizes


def estimate(
    fit: Fit, effect: Effect, p: Parameter, case: Case, scatter: float
) -> ParameterEstimate:
    """Return a fitted parameter with its interval, cut at the values that a rig file accepts.

    `scatter` is the relative sampling error of a random quantity, else 0.
    """
    key = effect.value_key(p)
    value = fit.values[key]
    # The covariance includes noise and misfit, but not that the fit may stop off the optimum.
    low = value - UNDERSTATED * (value - fit.low[key])
    high = value + UNDERSTATED * (fit.high[key] - value)
    if scatter > 0.0:  # sampling error of a random quantity, which is positive: a factor
        times = math.exp(NORMAL_95 * scatter)
        low = max(value - math.hypot(value - low, value - value / times), p.low)
        high = value + math.hypot(high - value, times * value - value)
    twin = other_side(value, case.nominal.frame_rate) if p.kind == "aliased" else None
    if twin is not None:  # aliased: the tone may lie on either side of the Nyquist frequency
        low, high = min(low, twin - (value - low)), max(high, twin + (high - value))
    least, most = p.accepted(case.nominal, case.control)
    low = max(low, min(least, value)) if math.isfinite(low) else low
    high = min(high, max(most, value)) if math.isfinite(high) else high
    ends = (low if math.isfinite(low) else None, high if math.isfinite(high) else None)
    filed = float(p.nominal(case.nominal, case.control))
    found_low, found_high = (None if one is None else float(p.entered(filed, one)) for one in ends)
    held = case.nominal.controls.get(case.control)
    hosted = held is not None and (held.compensation.deflection or held.compensation.gradient)
    return ParameterEstimate(
        name=p.named(case.control),
        value=value,
        low=ends[0],
        high=ends[1],
        key=p.key_on(case.control),
        unit=p.unit(case.nominal, case.control),
        filed=None if p.is_limit and filed == 0.0 else filed,
        found=float(p.entered(filed, value)),
        found_low=found_low,
        found_high=found_high,
        host=HOST_VALUES.get(p.key, "") if hosted else "",
        relative=p.mode == "factor",
    )
