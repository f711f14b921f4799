"""One measured output of a stage, and its prediction from the stage's measured input.

A loader runs at 2 kHz or more for the pilot's hand. A replay of a record needs only a few steps a
frame: at 480 Hz a replay of 60 s differs from that at 2 kHz by hundredths of a noise floor, at a
quarter of the cost. Final fits and all results use the rig's own steps. A flight with steps of
twice the width differs by several noise floors, but the change of the motion by an effect is nearly
the same: it is used to screen effects (`change`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise, noise_of, rms_of
from coupled.gap.thresholds import (
    DOUBLED,
    FAULTY_FROM,
    FEW_STRETCHES,
    MINOR,
    MISMATCH,
    NEARLY_ALL,
    PARTLY,
    SIGMAS,
    SMALL,
    SMOOTHING_LOST,
    COARSE_STEPS_Hz,
    PIECE_s,
    STRETCH_s,
)
from coupled.rig.rig import Rig
from coupled.schema import quantity


class CoarseRig(Rig):
    """A rig of wide steps; those of its loader may be wider than a rig file allows."""

    loader_rate: float = quantity("Hz", COARSE_STEPS_Hz, gt=0)


def coarsely_stepped(rig: Rig) -> CoarseRig:
    """Return a rig whose loader and aircraft take no more steps than the search needs."""
    given = {name: getattr(rig, name) for name in Rig.model_fields}
    rate_Hz = min(rig.loader_rate, COARSE_STEPS_Hz)
    return CoarseRig.model_construct(**{**given, "loader_rate": rate_Hz})


Floats = NDArray[np.float64]
TRIM = "elevator_trim_rad"  # the channel of an output: elevator position in trim
Predict = Callable[[Rig], Floats]
Part = Literal["all", "fitted", "held"]
_KEPT = 8  # size of the cache of residuals; threads fit different effects at once


@dataclass(frozen=True)
class HiddenGap:
    """A noise floor that may hide a gap: `share` is the floor over the channel's motion, both rms.

    `most` is the largest share that hides no large gap; it is larger for the airframe, of which a
    gentle flight has hardly ten floors of motion. `noisiest` is the channel whose noise dominates
    the floor, `channel` that of the output. `misses` is the gap of the healthy records, if the
    floor includes a model error; `coloured` a gap that noise of the input may cause, if its colour
    is too uncertain; else 0.
    """

    share: float
    noisiest: str
    channel: str
    misses: float = 0.0
    coloured: float = 0.0
    most: float = SMALL

    @property
    def much(self) -> bool:
        """Whether the floor could hide a gap that is a large share of the signal."""
        return self.share > self.most

    @property
    def still(self) -> bool:
        """Whether the channel hardly moves: breakout and friction held it."""
        return not self.misses and self.noisiest == self.channel and self.share > NEARLY_ALL

    @property
    def words(self) -> str:
        """The reason in words."""
        if self.coloured:
            return f"its gap of {self.coloured:.2g} noise floors may be coloured noise of its input"
        if self.still:
            return f"{self.channel} shows little but noise"
        share = f"{100 * self.share:.0f} %" if self.share < 1.0 else "more than the whole"
        if self.misses:
            missed = f"the rig misses the healthy record there by {self.misses:.3g} times the noise"
            return f"{missed}, {share} of the stage's motion"
        return f"noise of {self.noisiest} is {share} of the motion of {self.channel}"

    @property
    def wanted(self) -> str:
        """How to lower the floor, in a sentence."""
        if self.misses:
            return "Fit the rig to the healthy record first (coupled fit), then diagnose again."
        if self.coloured:
            return (
                "Record an input that changes less often: its noise is estimated between changes."
            )
        if self.still:
            return f"Record a force that moves {self.channel}, or {self.noisiest} with less noise."
        larger = f"{math.ceil(self.share / SMALL)} times as large"
        if self.share >= 1.0:
            larger = "far larger than that noise"
        return f"Record a motion {larger}, or {self.noisiest} with less noise."


@dataclass(frozen=True)
class Output:
    """One measured output of a stage, and its prediction by a rig from the measured input.

    floor      rms of noise alone in the residual, in the channel's unit
    record     number of the record
    spread     relative standard deviation of the floor between records
    smoothed   share of the floor from the noise of the smoothed input
    hides      what the floor may hide, if known
    held       frames held out from fits; default: every other stretch
    missed     frames that the host missed (`missed`)
    stepped    the prediction runs at the loader's own steps, which wider steps approximate well
    mismatch   gap beyond 1 that errors of the nuisance parameters' laws may cause
    rough      an approximate prediction with fewer replays, for derivatives
    unsure     relative amount by which the floor may be too low, from the colour of input noise
    in_series  predicted from the force by loader and linkage in series
    shots      prediction by multiple shooting: short replays, restarted as measured
    handed_on  part of the measurement that comes from the input; the rest is the stage's own motion
    imposed    the imposed motion as read, d, of a force that answers it
    errors     samples of the propagated error of the input; of one number in all of a record's
    lasts      autocorrelation time of the noise floor, frames, if its residual may not show it
    """

    stage: str
    channel: str
    measured: Floats
    predict: Predict
    floor: float
    frame_rate_Hz: float
    record: int = 0
    spread: float = 0.0
    smoothed: float = 0.0
    hidden_gap: HiddenGap | None = None
    held: NDArray[np.bool_] | None = field(default=None, repr=False, compare=False)
    missed: NDArray[np.bool_] | None = field(default=None, repr=False, compare=False)
    stepped: bool = False
    mismatch: float = 0.0
    rough: Predict | None = field(default=None, repr=False, compare=False)
    unsure: float = 0.0
    in_series: bool = False
    shots: Predict | None = field(default=None, repr=False, compare=False)
    handed_on: Floats | None = field(default=None, repr=False, compare=False)
    imposed: Floats | None = field(default=None, repr=False, compare=False)
    errors: Sequence[Floats] = field(default=(), repr=False, compare=False)
    lasts: float = 1.0
    _known: list[tuple[Any, Floats]] = field(default_factory=list, repr=False, compare=False)

    def allows_coarse_steps(self, rig: Rig) -> bool:
        """Tell whether wide steps change the prediction little against the floor.

        They do not for forces up to half of the frame rate, and for floors near zero.
        """
        stepped = replace(self, stepped=True)
        change = stepped.residual(rig, coarse=True) - stepped.residual(rig)
        return rms_of(change) < PARTLY

    def residual(
        self, rig: Rig, part: Part = "all", coarse: bool = False, rough: bool = False
    ) -> Floats:
        """Return measured minus predicted, in floors, shape (frames,), of a part's stretches.

        `coarse`: with wide steps. `rough`: approximate, for derivatives.
        """
        rig = coarsely_stepped(rig) if coarse and self.stepped else rig
        predict = self.rough if rough and self.rough is not None else self.predict
        key = (type(rig), rig.controls, rig.flight, predict is self.predict)
        left = next((left for known, left in self._known if known == key), None)
        if left is None:
            left = (self.measured - predict(rig)) / self.floor
            self._known[:] = [*self._known[1 - _KEPT :], (key, left)]
        return left if part == "all" else left[self.rows(part)]

    def change(self, before: Rig, after: Rig) -> Floats:
        """Return the change of the residual from one rig to another, approximately, in floors."""
        if self.stage != "airframe":
            return self.residual(after, coarse=True) - self.residual(before, coarse=True)
        wide = replace(self, stepped=True)
        return wide.residual(after, coarse=True) - wide.residual(before, coarse=True)

    def under(self, noise: Noise) -> Output:
        """Return the output with `unsure` set for the noise of the signal that drives it."""
        more = noise.unsure * self.smoothed**2
        return replace(self, unsure=math.sqrt(1.0 + more) - 1.0, _known=[])

    def predicted_by(self, rig_of: Callable[[Rig], Rig]) -> Output:
        """Return the output with its predictions by another rig, a function of the given one."""

        def by(predict: Predict | None) -> Predict | None:
            return None if predict is None else lambda rig: predict(rig_of(rig))

        made = replace(self, rough=by(self.rough), shots=by(self.shots), _known=[])
        return replace(made, predict=lambda rig: self.predict(rig_of(rig)))

    def by_shots(self) -> Output:
        """Return the output predicted by multiple shooting, if it can be."""
        if self.shots is None:
            return self
        return replace(self, predict=self.shots, rough=None, _known=[])

    @property
    def carried(self) -> float:
        """The part of the floor that is the input's noise, propagated."""
        return self.floor * self.smoothed

    @property
    def own(self) -> float:
        """The part of the floor that is the channel's own noise."""
        return self.floor * math.sqrt(1.0 - self.smoothed**2)

    @property
    def stretches(self) -> NDArray[np.intp]:
        """The number of each frame's stretch."""
        return np.arange(len(self.measured)) // stretch_of(len(self.measured), self.frame_rate_Hz)

    def rows(self, part: Part) -> NDArray[np.bool_]:
        """Return the frames of a part: every other stretch is fitted, the others are held out."""
        if part == "all":
            return np.ones(len(self.measured), dtype=bool)
        held = self.stretches % 2 == 1 if self.held is None else self.held
        return np.asarray(held if part == "held" else ~held)

    def halved(self, rig: Rig) -> Output:
        """Return the output with halves of about equal power of this rig's residual.

        Stretches with much of it are divided: a rare event would otherwise be in one half only.
        """
        frames = stretch_of(len(self.measured), self.frame_rate_Hz)
        least = max(1, round(PIECE_s * self.frame_rate_Hz))
        power = np.concatenate(([0.0], np.cumsum(self.residual(rig) ** 2)))
        most = max(1.0 / FEW_STRETCHES, 2.0 * frames / len(self.measured)) * float(power[-1])
        held = np.zeros(len(self.measured), dtype=bool)
        start, odd = 0, False
        while start < len(held):
            full = int(np.searchsorted(power, power[start] + most))
            end = min(max(full, start + least), start + frames)
            held[start:end] = odd
            start, odd = end, not odd
        return replace(self, held=held, _known=[])

    @property
    def limit(self) -> float:
        """The largest gap of noise alone."""
        return max(self.sure_limit, self._largest * (1.0 + self.unsure))

    @property
    def sure_limit(self) -> float:
        """The largest gap of noise alone if the input's noise has the estimated spectrum."""
        return max(FAULTY_FROM, self._largest, 1.0 + self.mismatch)

    @property
    def _largest(self) -> float:
        return 1.0 + SIGMAS * self.spread + SMOOTHING_LOST * self.smoothed

    def coloured(self, rig: Rig) -> HiddenGap | None:
        """Return the gap that coloured noise of the input may cause, if it may double the floor."""
        gap = self.gap(rig)
        if self.hidden_gap is None or self.unsure <= 1.0 or gap <= self.sure_limit:
            return None
        return replace(self.hidden_gap, coloured=gap)

    @property
    def does(self) -> float:
        """The standard deviation of the stage's own motion, in the channel's unit."""
        own = self.measured if self.handed_on is None else self.measured - self.handed_on
        return float(np.std(own))

    def samples(self, left: Floats) -> float:
        """Return the effective samples of a residual: its frames over its autocorrelation time.

        That is at least the noise floor's: a small part of the noise, as the drift after a wrong
        restart, may last long, and be fitted by effects.
        """
        return len(left) / max(memory(left), self.lasts)

    def gap(self, rig: Rig) -> float:
        """Return the rms residual over the floor."""
        return rms_of(self.residual(rig))


def stretch_of(frames: int, rate_Hz: float) -> int:
    """Return the frames of a stretch of a record; a record of less than two is cut into eight."""
    whole, least = round(STRETCH_s * rate_Hz), round(PIECE_s * rate_Hz)
    return max(1, whole if frames >= 2 * whole else max(frames // FEW_STRETCHES, least))


def white(signal: Floats) -> float:
    """Return the rms of the noise in a smooth signal."""
    return estimate_noise(signal).rms


def estimate_noise(signal: Floats) -> Noise:
    """Return the noise in a smooth signal, at least its rounding, which may not be white."""
    return above_rounding(noise_of(signal), signal)


def exceeds_noise(signal: Floats, least: float = 0.0) -> bool:
    """Tell whether the standard deviation of a signal is well above its noise, and above `least`.

    Also true of a signal with a value that is no number: the record is then refused with the row.
    """
    if not np.all(np.isfinite(signal)):
        return True
    spread = float(np.std(signal))
    if len(signal) < 5 or spread <= least:
        return False
    return spread > DOUBLED * estimate_noise(signal).rms


def above_rounding(noise: Noise, signal: Floats) -> Noise:
    """Return a noise that is at least the rounding of a signal."""
    rough = float(np.sqrt(np.mean(np.diff(signal, 4) ** 2) / 70.0))
    return replace(noise, rms=max(noise.rms, rounding(signal, rough)))


def rounding(signal: Floats, noise: float) -> float:
    """Return the rms error of a signal's rounding, from the least step between its values.

    Zero if that would be `SIGMAS` times `noise`: the even steps of a ramp, and the few levels of
    a test, are not rounding. Nor are steps that a double of the signal's size does not resolve.
    """
    steps = np.diff(np.unique(signal))
    step = float(steps.min()) if steps.size else 0.0
    error = step / math.sqrt(12.0)
    resolved = step >= float(np.spacing(np.max(np.abs(signal)))) if steps.size else False
    return error if resolved and error < SIGMAS * noise else 0.0


def spread(
    carried: Sequence[Floats], own: float, memory: float = 0.0, rate_Hz: float = 120.0
) -> float:
    """Return the relative standard deviation of the rms of noise.

    `carried` are samples of propagated input noise. The own noise is white, or correlates by
    `memory` from frame to frame. If a stage passes noise in a part of the record only, only that
    part counts. The mean square of N values of Gaussian noise has the relative standard deviation
    √(2·Σρ²/N) (Bartlett), its root half of that.
    """
    power = np.mean([np.abs(np.fft.rfft(x)) ** 2 for x in carried], axis=0) / len(carried[0])
    crowded = 1.0 + 1.0 / len(carried)  # bias of a squared periodogram averaged over few samples
    at = np.linspace(0.0, np.pi, len(power))
    alone = own**2 * (1.0 - memory**2) / (1.0 + memory**2 - 2.0 * memory * np.cos(at))
    total = float(np.mean(power + alone))
    square = float(np.mean(power**2 / crowded + 2.0 * power * alone + alone**2))
    frames = stretch_of(len(carried[0]), rate_Hz)
    starts = np.arange(0, len(carried[0]), frames)
    lengths = np.diff([*starts, len(carried[0])])
    local = np.add.reduceat(np.mean(np.square(carried), axis=0) + own**2, starts) / lengths
    mean, square_mean = np.average([local, local**2], axis=1, weights=lengths)
    crowd = float(mean**2 / square_mean) if total > 0.0 else 1.0
    return float(np.sqrt(0.5 * square / total**2 / (crowd * len(carried[0]))))


def lasting(errors: Sequence[Floats], floor: float) -> float:
    """Return the autocorrelation time, frames, of a noise floor that includes some errors."""
    power = min(float(np.mean(np.square(errors))) / floor**2, 1.0)
    return 1.0 + power * (float(np.mean([memory(error) for error in errors])) - 1.0)


def memory(residual: Floats) -> float:
    """Return the residual's integrated autocorrelation time in frames, at least 1."""
    x = residual - residual.mean()
    power = np.abs(np.fft.rfft(x, 2 * len(x))) ** 2
    correlation = np.fft.irfft(power)[: len(x) // 4]
    if correlation[0] <= 0.0:
        return 1.0
    correlation /= correlation[0]
    negative = np.flatnonzero(correlation < MINOR)
    end = int(negative[0]) if negative.size else len(correlation)
    return float(max(1.0, 1.0 + 2.0 * correlation[1:end].sum()))


def explained_below(before: float, limit: float) -> float:
    """Return the largest gap of an explained stage, by those without effects and of noise."""
    return max(limit, 1.0 + MISMATCH * (before - 1.0))


def unexplained(
    before: Mapping[str, float], left: Mapping[str, float], outputs: Sequence[Output]
) -> set[str]:
    """Return the outputs whose gap that is left exceeds that of an explained stage."""
    limits = stage_limits(outputs)
    return {at for at, gap in left.items() if gap > explained_below(before[at], limits[at])}


def stage_limits(outputs: Sequence[Output]) -> dict[str, float]:
    """Return the largest gap of noise alone of each stage."""
    found: dict[str, float] = {}
    for output in outputs:
        found[output.stage] = max(found.get(output.stage, FAULTY_FROM), output.limit)
    return found


def stage_gaps(outputs: Sequence[Output], rig: Rig) -> dict[str, float]:
    """Return each stage's gap: the largest of its outputs in all records."""
    found: dict[str, float] = {}
    for output in outputs:
        found[output.stage] = max(found.get(output.stage, 0.0), output.gap(rig))
    return found
