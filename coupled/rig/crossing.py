"""Crossing: what other controls' forces bend at this one, and what the host adds for it.

    δ_i = x_i + K_ii·F_i + Σ_j K_ij·F_j        the structure's part, in `linkage`
    δ̂_i = δc_i + K̂_ii·F_i + Σ_j K̂_ij·F_j       the host's, in its estimate

At every node of the loaders, one control after the other, each with the others' latest forces
(Gauss and Seidel's order: it settles between stiff hands for every structure that takes work).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import layout
from coupled.rig.declaration import Declaration

MOST = 3  # controls of a rig


class CrossingParameters(Protocol):
    """One row of the structure's compliance, controls in the rig's order; its own place 0."""

    joined: int  # whether any control of the rig has such a term
    bends: NDArray[np.float64]  # K_ij, d/N
    assumed: NDArray[np.float64]  # K̂_ij, d/N; 0 where the deflection correction is off


class CrossingState(Protocol):
    """What the host has of the others at t_k."""

    read: float  # F of this control as the host reads it, N
    estimated: float  # Σ_j K̂_ij·F_j, d


CROSSING = Declaration(
    layout(CrossingParameters, bends=(MOST,), assumed=(MOST,)),
    derived={
        "joined": lambda g: g.joined,
        "bends": lambda g: _filled(g.bends),
        "assumed": lambda g: _filled(g.assumed),
    },
    state=layout(CrossingState),
)


def _filled(row: tuple[float, ...]) -> tuple[float, ...]:
    return row + (0.0,) * (MOST - len(row))
