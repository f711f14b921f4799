"""Where inside a stage the gap lies: what it follows, at which frequency, since when.

The residual of the nominal rig is held against the stage's own signals, each alone: the share of
its variance that a straight line on that signal takes, and its slope. Onset is the first half
second whose residual stands clear of the floor and is followed by more.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import bilinear, welch

from coupled.gap.flexible import free_share
from coupled.gap.output import Output
from coupled.gap.smooth import rate_of, smoothed
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
WINDOW_s = 0.5
LOUD = 2.0  # floors from which a window shows the gap
TOLD = 0.05  # least share of the variance that is worth telling


def where(output: Output, rig: Rig, record: Record, control: ControlName) -> dict[str, Any]:
    """Return what an output's residual `follows`, its `peak_Hz`, `onset_s`, and more.

    `loud` is the share of time that shows it, `by_pressure` its gap in each third of the q̄ met.
    Slopes are in the channel's unit per the signal's.
    """
    left = output.residual(rig)
    found: dict[str, Any] = {
        "channel": output.channel,
        "follows": _follows(output, left, record, control),
    }
    found |= _in_time(left, record.time_s, output.frame_rate_Hz)
    pressure = "dynamic_pressure_Pa"
    if pressure in record and np.ptp(record[pressure]) > 0.0:
        found["by_pressure"] = _by(left, smoothed(record[pressure]))
    return found


def remains(output: Output, improved: Rig, record: Record, control: ControlName) -> dict[str, Any]:
    """Return what the effects found leave of an output: its gap, what that follows, its frequency.

    `free_share` is what a model free in form could still take of it, as a function of the signal
    `free_in`, or of all.
    """
    left, answers = output.residual(improved), _response(output, improved, record, control)
    known = signals(output.stage, record, control, output.frame_rate_Hz)
    share, signal = free_share(output, left, known, answers)
    return {
        "gap": output.gap(improved),
        "follows": _follows(output, left, record, control),
        "peak_Hz": _peak(left, output.frame_rate_Hz),
        "free_share": share,
        "free_in": signal,
    }


def _response(
    output: Output, rig: Rig, record: Record, control: ControlName
) -> tuple[Floats, Floats] | None:
    """Return the digital filter by which a loader answers to a force, at its mean gradient."""
    name = channel(control, "gradient")
    if output.stage != "loader" or name not in record:
        return None
    loader = rig.controls[control].loader
    second = [loader.mass, loader.damping, max(float(np.mean(record[name])), 1.0)]
    above, below = bilinear([1.0], second, output.frame_rate_Hz)
    return np.asarray(above), np.asarray(below)


def signals(stage: str, record: Record, control: ControlName, rate_Hz: float) -> dict[str, Floats]:
    """Return the signals that a stage's gap may follow, by name with unit, as far as recorded."""
    d = unit_of(control)
    names = {
        "loader": (("force", "N"), ("computed", d)),
        "multiplier": (("computed", d), ("gradient", f"N_per_{d}")),
        "linkage": (("force", "N"), ("computed", d)),
        "surface": (("estimate", d),),
    }
    found: dict[str, Floats] = {}
    for quantity, unit in names.get(stage, ()):
        name = channel(control, quantity)
        if name not in record:
            continue
        calm = smoothed(record[name])
        found[f"{quantity}_{unit}"] = calm
        if quantity in ("computed", "estimate"):
            rate = rate_of(calm, rate_Hz)
            found[f"{quantity}_rate_{unit}_per_s"] = rate
            found[f"{quantity}_rate_sign"] = _sign(rate)
            found[f"{quantity}_cubed_{unit}3"] = calm**3
            found[f"{quantity}_sign"] = _sign(calm)
    common: dict[str, tuple[str, ...]] = {
        "loader": ("load_factor",),
        "schedule": ("dynamic_pressure_Pa",),
        "surface": ("dynamic_pressure_Pa",),
        "airframe": ("elevator_rad", "pitch_rate_rad_per_s", "alpha_rad"),
    }
    for name in common.get(stage, ()):
        if name in record:
            found[name] = smoothed(record[name])
    if stage == "schedule" and "dynamic_pressure_Pa" in found:
        found["dynamic_pressure_rate_Pa_per_s"] = rate_of(found["dynamic_pressure_Pa"], rate_Hz)
    found["time_s"] = record.time_s
    return found


def _sign(signal: Floats) -> Floats:
    """Return the sign of a signal, nothing where it is too small to have one."""
    return np.where(np.abs(signal) > 0.05 * np.sqrt(np.mean(signal**2)), np.sign(signal), 0.0)


def _follows(
    output: Output, left: Floats, record: Record, control: ControlName
) -> list[dict[str, Any]]:
    """Return what the residual follows, the largest share first; `constant` is its mean."""
    power = float(np.mean(left**2))
    mean = float(np.mean(left))
    told: list[dict[str, Any]] = [
        {"signal": "constant", "share": mean**2 / power, "per_unit": mean * output.floor}
    ]
    spread = left - mean
    for name, signal in signals(output.stage, record, control, output.frame_rate_Hz).items():
        moved = signal - signal.mean()
        size = float(moved @ moved)
        if size <= 0.0:
            continue
        slope = float(spread @ moved) / size
        share = slope**2 * size / (len(left) * power)
        told.append({"signal": name, "share": share, "per_unit": slope * output.floor})
    told.sort(key=lambda item: -item["share"])
    return [item for item in told if item["share"] >= TOLD][:4]


def _in_time(left: Floats, time_s: Floats, rate_Hz: float) -> dict[str, Any]:
    window = max(1, round(WINDOW_s * rate_Hz))
    count = len(left) // window
    rms = np.sqrt(np.mean(left[: count * window].reshape(count, window) ** 2, axis=1))
    loud = rms > LOUD
    found: dict[str, Any] = {"peak_Hz": _peak(left, rate_Hz), "loud": float(np.mean(loud))}
    if loud.any():
        found["onset_s"] = float(time_s[int(np.argmax(loud)) * window])
    return found


def _peak(left: Floats, rate_Hz: float) -> float:
    frequency, density = welch(left, rate_Hz, nperseg=min(len(left), round(8.0 * rate_Hz)))
    return float(frequency[1:][np.argmax(density[1:])])


def _by(left: Floats, pressure: Floats) -> list[dict[str, float]]:
    """Return the gap in the lower, middle and upper third of the record's q̄."""
    edges = np.linspace(pressure.min(), pressure.max(), 4)
    found = []
    for low, high in pairwise(edges.tolist()):
        rows = (pressure >= low) & (pressure <= high)
        if rows.any():
            gap = float(np.sqrt(np.mean(left[rows] ** 2)))
            found.append({"from_Pa": low, "to_Pa": high, "gap": gap})
    return found
