"""Curves: functions of one signal that describe a residual which no effect explains.

A curve is not a cause, and does not change the verdict. Where the credible effects leave a stage
unexplained, each curve that a rig may have (`curvelaws`) is fitted as a piecewise linear function
of its signal (`curvefit`), and flown by the stage's own code. The responses to its values are
finite differences about the last fit (Gauss-Newton). Nodes and values are fitted to every other
stretch; the others give the share `closed`.

The curve with the largest evidence in the whole record is reported if it is bent (a straight line
is an effect of the library), beats the effects found, closes at least `CURVE_CLOSES` of the gap on
held-out stretches, and has the same size in all halves of the record. An intermittent or a fading
fault has not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.display import split_unit
from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.chain import stage_of
from coupled.gap.findings.budget import ChannelShrink, channel_shrink
from coupled.gap.findings.credibility import Acts, regimes
from coupled.gap.findings.curvefit import (
    Basis,
    Pick,
    Values,
    choose,
    closed_form,
    straight,
    with_nodes,
)
from coupled.gap.findings.curvelaws import (
    LAWS,
    Law,
    filed_curve,
    named,
    places_of,
    rising,
    units_of,
    with_curve,
)
from coupled.gap.findings.result import EffectResult
from coupled.gap.findings.where import signals
from coupled.gap.noise.smooth import smoothed
from coupled.gap.search.case import Case
from coupled.gap.search.evidence import Evidence, evidence, fewest_unexplained, misfit
from coupled.gap.search.found import Choice, Fit
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import (
    Output,
    explained_below,
    memory,
    stage_gaps,
    stage_limits,
)
from coupled.gap.signals.reading import LOAD
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import (
    CERTAIN,
    CURVE_CLOSES,
    CURVE_DRIFT,
    CURVE_NEAR,
    CURVE_ROUNDS,
    CURVE_STEP,
    DRIFT_CHANCE,
    RIVAL_GAIN,
)
from coupled.parallel import in_threads
from coupled.record.channels import ControlName, unit_of
from coupled.record.record import Record
from coupled.rig.rig import Rig
from coupled.rig.surface import share_of_travel

Floats = NDArray[np.float64]


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
class _Made:
    """A curve fitted to the fitted stretches: its nodes and values, its rig, and the fit."""

    law: Law
    values: Values
    rig: Rig
    basis: Basis
    pick: Pick
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
        gains = [one.likelihood - self._likelihood(one.basis, self.rig) for one in begun]
        if max(gains, default=0.0) <= 0.0:
            return None
        near = [
            self._refined(one)
            for one, gain in zip(begun, gains, strict=True)
            if gain > CURVE_NEAR * max(gains)
        ]
        ends = [end for made in near if (end := self._whole(made)) is not None]
        if not ends:
            return None
        without = evidence(self.problem, replace(self.base, rig=self.rig), self._variances)
        by_effects = evidence(self.problem, self.whole, self._variances)
        known = [self._evidence(rig, without, pick) for _, rig, pick in ends]
        samples = fewest_unexplained([without, by_effects, *known])
        logs = [one.log(samples) for one in known]
        at = int(np.argmax(logs))
        made, rig, pick = ends[at]
        rivals = without.log(samples), by_effects.log(samples)
        if logs[at] < max(rivals) + RIVAL_GAIN or not self._bent(made):
            return None
        curve = self._stated(made, rig, pick)
        return None if curve is None else (curve, rig, made)

    @cached_property
    def _variances(self) -> Floats:
        return self.problem.variances(self.base.rig)

    def _evidence(self, rig: Rig, without: Evidence, pick: Pick) -> Evidence:
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
        if signal is None or filed_curve(self.rig, self.case.control, law).nodes:
            return None
        return self._fitted(law, places_of(signal, law, self._entries(law)), outputs, None)

    def _signal(self, law: Law, outputs: Sequence[Output]) -> Floats | None:
        """Return a law's signal in all of its records; None if one lacks it."""
        control, found = self.case.control, []
        for output in {output.record: output for output in outputs}.values():
            record, left = self.records[output.record], output.residual(self.rig)
            stage = "loader" if law.stage == "sensing" else law.stage
            shown = signals(output, left, record, control, stage)
            name = named(law.signal, control)
            if name not in shown and (own := f"{control}_{name}") in record:
                shown[name] = smoothed(record[own])
            each = shown.get(name)
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
        name = f"{self.case.control}_{named(law.scale, self.case.control)}"
        record = self.records[outputs[0].record]
        if name not in record:  # δc
            name = f"{self.case.control}_deflection_{unit_of(self.case.control)}"
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
        pick = choose(basis, basis.sums("fitted"), self._entries(law))
        values = pick.values(basis)
        rig = self._with(law, values)
        if rig is None:
            return None
        return _Made(law, values, rig, basis, pick, self._likelihood(basis, rig))

    def _basis(
        self, law: Law, places: Floats, outputs: Sequence[Output], about: Values | None
    ) -> Basis | None:
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
        steps = rising(places)

        def response(k: int) -> list[Floats] | None:
            bends = np.flatnonzero(np.diff(steps[:, k]))
            own = np.union1d(nodes, places[[*bends, *(bends + 1)]])
            values = np.interp(own, nodes, start) + step * np.interp(own, places, steps[:, k])
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
        to_hats = np.linalg.inv(steps[np.ix_(free, free)])
        columns = [np.zeros((len(output.measured), len(places))) for output in outputs]
        for o, column in enumerate(columns):
            column[:, free] = np.column_stack([one[o] for one in each if one]) @ to_hats
        responds = [bool(np.any(column)) for column in columns]
        if not any(responds):
            return None
        theta = np.interp(places, nodes, start)
        theta[np.setdiff1d(np.arange(len(places)), free)] = 0.0
        index = [k for k, one in enumerate(self.problem.outputs) if any(one is o for o in outputs)]
        return Basis(
            law,
            places,
            outputs,
            columns,
            [o.residual(rig) + j @ theta for o, j in zip(outputs, columns, strict=True)],
            self._variances[index],
        )

    def _likelihood(self, basis: Basis, rig: Rig) -> float:
        """Return the log likelihood of a rig in the fitted stretches, by the basis's samples."""
        sums = basis.sums("fitted")
        lefts = [output.residual(rig, "fitted") for output in basis.outputs]
        squares = np.array([float(np.mean(left**2)) for left in lefts]) / sums.variance
        return -0.5 * float(sums.samples @ misfit(squares))

    def _refined(self, made: _Made) -> _Made:
        """Return a law fitted again about its last curve, while the fit improves."""
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

    def _whole(self, made: _Made) -> tuple[_Made, Rig, Pick] | None:
        """Return a curve's values from all stretches, with their rig."""
        basis = self._basis(made.law, made.basis.places, made.basis.outputs, made.values)
        if basis is None:
            return None
        pick = with_nodes(basis, basis.sums("all"), made.pick.at)
        rig = self._with(made.law, pick.values(basis))
        return None if rig is None else (replace(made, basis=basis), rig, pick)

    def _bent(self, made: _Made) -> bool:
        """Tell whether a curve has more evidence than a straight line."""
        line = straight(made.basis, made.basis.sums("fitted"))
        return made.pick.known.log > line + RIVAL_GAIN

    def _stated(self, made: _Made, rig: Rig, pick: Pick) -> Curve | None:
        """Return a curve with its tests; None if it fails one."""
        outputs, law = made.basis.outputs, made.law
        widest = max(outputs, key=lambda output: output.gap(self.rig))
        held = channel_shrink(widest, self.rig, made.rig, 1.0, improved=True)
        if held.closed is None or held.low is None or held.high is None:
            return None
        if held.low < CURVE_CLOSES or self._drift(rig, outputs) > CURVE_DRIFT:
            return None
        nodes, _ = pick.values(made.basis)
        errors = pick.errors(made.basis)
        of, lists, unit = units_of(self.rig, self.case.control, law)
        shown = filed_curve(rig, self.case.control, law).at(nodes)
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
            like=closed_form(made.basis, pick, self._entries(law), self._of_two_signals(made)),
            lists=lists,
        )

    def _of_two_signals(self, made: _Made) -> dict[str, list[Floats]]:
        """Return the responses to a force in proportion to δ·|v|, by name; none of other stages."""
        outputs, control = made.basis.outputs, self.case.control
        if made.law.stage != "loader":
            return {}
        found = []
        for output in outputs:
            record = self.records[output.record]
            known = signals(output, output.residual(self.rig), record, control, "loader")
            d = unit_of(control)
            force = known[f"computed_{d}"] * np.abs(known[f"computed_rate_{d}_per_s"])
            size = self._step(made.law, outputs) / float(np.sqrt(np.mean(force**2)))
            found.append(response_to_force(self.rig, control, record, output, size * force))
        return {"c·δ·|v|": found}

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


def response_to_force(
    rig: Rig, control: ControlName, record: Record, output: Output, force: Floats
) -> Floats:
    """Return an output's response to a force against δc, N at the frames, in floors.

    The force is that of a bob weight of 1 N/g, whose load factor is the force; those of rig and
    record are left out of the difference.
    """
    if output.stage != "loader":
        return np.zeros(len(output.measured))
    kept = [name for name in record.channels if name != LOAD]
    data = np.column_stack((*(record[name] for name in kept), 1.0 + force))
    loaded = replace(record, channels=(*kept, LOAD), data=data)
    reader = Reader(rig, loaded, control, surface_points, output.record)
    made = next(one for one in reader.outputs() if one.channel == output.channel)
    key = f"controls.{control}.loader.bob_weight_N_per_g"
    moved = made.predict(rig.changed({key: 1.0})) - made.predict(rig.changed({key: 0.0}))
    return np.asarray(moved / output.floor)
