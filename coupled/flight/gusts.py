"""Vertical gusts: air that rises and sinks, as the Dryden spectrum has it.

White noise through

    H(s) = σ·√(L/(π·V))·(1 + √3·(L/V)·s)/(1 + (L/V)·s)²      (MIL-F-8785C, w component)

with L the scale and V the true airspeed, made discrete by the bilinear rule. The air is still
at the start, where the aircraft is trimmed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.signal import bilinear, lfilter

Floats = NDArray[np.float64]
Step = Callable[[tuple[float, float, float]], None]
_BLOCK = 1024  # frames made at a time


def dryden(
    rms_m_per_s: float, length_m: float, speed_m_per_s: float, frame_s: float, seed: int
) -> Iterator[float]:
    """Yield the air's upward speed in m/s, a frame each, without end."""
    lag = length_m / speed_m_per_s
    gain = rms_m_per_s * np.sqrt(lag / np.pi)
    rise, fall = gain * np.array([np.sqrt(3.0) * lag, 1.0]), [lag**2, 2.0 * lag, 1.0]
    top, bottom = bilinear(rise, fall, 1.0 / frame_s)
    rng = np.random.default_rng([seed, 97])
    memory = np.zeros(2)
    while True:
        # Of unit density over 0 < ω < π/frame.
        hiss = rng.normal(0.0, np.sqrt(np.pi / frame_s), _BLOCK)
        block, memory = lfilter(top, bottom, hiss, zi=memory)
        yield from block.tolist()


def gusty(step: Step, set_air: Callable[[float], None], air_m_per_s: Iterator[float]) -> Step:
    """Return a stepping in which the air over each frame moves up as told."""

    def run(commands: tuple[float, float, float], /) -> None:
        set_air(next(air_m_per_s, 0.0))
        step(commands)

    return run
