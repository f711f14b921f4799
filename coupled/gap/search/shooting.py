"""Where the fit of a law that breaks away begins: where one to short replays ended.

A control that breaks loose once too early goes another way for seconds: a fit to the whole replay
stands in hollows, one for each order of slips, far from the least. Replays of a quarter second,
each begun as measured, forget what went before, and a fit to them goes down from afar (multiple
shooting: Bock 1983, in Numerical Treatment of Inverse Problems). They know the contact less well,
whose memory begins anew with each, and noise moves their beginnings: where they end is only where
the fit to the whole replay begins.
"""

from __future__ import annotations

from collections.abc import Sequence

from coupled.gap.effects.effect import Effect
from coupled.gap.search.case import Case
from coupled.gap.search.descent import Descent
from coupled.gap.search.fit import Fit
from coupled.gap.search.laws import Starts, above, imitating, law_starts, leaves_only_noise
from coupled.gap.search.screen import Screened, screen
from coupled.gap.signals.output import Part
from coupled.gap.thresholds import RICHER, SHOOTINGS

SHORT = Descent("wide", SHOOTINGS)


def shot_starts(
    case: Case,
    current: Fit,
    law: Effect,
    starts: Starts,
    found: Sequence[tuple[Effect, Fit]],
) -> Starts:
    """Return where the fit of a law of friction starts beside the effects of `current`.

    A law that holds plain friction, where that was fitted and leaves more than noise, at the end of
    a fit to short replays, and at plain friction itself. Any other, and where no output has
    short replays, as `law_starts` says.
    """
    for plain, fitted in found:
        if law.alike is not None and plain.name == law.alike.plainer:
            short = [] if leaves_only_noise(case, plain, fitted) else shot(case, law, plain, fitted)
            if short:
                alike = imitating(case, law, plain, fitted)
                return [*short, {**current.values, **fitted.values, **alike}]
    return law_starts(case, law, starts, found)


def shot(case: Case, law: Effect, plain: Effect, fitted: Fit, part: Part = "fitted") -> Starts:
    """Return where a fit to short replays ends with a law in place of plain friction, if any has.

    It begins at plain friction with a breakaway above it, and leaves what shares no output.
    """
    if case.by_shots is None:
        return []
    effects = [law if one is plain else one for one in fitted.effects]
    shapes = {law.value_key(p): p.starts[0] for p in law.free if p.shape}
    begun = {**fitted.values, **imitating(case, law, plain, fitted), **shapes}
    begun |= above(case, law, fitted, RICHER)
    return [dict(case.by_shots.fit(effects, part, begun, law, SHORT).values)]


def shot_contact(case: Case, current: Fit) -> Fit | None:
    """Return the fit of the same effects to short replays, begun with the settings as filed.

    How dry friction yields stands in hollows of its own, and the loader's settings with it. None
    where no output has short replays.
    """
    if case.by_shots is None:
        return None
    ours = {effect.value_key(p) for effect in current.effects for p in effect.free}
    begun = {key: value for key, value in current.values.items() if key in ours}
    return case.by_shots.fit(current.effects, "all", begun, None, SHORT)


def screened_short(case: Case, current: Fit, candidates: Sequence[Effect]) -> list[Screened]:
    """Return the candidates by what their signatures take of short replays, and where to start.

    With the contact and the settings that suit those. Where the whole replay sticks at other times
    than the record, what it leaves is of those times, and no effect's signature is like it.
    """
    short = shot_contact(case, current)
    if short is None or case.by_shots is None:
        return []
    found = screen(case.by_shots, short, candidates)
    return [one._replace(starts=[{**short.values, **at} for at in one.starts]) for one in found]
