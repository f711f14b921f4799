"""Records of the healthy machine as a reference, which separates model error from faults.

A nominal rig never describes a machine fully. Records of the healthy machine are therefore
diagnosed first, and the rig with their effects becomes the nominal rig. Its remaining residual is
the model error. It is added to each channel's noise floor, with its scatter between records. If
the model error raises a stage's floor above a tenth of the stage's motion, the stage is not judged
and the rig should first be fitted to the healthy records. An effect of the healthy machine may
imitate a model error whose size differs between records; the scatter of its parameter is therefore
the parameter's tolerance.

Whether the machine changed at all is tested without a model (`changed`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from coupled.display import unit_in
from coupled.gap.chain import stage_of
from coupled.gap.effects.effect import Effect, possible
from coupled.gap.effects.settings import ALONE
from coupled.gap.findings.budget import by_stretch
from coupled.gap.findings.changed import Comparison, compare
from coupled.gap.findings.result import StageResult, Verdict
from coupled.gap.noise.noise import rms_of
from coupled.gap.noise.smooth import smoothed
from coupled.gap.search.case import Case
from coupled.gap.search.found import Fit
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import HiddenGap, Output, Part
from coupled.gap.thresholds import ROUGH, SIGMAS
from coupled.record.record import Record
from coupled.rig.rig import Rig


@dataclass(frozen=True)
class ModelError:
    """The model error of one channel: its residual on the healthy machine, without noise.

    `rms` and `moves`, the channel's standard deviation, are in its unit; `rate` is that of its
    change per frame. `by_stretch` and `by_record` are relative standard deviations of the rms
    between stretches and between records. `misses` is the largest gap of a record beyond noise.
    """

    rms: float
    moves: float
    rate: float
    by_stretch: float
    by_record: float
    misses: float = 0.0

    @classmethod
    def of(cls, outputs: Sequence[Output], rig: Rig) -> ModelError:
        """Return the model error of one channel from its outputs, one for each record."""
        lefts = [output.residual(rig) * output.floor for output in outputs]
        power = float(np.mean(np.concatenate(lefts) ** 2))
        noise = float(np.mean([output.floor**2 for output in outputs]))
        each = [rms_of(left) for left in lefts]
        blocks = np.concatenate(
            [
                by_stretch(left**2, output.stretches) / np.bincount(output.stretches)
                for output, left in zip(outputs, lefts, strict=True)
            ]
        )
        few = ROUGH / math.sqrt(len(each))
        several = len(each) > 1 and power > 0.0  # a channel computed by the host may have none
        scatter = float(np.std(each, ddof=1) / np.mean(each)) if several else 0.0
        return cls(
            rms=math.sqrt(max(power - noise, 0.0)),
            moves=math.sqrt(float(np.mean([np.var(output.measured) for output in outputs]))),
            rate=math.sqrt(float(np.mean([_rate(output) ** 2 for output in outputs]))),
            by_stretch=0.5 * float(np.std(blocks) / max(np.mean(blocks), 1e-300)),
            by_record=max(scatter, few),
            misses=max((o.gap(rig) for o in outputs if o.gap(rig) > o.limit), default=0.0),
        )

    def raised(self, output: Output) -> Output:
        """Return an output with the model error added to its noise floor.

        It is scaled by how much larger or faster the motion is than in the healthy records.
        """
        larger = max(1.0, float(np.std(output.measured)) / max(self.moves, 1e-300))
        larger = max(larger, _rate(output) / max(self.rate, 1e-300))
        error = self.rms * larger
        floor = math.hypot(output.floor, error)
        share = (error / floor) ** 2
        hidden_gap = None
        if self.misses:
            hidden = floor / max(output.does, 1e-300)
            hidden_gap = HiddenGap(hidden, output.channel, output.channel, self.misses)
        stretches = max(len(np.unique(output.stretches)), 1)
        scatter = math.hypot(self.by_stretch / math.sqrt(stretches), self.by_record)
        return replace(
            output,
            floor=floor,
            spread=math.hypot((1.0 - share) * output.spread, share * scatter),
            smoothed=(1.0 - share) * output.smoothed,
            unsure=(1.0 - share) * output.unsure,
            hidden_gap=hidden_gap,
            _known=[],
        )


def _rate(output: Output) -> float:
    """Return the standard deviation of a smoothed channel's change per frame."""
    return float(np.std(np.diff(smoothed(output.measured))))


def tolerances(case: Case, found: Fit) -> dict[str, float]:
    """Return the tolerances of the fitted parameters by key, in the keys' units.

    They are `SIGMAS` standard deviations between records; of a single record, between its halves,
    and at least a share of the effect, as both halves have one motion. Parameters that no
    effect has alone stay as fitted: their scatter might absorb a change of another parameter.
    """
    numbers = sorted({output.record for output in case.outputs})
    single = len(numbers) == 1
    if not single:
        parts = [[o for o in case.outputs if o.record == n] for n in numbers]
        fits = [Problem(replace(case, outputs=p)).fit(found.effects, found.values) for p in parts]
    else:
        halves: tuple[Part, ...] = ("fitted", "held")
        fits = [Problem(case).fit(found.effects, found.values, part=half) for half in halves]
    wide = {}
    for effect in found.effects:
        for p in effect.free:
            key, name = p.key_on(case.control), effect.value_key(p)
            if key.startswith("flight.") or p.key not in ALONE:
                continue
            filed = float(p.nominal(case.nominal, case.control))
            each = [float(p.entered(filed, one.values[name])) for one in fits]
            off = abs(float(p.entered(filed, found.values[name])) - filed)
            least = ROUGH * off if single else 0.0
            scatter = max(SIGMAS * float(np.std(each, ddof=1)), least)
            if scatter > 0.0:
                wide[key] = scatter
    return wide


@dataclass(frozen=True)
class Baseline:
    """The healthy machine: its rig, the effects found in it, and the model errors.

    `records` are those by their files, `case` has the outputs of the rig as filed, `had` are the
    effects found in them, `errors` the model's by channel.
    """

    records: Mapping[str, Record]
    case: Case
    rig: Rig
    had: tuple[Effect, ...]
    errors: Mapping[str, ModelError]

    @classmethod
    def of(cls, records: Mapping[str, Record], case: Case, found: Fit) -> Baseline:
        """Return the reference from records of the healthy machine and the fit to them."""
        rig = found.rig
        if rig.controls:
            wide = {**rig.controls[case.control].tolerance, **tolerances(case, found)}
            rig = rig.changed({f"controls.{case.control}.tolerance": wide})
        names = dict.fromkeys(output.channel for output in case.outputs)
        each = {name: [one for one in case.outputs if one.channel == name] for name in names}
        errors = {name: ModelError.of(ours, rig) for name, ours in each.items()}
        return cls(records, case, rig, found.effects, errors)

    def compared(
        self, records: Mapping[str, Record], case: Case, force: bool, found: Fit | None = None
    ) -> Comparison:
        """Return records tested against the healthy ones, without what effects found do."""
        rig = now = self.case.nominal
        if found is not None and found.effects:
            rig = case.nominal  # to which the effects were fitted
            now = possible(rig, case.control, found.effects, found.values) or rig
        well = list(self.records.values()), self.case.outputs, rig
        return compare(self.case.control, well, (list(records.values()), case.outputs, now), force)

    def raised(self, outputs: Sequence[Output]) -> list[Output]:
        """Return outputs with the model error in their noise floors, where it is known."""
        return [
            self.errors[one.channel].raised(one) if one.channel in self.errors else one
            for one in outputs
        ]

    @property
    def missed(self) -> dict[str, ModelError]:
        """The channels in which the reference misses the healthy records by more than noise."""
        return {name: one for name, one in self.errors.items() if one.misses}

    @property
    def assumed(self) -> frozenset[str]:
        """The stages in which the healthy records widen what counts as noise, or a tolerance."""
        wide = {effect.stage for effect in self.had}
        stages = {output.channel: output.stage for output in self.case.outputs}
        return frozenset(wide | {stages[name] for name in self.missed})

    @property
    def words(self) -> str:
        """What the reference is, and where it misses the healthy records."""
        several = len(self.records) > 1
        count, them = (f"{len(self.records)} records", "them") if several else ("a record", "it")
        found = ", ".join(effect.name.replace("_", " ") for effect in self.had)
        had = f", with {found}" if found else ""
        said = f"Compared with the healthy machine of {count}{had}."
        if not self.missed:
            return said
        each = ", ".join(
            f"{name} by {one.misses:.3g} times its noise (rms {one.rms:.3g} {unit_in(name)})"
            for name, one in self.missed.items()
        )
        return (
            f"{said} The rig misses {them} in {each}: smaller changes are not detected there."
            f" Fit the rig to {them} first (coupled fit)."
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        errors = {
            name: {"rms": one.rms, "by_record": one.by_record, "misses": one.misses}
            for name, one in self.errors.items()
        }
        had = [effect.name for effect in self.had]
        return {"records": list(self.records), "effects": had, "errors": errors}


def beside_healthy(
    verdict: Verdict,
    stages: tuple[StageResult, ...],
    effects: Sequence[Effect],
    assumed: frozenset[str],
    change: Comparison,
) -> tuple[Verdict, tuple[StageResult, ...]]:
    """Return the verdict and the stages with what a comparison with healthy records shows.

    `change` compares the record beside its `effects`; `assumed` is as in `Baseline`. A stage that
    changed is faulty, unless it is one in which an effect or an unexplained fault shows. A stage
    whose floor hides a gap is judged by the comparison instead. No verdict is given where neither
    the comparison nor noise would have shown a change of a tenth.
    """
    known = {stage.name for stage in stages if stage.guilty}
    known |= {stage_of(output) for effect in effects for output in effect.shows_in}
    if known and not effects:
        return verdict, stages
    if changed := [name for name in change.stages if name not in known]:
        found = [replace(one, guilty=one.guilty or one.name == changed[0]) for one in stages]
        return "unexplained", tuple(found)
    if known or verdict not in ("no_gap", "ambiguous"):
        return verdict, stages
    hidden = {stage.name for stage in stages if stage.hidden is not None}
    open_ones = (hidden | assumed) & change.blind | (hidden - change.shown.keys())
    return "ambiguous" if open_ones else "no_gap", stages
