"""The points of a sweep: all combinations of a grid, or samples of its ranges."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from coupled.campaign.sensitivity import design
from coupled.campaign.sweepfile import SweepFile, Vary

Floats = NDArray[np.float64]


def points(sweep: SweepFile) -> list[tuple[Any, ...]]:
    """Return the values of each point, in the order of the varied keys."""
    if sweep.samples is None:
        return list(itertools.product(*(_grid_values(vary) for vary in sweep.vary)))
    width = len(sweep.vary)
    if sweep.method == "sensitivity":
        shares = design(sweep.samples, width, sweep.seed)
    elif sweep.method == "sobol":
        power = max(0, (sweep.samples - 1).bit_length())
        shares = qmc.Sobol(width, seed=sweep.seed).random_base2(power)[: sweep.samples]
    else:
        shares = np.random.default_rng(sweep.seed).random((sweep.samples, width))
    columns = [_drawn(vary, shares[:, i]) for i, vary in enumerate(sweep.vary)]
    return list(zip(*columns, strict=True))


def _grid_values(vary: Vary) -> list[Any]:
    if vary.values is not None:
        return vary.values
    return _drawn(vary, np.linspace(0.0, 1.0, vary.steps or 2))


def _drawn(vary: Vary, shares: Floats) -> list[Any]:
    """Return the values at shares from 0 to 1 of a range or a list."""
    if vary.values is not None:
        places = np.minimum((shares * len(vary.values)).astype(int), len(vary.values) - 1)
        return [vary.values[place] for place in places]
    assert vary.low is not None
    assert vary.high is not None
    if vary.spread == "log":
        values = vary.low * (vary.high / vary.low) ** shares
    else:
        values = vary.low + (vary.high - vary.low) * shares
    return [float(value) for value in values]
