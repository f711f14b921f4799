"""The settings of a rig: numbers that may be off within a tolerance without being an effect.

A pot is set, and a servo tuned, to a per cent or two. Where a nominal rig was fitted to records of
the machine (`nominal`), its file holds how well each number is known, and that is its tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect, Parameter, Signature
from coupled.gap.effects.entries import setting_of
from coupled.gap.effects.library import BY_NAME, EFFECTS, LAG
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import YIELDS_m, YIELDS_rad
from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig

CONTACT = ("loader.friction_stiffness_N_per_{d}", "loader.friction_elastic_share")
MOST_ELASTIC = 0.95


def settings(rig: Rig, control: ControlName, outputs: Sequence[Output] = ()) -> dict[str, Effect]:
    """Return {the effect that frees the same number: the setting, free within its tolerance}.

    Of the `outputs`, those of loader and linkage in series show the linkage's settings, too.
    """
    known = ((effect, _ends(effect, rig, control)) for effect in EFFECTS)
    found = {
        effect.name: setting_of(effect, *ends, wide=_given(effect, rig, control))
        for effect, ends in known
        if ends is not None
    }
    if not any(output.in_series for output in outputs):
        return found
    return {
        name: replace(one, outputs=("linkage", "loader")) if one.stage == "linkage" else one
        for name, one in found.items()
    }


def lag_within_a_step(rig: Rig, control: ControlName) -> Effect:
    """Return the setting by which the force may act late on the loader alone, within one step.

    A simulated hand and loader exchange force and motion once a step of the loader: the force then
    acts as it stood at the step before.
    """
    step_s = 1.0 / (rig.frame_rate * rig.substeps)
    return setting_of(BY_NAME[LAG], 0.0, step_s, 0.0)


def _given(effect: Effect, rig: Rig, control: ControlName) -> bool:
    """Tell whether the rig's own tolerance is one of what is read, which shows in more stages."""
    given = rig.controls[control].tolerance
    return effect.stage == "sensing" and effect.free[0].key_on(control) in given


def contact(rig: Rig, control: ControlName) -> tuple[Effect, ...]:
    """Return how far dry friction yields and how, as settings; none where the file says it.

    All dry friction yields before it slips, by up to half a millimetre: how far is no effect.
    """
    loader = rig.controls[control].loader
    if loader.friction_stiffness > 0.0:
        return ()
    most = most_yielding(control)
    length = Parameter(
        "", CONTACT[0], "yields", 1e-3 * most, most, (0.1 * most, 0.01 * most), may_end=True
    )
    share = Parameter(
        "", CONTACT[1], "value", 0.0, MOST_ELASTIC, (loader.friction_elastic_share,), may_end=True
    )
    names = ("setting of the contact", "setting of the contact's share")
    numbers = zip(names, (length, share), strict=True)
    return tuple(Effect(name, "loader", (one,), Signature("", "")) for name, one in numbers)


def most_yielding(control: ControlName) -> float:
    """Return by how much dry friction may yield before it slips, d."""
    return YIELDS_rad if unit_of(control) == "rad" else YIELDS_m


def is_dry(rig: Rig, control: ControlName) -> bool:
    """Tell whether a rig file has dry friction."""
    loader = rig.controls[control].loader
    levels = (loader.friction, loader.breakaway, loader.friction_pull, loader.friction_push)
    return max(*levels, loader.friction_by_load) > 0.0


def _ends(effect: Effect, rig: Rig, control: ControlName) -> tuple[float, float, float] | None:
    """Return the least and largest value of an effect's number as a setting, and its neutral one.

    None where it is no setting: an effect of more numbers than one shares the first with another.
    """
    if len(effect.free) != 1 or len(effect.parameters) != 1:
        return None
    (number,) = effect.free
    tolerance = number.tolerance
    wide = rig.controls[control].tolerance.get(number.key_on(control))
    if wide is None and tolerance <= 0.0:
        return None
    if number.mode == "factor" and not number.nominal(rig, control):
        return None  # the rig has none of it, as a servo
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
