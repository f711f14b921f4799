"""A diagnosis: where the gap lies, which effects cause it, how far it shrinks.

    prepare    the drive, the trim, and the outputs that can be judged (`prepare`)
    search     the sets of effects with the largest evidence (`beam`)
    findings   the verdict, each effect's probability and interval, and the alternatives

The verdict is `no_gap` if every stage is within its noise floor, `effect` if the residual with the
effects found is noise, `mostly` if the effects are certain and explain most of the gap, `ambiguous`
if the data do not discriminate them from others, and `unexplained` if no credible effects explain
half of the gap.

A part is a control that the records move, or the airframe. If the records move one control, its
part judges the airframe. If they move several, the airframe is a separate part: its motion is
predicted once, from all measured surfaces. It is the only part of a rig without controls.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from coupled.errors import InputError
from coupled.gap.chain import AIRFRAME, STAGES, Part
from coupled.gap.checks import unmeasured_trim
from coupled.gap.effects.library import MOTION
from coupled.gap.findings.answer import effects_of, incredible, settings_of, verdict_of
from coupled.gap.findings.beside import beside_closed_form
from coupled.gap.findings.budget import StageBudget, floors_of, shrink, stage_budget
from coupled.gap.findings.curves import Curves, find_curves
from coupled.gap.findings.diagnosis import Diagnosis, PartDiagnosis, WholeDiagnosis
from coupled.gap.findings.gear import by_other_gear
from coupled.gap.findings.healthy import Baseline, beside_healthy
from coupled.gap.findings.hints import late_channels, still_surfaces, unknown_conditions
from coupled.gap.findings.judge import Judge
from coupled.gap.findings.onefunction import by_one_function, needs_a_function
from coupled.gap.findings.othercauses import (
    OtherCause,
    held_still,
    in_other_unit,
    steady_sideslip,
)
from coupled.gap.findings.result import EffectResult, StageResult, Verdict
from coupled.gap.findings.where import lone_channel
from coupled.gap.prepare import Prepared, prepare
from coupled.gap.search.case import Case, Tell
from coupled.gap.search.descent import Descent
from coupled.gap.search.found import Choice, Fit, inseparable
from coupled.gap.search.histories import search
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Floats, exceeds_noise
from coupled.gap.signals.reading import Reading
from coupled.gap.stages.airframe import needs
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.stages.tried import TERMS_OPTION, functions_tried, tried_effects, untried_terms
from coupled.gap.thresholds import TINY
from coupled.parallel import in_threads, threads
from coupled.record.channels import CONTROL_NAMES, ControlName, channel
from coupled.record.record import Record
from coupled.rig.parameters import Flight
from coupled.rig.rig import Rig

__all__ = ["Diagnosis", "diagnose"]
T = TypeVar("T")
Records = Mapping[str, Record]


def diagnose(
    rig: Rig,
    records: Records,
    control: ControlName | None = None,
    tell: Tell | None = None,
    healthy: Records | None = None,
    workers: int = 0,
    terms: bool = False,
) -> Diagnosis:
    """Return the diagnosis of records of one rig, by their files' names.

    It judges one control, or all that the records move, and the airframe. `tell` is called with the
    present task, and the numbers of tasks done and in all. With records of the `healthy` machine,
    the change since then is judged. `workers` is the number of threads, 0 for one per core; the
    result does not depend on it. With `terms`, the named functions of the model's aerodynamics are
    tried. Raises InputError if a record cannot be of this rig, or if no stage can be judged.
    """
    if terms and rig.flight is None:
        raise InputError(rig.place, TERMS_OPTION, "the rig has no aircraft; leave it out")
    with threads(workers):
        parts, words = parts_of(rig, records, control)
        well = _of_parts(rig, healthy, list(parts)) if healthy else {}
        used = {name for ours in well.values() for name in ours}
        for unused in (healthy or {}).keys() - used:
            names = ", ".join(part.name for part in parts)
            problem = f"moves none of what is judged ({names}): is it of another machine?"
            raise InputError(unused, "--healthy", problem)
        alone = [part.name for part in parts if healthy and part not in well]
        words += tuple(f"No healthy record moves the {n}; noise is the limit." for n in alone)

        def reference(part: Part, flight: Flight | None) -> Baseline:
            made = prepare(rig, well[part], part, _told(tell, part, parts), None, flight, terms)
            case, found = search(made.case, made.library)
            return Baseline.of(made.records, case, found.fit)

        baselines = _airframe_first(list(well), reference, lambda known: known.rig)

        def diagnosed(part: Part, flight: Flight | None) -> PartDiagnosis:
            told = _told(tell, part, parts)
            made = prepare(rig, parts[part], part, told, baselines.get(part), flight, terms)
            return findings(made, *search(made.case, made.library))

        found = _airframe_first(list(parts), diagnosed, lambda known: known.improved)
        made = (found[part] for part in parts)
        each = [replace(one, left_out=(*one.left_out, *words)) for one in made]
    if len(each) == 1:
        return each[0]
    judged = {file: one for part in each for file, one in part.records.items()}
    return WholeDiagnosis.of(each, {file: judged[file] for file in records if file in judged})


def parts_of(
    rig: Rig, records: Records, control: ControlName | None
) -> tuple[dict[Part, Records], tuple[str, ...]]:
    """Return the records of each part, by their files' names, and what is not judged, in words.

    The parts are of one control, or of all that the rig has and the records move.
    """
    if not rig.controls:
        if control is not None:
            problem = f"the rig is an aircraft alone, without a {control}; leave it out"
            raise InputError(rig.place, "--control", problem)
        return {Part("column", own=False): records}, ()
    if control is not None:
        return {Part(control): records}, ()
    moved = {
        name: {file: one for file, one in records.items() if moves(rig, one, name)}
        for name in rig.controls
    }
    judged = {name: ours for name, ours in moved.items() if _judges(rig, ours, name)}
    words = {
        name: _why_not(name, bool(ours))
        for name, ours in moved.items()
        if name not in judged and any(_pulled(one, name) for one in records.values())
    }
    if len(judged) < 2:
        known = [name for name in rig.controls if any(_way(one, name) for one in records.values())]
        first = next(iter([*judged, *words, *known, *rig.controls, *CONTROL_NAMES]))
        words.pop(first, None)
        return {Part(first): records}, tuple(words.values())
    first = next(iter(judged))
    parts: dict[Part, Records] = {
        Part(name, airframe=False): ours for name, ours in judged.items() if name != first
    }
    flown = rig.flight is not None
    if flown and any(all(n in one for n in needs(rig, one)) for one in records.values()):
        parts[Part(first, own=False)] = records
        flown = False
    # An airframe that cannot be judged is listed with the first control, and what it lacks.
    return {Part(first, airframe=flown): judged[first], **parts}, tuple(words.values())


def moves(rig: Rig, record: Record, control: ControlName) -> bool:
    """Tell whether a record has a control of a rig, and moves it by more than noise."""
    least = TINY * rig.controls[control].travel
    return any(exceeds_noise(signal, least) for signal in _way(record, control))


def _way(record: Record, control: ControlName) -> list[Floats]:
    names = (channel(control, quantity) for quantity in ("computed", "deflection", "estimate"))
    return [record[name] for name in names if name in record]


def _judges(rig: Rig, records: Records, control: ControlName) -> bool:
    """Tell whether some of the records have the channels of a stage of a control."""
    readings = (Reading(rig, one, control, surface_points) for one in records.values())
    return any({*STAGES} - {AIRFRAME, "sensing"} - one.missing().keys() for one in readings)


def _why_not(control: ControlName, moved: bool) -> str:
    """Return why a control on which a force acts is not judged."""
    be, they = ("are", "them") if control == "pedals" else ("is", "it")
    why = "the records lack its channels" if moved else f"no record moves {they}"
    return f"The {control} {be} not judged: {why}."


def _pulled(record: Record, control: ControlName) -> bool:
    """Tell whether a force acts on a control whose motion is recorded."""
    name = channel(control, "force")
    return name in record and bool(_way(record, control)) and exceeds_noise(record[name])


def _airframe_first(
    parts: Sequence[Part], work: Callable[[Part, Flight | None], T], rig_of: Callable[[T], Rig]
) -> dict[Part, T]:
    """Return the results of parts: of the airframe, and then of the controls side by side.

    The trim positions of their surfaces depend on what was found in the aircraft.
    """
    found = {part: work(part, None) for part in parts if not part.own}
    flight = next((rig_of(known).flight for known in found.values()), None)
    rest = [part for part in parts if part.own]
    return found | dict(zip(rest, in_threads(lambda part: work(part, flight), rest), strict=True))


def _of_parts(rig: Rig, records: Records, parts: Sequence[Part]) -> dict[Part, Records]:
    """Return the healthy records of each part; a control that none of them moves has none."""
    if len(parts) == 1:
        return {parts[0]: records}
    found = {
        part: {f: r for f, r in records.items() if not part.own or moves(rig, r, part.control)}
        for part in parts
    }
    return {part: ours for part, ours in found.items() if ours}


def _told(tell: Tell | None, part: Part, parts: Collection[Part]) -> Tell | None:
    """Return the progress of one of several parts, whose tasks name the part."""
    if tell is None or len(parts) == 1:
        return tell
    return lambda what, done, total: tell(f"{part.name}: {what}", done, total)


def findings(prepared: Prepared, case: Case, choice: Choice) -> PartDiagnosis:
    """Return the diagnosis from a search; `case` has the final noise floors."""
    part, readers, baseline = prepared.part, prepared.readers, prepared.baseline
    outputs = list(case.outputs)
    answer = _answer(prepared, case, choice)
    choice, stages, fit = answer.choice, answer.judged.stages, answer.choice.fit
    effects, verdict, doubts = _beside_other_causes(prepared, case, answer)
    hints = _hints(prepared, case, stages) if verdict == "unexplained" else []
    change = None
    if baseline is not None:
        change = baseline.compared(prepared.records, prepared.case, part.own)
        others = baseline.compared(prepared.records, prepared.case, part.own, fit)
        verdict, stages = beside_healthy(verdict, stages, fit.effects, baseline.assumed, others)
    filtered = (one.filtered().items() for one in readers) if part.own else ()
    return PartDiagnosis(
        part=part,
        control=part.name,
        verdict=verdict,
        stages=stages,
        effects=effects,
        budget=answer.judged.budget,
        rivals=tuple(
            tuple(dict.fromkeys((s.effect.name, *(r.effect.name for r in s.rivals))))
            for s in choice.steps
            if s.rivals
        ),
        settings=settings_of(choice, case.nominal, case.control, outputs),
        shrink=shrink(case, answer.fitted, floors_of(case, choice)),
        nominal=case.nominal,
        improved=_as_stamped(fit.rig, case.nominal, effects),
        records=dict(prepared.records),
        readers=readers,
        outputs=tuple(outputs),
        choice=choice,
        baseline=baseline,
        change=change,
        trim=prepared.trim,
        filtered={name: one for each in filtered for name, one in each},
        left_out=tuple(words for words in (*prepared.left_out, *doubts, *hints) if words),
        inseparable=inseparable(fit, case.control),
        curved=answer.curves,
    )


def _hints(prepared: Prepared, case: Case, stages: Sequence[StageResult]) -> list[str]:
    """Return what to check in a record that no effect explains, a sentence each."""
    of_channels = [lone_channel(case.outputs, case.nominal)]
    of_channels.append(late_channels(case.outputs, case.nominal))
    if not _is_faulty(AIRFRAME, stages):
        return of_channels
    records = prepared.own_records
    of_channels.append(still_surfaces(records))
    untried = "" if any(of_channels) else untried_terms(prepared.library, case.nominal)
    return [*of_channels, unknown_conditions(records), untried]


def _is_faulty(stage: str, stages: Sequence[StageResult]) -> bool:
    return any(one.name == stage and one.guilty for one in stages)


@dataclass(frozen=True)
class _Judged:
    """The stages, effects and their shares in the gaps, and the verdict on them."""

    judge: Judge
    stages: tuple[StageResult, ...]
    effects: tuple[EffectResult, ...]
    budget: tuple[StageBudget, ...]
    verdict: Verdict


def _judged(
    prepared: Prepared, case: Case, choice: Choice, effects: tuple[EffectResult, ...] | None = None
) -> _Judged:
    """Return the verdict on a choice, with given results of its effects if these are known."""
    part, readers = prepared.part, prepared.readers
    judge = Judge(readers, list(case.outputs), choice, case.gaps(choice.fit.rig))
    stages = _of_part(part, judge.stages())
    effects = effects_of(case, choice, readers, stages) if effects is None else effects
    if unsure := incredible(choice, effects):
        stages = _of_part(part, replace(judge, doubted=unsure).stages())
    floors, root = floors_of(case, choice), choice.without_effects
    faulty = [stage.name for stage in stages if stage.guilty]
    budgets = [stage_budget(name, case, root, choice.fit, floors) for name in faulty]
    budget = tuple(one for one in budgets if one is not None)
    return _Judged(judge, stages, effects, budget, verdict_of(choice, stages, effects, budget))


@dataclass(frozen=True)
class _Answer:
    """The last choice, the verdict on it, the curves, and the fit to every other stretch."""

    choice: Choice
    judged: _Judged
    curves: Curves | None
    fitted: Fit


def _answer(prepared: Prepared, case: Case, choice: Choice) -> _Answer:
    """Return the answer from a choice, with a function of the model or curves if they do better."""
    choice, judged = _with_function(prepared, case, choice)
    curves, fit = None, choice.fit
    if prepared.part.own and judged.verdict != "no_gap":
        curves = find_curves(case, choice, judged.effects, prepared.own_records)
    beside = None
    if curves is not None:
        beside = beside_closed_form(judged.judge, case, judged.effects, curves)
    if beside is not None:
        judged = _judged(prepared, case, beside.choice, beside.effects)
        return _Answer(beside.choice, judged, beside.curves, beside.fitted)
    if curves is not None:
        judged = _judged(prepared, case, choice, tuple(map(curves.probable, judged.effects)))
    fitted = Problem(case).fit(fit.effects, fit.values, descent=Descent("own"), part="fitted")
    return _Answer(choice, judged, curves, fitted)


def _beside_other_causes(
    prepared: Prepared, case: Case, answer: _Answer
) -> tuple[tuple[EffectResult, ...], Verdict, list[str]]:
    """Return effects and verdict beside other causes, and a sentence on each cause."""
    effects, verdict = answer.judged.effects, answer.judged.verdict
    causes = list(_other_causes(prepared, case, answer))
    words = [one.words for one in causes]
    if _is_faulty(AIRFRAME, answer.judged.stages):
        words.append(unmeasured_trim(case.nominal, prepared.records))
    shares = {name: one.probability for one in causes for name in one.effects}
    if not any(one.name in shares for one in effects):
        return effects, verdict, words
    less = (replace(e, probability=shares.get(e.name, 1.0) * e.probability) for e in effects)
    return tuple(less), "ambiguous" if verdict in ("effect", "mostly") else verdict, words


def _other_causes(prepared: Prepared, case: Case, answer: _Answer) -> Iterator[OtherCause]:
    """Yield the causes that are no effects: recorder, air, units, gear, held loader, sideslip."""
    effects, records = answer.judged.effects, prepared.own_records
    yield OtherCause(frozenset(one.name for one in effects if prepared.is_otherwise(one)))
    yield from in_other_unit(case.nominal, effects)
    if answer.judged.verdict != "no_gap":
        gear = by_other_gear(case, answer.choice, records)
        yield from [] if gear is None else [gear]
    held = held_still(case.nominal, case.control, records)
    if held and _is_faulty("loader", answer.judged.stages):
        yield OtherCause(frozenset(e.name for e in effects if e.stage == "loader"), held)
    if slip := steady_sideslip(prepared.records, effects):
        yield OtherCause(frozenset(["sideslip_zero"]), slip)


def _with_function(prepared: Prepared, case: Case, choice: Choice) -> tuple[Choice, _Judged]:
    """Return a choice, or the choice of one function of the model if it is likelier."""
    judged = _judged(prepared, case, choice)
    tried = any(effect.of for effect in prepared.library)
    if tried or not needs_a_function(case, choice, judged.effects):
        return choice, judged
    functions = functions_tried(case.nominal, prepared.own_records)
    shown = tried_effects(functions, prepared.readers, case.outputs)
    other = by_one_function(case, choice, shown)
    return (choice, judged) if other is None else (other, _judged(prepared, case, other))


def _as_stamped(rig: Rig, filed: Rig, effects: Sequence[EffectResult]) -> Rig:
    """Return a rig with the filed stamps of the motion, if only the rows of a log shift them."""
    if filed.controls or any(one.name == MOTION for one in effects):
        return rig
    assert filed.flight is not None
    return rig.changed({"flight.motion_stamp_s": filed.flight.motion_stamp})


def _of_part(part: Part, stages: Sequence[StageResult]) -> tuple[StageResult, ...]:
    """Return the stages that a part judges; of the airframe alone, faulty sensors of the motion."""
    return tuple(one for one in stages if part.judges(one.name) or (one.guilty and not part.own))
