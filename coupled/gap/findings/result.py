"""The result of a diagnosis, and its JSON.

`as_dict` of each part returns its JSON. The keys are those of the contract. SI units; a gap is a
residual's RMS over its noise floor.

Read back, the keys that other parts of the package use are checked, and other keys ignored.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from coupled.arguments import public
from coupled.errors import InputError
from coupled.files import check_format
from coupled.gap.effects.airframe import TERM
from coupled.gap.effects.effect import dotted
from coupled.gap.findings.budget import StageBudget
from coupled.gap.findings.credibility import Credibility, remainder
from coupled.gap.findings.where import Remains, Where
from coupled.gap.search.course import Course
from coupled.gap.signals.output import HiddenGap, explained_below
from coupled.gap.thresholds import FAULTY_FROM
from coupled.schema import Lenient, quantity, read_as

# Of the JSON. A file without a format is read as one from before formats were numbered; a newer
# format is refused (`files.check_format`).
FORMAT = 3
# Stages whose laws have an error of their own: a host's schedule and a model's motion have none.
OF_THE_MACHINE = ("loader", "linkage", "surface")
Verdict = Literal["no_gap", "effect", "mostly", "ambiguous", "unexplained"]


def labelled(name: str, control: str | None) -> str:
    """Return an effect's name for people; with its control, if given."""
    words = name.replace("_", " ")
    return f"{control} {words}" if control else words


def placed(stage: str, control: str | None) -> str:
    """Return a stage's name among those of several controls; of one control, the stage's own."""
    return f"{control}.{stage}" if control else stage


@dataclass(frozen=True)
class StageResult:
    """One stage. `gap` is None if it was not judged, for lack of `missing` or for the reason `why`.

    `settled` is the gap with fitted nuisance parameters, `left` that with the effects found,
    `limit` the largest gap of noise alone. `shown_in` are the stages in which a fault of this one
    shows, if it has no residual of its own. `hidden`: its noise floor could hide a gap; it is
    `guilty` only if it changed since the healthy records.
    """

    name: str
    gap: float | None = None
    settled: float | None = None
    limit: float | None = None
    left: float | None = None
    guilty: bool = False
    where: Where | None = None
    remains: Remains | None = None
    missing: tuple[str, ...] = ()
    why: str = ""
    shown_in: tuple[str, ...] = ()
    hidden: HiddenGap | None = None

    @property
    def judged(self) -> bool:
        """Whether the record let the stage be judged."""
        return self.gap is not None

    @property
    def explained_below(self) -> float:
        """The gap up to which the effects found explain the stage."""
        if self.settled is None or self.limit is None:
            return FAULTY_FROM if self.limit is None else self.limit
        return explained_below(self.settled, self.limit)

    @property
    def unexplained(self) -> bool:
        """Whether the gap that remains exceeds that of an explained stage."""
        return self.left is not None and self.left > self.explained_below

    def remainder(self, without: float) -> float:
        """Return the weight of the remaining residual as evidence against an effect.

        `without` is the gap without this effect, beside the others (`credibility`).
        """
        if self.left is None or self.settled is None:
            return 0.0
        own = 1.0
        if self.remains is not None and self.name in OF_THE_MACHINE:
            own = self.left * math.sqrt(1.0 - self.remains.free_share)
        gap = min(self.settled, without)
        limit = FAULTY_FROM if self.limit is None else self.limit
        return remainder(gap, self.left, explained_below(gap, limit), own)

    @property
    def within_settings(self) -> bool:
        """Whether the gap exceeds its limit only by nuisance parameters within their tolerance."""
        if self.gap is None or self.settled is None or self.limit is None or self.guilty:
            return False
        return self.settled <= self.limit < self.gap

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        if self.gap is None:
            found: dict[str, Any] = {"judged": False, "missing": list(self.missing)}
            found |= {"why": self.why} if self.why else {}
            found |= {"guilty": True} if self.guilty else {}
            return found | ({} if self.hidden is None else {"floor_share": self.hidden.share})
        found = {"gap": self.gap}
        numbers = {"settled": self.settled, "limit": self.limit, "left": self.left}
        found |= {name: number for name, number in numbers.items() if number is not None}
        found["guilty"] = self.guilty
        described = {"where": self.where, "remains": self.remains}
        return found | {name: one.as_dict() for name, one in described.items() if one is not None}


@dataclass(frozen=True)
class ParameterEstimate:
    """A parameter with its 95 % interval; a bound is None if the records do not determine it.

    `filed` is the value of `key` in the rig file, in `unit`, None if the rig has none; `found` its
    estimate, with the interval `found_low` to `found_high`. `value`, with `low` and `high`, is the
    effect's own parameter: that number, a factor on it, or an addition to it. `host` is the host's
    name of the number, if any. `relative`: the change is stated as a share of the filed value.
    """

    name: str
    value: float
    low: float | None
    high: float | None
    key: str = ""
    unit: str = ""
    filed: float | None = None
    found: float = 0.0
    found_low: float | None = None
    found_high: float | None = None
    host: str = ""
    relative: bool = False

    def interval(self, written: Callable[[float], str]) -> str:
        """Return the 95 % interval of the rig's own number in words; none where it is open."""
        if self.found_low is None:
            return ""
        if self.found_high is None:
            return f"{written(self.found_low)} or more"
        return f"{written(self.found_low)} to {written(self.found_high)}"

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        own = {"value": self.value, "low": self.low, "high": self.high}
        return own | {"key": self.key, "filed": self.filed, "found": self.found}


@dataclass(frozen=True)
class EffectResult:
    """An effect found, and the probability that it is the cause; `of`: its aerodynamic function."""

    name: str
    stage: str
    probability: float
    parameters: tuple[ParameterEstimate, ...]
    credibility: Credibility | None = None
    course: Course | None = None
    of: str = ""
    control: str | None = None  # where several are judged; None for the airframe

    @property
    def label(self) -> str:
        """Its name for people, with its control where several are judged."""
        return labelled(self.name, self.control)

    @property
    def place(self) -> str:
        """Its stage, with its control where several are judged: `linkage` or `column.linkage`."""
        return placed(self.stage, self.control)

    @property
    def value(self) -> float | None:
        """The value of its first parameter; None if it has none (a discrete effect)."""
        return self.parameters[0].value if self.parameters else None

    def key_of(self, parameter: ParameterEstimate) -> str:
        """Return a parameter's key in the rig file; with its control where several are judged."""
        return dotted(parameter.key, self.control) if self.control else parameter.key

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        named = {"property": {"value": self.of, "low": None, "high": None}} if self.of else {}
        found: dict[str, Any] = {
            "name": TERM if self.of else self.name,
            "stage": self.stage,
            "probability": self.probability,
            "parameters": named | {p.name: p.as_dict() for p in self.parameters},
        }
        tests = {"course": self.course, "credibility": self.credibility}
        return found | {name: one.as_dict() for name, one in tests.items() if one is not None}


@dataclass(frozen=True)
class SettingResult:
    """A fitted nuisance parameter, as a factor on its nominal value.

    `yields` is the presliding length instead, m or rad, of friction without a filed stiffness;
    `late_s` the delay of a time stamp.
    """

    name: str
    stage: str
    factor: float = 1.0
    yields: float | None = None
    late_s: float | None = None

    @property
    def value(self) -> float | None:
        """The number that is reported in place of a factor, if any."""
        return self.yields if self.late_s is None else self.late_s

    @property
    def moved(self) -> bool:
        """Whether the deviation is large enough to show in `words`."""
        off = self.factor - 1.0 if self.late_s is None else 10.0 * self.late_s
        return self.yields is not None or abs(off) >= 5e-4

    @property
    def words(self) -> str:
        """The deviation in words."""
        if self.late_s is not None:
            late = f"{1e3 * abs(self.late_s):.2g} ms {'late' if self.late_s > 0.0 else 'early'}"
            return f"{self.name.split('_')[0]} that is stamped {late}"
        if self.yields is None:
            return f"{self.name.replace('_', ' ')} {100 * (self.factor - 1):+.1f} %"
        unit = "mrad" if self.name.endswith("rad") else "mm"
        return f"friction that yields by {1e3 * self.yields:.2g} {unit} before it slips"


@dataclass(frozen=True)
class Findings:
    """The results of a diagnosis: verdict, stages, effects and budget.

    `control` may be `airframe`. `stages` are in the order of the chain, `effects` with the largest
    first; `rivals` are groups of effects that the records do not distinguish.
    """

    control: str
    verdict: Verdict
    stages: tuple[StageResult, ...]
    effects: tuple[EffectResult, ...]
    rivals: tuple[tuple[str, ...], ...]
    settings: tuple[SettingResult, ...]
    budget: tuple[StageBudget, ...]

    @public
    def stage(self, name: str) -> StageResult:
        """Return a stage by its name; KeyError if the results do not have it."""
        for stage in self.stages:
            if stage.name == name:
                return stage
        raise KeyError(name)

    @property
    def guilty(self) -> tuple[str, ...]:
        """The names of the faulty stages."""
        return tuple(stage.name for stage in self.stages if stage.guilty)


# `refused` and `failed` are verdicts of records that could not be diagnosed.
AnyVerdict = Literal[Verdict, "refused", "failed"]


class KeptParameter(Lenient):
    """A parameter of an effect, SI; a bound of its 95 % interval is None if it is open."""

    value: float | str | None = None
    low: float | None = None
    high: float | None = None


class KeptEffect(Lenient):
    """An effect found."""

    name: str
    probability: float = quantity("", ge=0, le=1)
    control: str | None = None
    parameters: dict[str, KeptParameter] = {}


class KeptStage(Lenient):
    """A stage, judged or not."""

    guilty: bool = False
    missing: list[str] = []


class KeptShrink(Lenient):
    """The reduction of the gap by the effects found."""

    closed: float | None = None


class KeptMade(Lenient):
    """The inputs of the diagnosis."""

    rig: str | None = None


class KeptDiagnosis(Lenient):
    """The JSON of a diagnosis."""

    verdict: AnyVerdict
    effects: list[KeptEffect]
    stages: dict[str, KeptStage]
    rivals: list[list[str]] = []
    shrink: KeptShrink = KeptShrink()
    budget: dict[str, dict[str, float]] = {}
    made: KeptMade = KeptMade()
    why: str = ""


def diagnosis_from(table: Any, file: object) -> KeptDiagnosis:
    """Return the diagnosis that a JSON file holds. Raises InputError, naming file and key."""
    if not isinstance(table, dict):
        raise InputError(file, "", "is not a diagnosis written by coupled diagnose")
    check_format(table.get("format"), FORMAT, file, "diagnosis")
    return read_as(KeptDiagnosis, table, file)
