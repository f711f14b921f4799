"""A description of a stage's residual: correlated signals, frequency, onset.

The residual is regressed on each of the stage's own signals: the share of its variance that a
straight line explains, and the slope. Onset and end are found by windows of the same excitation
(`onset`).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.gap.findings.flexible import free_share
from coupled.gap.findings.onset import Span, in_time
from coupled.gap.noise.filters import of_second_order
from coupled.gap.noise.lines import SeenLine, widest_line
from coupled.gap.noise.smooth import rate_of, smoothed
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import (
    NEAR_DENSER,
    NEAR_SHARE,
    NO_SIGN,
    WHERE_MOST,
    WHERE_SHARE,
    NEAR_s,
    SPECTRUM_s,
)
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.rig.rig import Rig

AIRFRAME = (
    *("elevator_rad", "pitch_rate_rad_per_s", "alpha_rad"),
    *("aileron_rad", "rudder_rad", "roll_rate_rad_per_s", "yaw_rate_rad_per_s", "sideslip_rad"),
)
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Follows:
    """A signal correlated with a residual: its share of the power, 0 to 1, and the slope.

    `per_unit` is in the channel's unit over the signal's.
    """

    signal: str
    share: float
    per_unit: float

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {"signal": self.signal, "share": self.share, "per_unit": self.per_unit}


@dataclass(frozen=True)
class PressureBand:
    """The gap while q̄ is between two pressures, Pa."""

    from_Pa: float
    to_Pa: float
    gap: float

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {"from_Pa": self.from_Pa, "to_Pa": self.to_Pa, "gap": self.gap}


@dataclass(frozen=True)
class Where:
    """A description of a stage's gap, from the channel in which it is largest.

    `loud` is the share of time with the gap. `begins` and `ends` are None if the excitation can
    explain them; `by_pressure` is empty if q̄ is constant; `line` is None if the spectrum has no
    line.
    """

    channel: str
    follows: tuple[Follows, ...]
    peak_Hz: float
    loud: float
    begins: Span | None = None
    ends: Span | None = None
    by_pressure: tuple[PressureBand, ...] = ()
    line: SeenLine | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON, without unknown values."""
        found: dict[str, Any] = {"channel": self.channel}
        found["follows"] = [item.as_dict() for item in self.follows]
        found |= {"peak_Hz": self.peak_Hz, "loud": self.loud}
        for name, span in (("onset", self.begins), ("end", self.ends)):
            if span is not None:
                found |= {f"{name}_s": span.at_s, f"{name}_95_s": [span.low_s, span.high_s]}
        if self.by_pressure:
            found["by_pressure"] = [band.as_dict() for band in self.by_pressure]
        if self.line is not None:
            found["line"] = self.line.as_dict()
        return found


@dataclass(frozen=True)
class Reversals:
    """A residual concentrated at reversals of motion: its share within a time of one, s."""

    within_s: float
    share: float

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {"within_s": self.within_s, "share": self.share}


@dataclass(frozen=True)
class Remains:
    """A description of the residual of a stage that the effects do not explain.

    `free_share` is the share that a nonparametric model predicts on held-out stretches, 0 to 1,
    as a function of the signal `free_in`, or of all signals (`all`).
    """

    gap: float
    follows: tuple[Follows, ...]
    peak_Hz: float
    free_share: float
    free_in: str
    reversals: Reversals | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        near = {} if self.reversals is None else {"reversals": self.reversals.as_dict()}
        return near | {
            "gap": self.gap,
            "follows": [item.as_dict() for item in self.follows],
            "peak_Hz": self.peak_Hz,
            "free_share": self.free_share,
            "free_in": self.free_in,
        }


def where(output: Output, rig: Rig, record: Record, control: ControlName) -> Where:
    """Return a description of an output's gap, from its residual with this rig."""
    left, rate_Hz = output.residual(rig), output.frame_rate_Hz
    known = signals(output, left, record, control)
    drives = {name: x for name, x in known.items() if not name.endswith(("sign", "3", "time_s"))}
    times = in_time(left, drives, rate_Hz)
    pressure = "dynamic_pressure_Pa"
    varies = pressure in record and np.ptp(record[pressure]) > 0.0
    return Where(
        channel=output.channel,
        follows=_follows(output, left, record, control),
        peak_Hz=_peak(left, rate_Hz),
        loud=times.loud,
        begins=times.begins,
        ends=times.ends,
        by_pressure=_by(left, smoothed(record[pressure])) if varies else (),
        line=widest_line(left, output.floor, rate_Hz),
    )


def remains(output: Output, improved: Rig, record: Record, control: ControlName) -> Remains:
    """Return a description of an output's residual with the effects found."""
    left, answers = output.residual(improved), response(output, improved, record, control)
    known = signals(output, left, record, control)
    share, signal = free_share(output, left, known, answers)
    return Remains(
        gap=output.gap(improved),
        follows=_follows(output, left, record, control),
        peak_Hz=_peak(left, output.frame_rate_Hz),
        free_share=share,
        free_in=signal,
        reversals=_reversals(left, known, output.frame_rate_Hz),
    )


def _reversals(left: Floats, known: dict[str, Floats], rate_Hz: float) -> Reversals | None:
    """Return the time from reversals within which most of a residual lies; None if none."""
    side = next((s for name, s in known.items() if name.endswith("rate_sign")), None)
    if side is None:
        return None
    moving = np.flatnonzero(side)
    turned = np.flatnonzero(np.diff(side[moving]) != 0.0)
    turns = 0.5 * (moving[turned] + moving[turned + 1])
    if not turns.size:
        return None
    frames = np.arange(len(left))
    after = np.searchsorted(turns, frames)
    last, following = turns[np.maximum(after - 1, 0)], turns[np.minimum(after, len(turns) - 1)]
    away_s = np.minimum(np.abs(frames - last), np.abs(following - frames)) / rate_Hz
    power = float(left @ left)
    for within_s in NEAR_s:
        near = away_s <= within_s
        share = float(left[near] @ left[near]) / power
        if share >= NEAR_SHARE and share >= NEAR_DENSER * float(np.mean(near)):
            return Reversals(within_s, share)
    return None


def response(
    output: Output, rig: Rig, record: Record, control: ControlName
) -> tuple[Floats, Floats] | None:
    """Return the digital filter from force to deflection of a loader, at its mean gradient."""
    name = channel(control, "gradient")
    if output.stage != "loader" or name not in record:
        return None
    loader = rig.controls[control].loader
    stiffness = max(float(np.mean(record[name])), 1.0)
    return of_second_order(loader.mass, loader.damping, stiffness, output.frame_rate_Hz)


def signals(
    output: Output, left: Floats, record: Record, control: ControlName, stage: str = ""
) -> dict[str, Floats]:
    """Return the signals compared with an output's residual, by name with unit, if recorded.

    They are those of the output's stage, or of another `stage`. `left` is the residual in floors.
    If motion is imposed, the force is the output: its prediction replaces the measurement, which
    contains the residual that is to be explained.
    """
    d, rate_Hz = unit_of(control), output.frame_rate_Hz
    names = {
        "loader": (("force", "N"), ("computed", d)),
        "multiplier": (("computed", d), ("gradient", f"N_per_{d}")),
        "linkage": (("force", "N"), ("computed", d)),
        "compensation": (("force", "N"), ("computed", d)),
        "surface": (("estimate", d),),
    }
    found: dict[str, Floats] = {}
    for quantity, unit in names.get(stage or output.stage, ()):
        name = channel(control, quantity)
        if name not in record and quantity == "computed":
            name = channel(control, "deflection")  # the motion that was imposed
        if name not in record:
            continue
        answers = quantity == "force" and name == output.channel
        smooth = smoothed(record[name] - left * output.floor if answers else record[name])
        found[f"{quantity}_{unit}"] = smooth
        if quantity in ("computed", "estimate"):
            rate = rate_of(smooth, rate_Hz)
            found[f"{quantity}_rate_{unit}_per_s"] = rate
            found[f"{quantity}_rate_sign"] = _sign(rate)
            found[f"{quantity}_cubed_{unit}3"] = smooth**3
            found[f"{quantity}_sign"] = _sign(smooth)
    common: dict[str, tuple[str, ...]] = {
        "loader": ("load_factor",),
        "schedule": ("dynamic_pressure_Pa",),
        "surface": ("dynamic_pressure_Pa",),
        "airframe": AIRFRAME,
    }
    for name in common.get(output.stage, ()):
        if name in record:
            found[name] = smoothed(record[name])
    if output.stage == "schedule" and "dynamic_pressure_Pa" in found:
        found["dynamic_pressure_rate_Pa_per_s"] = rate_of(found["dynamic_pressure_Pa"], rate_Hz)
    found["time_s"] = record.time_s
    return found


def _sign(signal: Floats) -> Floats:
    """Return the sign of a signal; 0 where the signal is too small."""
    return np.where(np.abs(signal) > NO_SIGN * np.sqrt(np.mean(signal**2)), np.sign(signal), 0.0)


def _follows(
    output: Output, left: Floats, record: Record, control: ControlName
) -> tuple[Follows, ...]:
    """Return the signals correlated with a residual, largest share first; `constant`: its mean."""
    power = float(np.mean(left**2))
    if power == 0.0:
        return ()
    mean = float(np.mean(left))
    found = [Follows("constant", mean**2 / power, mean * output.floor)]
    spread = left - mean
    for name, signal in signals(output, left, record, control).items():
        moved = signal - signal.mean()
        size = float(moved @ moved)
        if size <= 0.0:
            continue
        slope = float(spread @ moved) / size
        share = slope**2 * size / (len(left) * power)
        found.append(Follows(name, share, slope * output.floor))
    found.sort(key=lambda item: -item.share)
    return tuple(item for item in found if item.share >= WHERE_SHARE)[:WHERE_MOST]


def _peak(left: Floats, rate_Hz: float) -> float:
    """Return the frequency, Hz, of the largest power (Welch, segments with half overlap)."""
    many = min(len(left), round(SPECTRUM_s * rate_Hz))
    pieces = np.lib.stride_tricks.sliding_window_view(left, many)[:: many - many // 2]
    level = pieces - np.mean(pieces, axis=1, keepdims=True)
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(many) / many)
    power = np.mean(np.abs(np.fft.rfft(level * taper, axis=1)) ** 2, axis=0)
    power[-1] *= 0.5 if many % 2 == 0 else 1.0  # the Nyquist frequency is not doubled
    return float(np.fft.rfftfreq(many, 1.0 / rate_Hz)[1:][np.argmax(power[1:])])


def _by(left: Floats, pressure: Floats) -> tuple[PressureBand, ...]:
    """Return the gap in the lower, middle and upper third of the record's q̄."""
    edges = np.linspace(pressure.min(), pressure.max(), 4)
    found = []
    for low, high in pairwise(edges.tolist()):
        rows = (pressure >= low) & (pressure <= high)
        if rows.any():
            found.append(PressureBand(low, high, float(np.sqrt(np.mean(left[rows] ** 2)))))
    return tuple(found)
