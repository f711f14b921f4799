"""Effects of forces on other controls at a control, node by node: bend and crosstalk."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import stage
from coupled.rig.control import ControlArray

Floats = NDArray[np.float64]


@stage
def bend_by_others(controls: ControlArray, i: int) -> None:
    """Set the bend at control i by the others' forces: Σ_j K_ij·F_j."""
    row, bent = controls[i].parameters.crossing.bends, 0.0
    for j in range(len(controls)):
        bent += row[j] * controls[j].state.hand.force
    controls[i].state.linkage.others = bent


@stage
def leak_from_others(controls: ControlArray, i: int, script: Floats, node: int) -> None:
    """Set the others' forces on loader i at a node by crosstalk.

    Controls before i have been advanced to the node; those after it are at the last node, with
    their scripts extrapolated.
    """
    row, leaked = controls[i].parameters.crossing.leaks, 0.0
    for j in range(len(controls)):
        force = controls[j].state.hand.force
        if j > i and node > 0:
            force += script[j, 0, node] - script[j, 0, node - 1]
        leaked += row[j] * force
    controls[i].state.loader.leaked = leaked
