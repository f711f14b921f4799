"""Curves: functions of one signal that describe a residual which no effect explains.

A curve is not a cause, and does not change the verdict. Where the credible effects leave a stage
unexplained, each curve that a rig may have (`LAWS`) is fitted as a piecewise linear function of its
signal, and flown by the stage's own code:

    residual = J·θ + noise,   θ_i ~ N(0, S²),   kink_i ~ N(0, κ²·h_i)

J holds the responses to a unit of the value at each of many possible nodes, by finite differences
about the last fit (Gauss-Newton). kink_i is the change of slope at node i, h_i the mean width
beside it. Nodes are added one by one while the log evidence of `search.evidence` grows, which is a
closed form for a linear model (MacKay, Neural Computation 4, 1992); κ maximises it as well. Nodes
and values are fitted to every other stretch; the others give the share `closed`.

The curve with the largest evidence in the whole record is reported if it is bent (a straight line
is an effect of the library), beats the effects found, closes at least `CURVE_CLOSES` of the gap on
held-out stretches, and has the same size in all halves of the record. An intermittent or a fading
fault has not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.display import split_unit
from coupled.errors import InputError
from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.chain import stage_of
from coupled.gap.findings.regimes import Acts, regimes
from coupled.gap.findings.result import EffectResult
from coupled.gap.findings.shrink import ChannelShrink, channel_shrink
from coupled.gap.findings.where import signals
from coupled.gap.search.case import Case
from coupled.gap.search.evidence import Evidence, evidence, fewest_unexplained, misfit
from coupled.gap.search.found import Choice, Fit
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import (
    Output,
    Part,
    explained_below,
    memory,
    stage_gaps,
    stage_limits,
)
from coupled.gap.thresholds import (
    CERTAIN,
    CURVE_CLOSES,
    CURVE_DRIFT,
    CURVE_KINKS,
    CURVE_NEAR,
    CURVE_NODES,
    CURVE_PLACES,
    CURVE_ROUNDS,
    CURVE_STEP,
    DRIFT_CHANCE,
    PRIOR_EFFECT,
    PRIOR_NUMBER,
    PRIOR_SPAN,
    RIVAL_GAIN,
    UNDERSTATED,
)
from coupled.parallel import in_threads
from coupled.record.channels import ControlName, unit_of
from coupled.record.record import Record
from coupled.rig.curves import BendCurve, GradientCurve
from coupled.rig.curves import Curve as RigCurve
from coupled.rig.rig import Rig
from coupled.rig.surface import share_of_travel
from coupled.schema import SMALLEST, file_keys

Floats = NDArray[np.float64]
WIDTH = PRIOR_SPAN / math.sqrt(2.0 * math.pi)  # prior's width over the size (`search.evidence`)
Values = tuple[Floats, Floats]  # nodes and values of a curve


@dataclass(frozen=True)
class Law:
    """A curve that a rig may have: its key of a control, its stage, and its signal.

    `signal` is a name in `where.signals`, `symbol` that of closed forms. `scale` is a signal of the
    size of its values. `by_size`: of the signal's size only. `anchored`: it vanishes at 0, where a
    named effect acts.
    """

    key: str
    stage: str
    signal: str
    symbol: str
    scale: str
    by_size: bool = False
    anchored: bool = False


LAWS = (
    Law("loader.force_curve", "loader", "computed_{d}", "δ", "force_N"),
    Law(
        "loader.friction_curve",
        "loader",
        "computed_rate_{d}_per_s",
        "v",
        "force_N",
        by_size=True,
        anchored=True,
    ),
    Law("loader.load_curve", "loader", "force_N", "F", "force_N", by_size=True, anchored=True),
    Law("loader.bend_curve", "linkage", "force_N", "F", "computed_{d}", anchored=True),
    Law("sensing.deflection_curve", "sensing", "computed_{d}", "δ", "computed_{d}"),
    Law("sensing.force_curve", "sensing", "force_N", "F", "force_N"),
    Law("schedule.gradient_curve", "schedule", "dynamic_pressure_Pa", "q̄", "gradient_N_per_{d}"),
    Law("rigging.command_curve", "surface", "estimate_{d}", "δ̂", "estimate_{d}"),
)


@dataclass(frozen=True)
class Curve:
    """A function of one signal that takes a residual, and is no cause.

    `key` is that of the rig file, `of` and `lists` its keys of the nodes and of the values. `unit`
    is that of the values, `low` and `high` their 95 % intervals. `closed` is the share of the gap
    closed on held-out stretches, with its interval. `like` is a closed form that fits as well, or
    empty.
    """

    key: str
    stage: str
    of: str
    unit: str
    nodes: tuple[float, ...]
    values: tuple[float, ...]
    low: tuple[float, ...]
    high: tuple[float, ...]
    closed: float
    closed_low: float
    closed_high: float
    like: str = ""
    lists: str = ""

    @property
    def words(self) -> str:
        """The share of the gap that the curve closes, and the closed form, in words."""
        ends = f"{100 * self.closed_low:.0f} to {100 * self.closed_high:.0f} %"
        like = f", like {self.like}" if self.like else ""
        return f"closes {100 * self.closed:.0f} % of the gap on held-out data ({ends}){like}"

    @property
    def sentence(self) -> str:
        """The curve in a sentence."""
        of = split_unit(self.of)[0].replace("_", " ")
        return f"A curve over the {of}, {self.key}, {self.words}; it is no cause."

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        ends = {"closed_low": self.closed_low, "closed_high": self.closed_high}
        lists = {name: list(getattr(self, name)) for name in ("nodes", "values", "low", "high")}
        head = {"stage": self.stage, "key": self.key, "of": self.of, "unit": self.unit}
        found = head | lists | {"closed": self.closed} | ends
        return found | ({"like": self.like} if self.like else {})


@dataclass(frozen=True)
class Curves:
    """The curves found, and the rig with the credible effects and with them.

    `shrink` is the reduction of the gap in each channel that they change, with curves that are
    fitted to the other stretches.
    """

    found: tuple[Curve, ...]
    rig: Rig
    shrink: tuple[ChannelShrink, ...]


def find_curves(
    case: Case, choice: Choice, effects: Sequence[EffectResult], records: Sequence[Record]
) -> Curves | None:
    """Return curves of the stages that the credible of the effects do not explain; None if none.

    `effects` are those found, with their probabilities.
    """
    sure = {one.name for one in effects if one.probability >= CERTAIN}
    problem = Problem(case)
    kept = [one for one in choice.fit.effects if one.name in sure]
    base = choice.fit if kept else choice.without_effects
    if kept and len(kept) < len(choice.fit.effects):
        base = problem.fit(kept, choice.fit.values)
    found: list[Curve] = []
    rig = half = base.rig
    while open_stages := _open_stages(case, choice, rig):
        one = _Fitter(case, problem, base, rig, choice.fit, records).best(open_stages)
        if one is None:
            break
        curve, rig, made = one
        found.append(curve)
        half = with_curve(half, case.control, made.law, *made.values) or half
    if not found:
        return None
    closed = tuple(
        channel_shrink(output, case.nominal, half, 1.0, improved=True)
        for output in case.outputs
        if not np.array_equal(output.residual(rig), output.residual(base.rig))
    )
    return Curves(tuple(found), rig, closed)


def _open_stages(case: Case, choice: Choice, rig: Rig) -> set[str]:
    """Return the stages whose residual with a rig exceeds that of an explained stage."""
    root = stage_gaps(case.outputs, choice.without_effects.rig)
    left, limits = stage_gaps(case.outputs, rig), stage_limits(case.outputs)
    return {stage_of(at) for at, gap in left.items() if gap > explained_below(root[at], limits[at])}


@dataclass(frozen=True)
class _Sums:
    """The normal equations of each output, and the weights of its frames.

    `inner` is JᵀJ, shape (outputs, places, places), `along` Jᵀ·residual, `power` the residual's sum
    of squares, `frames` their number, `samples` the effective number, `variance` that of the
    residual in floors². `weights` are those of a frame in the likelihood.
    """

    inner: Floats
    along: Floats
    power: Floats
    frames: Floats
    samples: Floats
    variance: Floats
    weights: Floats

    def of(self, mix: Floats) -> _Sums:
        """Return the sums for combinations of the columns, shape (places, combinations)."""
        inner = np.einsum("pi,opq,qj->oij", mix, self.inner, mix)
        return replace(self, inner=inner, along=self.along @ mix)

    def likelihood(self, theta: Floats) -> float:
        """Return the log likelihood of values."""
        curved = np.einsum("i,oij,j->o", theta, self.inner, theta)
        left = np.maximum(self.power - 2.0 * self.along @ theta + curved, 0.0)
        square = left / (self.frames * self.variance)
        return -0.5 * float(self.samples @ misfit(square))

    def posterior(self, prior: Floats) -> _Posterior:
        """Return values, their covariance, and the log evidence for a prior's precision."""
        precision = np.einsum("o,oij->ij", self.weights, self.inner) + prior
        theta = np.linalg.solve(precision, self.weights @ self.along)
        volume = np.linalg.slogdet(precision)[1] - np.linalg.slogdet(prior)[1]
        rest = -0.5 * float(theta @ prior @ theta) - 0.5 * float(volume) - PRIOR_EFFECT
        rest -= PRIOR_NUMBER * (len(theta) - 1)
        return _Posterior(theta, np.linalg.inv(precision), rest, self.likelihood(theta))

    def size(self) -> float:
        """Return the rms of the values of a fit without a prior to speak of."""
        inner = np.einsum("o,oij->ij", self.weights, self.inner)
        ridge = 1e-6 * np.trace(inner) / len(inner)
        found = np.linalg.solve(inner + ridge * np.eye(len(inner)), self.weights @ self.along)
        return float(np.sqrt(np.mean(found**2)))


@dataclass(frozen=True)
class _Posterior:
    """Values with their covariance; the log evidence is `likelihood` + `rest`."""

    theta: Floats
    covariance: Floats
    rest: float
    likelihood: float

    @property
    def log(self) -> float:
        """The log evidence."""
        return self.likelihood + self.rest


@dataclass(frozen=True)
class _Basis:
    """The responses to a unit of a law's value at each place, about a fitted curve.

    `columns` are those of each output, shape (frames, places), `wanted` its residual without the
    curve, linearised.
    """

    law: Law
    places: Floats
    outputs: Sequence[Output]
    columns: Sequence[Floats]
    wanted: Sequence[Floats]
    variance: Floats

    @property
    def free(self) -> NDArray[np.bool_]:
        """The places whose value is free: all but 0 of an anchored law."""
        return np.asarray(~(self.law.anchored & (self.places == 0.0)))

    @cached_property
    def _scales(self) -> tuple[Floats, Floats]:
        """Autocorrelation time and q of each output's residual with a value at every place."""
        powers = [float(w @ w) for w in self.wanted]
        inner = sum(j.T @ j / v for j, v in zip(self.columns, self.variance, strict=True))
        along = sum(
            j.T @ w / v for j, w, v in zip(self.columns, self.wanted, self.variance, strict=True)
        )
        assert isinstance(inner, np.ndarray) and powers
        ridge = 1e-6 * np.trace(inner) / len(inner)
        theta = np.linalg.solve(inner + ridge * np.eye(len(inner)), along)
        lefts = [w - j @ theta for j, w in zip(self.columns, self.wanted, strict=True)]
        squares = np.array([float(np.mean(left**2)) for left in lefts]) / self.variance
        return np.array([memory(left) for left in lefts]), squares

    def sums(self, part: Part) -> _Sums:
        """Return the normal equations of a part's frames."""
        memories, squares = self._scales
        rows = [output.rows(part) for output in self.outputs]
        some = [(j[at], w[at]) for j, w, at in zip(self.columns, self.wanted, rows, strict=True)]
        frames = np.array([float(at.sum()) for at in rows])
        return _Sums(
            np.array([j.T @ j for j, _ in some]),
            np.array([j.T @ w for j, w in some]),
            np.array([float(w @ w) for _, w in some]),
            frames,
            frames / memories,
            self.variance,
            1.0 / (memories * np.maximum(squares, 1.0) * self.variance),
        )


@dataclass(frozen=True)
class _Pick:
    """A curve with nodes at some places: their indices, and the values' posterior."""

    at: tuple[int, ...]
    known: _Posterior

    def values(self, basis: _Basis) -> Values:
        """Return nodes and values; 0 at 0 of an anchored law."""
        nodes, free = basis.places[list(self.at)], basis.free[list(self.at)]
        values = np.zeros(len(nodes))
        values[free] = self.known.theta
        return nodes, values

    def errors(self, basis: _Basis) -> Floats:
        """Return half of the 95 % interval of each value."""
        found = np.zeros(len(self.at))
        half = 1.96 * UNDERSTATED * np.sqrt(np.diag(self.known.covariance))
        found[basis.free[list(self.at)]] = half
        return found


def _mix(basis: _Basis, at: Sequence[int]) -> Floats:
    """Return the values at all places by those at some, shape (places, free of these)."""
    nodes = basis.places[list(at)]
    unit = np.eye(len(at))[:, basis.free[list(at)]]
    return np.array([np.interp(basis.places, nodes, column) for column in unit.T]).T


def _smooth(basis: _Basis, at: Sequence[int]) -> Floats:
    """Return the precision of the kinks of values at some places, for κ = 1."""
    nodes = basis.places[list(at)]
    widths = np.diff(nodes) / (basis.places[-1] - basis.places[0])
    kinks = np.zeros((max(len(at) - 2, 0), len(at)))
    for k, (a, b) in enumerate(pairwise(widths.tolist())):
        kinks[k, k : k + 3] = np.array([1.0 / a, -1.0 / a - 1.0 / b, 1.0 / b])
        kinks[k] /= math.sqrt(0.5 * (a + b))
    kinks = kinks[:, basis.free[list(at)]]
    return np.asarray(kinks.T @ kinks)


def _with_nodes(basis: _Basis, sums: _Sums, at: Sequence[int]) -> _Pick:
    """Return the curve with nodes at given places, and the smoothness of the largest evidence."""
    own, rough = sums.of(_mix(basis, at)), _smooth(basis, at)
    size = max(own.size(), 1e-300)
    level = np.eye(len(rough)) / (WIDTH * size) ** 2
    each = [own.posterior(level + rough / (kink * size) ** 2) for kink in CURVE_KINKS]
    return _Pick(tuple(at), max(each, key=lambda one: one.log))


def _choose(basis: _Basis, sums: _Sums, entries: Sequence[float]) -> tuple[_Pick, _Pick]:
    """Return the curve with the nodes of the largest evidence, and the straight line.

    The search begins at the ends, and again at the entries of the schedule.
    """
    ends = {0, len(basis.places) - 1, *np.flatnonzero(basis.places == 0.0).tolist()}
    line = _with_nodes(basis, sums, sorted(ends))
    own = ends | {*np.flatnonzero(np.isin(basis.places, entries)).tolist()}
    starts = [line]
    if len(ends) < len(own) < CURVE_NODES:
        starts.append(_with_nodes(basis, sums, sorted(own)))
    grown = [_grown(basis, sums, start, ends) for start in starts]
    return max(grown, key=lambda one: one.known.log), line


def _grown(basis: _Basis, sums: _Sums, start: _Pick, ends: set[int]) -> _Pick:
    """Return a curve with nodes added one by one, and then taken away, as the evidence grows.

    Two nodes that gain only together are found: one may lose evidence if the next gains more.
    """
    best = last = start
    while len(last.at) < CURVE_NODES and len(last.at) <= len(best.at) + 1:
        more = [k for k in range(len(basis.places)) if k not in last.at]
        if not more:
            break
        tries = (_with_nodes(basis, sums, sorted((*last.at, k))) for k in more)
        last = max(tries, key=lambda one: one.known.log)
        best = max(best, last, key=lambda one: one.known.log)
    while inner := [k for k in best.at if k not in ends]:
        fewer = [_with_nodes(basis, sums, [j for j in best.at if j != k]) for k in inner]
        less = max(fewer, key=lambda one: one.known.log)
        if less.known.log < best.known.log:
            break
        best = less
    return best


@dataclass(frozen=True)
class _Made:
    """A curve fitted to the fitted stretches: its nodes and values, its rig, and the fit."""

    law: Law
    values: Values
    rig: Rig
    basis: _Basis
    pick: _Pick
    line: _Pick
    likelihood: float


@dataclass(frozen=True)
class _Fitter:
    """Fits curves beside the effects of `base` and the curves of `rig`.

    `whole` is the fit of all effects found, which a curve must beat.
    """

    case: Case
    problem: Problem
    base: Fit
    rig: Rig
    whole: Fit
    records: Sequence[Record]

    def best(self, stages: set[str]) -> tuple[Curve, Rig, _Made] | None:
        """Return the curve of the largest evidence that shows in stages; None if none holds.

        With it are its rig, and the curve that is fitted to the fitted stretches.
        """
        begun = [one for law in LAWS if (one := self._begun(law, stages)) is not None]
        if not begun:
            return None
        gains = [one.likelihood - self._likelihood(one.basis, self.rig) for one in begun]
        near = [
            self._refined(one)
            for one, gain in zip(begun, gains, strict=True)
            if gain > CURVE_NEAR * max(gains)
        ]
        ends = [one for made in near if (one := self._whole(made)) is not None]
        if not ends:
            return None
        without = evidence(self.problem, replace(self.base, rig=self.rig), self._variances)
        named = evidence(self.problem, self.whole, self._variances)
        known = [self._evidence(rig, without, pick) for _, rig, pick in ends]
        samples = fewest_unexplained([without, named, *known])
        logs = [one.log(samples) for one in known]
        at = int(np.argmax(logs))
        made, rig, pick = ends[at]
        rivals = without.log(samples), named.log(samples)
        if logs[at] < max(rivals) + RIVAL_GAIN or not self._bent(made):
            return None
        curve = self._stated(made, rig, pick)
        return None if curve is None else (curve, rig, made)

    @cached_property
    def _variances(self) -> Floats:
        return self.problem.variances(self.base.rig)

    def _evidence(self, rig: Rig, without: Evidence, pick: _Pick) -> Evidence:
        """Return the evidence of a curve, from the residuals with it."""
        lefts = [output.residual(rig) for output in self.problem.outputs]
        squares = np.array([float(np.mean(left**2)) for left in lefts]) / self._variances
        if self.case.model_error_in_floors:
            squares = np.maximum(squares, 1.0)
        counts = np.array([len(left) / memory(left) for left in lefts])
        return Evidence(squares, counts, without.rest + pick.known.rest)

    def _begun(self, law: Law, stages: set[str]) -> _Made | None:
        """Return a law fitted once; None if it cannot be, or shows in none of the stages."""
        shown = STAGE_OF[law.stage].effects_show_in
        outputs = [
            output
            for output in self.problem.outputs
            if output.stage in shown or (output.in_series and law.stage == "linkage")
        ]
        if not stages & {stage_of(output.stage) for output in outputs}:
            return None
        signal = self._signal(law, outputs)
        section, _, name = law.key.partition(".")
        present: RigCurve = getattr(getattr(self.rig.controls[self.case.control], section), name)
        if signal is None or present.nodes:
            return None
        return self._fitted(law, _places(signal, law, self._entries(law)), outputs, None)

    def _signal(self, law: Law, outputs: Sequence[Output]) -> Floats | None:
        """Return a law's signal in all of its records; None if one lacks it."""
        control, found = self.case.control, []
        for output in {output.record: output for output in outputs}.values():
            record, rate_Hz = self.records[output.record], output.frame_rate_Hz
            stage = "loader" if law.stage == "sensing" else law.stage
            each = signals(stage, record, control, rate_Hz).get(_named(law.signal, control))
            if each is None or np.ptp(each) <= 0.0:
                return None
            if law.stage == "surface":
                each = share_of_travel(self.rig.controls[control], each)
            found.append(np.abs(each) if law.by_size else each)
        return np.concatenate(found) if found else None

    def _entries(self, law: Law) -> Sequence[float]:
        """Return the q̄ of the schedule's entries, Pa, for a law over q̄."""
        if law.stage != "schedule":
            return ()
        return self.rig.controls[self.case.control].schedule.dynamic_pressure

    def _step(self, law: Law, outputs: Sequence[Output]) -> float:
        """Return a small size of a law's values, in their unit."""
        if law.stage == "surface":
            return CURVE_STEP
        name = f"{self.case.control}_{_named(law.scale, self.case.control)}"
        record = self.records[outputs[0].record]
        name = (
            name
            if name in record
            else f"{self.case.control}_deflection_{unit_of(self.case.control)}"
        )
        return CURVE_STEP * float(np.sqrt(np.mean(record[name] ** 2)))

    def _with(self, law: Law, values: Values) -> Rig | None:
        return with_curve(self.rig, self.case.control, law, *values)

    def _fitted(
        self, law: Law, places: Floats, outputs: Sequence[Output], about: Values | None
    ) -> _Made | None:
        """Return a law fitted to the fitted stretches, linearised about a curve."""
        basis = self._basis(law, places, outputs, about)
        if basis is None:
            return None
        pick, line = _choose(basis, basis.sums("fitted"), self._entries(law))
        values = pick.values(basis)
        rig = self._with(law, values)
        if rig is None:
            return None
        return _Made(law, values, rig, basis, pick, line, self._likelihood(basis, rig))

    def _basis(
        self, law: Law, places: Floats, outputs: Sequence[Output], about: Values | None
    ) -> _Basis | None:
        """Return the responses about a curve; None if the stage does not respond."""
        step = self._step(law, outputs)
        if law.signal == law.scale and law.by_size:  # friction by load grows less than the load
            step = min(step, 0.3 * float(np.min(np.diff(places))))
        ends = places[[0, -1]]
        zero = np.array([0.0] if places[0] <= 0.0 <= places[-1] else [])
        nodes = np.union1d(ends, zero) if about is None else about[0]
        start = np.zeros(len(nodes)) if about is None else about[1]
        rig = self.rig if about is None else self._with(law, about)
        assert rig is not None
        free = np.flatnonzero(~(law.anchored & (places == 0.0)))
        rising = _rising(places)

        def response(k: int) -> list[Floats] | None:
            bends = np.flatnonzero(np.diff(rising[:, k]))
            own = np.union1d(nodes, places[[*bends, *(bends + 1)]])
            values = np.interp(own, nodes, start) + step * np.interp(own, places, rising[:, k])
            changed = self._with(law, (own, values))
            if changed is None:
                return None
            return [
                (output.residual(rig, rough=True) - output.residual(changed, rough=True)) / step
                for output in outputs
            ]

        each = in_threads(response, free.tolist())
        if any(one is None for one in each):
            return None
        to_hats = np.linalg.inv(rising[np.ix_(free, free)])
        columns = [np.zeros((len(output.measured), len(places))) for output in outputs]
        for o, column in enumerate(columns):
            column[:, free] = np.column_stack([one[o] for one in each if one]) @ to_hats
        responds = [bool(np.any(column)) for column in columns]
        if not any(responds):
            return None
        theta = np.interp(places, nodes, start)
        theta[np.setdiff1d(np.arange(len(places)), free)] = 0.0
        index = [k for k, one in enumerate(self.problem.outputs) if any(one is o for o in outputs)]
        return _Basis(
            law,
            places,
            outputs,
            columns,
            [o.residual(rig) + j @ theta for o, j in zip(outputs, columns, strict=True)],
            self._variances[index],
        )

    def _likelihood(self, basis: _Basis, rig: Rig) -> float:
        """Return the log likelihood of a rig in the fitted stretches, by the basis's samples."""
        sums = basis.sums("fitted")
        lefts = [output.residual(rig, "fitted") for output in basis.outputs]
        squares = np.array([float(np.mean(left**2)) for left in lefts]) / sums.variance
        return -0.5 * float(sums.samples @ misfit(squares))

    def _refined(self, made: _Made) -> _Made:
        """Return a law fitted again about its own curve, while that improves it."""
        for _ in range(CURVE_ROUNDS):
            anew = self._fitted(made.law, made.basis.places, made.basis.outputs, made.values)
            if anew is None:
                break
            gain = anew.likelihood - self._likelihood(anew.basis, made.rig)
            if gain < 0.0:
                break
            made = anew
            if gain < 1.0:
                break
        return made

    def _whole(self, made: _Made) -> tuple[_Made, Rig, _Pick] | None:
        """Return a curve's values from all stretches, with their rig."""
        basis = self._basis(made.law, made.basis.places, made.basis.outputs, made.values)
        if basis is None:
            return None
        pick = _with_nodes(basis, basis.sums("all"), made.pick.at)
        rig = self._with(made.law, pick.values(basis))
        return None if rig is None else (replace(made, basis=basis), rig, pick)

    def _bent(self, made: _Made) -> bool:
        """Tell whether a curve has more evidence than a straight line."""
        return made.pick.known.log > made.line.known.log + RIVAL_GAIN

    def _stated(self, made: _Made, rig: Rig, pick: _Pick) -> Curve | None:
        """Return a curve with its tests; None if it fails one."""
        outputs, law = made.basis.outputs, made.law
        widest = max(outputs, key=lambda output: output.gap(self.rig))
        held = channel_shrink(widest, self.rig, made.rig, 1.0, improved=True)
        if held.closed is None or held.low is None or held.high is None:
            return None
        if held.low < CURVE_CLOSES or self._drift(rig, outputs) > CURVE_DRIFT:
            return None
        nodes, values = pick.values(made.basis)
        errors = pick.errors(made.basis)
        of, lists, unit = _units(self.rig, self.case.control, law)
        shown = nodes + values if _kind(self.rig, self.case.control, law).MAP else values
        return Curve(
            key=f"controls.{self.case.control}.{law.key}",
            stage=law.stage,
            of=of,
            unit=unit,
            nodes=tuple(nodes.tolist()),
            values=tuple(shown.tolist()),
            low=tuple((shown - errors).tolist()),
            high=tuple((shown + errors).tolist()),
            closed=held.closed,
            closed_low=held.low,
            closed_high=held.high,
            like=closed_form(made.basis, pick, self._entries(law)),
            lists=lists,
        )

    def _drift(self, rig: Rig, outputs: Sequence[Output]) -> float:
        """Return the largest significant difference of a curve's size between halves."""
        acts = []
        for output in outputs:
            left = output.residual(rig)
            action = output.residual(self.rig) - left
            if np.any(action):
                acts.append(Acts(output, self.records[output.record], action, left))
        halves = regimes(self.case, acts)
        chance = DRIFT_CHANCE / max(len(halves), 1)
        return max((one.apart(chance) for one in halves), default=0.0)


def _named(name: str, control: ControlName) -> str:
    return name.format(d=unit_of(control))


def _kind(rig: Rig, control: ControlName, law: Law) -> type[RigCurve]:
    section, _, name = law.key.partition(".")
    return type(getattr(getattr(rig.controls[control], section), name))


def _units(rig: Rig, control: ControlName, law: Law) -> tuple[str, str, str]:
    """Return the keys of a law's nodes and values, and the unit of its values in text."""
    of, values, *_ = file_keys(_kind(rig, control, law), unit_of(control))
    return of, values, split_unit(values)[1]


def with_curve(
    rig: Rig, control: ControlName, law: Law, nodes: Floats, values: Floats
) -> Rig | None:
    """Return the rig with a curve; None if no rig can have it.

    The values of a map are added to the signal. Neither a map nor a bend may fall: where one
    would, it is flat. A curve of the schedule is constant beyond its nodes.
    """
    kind = _kind(rig, control, law)
    of, value, *_ = file_keys(kind, unit_of(control))
    given = values
    if kind is GradientCurve:  # held at its ends, as the schedule's table
        beyond = 0.01 * float(nodes[-1] - nodes[0])
        nodes = np.concatenate(([nodes[0] - beyond], nodes, [nodes[-1] + beyond]))
        given = np.pad(values, 1, "edge")
    if kind.MAP or kind is BendCurve:
        line = nodes * (1.0 if kind.MAP else _least_bend(rig, control))
        raised = np.maximum.accumulate(values + line)
        given = raised if kind.MAP else raised - line - np.interp(0.0, nodes, raised - line)
    lists = {
        name: np.where(np.abs(each) < SMALLEST, 0.0, each).tolist()
        for name, each in ((of, nodes), (value, given))
    }
    try:
        return rig.changed({f"controls.{control}.{law.key}": lists})
    except InputError:
        return None


def _least_bend(rig: Rig, control: ControlName) -> float:
    """Return the least bend by the force that a rig has without a curve, d/N."""
    loader = rig.controls[control].loader
    push = loader.bend if loader.bend_push is None else loader.bend_push
    return 0.0 if loader.bend_limit > 0.0 else min(loader.bend, push)


def _rising(places: Floats) -> Floats:
    """Return functions that rise from one place to the next, shape (places, functions).

    They are 0 towards 0 and ±1 beyond; one is constant. A rig that may not have a falling curve
    can have each, and together they span all functions that are linear between the places.
    """
    above = np.tri(len(places))
    zero = np.flatnonzero(places == 0.0)
    for k in range(int(zero[0]) if zero.size else 0):
        above[:, k] = -1.0 * (np.arange(len(places)) <= k)
    if zero.size:
        above[:, zero[0]] = 1.0
    return above


def _places(signal: Floats, law: Law, entries: Sequence[float]) -> Floats:
    """Return where a curve may have nodes: evenly spaced, at quantiles, at 0 and at entries.

    From the least value of the signal to the largest; through 0, where the signal has both signs.
    """
    low, high = float(signal.min()), float(signal.max())
    if law.by_size:
        low = 0.0
    elif law.stage != "schedule":
        width = max(abs(low), abs(high))
        low, high = min(low, -1e-2 * width), max(high, 1e-2 * width)
    near = 0.4 * (high - low) / CURVE_PLACES
    fixed = [low, high, *(x for x in entries if low < x < high)]
    fixed += [0.0] if low < 0.0 < high else []
    found = list(fixed)
    even = np.linspace(low, high, CURVE_PLACES)
    for x in (*even, *np.quantile(signal, np.linspace(0.0, 1.0, CURVE_PLACES))):
        if all(abs(x - other) > near for other in found):
            found.append(float(x))
    return np.array(sorted(set(found)))


Form = tuple[str, Floats]


def closed_form(basis: _Basis, curve: _Pick, entries: Sequence[float]) -> str:
    """Return the closed form with the largest evidence, if that is as large as the curve's.

    Beside it, a straight line is free: its slope and its level are effects of the library.
    """
    sums, places = basis.sums("all"), basis.places
    lines = [np.empty((len(places), 0)), places[:, None]]
    if not basis.law.anchored:
        lines += [np.ones((len(places), 1)), np.column_stack((places, np.ones(len(places))))]
    best, name = curve.known.log - RIVAL_GAIN, ""
    for text, form in _forms(basis.law, places, entries):
        for line in lines:
            log = _log_of(sums.of(np.column_stack((form, line))))
            if log > best:
                best, name = log, text
    return name


def _log_of(sums: _Sums) -> float:
    """Return the log evidence of a few independent sizes, each with a prior of its own width."""
    inner = np.einsum("o,oij->ij", sums.weights, sums.inner)
    if not np.all(np.diag(inner) > 0.0):
        return -math.inf
    scale = 1.0 / np.sqrt(np.diag(inner))
    theta = (
        scale
        * np.linalg.lstsq(
            inner * np.outer(scale, scale), scale * (sums.weights @ sums.along), rcond=None
        )[0]
    )
    width = WIDTH * np.maximum(np.abs(theta), scale)
    return sums.posterior(np.diag(1.0 / width**2)).log


def _forms(law: Law, x: Floats, entries: Sequence[float]) -> Iterator[Form]:
    """Yield the closed forms of a law, and their values at places, shape (places, 1)."""
    s, size = law.symbol, np.abs(x)
    if law.stage == "schedule":
        inside = [e for e in entries if x[0] <= e <= x[-1]]
        for k, at in enumerate(entries):
            if at in inside:
                unit = np.eye(len(entries))[k]
                yield f"one entry, at {at:g} Pa", np.interp(x, entries, unit)
        yield f"c·{s}²", x**2
        return
    yield f"c·{s}·|{s}|", x * size
    yield f"c·{s}³", x**3
    if not law.by_size:
        yield f"c·{s}²", x**2
        yield f"c·|{s}|", size
    for at in size[size > 0.0]:
        yield f"c·sgn({s}) beyond |{s}| = {at:.3g}", np.sign(x) * (size >= at)
        zone = "dead zone" if law.stage in ("sensing", "surface") else "saturation"
        yield f"{zone} at |{s}| = {at:.3g}", np.clip(x, -at, at)
