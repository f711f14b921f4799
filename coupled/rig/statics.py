"""The rig at rest: force, deflection and what the host makes of it, in closed form.

With breakout, two segments and a stiffening bend, along δc: the balance of the loader gives
F(δc) = F_BO + F_L + k₃·δc³ + F_mod, which is eq. (9) solved for F; the structure δ = δc + bend(F).
Friction is left out: it is a band about this line. `equations` has the linear case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from coupled.rig.compensation import estimate
from coupled.rig.equations import basic_force, specified_force
from coupled.rig.linkage import bend
from coupled.rig.modification import modifying_force, set_gradients
from coupled.rig.packing import pack
from coupled.rig.rig import Rig
from coupled.rig.schedule import gradients

Floats = NDArray[np.float64]


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
    (packed,) = pack(rig, only=control)
    p, s = packed["parameters"], packed["state"]
    first, second = gradients(p["schedule"], pressure_Pa)
    set_gradients(p["modification"], s["modification"], first, second)
    loader, side = p["loader"], np.sign(computed)
    added = np.array([modifying_force(s["modification"], x) for x in computed])
    force = (
        loader["breakout"] * side
        + basic_force(float(loader["basic_gradient"]), computed)
        + loader["cubic"] * computed**3
        + added
    )
    deflection = computed + np.array([bend(p["linkage"], f) for f in force])
    read = p["sensing"]["read_scale"] * computed
    force_read = p["sensing"]["force_scale"] * force
    estimates = np.array(
        [estimate(p["compensation"], x, f) for x, f in zip(read, force_read, strict=True)]
    )
    return Statics(
        computed,
        force,
        deflection,
        estimates,
        specified_force(rig, control, pressure_Pa, deflection),
    )


def static_point(rig: Rig, control: str, pressure_Pa: float, deflection: float) -> Statics:
    """Return the point of the static line at which the grip stands at δ in d (not zero)."""

    def excess(computed: float) -> float:
        line = static_line(rig, control, pressure_Pa, np.array([computed]))
        return float(line.deflection[0]) - deflection

    # δc has δ's sign and is no larger; a breakout may hold the loader at neutral.
    tiny = deflection * 1e-9
    computed = tiny if excess(tiny) * deflection > 0.0 else brentq(excess, tiny, deflection)
    return static_line(rig, control, pressure_Pa, np.array([computed]))
