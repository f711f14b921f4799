"""K in service: the structure's bend, estimated in flight from F, δc and δ.

The grip is at δ = x + K·F, x being the servo's answer to δc. Servo and δc are known, so

    y = δ − x = K·F + b

is a line with slope K and the transducer's zero as intercept. It is fitted by recursive least
squares with exponential forgetting (Ljung and Söderström 1983, ch. 2; here in information form).
The variance is that of weighted least squares with equal noise, A⁻¹·B·A⁻¹ with B the sums of
squared weights, times (1 + ρ)/(1 − ρ) for residuals with lag-one correlation ρ. The fit pauses,
without forgetting, if the hand moves too little or no new sample came.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from coupled.live.servo import Servo
from coupled.rig.parameters import Control

MEMORY_s = 10.0  # time constant of the forgetting, counted while the hand moves
LEAST_N = 3.0  # standard deviation of F over a second below which the fit pauses
FIRST_s = 2.0  # time of motion before the first estimate
ALARM = 4.0  # standard errors: a healthy rig exceeds 2 now and then in an hour
ALARM_SHARE = 0.05  # of the calibrated K, for errors of servo and backlash in the rig file
ALARM_AFTER_s = 1.0
ADAPT_EVERY_s = 0.25
ADAPT_TIME_s = 4.0  # time constant of K̂
ADAPT_SHARE_per_s = 0.05  # largest rate of K̂, of the calibrated K
ADAPT_SURE = 0.1  # half an interval over K, above which K̂ is not changed
ADAPT_BOUNDS = (0.5, 2.0)  # on the calibrated K
STABLE = 0.8  # K̂·G_T


@dataclass(frozen=True)
class ServiceBend:
    """The estimate of K: d/N, with its standard error; None before the first estimate.

    `excitation_N` is the weighted standard deviation of F; `frozen`: the fit pauses; `alarm`: K
    differs from the calibrated one.
    """

    bend: float | None
    error: float | None
    excitation_N: float
    frozen: bool
    alarm: bool

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON for manifest and page, with the 95 % interval."""
        found: dict[str, Any] = dict(vars(self))
        if self.bend is not None and self.error is not None:
            found |= {"low": self.bend - 1.96 * self.error, "high": self.bend + 1.96 * self.error}
        return found


class BendEstimator:
    """Estimates K of one control; `control` is its section of the rig, with the servo."""

    def __init__(self, control: Control, frame_s: float, memory_s: float = MEMORY_s) -> None:
        found = control.calibration
        self._servo = Servo(control, frame_s)
        self._kept = math.exp(-frame_s / memory_s)
        self._second = math.exp(-frame_s)
        self._frame_s = frame_s
        self.calibrated = control.compensation.bend
        self._calibrated_error = found.bend_error if found.readings else 0.0
        self._sums = np.zeros(5)  # of 1, F, F², y, F·y
        self._squares = np.zeros(3)  # of the squared weights of 1, F, F²
        self._apart = [0.0, 0.0, 0.0]  # of r², r·r before, and the last r
        self._mean = self._variance = 0.0
        self._moving_s = self._beyond_s = 0.0
        self._started = self._alarm = False
        self.now = ServiceBend(None, None, 0.0, True, False)

    def update(
        self, force: float, computed: float, deflection: float, *, fresh: bool = True
    ) -> ServiceBend:
        """Process a frame's F in N, δc and δ in d, and return the estimate.

        A frame that is not `fresh` repeats the sample before it and is not used.
        """
        if not fresh:
            self._servo.miss()
            self.now = replace(self.now, frozen=True)
            return self.now
        position = self._servo.move(computed)
        if not self._started:
            self._started, self._mean = True, force
        away = force - self._mean
        share = 1.0 - self._second
        self._mean += share * away
        self._variance = self._second * (self._variance + share * away * away)
        known = math.isfinite(deflection) and self._servo.settled
        frozen = self._variance < LEAST_N**2 or not known
        if not frozen:
            self._learn(force, deflection - position)
        if frozen and self.now.frozen:
            return self.now
        self.now = self._estimate(frozen)
        return self.now

    def _learn(self, force: float, gap: float) -> None:
        kept = self._kept
        one = np.array((1.0, force, force * force, gap, force * gap))
        self._sums = kept * self._sums + one
        self._squares = kept * kept * self._squares + one[:3]
        self._moving_s += self._frame_s
        slope, zero = self._line()
        left = gap - slope * force - zero
        square, product, last = self._apart
        self._apart = [kept * square + left * left, kept * product + left * last, left]

    def _line(self) -> tuple[float, float]:
        n, f, ff, y, fy = self._sums.tolist()
        bulk = n * ff - f * f
        if bulk <= 0.0:
            return 0.0, y / n
        slope = (n * fy - f * y) / bulk
        return slope, (y - slope * f) / n

    def _estimate(self, frozen: bool) -> ServiceBend:
        n, f, ff = self._sums[:3].tolist()
        spread = math.sqrt(max(ff / n - (f / n) ** 2, 0.0)) if n > 0.0 else 0.0
        if self._moving_s < FIRST_s or spread == 0.0:
            return ServiceBend(None, None, spread, frozen, self._alarm)
        slope, _ = self._line()
        square, product, _ = self._apart
        alike = min(max(product / square, 0.0), 0.99) if square > 0.0 else 0.0
        n2, f2, ff2 = self._squares.tolist()
        # The row of A⁻¹ for the slope is (−f, n)/(n·ff − f²); B is of the squared weights.
        across = (f * f * n2 - 2.0 * f * n * f2 + n * n * ff2) / (n * ff - f * f) ** 2
        error = math.sqrt(square / n * across * (1.0 + alike) / (1.0 - alike))
        away = abs(slope - self.calibrated)
        apart = ALARM * math.hypot(error, self._calibrated_error)
        beyond = away > apart and away > ALARM_SHARE * self.calibrated
        if not frozen:
            self._beyond_s = self._beyond_s + self._frame_s if beyond else 0.0
            self._alarm = self._beyond_s >= ALARM_AFTER_s
        return ServiceBend(slope, error, spread, frozen, self._alarm)


class Adaptation:
    """Moves the compensation's K̂ to the estimated K, slowly and within bounds.

    `stiffest` is the schedule's largest G_T in N/d.
    """

    def __init__(self, calibrated: float, stiffest: float) -> None:
        self._calibrated = self.assumed = calibrated
        low, high = ADAPT_BOUNDS
        self._low, self._high = low * calibrated, min(high * calibrated, STABLE / stiffest)
        self._due_s = 0.0

    def update(self, time_s: float, found: ServiceBend) -> float | None:
        """Return the new K̂, d/N; None if it does not change."""
        if time_s < self._due_s:
            return None
        self._due_s = time_s + ADAPT_EVERY_s
        if found.bend is None or found.error is None or found.frozen:
            return None
        if found.bend <= 0.0 or 1.96 * found.error > ADAPT_SURE * found.bend:
            return None
        most = ADAPT_SHARE_per_s * ADAPT_EVERY_s * self._calibrated
        step = (found.bend - self.assumed) * ADAPT_EVERY_s / ADAPT_TIME_s
        wanted = self.assumed + min(max(step, -most), most)
        bounded = min(max(wanted, self._low), self._high)
        if bounded == self.assumed:
            return None
        self.assumed = bounded
        return bounded
