"""Diagnoses read back, each compared with the truth of its record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from coupled.blind.trials.deck import read_deck
from coupled.blind.trials.key import Key
from coupled.blind.trials.readings import same_law
from coupled.blind.trials.truth import Truth
from coupled.errors import InputError
from coupled.files import read_json
from coupled.gap.findings.result import KeptEffect, diagnosis_from, placed

NAMING = ("effect", "mostly")  # verdicts that name effects as certain
MISSING = "missing"  # the verdict of a record without a diagnosis


@dataclass(frozen=True)
class Interval:
    """A 95 % interval of a parameter, SI; a bound is None if it is open."""

    low: float | None
    high: float | None

    @property
    def whole(self) -> bool:
        """Whether it has both bounds."""
        return self.low is not None and self.high is not None

    def holds(self, value: float) -> bool:
        """Tell whether a value lies within; an open interval contains none."""
        return self.low is not None and self.high is not None and self.low <= value <= self.high


@dataclass(frozen=True)
class FoundEffect:
    """An effect of a diagnosis, its probability, 0 to 1, and its parameters."""

    probability: float
    intervals: Mapping[str, Interval]


@dataclass(frozen=True)
class Answer:
    """A record's truth, and its diagnosis.

    found     the effects of the diagnosis by name
    possible  all effects that the diagnosis does not exclude
    guilty    the faulty stages of the diagnosis
    lacking   channels that it reports as missing
    closed    share of the gap that it closed, if given
    budget    {faulty stage: {effect: its share of the residual's power}}
    """

    record: str
    truth: Truth
    verdict: str
    found: Mapping[str, FoundEffect]
    possible: frozenset[str]
    guilty: frozenset[str]
    lacking: frozenset[str]
    closed: float | None
    budget: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def exact(self) -> bool:
        """Whether it names exactly the true effects, with certainty.

        If another effect is the same law on this record, naming exactly these two as alternatives
        is exact, too.
        """
        if self.verdict in NAMING:
            return self.names_right
        alike = frozenset(self.truth.alike) | self.truth.not_distinguished
        return bool(alike) and self.contains and self.possible <= self._known | alike

    @property
    def _known(self) -> frozenset[str]:
        """The names of the true effects in all equivalent readings."""
        return self.truth.names.union(*self._laws)

    @property
    def _laws(self) -> list[frozenset[str]]:
        """The sets of effects that are the truth, in all equivalent readings."""
        sure = [one.names for one in self.truth.readings if one.sure]
        same = [one.names for names in sure for one in same_law(names)]
        return [self.truth.names, *map(frozenset, (*sure, *same))]

    @property
    def names_right(self) -> bool:
        """Whether it names the true effects, and otherwise only other properties of the rig."""
        found, also = frozenset(self.found), frozenset(self.truth.also)
        return any(names <= found <= names | also for names in self._laws)

    @property
    def contains(self) -> bool:
        """Whether it is exact, or its possible effects include the truth and all that it names."""
        if self.verdict in NAMING:
            return self.names_right
        if self.verdict != "ambiguous":
            return False
        sizes = {len(names) for names in self._laws if names <= self.possible}
        return len(self.found) in sizes

    @property
    def wrong(self) -> bool:
        """Whether it names an effect with certainty that is not true."""
        return self.verdict in NAMING and not self.exact

    @property
    def stage_right(self) -> bool:
        """Whether its faulty stages are exactly the true ones."""
        known = [self.truth.stages, *(one.stages for one in self.truth.readings)]
        return self.guilty in [frozenset(stages) for stages in known]

    def shares(self, stage: str) -> list[tuple[float, float]]:
        """Return each true effect's share of a stage's power, as diagnosed and true.

        Two effects with one name in the diagnosis, such as a stiffening bend and a bend beside it,
        are added.
        """
        true = self.truth.budget[stage]
        within = self.truth.names - self.found.keys()
        if within and self.found and self.found.keys() <= self.truth.names:
            return [(sum(self.share(stage, name) for name in true), sum(true.values()))]
        return [(self.share(stage, name), share) for name, share in true.items()]

    def share(self, stage: str, effect: str) -> float:
        """Return the diagnosed share of a stage's power of an effect, in any equivalent reading."""
        shares = self.budget.get(stage, {})
        if effect in self.found:
            return shares.get(effect, 0.0)
        others = frozenset(self.found) - self.truth.names
        return sum(share for name, share in shares.items() if name in others)

    def interval(self, effect: str, parameter: str) -> Interval | None:
        """Return the interval of a true effect's parameter, in any equivalent reading.

        In an alternative, which is another law, a parameter of the same name has another meaning.
        """
        others = sorted({*self.found} & self._known - self.truth.names)
        names = [effect] if effect in self.found else others
        found = (self.found[name].intervals.get(parameter) for name in names)
        return next((interval for interval in found if interval is not None), None)


def read_answers(folder: Path, key: Key) -> list[Answer]:
    """Return an answer for each record of the key. Raises InputError."""
    if not folder.is_dir():
        raise InputError(folder, "", "is no folder; give that of the diagnoses, rNNN.json each")
    whole = read_deck(key.version).whole is not None
    records = key.records.items()
    answers = [_read(folder / f"{name}.json", truth, whole) for name, truth in records]
    if all(answer.verdict == MISSING for answer in answers):
        raise InputError(folder, "", "holds no diagnosis of any record of the key (rNNN.json)")
    return answers


def _read(path: Path, truth: Truth, whole: bool) -> Answer:
    """Return the answer of a file; of a `whole` aircraft its effects have their controls."""
    nothing: frozenset[str] = frozenset()
    if not path.is_file():
        return Answer(path.stem, truth, MISSING, {}, nothing, nothing, nothing, None)
    kept = diagnosis_from(read_json(path, "a diagnosis is wanted"), path)
    rig = truth.rig if kept.made.rig is None else kept.made.rig
    if rig != truth.rig:
        raise InputError(path, "made.rig", f"is {rig}, in the key {truth.rig}: give this set's key")
    owners = {effect.name: effect.control if whole else None for effect in kept.effects}
    found = {placed(one.name, one.control if whole else None): _found(one) for one in kept.effects}
    rivals = [[placed(name, owners.get(group[0])) for name in group] for group in kept.rivals]
    return Answer(
        path.stem,
        truth,
        kept.verdict,
        found,
        frozenset(found).union(*rivals),
        frozenset(name for name, stage in kept.stages.items() if stage.guilty),
        frozenset(channel for stage in kept.stages.values() for channel in stage.missing),
        kept.shrink.closed,
        kept.budget,
    )


def _found(effect: KeptEffect) -> FoundEffect:
    intervals = {name: Interval(one.low, one.high) for name, one in effect.parameters.items()}
    return FoundEffect(effect.probability, intervals)
