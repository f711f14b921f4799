"""Inertia: mass, damping and force of the loader's model, scheduled by the gradient.

    m = m₀·f_m(G_T),    c = c₀·f_c(G_T),    F_L = F + T(G_T)·z',    τ·z' = F − z

Eq. (12) gives the loader a spring of G_T/(1 − K·G_T) on δc, so that a constant m and c oscillate
faster and with less damping than specified: the frequency by 1/√(1 − K·G_T), the damping ratio by
√(1 − K·G_T). With both factors 1/(1 − K·G_T) they are as specified. The remaining error of a
release is the bend's springing back: the grip is at δ·(1 − K·G_T) at once, and at rest. The lead T
on the force gives the loader the speed of the specified motion there, by an impulse T·F when F ends
(`calibration/releaseschedule`). All three are in a table over the gradient of the schedule, linear
between its rows and constant beyond, and are set at each frame.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import TINY, layout, seldom, stage
from coupled.rig.declaration import Declaration, Given
from coupled.rig.loader import LoaderParameters, LoaderState
from coupled.rig.parameters import MAX_ROWS

Table = NDArray[np.float64]


class InertiaParameters(Protocol):
    """The table of factors."""

    rows: int  # 0 for none
    gradient: Table  # G_T, N/d, rising
    mass_factor: Table
    damping_factor: Table
    force_lead: Table  # T, s
    lag: float  # τ, s
    lag_gain: float  # step response of z over a substep, by the implicit Euler rule


class InertiaState(Protocol):
    """The current lead."""

    lead: float  # T, s
    lagged: float  # z, N


def _column(of: str) -> Callable[[Given], Table]:
    """Return a function for a column of the table at its full length; default: neutral."""

    def column(g: Given) -> Table:
        host = g.control.compensation
        neutral = 0.0 if of == "force_lead" else 1.0
        values: list[float] = getattr(host, of) or [neutral] * len(host.inertia_gradient or [])
        whole = np.zeros(MAX_ROWS)
        whole[: len(values)] = values
        return whole

    return column


_TABLE = ("gradient", "mass_factor", "damping_factor", "force_lead")
INERTIA = Declaration(
    layout(InertiaParameters, **dict.fromkeys(_TABLE, (MAX_ROWS,))),
    derived={
        "rows": lambda g: len(g.control.compensation.inertia_gradient or []),
        "gradient": _column("inertia_gradient"),
        "mass_factor": _column("mass_factor"),
        "damping_factor": _column("damping_factor"),
        "force_lead": _column("force_lead"),
        "lag": lambda g: g.control.compensation.force_lead_lag,
        "lag_gain": lambda g: g.substep_s / (g.substep_s + g.control.compensation.force_lead_lag),
    },
    state=layout(InertiaState),
    fixed=("lead",),
)


@seldom
def set_inertia(
    p: InertiaParameters,
    own: InertiaState,
    loader_p: LoaderParameters,
    s: LoaderState,
    gradient: float,
) -> None:
    """Set m, c and T for the frame, by the gradient of the schedule, N/d."""
    if p.rows == 0:
        return
    g, row = p.gradient, 1
    while row < p.rows - 1 and gradient > g[row]:
        row += 1
    share = min(max((gradient - g[row - 1]) / (g[row] - g[row - 1]), 0.0), 1.0)
    mass, damping = p.mass_factor, p.damping_factor
    s.mass = loader_p.mass * (mass[row - 1] + share * (mass[row] - mass[row - 1]))
    s.damping = loader_p.damping * (damping[row - 1] + share * (damping[row] - damping[row - 1]))
    lead = p.force_lead
    own.lead = lead[row - 1] + share * (lead[row] - lead[row - 1])


@stage
def lead_force(p: InertiaParameters, s: InertiaState, force: float) -> float:
    """Return the loader's input for a force at a node, N: F + T·z'."""
    s.lagged += p.lag_gain * (force - s.lagged)
    if abs(s.lagged) < TINY:
        s.lagged = 0.0
    return force + s.lead * (force - s.lagged) / p.lag
