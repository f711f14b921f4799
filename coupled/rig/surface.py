"""Surface: from the host's estimate of the deflection to a command for the model.

    u = sign·f(δ̂/travel), clipped to ±1         the linkage; the travel of a pull or of a push; f is
                                                the identity or a curve (`curves`)
    cable stretch   u/(1 + loss·q̄)              under air load
    lag             τ·y' = u − y
    rate limit      |y'| ≤ rate
    free play       the surface follows once the play is taken up
    rigging         a constant added

The result is added to the trim. All are in command units: 1 is the whole travel.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import TINY, layout, stage
from coupled.rig.declaration import Declaration, first_order_gain
from coupled.rig.parameters import Control
from coupled.rig.piecewise import SHAPE, along, count_of, table_of


class SurfaceParameters(Protocol):
    """The chain from the column to the surface."""

    gain: float  # sign/travel of a pull, 1/d
    gain_push: float  # and of a push
    stretch: float  # loss, 1/Pa
    lag_gain: float  # 1 − exp(−T/τ) over a frame; 1 without lag
    rate_step: float  # largest motion in a frame; 0 for no limit
    play: float  # full width
    offset: float
    curve_nodes: int  # of the command's curve; 0 without one
    curve: NDArray[np.float64]  # command less share of the travel, pull positive


class SurfaceState(Protocol):
    """The state of the surface's chain."""

    lagged: float
    moved: float
    position: float


# JSBSim's sign for nose up, right wing down, nose right, confirmed in flight of each model.
COMMAND_SIGN = {"elevator": -1.0, "aileron": 1.0, "rudder": -1.0}

SURFACE = Declaration(
    layout(SurfaceParameters, curve=SHAPE),
    section="control.rigging",
    derived={
        "gain": lambda g: COMMAND_SIGN[g.control.surface] / g.control.pull,
        "gain_push": lambda g: COMMAND_SIGN[g.control.surface] / g.control.push,
        "stretch": lambda g: g.control.rigging.stretch_loss,
        "lag_gain": lambda g: first_order_gain(g.control.rigging.lag, g.frame_s),
        "rate_step": lambda g: g.control.rigging.rate_limit * g.frame_s,
        "curve_nodes": lambda g: count_of(g.control.rigging.command_curve),
        "curve": lambda g: table_of(g.control.rigging.command_curve),
    },
    state=layout(SurfaceState),
)


def share_of_travel(control: Control, deflection: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return deflections in d as shares of the travel on their side, pull positive."""
    share: NDArray[np.float64] = deflection / np.where(deflection > 0.0, control.pull, control.push)
    return share


@stage
def static_command(p: SurfaceParameters, estimate: float, dynamic_pressure: float) -> float:
    """Return the linkage's command, in ±1, for δ̂ in d and q̄ in Pa."""
    gain = p.gain if estimate > 0.0 else p.gain_push
    asked = gain * estimate
    if p.curve_nodes > 0:
        sign = math.copysign(1.0, gain)
        asked += sign * along(p.curve, p.curve_nodes, sign * asked)
    commanded = min(max(asked, -1.0), 1.0)
    return commanded / (1.0 + p.stretch * dynamic_pressure)


@stage
def command_surface(
    p: SurfaceParameters, s: SurfaceState, estimate: float, dynamic_pressure: float
) -> float:
    """Return the command over this frame, in ±1, for δ̂ in d and q̄ in Pa."""
    commanded = static_command(p, estimate, dynamic_pressure)
    s.lagged += p.lag_gain * (commanded - s.lagged)
    if abs(s.lagged) < TINY:
        s.lagged = 0.0
    if p.rate_step > 0.0:
        s.moved += min(max(s.lagged - s.moved, -p.rate_step), p.rate_step)
    else:
        s.moved = s.lagged
    half = 0.5 * p.play
    s.position = min(max(s.position, s.moved - half), s.moved + half)
    return s.position + p.offset
