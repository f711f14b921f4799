"""A diagnosis: where the gap lies, which effects cause it, how far it shrinks.

The verdict is `no_gap` where every stage stays within its floor, `effect` where what the effects
found leave is noise, `mostly` where they are certain and hold most of the gap, `ambiguous` where
the record does not distinguish them from others, and `unexplained` where nothing that is credible
holds half of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from coupled.errors import InputError
from coupled.gap.airframe import airframe_outputs, needs, trim_speed
from coupled.gap.answer import effects_of, settings_of, verdict_of
from coupled.gap.budget import stage_budget
from coupled.gap.case import Case, Tell
from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.chain import CHAIN, stage_of
from coupled.gap.checks import check_record, check_trim
from coupled.gap.choose import Choice
from coupled.gap.counts import as_counted
from coupled.gap.descent import Descent
from coupled.gap.diagnosis import Diagnosis
from coupled.gap.drives import as_driven
from coupled.gap.effect import Effect
from coupled.gap.healthy import Baseline
from coupled.gap.imposed import under_motion
from coupled.gap.library import EFFECTS
from coupled.gap.output import Hides, Output, explained_below, stage_gaps, stage_limits
from coupled.gap.result import StageResult
from coupled.gap.search import search
from coupled.gap.shrink import floors_of, shrink
from coupled.gap.stages import Reader
from coupled.gap.surfaces import surface_points
from coupled.gap.thresholds import MOST
from coupled.gap.where import remains, where
from coupled.parallel import in_threads, threads
from coupled.record.channels import ControlName
from coupled.record.record import Record
from coupled.rig.rig import Rig

__all__ = ["Diagnosis", "diagnose"]

BY_LAWS = "the aircraft's laws move it, too; judged with the airframe"


def diagnose(
    rig: Rig,
    records: Mapping[str, Record],
    control: ControlName = "column",
    tell: Tell | None = None,
    healthy: Mapping[str, Record] | None = None,
    workers: int = 0,
) -> Diagnosis:
    """Return the diagnosis of records of one rig, by their files' names.

    `tell` is called with what is being done, and how much of how much is done. With records of the
    machine when it was well (`healthy`), the difference from those is judged (`healthy`). So many
    threads work as `workers`, 0 being one a core; the answer is that of one. Raises InputError
    where a record cannot be of this rig, or lets no stage be judged.
    """
    with threads(workers):
        return _diagnose(rig, records, control, tell, healthy or {})


def _diagnose(
    rig: Rig,
    records: Mapping[str, Record],
    control: ControlName,
    tell: Tell | None,
    healthy: Mapping[str, Record],
) -> Diagnosis:
    baseline = None
    if healthy:
        well = _diagnose(rig, healthy, control, tell, {})
        case = Case(rig, control, well.outputs)
        baseline = Baseline.of(tuple(healthy), case, well.choice.fit)
        rig = baseline.rig
    rig = as_driven(rig, list(records.values()), control) if control in rig.controls else rig
    for file, record in records.items():
        check_record(rig, record, control, file)
        if rig.flight is not None:
            check_trim(trim_speed(rig), record, file)
    rig = as_counted(rig, list(records.values()), control)
    readers = [
        Reader(rig, record, control, surface_points, i) for i, record in enumerate(records.values())
    ]
    raised = list if baseline is None else baseline.raised
    judged = _outputs(readers)
    outputs = [output.halved(rig) for output in raised(judged)]
    if not outputs:
        lacking = sorted({n for r in readers for names in r.missing().values() for n in names})
        file = next(iter(records))
        raise InputError(file, "", "lets no stage be judged; it lacks " + ", ".join(lacking))
    library = [effect for effect in EFFECTS if effect.can_be_tried(list(records.values()), control)]
    library = under_motion(library) if readers[0].moved else library

    known: list[tuple[Rig, Sequence[Output]]] = []  # the last one asked for: it takes as long again

    def refloored(other: Rig) -> Sequence[Output]:
        if not known or known[0][0] != other:
            flown = [one for one in judged if one.stage == "airframe"]
            anew = [replace(reader, rig=other) for reader in readers]
            made = raised(_outputs(anew, flown if _fly_alike(rig, other) else None))
            known[:] = [(other, made)]
        return known[0][1]

    case = Case(rig, control, outputs, tell, refloored, only_wide=baseline is not None)
    case, choice = search(case, library)
    outputs = list(case.outputs)
    stages = _Judge(readers, outputs, choice, case.gaps(choice.fit.rig)).stages()
    fitted = case.fit(choice.fit.effects, "fitted", choice.fit.values, descent=Descent("own"))
    floors = floors_of(case, choice)
    budgets = [
        stage_budget(stage.name, case, choice.settled, fitted, floors)
        for stage in stages
        if stage.guilty
    ]
    budget = tuple(one for one in budgets if one is not None)
    effects = effects_of(case, choice, readers, stages)
    return Diagnosis(
        control=control,
        verdict=verdict_of(choice, stages, effects, budget),
        stages=stages,
        effects=effects,
        budget=budget,
        rivals=tuple(
            (s.effect.name, *(r.effect.name for r in s.rivals)) for s in choice.steps if s.rivals
        ),
        settings=settings_of(choice, rig, control),
        shrink=shrink(case, fitted, floors),
        nominal=rig,
        improved=choice.fit.rig,
        records=dict(records),
        outputs=tuple(outputs),
        choice=choice,
        baseline=baseline,
        filtered={name: one for reader in readers for name, one in reader.filtered().items()},
    )


def _outputs(readers: Sequence[Reader], flown: Sequence[Output] | None = None) -> list[Output]:
    """Return the outputs that records let judge; `flown` are the airframe's, where known."""
    makers: list[Callable[[], list[Output]]] = [reader.outputs for reader in readers]
    if flown is None:
        makers += [partial(airframe_outputs, r.rig, r.record, r.number) for r in readers]
    made = in_threads(lambda make: make(), makers)
    return [output for each in [*made, flown or []] for output in each]


def _fly_alike(one: Rig, other: Rig) -> bool:
    """Tell whether two rigs' surfaces and aircraft are the same."""
    rigged = all(
        one.controls[name].rigging == other.controls[name].rigging for name in one.controls
    )
    return rigged and one.flight == other.flight


def _by_stage(gaps: Mapping[str, float]) -> dict[str, float]:
    """Return the gaps of outputs by the stages that they judge, the widest of each."""
    joined: dict[str, float] = {}
    for output, gap in gaps.items():
        name = stage_of(output)
        joined[name] = max(joined.get(name, 0.0), gap)
    return joined


@dataclass(frozen=True)
class _Judge:
    """Judges the stages by their outputs. `last` are the outputs' gaps with the effects found."""

    readers: Sequence[Reader]
    outputs: Sequence[Output]
    choice: Choice
    last: Mapping[str, float]

    @property
    def rig(self) -> Rig:
        """The nominal rig."""
        return self.readers[0].rig

    @property
    def blamed(self) -> set[str]:
        """The stages of the effects found.

        One that shows in its neighbours alone is blamed where half of a gap there is closed.
        """
        settled = stage_gaps(self.outputs, self.choice.settled.rig)

        def closes(effect: Effect) -> bool:
            seen = [out for out in effect.shows_in if out in settled]
            return any(self.last[o] - 1.0 < (1.0 - MOST) * (settled[o] - 1.0) for o in seen)

        effects = [step.effect for step in self.choice.steps]
        return {e.stage for e in effects if e.stage in e.shows_in or closes(e)}

    def stages(self) -> tuple[StageResult, ...]:
        """Return the stages that the records have, in the order of the chain."""
        before = _by_stage(stage_gaps(self.outputs, self.rig))
        settled = _by_stage(stage_gaps(self.outputs, self.choice.settled.rig))
        left, limits = _by_stage(self.last), _by_stage(stage_limits(self.outputs))
        lacking = self._lacking()
        found = []
        for stage in CHAIN:
            name = stage.name
            result: StageResult | None
            if name in before and name not in lacking:
                wide = left[name] > explained_below(settled[name], limits[name])
                guilty = name in self.blamed or wide
                hidden = None if guilty else self._hidden(name)
                if hidden is not None:
                    found += [StageResult(name, why=hidden.words, hidden=hidden)]
                    continue
                numbers = (before[name], settled[name], limits[name], left[name])
                result = self._with_where(StageResult(name, *numbers, guilty=guilty))
            elif name == "sensing":
                result = self._with_where(self._sensing(before))
            elif name in lacking:
                result = StageResult(name, missing=lacking[name])
            else:
                result = self._without_output(name)
            found += [result] if result is not None else []
        return tuple(found)

    def _hidden(self, stage: str) -> Hides | None:
        """Return what hides the least of a stage, where even that hides much; else None."""
        outputs = [output for output in self.outputs if output.stage == stage]
        known = [output.hides for output in outputs if output.hides is not None]
        least = min(known, key=lambda one: one.share, default=None)
        return least if least is not None and least.much else None

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
        """Return sensing: guilty where its effect was found, else not judged by itself.

        A wrong scale has no residual of its own: it shows in those of its neighbours at once,
        and the widest of them is its gap.
        """
        shown = dict.fromkeys(stage_of(o) for o in STAGE_OF["sensing"].effects_show_in)
        neighbours = tuple(name for name in shown if name in before)
        if "sensing" in self.blamed:
            widest = max(before[name] for name in neighbours)
            return StageResult("sensing", widest, guilty=True, shown_in=neighbours)
        why = f"see {', '.join(neighbours or shown)}"
        return StageResult("sensing", why=why, shown_in=tuple(shown))

    def _without_output(self, name: str) -> StageResult | None:
        """Return a stage that no output judges, None where the rig has none of it."""
        flown = self.rig.flight is not None
        if name == "linkage" and self.readers[0].moved and name in self.blamed:
            gap = max(o.gap(self.rig) for o in self.outputs if o.stage == "loader")
            return StageResult(name, gap, guilty=True, shown_in=("loader",))
        reader = self.readers[0]
        known = {"schedule": "constant gradient"}
        known |= {"linkage": "see loader"} if reader.moved else {}
        known |= {"loader": "δc is a set point"} if reader.set_points else {}
        known |= {"surface": BY_LAWS} if flown else {}
        if name in known:
            return StageResult(name, why=known[name])
        if name == "airframe" and flown:
            lacking = [n for n in needs(self.rig) if n not in self.readers[0].record]
            return StageResult(name, missing=tuple(lacking))
        return None

    def _with_where(self, found: StageResult) -> StageResult:
        """Return a stage with where in it the gap lies, by the output where it is widest."""
        stage = STAGE_OF[found.name]
        shown = stage.outputs or stage.effects_show_in
        ours = [output for output in self.outputs if output.stage in shown]
        if not found.guilty or not ours:
            return found
        # Without what its settings explain, unless at the end of their tolerance they hide it.
        hidden = found.settled is not None and found.settled <= (found.limit or 0.0)
        rig = self.rig if hidden else self.choice.settled.rig
        widest = max(ours, key=lambda o: o.gap(rig))
        reader = self.readers[widest.record]
        found = replace(found, where=where(widest, rig, reader.record, reader.control))
        if not found.unexplained:
            return found
        improved = self.choice.fit.rig
        most = max(ours, key=lambda o: o.gap(improved))
        record = self.readers[most.record].record
        return replace(found, remains=remains(most, improved, record, reader.control))
