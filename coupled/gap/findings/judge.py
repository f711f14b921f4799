"""Which stages are faulty, by the residuals of their outputs and by the effects found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.chain import STAGES, stage_of
from coupled.gap.findings.result import StageResult
from coupled.gap.findings.where import remains, where
from coupled.gap.search.found import Choice
from coupled.gap.signals.output import HiddenGap, Output, explained_below, stage_gaps, stage_limits
from coupled.gap.stages.airframe import needs
from coupled.gap.stages.stages import Reader
from coupled.gap.thresholds import MOST
from coupled.rig.rig import Rig

BY_LAWS = "control laws of the aircraft also move it; judged with the airframe"


def _by_stage(gaps: Mapping[str, float]) -> dict[str, float]:
    """Return the largest gap of each stage's outputs."""
    joined: dict[str, float] = {}
    for output, gap in gaps.items():
        name = stage_of(output)
        joined[name] = max(joined.get(name, 0.0), gap)
    return joined


@dataclass(frozen=True)
class Judge:
    """Judges the stages by their outputs. `last` are the outputs' gaps with the effects found.

    A stage without an output of its own is not faulty by an effect in `doubted`, which may imitate
    a fault of the stage in which it shows.
    """

    readers: Sequence[Reader]
    outputs: Sequence[Output]
    choice: Choice
    last: Mapping[str, float]
    doubted: frozenset[str] = frozenset()

    @property
    def rig(self) -> Rig:
        """The nominal rig."""
        return self.readers[0].rig

    @cached_property
    def blamed(self) -> set[str]:
        """The stages of the effects found.

        The stage of an effect that shows only in others is included if the effect closes half of a
        gap there; if the effect is in `doubted`, the stage with the largest gap instead.
        """
        root = stage_gaps(self.outputs, self.choice.without_effects.rig)
        found: set[str] = set()
        for effect in (step.effect for step in self.choice.steps):
            seen = [out for out in effect.shows_in if out in root]
            if effect.stage in effect.shows_in:
                found.add(effect.stage)
            elif any(self.last[o] - 1.0 < (1.0 - MOST) * (root[o] - 1.0) for o in seen):
                widest = stage_of(max(seen, key=lambda out: root[out]))
                found.add(widest if effect.name in self.doubted else effect.stage)
        return found

    def stages(self) -> tuple[StageResult, ...]:
        """Return the stages of the rig, in the order of the chain.

        Those of a rig without controls are the airframe, and those of the effects found.
        """
        before = _by_stage(stage_gaps(self.outputs, self.rig))
        root = _by_stage(stage_gaps(self.outputs, self.choice.without_effects.rig))
        left, limits = _by_stage(self.last), _by_stage(stage_limits(self.outputs))
        lacking = self._lacking()
        found = []
        for name in STAGES:
            if not self.rig.controls and name != "airframe" and name not in self.blamed:
                continue
            result: StageResult | None
            if name in before and name not in lacking:
                unexplained = left[name] > explained_below(root[name], limits[name])
                faulty = name in self.blamed or unexplained
                hidden = None if faulty else self._hidden(name)
                if hidden is not None:
                    result = StageResult(name, why=hidden.words, hidden=hidden)
                else:
                    numbers = (before[name], root[name], limits[name], left[name])
                    result = self._with_where(StageResult(name, *numbers, guilty=faulty))
            elif name == "sensing":
                result = self._with_where(self._sensing(before))
            elif name in lacking:
                result = StageResult(name, missing=lacking[name])
            else:
                result = self._without_output(name)
            found += [result] if result is not None else []
        return tuple(found)

    def _hidden(self, stage: str) -> HiddenGap | None:
        """Return what hides a gap of the stage; None if one of its floors is low enough."""
        outputs = [output for output in self.outputs if output.stage == stage]
        known = [output.hidden_gap for output in outputs if output.hidden_gap is not None]
        least = min(known, key=lambda one: one.share, default=None)
        if least is not None and least.much:
            return least
        doubtful = (output.coloured(self.choice.without_effects.rig) for output in outputs)
        return next((one for one in doubtful if one is not None), None)

    def _lacking(self) -> dict[str, tuple[str, ...]]:
        """Return the channels that each stage lacks in every record."""
        each = [reader.missing() for reader in self.readers]
        shared = {s: tuple(n) for s, n in each[0].items() if all(s in m for m in each)}
        shared.pop("multiplier", None)
        if self.readers[0].set_points:
            shared.pop("loader", None)
        if self.rig.flight is None:
            shared.pop("surface", None)
        return shared

    def _sensing(self, before: Mapping[str, float]) -> StageResult:
        """Return sensing: faulty if its effect was found, else not judged.

        A wrong sensor scale has no residual of its own: its gap is the largest of the stages in
        which it shows. An effect of the sensors of the motion shows elsewhere.
        """
        shown = dict.fromkeys(stage_of(o) for o in STAGE_OF["sensing"].effects_show_in)
        neighbours = tuple(name for name in shown if name in before)
        if "sensing" in self.blamed:
            found = [s.effect for s in self.choice.steps if s.effect.stage == "sensing"]
            others = {stage_of(output) for effect in found for output in effect.shows_in}
            neighbours = neighbours or tuple(name for name in before if name in others)
            widest = max(before[name] for name in neighbours)
            return StageResult("sensing", widest, guilty=True, shown_in=neighbours)
        why = f"see {', '.join(neighbours or shown)}"
        return StageResult("sensing", why=why, shown_in=tuple(shown))

    def _without_output(self, name: str) -> StageResult | None:
        """Return a stage that no output judges; None if the rig does not have it."""
        flown = self.rig.flight is not None
        reader = self.readers[0]
        with_loader = reader.moved or reader.in_series
        if name == "linkage" and with_loader and name in self.blamed:
            gap = max(o.gap(self.rig) for o in self.outputs if o.stage == "loader")
            return StageResult(name, gap, guilty=True, shown_in=("loader",))
        known = {"schedule": "constant gradient"}
        known |= {"linkage": "see loader"} if with_loader else {}
        known |= {"loader": "δc is a set point"} if reader.set_points else {}
        known |= {"surface": BY_LAWS} if flown else {}
        if name in known:
            shown = ("loader",) if name == "linkage" and with_loader else ()
            return StageResult(name, why=known[name], shown_in=shown)
        if name == "airframe" and flown:
            record = self.readers[0].record
            lacking = [n for n in needs(self.rig, record) if n not in record]
            return StageResult(name, missing=tuple(lacking))
        return None

    def _with_where(self, found: StageResult) -> StageResult:
        """Return a faulty stage with the location of its gap, from the output with the largest."""
        stage = STAGE_OF[found.name]
        shown = stage.outputs or stage.effects_show_in
        ours = [output for output in self.outputs if output.stage in shown]
        if not found.guilty or not ours:
            return found
        # With fitted nuisance parameters, unless these hide the gap at their bounds.
        hidden = found.settled is not None and found.settled <= (found.limit or 0.0)
        rig = self.rig if hidden else self.choice.without_effects.rig
        widest = max(ours, key=lambda o: o.gap(rig))
        reader = self.readers[widest.record]
        found = replace(found, where=where(widest, rig, reader.record, reader.control))
        if not found.unexplained:
            return found
        improved = self.choice.fit.rig
        most = max(ours, key=lambda o: o.gap(improved))
        record = self.readers[most.record].record
        return replace(found, remains=remains(most, improved, record, reader.control))
