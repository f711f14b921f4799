"""Where the fit of a limit starts: at shares of the largest one that a record meets.

A limit that only the peaks of a record meet is a tenth below them: sizes that are a factor of three
apart are either never met, or cut so much off that the effect looks like none of the residual.

A servo's limit is inside its feedback, and its answer so steep that a fit from 3 % off ends in a
local minimum: limits 2 % apart are tried as well.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from coupled.gap.effects.effect import Effect
from coupled.gap.thresholds import LIMIT_BISECTIONS, LIMIT_SHARES, SERVO_SHARES


def is_limit(effect: Effect) -> bool:
    """Tell whether an effect is a limit and nothing else."""
    return len(effect.free) == 1 and effect.free[0].inverse


def limits(effect: Effect, shows: Callable[[float], bool]) -> list[list[float]]:
    """Return sets of limits to try, from the largest one that shows on, in the limit's own unit.

    Of each set the best is a start. `shows` tells of a limit whether it changes what is predicted.
    None where not even the lowest does.
    """
    number = effect.free[0]
    low, high = math.log(number.low), math.log(number.high)
    if not shows(number.low):
        return []
    for _ in range(LIMIT_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if shows(math.exp(middle)) else (low, middle)
    sets = (LIMIT_SHARES, SERVO_SHARES) if effect.stage == "linkage" else (LIMIT_SHARES,)
    most = math.exp(low)
    return [[max(share * most, number.low) for share in shares] for shares in sets]
