"""Whether a machine changed since its healthy records: a test of simple features.

A model that misses the healthy machine cannot judge by noise. The residual of a signal, and the
force itself, are therefore condensed to features of a whole record: the coefficients of its
regression, the spread about it, and the roughness, both as natural logarithms. The regression is
the textbook one of a machine with friction, over all frames that move,

    y = a₀ + a·sgn v + b·(v − v̄·sgn v) + k·(x − x̄) + m·v'

with v̄ and x̄ of the healthy records, and b, k and m times the rms of their regressors there. A
motion in one direction has no a. The coefficients part friction from damping and from an offset,
and none depends on how often a speed occurs. One record gives one value of a feature, so the
scatter between healthy records holds all that differs from day to day. The means a₀ ± a of either
direction would both scatter as the friction does, and hide an offset that does not.

A feature x of m records is tested against n healthy ones by a prediction interval for normal values
(Hahn and Meeker, Statistical Intervals, 1991, ch. 4):

    |x̄ − x̄_h| > t(1 − αw/2; n − 1)·√(s²·(1/m + 1/n) + d²/m) + e

s is the standard deviation between healthy records; of a residual's coefficients it is at least a
tenth of the noise floor, since errors of counting do not average out. d² is by how much the mean
variance of a tested record's coefficients, from the regression and its residual's correlation time,
exceeds that of the healthy ones: a motion of one speed hardly determines b. The weights w of all
features add up to 1 (Bonferroni), so that all tests together give a false alarm in at most a share
α of healthy records: half of the weight is that of a and b of the force, and of the other
stages' signals, for which few healthy records suffice. e is what another motion may change, up to
its square: twice the relative excess of the motion's rms place, mean place or rms speed over its
own prediction interval, times the rms of the signal. The size of change that is shown with
probability 0.9 follows from the noncentral t distribution.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import nctdtrinc, stdtrit

from coupled.display import unit_in
from coupled.gap.noise.noise import rms_of
from coupled.gap.noise.smooth import rate_of, smoothed
from coupled.gap.signals.output import Floats, Output, memory
from coupled.gap.thresholds import CHANGE_CHANCE, FEW, NEARLY_ALL, ROUNDING_SPAN, SMALL, TINY
from coupled.record.channels import ControlName, channel, motions_in
from coupled.record.record import Record
from coupled.rig.rig import Rig

SIDES = ((1, "positive"), (-1, "negative"))
# The levels of motion in both directions: a and a₀. A motion in one has a mean only.
LEVEL, MIDDLE = "half difference of the directions", "mean of both directions"
ONE_WAY = tuple(f"mean in {direction} direction" for _, direction in SIDES)
LEVELS = (LEVEL, MIDDLE, *ONE_WAY)
SLOPES = ("slope over the speed", "slope over the place", "slope over the acceleration")
FIRST = (LEVEL, *ONE_WAY, SLOPES[0])
LINEAR = ("half", "mean", "slope")


@dataclass(frozen=True)
class Interval:
    """A feature of some records against healthy ones: the difference of means, and its limits.

    `scatter` is the standard deviation between healthy records, `limit` the difference that chance
    exceeds with the probability of the test, `shown` the change that the test shows with
    probability `NEARLY_ALL`; both infinite with fewer than two healthy records.
    """

    difference: float
    scatter: float
    limit: float
    shown: float

    @classmethod
    def of(
        cls,
        well: Floats,
        now: Floats,
        chance: float,
        unsure: float = 0.0,
        least: float = 0.0,
        more: float = 0.0,
    ) -> Interval:
        """Return the two-sided interval at a probability of a false alarm, `chance`.

        `well` and `now` have one value a record; `unsure` is added to the limits; `least` is the
        least standard deviation of the healthy ones; `more` the variance of a value of `now` beyond
        that of a healthy one.
        """
        n, m = len(well), len(now)
        difference = float(now.mean() - well.mean())
        if n < 2:
            return cls(difference, math.inf, math.inf, math.inf)
        scatter = max(float(np.std(well, ddof=1)), least)
        error = math.sqrt(scatter**2 * (1.0 / m + 1.0 / n) + more / m)
        times = float(stdtrit(n - 1, 1.0 - 0.5 * chance))
        noncentral = float(nctdtrinc(n - 1, 1.0 - NEARLY_ALL, times))
        shown = noncentral * error + unsure if math.isfinite(noncentral) else math.inf
        return cls(difference, scatter, times * error + unsure, shown)

    @property
    def changed(self) -> bool:
        """Whether the difference is more than chance gives."""
        return abs(self.difference) > self.limit


@dataclass(frozen=True)
class Change:
    """A feature that was tested: of which signal and stage, and its interval."""

    stage: str
    signal: str
    feature: str
    interval: Interval

    @property
    def is_mean(self) -> bool:
        """Whether the feature is a mean or a slope, in the unit of its signal."""
        return self.feature.startswith(LINEAR)

    @property
    def beyond(self) -> float:
        """The difference over what chance gives."""
        return abs(self.interval.difference) / self.interval.limit

    @property
    def words(self) -> str:
        """What changed by how much."""
        one = self.interval
        sigmas = f"{abs(one.difference) / one.scatter:.3g} standard deviations"
        if self.is_mean:
            size = f"{one.difference:+.3g} {unit_in(self.signal.partition(' ')[0])}".rstrip()
        else:
            size = f"{100.0 * math.expm1(min(one.difference, 7.0)):+.3g} %"
        return f"{self.signal}, {self.feature}: {size} ({sigmas} of the healthy records)"

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        known = vars(self) | vars(self.interval)
        return {name: one for name, one in known.items() if name not in ("interval", "shown")}


@dataclass(frozen=True)
class Comparison:
    """All features of some records tested against healthy ones.

    `shown` is the change of friction or offset in each stage, relative to the rms of its channel,
    that would have been shown: the larger of the two, each in its more sensitive signal.
    """

    healthy: int
    tested: tuple[Change, ...]
    shown: Mapping[str, float]

    @property
    def changed(self) -> tuple[Change, ...]:
        """The features that changed by more than chance gives: means first, then the clearest."""
        found = [one for one in self.tested if one.interval.changed]
        return tuple(sorted(found, key=lambda one: (not one.is_mean, -one.beyond)))

    @property
    def stages(self) -> tuple[str, ...]:
        """The stages of the features that changed, the clearest first."""
        return tuple(dict.fromkeys(one.stage for one in self.changed))

    @property
    def blind(self) -> frozenset[str]:
        """The stages in which a change of a tenth of the signal would not have been shown."""
        return frozenset(stage for stage, size in self.shown.items() if size > SMALL)

    @property
    def words(self) -> str:
        """What changed, or what change would have been shown."""
        if self.changed:
            first, *more = self.changed
            also = f", and {len(more)} more feature{'s' if len(more) > 1 else ''}" if more else ""
            return f"Changed since the healthy records: {first.words}{also}."
        seen = {name: size for name, size in self.shown.items() if math.isfinite(size)}
        if not seen:
            return (
                "The scatter between healthy records is not known, and shows no change:"
                " record more of them, of the same motion."
            )
        each = ", ".join(f"{100.0 * size:.2g} % in the {name}" for name, size in seen.items())
        return (
            f"By the scatter between {self.healthy} healthy records, a change of friction or"
            f" offset is detectable from these shares of the signal's rms: {each}."
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        shown = {name: size if math.isfinite(size) else None for name, size in self.shown.items()}
        return {"changes": [one.as_dict() for one in self.changed], "shown": shown}


@dataclass(frozen=True)
class _Motions:
    """The motions of healthy records, about which a signal is regressed.

    `still` is the speed below which nothing moves, d/s, `middle` the mean speed and the median
    place, `sizes` the rms of each regressor about them.
    """

    still: float
    middle: tuple[float, float]
    sizes: Floats

    @classmethod
    def of(cls, motions: Sequence[Floats]) -> _Motions:
        """Return the numbers of some motions, each place and speed, shape (2, frames)."""
        place, speed = np.concatenate(motions, axis=1)
        still = SMALL * rms_of(speed)
        moving = np.abs(speed) > still
        usual = float(np.mean(np.abs(speed[moving]))) if moving.any() else still
        known = cls(still, (usual, float(np.median(place))), np.ones(len(SLOPES)))
        each = [np.concatenate(one) for one in zip(*map(known.regressors, motions), strict=True)]
        sizes = np.array([np.sqrt(np.mean(one[moving] ** 2)) for one in each])
        return replace(known, sizes=np.maximum(sizes, 1e-300))

    def regressors(self, moved: Floats) -> list[Floats]:
        """Return speed, place and acceleration of a motion, in units of the healthy ones."""
        (usual, middle), (place, speed) = self.middle, moved
        each = speed - usual * np.sign(speed), place - middle, np.gradient(speed)
        return [one / size for one, size in zip(each, self.sizes, strict=True)]


@dataclass(frozen=True)
class _Signal:
    """A signal of one record, with the motion beside it: place, d, and speed, d/s, as rows."""

    stage: str
    values: Floats
    moved: Floats
    channel_rms: float  # of the channel that it is of
    least: float  # standard deviation of a coefficient from record to record, at the least


Signals = Sequence[Mapping[str, _Signal]]
Judged = tuple[Sequence[Record], Sequence[Output], Rig]  # records, their outputs, predicted by rig


def compare(control: ControlName, well: Judged, now: Judged, force: bool = True) -> Comparison:
    """Return records tested against healthy ones.

    The predictions of each one's rig are subtracted. The `force` on the control is tested too.
    """
    healthy, tested = (_signals(control, *each, force) for each in (well, now))
    pull = channel(control, "force")
    names = [name for name in healthy[0] if all(name in one for one in (*healthy, *tested))]
    features = {name: _features(healthy, tested, name) for name in names}
    pairs = {(name, feature) for name, each in features.items() for feature in each}
    first = {
        (name, feature)
        for name, feature in pairs
        if (pull not in names or name == pull or healthy[0][name].stage != "loader")
        and feature in FIRST
    }
    others = pairs - first
    found, levels = [], dict[str, dict[str, float]]()
    for name, each in features.items():
        ours = [one[name] for one in healthy]
        excess = _excess([one.moved for one in ours], [one[name].moved for one in tested])
        size = float(np.sqrt(np.mean([np.mean(one.values**2) for one in ours])))
        stage, channel_rms = ours[0].stage, float(np.mean([one.channel_rms for one in ours]))
        for feature, (before, after) in each.items():
            alike = first if (name, feature) in first else others
            chance = CHANGE_CHANCE * (0.5 / len(alike))
            mean = feature.startswith(LINEAR)
            own = size if mean else 1.0
            more = 2.0 * (excess * own if mean else math.log1p(excess))
            beyond = max(float(after[:, 1].mean() - before[:, 1].mean()), 0.0)
            values = before[:, 0], after[:, 0]
            least = max(one.least for one in ours) if mean else ROUNDING_SPAN
            interval = Interval.of(*values, chance, more, least, beyond)
            found.append(Change(stage, name, feature, interval))
            if feature in LEVELS and channel_rms > 0.0:
                known, size_shown = levels.setdefault(stage, {}), interval.shown / channel_rms
                known[feature] = min(known.get(feature, math.inf), size_shown)
    shown = {stage: max(known.values()) for stage, known in levels.items()}
    return Comparison(len(healthy), tuple(found), shown)


def _signals(
    control: ControlName,
    records: Sequence[Record],
    outputs: Sequence[Output],
    rig: Rig,
    with_force: bool,
) -> Signals:
    """Return each record's signals by name: the force, and the residual of each output."""
    found = []
    for number, record in enumerate(records):
        place = next((smoothed(record[name]) for name in motions_in(record, control)), None)
        ours: dict[str, _Signal] = {}
        if place is not None:
            moved = np.array([place, rate_of(place, rig.frame_rate)])
            force = channel(control, "force")
            if with_force and force in record:
                rms = rms_of(record[force])
                ours[force] = _Signal("loader", record[force], moved, rms, ROUNDING_SPAN * rms)
            for one in (o for o in outputs if o.record == number and len(o.measured) == len(place)):
                left, rms = one.residual(rig) * one.floor, float(np.std(one.measured))
                signal = _Signal(one.stage, left, moved, rms, SMALL * one.floor)
                ours[f"{one.channel} beside its prediction"] = signal
        found.append(ours)
    return found


def _features(well: Signals, now: Signals, name: str) -> dict[str, tuple[Floats, Floats]]:
    """Return a signal's features: of each healthy record, and of each tested one.

    Shape (records, 2): the value, and the variance with which the record determines it.
    """
    about = _Motions.of([one[name].moved for one in well])
    before, after = ([_condensed(one[name], about) for one in ours] for ours in (well, now))
    return {
        key: (np.array([one[key] for one in before]), np.array([one[key] for one in after]))
        for key in before[0]
        if all(key in one for one in (*before, *after))
    }


def _condensed(signal: _Signal, about: _Motions) -> dict[str, tuple[float, float]]:
    """Return the features of one signal, and their variances, by its regression."""
    values, found = signal.values, dict[str, tuple[float, float]]()
    speed = signal.moved[1]
    least = max(len(LEVELS) + len(SLOPES), round(FEW * len(values)))
    sides = [(side * speed > about.still, name) for side, name in SIDES]
    sides = [(rows, name) for rows, name in sides if rows.sum() >= least]
    if not sides:
        return {}
    every = np.logical_or.reduce([rows for rows, _ in sides])
    steps, levels = [np.ones(len(values))], [f"mean in {sides[0][1]} direction"]
    if len(sides) > 1:
        steps, levels = [*steps, np.sign(speed)], [MIDDLE, LEVEL]
    table = np.column_stack([*steps, *about.regressors(signal.moved)])[every]
    known, _, rank, _ = np.linalg.lstsq(table, values[every], rcond=TINY)
    left = np.zeros(len(values))
    left[every] = values[every] - table @ known
    if rank == table.shape[1]:
        power = memory(left[every]) * float(np.mean(left[every] ** 2))
        variances = power * np.diag(np.linalg.inv(table.T @ table))
        each = zip(known.tolist(), variances.tolist(), strict=True)
        found |= dict(zip((*levels, *SLOPES), each, strict=True))
    rough = np.diff(values, 2, prepend=values[:2])
    for rows, name in sides:
        for what, signed in (("spread", left), ("roughness", rough)):
            size = rms_of(signed[rows])
            found[f"{what} in {name} direction"] = math.log(max(size, 1e-300)), 0.0
    return found


def _excess(well: Sequence[Floats], now: Sequence[Floats]) -> float:
    """Return by how much a motion differs, relative, beyond what healthy records' motions do."""
    before, after = (
        np.array([(x.std(), x.mean(), np.sqrt(np.mean(v**2))) for x, v in motions])
        for motions in (well, now)
    )
    sizes = before.mean(axis=0)
    sizes[1] = sizes[0]  # a mean place counts by how far the motion goes
    most = 0.0
    for k in range(len(sizes)):
        interval = Interval.of(before[:, k], after[:, k], CHANGE_CHANCE)
        limit = interval.limit if math.isfinite(interval.limit) else 0.0
        more = abs(interval.difference) - limit
        most = max(most, more / max(float(sizes[k]), 1e-300))
    return most
