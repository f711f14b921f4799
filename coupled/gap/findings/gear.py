"""Whether the landing gear, which a record does not show, may be the cause of what was found.

JSBSim's own runs begin with the gear down, and rig files have it up. Its drag changes the thrust of
the trim, and so the moment and the elevator: a mass, a drag or an offset may act alike. So the
aircraft with the other position of the gear is fitted without effects, and without each of several
effects, and compared with the best set by the log evidence.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import replace

from coupled.errors import joined
from coupled.gap.chain import AIRFRAME
from coupled.gap.effects.effect import Effect
from coupled.gap.findings.othercauses import OtherCause
from coupled.gap.search.case import Case
from coupled.gap.search.evidence import Evidence, evidence, fewest_unexplained
from coupled.gap.search.found import Choice
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import explained_below, stage_gaps, stage_limits
from coupled.gap.stages.surfaces import states_trim
from coupled.gap.thresholds import FAR, PRIOR_EFFECT, RIVAL_GAIN
from coupled.record.record import Record
from coupled.rig.parameters import Flight
from coupled.rig.rig import Rig

GEAR = "gear/gear-cmd-norm"


def by_other_gear(case: Case, choice: Choice, records: Collection[Record]) -> OtherCause | None:
    """Return the other position of the gear if it explains the airframe nearly as well, or better.

    None if a record's manifest states the trim, or if the model has no gear that moves.
    """
    rig = None if any(map(states_trim, records)) else _with_other_gear(case.nominal)
    root, limits = choice.without_effects.rig, stage_limits(case.outputs)
    before, limit = stage_gaps(case.outputs, root).get(AIRFRAME, 0.0), limits.get(AIRFRAME, FAR)
    if rig is None or case.timings or before <= limit or not _moves_gear(case, rig):
        return None
    other = replace(case, nominal=rig)
    error = Problem(case).model_error(root)
    best = evidence(Problem(case), choice.fit, error)
    for removed, kept in _replaced(choice.fit.effects):
        fit = Problem(other).fit(kept, choice.fit.values)
        # Its noise is not estimated: with the other gear the aircraft may not trim, and is far off.
        if stage_gaps(case.outputs, fit.rig)[AIRFRAME] > explained_below(before, limit):
            continue
        found = evidence(Problem(other), fit, error)
        ahead = _ahead(replace(found, rest=found.rest - PRIOR_EFFECT), best)
        if ahead > -RIVAL_GAIN:
            probability = 1.0 / (1.0 + math.exp(min(ahead, 100.0)))
            return OtherCause(removed, _words(rig, removed, ahead > RIVAL_GAIN), probability)
    return None


def _ahead(one: Evidence, other: Evidence) -> float:
    samples = fewest_unexplained([one, other])
    return one.log(samples) - other.log(samples)


def _with_other_gear(rig: Rig) -> Rig | None:
    """Return the rig with its gear down in place of up, or up; None for a bench."""
    if rig.flight is None:
        return None
    return rig.changed({"flight.properties": {GEAR: 0.0 if _is_down(rig.flight) else 1.0}})


def _is_down(flight: Flight) -> bool:
    return flight.properties.get(GEAR, 1.0) > 0.0  # JSBSim starts with the gear down


def _moves_gear(case: Case, other: Rig) -> bool:
    """Tell whether the gear changes the motion, with an aircraft that trims."""
    filed, gap = (stage_gaps(case.outputs, rig).get(AIRFRAME, FAR) for rig in (case.nominal, other))
    return filed != gap < FAR


def _replaced(effects: Collection[Effect]) -> Iterator[tuple[frozenset[str], list[Effect]]]:
    """Yield the effects that the gear may replace, by name, and those that are kept."""
    ours = [one for one in effects if AIRFRAME in one.shows_in]
    each = [ours, *([one] for one in ours if len(ours) > 1)]
    for removed in each:
        yield frozenset(one.name for one in removed), [e for e in effects if e not in removed]


def _words(rig: Rig, removed: Collection[str], better: bool) -> str:
    assert rig.flight is not None
    down = _is_down(rig.flight)
    names = joined([one.replace("_", " ") for one in sorted(removed)])
    return (
        f"With the gear {'down' if down else 'up'}{f', and without {names},' if names else ''} the "
        f"model explains the record {'better' if better else 'as well'}: if the gear was so, set "
        f'"{GEAR}" to {float(down)} in flight.properties of the rig file.'
    )
