"""The course of each effect found, by what its records hold of its action."""

from __future__ import annotations

import numpy as np

from coupled.gap.case import Case
from coupled.gap.course import Bounds, Course, course_of, course_of_events
from coupled.gap.effect import Effect
from coupled.gap.fit import Fit, touched
from coupled.gap.output import Floats
from coupled.record.record import Record


def course_in(effect: Effect, case: Case, found: Fit, records: list[Record]) -> Course | None:
    """Return the course of an effect in the record that holds most of its action.

    None of an effect without a number, of one of several records whose course is the same all the
    time, and of a limit, whose action does not go with its size.
    """
    if not effect.free:
        return None
    without = case.with_only(found, [other for other in found.effects if other is not effect])
    parts: dict[int, list[tuple[Floats, Floats]]] = {}
    for output in touched(case.outputs, [effect]):
        left = output.residual(found.rig)
        action = output.residual(without) - left
        parts.setdefault(output.record, []).append((action, left))
    if not parts:
        return None
    most = max(parts, key=lambda k: sum(float(action @ action) for action, _ in parts[k]))
    record, rate_Hz = records[most], case.nominal.frame_rate
    if effect.events is not None:
        at_s = effect.events(record)
        return course_of_events(at_s, len(record) / rate_Hz) if at_s.size else None
    first = effect.free[0]
    if first.inverse:
        return None
    key, nothing = effect.value_key(first), first.neutral(case.nominal, case.control)
    value, low, high = (
        bound.get(key, np.nan) - nothing for bound in (found.values, found.low, found.high)
    )
    return course_of(parts[most], rate_Hz, Bounds(value, low, high), effect.gradual)
