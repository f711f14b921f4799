"""The score of a set of diagnoses as data and JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Share:
    """A share, and its exact 95 % interval; None if the total is zero."""

    right: int
    of: int
    share: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class ClearSingles:
    """Single effects that at least double their stage's residual."""

    named: Share
    named_or_in_the_set: Share
    stage: Share
    wrong: Share


@dataclass(frozen=True)
class FaintSingles:
    """Single effects with a smaller gap."""

    right: Share
    no_gap: Share
    undecided: Share
    wrong: Share


@dataclass(frozen=True)
class Outsiders:
    """Faults outside the library."""

    unexplained: Share
    stage: Share
    false_attributions: Share


@dataclass(frozen=True)
class Pairs:
    """Two effects at once."""

    whole: Share
    whole_or_in_the_set: Share
    stages: Share


@dataclass(frozen=True)
class Intervals:
    """The share of parameters' intervals that contain the truth, and how many are open."""

    covered: Share
    without_interval: int


@dataclass(frozen=True)
class Reliability:
    """Effects of similar stated probability, and the share of them that is true."""

    stated: float
    true: Share


@dataclass(frozen=True)
class Probabilities:
    """Brier score and reliability of the stated probabilities; None if no effect was found."""

    brier: float | None
    effects: int
    bins: tuple[Reliability, ...]


@dataclass(frozen=True)
class Power:
    """Single effects of similar size: the bin's lower ratio, their median, and the share named."""

    least: float
    ratio: float
    wrong: int
    named: Share


@dataclass(frozen=True)
class ByEffect:
    """The number of right answers for an effect or outsider, and the wrong answers."""

    right: int
    of: int
    instead: Mapping[str, int]


@dataclass(frozen=True)
class Score:
    """The whole score."""

    records: int
    missing: int
    clear_singles: ClearSingles
    faint_singles: FaintSingles
    false_alarms: Share
    outsiders: Outsiders
    pairs: Pairs
    lack_said: Share
    intervals: Intervals
    budget: Share
    closed: Share
    probabilities: Probabilities
    power: tuple[Power, ...]
    effects: Mapping[str, ByEffect]

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        stated = self.probabilities
        return {
            "records": self.records,
            "missing": self.missing,
            "clear_singles": asdict(self.clear_singles),
            "faint_singles": asdict(self.faint_singles),
            "no_gap": {"false_alarms": asdict(self.false_alarms)},
            "outsiders": asdict(self.outsiders),
            "pairs": asdict(self.pairs),
            "lacking": {"lack_said": asdict(self.lack_said)},
            "intervals": asdict(self.intervals),
            "budget": {"within_5_points": asdict(self.budget)},
            "closed": asdict(self.closed),
            "probabilities": {
                "brier": stated.brier,
                "effects": stated.effects,
                "bins": [{"stated": row.stated, **asdict(row.true)} for row in stated.bins],
            },
            "power": [
                {"from": row.least, "ratio": row.ratio, "wrong": row.wrong, **asdict(row.named)}
                for row in self.power
            ],
            "effects": {name: asdict(row) for name, row in self.effects.items()},
        }
