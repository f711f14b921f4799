"""Constructors of effects and parameters for the library of effects."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from coupled.gap.effects.effect import Drawing, Effect, Parameter, Signature

# A potentiometer is set, and a servo tuned, to 1 or 2 %: within this tolerance the value is a
# nuisance parameter, and no effect.
SETTING = 0.02


def factor(key: str, start: float, low: float = 0.1, high: float = 10.0) -> Parameter:
    """Return a factor on the rig's value."""
    return Parameter("factor", key, "factor", low, high, (start,))


def added(name: str, key: str, low: float, high: float, *starts: float) -> Parameter:
    """Return a parameter that is added to the rig's value."""
    return Parameter(name, key, "added", low, high, starts)


def value(name: str, key: str, low: float, high: float, *starts: float) -> Parameter:
    """Return a parameter that replaces the rig's value."""
    return Parameter(name, key, "value", low, high, starts)


def limit(name: str, key: str, low: float, high: float, *starts: float) -> Parameter:
    """Return a limit: a smaller value has a larger effect."""
    return replace(value(name, key, low, high, *starts), inverse=True)


def exact(parameter: Parameter) -> Parameter:
    """Return a shape parameter without model error."""
    return replace(parameter, scanned=False, model_error=0.0)


def real_bend(start: float) -> Parameter:
    """Return the actual bend coefficient K."""
    number = value("bend_{d}_per_N", "loader.bend_{d}_per_N", 0, 1e-2, start)
    return replace(number, scanned=False, host="K̂")


def bend_beside(start: float) -> Parameter:
    """Return the actual bend coefficient K of another effect; it starts at the nominal value."""
    return replace(real_bend(start), above="loader.bend_{d}_per_N")


def switch(key: str, on: Any) -> Parameter:
    """Return a parameter without a value, which sets a key."""
    return Parameter("", key, "switch", on=on)


def one(
    stage: str,
    name: str,
    parameter: Parameter,
    x: str,
    y: str,
    drawing: Drawing = "law",
    zoom_s: float = 2.5,
) -> Effect:
    """Return an effect of one parameter, drawn as y against x."""
    return Effect(name, stage, (parameter,), Signature(x, y, drawing, zoom_s))


def setting_of(
    effect: Effect, low: float, high: float, neutral: float = 1.0, every_output: bool = False
) -> Effect:
    """Return an effect's parameter as a nuisance parameter between two values.

    It is fitted to the first output in which the effect shows, or to all of them if `every_output`.
    """
    (number,) = effect.parameters
    within = replace(number, low=low, high=high, starts=(neutral,), tolerance=0.0)
    name, shown = f"setting of {effect.name}", effect.shows_in[: None if every_output else 1]
    return replace(effect, name=name, parameters=(within,), outputs=shown)
