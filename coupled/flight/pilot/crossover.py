"""The crossover model of a pilot, and the remnant.

McRuer and Jex (1967): a pilot adapts so that, around the crossover frequency, pilot and
controlled element together are ω_c/s with a delay. Here

    Y_p = K·(T_L·s + 1)/(T_I·s + 1)·(1 + ω_I/s)·e^(−τs)

where either lead T_L or lag T_I gives the phase margin, and K the frequency. All is computed in the
discrete time of the frames, in which the pilot acts, so the result is exact.

The remnant is noise that the pilot adds. Kleinman, Baron and Levison (1970): white noise on the
displayed quantity, of covariance π·ρ·σ² with ρ = 0.01 (−20 dB) for a practised pilot and σ² the
mean square of that quantity. Here a first-order lag, the muscle's, filters it, so that the pilot's
lead does not amplify its high frequencies; σ² is the mean square of the last seconds.
"""

from __future__ import annotations

import cmath
import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from coupled.rig.packing import first_order_gain

_MOST_rad = math.radians(80.0)  # largest lead or lag of a pilot: T_L = 5.7/ω_c
_MEMORY_s = 5.0  # of the mean square that scales the remnant


@dataclass(frozen=True)
class Compensation:
    """A pilot's compensation in one loop: gain, lead or lag in s, and integral rate in 1/s."""

    gain: float
    lead_s: float
    lag_s: float
    integral_per_s: float


class CompensationFilter:
    """The discrete filter of a compensation, with its state."""

    def __init__(self, pilot: Compensation, frame_s: float) -> None:
        self._pilot, self._frame_s = pilot, frame_s
        self._last: float | None = None
        self._lagged = self._integral = 0.0

    def __call__(self, error: float) -> float:
        """Return the output for an error."""
        p, h = self._pilot, self._frame_s
        before = error if self._last is None else self._last
        self._last = error
        led = error + p.lead_s * (error - before) / h
        self._lagged += (led - self._lagged) / (1.0 + p.lag_s / h)
        self._integral += p.integral_per_s * h * self._lagged
        return p.gain * (self._lagged + self._integral)


class Delay:
    """A delay of any length, with linear interpolation between frames."""

    def __init__(self, delay_s: float, frame_s: float) -> None:
        whole, self._part = divmod(delay_s / frame_s, 1.0)
        self._past: deque[float] = deque([0.0] * (int(whole) + 2), maxlen=int(whole) + 2)

    def __call__(self, value: float) -> float:
        """Return the delayed value."""
        self._past.append(value)
        return (1.0 - self._part) * self._past[1] + self._part * self._past[0]


class Remnant:
    """A pilot's remnant on one error, frame by frame."""

    def __init__(self, ratio: float, lag_s: float, frame_s: float, seed: int) -> None:
        self._rng = np.random.default_rng([seed, 61])
        self._level = math.sqrt(math.pi * ratio / frame_s)
        self._lag, self._memory = (first_order_gain(t, frame_s) for t in (lag_s, _MEMORY_s))
        self._square = self._noise = 0.0

    def __call__(self, error: float) -> float:
        """Return the noise on an error, in its unit."""
        self._square += self._memory * (error * error - self._square)
        white = self._level * math.sqrt(self._square) * self._rng.standard_normal()
        self._noise += self._lag * (white - self._noise)
        return self._noise


def delay_response(delay_s: float, frame_s: float, rate: float) -> complex:
    """Return the frequency response of `Delay` at a frequency in rad/s."""
    whole, part = divmod(delay_s / frame_s, 1.0)
    back = cmath.exp(-1j * rate * frame_s)
    return back ** int(whole) * (1.0 - part + part * back)


def compensation_response(pilot: Compensation, frame_s: float, rate: float) -> complex:
    """Return the frequency response of `CompensationFilter` at a frequency in rad/s."""
    slope = _slope(frame_s, rate)
    shape = (1.0 + pilot.lead_s * slope) / (1.0 + pilot.lag_s * slope)
    return pilot.gain * shape * (1.0 + pilot.integral_per_s / slope)


def adapt(
    element: complex, crossover: float, margin: float, integral: float, frame_s: float
) -> Compensation | float:
    """Return the compensation for a given crossover and margin, or the phase that it lacks.

    `element` is the response of the controlled element, with delay and limbs, at the crossover in
    rad/s; `margin` in rad. A number is the required lead in rad (lag negative) beyond a pilot's
    limit.
    """
    slope = _slope(frame_s, crossover)
    rest = element * (1.0 + integral / slope)
    phase = cmath.phase(cmath.exp(1j * (margin - math.pi)) / rest)
    if abs(phase) > _MOST_rad:
        return phase
    time = math.tan(abs(phase)) / (slope.imag - slope.real * math.tan(abs(phase)))
    lead, lag = (time, 0.0) if phase > 0.0 else (0.0, time)
    shape = (1.0 + lead * slope) / (1.0 + lag * slope)
    return Compensation(1.0 / abs(rest * shape), lead, lag, integral)


def _slope(frame_s: float, rate: float) -> complex:
    """Return the frequency response of a difference from frame to frame, per second."""
    return (1.0 - cmath.exp(-1j * rate * frame_s)) / frame_s
