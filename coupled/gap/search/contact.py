"""Start values of the presliding parameters: presliding length and elastic share.

The positions in which a control sticks change with both parameters, so that the cost has many local
minima, and least squares stay near their start. The start is therefore the best point of a grid,
refined by a pattern search without derivatives (Hooke and Jeeves, J. ACM 8, 1961).

If the rig file has friction, its presliding parameters are nuisance parameters. Their law has the
model error of a right effect: a small share of the gap of a rigid contact may remain.
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

Cost = Callable[[float, float], float]  # mean square residual by a length, d, and a share


def contact_start(cost: Cost, most: float, most_elastic: float) -> tuple[float, float]:
    """Return the length, d, and elastic share of least cost, each up to its largest value."""
    known: dict[tuple[float, float], float] = {}

    def cost_at(at: tuple[float, float]) -> float:
        if at not in known:
            known[at] = cost(*at)
        return known[at]

    def within(length: float, share: float) -> tuple[float, float]:
        return min(max(length, 1e-3 * most), most), min(max(share, 0.0), most_elastic)

    best = min((within(x * most, s) for x, s in product(LENGTHS, ELASTIC_SHARES)), key=cost_at)
    times, more = 1.5, 0.2
    while times - 1.0 > SEARCHED_TO:
        length, share = best
        longer = ((length * times, share), (length / times, share))
        softer = ((length, share + more), (length, share - more))
        near = min((within(*step) for step in (*longer, *softer)), key=cost_at)
        if cost_at(near) < cost_at(best):
            best = near
        else:
            times, more = times**0.5, 0.5 * more
    return best


def allowing_for_contact(output: Output, rig: Rig, control: ControlName) -> Output:
    """Return an output with the gap that errors of the presliding law may cause (`mismatch`)."""
    if output.stage != "loader" or not is_dry(rig, control) or not contact(rig, control):
        return output
    return replace(output, mismatch=MISMATCH * max(output.gap(rig) - 1.0, 0.0))
