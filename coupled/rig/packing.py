"""From a rig's data to the kernels' parameters, by the stages' declarations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import cast

import numpy as np

from coupled.record.channels import ControlName
from coupled.rig.control import CONTROL, STAGES, ControlArray
from coupled.rig.crossing import leaks
from coupled.rig.declaration import Given, Hand, first_order_gain
from coupled.rig.rig import Rig
from coupled.rig.surface import COMMAND_SIGN

__all__ = ["COMMAND_SIGN", "Hand", "first_order_gain", "pack"]


def crossed_bends(
    rig: Rig, control: str, names: Sequence[str]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return K_ij and the host's K̂_ij of a control for the forces on others, d/N; its own 0."""
    at, structure = list(names).index(control), rig.structure
    corrected = rig.controls[cast(ControlName, control)].compensation.deflection
    bends = structure.between(names)[at]
    assumed = corrected * structure.assumed.between(names)[at]
    return tuple(map(float, bends)), tuple(map(float, assumed))


def pack(
    rig: Rig, hands: Mapping[str, Hand] | None = None, only: str | None = None
) -> ControlArray:
    """Return a rig's controls at rest in trim, shape (controls,), in the rig's order.

    With `only`, that control alone. Raises KeyError if the rig has no such control.
    """
    found = {str(name): control for name, control in rig.controls.items()}
    if only is not None:
        found = {only: found[only]}
    packed = np.zeros(len(found), CONTROL)
    frame_s = 1.0 / rig.frame_rate
    joined = len(found) > 1 and (
        not rig.structure.stands_apart or any(c.loader.crosstalk for c in found.values())
    )
    for p, (name, control) in zip(packed["parameters"], found.items(), strict=True):
        hand = (hands or {}).get(name, Hand())
        bends, assumed = crossed_bends(rig, name, list(found))
        given = Given(
            *(control, hand, frame_s, frame_s / rig.substeps, rig.substeps),
            *(joined, bends, assumed, leaks(name, control.loader.crosstalk, list(found))),
        )
        for stage, declared in STAGES.items():
            p[stage] = declared.values(given)
    packed["state"]["services"]["on"] = packed["parameters"]["services"]["present"]
    return packed
