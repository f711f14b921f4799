"""Screening: the projection of the residual on each effect's own signature, in milliseconds.

A signature is taken at sizes over three decades, since friction, play and rate limits do nothing
at one size and everything at another; the projection itself is free of scale. The size that
leaves least is where a fit starts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coupled.gap.case import Case
from coupled.gap.effects import Effect, apply
from coupled.gap.fit import Fit, touched
from coupled.rig.parameters import Rig

SCREENED = 6
SIZES = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0)  # times where a parameter starts
FACTORS = (-3.0, -1.0, 0.3, 1.0, 3.0, 10.0)  # the same for how far a factor is from 1


def screen(
    case: Case, current: Fit, candidates: Sequence[Effect]
) -> list[tuple[Effect, dict[str, float]]]:
    """Return the candidates whose signature takes most of the residual, and where to start."""
    scores = []
    for effect in candidates:
        ours = touched(case.outputs, [effect])
        now = np.concatenate([output.residual(current.rig) for output in ours])
        best, least, start = 0.0, np.inf, {}
        for values in _sizes(effect):
            rig = _with(case, current, effect, values)
            left = np.concatenate([output.residual(rig) for output in ours])
            sign = now - left
            size = float(sign @ sign)
            best = max(best, float(now @ sign) ** 2 / size if size > 0.0 else 0.0)
            if float(left @ left) < least:
                least, start = float(left @ left), values
        scores.append((best, effect, start))
    scores.sort(key=lambda item: -item[0])
    return [(effect, start) for _, effect, start in scores[:SCREENED]]


def _with(case: Case, current: Fit, effect: Effect, values: dict[str, float]) -> Rig:
    """Return the current rig with one more effect, of these values."""
    chosen = (*current.effects, effect)
    every = (*chosen, *case.nuisances(chosen))
    known = {**case.neutral, **current.values, **values}
    return apply(case.nominal, case.control, every, known)


def _sizes(effect: Effect) -> list[dict[str, float]]:
    """Return sets of an effect's parameters to try; few where each has to be flown."""
    if not effect.free:
        return [{}]
    found = []
    tries = max(len(p.starts) for p in effect.free)
    flown = effect.stage == "airframe"
    for k in range(1 if flown else len(SIZES)):
        for i in range(tries):
            values = {}
            for p in effect.free:
                start = p.starts[min(i, len(p.starts) - 1)]
                value = start
                if not flown and p.mode == "factor":
                    value = 1.0 + FACTORS[k] * (start - 1.0)
                elif not flown and not p.name.startswith(("bend", "stribeck")):
                    value = SIZES[k] * start
                values[f"{effect.name}.{p.name}"] = float(np.clip(value, p.low, p.high))
            found.append(values)
    return found
