"""Two readings of one law: friction by direction or by how it yields, and a force that is late.

Dry friction of a with the pull and b with the push is friction of (a + b)/2 with a constant
force of (b − a)/2 beside it, moving and at rest alike: no record of force and deflection
separates them, and one reading is given. Where one direction has less than twice the friction of
the other it is the even one with an offset, which a bearing with an amplifier's zero has; where it
has more, friction by direction. An offset is none that is less than friction is known by.

Where nothing bends, a force that is felt late is one that is stamped early: the first is named,
which a machine has more often, and the other beside it.

How far a contact yields before it slips is a setting beside any dry friction (`settings`). Where
the records show that it does, plain friction is read as friction that yields, with those numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from coupled.gap.effects.effect import FRICTION, Effect, value_of
from coupled.gap.effects.library import BY_NAME
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.gain import Candidate
from coupled.gap.thresholds import MODEL_ERROR, RIVAL_GAIN, YIELDED

UNEVEN = 2.0  # times the other direction's friction


def read_even(case: Case, found: Fit) -> tuple[tuple[Effect, ...], dict[str, float]] | None:
    """Return a fit's effects and values by `even_reading`, on a rig with its own friction."""
    filed = float(value_of(case.nominal, case.control, FRICTION))
    return even_reading(found.effects, found.values, filed)


def even_reading(
    effects: tuple[Effect, ...], values: Mapping[str, float], filed: float = 0.0
) -> tuple[tuple[Effect, ...], dict[str, float]] | None:
    """Return effects and values with friction by direction read as even friction and an offset.

    The last effect is read so. None where it is no such friction, where it is uneven indeed, or
    where one of the two is named already. Values in N; `filed` is the friction that the rig has.
    """
    *others, uneven = effects
    if uneven.even is None or {effect.name for effect in others} & set(uneven.even):
        return None
    pull, push = (values[uneven.value_key(number)] for number in uneven.free)
    if max(pull, push) >= UNEVEN * min(pull, push):
        return None
    even, offset = (BY_NAME[name] for name in uneven.even)
    level, zero = 0.5 * (pull + push), 0.5 * (push - pull)
    gone = {uneven.value_key(number) for number in uneven.free}
    read = {key: value for key, value in values.items() if key not in gone}
    read[even.value_key(even.free[0])] = level
    if abs(zero) < MODEL_ERROR * (filed + level):
        return (*others, even), read
    read[offset.value_key(offset.free[0])] = zero
    return (*others, even, offset), read


def plain_reading(best: Candidate, ranked: Sequence[Candidate]) -> Candidate:
    """Return the best candidate, or another that is the same law where nothing tells them apart."""
    least = best.gain - RIVAL_GAIN
    same = (o for o in ranked if best.effect.name in o.effect.swallows and o.gain > least)
    return next(same, best)


def yielding_reading(case: Case, found: Fit) -> tuple[Effect, Effect, dict[str, float]] | None:
    """Return the plain friction found, the law that it is where it yields, and where to start.

    None where no friction was found that surely yields by more than `YIELDED` of what may be.
    """
    if not case.contact:
        return None
    length, share = (one.value_key(one.free[0]) for one in case.contact)
    most = case.contact[0].free[0].high
    plain = next((effect for effect in found.effects if effect.yielding), None)
    if plain is None or found.low.get(length, 0.0) < YIELDED * most:
        return None
    law = BY_NAME[plain.yielding]
    if law in found.effects:
        return None
    contact = value_of(found.rig, case.control, case.contact[0].free[0].key)
    numbers = (found.values[plain.value_key(plain.free[0])], float(contact), found.values[share])
    start = dict(found.values)
    start |= {law.value_key(p): v for p, v in zip(law.free, numbers, strict=True)}
    return plain, law, start
