"""A diagnosis in the few sentences that an engineer can repeat."""

from __future__ import annotations

import math

from coupled.gap.result import EffectResult, Findings, ParameterEstimate
from coupled.gap.shrink import Shrink
from coupled.gap.thresholds import FREE_LEAST, ONSET_s
from coupled.gap.where import Remains

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
}


def in_figures(name: str, value: float) -> str:
    """Return a parameter's value in figures; of a factor as many as distinguish it from 1."""
    off = abs(value - 1.0)
    if name != "factor" or off >= 0.1 or off < 1e-12:
        return f"{value:.4g}"
    return f"{value:.{1 - math.floor(math.log10(off))}f}"


def plain(name: str) -> str:
    """Return an effect's or a stage's name without its underscores."""
    return name.replace("_", " ")


def summary(found: Findings, shrink: Shrink, next_test: str) -> str:
    """Return what is wrong, how large, how sure, how much it explains, and what to record next."""
    said = [_what(found), _settings(found)]
    if found.verdict == "no_gap":
        said.append(_not_judged(found))
    else:
        said += [_since(found), _sure(found), _closes(shrink)]
    said.append(next_test)
    return " ".join(sentence for sentence in said if sentence)


def _not_judged(found: Findings) -> str:
    """Return the stages that were not judged, nor by the residuals of their neighbours."""
    judged = {stage.name for stage in found.stages if stage.judged}
    names = [s.name for s in found.stages if not s.judged and not judged & set(s.shown_in)]
    return f"Not judged: {', '.join(names)}." if names else ""


def _what(found: Findings) -> str:
    named = "; ".join(_effect(effect) for effect in found.effects)
    if found.verdict == "no_gap":
        within = "every stage that could be judged stays within its noise"
        return f"No gap in the {found.control}: {within}."
    where = ", ".join(found.guilty)
    if found.verdict == "unexplained":
        also = f" Found nevertheless: {named}." if named else ""
        return f"A gap in the {where} that no effect of the library explains.{also}"
    return f"The gap lies in the {where}: {named}."


def _settings(found: Findings) -> str:
    """Return what widens a stage that nothing else does: a number off within its setting."""
    said = []
    for stage in found.stages:
        if stage.guilty or stage.gap is None or stage.gap <= (stage.limit or 0.0):
            continue
        off = [
            f"{plain(setting.name)} {100 * (setting.factor - 1):+.1f} %"
            for setting in found.settings
            if setting.stage == stage.name
        ]
        if off:
            said.append(
                f"The {stage.name} stands at {stage.gap:.3g} floors by its settings,"
                f" {' and '.join(off)}: within what they are set to."
            )
    return " ".join(said)


def _since(found: Findings) -> str:
    """Return since when, and for what is not explained, what it follows."""
    said = []
    for stage in found.stages:
        if stage.where is None:
            continue
        if stage.where.onset_s is not None and stage.where.onset_s > ONSET_s:
            said.append(f"In the {stage.name} it is first seen at {stage.where.onset_s:.1f} s.")
        if stage.remains is not None:
            said.append(_remains(stage.name, stage.remains))
    return " ".join(said)


def _remains(stage: str, left: Remains) -> str:
    """Return what an unexplained stage's residual looks like, effects found taken off."""
    follows = ""
    if left.follows:
        most = left.follows[0]
        follows = f"{100 * most.share:.0f} % follows {_signal(most.signal)}, and "
    share = round(100 * left.free_share)
    of = "the stage's own signals" if left.free_in == "all" else _signal(left.free_in)
    takes = f"{share} % could be some function of {of}"
    if share < FREE_LEAST:
        takes = "no function of the stage's signals takes any on stretches held out"
    return f"What remains in the {stage} is {left.gap:.3g} floors: {follows}{takes}."


def _signal(name: str) -> str:
    if name == "constant":
        return "nothing: it is constant"
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
    if found.verdict == "unexplained" or not found.effects:
        return ""
    return f"Probability {min(effect.probability for effect in found.effects):.2f}."


def _closes(shrink: Shrink) -> str:
    most = shrink.widest
    if most.closed is None or most.low is None or most.high is None:
        return ""
    few = "" if most.reliable else ", of too few stretches to rely on"
    ends = f"{100 * most.low:.0f} to {100 * most.high:.0f} %{few}"
    return f"It closes {100 * most.closed:.0f} % of the gap on held-out data ({ends})."


def _effect(effect: EffectResult) -> str:
    numbers = ", ".join(_number(parameter) for parameter in effect.parameters)
    return f"{plain(effect.name)}, {numbers}" if numbers else plain(effect.name)


def _number(p: ParameterEstimate) -> str:
    value = f"{p.name} {in_figures(p.name, p.value)}"
    if p.low is None or p.high is None:
        return value
    return f"{value} ({in_figures(p.name, p.low)} to {in_figures(p.name, p.high)})"
