"""The nuisance parameters of a rig: values that may be off within a tolerance without an effect.

The default tolerance is 1 or 2 %, to which a potentiometer is set and a servo tuned. The file of a
nominal rig fitted to records of the machine (`nominal`) has the tolerance of each fitted value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.effect import Effect, Parameter, Signature, setting_of
from coupled.gap.effects.library import BY_NAME, EFFECTS, LAG
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import COLUMN_WAY, MINOR, YIELDS_m
from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig

CONTACT = ("loader.friction_stiffness_N_per_{d}", "loader.friction_elastic_share")


def settings(rig: Rig, control: ControlName, outputs: Sequence[Output] = ()) -> dict[str, Effect]:
    """Return {effect that frees the same key: nuisance parameter within its tolerance}.

    If an output is of loader and linkage in series, the linkage's parameters show in both. An
    aircraft alone has none.
    """
    if not rig.controls:
        return {}
    known = ((effect, _ends(effect, rig, control)) for effect in EFFECTS)
    found = {
        effect.name: setting_of(effect, *ends, every_output=_given(effect, rig, control))
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
    """Return a delay of the force on the loader as a nuisance parameter, at most one step.

    If a simulated hand and loader exchange force and motion once per step of the loader, the force
    of the step before acts.
    """
    step_s = 1.0 / (rig.frame_rate * rig.substeps)
    return setting_of(BY_NAME[LAG], 0.0, step_s, 0.0)


def _given(effect: Effect, rig: Rig, control: ControlName) -> bool:
    """Tell whether the rig file has a tolerance of a sensor, which shows in several outputs."""
    given = rig.controls[control].tolerance
    return effect.stage == "sensing" and effect.free[0].key_on(control) in given


def contact(rig: Rig, control: ControlName) -> tuple[Effect, ...]:
    """Return the presliding parameters as nuisance parameters; none if the rig file has them.

    All dry friction has presliding, of up to half a millimetre, so that its length is no effect.
    """
    if not rig.controls:
        return ()
    loader = rig.controls[control].loader
    if loader.friction_stiffness > 0.0:
        return ()
    most = most_yielding(control)
    length = Parameter(
        "", CONTACT[0], "yields", 1e-3 * most, most, (0.1 * most, 0.01 * most), may_end=True
    )
    share = Parameter(
        "", CONTACT[1], "value", 0.0, 1.0 - MINOR, (loader.friction_elastic_share,), may_end=True
    )
    names = ("setting of the contact", "setting of the contact's share")
    numbers = zip(names, (length, share), strict=True)
    return tuple(Effect(name, "loader", (one,), Signature("", "")) for name, one in numbers)


def most_yielding(control: ControlName) -> float:
    """Return the largest presliding length, d."""
    return (
        (YIELDS_m * COLUMN_WAY["rad"] / COLUMN_WAY["m"]) if unit_of(control) == "rad" else YIELDS_m
    )


def is_dry(rig: Rig, control: ControlName) -> bool:
    """Tell whether a rig file has dry friction."""
    if not rig.controls:
        return False
    loader = rig.controls[control].loader
    levels = (loader.friction, loader.breakaway, loader.friction_pull, loader.friction_push)
    return any((*levels, loader.friction_by_load, loader.regressor_friction))


def _ends(effect: Effect, rig: Rig, control: ControlName) -> tuple[float, float, float] | None:
    """Return the tolerance limits of an effect's parameter, and its neutral value.

    None without a tolerance, and for an effect of several parameters.
    """
    if len(effect.free) != 1 or len(effect.parameters) != 1:
        return None
    (number,) = effect.free
    tolerance = number.tolerance
    filed_tolerance = rig.controls[control].tolerance.get(number.key_on(control))
    if filed_tolerance is None and tolerance <= 0.0:
        return None
    if number.mode == "factor" and not number.nominal(rig, control):
        return None  # the rig lacks the component, such as a servo
    neutral = number.neutral(rig, control)
    if filed_tolerance is not None:
        filed = float(number.nominal(rig, control))
        if number.mode == "factor":
            tolerance = filed_tolerance / abs(filed) if filed else 0.0
        else:
            tolerance = filed_tolerance
            # At most the filed value is removed: friction is not negative.
            floor = -math.inf if number.low < 0.0 else -abs(filed)
            floor = number.low if number.mode == "value" else floor
            return max(neutral - tolerance, floor), neutral + tolerance, neutral
    if tolerance <= 0.0:
        return None
    return neutral - min(tolerance, 0.9), neutral + tolerance, neutral
