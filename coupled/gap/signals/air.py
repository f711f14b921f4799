"""How the air moves, by kinematics alone, without any aerodynamics.

    w = ḣ − V·sin(θ − α),

with ḣ from the load factor, held to the altitude. The model is then flown through that air: a
gust is accepted where the *pitch rate* follows it, which had no part in finding it.

The noise in w is white, that of turbulence falls as 1/ω²: the smoother is Whittaker's with first
differences, which is Wiener's for such a signal, H = S_w/(S_w + S_n). What is wrong with its
outcome, noise passed and air lost, has the spectrum H·S_n then, and is known without the air.
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
from coupled.gap.signals.output import heard, white
from coupled.gap.thresholds import STIFFEST_AIR
from coupled.record.record import Record

Floats = NDArray[np.float64]
NEEDS = ("alpha_rad", "pitch_rad", "true_airspeed_m_per_s", "altitude_m")
LOAD = "load_factor"
GRAVITY_m_per_s2 = 9.80665


@dataclass(frozen=True)
class Air:
    """The air's vertical speed over a record, m/s, shape (frames,), and what is wrong with it."""

    speed: Floats
    rms: float  # of the true air: the rough one's less its noise
    error: Floats  # a sample of the error, m/s


def can_tell_air(records: Sequence[Record]) -> bool:
    """Tell whether the records have what the kinematics of the air need."""
    return all(name in record for record in records for name in NEEDS)


def vertical_air(record: Record, frame_s: float, seed: int = 43) -> Air | None:
    """Return how fast the air rises at each frame, or None where channels lack."""
    if not can_tell_air([record]):
        return None
    alpha, pitch, speed, _ = (record[name] for name in NEEDS)
    rng = np.random.default_rng(seed)
    climb, climb_error = _climb(record, frame_s, rng)
    rough = climb - smoothed(speed) * np.sin(pitch - alpha)
    level = heard(rough)
    smoother = Smoother.of(rough, (1,))
    smooth = smoother.smooth(rough)
    error = smoother.wiener_error(level, len(rough), rng) + climb_error
    # The smoother takes some of a faint gust with the noise, which its own rms would miss.
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
    # JSBSim tells the acceleration that led to a frame: the next one holds that of this frame.
    normal = np.append(load[1:], load[-1]) * GRAVITY_m_per_s2
    attack = smoothed(alpha)
    # What the aircraft feels along its path is of its thrust and drag, and of a part of its lift.
    path = rate_of(smoothed(speed), 1.0 / frame_s)
    path += GRAVITY_m_per_s2 * np.sin(smoothed(pitch - alpha))
    ahead = (path + normal * np.sin(attack)) / np.cos(attack)
    upward = normal * np.cos(pitch) + ahead * np.sin(pitch) - GRAVITY_m_per_s2
    sigma = GRAVITY_m_per_s2 * white(load), white(height)
    noise = rng.normal(0.0, sigma[0], len(height)), rng.normal(0.0, sigma[1], len(height))
    return _held(upward, height, frame_s, sigma), _held(*noise, frame_s, sigma)


def _held(upward: Floats, height: Floats, frame_s: float, sigma: tuple[float, float]) -> Floats:
    """Return the integral of an acceleration, m/s, held to a height, each by its noise `sigma`.

    Least squares in both: what the twice integrated acceleration d lacks of the height solves
    (I + λ·D₂ᵀD₂)·d = h − ∬a with λ = (σ_h/(σ_a·Δt²))².
    """
    climbs = _summed(upward, frame_s)
    lacks = height - _summed(climbs, frame_s)
    frames = np.arange(len(height))
    slow = Polynomial.fit(frames, lacks, 6)(frames)  # what would cost the equations digits
    weight = min((sigma[1] / max(sigma[0] * frame_s**2, 1e-12)) ** 2, STIFFEST_AIR)
    drift = slow + _whittaker(lacks - slow, weight)
    return np.asarray(climbs + np.gradient(drift, frame_s))


def _summed(rate: Floats, frame_s: float) -> Floats:
    """Return the integral of a rate from the first frame on, by trapezia, same shape."""
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
    """Return the relative standard error of the gusts' rms, from how few of them a record meets.

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
