"""Shapley values: the share of each contribution in a power that all of them reduce (Shapley 1953).

The share of a contribution is the reduction by adding it, averaged over all orders of adding them.
The shares sum to the reduction by all of them together.
"""

from __future__ import annotations

from itertools import combinations
from math import factorial

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def shapley_weights(players: int) -> Floats:
    """Return the weight of each subset's power in each player's share, (players, 2^players).

    Bit i of a subset's number is set if player i belongs to it.
    """
    weights = np.zeros((players, 2**players))
    for i in range(players):
        others = [j for j in range(players) if j != i]
        for size in range(players):
            weight = factorial(size) * factorial(players - size - 1) / factorial(players)
            for some in combinations(others, size):
                without = sum(1 << j for j in some)
                weights[i, without] += weight
                weights[i, without | 1 << i] -= weight
    return weights
