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


MOST_PLAYERS = 5  # chosen: 32 subsets; more are averaged over first and last


def shapley_subsets(players: int) -> tuple[list[int], Floats]:
    """Return the subsets whose powers are needed, and their weights, (players, subsets).

    Subset 0 is the first and that of all players the last. For more than `MOST_PLAYERS` players,
    the reductions of each as the first and as the last player are averaged. That is exact if the
    power is the mean square of a sum of the players' actions.
    """
    if players <= MOST_PLAYERS:
        return list(range(2**players)), shapley_weights(players)
    whole = 2**players - 1
    subsets = [
        0,
        *(1 << i for i in range(players)),
        *(whole - (1 << i) for i in range(players)),
        whole,
    ]
    one = np.eye(players)
    none = np.ones((players, 1))
    return subsets, 0.5 * np.hstack([none, -one, one, -none])


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
