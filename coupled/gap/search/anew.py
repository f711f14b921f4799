"""A fit begun anew where it may have ended in a hollow: over a limit, or at a setting's end.

What the contact of dry friction, or a setting, was found beside lacked the effect found last, and
either may make up for that effect's number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.effects.effect import Effect, value_of
from coupled.gap.effects.settings import is_dry
from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.search.shooting import shot_contact
from coupled.gap.thresholds import BEGUN_AT, FAR_BELOW_NOISE, HIGHER, NEXT_TO
from coupled.parallel import in_threads


def with_contact_anew(case: Case, current: Fit) -> Fit:
    """Return a fit, or the one with the contact of dry friction sought anew if that leaves less.

    Where the loader is over its limit: what the contact was found beside lacked this effect. A
    breakaway that was found too low has a contact of its own, and fits between the two are worse:
    one that stands higher above running friction is tried, too.
    """
    start = case.but_for_contact(current.values)
    if "loader" not in case.over_limit(current.rig) or start == current.values:
        return current
    starts = [start, *({**start, **one} for one in _higher_breakaways(case, current))]
    short = shot_contact(case, current)
    starts += [] if short is None else [dict(short.values)]
    fits = in_threads(partial(_begun, case, current.effects), starts)
    return min([current, *fits], key=lambda one: one.cost)


def _higher_breakaways(case: Case, current: Fit) -> list[dict[str, float]]:
    """Return each breakaway that was found, HIGHER times as far above the friction beside it."""
    found = []
    for effect in current.effects:
        for p in effect.free:
            if p.above:
                key = effect.value_key(p)
                running = float(value_of(current.rig, case.control, p.above))
                found += [{key: running + HIGHER * (current.values[key] - running)}]
    return found


def with_settings_anew(case: Case, current: Fit) -> Fit:
    """Return a fit, or the least of those begun with the settings as filed where one is at its end.

    The fit may have ended in a hollow, in which the setting makes up for an effect's number: that
    is tried at less and at more, too. Of friction and of flights, of which each fit takes long, it
    is asked only where something is over its limit, and by its number as found; of friction also
    where the setting would be held against an effect (`strained`), and begun by short replays, too.
    """
    ends = {one.value_key(p): (p.low, p.high) for one in case.known.values() for p in one.free}
    strained = {key for key in ends if key in current.values and _at_end(current, key, ends[key])}
    settings = (one for one in case.known.values() if strained & {*map(one.value_key, one.free)})
    shown = {stage for one in settings for stage in one.shows_in}
    ours = [one for one in current.effects if one.free and shown & {*one.shows_in}]
    if not strained:
        return current
    rubs = "loader" in shown and (is_dry(case.nominal, case.control) or any(o.dry for o in ours))
    long = rubs or any(STAGE_OF[stage].flown for stage in shown) or any(one.dry for one in ours)
    asked = rubs and case.gaps(current.rig).get("loader", 0.0) >= FAR_BELOW_NOISE
    if long and not asked and not case.over_limit(current.rig):
        return current
    filed = {key: value for key, value in current.values.items() if key not in ends}
    starts = [filed]
    for effect in [] if long else ours:
        key, level = effect.value_key(effect.free[0]), effect.free[0]
        none = level.neutral(case.nominal, case.control)
        starts += [{**filed, key: none + times * (filed[key] - none)} for times in BEGUN_AT]
    short = shot_contact(case, current) if rubs else None
    starts += [] if short is None else [dict(short.values)]
    fits = in_threads(partial(_begun, case, current.effects), starts)
    return min([current, *fits], key=lambda one: one.cost)


def _begun(case: Case, effects: Sequence[Effect], start: Mapping[str, float]) -> Fit:
    return case.fit(effects, start=start)


def _at_end(current: Fit, key: str, ends: tuple[float, float]) -> bool:
    """Tell whether a setting stands at an end of its tolerance, or next to it."""
    room = NEXT_TO * (ends[1] - ends[0])
    return key in current.at_bound or not ends[0] + room < current.values[key] < ends[1] - room
