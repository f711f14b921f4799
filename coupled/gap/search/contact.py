"""Where a fit of a contact starts: how far dry friction yields, and what share of it is elastic.

Where a control sticks depends on both, and with each little change it sticks elsewhere: least
squares stay near where they begin. So a few lengths and shares are tried, and from the best of
them a pattern search goes on (Hooke and Jeeves, J. ACM 8, 1961), which asks for no slopes.

Of friction that is filed the contact is a setting. How it yields is known no better than the
physics of a right effect: that part of the gap which a rigid contact leaves may remain.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import product

from coupled.gap.effects.settings import contact, is_dry
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import ELASTIC_SHARES, LENGTHS, MISMATCH, SEARCHED_TO
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

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


def allowing_for_contact(output: Output, rig: Rig, control: ControlName) -> Output:
    """Return an output of the loader with what the law of a contact that yields may leave of it."""
    if output.stage != "loader" or not is_dry(rig, control) or not contact(rig, control):
        return output
    return replace(output, mismatch=MISMATCH * max(output.gap(rig) - 1.0, 0.0))
