"""Ripple of the loader's force with its deflection, as a residual shows it: where a fit starts.

What δc lacks is taken back to a force by the loader's own equation, r → m·r'' + c·r' + G·r, and
that force is held against sin and cos of 2π·δc/period for many periods: a line in a spectrum, but
over the deflection and not over time.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coupled.gap.noise.smooth import rate_of, smoothed
from coupled.gap.signals.output import Floats, Output
from coupled.gap.thresholds import RIPPLE_LEAST, RIPPLE_PERIODS
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig


def ripples(outputs: Sequence[Output], rig: Rig, control: ControlName) -> list[dict[str, float]]:
    """Return amplitude in N, period in d and phase in rad of the ripple that shows most, if any."""
    ours = [
        output for output in outputs if output.stage == "loader" and "force" not in output.channel
    ]
    if not ours:
        return []
    force = np.concatenate([_missing(output, rig, control) for output in ours])
    way = np.concatenate([smoothed(output.measured) for output in ours])
    smooth = np.column_stack((np.ones_like(way), way, np.abs(way), way**3))
    force = force - smooth @ np.linalg.lstsq(smooth, force, rcond=None)[0]
    span = float(np.ptp(way))
    periods = span / np.arange(RIPPLE_LEAST, RIPPLE_PERIODS, 0.25)
    waves = [_wave(force, way, period) for period in periods.tolist()]
    best = max(range(len(waves)), key=lambda i: float(np.hypot(*waves[i])))
    sine, cosine = waves[best]
    return [
        {
            "ripple_N": float(np.hypot(sine, cosine)),
            "period_{d}": float(periods[best]),
            "phase_rad": float(np.arctan2(cosine, sine)),
        }
    ]


def _missing(output: Output, rig: Rig, control: ControlName) -> Floats:
    """Return the force that the loader would have to have had against it beside, N."""
    data = rig.controls[control]
    loader, rate_Hz = data.loader, output.frame_rate_Hz
    left = smoothed(output.residual(rig) * output.floor)
    speed = rate_of(left, rate_Hz)
    gradient = float(np.mean(data.schedule.total_gradient))
    moved = loader.mass * rate_of(speed, rate_Hz) + loader.damping * speed
    return np.asarray(-(moved + gradient * left))


def _wave(force: Floats, way: Floats, period: float) -> tuple[float, float]:
    """Return the parts of a force in N that go as sin and cos of 2π·way/period."""
    turn = 2.0 * np.pi * way / period
    waves = np.column_stack((np.sin(turn), np.cos(turn)))
    sine, cosine = np.linalg.lstsq(waves, force, rcond=None)[0]
    return float(sine), float(cosine)
