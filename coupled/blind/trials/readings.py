"""Other readings of a trial's truth: equivalent laws, and laws that its record cannot discriminate.

A reading that is equivalent in any record may be named with certainty, and so may a simpler law
that this record does not discriminate from the truth. Any other law that the record does not
discriminate may only be named as an alternative to the truth.
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

# Equivalent laws with presliding: friction by direction is plain friction of the mean with a force
# of half the difference, and the twin's rigs have their own presliding length.
PLAIN, YIELDS = "coulomb_friction", "presliding_friction"
SAME = {
    (PLAIN,): ((YIELDS,),),
    (YIELDS,): ((PLAIN,),),
    ("asymmetric_friction",): ((PLAIN, "force_offset"), (YIELDS, "force_offset")),
    (PLAIN, "force_offset"): (("asymmetric_friction",), (YIELDS, "force_offset")),
}
# Laws equivalent in a limit that a record may not leave: a rig that does not bend, a short lag, a
# lift that is all of the angle of attack, a stiff contact.
NEAR = (
    ("force_zero", "force_offset"),
    ("force_skew", "transport_delay"),
    ("viscous_damping", "modifying_lag"),
    ("mass", "lift_slope"),
    ("backlash", "soft_backlash"),
)
# Laws with their simpler law, which is right if a record shows nothing of the difference: a mode
# far above the pilot's frequencies is a bend, and a short dead time is a slower servo.
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
    """Yield the readings that are equivalent to effects in any record."""
    for names, others in SAME.items():
        if set(names) <= set(effects):
            rest = set(effects) - set(names)
            for other in others:
                yield reading(rest | set(other), sure=True)
    # The twin has one bend, one servo and one contact: an effect that also sets another's numbers
    # includes that effect.
    for name in effects:
        own = _numbers(name)
        if own and any(own < _numbers(other) for other in effects):
            yield reading(set(effects) - {name}, sure=True)


def _numbers(name: str) -> set[str]:
    """Return the rig's parameters that an effect of the library sets."""
    return {number.key for number in BY_NAME[name].free} if name in BY_NAME else set()


def not_distinguished(
    rig: Rig,
    record: Record,
    effects: Sequence[str],
    numbers: Mapping[str, Mapping[str, float]] | None = None,
) -> Iterator[Reading]:
    """Yield the readings that this record does not discriminate from a rig's effects.

    Their log-likelihood differs by less than the gain required in a diagnosis. The true effect's
    fit begins at its true `numbers`, by effect, if given, since the fit from another start may end
    in a local minimum that is better by chance.
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
    """Return the start values of a fit at the true numbers of effects."""
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
