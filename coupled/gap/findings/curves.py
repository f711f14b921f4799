"""Curves: functions of one signal that describe a residual which no effect explains.

A curve is not a cause, and does not change the verdict. Where the credible effects leave a stage
unexplained, each curve that a rig may have is fitted as a piecewise linear function of its signal
(`curvefit`). The responses to its values are finite differences (Gauss-Newton) of a replay. Nodes
and values are fitted to every other stretch; the others give the share `closed`.

The curve whose linear model has the largest evidence is fitted further, about its last values. It
is reported if a rig can have it, if it is bent (a straight line is an effect of the library), if
it has more evidence than the effects found, closes most of the gap on held-out stretches, and has
the same size in all halves of the record. The curve of an intermittent or fading fault does not.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from coupled.display import split_unit
from coupled.errors import joined
from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.chain import stage_of
from coupled.gap.findings.budget import ChannelShrink, channel_shrink
from coupled.gap.findings.credibility import Acts, regimes
from coupled.gap.findings.curvefit import (
    LAWS,
    Basis,
    Form,
    Law,
    Pick,
    Values,
    choose,
    closed_form,
    filed_curve,
    named,
    places_of,
    rising,
    straight,
    units_of,
    with_curve,
    with_nodes,
)
from coupled.gap.findings.result import EffectResult
from coupled.gap.findings.summary import plain
from coupled.gap.findings.where import signals
from coupled.gap.noise.noise import rms_of
from coupled.gap.noise.smooth import smoothed
from coupled.gap.search.case import Case
from coupled.gap.search.evidence import (
    Evidence,
    evidence,
    evidence_of,
    fewest_unexplained,
    misfit,
)
from coupled.gap.search.found import Choice, Fit
from coupled.gap.search.problem import ModelError, Problem
from coupled.gap.signals.output import Floats, Output, stage_gaps, unexplained
from coupled.gap.signals.reading import LOAD
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import (
    CERTAIN,
    DRIFT_CHANCE,
    LESSER,
    MOST,
    NEGLIGIBLE,
    RIVAL_GAIN,
    TRIES,
)
from coupled.parallel import in_threads
from coupled.record.channels import ControlName, unit_of
from coupled.record.record import Record
from coupled.rig.rig import Rig
from coupled.rig.surface import share_of_travel


@dataclass(frozen=True)
class Curve:
    """A function of one signal that reproduces a residual; it does not state the cause.

    `key` is that of the rig file, `of` and `lists` its keys of the nodes and of the values. `unit`
    is that of the values, `low` and `high` their 95 % intervals, `closed` the share of the gap
    closed on held-out stretches, with its interval, `form` a closed form that fits as well.
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
    lists: str = ""
    form: Form | None = None

    @property
    def like(self) -> str:
        """The name of the closed form, or empty."""
        return "" if self.form is None else self.form.name

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

    `shrink` is the reduction of the gap in each channel that they change, with curves fitted to
    the other stretches. `instead` are the effects that the curves describe better, with their odds.
    """

    found: tuple[Curve, ...]
    rig: Rig
    shrink: tuple[ChannelShrink, ...]
    instead: Mapping[str, float] = field(default_factory=dict)

    def better_than(self, names: Sequence[str]) -> str:
        """Return a sentence on those of some effects that the curves describe better."""
        ours = joined([plain(name) for name in names if name in self.instead])
        if len(self.found) > 1:
            return f"They describe the gap better than {ours}, which may only approximate them."
        return f"It describes the gap better than {ours}, which may only approximate it."

    def probable(self, effect: EffectResult) -> EffectResult:
        """Return an effect with the probability that it has beside the curves."""
        if effect.name not in self.instead:
            return effect
        odds = self.instead[effect.name]
        return replace(effect, probability=odds / (1.0 + odds) * effect.probability)

    def in_closed_form(self, case: Case) -> Curves | None:
        """Return the curve in its closed form, with the nominal rig; None if it has none."""
        form = self.found[0].form if len(self.found) == 1 else None
        if form is None or form.curve is None:
            return None
        (nodes, values), (one,) = form.curve, self.found
        drawn = replace(
            one,
            nodes=tuple(nodes.tolist()),
            values=tuple(values.tolist()),
            low=tuple((values - form.errors).tolist()),
            high=tuple((values + form.errors).tolist()),
        )
        return replace(self, found=(drawn,)).scaled(case, 1.0)

    def scaled(self, case: Case, scale: float) -> Curves | None:
        """Return the only curve times a factor, with the nominal rig; None if no rig has it."""
        (one,) = self.found
        law = next(law for law in LAWS if one.key == f"controls.{case.control}.{law.key}")
        own = np.array(one.values)
        rig = with_curve(case.nominal, case.control, law, np.array(one.nodes), scale * own)
        if rig is None:
            return None
        values, low, high = (
            tuple((np.array(each) + (scale - 1.0) * own).tolist())
            for each in (one.values, one.low, one.high)
        )
        return replace(self, found=(replace(one, values=values, low=low, high=high),), rig=rig)


def find_curves(
    case: Case, choice: Choice, effects: Sequence[EffectResult], records: Sequence[Record]
) -> Curves | None:
    """Return curves of the stages that the credible effects do not explain; None if none.

    They are fitted beside the credible effects. Several effects of such a stage may be terms of a
    series that approximates one curve: they compete with the curves without them, by evidence. A
    single law that leaves little may only be rough, and does not compete.
    """
    sure = {one.name for one in effects if one.probability >= CERTAIN}
    problem = Problem(case)
    error = problem.model_error(choice.without_effects.rig)
    beside = _Curved.of(problem, choice, sure, records)
    ours = _above_noise(problem, choice)
    if len(ours) < 2:
        return beside.curves(case)
    alone = _Curved.of(problem, choice, sure - ours, records) if sure & ours else beside
    instead = alone.curves(case)
    if instead is None:
        return beside.curves(case)
    known = [evidence(problem, choice.fit, error), alone.evidence(error)]
    known += [beside.evidence(error)] if sure & ours else []
    samples = fewest_unexplained(known)
    by_effects, by_curves, *by_both = (one.log(samples) for one in known)
    ahead = by_curves - max((by_effects, *by_both))
    if ahead < 0.0:
        return beside.curves(case)
    return replace(instead, instead=dict.fromkeys(ours, math.exp(-ahead)))


@dataclass(frozen=True)
class _Curved:
    """The curves found beside the effects of `base`: the rig with them, and with those by `half`.

    `half` are fitted to every other stretch. `rest` is that of the curves' evidence.
    """

    problem: Problem
    base: Fit
    found: tuple[Curve, ...]
    rig: Rig
    half: Rig
    rest: float

    @classmethod
    def of(
        cls, problem: Problem, choice: Choice, names: Collection[str], records: Sequence[Record]
    ) -> _Curved:
        """Return the curves beside some of the effects found."""
        case, kept = problem.case, [e for e in choice.fit.effects if e.name in names]
        base = choice.fit if kept else choice.without_effects
        if kept and len(kept) < len(choice.fit.effects):
            base = problem.fit(kept, choice.fit.values)
        made = cls(problem, base, (), base.rig, base.rig, 0.0)
        while open_outputs := _open_outputs(case, choice, made.rig):
            stages = {stage_of(at) for at in open_outputs}
            one = _Fitter(case, problem, base, made.rig, choice.fit, records).best(stages)
            if one is None:
                break
            curve, rig, law, fitted, rest = one
            half = with_curve(made.half, case.control, law, *fitted) or made.half
            made = cls(problem, base, (*made.found, curve), rig, half, made.rest + rest)
        return made

    def evidence(self, error: ModelError) -> Evidence:
        """Return the evidence of the curves and of the effects of the base."""
        rest = evidence(self.problem, self.base, error).rest + self.rest
        return evidence_of(self.problem, self.rig, error, rest)

    def curves(self, case: Case) -> Curves | None:
        """Return the curves; None if there are none."""
        if not self.found:
            return None
        closed = tuple(
            channel_shrink(output, case.nominal, self.half, 1.0, improved=True)
            for output in case.outputs
            if not np.array_equal(output.residual(self.rig), output.residual(self.base.rig))
        )
        return Curves(self.found, self.rig, closed)


def _above_noise(problem: Problem, choice: Choice) -> frozenset[str]:
    """Return the effects found that show in outputs of which they leave more than noise."""
    left = problem.over_limit(choice.fit.rig)
    return frozenset(one.name for one in choice.fit.effects if left & {*one.shows_in})


def _open_outputs(case: Case, choice: Choice, rig: Rig) -> set[str]:
    """Return the outputs whose residual with a rig exceeds that of an explained stage."""
    root = stage_gaps(case.outputs, choice.without_effects.rig)
    return unexplained(root, stage_gaps(case.outputs, rig), case.outputs)


# A curve as reported, the rig with it, its law, its nodes and values by the fitted stretches, and
# the terms of its evidence beside the likelihood.
_Found = tuple[Curve, Rig, Law, Values, float]


@dataclass(frozen=True)
class _Fitter:
    """Fits curves beside the effects of `base` and the curves of `rig`, to beat the `whole` fit."""

    case: Case
    problem: Problem
    base: Fit
    rig: Rig
    whole: Fit
    records: Sequence[Record]

    def best(self, stages: set[str]) -> _Found | None:
        """Return the curve of the largest evidence that shows in stages; None if none holds.

        All laws compete by the evidence of their linear models, also those that no rig can have:
        their residual follows no other signal. The others that gain are fitted further, since a
        response is not linear in a large curve, and compete again. Of laws that the data do not
        discriminate, the first that a rig can have is taken: a bend, or beyond the least bend what
        the force adds to the reading at the grip.
        """
        begun = [one for law in LAWS if (one := self._begun(law, stages)) is not None]
        above = [pick.known.log - self._likelihood(basis, self.rig) for basis, pick in begun]
        flown = [
            (gain, self._refined(*one, rig))
            for one, gain in zip(begun, above, strict=True)
            if gain > 0.0 and (rig := self._with(one[0].law, one[1].values(one[0])))
        ]
        if not any(gain > max(above) - RIVAL_GAIN for gain, _ in flown):
            return None
        known = [
            evidence_of(self.problem, rig, self._error, pick.known.rest)
            for _, (_, pick, rig) in flown
        ]
        samples = fewest_unexplained(known)
        logs = [one.log(samples) for one in known]
        first = next(k for k, log in enumerate(logs) if log > max(logs) - RIVAL_GAIN)
        _, (basis, pick, fitted) = flown[first]
        line = straight(basis, basis.sums("fitted"))
        whole = self._basis(basis.law, basis.places, basis.outputs, pick.values(basis))
        if whole is None or pick.known.log < line + RIVAL_GAIN:
            return None
        last = with_nodes(whole, whole.sums("all"), pick.at)
        rig = self._with(whole.law, last.values(whole))
        if rig is None or not self._beats_effects(rig, last):
            return None
        curve = self._stated(whole, last, rig, fitted)
        return (
            None if curve is None else (curve, rig, basis.law, pick.values(basis), last.known.rest)
        )

    def _beats_effects(self, rig: Rig, pick: Pick) -> bool:
        """Tell whether a curve has more evidence than the effects found, and than none."""
        without = evidence(self.problem, replace(self.base, rig=self.rig), self._error)
        by_effects = evidence(self.problem, self.whole, self._error)
        curved = evidence_of(self.problem, rig, self._error, without.rest + pick.known.rest)
        samples = fewest_unexplained([without, by_effects, curved])
        rivals = without.log(samples), by_effects.log(samples)
        return curved.log(samples) >= max(rivals) + RIVAL_GAIN

    @cached_property
    def _error(self) -> ModelError:
        return self.problem.model_error(self.base.rig)

    def _begun(self, law: Law, stages: set[str]) -> tuple[Basis, Pick] | None:
        """Return a law's linear fit; None if it cannot be, or shows in none of the stages."""
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
        entries = self._entries(law)
        basis = self._basis(law, places_of(signal, law, entries), outputs, None)
        return None if basis is None else (basis, choose(basis, basis.sums("fitted"), entries))

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
            return NEGLIGIBLE
        name = f"{self.case.control}_{named(law.scale, self.case.control)}"
        record = self.records[outputs[0].record]
        if name not in record:  # δc
            name = f"{self.case.control}_deflection_{unit_of(self.case.control)}"
        return NEGLIGIBLE * rms_of(record[name])

    def _with(self, law: Law, values: Values) -> Rig | None:
        return with_curve(self.rig, self.case.control, law, *values)

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
        is_free = ~(law.anchored & (places == 0.0))
        free = np.flatnonzero(is_free)
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
        if not any(np.any(column) for column in columns):
            return None
        theta = np.where(is_free, np.interp(places, nodes, start), 0.0)
        index = [k for k, one in enumerate(self.problem.outputs) if any(one is o for o in outputs)]
        wanted = [o.residual(rig) + j @ theta for o, j in zip(outputs, columns, strict=True)]
        return Basis(law, places, outputs, columns, wanted, self._error.of(index))

    def _likelihood(self, basis: Basis, rig: Rig) -> float:
        """Return the log likelihood of a rig in the fitted stretches, by the basis's samples."""
        sums = basis.sums("fitted")
        lefts = [output.residual(rig, "fitted") for output in basis.outputs]
        squares = np.array([float(np.mean(left**2)) for left in lefts]) / sums.variance
        return -0.5 * float(sums.samples @ misfit(squares, sums.smooth))

    def _refined(self, basis: Basis, pick: Pick, rig: Rig) -> tuple[Basis, Pick, Rig]:
        """Return a law fitted again about its last curve, while the fit improves, and its rig."""
        for _ in range(TRIES):
            again = self._basis(basis.law, basis.places, basis.outputs, pick.values(basis))
            if again is None:
                break
            next_pick = choose(again, again.sums("fitted"), self._entries(again.law))
            changed = self._with(again.law, next_pick.values(again))
            if changed is None:
                break
            gain = self._likelihood(again, changed) - self._likelihood(again, rig)
            if gain < 0.0:
                break
            basis, pick, rig = again, next_pick, changed
            if gain < 1.0:
                break
        return basis, pick, rig

    def _stated(self, basis: Basis, pick: Pick, rig: Rig, fitted: Rig) -> Curve | None:
        """Return the curve for the report; None if it is not held out, or not stationary."""
        outputs, law = basis.outputs, basis.law
        widest = max(outputs, key=lambda output: output.gap(self.rig))
        held = channel_shrink(widest, self.rig, fitted, 1.0, improved=True)
        if held.closed is None or held.low is None or held.high is None:
            return None
        if held.low < MOST or self._drift(rig, outputs) > LESSER:
            return None
        nodes, _ = pick.values(basis)
        errors = pick.errors(basis)
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
            form=closed_form(basis, pick, self._entries(law), self._of_two_signals(basis)),
            lists=lists,
        )

    def _of_two_signals(self, basis: Basis) -> dict[str, list[Floats]]:
        """Return the responses to a force in proportion to δ·|v|, by name; none of other stages."""
        outputs, control = basis.outputs, self.case.control
        if basis.law.stage != "loader":
            return {}
        found = []
        for output in outputs:
            record = self.records[output.record]
            known = signals(output, output.residual(self.rig), record, control, "loader")
            d = unit_of(control)
            force = known[f"computed_{d}"] * np.abs(known[f"computed_rate_{d}_per_s"])
            size = self._step(basis.law, outputs) / rms_of(force)
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

    It is the force of a bob weight of 1 N/g in an equal load factor.
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
