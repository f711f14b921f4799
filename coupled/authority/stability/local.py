"""The rig for small motions about rest: each curve replaced by its slope there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from coupled.errors import InputError
from coupled.record.channels import unit_of
from coupled.rig.curves import Curve, FrictionCurve, curves_of
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig

# By section and curve: the parameter to which the slope is added, or which it multiplies.
_NUMBERS: Mapping[tuple[str, str], str] = {
    ("loader", "force_curve"): "basic_gradient_N_per_{d}",
    ("loader", "friction_curve"): "damping_N_s_per_{d}",
    ("loader", "bend_curve"): "bend_{d}_per_N",
    ("sensing", "deflection_curve"): "deflection_scale",
    ("sensing", "force_curve"): "force_scale",
}


def slope_at_rest(curve: Curve) -> float:
    """Return a curve's slope at 0, the mean of both sides."""
    if isinstance(curve, FrictionCurve) and curve.force_push:
        other = curve.model_copy(update={"force": curve.force_push, "force_push": []})
        return 0.5 * (curve.slopes[0] + other.slopes[0])
    right = int(np.clip(np.searchsorted(curve.nodes, 0.0, "right") - 1, 0, len(curve.slopes) - 1))
    left = right - 1 if curve.nodes[right] == 0.0 and right > 0 else right
    return 0.5 * (curve.slopes[left] + curve.slopes[right])


def about_rest(rig: Rig) -> Rig:
    """Return the rig with its curves replaced by their slopes at rest; unchanged without curves.

    A curve over q̄ stays, and those of dry friction and of the command do not act on small motions.
    Raises InputError if a slope gives a nonpositive damping, spring or bend.
    """
    changes: dict[str, Any] = {}
    for name, control in rig.controls.items():
        changes |= _of_control(rig, str(name), control)
    return rig.changed(changes) if changes else rig


def _of_control(rig: Rig, name: str, control: Control) -> dict[str, Any]:
    d, found = unit_of(name), dict[str, Any]()
    for section in ("loader", "sensing"):
        for key, curve in curves_of(getattr(control, section), d):
            number = _NUMBERS.get((section, key), "").format(d=d)
            if not curve.nodes or not number:
                continue
            path = f"controls.{name}.{section}"
            filed, slope = float(rig[f"{path}.{number}"]), slope_at_rest(curve)
            local = filed * slope if curve.MAP else filed + slope
            if local < 0.0 or (curve.MAP and local == 0.0):
                problem = f"makes {number} {local:.4g} for small motions; their stability is"
                raise InputError(rig.place, f"{path}.{key}", f"{problem} not found")
            found |= {f"{path}.{number}": local, f"{path}.{key}": {}}
            push = f"bend_push_{d}_per_N"
            if key == "bend_curve" and control.loader.bend_push is not None:
                found[f"{path}.{push}"] = control.loader.bend_push + slope
    return found
