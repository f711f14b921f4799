"""A diagnosis read back from its JSON: the keys that other parts of the package use, checked.

Other keys are ignored (docs/diagnosis.md).
"""

from __future__ import annotations

from typing import Any, Literal

from coupled.errors import InputError
from coupled.files import check_format
from coupled.gap.findings.result import FORMAT
from coupled.schema import Lenient, quantity, read_as

# `refused` and `failed` are verdicts of records that could not be diagnosed.
AnyVerdict = Literal["no_gap", "effect", "mostly", "ambiguous", "unexplained", "refused", "failed"]


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
