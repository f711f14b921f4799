"""A varied key as a label for people."""

from __future__ import annotations


def parameter_label(key: str) -> str:
    """Return a readable key: `column loader bend, m/N` for that of a rig."""
    parts = key.split(".")
    last, unit = _unit(parts[-1])
    passed = ("rig", "controls", "flight", "properties", "event")
    name = " ".join([part for part in parts[:-1] if part not in passed] + [last.replace("_", " ")])
    return f"{name}, {unit}" if unit else name


def _unit(word: str) -> tuple[str, str]:
    """Return a key's name and its unit, which follows the first part that is a unit."""
    parts = word.split("_")
    units = ("m", "rad", "s", "N", "Pa", "kg", "Hz", "V", "bits", "norm", "J")
    for i, part in enumerate(parts[1:], 1):
        if part == "per":
            return "_".join(parts[:i]), "1/" + "·".join(parts[i + 1 :])
        if part in units:
            unit = " ".join(parts[i:]).replace(" per ", "/").replace(" ", "·")
            return "_".join(parts[:i]), "of travel" if unit == "norm" else unit
    return word, ""
