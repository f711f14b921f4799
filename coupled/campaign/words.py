"""A verdict's figure, bounds and margin in words, and a parameter's name."""

from __future__ import annotations

from coupled.campaign.verdict import Verdict


def wanted(verdict: Verdict) -> str:
    """Return the bounds, as `0.2 to 0.3`, `≥ 0.2` or `≤ 0.3`."""
    least, most = verdict.least, verdict.most
    if least is not None and most is not None:
        return f"{least:.4g} to {most:.4g}"
    if least is not None:
        return f"≥ {least:.4g}"
    return "" if most is None else f"≤ {most:.4g}"


def finding(verdict: Verdict) -> str:
    """Return what was found, in one line."""
    bounds = f" (wanted {wanted(verdict)})" if wanted(verdict) else ""
    if verdict.value is None or verdict.margin is None:
        return verdict.problem + bounds
    return f"{verdict.value:.6g}{bounds}, margin {verdict.margin:.3g}"


def parameter(key: str) -> str:
    """Return a key for people: `column loader bend, m/N` for that of a rig."""
    words = key.split(".")
    last, unit = _unit(words[-1])
    passed = ("rig", "controls", "flight", "properties", "event")
    name = " ".join([word for word in words[:-1] if word not in passed] + [last.replace("_", " ")])
    return f"{name}, {unit}" if unit else name


def _unit(word: str) -> tuple[str, str]:
    """Return a key's name and its unit: after the first part that is one."""
    parts = word.split("_")
    units = ("m", "rad", "s", "N", "Pa", "kg", "Hz", "V", "bits", "norm", "J")
    for i, part in enumerate(parts[1:], 1):
        if part == "per":
            return "_".join(parts[:i]), "1/" + "·".join(parts[i + 1 :])
        if part in units:
            unit = " ".join(parts[i:]).replace(" per ", "/").replace(" ", "·")
            return "_".join(parts[:i]), "of travel" if unit == "norm" else unit
    return word, ""
