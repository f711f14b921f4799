"""The settings of a rig: numbers that may be off within a tolerance without being an effect.

A pot is set, and a servo tuned, to a per cent or two. Where a nominal rig was fitted to records of
the machine (`nominal`), its file holds how well each number is known, and that is its tolerance.
"""

from __future__ import annotations

from coupled.gap.effect import Effect, setting_of
from coupled.gap.library import EFFECTS
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig


def settings(rig: Rig, control: ControlName) -> dict[str, Effect]:
    """Return {the effect that frees the same number: the setting, free within its tolerance}."""
    known = ((effect, _ends(effect, rig, control)) for effect in EFFECTS)
    return {effect.name: setting_of(effect, *ends) for effect, ends in known if ends is not None}


def _ends(effect: Effect, rig: Rig, control: ControlName) -> tuple[float, float, float] | None:
    """Return the least and largest value of an effect's number as a setting, and its neutral one.

    None where it is no setting: an effect of more numbers than one shares the first with another.
    """
    if len(effect.free) != 1 or len(effect.parameters) != 1:
        return None
    (number,) = effect.free
    tolerance = effect.tolerance
    wide = rig.controls[control].tolerance.get(number.key_on(control))
    if wide is None and tolerance <= 0.0:
        return None
    neutral = number.neutral(rig, control)
    if wide is not None:
        filed = float(number.nominal(rig, control))
        if number.mode == "factor":
            tolerance = wide / abs(filed) if filed else 0.0
        else:
            tolerance = wide
            # What is filed may be taken off, but no more: friction is not negative.
            floor = number.low if number.mode == "value" else min(number.low, 0.0) - abs(filed)
            return max(neutral - tolerance, floor), neutral + tolerance, neutral
    if tolerance <= 0.0:
        return None
    return neutral - min(tolerance, 0.9), neutral + tolerance, neutral
