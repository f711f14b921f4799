"""A fit begun anew where something is over its limit: it may have ended in a hollow.

What the contact of dry friction, or a setting, was found beside lacked the effect found last, and
either may make up for that effect's number.
"""

from __future__ import annotations

from coupled.gap.search.case import Case
from coupled.gap.search.fit import Fit
from coupled.gap.signals.output import stage_limits


def with_contact_anew(case: Case, current: Fit) -> Fit:
    """Return a fit, or the one with the contact of dry friction sought anew if that leaves less.

    Where the loader is over its limit: what the contact was found beside lacked this effect.
    """
    start = case.but_for_contact(current.values)
    over = case.gaps(current.rig).get("loader", 0.0) > stage_limits(case.outputs).get("loader", 0.0)
    if not over or start == current.values:
        return current
    return min([current, case.fit(current.effects, start=start)], key=lambda one: one.cost)


def with_settings_anew(case: Case, current: Fit) -> Fit:
    """Return a fit, or the one begun with the settings as filed if that leaves less.

    Where a setting stands at its end and something is over its limit: the fit may have ended in a
    hollow, in which the setting makes up for an effect's number.
    """
    limits = stage_limits(case.outputs)
    keys = {one.value_key(p) for one in case.known.values() for p in one.free}
    strained = [key for key in current.at_bound if key in keys]
    if not strained or all(gap <= limits[at] for at, gap in case.gaps(current.rig).items()):
        return current
    start = {key: value for key, value in current.values.items() if key not in keys}
    return min([current, case.fit(current.effects, start=start)], key=lambda one: one.cost)
