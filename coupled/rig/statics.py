"""The rig at rest: force, deflection and what the host makes of it, in closed form.

With breakout, two segments and a stiffening bend, along δc: the balance of the loader gives
F(δc) = F_BO + F_L + k₃·δc³ + F_mod, which is eq. (9) solved for F; the structure δ = δc + bend(F).
Friction is left out: it is a band about this line, and so is the bend's hysteresis, whose
middle is here. `equations` has the linear case. Forces that other controls' pilots hold bend a
common structure: δ = δc + bend(F) + Σ_j K_ij·F_j, and δ̂ has the host's K̂_ij·F_j in it. The line
is drawn by the stages that fly, in one kernel that is kept on disk.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compensation import estimate
from coupled.rig.compiled import entry, stage
from coupled.rig.control import ControlArray, ControlParameters, ControlState
from coupled.rig.equations import basic_force, specified_force
from coupled.rig.linkage import bend
from coupled.rig.modification import modifying_force, set_gradients
from coupled.rig.packing import crossed_bends, pack
from coupled.rig.rig import Rig
from coupled.rig.schedule import gradients
from coupled.rig.springs import limited, ripple

Floats = NDArray[np.float64]
loader_force = stage(basic_force)  # eq. (8)


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
    others = crossed(rig, control, others_N or {})
    return _line(rig, control, pressure_Pa, pack(rig, only=control), computed, others)


def static_point(
    rig: Rig,
    control: str,
    pressure_Pa: float,
    deflection: float,
    others_N: Mapping[str, float] | None = None,
) -> Statics:
    """Return the point of the static line at which the grip stands at δ in d (not zero).

    Not where the others' forces alone bring it: there this control has no force.
    """
    packed = pack(rig, only=control)
    others = crossed(rig, control, others_N or {})
    computed = _computed_at(packed, float(pressure_Pa), float(deflection) - others[0])
    return _line(rig, control, pressure_Pa, packed, np.array([computed]), others)


def _line(
    rig: Rig,
    control: str,
    pressure_Pa: float,
    packed: ControlArray,
    computed: Floats,
    others: tuple[float, float],
) -> Statics:
    out = np.empty((3, len(computed)))
    _along(packed, float(pressure_Pa), np.ascontiguousarray(computed, dtype=np.float64), out)
    out[1] += others[0]
    out[2] += others[1]
    force, deflection, estimates = out
    wanted = specified_force(rig, control, pressure_Pa, deflection)
    return Statics(computed, force, deflection, estimates, wanted)


@stage
def _force(p: ControlParameters, s: ControlState, computed: float) -> float:
    """Return F in N at δc = `computed` d, which is not zero."""
    breakout = p.loader.breakout if computed > 0.0 else -p.loader.breakout
    spring = loader_force(p.loader.basic_gradient, computed) + p.loader.cubic * computed**3
    given = limited(p.loader, modifying_force(s.modification, computed))
    return breakout + spring + ripple(p.loader, computed) + given


@entry
def _along(controls: ControlArray, pressure: float, computed: Floats, out: Floats) -> None:
    """Write F in N, δ and δ̂ in d, shape (3, n), at each δc."""
    p, s = controls[0].parameters, controls[0].state
    first, second = gradients(p.schedule, pressure)
    set_gradients(p.modification, s.modification, first, second)
    for i in range(len(computed)):
        x = computed[i]
        force = _force(p, s, x)
        out[0, i] = force
        out[1, i] = x + bend(p.linkage, force)
        read, force_read = p.sensing.read_scale * x, p.sensing.force_scale * force
        out[2, i] = estimate(p.compensation, read, force_read + p.sensing.force_zero)


@entry
def _computed_at(controls: ControlArray, pressure: float, deflection: float) -> float:
    """Return the δc in d at which the grip stands at δ, to the last digit, by bisection.

    δc has δ's sign and is no larger; a breakout may hold the loader at neutral.
    """
    p, s = controls[0].parameters, controls[0].state
    first, second = gradients(p.schedule, pressure)
    set_gradients(p.modification, s.modification, first, second)
    size = abs(deflection)
    near, far = 1e-9, 1.0  # shares of δ
    middle = near
    while True:
        x = middle * deflection
        beyond = abs(x + bend(p.linkage, _force(p, s, x))) > size
        if beyond and middle == near:
            return x
        near, far = (near, middle) if beyond else (middle, far)
        middle = 0.5 * (near + far)
        if middle in (near, far):
            return middle * deflection
