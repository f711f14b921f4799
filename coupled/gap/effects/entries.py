"""The parts that the entries of the library of effects are put together from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from coupled.gap.effects.effect import Drawing, Effect, Parameter, Signature

# A pot is set, and a servo tuned, to a per cent or two: no effect, but a setting that every fit
# leaves free within that.
SETTING = 0.02


def factor(key: str, start: float, low: float = 0.1, high: float = 10.0) -> Parameter:
    """Return a factor on what the rig has."""
    return Parameter("factor", key, "factor", low, high, (start,))


def added(name: str, key: str, low: float, high: float, *starts: float) -> Parameter:
    """Return a number added to what the rig has."""
    return Parameter(name, key, "added", low, high, starts)


def value(name: str, key: str, low: float, high: float, *starts: float) -> Parameter:
    """Return a number in place of what the rig has."""
    return Parameter(name, key, "value", low, high, starts)


def limit(name: str, key: str, low: float, high: float, *starts: float) -> Parameter:
    """Return a limit: less does more."""
    return replace(value(name, key, low, high, *starts), inverse=True)


def exact(parameter: Parameter) -> Parameter:
    """Return a number that shapes another, of a law that leaves no error of its own."""
    return replace(parameter, scanned=False, model_error=0.0)


def real_bend(start: float) -> Parameter:
    """Return K of the rig as it is."""
    number = value("bend_{d}_per_N", "loader.bend_{d}_per_N", 0, 1e-2, start)
    return replace(number, scanned=False, host="K̂")


def bend_beside(start: float) -> Parameter:
    """Return K of the rig as it is, which starts from the nominal one: the effect is another's."""
    return replace(real_bend(start), above="loader.bend_{d}_per_N")


def switch(key: str, on: Any) -> Parameter:
    """Return a key that is set."""
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
    """Return an effect of one parameter; y against x is how it is drawn."""
    return Effect(name, stage, (parameter,), Signature(x, y, drawing, zoom_s))


def setting_of(
    effect: Effect, low: float, high: float, neutral: float = 1.0, wide: bool = False
) -> Effect:
    """Return the number that an effect frees as a setting, free between two values.

    A `wide` one is fitted to all outputs in which it shows, which are then fitted together.
    """
    (number,) = effect.parameters
    within = replace(number, low=low, high=high, starts=(neutral,), tolerance=0.0)
    name, shown = f"setting of {effect.name}", effect.shows_in[: None if wide else 1]
    return replace(effect, name=name, parameters=(within,), outputs=shown)
