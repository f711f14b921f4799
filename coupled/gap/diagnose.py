"""A diagnosis: where the gap lies, which effects cause it, how far it shrinks.

The verdict is `no_gap` where every stage stays within its floor, `effect` where what the effects
found leave is noise, `mostly` where they are certain and hold most of the gap, `ambiguous` where
the record does not distinguish them from others, and `unexplained` where nothing that is credible
holds half of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from coupled.errors import InputError
from coupled.gap.checks import check_record, check_trim
from coupled.gap.effects.effect import Effect
from coupled.gap.effects.library import library_of
from coupled.gap.effects.scales import Scales, in_scale
from coupled.gap.findings.answer import effects_of, incredible, settings_of, verdict_of
from coupled.gap.findings.budget import stage_budget
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.healthy import Baseline, beside_healthy
from coupled.gap.findings.judge import Judge
from coupled.gap.findings.shrink import floors_of, shrink
from coupled.gap.refuted import search_unrefuted
from coupled.gap.search.case import Case, Tell
from coupled.gap.search.choose import Choice
from coupled.gap.search.contact import allowing_for_contact
from coupled.gap.search.descent import Descent
from coupled.gap.signals.counts import as_counted
from coupled.gap.signals.drives import as_driven
from coupled.gap.signals.live import judged_part, live_of
from coupled.gap.signals.output import Output
from coupled.gap.signals.reading import worth_recording
from coupled.gap.stages.airframe import Flights, airframe_outputs
from coupled.gap.stages.joined import as_judged
from coupled.gap.stages.setpoints import under_set_points
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.thresholds import RIGS_KEPT
from coupled.gap.trimmed import trim_speed, trimmed
from coupled.parallel import in_threads, threads
from coupled.record.channels import ControlName
from coupled.record.record import Record
from coupled.rig.rig import Rig

__all__ = ["Diagnosis", "diagnose"]

Search = Callable[[Case, Sequence[Effect]], tuple[Case, Choice]]


def diagnose(
    rig: Rig,
    records: Mapping[str, Record],
    control: ControlName = "column",
    tell: Tell | None = None,
    healthy: Mapping[str, Record] | None = None,
    workers: int = 0,
    search: Search = search_unrefuted,
) -> Diagnosis:
    """Return the diagnosis of records of one rig, by their files' names.

    `tell` is called with what is being done, and how much of how much is done. With records of the
    machine when it was well (`healthy`), the difference from those is judged (`healthy`). So many
    threads work as `workers`, 0 being one a core; the answer is that of one. `search` finds the
    effects: `beam.beam.search_sets` is the one that is being built. Raises InputError where a
    record cannot be of this rig, or lets no stage be judged.
    """
    with threads(workers):
        return _diagnose(rig, records, control, tell, healthy or {}, search)


def _diagnose(
    rig: Rig,
    records: Mapping[str, Record],
    control: ControlName,
    tell: Tell | None,
    healthy: Mapping[str, Record],
    search: Search,
) -> Diagnosis:
    baseline = _reference(rig, healthy, control, tell, search) if healthy else None
    rig = rig if baseline is None else baseline.rig
    live = [one for one in map(live_of, records.values()) if one is not None]
    records = {file: judged_part(record, file) for file, record in records.items()}
    rig = as_driven(rig, list(records.values()), control) if control in rig.controls else rig
    rig, trim = trimmed(rig, records)
    for file, record in records.items():
        check_record(rig, record, control, file)
        if rig.flight is not None:
            check_trim(trim_speed(rig), record, file)
    rig = as_counted(rig, list(records.values()), control)
    readers = [
        Reader(rig, record, control, surface_points, i) for i, record in enumerate(records.values())
    ]
    raised = list if baseline is None else baseline.raised
    judged = _outputs(readers, flights := [Flights() for _ in readers])
    halved = (output.halved(rig) for output in raised(judged))
    outputs = [allowing_for_contact(output, rig, control) for output in halved]
    if not outputs:
        lacking = sorted(
            {
                name
                for reader in readers
                for stage, names in reader.missing().items()
                for name in worth_recording(rig, control, stage, names)
            }
        )
        file = next(iter(records))
        problem = f"holds too little to judge any stage by; it lacks {', '.join(lacking)}"
        raise InputError(file, "", problem)
    every = library_of(rig, control)
    library = [effect for effect in every if effect.can_be_tried(list(records.values()), control)]
    library = in_scale(as_judged(library, readers, outputs), Scales.of(readers), rig, control)
    if readers[0].set_points:
        library = under_set_points(library, list(records.values()), control)

    known: list[tuple[Rig, Sequence[Output]]] = []  # the last asked for: each takes as long again

    def refloored(other: Rig) -> Sequence[Output]:
        held = next((outputs for rig_, outputs in known if rig_ == other), None)
        if held is None:
            flown = [one for one in judged if one.stage == "airframe"]
            anew = [replace(reader, rig=other) for reader in readers]
            held = raised(_outputs(anew, flights, flown if _fly_alike(rig, other) else None))
            known[:] = [*known[1 - RIGS_KEPT :], (other, held)]
        return held

    case = Case(rig, control, outputs, tell, refloored, only_wide=baseline is not None)
    case, choice = search(case, library)
    outputs = list(case.outputs)
    judge = Judge(readers, outputs, choice, case.gaps(choice.fit.rig))
    stages = judge.stages()
    effects = effects_of(case, choice, readers, stages)
    if unsure := incredible(choice, effects):
        stages = replace(judge, doubted=unsure).stages()
    last = choice.halves or choice.fit
    fitted = case.fit(last.effects, "fitted", last.values, descent=Descent("own"), near=last)
    floors = floors_of(case, choice)
    budgets = [
        stage_budget(stage.name, case, choice.settled, choice.fit, floors)
        for stage in stages
        if stage.guilty
    ]
    budget = tuple(one for one in budgets if one is not None)
    verdict = verdict_of(choice, stages, effects, budget)
    change = None if baseline is None else baseline.compared(list(records.values()), judged)
    verdict, stages = beside_healthy(verdict, stages, baseline, change)
    return Diagnosis(
        control=control,
        verdict=verdict,
        stages=stages,
        effects=effects,
        budget=budget,
        rivals=tuple(
            (s.effect.name, *(r.effect.name for r in s.rivals)) for s in choice.steps if s.rivals
        ),
        settings=settings_of(choice, rig, control, outputs),
        shrink=shrink(case, fitted, floors),
        nominal=rig,
        improved=choice.fit.rig,
        records=dict(records),
        outputs=tuple(outputs),
        choice=choice,
        baseline=baseline,
        change=change,
        trim=trim,
        filtered={name: one for reader in readers for name, one in reader.filtered().items()},
        left_out=tuple(dict.fromkeys(words for one in live for words in one.left_out)),
    )


def _reference(
    rig: Rig, healthy: Mapping[str, Record], control: ControlName, tell: Tell | None, search: Search
) -> Baseline:
    """Return the machine of its healthy records, as what others are held against."""
    well = _diagnose(rig, healthy, control, tell, {}, search)
    case = Case(well.nominal, control, well.outputs)
    return Baseline.of(well.records, case, well.choice.fit)


def _outputs(
    readers: Sequence[Reader], flights: Sequence[Flights], flown: Sequence[Output] | None = None
) -> list[Output]:
    """Return the outputs that records let judge; `flown` are the airframe's, where known."""
    makers: list[Callable[[], list[Output]]] = [reader.outputs for reader in readers]
    if flown is None:
        pairs = zip(readers, flights, strict=True)
        makers += [partial(airframe_outputs, r.rig, r.record, r.number, one) for r, one in pairs]
    made = in_threads(lambda make: make(), makers)
    return [output for each in [*made, flown or []] for output in each]


def _fly_alike(one: Rig, other: Rig) -> bool:
    """Tell whether two rigs' surfaces and aircraft are the same."""
    rigged = all(
        one.controls[name].rigging == other.controls[name].rigging for name in one.controls
    )
    return rigged and one.flight == other.flight
