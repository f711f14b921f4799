"""A diagnosis: where the gap lies, which effects cause it, how far it shrinks.

    prepare    how the machine is driven, where it trims, what can be judged (`prepare`)
    search     the sets of effects with the largest evidence (`beam`)
    findings   the verdict, each effect's probability and interval, and what else may be the cause

The verdict is `no_gap` where every stage stays within its noise floor, `effect` where the residual
with the effects found is noise, `mostly` where they are certain and hold most of the gap,
`ambiguous` where the record does not distinguish them from others, and `unexplained` where nothing
that is credible holds half of it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from coupled.gap.findings.answer import effects_of, incredible, settings_of, verdict_of
from coupled.gap.findings.budget import stage_budget
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.healthy import Baseline, beside_healthy
from coupled.gap.findings.inseparable import inseparable
from coupled.gap.findings.judge import Judge
from coupled.gap.findings.shrink import floors_of, shrink
from coupled.gap.prepare import Prepared, prepare
from coupled.gap.search.case import Case, Tell
from coupled.gap.search.descent import Descent
from coupled.gap.search.found import Choice
from coupled.gap.search.histories import search
from coupled.gap.search.problem import Problem
from coupled.parallel import threads
from coupled.record.channels import ControlName
from coupled.record.record import Record
from coupled.rig.rig import Rig

__all__ = ["Diagnosis", "diagnose"]


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
    threads work as `workers`, 0 being one a core; the answer is that of one. Raises
    InputError where a record cannot be of this rig, or lets no stage be judged.
    """
    with threads(workers):
        baseline = None
        if healthy:
            well = prepare(rig, healthy, control, tell)
            case, found = search(well.case, well.library)
            baseline = Baseline.of(well.records, case, found.fit)
        prepared = prepare(rig, records, control, tell, baseline)
        return findings(prepared, *search(prepared.case, prepared.library))


def findings(prepared: Prepared, case: Case, choice: Choice) -> Diagnosis:
    """Return the answer that a search of prepared records gives; `case` has its last floors."""
    rig, control, readers = case.nominal, case.control, prepared.readers
    outputs = list(case.outputs)
    judge = Judge(readers, outputs, choice, case.gaps(choice.fit.rig))
    stages = judge.stages()
    effects = effects_of(case, choice, readers, stages)
    if unsure := incredible(choice, effects):
        stages = replace(judge, doubted=unsure).stages()
    own, found = Descent("own"), choice.fit
    fitted = Problem(case).fit(found.effects, found.values, descent=own, part="fitted")
    floors = floors_of(case, choice)
    budgets = [
        stage_budget(stage.name, case, choice.without_effects, choice.fit, floors)
        for stage in stages
        if stage.guilty
    ]
    budget = tuple(one for one in budgets if one is not None)
    baseline, records = prepared.baseline, list(prepared.records.values())
    change = None if baseline is None else baseline.compared(records, prepared.case.outputs)
    verdict = verdict_of(choice, stages, effects, budget)
    verdict, stages = beside_healthy(verdict, stages, baseline, change)
    return Diagnosis(
        control=control,
        verdict=verdict,
        stages=stages,
        effects=effects,
        budget=budget,
        rivals=tuple(
            tuple(dict.fromkeys((s.effect.name, *(r.effect.name for r in s.rivals))))
            for s in choice.steps
            if s.rivals
        ),
        settings=settings_of(choice, rig, control, outputs),
        shrink=shrink(case, fitted, floors),
        nominal=rig,
        improved=choice.fit.rig,
        records=dict(prepared.records),
        outputs=tuple(outputs),
        choice=choice,
        baseline=baseline,
        change=change,
        trim=prepared.trim,
        filtered={name: one for reader in readers for name, one in reader.filtered().items()},
        left_out=prepared.left_out,
        inseparable=inseparable(choice.fit),
    )
