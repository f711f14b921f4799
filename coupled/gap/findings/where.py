"""Where a residual lies, since when, and what a nonparametric model predicts of it.

Ridge regressions show whether the stage's own signals predict a residual that the effects leave:
piecewise linear functions of one signal, with knots at its quantiles, lagged copies, the same
filtered by the stage's response, or all signals with their pairwise products. The models are fitted
on every other stretch and compared on the stretches between. The share of variance that a straight
line over each signal explains is given too, with its slope.

Onset and end are found by windows of the same excitation: a gap that grows with the motion is small
while the motion is small, which is no onset. A quiet window is evidence only in comparison with the
loud windows that were excited no more, in every signal that drives the stage. If excitation alone
decided, all windows before the onset would be quiet with probability Π(1 − q), where q is the loud
share of the windows excited no more.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.gap.chain import AIRFRAME as FLOWN
from coupled.gap.noise.lines import SeenLine, widest_line
from coupled.gap.noise.noise import filtered, of_second_order, rms_of
from coupled.gap.noise.smooth import rate_of, smoothed
from coupled.gap.search.course import Bounds
from coupled.gap.signals.output import TRIM, Floats, Output
from coupled.gap.signals.reading import PRESSURE
from coupled.gap.thresholds import (
    BENDS,
    DOUBLED,
    MINOR,
    MORE,
    MOST,
    ONSET_CHANCE,
    RIDGES,
    TINY,
    TRIES,
    LAGS_s,
    SHORTEST_RECORD_s,
    WINDOW_s,
)
from coupled.record.channels import ControlName, channel, unit_of
from coupled.record.record import Record
from coupled.results import Plain
from coupled.rig.rig import Rig

Response = tuple[Floats, Floats]
ALL = "all"


def free_share(
    output: Output, left: Floats, signals: Mapping[str, Floats], response: Response | None = None
) -> tuple[float, str]:
    """Return the share of a residual's power that the best model predicts, 0 to 1, and its signal.

    The share is on held-out stretches; the signal is `ALL` for a model of all signals. `left` is
    the residual in noise floors, shape (frames,), `response` the digital filter from a force inside
    the stage to its output.
    """
    plain = {name: (s - s.mean()) / s.std() for name, s in signals.items() if s.std() > 0.0}
    each = {name: _functions(signal, output.frame_rate_Hz) for name, signal in plain.items()}
    crossed = [a * b for a, b in combinations(plain.values(), 2)]
    if crossed:
        each[ALL] = np.column_stack((*each.values(), *crossed))
    best = 0.0, ""
    for name, columns in each.items():
        answers = [] if response is None else [filtered(*response, columns)]
        best = max(best, (_taken(output, left, np.hstack((columns, *answers))), name))
    return best


def _functions(signal: Floats, rate_Hz: float) -> Floats:
    """Return a model's functions of one signal, shape (frames, functions)."""
    found = [signal, *(np.maximum(signal - bend, 0.0) for bend in np.quantile(signal, BENDS))]
    for lag_s in LAGS_s:
        share = -np.expm1(-1.0 / (lag_s * rate_Hz))
        found.append(filtered([share], [1.0, share - 1.0], signal))
    return np.column_stack(found)


def _taken(output: Output, left: Floats, columns: Floats) -> float:
    """Return the share of the residual's power that the functions predict on held-out stretches.

    These also select the ridge parameter. Cross-validation by single frames would overfit, since
    the residual is autocorrelated.
    """
    fitted = output.rows("fitted")
    remains = np.zeros(len(RIDGES))
    for known in (fitted, ~fitted):
        made = _ridges(columns[known], left[known], columns[~known])
        remains += np.sum((left[~known, None] - made) ** 2, axis=0)
    power = float(left @ left)
    return max(0.0, 1.0 - float(np.min(remains)) / power) if power > 0.0 else 0.0


def _ridges(known: Floats, wanted: Floats, asked: Floats) -> Floats:
    """Return the ridge regressions' predictions, shape (frames, RIDGES)."""
    spread = known.std(axis=0)
    varies = spread > TINY * np.vstack((known, asked)).std(axis=0)
    mean, spread = known[:, varies].mean(axis=0), spread[varies]
    level = float(wanted.mean())
    left, sizes, right = np.linalg.svd((known[:, varies] - mean) / spread, full_matrices=False)
    passed = sizes[:, None] / (sizes[:, None] ** 2 + np.array(RIDGES) * len(wanted))
    weights = right.T @ (passed * (left.T @ (wanted - level))[:, None])
    return np.asarray(level + (asked[:, varies] - mean) / spread @ weights)


AIRFRAME = (
    *("elevator_rad", "pitch_rate_rad_per_s", "alpha_rad"),
    *("aileron_rad", "rudder_rad", "roll_rate_rad_per_s", "yaw_rate_rad_per_s", "sideslip_rad"),
)


@dataclass(frozen=True)
class Follows(Plain):
    """A signal correlated with a residual: its share of the power, 0 to 1, and the slope.

    `per_unit` is in the channel's unit over the signal's.
    """

    signal: str
    share: float
    per_unit: float


@dataclass(frozen=True)
class Where:
    """A description of a stage's gap, from the channel in which it is largest.

    `loud` is the share of time with the gap. `begins` and `ends` are None if the excitation can
    explain them; `by_pressure` is empty if q̄ is constant; `line` is None without a line.
    """

    channel: str
    follows: tuple[Follows, ...]
    peak_Hz: float
    loud: float
    begins: Bounds | None = None
    ends: Bounds | None = None
    by_pressure: tuple[Mapping[str, float], ...] = ()
    line: SeenLine | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON, without unknown values."""
        found: dict[str, Any] = {"channel": self.channel}
        found["follows"] = [item.as_dict() for item in self.follows]
        found |= {"peak_Hz": self.peak_Hz, "loud": self.loud}
        for name, span in (("onset", self.begins), ("end", self.ends)):
            if span is not None:
                found |= {f"{name}_s": span.value, f"{name}_95_s": [span.low, span.high]}
        if self.by_pressure:
            found["by_pressure"] = list(self.by_pressure)
        if self.line is not None:
            found["line"] = self.line.as_dict()
        return found


@dataclass(frozen=True)
class Reversals(Plain):
    """A residual concentrated at reversals of motion: its share within a time of one, s."""

    within_s: float
    share: float


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
    varies = PRESSURE in record and np.ptp(record[PRESSURE]) > 0.0
    return Where(
        channel=output.channel,
        follows=_follows(left, known, output.floor),
        peak_Hz=_peak(left, rate_Hz),
        by_pressure=_by(left, smoothed(record[PRESSURE])) if varies else (),
        line=widest_line(left, output.floor, rate_Hz),
        **in_time(left, drives, rate_Hz)._asdict(),
    )


def lone_channel(outputs: Sequence[Output], rig: Rig) -> str:
    """Return a sentence on the only channel of the motion with a gap; empty if there are others.

    An error of the aircraft's forces shows in several; a small one may exceed the limit of one
    alone, unless it is mostly a constant. The trim alone may be off by a force.
    """
    judged = [one for one in outputs if one.stage == FLOWN and one.channel != TRIM]
    clear = {one.channel for one in judged if one.gap(rig) <= one.limit}
    with_gap = {one.channel for one in judged} - clear
    distinct = any(
        one.gap(rig) > DOUBLED * one.limit
        or np.mean(one.residual(rig)) ** 2 > MOST * np.mean(one.residual(rig) ** 2)
        for one in judged
        if one.channel in with_gap
    )
    if len(with_gap) != 1 or len(clear) < 2 or not distinct:
        return ""
    (name,) = with_gap
    return (
        f"Of the motion {name} alone has a gap, and {len(clear)} other channels agree with the "
        "model: check the offset, scale, delay and place of its sensor."
    )


def remains(output: Output, improved: Rig, record: Record, control: ControlName) -> Remains:
    """Return a description of an output's residual with the effects found."""
    left, answers = output.residual(improved), response(output, improved, record, control)
    known = signals(output, left, record, control)
    share, signal = free_share(output, left, known, answers)
    return Remains(
        gap=output.gap(improved),
        follows=_follows(left, known, output.floor),
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
    for within_s in LAGS_s[:3]:
        near = away_s <= within_s
        share = float(left[near] @ left[near]) / power
        if share >= MOST and share >= MORE * float(np.mean(near)):
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
    If motion is imposed, the predicted force replaces the measured one, which contains the
    residual that is to be explained.
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
        "schedule": (PRESSURE,),
        "surface": (PRESSURE,),
        "airframe": AIRFRAME,
    }
    for name in common.get(output.stage, ()):
        if name in record:
            found[name] = smoothed(record[name])
    if output.stage == "schedule" and PRESSURE in found:
        found["dynamic_pressure_rate_Pa_per_s"] = rate_of(found[PRESSURE], rate_Hz)
    found["time_s"] = record.time_s
    return found


def _sign(signal: Floats) -> Floats:
    """Return the sign of a signal; 0 where the signal is too small."""
    return np.where(np.abs(signal) > MINOR * np.sqrt(np.mean(signal**2)), np.sign(signal), 0.0)


def _follows(left: Floats, known: Mapping[str, Floats], floor: float) -> tuple[Follows, ...]:
    """Return the signals correlated with a residual, largest share first; `constant`: its mean."""
    power = float(np.mean(left**2))
    if power == 0.0:
        return ()
    mean = float(np.mean(left))
    found = [Follows("constant", mean**2 / power, mean * floor)]
    spread = left - mean
    for name, signal in known.items():
        moved = signal - signal.mean()
        size = float(moved @ moved)
        if size <= 0.0:
            continue
        slope = float(spread @ moved) / size
        share = slope**2 * size / (len(left) * power)
        found.append(Follows(name, share, slope * floor))
    found.sort(key=lambda item: -item.share)
    return tuple(item for item in found if item.share >= MINOR)[:TRIES]


def _peak(left: Floats, rate_Hz: float) -> float:
    """Return the frequency, Hz, of the largest power (Welch, segments with half overlap)."""
    many = min(len(left), round(SHORTEST_RECORD_s * rate_Hz))
    pieces = np.lib.stride_tricks.sliding_window_view(left, many)[:: many - many // 2]
    level = pieces - np.mean(pieces, axis=1, keepdims=True)
    taper = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(many) / many)
    power = np.mean(np.abs(np.fft.rfft(level * taper, axis=1)) ** 2, axis=0)
    power[-1] *= 0.5 if many % 2 == 0 else 1.0  # the Nyquist frequency is not doubled
    return float(np.fft.rfftfreq(many, 1.0 / rate_Hz)[1:][np.argmax(power[1:])])


def _by(left: Floats, pressure: Floats) -> tuple[Mapping[str, float], ...]:
    """Return the gap in the lower, middle and upper third of the record's q̄, Pa, as JSON."""
    edges = np.linspace(pressure.min(), pressure.max(), 4)
    found = []
    for low, high in pairwise(edges.tolist()):
        rows = (pressure >= low) & (pressure <= high)
        if rows.any():
            gap = rms_of(left[rows])
            found.append({"from_Pa": low, "to_Pa": high, "gap": gap})
    return tuple(found)


Mask = NDArray[np.bool_]


class InTime(NamedTuple):
    """The share of loud windows, and onset and end, s; None if the excitation explains them."""

    loud: float
    begins: Bounds | None
    ends: Bounds | None


def in_time(left: Floats, drives: Mapping[str, Floats], rate_Hz: float) -> InTime:
    """Return when a residual, in noise floors, is loud; `drives` are the stage's excitations."""
    frames = max(1, round(WINDOW_s * rate_Hz))
    rms = _rms(left, frames)
    loud = rms > DOUBLED
    excited = np.array([_rms(x - np.median(x), frames) for x in drives.values()])
    window_s, last = frames / rate_Hz, len(loud)
    share = float(np.mean(loud)) if last else 0.0
    if not loud.any() or not len(excited):
        return InTime(share, None, None)
    first, turned = _begins(loud, excited), _begins(loud[::-1], excited[:, ::-1])
    begins = ends = None
    if first is not None:
        begins = Bounds(*(window_s * k for k in first))
    if turned is not None:
        at_s, high_s, low_s = (window_s * (last - k) for k in turned)
        ends = Bounds(at_s, low_s, high_s)
    return InTime(share, begins, ends)


def _begins(loud: Mask, excited: Floats) -> tuple[int, int, int] | None:
    """Return the first loud window and the bounds of the onset, in windows; None if unsure."""
    first, last = int(np.argmax(loud)), len(loud) - int(np.argmax(loud[::-1]))
    chance, last_quiet = 0.0, 0
    for i in range(first):
        alike = np.all(excited[:, first:last] <= excited[:, i : i + 1], axis=0)
        count, of = int(np.sum(loud[first:last][alike])), int(np.sum(alike))
        if not of:
            continue
        likely = (count + 0.5) / (of + 1.0)
        chance += math.log1p(-likely)
        if likely >= MOST:
            last_quiet = i + 1
    if chance > math.log(ONSET_CHANCE):
        return None
    return first, last_quiet, first + 1


def _rms(signal: Floats, frames: int) -> Floats:
    windows = signal[: len(signal) // frames * frames].reshape(-1, frames)
    return np.asarray(np.sqrt(np.mean(windows**2, axis=1)))
