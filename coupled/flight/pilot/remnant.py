"""The remnant: a pilot's noise.

Kleinman, Baron and Levison (1970): white observation noise of covariance π·ρ·σ² with ρ = 0.01
(−20 dB) for a practised pilot and σ² the mean square of the observed signal. Here it passes the
muscle's first-order lag, so that a pilot's lead does not amplify it at high frequency; σ² is the
mean square of the last seconds.
"""

from __future__ import annotations

import math

import numpy as np

from coupled.rig.packing import first_order_gain

_MEMORY_s = 5.0


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
