"""Laws of dry friction beside one another: where the richer one's fit starts, and whether it pays.

A richer law holds the plainer one. Where the plainer leaves noise alone, what the richer could gain
is foretold at the plainer one's end, by how a little of what it has more turns the residual: the
score test (Rao, Math. Proc. Camb. Phil. Soc. 44, 1948). It costs six replays, a fit a hundred.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect, possible, value_of
from coupled.gap.search.case import Case
from coupled.gap.search.descent import leaves_noise
from coupled.gap.search.fit import Fit, touched
from coupled.gap.search.slopes import Slope
from coupled.gap.signals.output import Output, Part, memory
from coupled.gap.thresholds import HARDLY, RICHER, SHAPES, SIMPLER_GAIN
from coupled.parallel import go_on

Floats = NDArray[np.float64]
Starts = list[dict[str, float]]
Fits = Sequence[tuple[Effect, Fit]]


def law_starts(case: Case, law: Effect, starts: Starts, found: Fits) -> Starts:
    """Return where the fit of a law of friction starts, beside those that were fitted.

    With the contact that plain friction was found with; the richer of two laws where the plainer
    one ended, too, and only there where that one left noise alone.
    """
    beside = _contact_of(case, found)
    from_plainer = _from_plainer(case, law, found)
    if from_plainer and any(one.yielding and leaves_only_noise(case, one, f) for one, f in found):
        return from_plainer
    return [*({**beside, **start} for start in starts), *from_plainer]


def may_gain(case: Case, law: Effect, found: Fits) -> bool:
    """Tell whether a law of friction may gain beside the plain one that was fitted.

    All may but a richer one where plain friction leaves noise alone, and little is foretold.
    """
    for plain, fitted in found:
        if plain.yielding and leaves_only_noise(case, plain, fitted):
            gain = foretold(case, law, plain, fitted)
            return gain is None or gain >= SIMPLER_GAIN
    return True


def leaves_only_noise(case: Case, effect: Effect, fitted: Fit) -> bool:
    """Tell whether an effect, as fitted, leaves noise alone of the outputs that it shows in."""
    ours = touched(case.outputs, [effect])
    squares = [0.5 * float(np.sum(o.residual(fitted.rig, "fitted", wide=True) ** 2)) for o in ours]
    return leaves_noise(sum(squares), sum(int(o.rows("fitted").sum()) for o in ours))


def imitating(case: Case, richer: Effect, plain: Effect, fitted: Fit) -> dict[str, float]:
    """Return the values by which a richer law is nearly the plainer one that was fitted."""
    assert richer.alike is not None
    known = {p.name: fitted.values[plain.value_key(p)] for p in plain.free}
    base = float(value_of(case.nominal, case.control, richer.alike.base))
    values = richer.alike.values(known, base)
    return {richer.value_key(p): values[p.name] for p in richer.free}


def _contact_of(case: Case, found: Fits) -> dict[str, float]:
    """Return how plain friction yields by its fit, if it was fitted."""
    return {
        one.value_key(p): fitted.values[one.value_key(p)]
        for plain, fitted in found
        if plain.yielding
        for one in case.contact
        for p in one.free
        if one.value_key(p) in fitted.values
    }


def _from_plainer(case: Case, effect: Effect, found: Fits) -> Starts:
    """Return where a richer law's fit starts by what its plainer one was fitted to, if it was."""
    if effect.alike is None:
        return []
    starts = []
    for plain, fitted in found:
        if plain.name == effect.alike.plainer:
            alike = {**fitted.values, **imitating(case, effect, plain, fitted)}
            hardly = above(case, effect, fitted, HARDLY)
            starts += [alike, {**alike, **hardly}]
    return starts


def above(case: Case, effect: Effect, fitted: Fit, times: float) -> dict[str, float]:
    """Return the numbers of a richer law that stand above another, so many times it."""
    return {
        effect.value_key(p): times * float(value_of(fitted.rig, case.control, p.above))
        for p in effect.free
        if p.above
    }


def little_richer(case: Case, law: Effect, plain: Effect, fitted: Fit) -> Starts:
    """Return values by which a richer law is a little more than the plain one that was fitted.

    None where it does not hold that one.
    """
    if law.alike is not None and law.alike.plainer == plain.name:
        alike = {**fitted.values, **imitating(case, law, plain, fitted)}
        shape = {law.value_key(p): p.starts[0] for p in law.free if p.shape}
        each = [{key: k * value for key, value in shape.items()} for k in SHAPES]
        levels = [above(case, law, fitted, times) for times in (HARDLY, RICHER)]
        return [{**alike, **one, **more} for one in each for more in levels]
    if law.even is None or law.even[0] != plain.name:
        return []
    level = fitted.values[plain.value_key(plain.free[0])]
    if level <= 0.0:
        return []
    both = {law.value_key(p): level for p in law.free}
    first = law.value_key(law.free[0])
    return [{**fitted.values, **both, first: HARDLY * level}]


def foretold(
    case: Case,
    law: Effect,
    plain: Effect,
    fitted: Fit,
    part: Part = "fitted",
    tries: Starts | None = None,
) -> float | None:
    """Return the log-likelihood that a richer law is foretold to gain over a plain one.

    On the part of the record that was fitted, by a little of what it has more, or by what is to be
    tried. All of that goes along, by its slopes. None where that cannot be foretold.
    """
    tries = little_richer(case, law, plain, fitted) if tries is None else tries
    keys, slope = slope_of(plain, fitted)
    if slope is None or not tries:
        return None
    ours = of_a_slope(case, fitted, keys)
    rows = np.concatenate([output.rows(part) for output in ours])
    now = np.concatenate([output.residual(fitted.rig, wide=True) for output in ours])
    if len(now) != len(slope.left):
        return None
    base, left = np.linalg.qr(slope.jacobian[rows])[0], now[rows]
    effects = [law if one is plain else one for one in fitted.effects]
    effects += case.nuisances(effects)
    most = 0.0
    for values in tries:
        rig = possible(case.nominal, case.control, effects, {**case.neutral, **values})
        if rig is None:
            return None
        go_on()
        there = np.concatenate([output.residual(rig, wide=True) for output in ours])
        less, power, _ = turned(left, base, (there - now)[rows])
        if law.even is None:  # no breakaway is under the running friction
            less = max(less, 0.0)
        most = max(most, 0.5 * less * less / power if power > 0.0 else 0.0)
    memories = max(memory(output.residual(fitted.rig, part, wide=True)) for output in ours)
    return most / (float(np.mean(left**2)) * memories)


def turned(left: Floats, base: Floats, turn: Floats) -> tuple[float, float, Floats]:
    """Return by how much a residual's turn goes against it, its own square, and what goes along.

    But for what goes along with the slopes of other numbers, which `base` spans.
    """
    along = base.T @ turn
    own = turn - base @ along
    return -float(left @ own), float(own @ own), along


def slope_of(plain: Effect, fitted: Fit) -> tuple[tuple[str, ...], Slope | None]:
    """Return the numbers that were fitted with a law's level, and how the residual goes by them."""
    key = plain.value_key(plain.free[0])
    return next((each for each in fitted.slopes.items() if key in each[0]), ((), None))


def of_a_slope(case: Case, fitted: Fit, keys: Sequence[str]) -> list[Output]:
    """Return the outputs by which numbers were fitted together."""
    every = (*fitted.effects, *case.nuisances(fitted.effects))
    together = [one for one in every if any(one.value_key(p) in keys for p in one.free)]
    return touched(case.outputs, together)
