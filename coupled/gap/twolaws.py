"""Two readings of one law: friction by direction, and even friction with an offset.

Dry friction of a with the pull and b with the push is friction of (a + b)/2 with a constant
force of (b − a)/2 beside it, moving and at rest alike: no record of force and deflection
separates them, and one reading is given. Where one direction has less than twice the friction of
the other it is the even one with an offset, which a bearing with an amplifier's zero has; where it
has more, friction by direction.
"""

from __future__ import annotations

from collections.abc import Mapping

from coupled.gap.effect import Effect
from coupled.gap.library import BY_NAME

UNEVEN = 2.0  # times the other direction's friction


def even_reading(
    effects: tuple[Effect, ...], values: Mapping[str, float]
) -> tuple[tuple[Effect, ...], dict[str, float]] | None:
    """Return effects and values with friction by direction read as even friction and an offset.

    The last effect is read so. None where it is no such friction, where it is uneven indeed, or
    where one of the two is named already. Values in N.
    """
    *others, uneven = effects
    if uneven.even is None or {effect.name for effect in others} & set(uneven.even):
        return None
    pull, push = (values[uneven.value_key(number)] for number in uneven.free)
    if max(pull, push) >= UNEVEN * min(pull, push):
        return None
    even, offset = (BY_NAME[name] for name in uneven.even)
    gone = {uneven.value_key(number) for number in uneven.free}
    read = {key: value for key, value in values.items() if key not in gone}
    read[even.value_key(even.free[0])] = 0.5 * (pull + push)
    read[offset.value_key(offset.free[0])] = 0.5 * (push - pull)
    return (*others, even, offset), read
