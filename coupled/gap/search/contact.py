"""Where a fit of a contact starts: how far dry friction yields, and what share of it is elastic.

Where a control sticks depends on both, and with each little change it sticks elsewhere: least
squares stay near where they begin. So a few lengths and shares are tried, and from the best of
them a pattern search goes on (Hooke and Jeeves, J. ACM 8, 1961), which asks for no slopes.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

from coupled.gap.thresholds import ELASTIC_SHARES, LENGTHS, SEARCHED_TO

Left = Callable[[float, float], float]  # what a length, d, and a share leave


def contact_start(left: Left, most: float, most_elastic: float) -> tuple[float, float]:
    """Return the length, d, and the elastic share that leave least, up to the `most` of each."""
    known: dict[tuple[float, float], float] = {}

    def leaves(at: tuple[float, float]) -> float:
        if at not in known:
            known[at] = left(*at)
        return known[at]

    def within(length: float, share: float) -> tuple[float, float]:
        return min(max(length, 1e-3 * most), most), min(max(share, 0.0), most_elastic)

    best = min((within(x * most, s) for x, s in product(LENGTHS, ELASTIC_SHARES)), key=leaves)
    times, more = 1.5, 0.2
    while times - 1.0 > SEARCHED_TO:
        length, share = best
        longer = ((length * times, share), (length / times, share))
        softer = ((length, share + more), (length, share - more))
        near = min((within(*step) for step in (*longer, *softer)), key=leaves)
        if leaves(near) < leaves(best):
            best = near
        else:
            times, more = times**0.5, 0.5 * more
    return best
