"""A diagnosis: where the gap lies, which effects cause it, how far it shrinks.

    prepare    the drive, the trim, and the outputs that can be judged (`prepare`)
    search     the sets of effects with the largest evidence (`beam`)
    findings   the verdict, each effect's probability and interval, and the alternatives

The verdict is `no_gap` if every stage is within its noise floor, `effect` if the residual with the
effects found is noise, `mostly` if the effects are certain and explain most of the gap, `ambiguous`
if the data do not discriminate them from others, and `unexplained` if no credible effects explain
half of the gap.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from coupled.gap.findings.answer import effects_of, incredible, settings_of, verdict_of
from coupled.gap.findings.budget import stage_budget
from coupled.gap.findings.curves import find_curves
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

    `tell` is called with the present task, and the numbers of tasks done and in all. With records
    of the `healthy` machine, the change since then is judged. `workers` is the number of threads, 0
    for one per core; the result does not depend on it. Raises InputError if a record cannot be of
    this rig, or if no stage can be judged.
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
    """Return the diagnosis from a search; `case` has the final noise floors."""
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
    curves = None
    if verdict in ("mostly", "unexplained"):
        curves = find_curves(case, choice, effects, [reader.record for reader in readers])
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
        curved=curves,
    )
