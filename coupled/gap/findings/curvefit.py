"""The laws of one signal that a rig may have as curves, their linear fits, and closed forms.

The values at the nodes have a Gaussian prior, and so have the kinks, so that a curve is smooth:

    residual = J·θ + noise,   θ_i ~ N(0, S²),   kink_i ~ N(0, κ²·h_i)

J holds the responses to a unit of the value at each of many possible nodes. kink_i is the change of
slope at node i, h_i the mean width beside it. The log evidence of a linear model is a closed form
(MacKay, Neural Computation 4, 1992): its terms are those of `search.evidence`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from operator import attrgetter

import numpy as np
from numpy.typing import NDArray

from coupled.display import split_unit
from coupled.errors import InputError
from coupled.gap.noise.noise import rms_of
from coupled.gap.search.evidence import misfit
from coupled.gap.search.problem import ModelError
from coupled.gap.signals.output import Floats, Output, Part, memory
from coupled.gap.thresholds import (
    CURVE_KINKS,
    CURVE_NODES,
    CURVE_PLACES,
    NORMAL_95,
    PRIOR_EFFECT,
    PRIOR_NUMBER,
    PRIOR_SPAN,
    RIVAL_GAIN,
    TINY,
    UNDERSTATED,
)
from coupled.record.channels import ControlName, unit_of
from coupled.rig.curves import BendCurve, GradientCurve, LoadCurve
from coupled.rig.curves import Curve as RigCurve
from coupled.rig.rig import Rig
from coupled.schema import SMALLEST, file_keys

WIDTH = PRIOR_SPAN / math.sqrt(2.0 * math.pi)  # prior's width over the size (`search.evidence`)
Values = tuple[Floats, Floats]  # nodes and values of a curve


@dataclass(frozen=True)
class Law:
    """A curve that a rig may have: its key of a control, its stage, and its signal.

    `signal` is a name in `where.signals`, `symbol` that of closed forms, `scale` a signal of the
    size of its values. `by_size`: of the signal's size only. `anchored`: it vanishes at 0, where a
    named effect acts. `is_map`: its value replaces the signal.
    """

    key: str
    stage: str
    signal: str
    symbol: str
    scale: str
    by_size: bool = False
    anchored: bool = False
    is_map: bool = False


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
    Law("sensing.grip_load_curve", "linkage", "force_N", "F", "computed_{d}", anchored=True),
    Law("sensing.grip_curve", "linkage", "deflection_{d}", "δ", "deflection_{d}", is_map=True),
    Law("sensing.deflection_curve", "sensing", "computed_{d}", "δ", "computed_{d}", is_map=True),
    Law("sensing.force_curve", "sensing", "force_N", "F", "force_N", is_map=True),
    Law("schedule.gradient_curve", "schedule", "dynamic_pressure_Pa", "q̄", "gradient_N_per_{d}"),
    Law("rigging.command_curve", "surface", "estimate_{d}", "δ̂", "estimate_{d}", is_map=True),
)


def named(name: str, control: ControlName) -> str:
    """Return the name of a signal on a control, with m or rad."""
    return name.format(d=unit_of(control))


def filed_curve(rig: Rig, control: ControlName, law: Law) -> RigCurve:
    """Return the curve of a law that a rig has; without nodes, it has none."""
    found: RigCurve = attrgetter(law.key)(rig.controls[control])
    return found


def units_of(rig: Rig, control: ControlName, law: Law) -> tuple[str, str, str]:
    """Return the keys of a law's nodes and values, and the unit of its values in text."""
    of, values, *_ = file_keys(type(filed_curve(rig, control, law)), unit_of(control))
    return of, values, split_unit(values)[1]


def with_curve(
    rig: Rig, control: ControlName, law: Law, nodes: Floats, values: Floats
) -> Rig | None:
    """Return the rig with a curve; None if no rig can have it.

    The values of a map are added to the signal. Neither a map nor a bend may fall: where one
    would, it is flat. Friction by load is not below 0. A curve of the schedule is constant beyond
    its nodes.
    """
    kind = type(filed_curve(rig, control, law))
    of, value, _ = units_of(rig, control, law)
    given = values
    if kind is GradientCurve:  # held at its ends, as the schedule's table
        beyond = 0.01 * float(nodes[-1] - nodes[0])
        nodes = np.concatenate(([nodes[0] - beyond], nodes, [nodes[-1] + beyond]))
        given = np.pad(values, 1, "edge")
    if kind.MAP or kind is BendCurve:
        line = nodes * (1.0 if kind.MAP else rig.controls[control].loader.least_bend)
        raised = np.maximum.accumulate(values + line)
        given = raised if kind.MAP else raised - line - np.interp(0.0, nodes, raised - line)
    if kind is LoadCurve:
        given = np.maximum(values, 0.0)
    lists = {
        name: np.where(np.abs(each) < SMALLEST, 0.0, each).tolist()
        for name, each in ((of, nodes), (value, given))
    }
    try:
        return rig.changed({f"controls.{control}.{law.key}": lists})
    except InputError:
        return None


def rising(places: Floats) -> Floats:
    """Return functions that rise from one place to the next, shape (places, functions).

    They are 0 towards 0 and ±1 beyond; one is constant. A rig that may not have a falling curve
    can have each, and together they span all functions that are linear between the places.
    """
    above = np.tri(len(places))
    for zero in np.flatnonzero(places == 0.0):
        above[:, :zero] = -np.tri(len(places)).T[:, :zero]
        above[:, zero] = 1.0
    return above


def places_of(signal: Floats, law: Law, entries: Sequence[float]) -> Floats:
    """Return where a curve may have nodes: evenly spaced, at quantiles, at 0 and at entries."""
    low, high = float(signal.min()), float(signal.max())
    if law.by_size:
        low = 0.0
    elif law.stage != "schedule":
        width = max(abs(low), abs(high))
        low, high = min(low, -1e-2 * width), max(high, 1e-2 * width)
    near = 0.4 * (high - low) / CURVE_PLACES
    found = [low, high, *(x for x in entries if low < x < high)]
    found += [0.0] if low < 0.0 < high else []
    even = np.linspace(low, high, CURVE_PLACES)
    for x in (*even, *np.quantile(signal, np.linspace(0.0, 1.0, CURVE_PLACES))):
        if all(abs(x - other) > near for other in found):
            found.append(float(x))
    return np.unique(found)


@dataclass(frozen=True)
class Sums:
    """The normal equations of each output, and the weights of its frames.

    `inner` is JᵀJ, shape (outputs, places, places), `along` Jᵀ·residual, `power` the residual's sum
    of squares, `frames` their number, `samples` the effective number, `variance` that of the
    residual in floors², `smooth` τ_n/τ_o (`evidence`). `weights` are those of a frame in the
    likelihood.
    """

    inner: Floats
    along: Floats
    power: Floats
    frames: Floats
    samples: Floats
    variance: Floats
    smooth: Floats
    weights: Floats

    def of(self, mix: Floats) -> Sums:
        """Return the sums for combinations of the columns, shape (places, combinations)."""
        inner = np.einsum("pi,opq,qj->oij", mix, self.inner, mix)
        return replace(self, inner=inner, along=self.along @ mix)

    def likelihood(self, theta: Floats) -> float:
        """Return the log likelihood of values."""
        curved = np.einsum("i,oij,j->o", theta, self.inner, theta)
        left = np.maximum(self.power - 2.0 * self.along @ theta + curved, 0.0)
        square = left / (self.frames * self.variance)
        return -0.5 * float(self.samples @ misfit(square, self.smooth))

    def posterior(self, prior: Floats) -> Posterior:
        """Return values, their covariance, and the log evidence for a prior's precision."""
        inner, along = self.weighted()
        precision = inner + prior
        theta = np.asarray(np.linalg.solve(precision, along), dtype=np.float64)
        covariance = np.asarray(np.linalg.inv(precision), dtype=np.float64)
        volume = np.linalg.slogdet(precision)[1] - np.linalg.slogdet(prior)[1]
        rest = -0.5 * float(theta @ prior @ theta) - 0.5 * float(volume) - PRIOR_EFFECT
        rest -= PRIOR_NUMBER * (len(theta) - 1)
        return Posterior(theta, covariance, rest, self.likelihood(theta))

    def weighted(self) -> tuple[Floats, Floats]:
        """Return JᵀJ and Jᵀ·residual of all outputs, by the weights of their frames."""
        return np.einsum("o,oij->ij", self.weights, self.inner), self.weights @ self.along


@dataclass(frozen=True)
class Posterior:
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
class Basis:
    """The responses to a unit of a law's value at each place, about a fitted curve.

    `columns` are those of each output, (frames, places), `wanted` its linearised residual without
    the curve.
    """

    law: Law
    places: Floats
    outputs: Sequence[Output]
    columns: Sequence[Floats]
    wanted: Sequence[Floats]
    error: ModelError

    @property
    def free(self) -> NDArray[np.bool_]:
        """The places whose value is free: all but 0 of an anchored law."""
        return np.asarray(~(self.law.anchored & (self.places == 0.0)))

    @cached_property
    def _scales(self) -> tuple[Floats, Floats]:
        """Autocorrelation time and q of each output's residual with a value at every place."""
        scale = 1.0 / np.sqrt(self.error.variance)
        columns = np.concatenate([j * s for j, s in zip(self.columns, scale, strict=True)])
        wanted = np.concatenate([w * s for w, s in zip(self.wanted, scale, strict=True)])
        theta = _least_squares(columns.T @ columns, columns.T @ wanted)
        lefts = [w - j @ theta for j, w in zip(self.columns, self.wanted, strict=True)]
        squares = np.array([float(np.mean(left**2)) for left in lefts]) / self.error.variance
        return np.array([memory(left) for left in lefts]), squares

    def sums(self, part: Part) -> Sums:
        """Return the normal equations of a part's frames."""
        memories, squares = self._scales
        rows = [output.rows(part) for output in self.outputs]
        some = [(j[at], w[at]) for j, w, at in zip(self.columns, self.wanted, rows, strict=True)]
        frames = np.array([float(at.sum()) for at in rows])
        whole = np.array([len(at) for at in rows])
        return Sums(
            np.array([j.T @ j for j, _ in some]),
            np.array([j.T @ w for j, w in some]),
            np.array([float(w @ w) for _, w in some]),
            frames,
            frames / memories,
            self.error.variance,
            self.error.smooth(whole / memories),
            1.0 / (memories * np.maximum(squares, 1.0) * self.error.variance),
        )


@dataclass(frozen=True)
class Pick:
    """A curve with nodes at some places: their indices, and the values' posterior."""

    at: tuple[int, ...]
    known: Posterior

    def values(self, basis: Basis) -> Values:
        """Return nodes and values; 0 at 0 of an anchored law."""
        return basis.places[list(self.at)], self._at_nodes(basis, self.known.theta)

    def errors(self, basis: Basis) -> Floats:
        """Return half of the 95 % interval of each value."""
        half = NORMAL_95 * UNDERSTATED * np.sqrt(np.diag(self.known.covariance))
        return self._at_nodes(basis, half)

    def _at_nodes(self, basis: Basis, free: Floats) -> Floats:
        found = np.zeros(len(self.at))
        found[basis.free[list(self.at)]] = free
        return found


def _least_squares(inner: Floats, along: Floats) -> Floats:
    """Solve normal equations, with a ridge for values that no frame depends on."""
    ridge = 1e-6 * np.trace(inner) / len(inner)
    return np.asarray(np.linalg.solve(inner + ridge * np.eye(len(inner)), along))


def _mix(basis: Basis, at: Sequence[int]) -> Floats:
    """Return the values at all places by those at some, shape (places, free of these)."""
    nodes = basis.places[list(at)]
    unit = np.eye(len(at))[:, basis.free[list(at)]]
    return np.array([np.interp(basis.places, nodes, column) for column in unit.T]).T


def _smooth(basis: Basis, at: Sequence[int]) -> Floats:
    """Return the precision of the kinks of values at some places, for κ = 1."""
    nodes = basis.places[list(at)]
    widths = np.diff(nodes) / (basis.places[-1] - basis.places[0])
    kinks = np.zeros((max(len(at) - 2, 0), len(at)))
    for k, (a, b) in enumerate(pairwise(widths.tolist())):
        kinks[k, k : k + 3] = np.array([1.0 / a, -1.0 / a - 1.0 / b, 1.0 / b])
        kinks[k] /= math.sqrt(0.5 * (a + b))
    kinks = kinks[:, basis.free[list(at)]]
    return np.asarray(kinks.T @ kinks)


def with_nodes(basis: Basis, sums: Sums, at: Sequence[int]) -> Pick:
    """Return the curve with nodes at given places, and the smoothness of the largest evidence."""
    own, rough = sums.of(_mix(basis, at)), _smooth(basis, at)
    size = max(rms_of(_least_squares(*own.weighted())), 1e-300)
    level = np.eye(len(rough)) / (WIDTH * size) ** 2
    each = [own.posterior(level + rough / (kink * size) ** 2) for kink in CURVE_KINKS]
    return Pick(tuple(at), max(each, key=lambda one: one.log))


def choose(basis: Basis, sums: Sums, entries: Sequence[float]) -> Pick:
    """Return the curve of the largest evidence, with nodes added to the ends, or to the entries."""
    ends = {0, len(basis.places) - 1, *np.flatnonzero(basis.places == 0.0).tolist()}
    own = ends | {*np.flatnonzero(np.isin(basis.places, entries)).tolist()}
    starts = [ends, own] if len(ends) < len(own) < CURVE_NODES else [ends]
    grown = [_grown(basis, sums, with_nodes(basis, sums, sorted(at)), ends) for at in starts]
    return max(grown, key=lambda one: one.known.log)


def straight(basis: Basis, sums: Sums) -> float:
    """Return the largest log evidence of a straight line, which the library's effects have."""
    known = (_free(sums.of(line)) for line in _lines(basis))
    return max((one.log for one in known if one is not None), default=-math.inf)


def _lines(basis: Basis) -> list[Floats]:
    """Return the straight lines of a law at its places: level and slope, or one of them."""
    slope = basis.places[:, None]
    if basis.law.anchored:
        return [slope]
    level = np.ones_like(slope)
    return [slope, level, np.column_stack((slope, level))]


def _grown(basis: Basis, sums: Sums, start: Pick, ends: set[int]) -> Pick:
    """Return the curve of a forward and then backward selection of nodes by the evidence.

    A node that lowers it is kept for one step more, since two nodes together may raise it.
    """
    best = last = start
    while len(last.at) < CURVE_NODES and len(last.at) <= len(best.at) + 1:
        more = [k for k in range(len(basis.places)) if k not in last.at]
        if not more:
            break
        tries = (with_nodes(basis, sums, sorted((*last.at, k))) for k in more)
        last = max(tries, key=lambda one: one.known.log)
        best = max(best, last, key=lambda one: one.known.log)
    while inner := [k for k in best.at if k not in ends]:
        fewer = [with_nodes(basis, sums, [j for j in best.at if j != k]) for k in inner]
        less = max(fewer, key=lambda one: one.known.log)
        if less.known.log < best.known.log:
            break
        best = less
    return best


@dataclass(frozen=True)
class Form:
    """A closed form that fits as well as a curve.

    `curve` are its nodes and values, `errors` half of their 95 % intervals; None of a form of two
    signals, and of one with a kink, whose place is known only roughly.
    """

    name: str
    curve: Values | None = None
    errors: Floats = field(default_factory=lambda: np.zeros(0))


def closed_form(
    basis: Basis, curve: Pick, entries: Sequence[float], others: Mapping[str, Sequence[Floats]]
) -> Form | None:
    """Return the closed form with the largest evidence, if that is as large as the curve's.

    Beside it, a straight line is free: its slope and its level are effects of the library. `others`
    are forms of more than the law's signal, by name, as the responses of each output, in floors.
    """
    columns = [
        np.column_stack((own, *(each[k] for each in others.values())))
        for k, own in enumerate(basis.columns)
    ]
    sums = replace(basis, columns=columns).sums("all")
    unit = np.eye(len(basis.places) + len(others))
    on_places = unit[:, : len(basis.places)]
    forms = [(name, on_places @ form) for name, form in _forms(basis.law, basis.places, entries)]
    exact = {name for name, _ in forms}
    forms += [(name, on_places @ form) for name, form in _zones(basis.law, basis.places)]
    forms += zip(others, unit[len(basis.places) :, :, None], strict=True)
    lines = [np.empty((len(unit), 0)), *(on_places @ line for line in _lines(basis))]
    best, found = curve.known.log - RIVAL_GAIN, None
    for text, form in forms:
        for line in lines:
            known = _free(sums.of(np.column_stack((form, line))))
            if known is not None and known.log > best:
                best, found = known.log, (text, form.ravel(), known)
    if found is None:
        return None
    text, form, known = found
    half = NORMAL_95 * UNDERSTATED * math.sqrt(float(known.covariance[0, 0]))
    shape = form[: len(basis.places)]
    if text not in exact:
        return Form(text)
    at = _bent_at(basis.places, shape)
    return Form(text, (basis.places[at], known.theta[0] * shape[at]), half * np.abs(shape[at]))


def _bent_at(places: Floats, shape: Floats) -> NDArray[np.intp]:
    """Return the places that draw a form: its kinks if they are few, or else evenly spaced ones."""
    slope = np.diff(shape) / np.diff(places)
    kinks = np.flatnonzero(np.abs(np.diff(slope)) > TINY * np.max(np.abs(slope))) + 1
    if len(kinks) > CURVE_NODES - 2:
        even = np.linspace(places[0], places[-1], CURVE_NODES)
        kinks = np.argmin(np.abs(places[:, None] - even), axis=0)
    zero = np.flatnonzero(places == 0.0)
    return np.unique(np.concatenate(([0, len(places) - 1], zero, kinks)))


def _free(sums: Sums) -> Posterior | None:
    """Return a few independent sizes, of priors as wide; None without responses."""
    inner, along = sums.weighted()
    if not np.all(np.diag(inner) > 0.0):
        return None
    scale = 1.0 / np.sqrt(np.diag(inner))
    theta, *_ = np.linalg.lstsq(inner * np.outer(scale, scale), scale * along, rcond=None)
    theta *= scale
    width = WIDTH * np.maximum(np.abs(theta), scale)
    return sums.posterior(np.diag(1.0 / width**2))


def _forms(law: Law, x: Floats, entries: Sequence[float]) -> Iterator[tuple[str, Floats]]:
    """Yield the closed forms of a law, and their values at places, shape (places, 1)."""
    s, size = law.symbol, np.abs(x)
    if law.stage == "schedule":
        for at, unit in zip(entries, np.eye(len(entries)), strict=True):
            if x[0] <= at <= x[-1]:
                yield f"one entry, at {at:g} Pa", np.interp(x, entries, unit)
        yield f"c·{s}²", x**2
        return
    yield f"c·{s}·|{s}|", x * size
    yield f"c·{s}³", x**3
    if not law.by_size:
        yield f"c·{s}²", x**2
        yield f"c·|{s}|", size


def _zones(law: Law, x: Floats) -> Iterator[tuple[str, Floats]]:
    """Yield the closed forms with a kink, which may lie between two places, as `_forms` does."""
    if law.stage == "schedule":
        return
    s, size = law.symbol, np.abs(x)
    zone = "dead zone" if law.is_map else "saturation"
    for k, at in enumerate(np.unique(size[size > 0.0])):
        yield f"{zone} at |{s}| = {at:.3g}", np.clip(x, -at, at)
        if k > 0:  # between 0 and the first place the sign is a line, as the zone
            yield f"c·sgn({s}) beyond |{s}| = {at:.3g}", np.sign(x) * (size >= at)
