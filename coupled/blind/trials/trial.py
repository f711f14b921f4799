"""One trial drawn: its class, what is wrong with its rig and how much, and its record."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from coupled.blind.trials.measure import alike, stage_gaps
from coupled.blind.trials.rigs import DRAWN
from coupled.blind.twin.effects import EFFECTS
from coupled.blind.twin.kinds import Clean, Draw, Kind
from coupled.blind.twin.outsiders import OUTSIDERS
from coupled.blind.twin.setting import Setting, draw_setting, fly_clean
from coupled.blind.twin.twin import LostError
from coupled.record.record import Record
from coupled.rig.rig import Rig

Rng = np.random.Generator
KINDS = {kind.name: kind for kind in (*EFFECTS, *OUTSIDERS)}
SHARES = {"none": 0.20, "single": 0.50, "pair": 0.12, "outsider": 0.15, "lacking": 0.03}
TOLERANCE = 0.007  # standard deviation of a nominal number's setting
FAINTEST, WIDEST = 0.5, 30.0  # of a single's excess residual, in floors
CLEAR, CLEAREST = 2.5, 20.0  # a pair's and an outsider's gap, in floors
SIZINGS = 5
# What a record may lack, as the rig of a stranger does: one of these groups.
GROUPS = (
    ("column_deflection_m",),
    ("column_gradient_N_per_m",),
    ("column_estimate_m",),
    ("elevator_rad",),
)


@dataclass(frozen=True)
class Plan:
    """What a record is to be: its class, and the names of what its rig has."""

    kind: str
    names: tuple[str, ...]


@dataclass(frozen=True)
class Trial:
    """A record, its nominal rig, and the truth of it as the key has it."""

    rig: Rig
    record: Record
    truth: dict[str, Any]


@dataclass(frozen=True)
class _Sized:
    """A kind at the size it was given, and the gap that it makes alone."""

    kind: Kind
    size: float
    draw: Draw
    gap: float


def plans(rng: Rng, records: int) -> list[Plan]:
    """Return what each record is to be, in random order, every kind about equally often."""
    counts = {kind: math.floor(share * records) for kind, share in SHARES.items()}
    counts["single"] += records - sum(counts.values())
    effects = _deck(rng, [kind.name for kind in EFFECTS], records)
    others = _deck(rng, [kind.name for kind in OUTSIDERS], records)
    made = []
    for kind, count in counts.items():
        for _ in range(count):
            names: tuple[str, ...] = ()
            if kind in ("single", "lacking"):
                names = (effects.pop(),)
            elif kind == "outsider":
                names = (others.pop(),)
            elif kind == "pair":
                first, second = rng.choice([e.name for e in EFFECTS], 2, replace=False).tolist()
                names = (first, second)
            made.append(Plan(kind, names))
    order = rng.permutation(len(made))
    return [made[i] for i in order]


def _deck(rng: Rng, names: Sequence[str], least: int) -> list[str]:
    """Return shuffled decks of the names, one after the other, at least so many."""
    deck: list[str] = []
    while len(deck) < least:
        deck = [str(name) for name in rng.permutation(list(names))] + deck
    return deck


def draw_trial(rng: Rng, plan: Plan, pool: Mapping[str, Rig]) -> Trial:
    """Return a trial of a plan, on a rig of the pool that can have it.

    What cannot be made clear on one rig is drawn anew on another; after many, the kinds
    themselves are drawn anew, so that the work always ends.
    """
    kinds = [KINDS[name] for name in plan.names]
    for attempt in range(60):
        if attempt and attempt % 12 == 0 and plan.kind in ("pair", "outsider"):
            of = EFFECTS if plan.kind == "pair" else OUTSIDERS
            kinds = [of[i] for i in rng.choice(len(of), len(kinds), replace=False)]
        rig = _choose_rig(rng, kinds, pool)
        begun = fly_clean(draw_setting(rng, rig)) if rig else None
        if begun is None:
            continue
        trial = _flown(rng, plan, kinds, *begun)
        if trial is not None:
            return trial
    raise AssertionError(f"no rig of the pool can be flown with {plan}")


def _choose_rig(rng: Rng, kinds: Sequence[Kind], pool: Mapping[str, Rig]) -> Rig | None:
    """Return a rig that suits: one of the shipped in two of three draws; a bench in one of four."""
    suited = [name for name, rig in pool.items() if all(kind.suits(rig) for kind in kinds)]
    shipped = rng.uniform() < 2.0 / 3.0
    benches = rng.uniform() < 0.25
    of_kind = [name for name in suited if name.startswith(DRAWN) != shipped] or suited
    found = [name for name in of_kind if (pool[name].flight is None) == benches] or of_kind
    return pool[str(rng.choice(found))] if found else None


def _flown(
    rng: Rng, plan: Plan, kinds: Sequence[Kind], setting: Setting, clean: Clean
) -> Trial | None:
    """Return the trial in its setting, or None where its kinds cannot be made as wide as wanted."""
    if plan.kind == "none":
        return _without(rng, setting)
    bare = stage_gaps(clean.rig, clean.record, any(k.stage == "airframe" for k in kinds))
    parts = []
    for kind in kinds:
        part = _part(rng, plan, kind, setting, clean, bare)
        if part is None:
            return None
        parts.append(part)
    try:
        record, found = setting.fly(clean, [(p.kind, p.size, p.draw) for p in parts])
    except LostError:
        return None
    truth = _truth(setting, plan.kind, stage_gaps(setting.rig, record)) | {
        "effects": [
            {"name": part.kind.name, "stage": part.kind.stage, "parameters": values}
            for part, values in zip(parts, found, strict=True)
        ],
        "stages": sorted({kind.stage for kind in kinds}),
        "clean_gap": {kind.stage: bare[kind.stage] for kind in kinds},
        "alone": [part.gap for part in parts],
        "ratio": min(part.gap / bare[part.kind.stage] for part in parts),
    }
    if plan.kind == "single":
        truth["alike"] = alike(setting.rig, record, kinds[0].name)
    trial = Trial(setting.rig, record, truth)
    return _lacking(rng, trial) if plan.kind == "lacking" else trial


def _part(
    rng: Rng, plan: Plan, kind: Kind, setting: Setting, clean: Clean, bare: Mapping[str, float]
) -> _Sized | None:
    """Return a kind at a size that makes it as wide as its class wants, or None."""
    if kind.stage not in bare:  # a gradient that never changes tells nothing of its schedule
        return None
    clear = plan.kind in ("pair", "outsider")
    low, high = (CLEAR * 1.1, CLEAREST * 0.8) if clear else (FAINTEST, WIDEST)
    wanted = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    shares = (float(rng.uniform()), float(rng.uniform()), float(rng.uniform()))
    draw = Draw(float(rng.choice([-1.0, 1.0])), shares, int(rng.integers(2**31)))
    sized = _sized(setting, clean, kind, draw, wanted, bare[kind.stage])
    if sized is None or (clear and not CLEAR <= sized.gap <= CLEAREST):
        return None
    return sized


def _without(rng: Rng, setting: Setting) -> Trial | None:
    """Return a trial without an effect; in one of three, numbers are off as their setting lets."""
    off = {}
    if rng.uniform() < 1.0 / 3.0:
        names = ("mass", "damping", "servo_rate")
        off = {name: 1.0 + float(rng.normal(0.0, TOLERANCE)) for name in names}
    try:
        record, _ = setting.fly(off=off)
    except LostError:
        return None
    truth = _truth(setting, "none", stage_gaps(setting.rig, record))
    return Trial(setting.rig, record, truth | {"effects": [], "stages": [], "tolerance": off})


def _truth(setting: Setting, kind: str, gaps: dict[str, float]) -> dict[str, Any]:
    about = {**setting.about, "level_N": setting.level_N}
    return {"class": kind, "rig": setting.rig.name, "gap": gaps, "missing": [], **about}


def _lacking(rng: Rng, trial: Trial) -> Trial:
    groups = [group for group in GROUPS if all(name in trial.record for name in group)]
    group = groups[int(rng.integers(len(groups)))]
    kept = [name for name in trial.record.channels if name not in group]
    data = np.column_stack([trial.record[name] for name in kept])
    truth = trial.truth | {"missing": list(group)}
    return replace(trial, record=Record(tuple(kept), data), truth=truth)


def _sized(
    setting: Setting, clean: Clean, kind: Kind, draw: Draw, wanted: float, bare: float
) -> _Sized | None:
    """Return a kind flown alone at a size whose excess residual is about as wide as wanted.

    The excess grows about as the size; a few trials correct it. None where all are lost.
    """
    size, best, miss = math.sqrt(kind.least * kind.most), None, math.inf
    for _ in range(SIZINGS):
        try:
            record, _ = setting.fly(clean, [(kind, size, draw)])
        except LostError:
            size = max(kind.least, 0.4 * size)
            continue
        gap = stage_gaps(setting.rig, record, kind.stage == "airframe")[kind.stage]
        excess = math.sqrt(max(gap**2 - bare**2, 0.01))
        off = abs(math.log(wanted / excess))
        if off < miss:
            best, miss = _Sized(kind, size, draw, gap), off
        last, size = (
            size,
            min(max(size * min(max(wanted / excess, 0.02), 50.0), kind.least), kind.most),
        )
        if off < 0.4 or size == last:
            break
    return best
