"""The rig at rest: force, deflection and what the host makes of it, in closed form.

With breakout, two segments and a stiffening bend, along δc: the balance of the loader gives
F(δc) = F_BO + F_L + k₃·δc³ + F_mod, which is eq. (9) solved for F; the structure δ = δc + bend(F).
Friction is left out: it is a band about this line, and so is the bend's hysteresis, whose
middle is here. `equations` has the linear case. Forces that other controls' pilots hold bend a
common structure: δ = δc + bend(F) + Σ_j K_ij·F_j, and δ̂ has the host's K̂_ij·F_j in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from coupled.rig.compensation import estimate
from coupled.rig.equations import basic_force, specified_force
from coupled.rig.linkage import deflection as deflection_at
from coupled.rig.modification import modifying_force, set_gradients
from coupled.rig.packing import crossed_bends, pack
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


def crossed(rig: Rig, control: str, others_N: Mapping[str, float]) -> tuple[float, float]:
    """Return what the others' forces bend at a control, and what its host adds for them, d."""
    names = [str(name) for name in rig.controls]
    bends, assumed = crossed_bends(rig, control, names)
    force = np.array([others_N.get(name, 0.0) for name in names])
    scale = np.array([data.sensing.force_scale for data in rig.controls.values()])
    return float(bends @ force), float(assumed @ (scale * force))


def static_line(
    rig: Rig,
    control: str,
    pressure_Pa: float,
    computed: Floats,
    others_N: Mapping[str, float] | None = None,
) -> Statics:
    """Return the static line at the given δc in d, which are not to be zero.

    `others_N` are the forces held on other controls, {control: N}.
    """
    bent, added_estimate = crossed(rig, control, others_N or {})
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
    p["linkage"]["share"] = 0.0
    resting = np.array([deflection_at(p["linkage"], s["linkage"], f) for f in force])
    deflection = computed + resting + bent
    read = p["sensing"]["read_scale"] * computed
    force_read = p["sensing"]["force_scale"] * force
    estimates = np.array(
        [estimate(p["compensation"], x, f) for x, f in zip(read, force_read, strict=True)]
    )
    estimates = estimates + added_estimate
    return Statics(
        computed,
        force,
        deflection,
        estimates,
        specified_force(rig, control, pressure_Pa, deflection),
    )


def static_point(
    rig: Rig,
    control: str,
    pressure_Pa: float,
    deflection: float,
    others_N: Mapping[str, float] | None = None,
) -> Statics:
    """Return the point of the static line at which the grip stands at δ in d.

    Not where the others' forces alone bring it: there this control has no force.
    """
    own = deflection - crossed(rig, control, others_N or {})[0]

    def excess(computed: float) -> float:
        line = static_line(rig, control, pressure_Pa, np.array([computed]), others_N)
        return float(line.deflection[0]) - deflection

    # δc has the sign of what is left to this control and is no larger; a breakout may hold the
    # loader at neutral.
    tiny = own * 1e-9
    computed = tiny if excess(tiny) * own > 0.0 else brentq(excess, tiny, own)
    return static_line(rig, control, pressure_Pa, np.array([computed]), others_N)
