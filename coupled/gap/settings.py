"""The settings of a rig: numbers that may be off within a tolerance without being an effect.

A pot is set, and a servo tuned, to a per cent or two. Where a nominal rig was fitted to records of
the machine (`nominal`), its file holds how well each number is known, and that is its tolerance.
"""

from __future__ import annotations

from coupled.gap.effect import Effect, Parameter, Signature, setting_of
from coupled.gap.library import EFFECTS
from coupled.gap.thresholds import YIELDS_m, YIELDS_rad
from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig

CONTACT = "loader.friction_stiffness_N_per_{d}"
YIELDING = "friction_stiffness"


def settings(rig: Rig, control: ControlName) -> dict[str, Effect]:
    """Return {the effect that frees the same number: the setting, free within its tolerance}."""
    known = ((effect, _ends(effect, rig, control)) for effect in EFFECTS)
    found = {effect.name: setting_of(effect, *ends) for effect, ends in known if ends is not None}
    return found | _yielding(rig, control)


def _yielding(rig: Rig, control: ControlName) -> dict[str, Effect]:
    """Return the stiffness of the contact of a filed friction, where the file does not say it.

    All dry friction yields before it slips, by up to half a millimetre: how far is no effect.
    """
    loader = rig.controls[control].loader
    if loader.friction == 0.0 or loader.friction_stiffness > 0.0:
        return {}
    least = loader.friction / (YIELDS_rad if unit_of(control) == "rad" else YIELDS_m)
    number = Parameter("", CONTACT, "value", least, 1e4 * least, (10.0 * least,))
    return {YIELDING: Effect(f"setting of {YIELDING}", "loader", (number,), Signature("", ""))}


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
