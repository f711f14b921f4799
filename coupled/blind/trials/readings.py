"""Other readings of a trial's truth: the same law by other names, and what its record cannot tell.

A reading that is the same law whatever is recorded may be named with confidence, and so may a
plainer law that this record does not tell from the truth. Another that it does not tell from the
truth may only be named beside it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from coupled.blind.trials.measure import outputs_of
from coupled.blind.trials.truth import Reading
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.evidence import likelier_by
from coupled.gap.search.problem import Problem
from coupled.gap.thresholds import RIVAL_GAIN
from coupled.record.record import Record
from coupled.rig.rig import Rig

# One law by other names, where friction yields: friction by direction is plain friction of the
# mean with a force of half the difference, and how far any yields is in the twin's rigs.
PLAIN, YIELDS = "coulomb_friction", "presliding_friction"
SAME = {
    (PLAIN,): ((YIELDS,),),
    (YIELDS,): ((PLAIN,),),
    ("asymmetric_friction",): ((PLAIN, "force_offset"), (YIELDS, "force_offset")),
    (PLAIN, "force_offset"): (("asymmetric_friction",), (YIELDS, "force_offset")),
}
# One law in a limit that a record may not leave: a rig that does not bend, a short lag, a lift that
# is all of the angle of attack, a contact that is stiff.
NEAR = (
    ("force_zero", "force_offset"),
    ("force_skew", "transport_delay"),
    ("viscous_damping", "modifying_lag"),
    ("mass", "lift_slope"),
    ("backlash", "soft_backlash"),
)
# Laws that are the plainer one beside them where a record shows nothing of what they add: a mode
# far above what the pilot excites is a bend, and a short dead time is a slower servo. The plainer
# one is then named, and rightly.
PLAINER = (
    ("structural_mode", "bend"),
    ("stiffening_bend", "bend"),
    ("bend_hysteresis", "bend"),
    ("soft_backlash", "backlash"),
    ("stribeck_friction", PLAIN),
    ("servo_delay", "servo_lag"),
    ("servo_tuning", "servo_delay"),
)


def same_law(effects: Sequence[str]) -> Iterator[Reading]:
    """Yield the readings of effects that are the same law, whatever the record holds."""
    for names, others in SAME.items():
        if set(names) <= set(effects):
            rest = set(effects) - set(names)
            for other in others:
                yield reading(rest | set(other), sure=True)
    # The twin has one bend, one servo and one contact: an effect that sets another's numbers, too,
    # is what the record holds of both.
    for name in effects:
        own = _numbers(name)
        if own and any(own < _numbers(other) for other in effects):
            yield reading(set(effects) - {name}, sure=True)


def _numbers(name: str) -> set[str]:
    """Return the numbers of the rig that an effect of the library sets."""
    return {number.key for number in BY_NAME[name].free} if name in BY_NAME else set()


def not_distinguished(
    rig: Rig,
    record: Record,
    effects: Sequence[str],
    numbers: Mapping[str, Mapping[str, float]] | None = None,
) -> Iterator[Reading]:
    """Yield the readings of a rig's effects that this record does not tell from them.

    What is left with the other effect fitted is likelier by less than a diagnosis asks for. The
    true effect's fit begins at its true `numbers`, by effect, where they are given: one that begins
    elsewhere may end where it does something else, better by chance.
    """
    start = _start(numbers or {})
    both_ways = [(pair, False) for one in NEAR for pair in (one, one[::-1])]
    for (name, other), sure in (*both_ways, *((pair, True) for pair in PLAINER)):
        if name not in effects or other in effects:
            continue
        shown = {*BY_NAME[name].shows_in, *BY_NAME[other].shows_in}
        here = [n for n in effects if shown & {*BY_NAME[n].shows_in}]
        outputs = outputs_of(rig, record, "airframe" in shown)
        case = Case(rig, "column", [o for o in outputs if o.stage in shown])
        right = Problem(case).fit([BY_NAME[n] for n in here], start)
        wrong = Problem(case).fit([BY_NAME[other if n == name else n] for n in here])
        if likelier_by(case.outputs, right, wrong) < RIVAL_GAIN:
            yield reading({other, *effects} - {name}, sure=sure)


def _start(numbers: Mapping[str, Mapping[str, float]]) -> dict[str, float]:
    """Return the values at which a fit begins by the true numbers of effects."""
    return {
        BY_NAME[name].value_key(p): min(max(float(given[p.named("column")]), p.low), p.high)
        for name, given in numbers.items()
        if name in BY_NAME
        for p in BY_NAME[name].free
        if p.named("column") in given
    }


def reading(names: Iterable[str], *, sure: bool) -> Reading:
    """Return a reading with the stages of its effects."""
    known = sorted(names)
    return Reading(tuple(known), tuple(sorted({BY_NAME[name].stage for name in known})), sure)
