"""One random trial: its category, the effects of its rig with their sizes, and its record."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from coupled.blind.trials.deck import Deck
from coupled.blind.trials.measure import alike, stage_gaps
from coupled.blind.trials.readings import not_distinguished, same_law
from coupled.blind.trials.rigs import DRAWN
from coupled.blind.trials.shares import true_shares
from coupled.blind.trials.truth import Sizes, TrueEffect, Truth
from coupled.blind.twin.kinds import Clean, Draw, Kind
from coupled.blind.twin.setting import Installed, Setting, draw_setting, fly_clean, with_other
from coupled.blind.twin.twin import LostError
from coupled.record.record import Record
from coupled.rig.rig import Rig

Rng = np.random.Generator
SHARES = {"none": 0.20, "single": 0.50, "pair": 0.12, "outsider": 0.15, "lacking": 0.03}
TOLERANCE = 0.007  # standard deviation of a nominal number within its tolerance
FAINTEST, WIDEST = 0.5, 30.0  # excess residual of a single effect, in noise floors
CLEAR, CLEAREST = 2.5, 20.0  # gap of a pair's effects and an outsider, in noise floors
SIZINGS = 5
# Channels that a record may lack, as an external rig's: one of these groups.
GROUPS = (
    ("column_deflection_m",),
    ("column_gradient_N_per_m",),
    ("column_estimate_m",),
    ("elevator_rad",),
)


@dataclass(frozen=True)
class Plan:
    """The plan of a record: its category, and the names of its rig's effects."""

    category: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Trial:
    """A record, its nominal rig, and its truth."""

    rig: Rig
    record: Record
    truth: Truth


@dataclass(frozen=True)
class _Sized:
    """A kind with its size, its gap alone, and that record."""

    put: Installed
    gap: float
    record: Record


def plans(rng: Rng, records: int, deck: Deck) -> list[Plan]:
    """Return the plan of each record, in random order, with every kind about equally often."""
    if deck.whole is not None:
        return [Plan(*one) for one in deck.whole.plans(rng, records)]
    counts = {category: math.floor(share * records) for category, share in SHARES.items()}
    counts["single"] += records - sum(counts.values())
    known = [kind.name for kind in deck.effects]
    effects = _shuffled(rng, known, records)
    others = _shuffled(rng, [kind.name for kind in deck.outsiders], records)
    made = []
    for category, count in counts.items():
        for _ in range(count):
            names: tuple[str, ...] = ()
            if category in ("single", "lacking"):
                names = (effects.pop(),)
            elif category == "outsider":
                names = (others.pop(),)
            elif category == "pair":
                first, second = rng.choice(known, 2, replace=False).tolist()
                names = (first, second)
            made.append(Plan(category, names))
    order = rng.permutation(len(made))
    return [made[i] for i in order]


def _shuffled(rng: Rng, names: Sequence[str], least: int) -> list[str]:
    """Return the names in repeated random permutations, at least `least` of them."""
    dealt: list[str] = []
    while len(dealt) < least:
        dealt = [str(name) for name in rng.permutation(list(names))] + dealt
    return dealt


def draw_trial(rng: Rng, plan: Plan, deck: Deck, pool: Mapping[str, Rig]) -> Trial:
    """Return a trial of a plan, on a suitable rig of the pool.

    If the effects cannot be made large enough on one rig, another rig is drawn; after many, the
    kinds themselves are drawn again, so that the loop always ends.
    """
    if deck.whole is not None:
        return Trial(*deck.whole.draw(rng, plan.category, plan.names, pool))
    kinds = [deck.kind(plan.category, name) for name in plan.names]
    for attempt in range(60):
        if attempt and attempt % 12 == 0 and plan.category in ("pair", "outsider"):
            known = deck.kinds(plan.category)
            kinds = [known[i] for i in rng.choice(len(known), len(kinds), replace=False)]
        rig = _choose_rig(rng, kinds, pool)
        begun = fly_clean(_set(rng, rig, kinds, deck)) if rig else None
        if begun is None:
            continue
        trial = _flown(rng, plan, kinds, *begun)
        if trial is not None:
            return trial
    raise AssertionError(f"no rig of the pool can be flown with {plan}")


def _set(rng: Rng, rig: Rig, kinds: Sequence[Kind], deck: Deck) -> Setting:
    """Return a setting; with a wheel if a kind needs one, and in a share of the others."""
    realism = deck.realism
    setting = replace(draw_setting(rng, rig, realism), built=deck.built)
    if any(kind.other for kind in kinds) or (realism.wheels and rng.uniform() < realism.wheels):
        return with_other(rng, setting)
    return setting


def _choose_rig(rng: Rng, kinds: Sequence[Kind], pool: Mapping[str, Rig]) -> Rig | None:
    """Return a suitable rig: a random one in one of three draws; a bench in one of four.

    None if no rig can have all of the kinds.
    """
    names = {kind.name for kind in kinds}
    if any(names & {*kind.excludes} for kind in kinds):
        return None
    suited = [name for name, rig in pool.items() if all(kind.suits(rig) for kind in kinds)]
    drawn = not rng.uniform() < 2.0 / 3.0
    benches = rng.uniform() < 0.25
    of_kind = [name for name in suited if name.startswith(DRAWN) == drawn] or suited
    found = [name for name in of_kind if (pool[name].flight is None) == benches] or of_kind
    return pool[str(rng.choice(found))] if found else None


def _flown(
    rng: Rng, plan: Plan, kinds: Sequence[Kind], setting: Setting, clean: Clean
) -> Trial | None:
    """Return the trial in its setting, or None if its gaps cannot be made as large as wanted."""
    if plan.category == "none":
        return _without(rng, setting)
    bare = stage_gaps(clean.rig, clean.record, any(k.widens == "airframe" for k in kinds))
    parts = []
    for kind in kinds:
        part = _part(rng, plan, kind, setting, clean, bare)
        if part is None:
            return None
        parts.append(part)
    try:
        flown = setting.fly(clean, [part.put for part in parts])
    except LostError:
        return None
    sizes = Sizes(
        clean_gap={kind.widens: bare[kind.widens] for kind in kinds},
        alone=tuple(part.gap for part in parts),
        ratio=min(part.gap / bare[part.put.kind.widens] for part in parts),
    )
    truth = Truth(
        plan.category,
        setting.rig.name,
        effects=tuple(
            TrueEffect(kind.name, kind.stage, values)
            for kind, values in zip(kinds, flown.parameters, strict=True)
        ),
        stages=tuple(sorted({kind.stage for kind in kinds})),
        gap=stage_gaps(setting.rig, flown.record),
        sizes=sizes,
        also=_also(setting),
        conditions=setting.conditions,
    )
    if plan.category == "single":
        others = alike(setting.rig, flown.record, kinds[0].name)
        truth = replace(truth, alike=others)
    if plan.category in ("single", "pair") and setting.conditions.presliding_m is not None:
        truth = _read_otherwise(truth, setting, clean, parts, flown.record)
    trial = Trial(setting.rig, flown.record, truth)
    return _lacking(rng, trial) if plan.category == "lacking" else trial


def _read_otherwise(
    truth: Truth, setting: Setting, clean: Clean, parts: Sequence[_Sized], record: Record
) -> Truth:
    """Return the truth with its other readings, and each effect's share of the gap."""
    names = [effect.name for effect in truth.effects]
    records = {frozenset[str](): clean.record, frozenset(names): record}
    if len(names) > 1:
        records |= {frozenset([part.put.kind.name]): part.record for part in parts}
    numbers = {one.name: one.parameters for one in truth.effects} if setting.built else {}
    return replace(
        truth,
        readings=(*same_law(names), *not_distinguished(setting.rig, record, names, numbers)),
        budget=true_shares(setting.known, records, truth.stages, apart=setting.built),
    )


def _part(
    rng: Rng, plan: Plan, kind: Kind, setting: Setting, clean: Clean, bare: Mapping[str, float]
) -> _Sized | None:
    """Return a kind at a size with the gap of its category, or None."""
    if kind.widens not in bare:  # a constant gradient shows nothing of its schedule
        return None
    clear = plan.category in ("pair", "outsider")
    low, high = (CLEAR * 1.1, CLEAREST * 0.8) if clear else (FAINTEST, WIDEST)
    wanted = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    shares = (float(rng.uniform()), float(rng.uniform()), float(rng.uniform()))
    draw = Draw(float(rng.choice([-1.0, 1.0])), shares, int(rng.integers(2**31)))
    sized = _sized(setting, clean, kind, draw, wanted, bare[kind.widens])
    if sized is None or (clear and not CLEAR <= sized.gap <= CLEAREST):
        return None
    return sized


def _without(rng: Rng, setting: Setting) -> Trial | None:
    """Return a trial without effects; in one of three, numbers deviate within their tolerance."""
    tolerance = {}
    if rng.uniform() < 1.0 / 3.0:
        names = ("mass", "damping", "servo_rate")
        tolerance = {name: 1.0 + float(rng.normal(0.0, TOLERANCE)) for name in names}
    try:
        record = setting.fly(tolerance=tolerance).record
    except LostError:
        return None
    truth = Truth(
        "none",
        setting.rig.name,
        gap=stage_gaps(setting.rig, record),
        tolerance=tolerance,
        also=_also(setting),
        conditions=setting.conditions,
    )
    return Trial(setting.rig, record, truth)


def _also(setting: Setting) -> tuple[str, ...]:
    """Return the rig's other properties: in later versions, presliding friction."""
    dry = setting.rig.controls["column"].loader.friction > 0.0
    return ("presliding_friction",) if dry and setting.conditions.presliding_m else ()


def _lacking(rng: Rng, trial: Trial) -> Trial:
    groups = [group for group in GROUPS if all(name in trial.record for name in group)]
    group = groups[int(rng.integers(len(groups)))]
    kept = [name for name in trial.record.channels if name not in group]
    data = np.column_stack([trial.record[name] for name in kept])
    truth = replace(trial.truth, missing=tuple(group))
    return replace(trial, record=Record(tuple(kept), data), truth=truth)


def _sized(
    setting: Setting, clean: Clean, kind: Kind, draw: Draw, wanted: float, bare: float
) -> _Sized | None:
    """Return a kind simulated alone at a size with about the wanted excess residual.

    The excess is about proportional to the size; a few iterations correct it. None if all fail.
    """
    size, best, miss = math.sqrt(kind.least * kind.most), None, math.inf
    for _ in range(SIZINGS):
        put = Installed(kind, size, draw)
        try:
            record = setting.fly(clean, [put]).record
        except LostError:
            size = max(kind.least, 0.4 * size)
            continue
        gap = stage_gaps(setting.rig, record, kind.widens == "airframe")[kind.widens]
        excess = math.sqrt(max(gap**2 - bare**2, 0.01))
        off = abs(math.log(wanted / excess))
        if off < miss:
            best, miss = _Sized(put, gap, record), off
        last = size
        size *= min(max(wanted / excess, 0.02), 50.0)
        size = min(max(size, kind.least), kind.most)
        if off < 0.4 or size == last:
            break
    return best
