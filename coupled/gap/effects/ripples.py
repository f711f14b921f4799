"""Ripple of the loader's force with its deflection, as a residual shows it: where a fit starts.

A force that goes as sin or cos of 2π·δc/period moves δc by the loader's own equation,
m·r'' + c·r' + G·r = −F. What that would be is held against the residual for many periods: a line in
a spectrum, but over the deflection and not over time. So noise counts as it stands in δc, where it
is white, and not in a force, which the equation would make of it: that is loud at short periods.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.output import Floats, Output
from coupled.gap.thresholds import RIPPLE_LEAST, RIPPLE_PERIODS, RIPPLES_TRIED
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Complex = NDArray[np.complex128]


def ripples(outputs: Sequence[Output], rig: Rig, control: ControlName) -> list[dict[str, float]]:
    """Return amplitude in N, period in d and phase in rad of the ripples that show most, if any.

    The one that takes most of the residual comes first.
    """
    ours = [
        output for output in outputs if output.stage == "loader" and "force" not in output.channel
    ]
    if not ours:
        return []
    ways = [smoothed(output.measured) for output in ours]
    answers = [_answer(output, rig, control) for output in ours]

    def moved(forces: Sequence[Floats] | Sequence[Complex]) -> Complex:
        each = zip(answers, forces, strict=True)
        return np.concatenate([np.fft.ifft(answer * np.fft.fft(force)) for answer, force in each])

    laws = [[np.ones_like(w), w, np.abs(w), w**3] for w in ways]
    smooth = np.column_stack([moved(law).real for law in zip(*laws, strict=True)])
    smooth = np.linalg.qr(smooth)[0]
    left = np.concatenate([output.residual(rig) * output.floor for output in ours])
    left = left - smooth @ (smooth.T @ left)
    span = max(float(np.ptp(way)) for way in ways)
    periods = span / np.arange(RIPPLE_LEAST, RIPPLE_PERIODS, 0.25)
    waves = []
    for period in periods.tolist():
        turned = moved([np.exp(2j * np.pi * way / period) for way in ways])
        both = np.column_stack((turned.imag, turned.real))  # by sin and by cos
        waves.append(_wave(both - smooth @ (smooth.T @ both), left, period))
    taken = np.array([0.0, *(wave.taken for wave in waves), 0.0])
    peaks = np.flatnonzero((taken[1:-1] > taken[:-2]) & (taken[1:-1] >= taken[2:]))
    best = sorted(peaks.tolist(), key=lambda k: -waves[k].taken)[:RIPPLES_TRIED]
    return [waves[k].values for k in best]


class _Wave(NamedTuple):
    """A ripple's values, and what it takes of the residual's power."""

    values: dict[str, float]
    taken: float


def _wave(both: Floats, left: Floats, period: float) -> _Wave:
    """Return the ripple of one period by what its sine and cosine move, and what is left."""
    sine, cosine = np.linalg.lstsq(both, left, rcond=None)[0]
    values = {
        "ripple_N": float(np.hypot(sine, cosine)),
        "period_{d}": period,
        "phase_rad": float(np.arctan2(cosine, sine)),
    }
    return _Wave(values, float(left @ (both @ np.array([sine, cosine]))))


def _answer(output: Output, rig: Rig, control: ControlName) -> Complex:
    """Return how the loader answers a force against it at each frequency of a transform, d/N."""
    data = rig.controls[control]
    turns = 2.0 * np.pi * np.fft.fftfreq(len(output.measured), 1.0 / output.frame_rate_Hz)
    gradient = float(np.mean(data.schedule.total_gradient))
    stiff = gradient + 1j * turns * data.loader.damping - turns**2 * data.loader.mass
    return np.asarray(-1.0 / np.where(stiff == 0.0, np.inf, stiff))
