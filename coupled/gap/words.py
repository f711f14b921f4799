"""A diagnosis in the few sentences that an engineer can repeat."""

from __future__ import annotations

import math
from typing import Any, cast

# Measured: docs/diagnosis.md.
FALSE_ALARMS = "Of 80 blind records without an effect one was blamed: under 7 % at 95 %."
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
    """Return a parameter's value in figures; of a factor as many as tell it from 1."""
    off = abs(value - 1.0)
    if name != "factor" or off >= 0.1 or off < 1e-12:
        return f"{value:.4g}"
    return f"{value:.{1 - math.floor(math.log10(off))}f}"


def in_words(diagnosis: dict[str, Any], control: str) -> str:
    """Return what is wrong, how large, how sure, how much it explains, and what to record next."""
    said = [_what(diagnosis, control)]
    said.append(_settings(diagnosis))
    if diagnosis["verdict"] == "no_gap":
        unjudged = [stage for stage, found in diagnosis["stages"].items() if "gap" not in found]
        if unjudged:
            said.append(f"Not judged: {', '.join(unjudged)}.")
        said.append(FALSE_ALARMS)
    else:
        said += [_since(diagnosis), _sure(diagnosis), _closes(diagnosis)]
    said.append(diagnosis.get("next_test", ""))
    return " ".join(sentence for sentence in said if sentence)


def _guilty(diagnosis: dict[str, Any]) -> list[str]:
    return [stage for stage, found in diagnosis["stages"].items() if found.get("guilty")]


def _what(diagnosis: dict[str, Any], control: str) -> str:
    named = "; ".join(_one_in_words(effect) for effect in diagnosis["effects"])
    if diagnosis["verdict"] == "no_gap":
        within = "every stage that could be judged stays within its noise"
        return f"No gap in the {control}: {within}."
    where = ", ".join(_guilty(diagnosis))
    if diagnosis["verdict"] == "unexplained":
        also = f" Found nevertheless: {named}." if named else ""
        return f"A gap in the {where} that no effect of the library explains.{also}"
    return f"The gap lies in the {where}: {named}."


def _settings(diagnosis: dict[str, Any]) -> str:
    """Return what widens a stage that nothing else does: a number off within its setting."""
    said = []
    for stage, names in (("loader", ("mass", "damping")), ("linkage", ("servo_frequency",))):
        found = diagnosis["stages"].get(stage, {})
        if found.get("guilty") or found.get("gap", 0.0) <= found.get("limit", 0.0):
            continue
        off = {name: diagnosis["settings"][name] for name in names if name in diagnosis["settings"]}
        told = [f"{name.replace('_', ' ')} {100 * (v - 1):+.1f} %" for name, v in off.items()]
        if told:
            said.append(
                f"The {stage} stands at {found['gap']:.3g} floors by its settings,"
                f" {' and '.join(told)}: within what they are set to."
            )
    return " ".join(said)


def _since(diagnosis: dict[str, Any]) -> str:
    """Return since when, and for what is not explained, what it follows."""
    said = []
    for stage in _guilty(diagnosis):
        found = diagnosis["stages"][stage].get("where")
        if found is None:
            continue
        if found.get("onset_s", 0.0) > 5.0:
            said.append(f"In the {stage} it is first seen at {found['onset_s']:.1f} s.")
        left = diagnosis["stages"][stage].get("remains")
        if left is not None:
            said.append(_remains(stage, left))
    return " ".join(said)


def _remains(stage: str, left: dict[str, Any]) -> str:
    """Return what an unexplained stage's residual looks like, effects found taken off."""
    follows = ""
    if left["follows"]:
        most = left["follows"][0]
        follows = f"{100 * most['share']:.0f} % follows {_signal(most['signal'])}, and "
    share = round(100 * left["free_share"])
    of = "the stage's own signals" if left["free_in"] == "all" else _signal(left["free_in"])
    takes = f"{share} % could be some function of {of}"
    if share < 5:
        takes = "no function of the stage's signals takes any on stretches held out"
    return f"What remains in the {stage} is {left['gap']:.3g} floors: {follows}{takes}."


def _signal(name: str) -> str:
    if name == "constant":
        return "nothing: it is constant"
    base = next((known for known in OF_SIGNAL if name.startswith(known)), name)
    rest = name[len(base) :]
    kind = "the sign of " if rest.endswith("sign") else ""
    kind += "the rate of " if "_rate" in rest else ("the cube of " if "cubed" in rest else "")
    return kind + OF_SIGNAL.get(base, base)


def _sure(diagnosis: dict[str, Any]) -> str:
    if diagnosis["rivals"]:
        groups = "; ".join(
            " or ".join(name.replace("_", " ") for name in group) for group in diagnosis["rivals"]
        )
        return f"The record cannot tell {groups}."
    if diagnosis["verdict"] == "unexplained" or not diagnosis["effects"]:
        return ""
    least = min(effect["probability"] for effect in diagnosis["effects"])
    return f"Probability {least:.2f}."


def _closes(diagnosis: dict[str, Any]) -> str:
    shrink = diagnosis["shrink"]
    if "closed" not in shrink:
        return ""
    few = "" if shrink["reliable"] else ", of too few stretches to rely on"
    ends = f"{100 * shrink['low']:.0f} to {100 * shrink['high']:.0f} %{few}"
    return f"It closes {100 * shrink['closed']:.0f} % of the gap on held-out data ({ends})."


def _one_in_words(effect: dict[str, Any]) -> str:
    numbers = ", ".join(
        f"{name} {in_figures(name, found['value'])}"
        + (
            f" ({in_figures(name, found['low'])} to {in_figures(name, found['high'])})"
            if found["low"] is not None and found["high"] is not None
            else ""
        )
        for name, found in effect["parameters"].items()
    )
    name = cast(str, effect["name"]).replace("_", " ")
    return f"{name}, {numbers}" if numbers else name
