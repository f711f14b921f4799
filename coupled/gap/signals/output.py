"""One measured output of a stage, against what a rig makes of the stage's measured input."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise, noise_of
from coupled.gap.signals.steps import widely_stepped
from coupled.gap.thresholds import (
    FLOOR_SHARE,
    GUILTY_FROM,
    MISMATCH,
    NOISE_ALONE,
    NOISE_SIGMAS,
    ROUNDED,
    SMOOTHING_LOST,
    STRETCH_POWER,
    UNCORRELATED,
    WIDE_NEAR,
    SHORTEST_STRETCH_s,
    STRETCH_s,
)
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
Predict = Callable[[Rig], Floats]
Part = Literal["all", "fitted", "held"]
_KEPT = 8  # predictions remembered: threads fit different effects at once


@dataclass(frozen=True)
class Hides:
    """What a floor hides of an output: its share of what the channel does, rms over rms.

    `noisiest` is the channel whose noise makes most of the floor, `channel` the output's. `misses`
    is not 0 where the floor is the misfit of a healthy record: by so many times the noise.
    """

    share: float
    noisiest: str
    channel: str
    misses: float = 0.0

    @property
    def much(self) -> bool:
        """Whether a gap that is a large share of the signal would not show."""
        return self.share > FLOOR_SHARE

    @property
    def still(self) -> bool:
        """Whether the channel shows little but its own noise: breakout and friction held it."""
        return not self.misses and self.noisiest == self.channel and self.share > NOISE_ALONE

    @property
    def words(self) -> str:
        """What hides how much."""
        if self.still:
            return f"{self.channel} shows little but noise"
        share = f"{100 * self.share:.0f} %"
        if self.misses:
            missed = f"the rig misses the healthy record there by {self.misses:.3g} times the noise"
            return f"{missed}, {share} of what the stage does"
        return f"noise of {self.noisiest} is {share} of what {self.channel} does"

    @property
    def wanted(self) -> str:
        """What to do about it, in a sentence."""
        if self.misses:
            return "Fit the rig to the healthy record first (coupled fit), then diagnose again."
        if self.still:
            return f"Record a push that moves {self.channel}, or {self.noisiest} with less noise."
        times = math.ceil(self.share / FLOOR_SHARE)
        return f"Record a motion {times} times as large, or {self.noisiest} with less noise."


@dataclass(frozen=True)
class Output:
    """One measured output of a stage, and how a rig predicts it from the measured input.

    `floor` is the rms that noise alone leaves, in the channel's unit, `spread` that rms's relative
    standard deviation from record to record, `smoothed` the share of it that a smoothed input has,
    `hides` what it hides, where that is known.
    `record` numbers the record that it is of; `held` are the frames held out from fits, without
    which they are those of every other stretch; `missed` are those that the host missed (`missed`).
    One is `stepped` whose prediction runs at the loader's own steps, finer than the frames, and
    that wider ones hardly change. `mismatch` is the gap beyond 1 that its settings' laws may leave.
    `rough` predicts nearly as well with fewer replays, where slopes are asked for.
    `unsure` is the part of the
    floor by which it may be too low, the colour of what drives the stage being what it may be.
    `shots` predicts by short replays, each begun as measured: what went before misleads none.
    One is `in_series` that is predicted by the loader and the linkage behind it, from the force.
    `handed_on` is the part of what was measured that the stage hands on from its input: what the
    stage does is the rest.
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
    hides: Hides | None = None
    held: NDArray[np.bool_] | None = field(default=None, repr=False, compare=False)
    missed: NDArray[np.bool_] | None = field(default=None, repr=False, compare=False)
    stepped: bool = False
    mismatch: float = 0.0
    rough: Predict | None = field(default=None, repr=False, compare=False)
    unsure: float = 0.0
    in_series: bool = False
    shots: Predict | None = field(default=None, repr=False, compare=False)
    handed_on: Floats | None = field(default=None, repr=False, compare=False)
    _known: list[tuple[Any, Floats]] = field(default_factory=list, repr=False, compare=False)

    def widely(self, rig: Rig) -> bool:
        """Tell whether wide steps of the loader change the prediction by little, against the floor.

        They do under a force up to half of the frame rate, and where the floor is near zero.
        """
        stepped = replace(self, stepped=True)
        change = stepped.residual(rig, wide=True) - stepped.residual(rig)
        return float(np.sqrt(np.mean(change**2))) < WIDE_NEAR

    def residual(
        self, rig: Rig, part: Part = "all", wide: bool = False, rough: bool = False
    ) -> Floats:
        """Return measured less predicted, in floors, shape (frames,), of a part's stretches.

        A `wide` one is by wide steps of the loader (`steps`), a `rough` one to take slopes by.
        """
        rig = widely_stepped(rig) if wide and self.stepped else rig
        predict = self.rough if rough and self.rough is not None else self.predict
        key = (rig.controls, rig.flight, rig.substeps, predict is self.predict)
        left = next((left for known, left in self._known if known == key), None)
        if left is None:
            left = (self.measured - predict(rig)) / self.floor
            self._known[:] = [*self._known[1 - _KEPT :], (key, left)]
        return left if part == "all" else left[self.rows(part)]

    def under(self, noise: Noise) -> Output:
        """Return the output of what is driven by a signal with this noise, which may be more."""
        more = noise.unsure * self.smoothed**2
        return replace(self, unsure=math.sqrt(1.0 + more) - 1.0, _known=[])

    def by_shots(self) -> Output:
        """Return the output predicted by short replays, where it has them."""
        if self.shots is None:
            return self
        return replace(self, predict=self.shots, rough=None, _known=[])

    @property
    def carried(self) -> float:
        """The part of the floor that is its input's noise, carried through."""
        return self.floor * self.smoothed

    @property
    def own(self) -> float:
        """The part of the floor that is the channel's own noise, not its input's."""
        return self.floor * math.sqrt(1.0 - self.smoothed**2)

    @property
    def stretches(self) -> NDArray[np.intp]:
        """The number of the stretch that each frame lies in."""
        frames = max(1, round(STRETCH_s * self.frame_rate_Hz))
        return np.arange(len(self.measured)) // frames

    def rows(self, part: Part) -> NDArray[np.bool_]:
        """Return which frames are of a part: every other stretch is fitted, those between held."""
        if part == "all":
            return np.ones(len(self.measured), dtype=bool)
        held = self.stretches % 2 == 1 if self.held is None else self.held
        return np.asarray(held if part == "held" else ~held)

    def halved(self, rig: Rig) -> Output:
        """Return the output with halves that both hold of what this rig leaves.

        What happens seldom, as a limit that is met once, would else be in one of them alone: a
        stretch that holds much of the residual's power is cut where it has had its share.
        """
        frames = max(1, round(STRETCH_s * self.frame_rate_Hz))
        least = max(1, round(SHORTEST_STRETCH_s * self.frame_rate_Hz))
        power = np.concatenate(([0.0], np.cumsum(self.residual(rig) ** 2)))
        most = max(STRETCH_POWER, 2.0 * frames / len(self.measured)) * float(power[-1])
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
        """The gap up to which noise may be all there is."""
        noise = 1.0 + NOISE_SIGMAS * self.spread + SMOOTHING_LOST * self.smoothed
        return max(GUILTY_FROM, noise * (1.0 + self.unsure), 1.0 + self.mismatch)

    @property
    def does(self) -> float:
        """What the stage does in this record: the rms about the mean, in the channel's unit."""
        return float(
            np.std(self.measured if self.handed_on is None else self.measured - self.handed_on)
        )

    def gap(self, rig: Rig) -> float:
        """Return the rms residual over the floor."""
        return float(np.sqrt(np.mean(self.residual(rig) ** 2)))


def white(signal: Floats) -> float:
    """Return the rms of the noise in a smooth signal."""
    return heard(signal).rms


def heard(signal: Floats) -> Noise:
    """Return the noise in a smooth signal (`noise`).

    No less than its rounding, which is not white where the signal is slow.
    """
    noise = noise_of(signal)
    rough = float(np.sqrt(np.mean(np.diff(signal, 4) ** 2) / 70.0))
    return replace(noise, rms=max(noise.rms, rounding(signal, rough)))


def rounding(signal: Floats, noise: float) -> float:
    """Return the rms error of a signal's rounding, by the least step between its values.

    None where it would be thrice `noise`: an even ramp has even steps, a test's few levels have
    wide ones, and neither was rounded.
    """
    steps = np.diff(np.unique(signal))
    error = float(steps.min()) / math.sqrt(12.0) if steps.size else 0.0
    return error if error < ROUNDED * noise else 0.0


def spread(
    carried: Sequence[Floats], own: float, memory: float = 0.0, rate_Hz: float = 120.0
) -> float:
    """Return the relative standard deviation of noise's rms: `carried` of some tries, and its own.

    The own noise is white, or correlates by `memory` from frame to frame. Where a stage lets noise
    pass in a part of the record alone, as where nothing else moves, only that part counts.

    The mean square of N values of Gaussian noise varies by √(2·Σρ²/N) of itself (Bartlett), its
    root by half of that. The less noise a stage and its smoother let pass, the fewer values count.
    """
    power = np.mean([np.abs(np.fft.rfft(x)) ** 2 for x in carried], axis=0) / len(carried[0])
    crowded = 1.0 + 1.0 / len(carried)  # of the square of a periodogram, by how few are averaged
    at = np.linspace(0.0, np.pi, len(power))
    alone = own**2 * (1.0 - memory**2) / (1.0 + memory**2 - 2.0 * memory * np.cos(at))
    total = float(np.mean(power + alone))
    square = float(np.mean(power**2 / crowded + 2.0 * power * alone + alone**2))
    frames = max(1, round(STRETCH_s * rate_Hz))
    starts = np.arange(0, len(carried[0]), frames)
    lengths = np.diff([*starts, len(carried[0])])
    local = np.add.reduceat(np.mean(np.square(carried), axis=0) + own**2, starts) / lengths
    mean, square_mean = np.average([local, local**2], axis=1, weights=lengths)
    crowd = float(mean**2 / square_mean) if total > 0.0 else 1.0
    return float(np.sqrt(0.5 * square / total**2 / (crowd * len(carried[0]))))


def memory(residual: Floats) -> float:
    """Return the residual's integrated autocorrelation time in frames, at least 1."""
    x = residual - residual.mean()
    power = np.abs(np.fft.rfft(x, 2 * len(x))) ** 2
    correlation = np.fft.irfft(power)[: len(x) // 4]
    if correlation[0] <= 0.0:
        return 1.0
    correlation /= correlation[0]
    negative = np.flatnonzero(correlation < UNCORRELATED)
    end = int(negative[0]) if negative.size else len(correlation)
    return float(max(1.0, 1.0 + 2.0 * correlation[1:end].sum()))


def explained_below(before: float, limit: float) -> float:
    """Return the gap up to which a stage is explained, by its gap without any effect.

    `limit` is the gap up to which noise may be all there is.
    """
    return max(limit, 1.0 + MISMATCH * (before - 1.0))


def stage_limits(outputs: Sequence[Output]) -> dict[str, float]:
    """Return the gap of each stage up to which noise may be all there is."""
    found: dict[str, float] = {}
    for output in outputs:
        found[output.stage] = max(found.get(output.stage, GUILTY_FROM), output.limit)
    return found


def stage_gaps(outputs: Sequence[Output], rig: Rig) -> dict[str, float]:
    """Return each stage's gap: the largest of its outputs', over all records."""
    found: dict[str, float] = {}
    for output in outputs:
        found[output.stage] = max(found.get(output.stage, 0.0), output.gap(rig))
    return found
