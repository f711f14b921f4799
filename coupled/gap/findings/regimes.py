"""An effect's size in halves of the records, divided by each signal of its stage.

The size in a half is relative to that in all records, with a standard error from the scatter
between stretches.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtr, stdtrit

from coupled.gap.findings.where import signals
from coupled.gap.noise.smooth import smoothed
from coupled.gap.search.case import Case
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import LEAST_HOLD, LEAST_OF_A_HALF
from coupled.record.record import Record

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Regime:
    """An effect's size in two halves of the records, relative to its size in all, with errors.

    `by` is the signal that divides the records, `low` the half in which it is smaller. `freedom`
    is the number of degrees of freedom of the errors.
    """

    by: str
    low: float
    high: float
    low_error: float
    high_error: float
    freedom: float

    def apart(self, chance: float) -> float:
        """Return the difference of the sizes beyond that which has the probability `chance`.

        The difference expected by chance is subtracted in squares.
        """
        error = math.hypot(self.low_error, self.high_error)
        errors = float(stdtrit(self.freedom, 1.0 - min(chance, 1.0) / 2.0))
        return math.sqrt(max((self.high - self.low) ** 2 - (errors * error) ** 2, 0.0))

    @property
    def p_value(self) -> float:
        """The p-value of the difference if the sizes are equal (two-sided t test)."""
        error = math.hypot(self.low_error, self.high_error)
        if error == 0.0:
            return 1.0
        away = abs(self.high - self.low) / error
        return float(2.0 * stdtr(self.freedom, -away))

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        sizes = {"low": self.low, "high": self.high}
        errors = {"low_error": self.low_error, "high_error": self.high_error}
        return {"by": self.by, **sizes, **errors, "p": self.p_value}


@dataclass(frozen=True)
class Acts:
    """An effect's contribution to one output and the residual with all effects, in floors."""

    output: Output
    record: Record
    action: Floats
    left: Floats


def regimes(case: Case, acts: Sequence[Acts]) -> tuple[Regime, ...]:
    """Return the sizes in halves by every signal that divides the effect's contribution."""
    by: dict[str, list[tuple[Acts, Floats]]] = {}
    for one in acts:
        for name, signal in _dividing(case, one).items():
            by.setdefault(name, []).append((one, signal))
    if len({one.output.record for one in acts}) > 1:
        by["record"] = [(one, np.full(len(one.left), float(one.output.record))) for one in acts]
    # If the floor is a model error, it may have one sign throughout a half.
    lasting = 1.0 if case.model_error_in_floors else 0.0
    found = (_regime(name, parts, lasting) for name, parts in by.items())
    return tuple(one for one in found if one is not None)


def _dividing(case: Case, one: Acts) -> dict[str, Floats]:
    """Return the signals by which an output's frames are divided into halves."""
    found = dict[str, Floats]()
    for name, signal in signals(one.output, one.left, one.record, case.control).items():
        if name.endswith("sign"):
            if "rate" in name:
                found[name] = signal
        elif name == "time_s" or "pressure" in name:
            found[name] = signal
            if "rate" in name:  # separates hysteresis, independent of the rate, from a lag
                found[f"size of {name}"] = np.abs(signal)
        elif "cubed" not in name:
            found[f"size of {name}"] = np.abs(signal - float(np.median(signal)))
    pressure = "dynamic_pressure_Pa"
    if pressure in one.record:
        found[pressure] = smoothed(one.record[pressure])
    return {name: signal for name, signal in found.items() if np.ptp(signal) > 0.0}


def _regime(by: str, parts: Sequence[tuple[Acts, Floats]], lasting: float) -> Regime | None:
    """Return the sizes in two halves with equal power of the contribution; None if impossible.

    `lasting` is the rms of an error that may be constant in a half, in floors.
    """
    signal = np.concatenate([signal for _, signal in parts])
    action = np.concatenate([one.action for one, _ in parts])
    left = np.concatenate([one.left for one, _ in parts])
    number = np.concatenate([1000 * one.output.record + one.output.stretches for one, _ in parts])
    power = action**2
    total = float(power.sum())
    if total <= 0.0:
        return None
    order = np.argsort(signal, kind="stable")
    reached = np.cumsum(power[order]) / total
    middle = float(signal[order][int(np.searchsorted(reached, 0.5))])
    low = signal < 0.0 if by.endswith("sign") else signal < middle
    high = signal > 0.0 if by.endswith("sign") else signal >= middle
    if min(float(power[low].sum()), float(power[high].sum())) < LEAST_OF_A_HALF * total:
        return None
    sizes = [_size(action[rows], left[rows], number[rows], lasting) for rows in (low, high)]
    (a, a_error, a_held), (b, b_error, b_held) = sizes
    if min(a_held, b_held) < LEAST_HOLD:
        return None
    squares = (a_error**2, b_error**2)
    apart = squares[0] ** 2 / (a_held - 1.0) + squares[1] ** 2 / (b_held - 1.0)
    freedom = sum(squares) ** 2 / apart if apart > 0.0 else math.inf  # Welch
    return Regime(by, 1.0 + a, 1.0 + b, a_error, b_error, freedom)


def _size(
    action: Floats, left: Floats, number: NDArray[np.intp], lasting: float = 0.0
) -> tuple[float, float, float]:
    """Return the relative error of an action in a residual, its standard error and sample size.

    The standard error is from a jackknife over stretches, plus a `lasting` error of the residual,
    rms, in proportion to the action. The sample size is the effective number of stretches with
    the action (Kish): two, if a limit is reached in two stretches only.
    """
    power = float(action @ action)
    more = float(left @ action) / power
    names, at = np.unique(number, return_inverse=True)
    scores, held = np.zeros(len(names)), np.zeros(len(names))
    np.add.at(scores, at, (left - more * action) * action)
    np.add.at(held, at, action**2 / power)
    scores /= np.maximum(1.0 - held, 1e-9)
    freedom = len(names) / max(len(names) - 1, 1)
    scatter = math.sqrt(float(scores @ scores) / freedom) / power
    error = math.hypot(scatter, lasting / math.sqrt(power / len(action)))
    return more, error, 1.0 / float(held @ held)
