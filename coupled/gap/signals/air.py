"""The motion of the air, from the motion of the aircraft in it.

The vertical speed is from kinematics alone, without aerodynamics: the rate of climb less the flow,

    w = ḣ − V·(sin θ·cos α·cos β − cos θ·(sin φ·sin β + cos φ·sin α·cos β)),

with ḣ integrated from the load factor and corrected by the altitude. The model is then flown
through that air. Gusts are accepted as an effect if the *pitch rate* follows them, which is not
used in the estimate.

No channel has the speed across the heading ψ. It is integrated, from the side force per mass f_y
that the model has in the measured flow, and from the load factor n_z:

    v = ∫(f_y·cos φ + n_z·g·sin φ)·dt − ∫U·dψ − V·(sin β·cos φ − sin α·cos β·sin φ)

with U the speed ahead. The *roll and yaw rates* are not used. The air is still in trim, at the
start.

The noise in both is white, and the spectrum of turbulence falls as 1/ω². The Whittaker smoother
with first differences is the Wiener filter of such a signal, H = S_w/(S_w + S_n). The error of its
output (noise passed and air lost) has the spectrum H·S_n, which does not depend on the air.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Polynomial
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import solveh_banded

from coupled.gap.noise.smooth import Smoother, rate_of, smoothed
from coupled.gap.signals.output import Floats, estimate_noise, white
from coupled.gap.thresholds import SHORT_FRAMES, STIFFEST_AIR
from coupled.record.record import Record
from coupled.rig.rig import Rig
from coupled.units import GRAVITY_m_per_s2

LOAD = "load_factor"
NEEDS = ("alpha_rad", "pitch_rad", "true_airspeed_m_per_s", "altitude_m")
_LATERAL = ("sideslip_rad", "roll_rad", "heading_rad")
NEEDS_ACROSS = (*NEEDS[:3], LOAD, *_LATERAL)


@dataclass(frozen=True)
class Air:
    """The speed of the air in one direction over a record, m/s, shape (frames,), with its error."""

    speed: Floats
    rms: float  # of the air: that of the unsmoothed estimate, without its noise
    error: Floats  # a sample of the error, m/s

    @classmethod
    def of(cls, rough: Floats, error: Floats, rng: np.random.Generator) -> Air:
        """Return the air of an unsmoothed estimate; `error` is a sample of its correlated error."""
        level = estimate_noise(rough)
        smoother = Smoother.of(rough, (1,))
        smooth = smoother.smooth(rough)
        error = smoother.wiener_error(level, len(rough), rng) + error
        # The smoother removes a part of weak gusts with the noise, so two estimates are compared.
        true = max(float(np.var(rough)) - level.rms**2, float(np.var(smooth)))
        return cls(smooth, math.sqrt(true), error)

    @property
    def spread(self) -> float:
        """The relative sampling error of the rms of the gusts.

        The variance of a Gaussian process has N/(Σρ²) independent samples (Bartlett).
        """
        x = self.speed - self.speed.mean()
        power = np.abs(np.fft.rfft(x, 2 * len(x))) ** 2
        correlation = np.fft.irfft(power)[: len(x) // 4] / float(x @ x)
        independent = len(x) / (1.0 + 2.0 * float(np.sum(correlation[1:] ** 2)))
        return float(np.sqrt(0.5 / max(independent, 1.0)))


def vertical_air(record: Record, frame_s: float, side_m_per_s2: Floats | None = None) -> Air | None:
    """Return the vertical speed of the air at each frame; None if channels are missing.

    `side_m_per_s2` is the side force per mass, shape (frames,), which lifts a banked aircraft.
    """
    if any(name not in record for name in NEEDS):
        return None
    rng = np.random.default_rng(43)
    side = np.zeros(len(record)) if side_m_per_s2 is None else side_m_per_s2
    climb, climb_error = _climb(record, frame_s, side, rng)
    rough = climb - smoothed(record["true_airspeed_m_per_s"]) * _flow(record)[2]
    return Air.of(rough, climb_error, rng)


def crossing_air(record: Record, frame_s: float, side_m_per_s2: Floats | None) -> Air | None:
    """Return the speed of the air across the heading; None if channels are missing.

    `side_m_per_s2` is the side force per mass in the measured flow, shape (frames,).
    """
    if side_m_per_s2 is None or any(name not in record for name in NEEDS_ACROSS):
        return None
    rng = np.random.default_rng(44)
    speed, roll = smoothed(record["true_airspeed_m_per_s"]), record["roll_rad"]
    ahead, right, _ = _flow(record)
    normal = _normal(record)
    pushed = side_m_per_s2 * np.cos(roll) + normal * np.sin(roll)
    turned = cumulative_trapezoid(speed * ahead, np.unwrap(record["heading_rad"]), initial=0.0)
    rough = _summed(pushed, frame_s) - turned - speed * right
    rough -= rough[:SHORT_FRAMES].mean()
    noise = rng.normal(0.0, white(roll), len(roll)) * normal
    return Air.of(rough, _summed(noise, frame_s), rng)


def _normal(record: Record) -> Floats:
    """Return the normal force per mass, m/s², upward positive."""
    load = record[LOAD]
    # JSBSim's load factor is that of the frame before: row k + 1 has that of row k.
    return np.append(load[1:], load[-1]) * GRAVITY_m_per_s2


def _flow(record: Record) -> tuple[Floats, Floats, Floats]:
    """Return the shares of the airspeed ahead, to the right and up, in level axes by the heading.

    Without a channel of sideslip or roll its angle is zero.
    """
    alpha, pitch = record["alpha_rad"], record["pitch_rad"]
    beta, roll = _banked(record)
    ahead, right, down = np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)
    below = right * np.sin(roll) + down * np.cos(roll)
    return (
        ahead * np.cos(pitch) + below * np.sin(pitch),
        right * np.cos(roll) - down * np.sin(roll),
        ahead * np.sin(pitch) - below * np.cos(pitch),
    )


def _banked(record: Record) -> list[Floats]:
    return [record[n] if n in record else np.zeros(len(record)) for n in _LATERAL[:2]]


def _climb(
    record: Record, frame_s: float, side: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    """Return the rate of climb, m/s, and a sample of its error, shape (frames,) each."""
    alpha, pitch, speed, height = (record[name] for name in NEEDS)
    if LOAD not in record:
        climb = rate_of(smoothed(height), 1.0 / frame_s)
        noisy = climb + rng.normal(0.0, white(height), len(height))
        return climb, smoothed(noisy) - climb
    normal, attack = _normal(record), smoothed(alpha)
    beta, roll = (smoothed(one) for one in _banked(record))
    # The acceleration along the path is from thrust, drag and a component of lift and side force.
    path = rate_of(smoothed(speed), 1.0 / frame_s)
    path += GRAVITY_m_per_s2 * smoothed(_flow(record)[2])
    along = path - side * np.sin(beta) + normal * np.sin(attack) * np.cos(beta)
    ahead = along / (np.cos(attack) * np.cos(beta))
    level = (normal * np.cos(roll) - side * np.sin(roll)) * np.cos(pitch)
    upward = level + ahead * np.sin(pitch) - GRAVITY_m_per_s2
    sigma = GRAVITY_m_per_s2 * white(record[LOAD]), white(height)
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


def spread_of_air(rig: Rig, record: Record) -> float:
    """Return the relative sampling error of the vertical gusts' rms in a record."""
    air = vertical_air(record, 1.0 / rig.frame_rate)
    return 0.0 if air is None else air.spread


def spread_of_crossing_air(rig: Rig, record: Record) -> float:
    """Return the relative sampling error of the lateral gusts' rms in a record.

    Of the Dryden spectrum: its correlation is e^(−x)·(1 − x/2) over x = V·t/L, and the two-sided
    integral of its square 5/8.
    """
    assert rig.flight is not None
    way_m = float(np.mean(record["true_airspeed_m_per_s"])) * len(record) / rig.frame_rate
    return float(np.sqrt(0.5 / max(way_m / (0.625 * rig.flight.gust_length), 1.0)))
