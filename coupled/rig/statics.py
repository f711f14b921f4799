"""The rig at rest: force, deflection and what the host makes of it, in closed form.

    F/δ = G_T                    loss K·G_T           gradient right:  eqs. (6), (7), (7a)
    F/δ = G_T/(1 + K·G_T)        loss K·G_T/(1 + K·G_T)    gradient left alone

and in general, with breakout, two segments and a stiffening bend, along δc: the
balance of the loader gives F(δc), the structure δ = δc + bend(F). Friction is left out:
it is a band about this line.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from coupled.record.channels import ControlName
from coupled.rig.compensation import estimate
from coupled.rig.linkage import bend
from coupled.rig.modification import modifying_force, set_gradients
from coupled.rig.packing import pack
from coupled.rig.rig import Rig
from coupled.rig.schedule import gradients

Floats = NDArray[np.float64]


def bend_loss(bend_per_force: float, gradient: float) -> float:
    """Return the share of the deflection lost when the pilot feels `gradient`: eq. (7a).

    K in d/N, G_T in N/d, without unit; the host takes δc for δ.
    """
    return bend_per_force * gradient


def uncompensated_loss(bend_per_force: float, gradient: float) -> float:
    """Return the share lost when the loader holds F = G_T·δc: K·G_T/(1 + K·G_T)."""
    return bend_per_force * gradient / (1.0 + bend_per_force * gradient)


@dataclass(frozen=True)
class Statics:
    """The static line of one control at one dynamic pressure; arrays of one shape.

    `computed` δc, `deflection` δ and `estimate` δ̂ in d, `force` F and `specified` (what the
    pilot should feel at that δ) in N.
    """

    computed: Floats
    force: Floats
    deflection: Floats
    estimate: Floats
    specified: Floats


def static_line(rig: Rig, control: str, pressure_Pa: float, computed: Floats) -> Statics:
    """Return the static line at the given δc in d, which are not to be zero."""
    i = [str(name) for name in rig.controls].index(control)
    packed = pack(rig)[i]
    p, s = packed["parameters"], packed["state"]
    first, second = gradients(p["schedule"], pressure_Pa)
    set_gradients(p["modification"], s["modification"], first, second)
    loader, side = p["loader"], np.sign(computed)
    added = np.array([modifying_force(s["modification"], x) for x in computed])
    force = (
        loader["breakout"] * side
        + (loader["basic_gradient"] + loader["cubic"] * computed**2) * computed
        + added
    )
    deflection = computed + np.array([bend(p["linkage"], f) for f in force])
    read = p["sensing"]["deflection_scale"] * computed
    force_read = p["sensing"]["force_scale"] * force
    believed = np.array(
        [estimate(p["compensation"], x, f) for x, f in zip(read, force_read, strict=True)]
    )
    return Statics(
        computed,
        force,
        deflection,
        believed,
        specified_force(rig, control, pressure_Pa, deflection),
    )


def specified_force(
    rig: Rig, control: str, pressure_Pa: float | Floats, deflection: Floats
) -> Floats:
    """Return the force in N specified at δ in d: breakout and one or two slopes."""
    data = rig.controls[cast(ControlName, control)]
    table = data.schedule
    first = np.interp(pressure_Pa, table.dynamic_pressure, table.total_gradient)
    second = first
    if table.second_gradient is not None:
        second = np.interp(pressure_Pa, table.dynamic_pressure, table.second_gradient)
    size = np.abs(deflection)
    beyond = np.maximum(size - table.break_deflection, 0.0) if table.break_deflection else 0.0
    slope_part = first * (size - beyond) + second * beyond
    return np.asarray(np.sign(deflection) * (data.loader.breakout + slope_part))


def static_point(rig: Rig, control: str, pressure_Pa: float, deflection: float) -> Statics:
    """Return the point of the static line at which the grip stands at δ in d (not zero)."""

    def excess(computed: float) -> float:
        line = static_line(rig, control, pressure_Pa, np.array([computed]))
        return float(line.deflection[0]) - deflection

    # δc has δ's sign and is no larger; a breakout may hold the loader at neutral.
    tiny = deflection * 1e-9
    computed = tiny if excess(tiny) * deflection > 0.0 else brentq(excess, tiny, deflection)
    return static_line(rig, control, pressure_Pa, np.array([computed]))
