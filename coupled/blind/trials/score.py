"""The score of a set of diagnoses: a share with its exact interval for each thing promised.

A record without a diagnosis is right in nothing; that it is missing is said.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Any

from scipy.stats import beta

from coupled.blind.trials.answers import Answer

CLEAR = 2.0  # a single that at least doubles its stage's residual is to be named
CLOSED = 0.95
SIZES = (0.0, 1.1, 1.3, 1.6, 2.0, 3.0, 5.0, 10.0, 20.0, float("inf"))  # bins of ratio
PROBABILITIES = (0.0, 0.5, 0.7, 0.9, 0.97, 1.0)
Score = dict[str, Any]


def share(right: int, total: int) -> Score:
    """Return a share and its 95 % interval after Clopper and Pearson, None where of nothing."""
    if total == 0:
        return {"right": 0, "of": 0, "share": None, "low": None, "high": None}
    low = float(beta.ppf(0.025, right, total - right + 1)) if right else 0.0
    high = float(beta.ppf(0.975, right + 1, total - right)) if right < total else 1.0
    return {"right": right, "of": total, "share": right / total, "low": low, "high": high}


def _of(answers: Sequence[Answer], test: Callable[[Answer], bool]) -> Score:
    return share(sum(map(test, answers)), len(answers))


def score(answers: Sequence[Answer]) -> Score:
    """Return the whole score as JSON has it."""
    by = {kind: [a for a in answers if a.kind == kind] for kind in _kinds(answers)}
    singles, pairs = by.get("single", []), by.get("pair", [])
    clear = [a for a in singles if a.truth["ratio"] >= CLEAR]
    faint = [a for a in singles if a.truth["ratio"] < CLEAR]
    right = [a for a in (*singles, *pairs) if a.exact]
    return {
        "records": len(answers),
        "missing": sum(a.verdict == "missing" for a in answers),
        "clear_singles": {
            "named": _of(clear, lambda a: a.exact),
            "named_or_in_the_set": _of(clear, lambda a: a.contains),
            "stage": _of(clear, lambda a: a.stage_right),
            "wrong": _of(clear, lambda a: a.wrong),
        },
        "faint_singles": {
            "right": _of(faint, lambda a: a.contains),
            "no_gap": _of(faint, lambda a: a.verdict == "no_gap"),
            "undecided": _of(faint, _undecided),
            "wrong": _of(faint, lambda a: a.wrong),
        },
        "no_gap": {"false_alarms": _of(by.get("none", []), _alarm)},
        "outsiders": {
            "unexplained": _of(by.get("outsider", []), lambda a: a.verdict == "unexplained"),
            "stage": _of(by.get("outsider", []), lambda a: a.stage_right),
            "false_attributions": _of(by.get("outsider", []), lambda a: a.verdict == "effect"),
        },
        "pairs": {
            "whole": _of(pairs, lambda a: a.exact),
            "whole_or_in_the_set": _of(pairs, lambda a: a.contains),
            "stages": _of(pairs, lambda a: a.stage_right),
        },
        "lacking": {
            "lack_said": _of(
                by.get("lacking", []), lambda a: set(a.truth["missing"]) <= set(a.lacking)
            )
        },
        "intervals": _intervals(right),
        "closed": _of(right, lambda a: a.closed is not None and a.closed > CLOSED),
        "probabilities": _probabilities(answers),
        "power": _power(singles),
        "effects": _by_effect([*singles, *by.get("outsider", [])]),
    }


def _kinds(answers: Iterable[Answer]) -> set[str]:
    return {answer.kind for answer in answers}


def _alarm(answer: Answer) -> bool:
    return answer.verdict not in ("no_gap", "missing", "refused")


def _undecided(answer: Answer) -> bool:
    """Tell whether it owns to a gap, but not to a cause, nor to sets that hold the true one."""
    return answer.verdict in ("ambiguous", "unexplained") and not answer.contains


def _intervals(right: Sequence[Answer]) -> Score:
    """Return how often the true parameter lies within its interval, where there is a whole one."""
    covered = total = without = 0
    for answer in right:
        for effect in answer.truth["effects"]:
            told = answer.found.get(effect["name"], {}).get("parameters", {})
            for name, value in effect["parameters"].items():
                low, high = (told.get(name, {}).get(end) for end in ("low", "high"))
                if low is None or high is None:
                    without += 1
                    continue
                total += 1
                covered += bool(low <= value <= high)
    return {"covered": share(covered, total), "without_interval": without}


def _probabilities(answers: Sequence[Answer]) -> Score:
    """Return the Brier score of the probabilities of the effects found, and their reliability."""
    told = [
        (float(effect["probability"]), name in answer.named)
        for answer in answers
        for name, effect in answer.found.items()
    ]
    bins = []
    for low, high in pairwise(PROBABILITIES):
        held = [(p, true) for p, true in told if low <= p < high or p == high == 1.0]
        if held:
            mean = sum(p for p, _ in held) / len(held)
            bins.append({"told": mean, **share(sum(true for _, true in held), len(held))})
    brier = sum((p - true) ** 2 for p, true in told) / len(told) if told else None
    return {"brier": brier, "effects": len(told), "bins": bins}


def _power(singles: Sequence[Answer]) -> list[Score]:
    """Return the share named against how many times the effect widens its stage's residual."""
    found = []
    for low, high in pairwise(SIZES):
        held = [a for a in singles if low <= a.truth["ratio"] < high]
        if held:
            named = _of(held, lambda a: a.exact)
            wrong = sum(a.wrong for a in held)
            middle = sorted(a.truth["ratio"] for a in held)[len(held) // 2]
            found.append({"from": low, "ratio": middle, "wrong": wrong, **named})
    return found


def _by_effect(answers: Sequence[Answer]) -> dict[str, Score]:
    """Return for each kind how often it was answered rightly, and what was said instead.

    A single is held right where named exactly, an outsider where unexplained; faint singles
    are left out.
    """
    found: dict[str, Score] = {}
    for answer in answers:
        if answer.kind == "single" and answer.truth["ratio"] < CLEAR:
            continue
        name = next(iter(answer.named))
        row = found.setdefault(name, {"right": 0, "of": 0, "instead": Counter()})
        right = answer.exact if answer.kind == "single" else answer.verdict == "unexplained"
        row["right"] += right
        row["of"] += 1
        if not right:
            said = answer.verdict
            if answer.found:
                said += ": " + " + ".join(sorted(answer.found))
            row["instead"][said] += 1
    for row in found.values():
        row["instead"] = dict(row["instead"].most_common())
    return dict(sorted(found.items()))
