"""The summary of a diagnosis, in a few sentences."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from coupled.display import System, in_system, split_unit, unit_in
from coupled.errors import joined
from coupled.gap.chain import AIRFRAME
from coupled.gap.effects.airframe import TERM
from coupled.gap.effects.effect import Switch, dotted
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.budget import Shrink, StageBudget
from coupled.gap.findings.result import EffectResult, Findings, ParameterEstimate, StageResult
from coupled.gap.findings.where import Remains, Where
from coupled.gap.noise.lines import SeenLine
from coupled.gap.thresholds import CERTAIN, DOUBLED, MINOR

_SENTENCE = re.compile(r"(?<=\.) (?=[A-ZΑ-Ω])")
OF_SIGNAL = {
    "computed": "the deflection",
    "estimate": "the estimated deflection",
    "force": "the force",
    "gradient": "the gradient",
    "dynamic_pressure": "q̄",
    "load_factor": "the load factor",
    "time": "time",
    "elevator": "the elevator",
    "pitch_rate": "the pitch rate",
    "alpha": "the angle of attack",
    "aileron": "the aileron",
    "rudder": "the rudder",
    "roll_rate": "the roll rate",
    "yaw_rate": "the yaw rate",
    "sideslip": "the sideslip",
}


def in_figures(name: str, value: float) -> str:
    """Return a parameter's value as text; a factor with enough digits to differ from 1."""
    off = abs(value - 1.0)
    if name != "factor" or off >= 0.1 or off < 1e-12:
        return f"{value:.4g}"
    return f"{value:.{1 - math.floor(math.log10(off))}f}"


def plain(name: str) -> str:
    """Return an effect's or a stage's name without its underscores; a function keeps its own."""
    return name if name.startswith(f"{TERM} ") else name.replace("_", " ")


def filtered_words(filtered: Mapping[str, str]) -> str:
    """Return which logs were filtered, and the source of their noise floors."""
    said = []
    for source in dict.fromkeys(filtered.values()):
        names = " and ".join(name for name, one in filtered.items() if one == source)
        said.append(
            f"No noise is found in {names}, as in a filtered or resampled log:"
            f" the noise floor is {source}."
        )
    return " ".join(said)


FAST = "changes by more than its own size within a minute"


def sentences(text: str) -> list[str]:
    """Return the sentences of a summary."""
    return _SENTENCE.split(text)


NOISE = "noise"
MISFIT = "no more than the model error of the healthy machine"


def summary(
    found: Findings,
    shrink: Shrink,
    in_flight: str,
    filtered: str,
    next_test: str,
    floor: str = NOISE,
) -> str:
    """Return the faults, their sizes, probabilities and shares, and what to record next.

    `in_flight` are the words on the flight, `filtered` on filtered logs, `floor` on the residual
    of a stage without a gap: `NOISE` or `MISFIT`.
    """
    said = [_what(found, floor), _set(found), _settings(found)]
    if found.verdict == "no_gap":
        said.append(_not_judged(found))
    else:
        said += [*map(in_time, found.effects), _since(found), _sure(found)]
        said += [closes(shrink), in_flight]
    said += [filtered, next_test]
    return " ".join(sentence for sentence in said if sentence)


def _not_judged(found: Findings) -> str:
    """Return the stages that were judged neither directly nor by other stages' residuals."""
    judged = {stage.name for stage in found.stages if stage.judged}
    names = [s.name for s in found.stages if not s.judged and not judged & set(s.shown_in)]
    return f"Not judged: {', '.join(names)}." if names else ""


def _what(found: Findings, floor: str) -> str:
    if found.verdict == "no_gap":
        own = any(one.judged for one in found.stages if one.name not in (AIRFRAME, "sensing"))
        return no_gap_in([found.control if own else AIRFRAME], floor)
    hidden = [stage for stage in found.stages if stage.hidden is not None]
    if hidden and not found.guilty:
        why = "; ".join(f"the {stage.name} is not judged, as {stage.why}" for stage in hidden)
        where = AIRFRAME if all(stage.name == AIRFRAME for stage in hidden) else found.control
        return f"Whether the {where} has a gap cannot be decided: {why}."
    if found.verdict == "ambiguous" and not found.guilty:
        return (
            f"Whether the {found.control} has a gap cannot be said: the rig does not explain the"
            " healthy records, and their scatter shows no change by a tenth."
        )
    budgets = {one.stage: one for one in found.budget}
    stages = [found.stage(name) for name in found.guilty]
    acting = {stage.name: _acting(found, stage, budgets.get(stage.name)) for stage in stages}
    if not any(acting.values()) and found.verdict == "unexplained":
        return f"A gap in the {', '.join(found.guilty)} that no effect of the library explains."
    said, sure = [_uncertain(found)], {one.name for one in _certain(found)}
    for stage in sorted(stages, key=lambda one: not acting[one.name]):
        ours = acting[stage.name]
        by_others = any({*ours} <= {*acting.get(name, ())} for name in stage.shown_in)
        # A stage without an output, with the effects of its neighbours, is not described again.
        if stage.left is not None or not ours or not by_others:
            said.append(_explained(ours, stage, budgets.get(stage.name), floor, sure))
    return " ".join(sentence for sentence in said if sentence)


def _uncertain(found: Findings) -> str:
    """Return that no effect found is a certain cause of an unexplained gap."""
    most = max((effect.probability for effect in found.effects), default=1.0)
    if found.verdict != "unexplained" or most >= CERTAIN:
        return ""
    of = "the effect has" if len(found.effects) == 1 else "no effect has more than"
    where = joined(found.guilty)
    return f"A gap in the {where} without a certain cause: {of} a probability of {most:.2f}."


def no_gap_in(controls: Sequence[str], floor: str = NOISE) -> str:
    """Return the sentence on controls without a gap; one of them may be the airframe."""
    within = "stays within its noise" if floor == NOISE else f"leaves {floor}"
    return f"No gap in the {joined(controls)}: every stage that could be judged {within}."


def _acting(found: Findings, stage: StageResult, budget: StageBudget | None) -> list[EffectResult]:
    """Return the effects of a stage, and others that explain a share of its gap."""
    beside = (effect for effect in found.effects if effect.stage != stage.name)
    shown = [] if budget is None else [e for e in beside if budget.of(e.name) >= MINOR]
    return [*(effect for effect in found.effects if effect.stage == stage.name), *shown]


def _explained(
    acting: Sequence[EffectResult],
    stage: StageResult,
    budget: StageBudget | None,
    floor: str,
    sure: Collection[str],
) -> str:
    """Return the share of a stage's gap that each effect explains, and what remains.

    Effects that are not `sure` would explain it.
    """
    if budget is None:
        return f"The gap lies in the {stage.name}."
    if not acting:
        return (
            f"No effect of the library explains the {stage.name}'s residual of"
            f" {stage.gap:.3g} times its noise floor."
        )
    # The share of an effect that only acts beside others counts with the largest one.
    main = max(acting, key=lambda e: budget.of(e.name))
    beside = [e for e in acting if e is not main and budget.of(e.name) < 0.0]
    shares = []
    for effect in (e for e in acting if e not in beside):
        one = [effect, *beside] if effect is main else [effect]
        share = _per_cent(sum(budget.of(e.name) for e in one))
        words = " with ".join(_effect(e) for e in one)
        verb = "explains" if effect.name in sure else "would explain"
        shares.append(f"{words}{',' if one[-1].parameters else ''} {verb} {share}")
    said = f"{capital(' and '.join(shares))} of the {stage.name}'s gap"
    over = stage.left is not None and stage.limit is not None and stage.left > stage.limit
    if over and not stage.unexplained:
        left = f"{_per_cent(budget.remains)} remains, {stage.left:.3g} times the noise floor"
        return f"{said}; {left}, which an error of the effect's own model may cause."
    if stage.left is None and budget.remains >= MINOR:
        return f"{said}; {_per_cent(budget.remains)} remains."
    if not stage.unexplained or stage.remains is None:
        return f"{said}; the remaining residual is {floor}."
    near = stage.remains.reversals
    where = "" if near is None else f", within {1000 * near.within_s:.0f} ms of each reversal,"
    rest = f"{_per_cent(budget.remains)} remains{where}"
    return f"{said}; {rest} and no effect of the library explains it."


def _per_cent(share: float) -> str:
    """Return a share in per cent, with a decimal close to 0 or 100 %."""
    nearly = share < 0.01 or 0.99 < share < 0.9995
    return f"{100 * share:.1f} %" if nearly else f"{100 * share:.0f} %"


def capital(text: str) -> str:
    """Return a text with its first letter as a capital."""
    return text[:1].upper() + text[1:]


def _set(found: Findings) -> str:
    """Return which values to set in host and rig file; of no effect or group that is uncertain."""
    if found.verdict not in ("effect", "mostly"):
        return ""
    known = _certain(found)
    numbers = [p for effect in known for p in effect.parameters if not _is_none(p)]
    keys = [p.host or f"{dotted(p.key, found.control)} in the rig file" for p in numbers]
    found_values = [f"{figure(p.found)} {p.unit}".rstrip() for p in numbers]
    said = [f"Set {key} to {value}." for key, value in zip(keys, found_values, strict=True)]
    effects = [BY_NAME[one.name] for one in known if one.name in BY_NAME]
    for one in (p for effect in effects for p in effect.parameters if isinstance(p, Switch)):
        key = dotted(one.key_on(found.control), found.control)
        said.append(f"Set {key} in the rig file to {json.dumps(one.on)}.")
    return " ".join(said)


def _certain(found: Findings) -> list[EffectResult]:
    """Return the effects that are certain, alone or together with their alternatives."""
    alike = {group[0]: len(group) for group in found.rivals}
    return [e for e in found.effects if e.probability * alike.get(e.name, 1) >= CERTAIN]


def _settings(found: Findings) -> str:
    """Return the stages whose gap is due to parameters within their tolerance."""
    said = []
    for stage in found.stages:
        off = [one.words for one in found.settings if one.stage == stage.name and one.moved]
        if off and stage.within_settings:
            said.append(
                f"The {stage.name}'s residual is {stage.gap:.3g} times its noise floor because of"
                f" {joined(off)}, each within its tolerance: the stage is not faulty."
            )
    return " ".join(said)


def _since(found: Findings) -> str:
    """Return onset and end of the gaps, tones, and descriptions of unexplained residuals."""
    said = []
    for stage in found.stages:
        if stage.where is None:
            continue
        if not any(e.course is not None and e.course.onset_s for e in found.effects):
            said += _between(stage.name, stage.where)
        if stage.where.line is not None:
            said.append(_line(stage.where.channel, stage.where.line))
        if stage.remains is not None:
            said.append(_remains(stage.name, stage.remains, bool(found.effects)))
    return " ".join(said)


def _between(stage: str, where: Where) -> list[str]:
    """Return onset and end of a stage's gap, if it is not there all the time."""
    begins, ends = (f"{span.value:.1f} s" if span else "" for span in (where.begins, where.ends))
    if not begins and not ends:
        return []
    span = f"until {ends}" if not begins else f"from {begins} {f'to {ends}' if ends else 'on'}"
    return [f"The residual of the {stage} exceeds its noise {span}."]


def in_time(effect: EffectResult) -> str:
    """Return onset and growth of an effect; empty if it is constant."""
    course = effect.course
    if course is None or course.kind == "constant":
        return ""
    onset, rate, said = course.onset_s, course.rate_per_s, []
    if onset is not None:
        said.append(f"from {onset.value:.1f} s on ({onset.low:.1f} to {onset.high:.1f})")
    if course.kind == "from":
        p = effect.parameters[0]
        filed = p.filed or 0.0
        said.append(f"then {figure(filed + course.then * (p.found - filed))} {p.unit}".rstrip())
    share = None if rate is None else rate.times(60.0)
    if share is not None and share.low < 0.0 < share.high:
        share = None  # the records do not show whether it grows or shrinks
    if share is not None:
        first = effect.parameters[0]
        unit = " of them" if course.kind == "events" else f" {first.unit}".rstrip()
        if course.kind != "events" and (first.relative or first.name == "per_s"):
            share, unit = share.times(100.0), " %"
            if abs(share.value) > 100.0:
                return f"{capital(plain(effect.name))}: {', '.join([*said, FAST])}."
        ends = f"{share.low:.3g} to {share.high:.3g}"
        said.append(f"at {share.value:.3g}{unit} a minute ({ends})")
    return f"{capital(plain(effect.name))}: {', '.join(said)}." if said else ""


def _line(channel: str, line: SeenLine) -> str:
    """Return the amplitude and frequency of a spectral line, and its tone if it is aliased."""
    size = f"{figure(line.amplitude)} {unit_in(channel)}"
    tone = f": aliased, from a tone of {line.tone_Hz:.4g} Hz" if line.folded else ""
    return f"A spectral line of {size} is at {line.seen_Hz:.4g} Hz in {channel}{tone}."


def _remains(stage: str, left: Remains, effects: bool) -> str:
    """Return a description of the residual that remains, with the effects found if any."""
    beside = " with these effects" if effects else ""
    said = f"The residual of the {stage}{beside} is {left.gap:.3g} times its noise floor: "
    if left.follows:
        most = left.follows[0]
        follows = "is" if most.signal == "constant" else "correlates with"
        said += f"{100 * most.share:.0f} % {follows} {_signal(most.signal)}, and "
    share = round(100 * left.free_share)
    if share < 100.0 * MINOR:
        seen = "; slow noise of a sensor would look the same"
        slow = "" if left.follows or left.gap > DOUBLED else seen
        return f"{said}no function of the stage's signals predicts held-out stretches{slow}."
    of = "the stage's own signals" if left.free_in == "all" else _signal(left.free_in)
    return f"{said}{share} % could be some function of {of}."


def _signal(name: str) -> str:
    if name == "constant":
        return "its mean"
    base = next((known for known in OF_SIGNAL if name.startswith(known)), name)
    rest = name[len(base) :]
    kind = "the sign of " if rest.endswith("sign") else ""
    kind += "the rate of " if "_rate" in rest else ("the cube of " if "cubed" in rest else "")
    return kind + OF_SIGNAL.get(base, base)


def _sure(found: Findings) -> str:
    if found.rivals:
        groups = [[plain(name) for name in group] for group in found.rivals]
        pairs = "; ".join(f"{first} from {' and '.join(rest)}" for first, *rest in groups)
        return f"The record does not distinguish {pairs}."
    if not found.effects:
        return ""
    if found.verdict == "unexplained":
        few = "The certain effects explain less than half of the gap."
        return _undone(found) if _uncertain(found) else few
    each = {plain(effect.name): f"{effect.probability:.2f}" for effect in found.effects}
    if len({*each.values()}) > 1:
        return f"Probabilities: {', '.join(f'{name} {p}' for name, p in each.items())}."
    return f"Probability {min(each.values())}."


def _undone(found: Findings) -> str:
    """Return a sentence on effects that cancel each other in channels without a gap."""
    known = [(plain(e.name), e.credibility) for e in found.effects]
    names = [name for name, tests in known if tests is not None and tests.undone > 1.0]
    if len(names) < 2:
        return ""
    return f"{capital(' and '.join(names))} cancel each other in a channel that has no gap."


def closes(shrink: Shrink) -> str:
    """Return the share of the widest gap closed on held-out data, with its interval."""
    most = shrink.widest
    if most.closed is None:
        return ""
    few = "" if most.reliable else "; too few stretches to be reliable"
    ends = "too few stretches for an interval"  # or of them some without a gap
    if most.low is not None and most.high is not None:
        low, high = round(100 * most.low), round(100 * most.high)
        ends = ends if few and low == high else f"{low} to {high} %{few}"
    return f"On held-out data {100 * most.closed:.0f} % of the gap is closed ({ends})."


def _effect(effect: EffectResult) -> str:
    pairs = zip(labels(effect), effect.parameters, strict=True)
    numbers = ", ".join(f"{label} {change(p)}".lstrip() for label, p in pairs)
    return f"{plain(effect.name)}, {numbers}" if numbers else plain(effect.name)


def labels(effect: EffectResult) -> list[str]:
    """Return a label of each parameter of an effect; empty if its unit identifies it."""
    units = [p.unit for p in effect.parameters]
    return [p.name.partition("_")[0] if units.count(p.unit) > 1 else "" for p in effect.parameters]


def _is_none(p: ParameterEstimate) -> bool:
    """Tell whether a parameter is a limit that is neither filed nor reached in the records."""
    return p.filed is None and p.found_low is None and p.found_high is None


def figure(value: float) -> str:
    """Return a number of the rig in four figures; small ones as 1.95e-4."""
    if value == 0.0 or abs(value) >= 1e-3:
        return f"{value:.4g}"
    digits, _, power = f"{value:.2e}".partition("e")
    return f"{digits}e{int(power)}"


def change(p: ParameterEstimate) -> str:
    """Return a parameter as filed → found (change), with its unit."""
    unit = f" {p.unit}" if p.unit else ""
    if _is_none(p):
        return "no limit reached"
    if p.filed is None:
        return f"none → {figure(p.found)}{unit}"
    more = p.found - p.filed
    sign = "+" if more >= 0.0 else ""
    by = f"{100 * (p.value - 1.0):+.3g} %" if p.relative else sign + figure(more)
    at_least = p.found_low is not None and p.found_high is None  # as of play beyond the motion
    more_does = " or more" if at_least else ""
    return f"{figure(p.filed)} → {figure(p.found)}{unit}{more_does} ({by})"


def changed(
    effects: Iterable[EffectResult], fitted_again: Mapping[tuple[str, ...], Any]
) -> list[str]:
    """Return each parameter's key and change.

    Values `fitted_again` without the other effects, by their keys' parts, replace those found.
    """
    now = {f".{'.'.join(parts)}": value for parts, value in fitted_again.items()}
    lines = []
    for effect in effects:
        for p in effect.parameters:
            key = effect.key_of(p)
            ends = [value for at, value in now.items() if at.endswith(f".{key}")]
            stated = replace(p, found=ends[0], relative=False) if ends else p
            lines.append(f"{key} {change(stated)}")
    return lines


def in_units(parameter: ParameterEstimate, system: System) -> ParameterEstimate:
    """Return a parameter with the rig's own number in the units of a system."""
    if system == "si":
        return parameter
    unit = in_system(parameter.unit, system)

    def to(value: float | None) -> float | None:
        return None if value is None else unit.factor * value

    return replace(
        parameter,
        unit=unit.unit,
        filed=to(parameter.filed),
        found=unit.factor * parameter.found,
        found_low=to(parameter.found_low),
        found_high=to(parameter.found_high),
    )


def size_in(name: str, value: float, system: System) -> str:
    """Return a parameter's size with its name: `play_m 0.001`, in US units `play, in 0.05`."""
    stem, unit = split_unit(name)
    shown = in_system(unit, system)
    words = name if system == "si" or not unit else f"{plain(stem)}, {shown.unit}"
    return f"{words} {in_figures(name, shown.factor * value)}"


def summary_in(text: str, effects: Sequence[EffectResult], system: System) -> str:
    """Return a summary in the units of a system; what is set in a rig file stays in the file's."""
    for parameter in (p for effect in effects for p in effect.parameters):
        text = text.replace(change(parameter), change(in_units(parameter, system)))
    return text
