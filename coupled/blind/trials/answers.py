"""Diagnoses read back, and each held against the truth of its record."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from coupled.errors import InputError

VERDICTS = ("no_gap", "effect", "ambiguous", "unexplained", "refused")


@dataclass(frozen=True)
class Answer:
    """A record's truth, and what a diagnosis made of it; verdict `missing` where there is none."""

    record: str
    truth: Mapping[str, Any]
    verdict: str
    found: Mapping[str, Mapping[str, Any]]  # the effects of the diagnosis by name
    sets: frozenset[str]  # every name that the diagnosis leaves possible
    guilty: frozenset[str]
    lacking: frozenset[str]  # channels whose lack it says
    closed: float | None

    @property
    def kind(self) -> str:
        """The class of the trial."""
        return str(self.truth["class"])

    @property
    def named(self) -> frozenset[str]:
        """The names of what the rig has."""
        return frozenset(effect["name"] for effect in self.truth["effects"])

    @property
    def exact(self) -> bool:
        """Whether it names what is there, nothing else, and is sure of it.

        Where another effect is the same law on this record, naming just these two is exact.
        """
        if self.verdict == "effect":
            return frozenset(self.found) == self.named
        twins = frozenset(self.truth.get("alike", []))
        return bool(twins) and self.contains and self.sets == self.named | twins

    @property
    def contains(self) -> bool:
        """Whether it is exact, or names no more than it holds possible, the truth among them."""
        if self.verdict == "effect":
            return frozenset(self.found) == self.named
        ambiguous = self.verdict == "ambiguous" and self.named <= self.sets
        return ambiguous and len(self.found) == len(self.named)

    @property
    def wrong(self) -> bool:
        """Whether it is sure of something that is not so."""
        return self.verdict == "effect" and not self.exact

    @property
    def stage_right(self) -> bool:
        """Whether just the stages that have something are guilty."""
        return self.guilty == frozenset(self.truth["stages"])


def read_answers(folder: Path, key: Mapping[str, Any]) -> list[Answer]:
    """Return an answer for each record of the key. Raises InputError."""
    if not folder.is_dir():
        raise InputError(folder, "", "is no folder; give that of the diagnoses, rNNN.json each")
    answers = [_read(folder / f"{name}.json", truth) for name, truth in key["records"].items()]
    if all(answer.verdict == "missing" for answer in answers):
        raise InputError(folder, "", "holds no diagnosis of any record of the key (rNNN.json)")
    return answers


def _read(path: Path, truth: Mapping[str, Any]) -> Answer:
    nothing: frozenset[str] = frozenset()
    if not path.is_file():
        return Answer(path.stem, truth, "missing", {}, nothing, nothing, nothing, None)
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        raise InputError(path, "", "is not JSON; a diagnosis is wanted") from None
    if not isinstance(told, dict) or told.get("verdict") not in VERDICTS:
        raise InputError(path, "verdict", f"is missing or not one of {', '.join(VERDICTS)}")
    try:
        return _answer(path.stem, truth, told)
    except (KeyError, TypeError, AttributeError, ValueError):
        raise InputError(path, "", "is no diagnosis as coupled diagnose writes it") from None


def _answer(name: str, truth: Mapping[str, Any], told: Mapping[str, Any]) -> Answer:
    found = {str(effect["name"]): dict(effect) for effect in told["effects"]}
    for effect in found.values():
        effect["probability"] = min(max(float(effect["probability"]), 0.0), 1.0)
    rivals = {str(rival) for group in told.get("rivals", []) for rival in group}
    stages = told["stages"].items()
    closed = told.get("shrink", {}).get("closed")
    return Answer(
        name,
        truth,
        told["verdict"],
        found,
        frozenset(found) | rivals,
        frozenset(stage for stage, judged in stages if judged.get("guilty")),
        frozenset(c for _, judged in stages for c in judged.get("missing", [])),
        None if closed is None else float(closed),
    )
