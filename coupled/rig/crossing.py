"""Crossing: the bend at this control by forces on others, and the host's correction for it.

    δ_i = x_i + K_ii·F_i + Σ_j K_ij·F_j        the structure's part, in `linkage`
    δ̂_i = δc_i + K̂_ii·F_i + Σ_j K̂_ij·F_j       the host's, in its estimate

A share of another control's force may also act on this loader (crosstalk): of the wheel's force,
since the wheel is mounted on the column, on column and pedals; on the wheel, of the column's. If
the rig lacks that control, the share is of the third's. The gauge does not measure it.

It is computed at every node of the loaders, one control after the other, each with the others'
latest forces (Gauss-Seidel, which converges between stiff hands for every passive structure).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import ControlName
from coupled.rig.compiled import layout
from coupled.rig.declaration import Declaration

MOST = 3  # controls of a rig


class CrossingParameters(Protocol):
    """One row of the structure's compliance, controls in the rig's order; its own element is 0."""

    joined: int  # whether any control of the rig has such a term
    bends: NDArray[np.float64]  # K_ij, d/N
    assumed: NDArray[np.float64]  # K̂_ij, d/N; 0 if the deflection correction is off
    leaks: NDArray[np.float64]  # shares of their forces that act on this loader


class CrossingState(Protocol):
    """The host's data on the other controls at t_k."""

    read: float  # F of this control as the host reads it, N
    estimated: float  # Σ_j K̂_ij·F_j, d


CROSSING = Declaration(
    layout(CrossingParameters, **dict.fromkeys(("bends", "assumed", "leaks"), (MOST,))),
    derived={
        "joined": lambda g: g.joined,
        "bends": lambda g: _filled(g.bends),
        "assumed": lambda g: _filled(g.assumed),
        "leaks": lambda g: _filled(g.leaks),
    },
    state=layout(CrossingState),
)


def leaking(control: str) -> tuple[ControlName, ControlName]:
    """Return the controls whose force may act on a control's loader, the first choice first."""
    first: dict[str, tuple[ControlName, ControlName]] = {
        "column": ("wheel", "pedals"),
        "wheel": ("column", "pedals"),
        "pedals": ("wheel", "column"),
    }
    return first[control]


def leaks(control: str, share: float, names: Sequence[str]) -> tuple[float, ...]:
    """Return the share of each named control's force that acts on a control's loader."""
    source = next((one for one in leaking(control) if one in names), None)
    return tuple(share if name == source else 0.0 for name in names)


def _filled(row: tuple[float, ...]) -> tuple[float, ...]:
    return row + (0.0,) * (MOST - len(row))
