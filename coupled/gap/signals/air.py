"""The vertical motion of the air, from kinematics alone, without aerodynamics.

    w = ḣ − V·sin(θ − α),

with ḣ integrated from the load factor and corrected by the altitude. The model is then flown
through that air. Gusts are accepted as an effect if the *pitch rate* follows them, which is not
used in the estimate.

The noise in w is white, and the spectrum of turbulence falls as 1/ω². The Whittaker smoother with
first differences is the Wiener filter of such a signal, H = S_w/(S_w + S_n). The error of its
output (noise passed and air lost) has the spectrum H·S_n, which does not depend on the air.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from coupled.gap.noise.smooth import Smoother, rate_of, smoothed
from coupled.gap.signals.output import estimate_noise, white
from coupled.gap.thresholds import STIFFEST_AIR
from coupled.record.record import Record
from coupled.units import GRAVITY_m_per_s2

Floats = NDArray[np.float64]
NEEDS = ("alpha_rad", "pitch_rad", "true_airspeed_m_per_s", "altitude_m")
LOAD = "load_factor"


@dataclass(frozen=True)
class Air:
    """The vertical speed of the air over a record, m/s, shape (frames,), with its error."""

    speed: Floats
    rms: float  # of the air: that of the unsmoothed estimate, without its noise
    error: Floats  # a sample of the error, m/s


def can_tell_air(records: Sequence[Record]) -> bool:
    """Tell whether the records have the channels that the kinematics need."""
    return all(name in record for record in records for name in NEEDS)


def vertical_air(record: Record, frame_s: float, seed: int = 43) -> Air | None:
    """Return the vertical speed of the air at each frame; None if channels are missing."""
    if not can_tell_air([record]):
        return None
    alpha, pitch, speed, _ = (record[name] for name in NEEDS)
    rng = np.random.default_rng(seed)
    climb, climb_error = _climb(record, frame_s, rng)
    rough = climb - smoothed(speed) * np.sin(pitch - alpha)
    level = estimate_noise(rough)
    smoother = Smoother.of(rough, (1,))
    smooth = smoother.smooth(rough)
    error = smoother.wiener_error(level, len(rough), rng) + climb_error
    # The smoother removes a part of weak gusts with the noise, so two estimates are compared.
    true = max(float(np.var(rough)) - level.rms**2, float(np.var(smooth)))
    return Air(smooth, math.sqrt(true), error)


def _climb(record: Record, frame_s: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """Return the rate of climb, m/s, and a sample of its error, shape (frames,) each."""
    alpha, pitch, speed, height = (record[name] for name in NEEDS)
    if LOAD not in record:
        climb = rate_of(smoothed(height), 1.0 / frame_s)
        noisy = climb + rng.normal(0.0, white(height), len(height))
        return climb, smoothed(noisy) - climb
    load = record[LOAD]
    # JSBSim's load factor is that of the frame before: row k + 1 has that of row k.
    normal = np.append(load[1:], load[-1]) * GRAVITY_m_per_s2
    attack = smoothed(alpha)
    # The acceleration along the path is from thrust, drag and a component of the lift.
    path = rate_of(smoothed(speed), 1.0 / frame_s)
    path += GRAVITY_m_per_s2 * np.sin(smoothed(pitch - alpha))
    ahead = (path + normal * np.sin(attack)) / np.cos(attack)
    upward = normal * np.cos(pitch) + ahead * np.sin(pitch) - GRAVITY_m_per_s2
    sigma = GRAVITY_m_per_s2 * white(load), white(height)
    noise = rng.normal(0.0, sigma[0], len(height)), rng.normal(0.0, sigma[1], len(height))
    return _held(upward, height, frame_s, sigma), _held(*noise, frame_s, sigma)


def _held(upward: Floats, height: Floats, frame_s: float, sigma: tuple[float, float]) -> Floats:
    """Return the integral of an acceleration, m/s, corrected by a height; `sigma` are their noises.

    Least squares in both: the error d of the twice integrated acceleration solves
    (I + λ·D₂ᵀD₂)·d = h − ∬a with λ = (σ_h/(σ_a·Δt²))².
    """
    climbs = _summed(upward, frame_s)
    lacks = height - _summed(climbs, frame_s)
    frames = np.arange(len(height))
    slow = Polynomial.fit(frames, lacks, 6)(frames)  # removed for numerical precision
    weight = min((sigma[1] / max(sigma[0] * frame_s**2, 1e-12)) ** 2, STIFFEST_AIR)
    drift = slow + _whittaker(lacks - slow, weight)
    return np.asarray(climbs + np.gradient(drift, frame_s))


def _summed(rate: Floats, frame_s: float) -> Floats:
    """Return the integral of a rate from the first frame on, by trapezoidal rule, same shape."""
    return np.asarray((np.cumsum(rate) - 0.5 * (rate + rate[0])) * frame_s)


def _whittaker(signal: Floats, weight: float) -> Floats:
    """Return the signal smoothed with second differences, by its banded normal equations."""
    n = len(signal)
    bands = np.zeros((3, n))
    for shift, coefficients in ((0, (1.0, 4.0, 1.0)), (1, (-2.0, -2.0)), (2, (1.0,))):
        for k, coefficient in enumerate(coefficients):
            bands[shift, k : k + n - 2] += weight * coefficient
    bands[0] += 1.0
    return np.asarray(solveh_banded(bands, signal, lower=True))


def spread_of_air(record: Record, frame_s: float) -> float:
    """Return the relative sampling error of the gusts' rms in a record.

    The variance of a Gaussian process has N/(Σρ²) independent samples (Bartlett).
    """
    air = vertical_air(record, frame_s)
    if air is None:
        return 0.0
    x = air.speed - air.speed.mean()
    power = np.abs(np.fft.rfft(x, 2 * len(x))) ** 2
    correlation = np.fft.irfft(power)[: len(x) // 4] / float(x @ x)
    independent = len(x) / (1.0 + 2.0 * float(np.sum(correlation[1:] ** 2)))
    return float(np.sqrt(0.5 / max(independent, 1.0)))
