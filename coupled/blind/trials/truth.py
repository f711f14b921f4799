"""The truth of a trial: its rig's effects, their gaps, and the conditions of the record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from coupled.blind.twin.conditions import LATER, Conditions
from coupled.errors import MISSING, InputError
from coupled.schema import Lenient, named, read_as

Category = Literal["none", "single", "pair", "outsider", "lacking"]
FEWEST_EFFECTS: Mapping[Category, int] = {
    "none": 0,
    "single": 1,
    "pair": 2,
    "outsider": 1,
    "lacking": 1,
}
_CONDITIONS = ("noise", "bristle_J", *LATER)  # that the key of a record may omit


@dataclass(frozen=True)
class TrueEffect:
    """An effect of the real rig that its nominal model lacks, with the names of a diagnosis."""

    name: str
    stage: str
    parameters: Mapping[str, float]


@dataclass(frozen=True)
class Sizes:
    """The gaps of a trial's effects, residual over noise floor under the nominal rig.

    clean_gap  of each effect's stage, on the same rig without any effect
    alone      of each effect alone, in the order of the effects
    ratio      the least of `alone` over `clean_gap`: 2 doubles the stage's residual
    """

    clean_gap: Mapping[str, float]
    alone: tuple[float, ...]
    ratio: float


@dataclass(frozen=True)
class Reading:
    """Effects that are equivalent to the true ones, and their stages, sorted.

    `sure`: in any record, so that naming them is right; otherwise in this record only, so that
    naming them is right only as an alternative to the truth.
    """

    names: tuple[str, ...]
    stages: tuple[str, ...]
    sure: bool


@dataclass(frozen=True)
class Truth:
    """The truth of a record, an entry of the key.

    category    the key's `class`: none, single, pair, outsider or lacking
    rig         name of the nominal rig
    stages      stages with effects, sorted
    gap         each stage's residual over its noise floor under the nominal rig
    missing     channels that were removed
    alike       effects that are the same law on this record; of a single effect
    readings    other effects that are equivalent, in any record or this one; of later versions
    budget      {stage: {effect: its share of the residual's power}}; of later versions
    also        other properties of the rig that the nominal one lacks; naming them is not wrong
    tolerance   factors on numbers within their tolerance, which are not effects
    sizes       None if the rig has no effects
    conditions  the conditions of the record
    seed        of the trial's draws
    """

    category: str
    rig: str
    effects: tuple[TrueEffect, ...] = ()
    stages: tuple[str, ...] = ()
    gap: Mapping[str, float] = field(default_factory=dict)
    missing: tuple[str, ...] = ()
    alike: tuple[str, ...] = ()
    readings: tuple[Reading, ...] = ()
    budget: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    also: tuple[str, ...] = ()
    tolerance: Mapping[str, float] = field(default_factory=dict)
    sizes: Sizes | None = None
    conditions: Conditions | None = None
    seed: tuple[int, ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """The names of the rig's effects."""
        return frozenset(effect.name for effect in self.effects)

    @property
    def not_distinguished(self) -> frozenset[str]:
        """The effects that this record does not discriminate from the true ones."""
        others = (one.names for one in self.readings if not one.sure)
        return frozenset(name for names in others for name in names) - self.names

    @property
    def ratio(self) -> float:
        """The factor by which the effects enlarge their stages' residuals; 1 without effects."""
        return 1.0 if self.sizes is None else self.sizes.ratio

    def as_dict(self) -> dict[str, Any]:
        """Return the truth for the key."""
        table: dict[str, Any] = {
            "class": self.category,
            "rig": self.rig,
            "effects": [asdict(effect) for effect in self.effects],
            "stages": list(self.stages),
            "gap": dict(self.gap),
            "missing": list(self.missing),
            "seed": list(self.seed),
        }
        if self.category == "single":
            table["alike"] = list(self.alike)
        if self.readings:
            table["readings"] = [
                {"names": list(one.names), "stages": list(one.stages), "sure": one.sure}
                for one in self.readings
            ]
        if self.budget:
            table["budget"] = {stage: dict(shares) for stage, shares in self.budget.items()}
        if self.also:
            table["also"] = list(self.also)
        if self.category == "none":
            table["tolerance"] = dict(self.tolerance)
        if self.sizes is not None:
            table |= asdict(self.sizes) | {"alone": list(self.sizes.alone)}
        if self.conditions is not None:
            table |= self.conditions.as_dict()
        return table


class KeyEffect(Lenient):
    """A true effect in a key."""

    name: str
    stage: str
    parameters: dict[str, float]


class KeyReading(Lenient):
    """Another reading of the truth in a key."""

    names: list[str]
    stages: list[str]
    sure: bool


class KeyEntry(Lenient):
    """The truth of a record in a key; keys of some records only are None in the others."""

    category: Category = named("class")
    rig: str
    effects: list[KeyEffect]
    stages: list[str]
    gap: dict[str, float]
    missing: list[str]
    alike: list[str] = []
    readings: list[KeyReading] = []
    budget: dict[str, dict[str, float]] = {}
    also: list[str] = []
    tolerance: dict[str, float] = {}
    seed: list[int] = []
    clean_gap: dict[str, float] = {}
    alone: list[float] = []
    ratio: float | None = None
    duration_s: float | None = None
    excitation: list[str] = []
    level_N: float | None = None
    noise: dict[str, float] = {}
    bristle_J: float | None = None
    presliding_m: float | None = None
    elastic_share: float = 0.0
    corner_Hz: dict[str, float] = {}
    force_skew_s: float = 0.0
    motion_skew_s: float = 0.0


def truth_from(entry: Any, file: object, path: str = "") -> Truth:
    """Return the truth written by `Truth.as_dict`; raises InputError for anything else.

    `path` is the dotted path of the entry in `file`.
    """
    table = read_as(KeyEntry, entry, file, path)
    fewest = FEWEST_EFFECTS[table.category]
    if len(table.effects) < fewest:
        problem = f"has {len(table.effects)}, and a record of class {table.category} has {fewest}"
        raise InputError(file, f"{path}.effects".lstrip("."), f"{problem} or more")
    sizes = conditions = None
    if table.ratio is not None:
        sizes = Sizes(table.clean_gap, tuple(table.alone), table.ratio)
    if table.duration_s is not None:
        if table.level_N is None:
            raise InputError(file, f"{path}.level_N".lstrip("."), MISSING)
        conditions = Conditions(
            duration_s=table.duration_s,
            excitation=tuple(table.excitation),
            level_N=table.level_N,
            **{name: getattr(table, name) for name in _CONDITIONS},
        )
    return Truth(
        category=table.category,
        rig=table.rig,
        effects=tuple(TrueEffect(e.name, e.stage, e.parameters) for e in table.effects),
        stages=tuple(table.stages),
        gap=table.gap,
        missing=tuple(table.missing),
        alike=tuple(table.alike),
        readings=tuple(
            Reading(tuple(one.names), tuple(one.stages), one.sure) for one in table.readings
        ),
        budget=table.budget,
        also=tuple(table.also),
        tolerance=table.tolerance,
        sizes=sizes,
        conditions=conditions,
        seed=tuple(table.seed),
    )
