"""The score of a set of diagnoses: a share with its exact interval for each claim.

A record without a diagnosis is wrong in everything, and reported as missing.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise

from scipy.stats import beta

from coupled.blind.trials.answers import MISSING, NAMING, Answer
from coupled.blind.trials.result import (
    ByEffect,
    ClearSingles,
    FaintSingles,
    Intervals,
    Outsiders,
    Pairs,
    Power,
    Probabilities,
    Reliability,
    Score,
    Share,
)

CLEAR = 2.0  # a single effect that at least doubles its stage's residual should be named
CLOSED = 0.95
NO_SHARE = 0.01
SHARE_NEAR = 0.05  # of a stage's power, tolerance of a share of the budget
SIZES = (0.0, 1.1, 1.3, 1.6, 2.0, 3.0, 5.0, 10.0, 20.0, float("inf"))  # bins of ratio
PROBABILITIES = (0.0, 0.5, 0.7, 0.9, 0.97, 1.0)


def share(right: int, total: int) -> Share:
    """Return a share and its 95 % interval by Clopper and Pearson, None if the total is zero."""
    if total == 0:
        return Share(0, 0, None, None, None)
    low = float(beta.ppf(0.025, right, total - right + 1)) if right else 0.0
    high = float(beta.ppf(0.975, right + 1, total - right)) if right < total else 1.0
    return Share(right, total, right / total, low, high)


def _of(answers: Sequence[Answer], test: Callable[[Answer], bool]) -> Share:
    return share(sum(map(test, answers)), len(answers))


def score(answers: Sequence[Answer]) -> Score:
    """Return the whole score."""

    def of(category: str) -> list[Answer]:
        return [answer for answer in answers if answer.truth.category == category]

    singles, pairs, outsiders = of("single"), of("pair"), of("outsider")
    clear = [a for a in singles if a.truth.ratio >= CLEAR]
    faint = [a for a in singles if a.truth.ratio < CLEAR]
    right = [a for a in (*singles, *pairs) if a.exact]
    return Score(
        records=len(answers),
        missing=sum(a.verdict == MISSING for a in answers),
        clear_singles=ClearSingles(
            named=_of(clear, lambda a: a.exact),
            named_or_in_the_set=_of(clear, lambda a: a.contains),
            stage=_of(clear, lambda a: a.stage_right),
            wrong=_of(clear, lambda a: a.wrong),
        ),
        faint_singles=FaintSingles(
            right=_of(faint, lambda a: a.contains),
            no_gap=_of(faint, lambda a: a.verdict == "no_gap"),
            undecided=_of(faint, _undecided),
            wrong=_of(faint, lambda a: a.wrong),
        ),
        false_alarms=_of(of("none"), _alarm),
        outsiders=Outsiders(
            unexplained=_of(outsiders, lambda a: a.verdict == "unexplained"),
            stage=_of(outsiders, lambda a: a.stage_right),
            false_attributions=_of(outsiders, lambda a: a.verdict in NAMING),
        ),
        pairs=Pairs(
            whole=_of(pairs, lambda a: a.exact),
            whole_or_in_the_set=_of(pairs, lambda a: a.contains),
            stages=_of(pairs, lambda a: a.stage_right),
        ),
        lack_said=_of(of("lacking"), lambda a: set(a.truth.missing) <= a.lacking),
        intervals=_intervals(right),
        budget=_budget(right),
        closed=_of(right, lambda a: a.closed is not None and a.closed > CLOSED),
        probabilities=_probabilities(answers),
        power=_power(singles),
        effects=_by_effect([*singles, *outsiders]),
    )


def _alarm(answer: Answer) -> bool:
    if answer.verdict in NAMING and answer.found:
        return not answer.names_right
    return answer.verdict not in ("no_gap", MISSING, "refused")


def _undecided(answer: Answer) -> bool:
    """Tell whether it reports a gap without a cause, and without the true one as possible."""
    return answer.verdict in ("ambiguous", "unexplained") and not answer.contains


def _intervals(right: Sequence[Answer]) -> Intervals:
    """Return the coverage of the parameters' intervals, for closed intervals."""
    covered = total = without = 0
    for answer in right:
        for effect in answer.truth.effects:
            for name, value in effect.parameters.items():
                interval = answer.interval(effect.name, name)
                if interval is None or not interval.whole:
                    without += 1
                    continue
                total += 1
                covered += interval.holds(value)
    return Intervals(share(covered, total), without)


def _budget(right: Sequence[Answer]) -> Share:
    """Return how often an effect's share of its stage's power agrees with the twin's own."""
    off = [
        abs(said - true)
        for answer in right
        for stage in answer.truth.budget
        for said, true in answer.shares(stage)
        if abs(true) > NO_SHARE  # it contributes there
    ]
    return share(sum(one <= SHARE_NEAR for one in off), len(off))


def _probabilities(answers: Sequence[Answer]) -> Probabilities:
    """Return the Brier score of the probabilities of the effects found, and their reliability."""
    stated = [
        (effect.probability, name in answer.truth.names)
        for answer in answers
        for name, effect in answer.found.items()
    ]
    bins = []
    for low, high in pairwise(PROBABILITIES):
        held = [(p, true) for p, true in stated if low <= p < high or p == high == 1.0]
        if held:
            mean = sum(p for p, _ in held) / len(held)
            bins.append(Reliability(mean, share(sum(true for _, true in held), len(held))))
    brier = sum((p - true) ** 2 for p, true in stated) / len(stated) if stated else None
    return Probabilities(brier, len(stated), tuple(bins))


def _power(singles: Sequence[Answer]) -> tuple[Power, ...]:
    """Return the share named by the factor by which the effect enlarges its stage's residual."""
    found = []
    for low, high in pairwise(SIZES):
        held = [a for a in singles if low <= a.truth.ratio < high]
        if held:
            middle = sorted(a.truth.ratio for a in held)[len(held) // 2]
            wrong = sum(a.wrong for a in held)
            found.append(Power(low, middle, wrong, _of(held, lambda a: a.exact)))
    return tuple(found)


def _by_effect(answers: Sequence[Answer]) -> dict[str, ByEffect]:
    """Return the number of right answers for each kind, and the wrong answers.

    A single effect is right if named exactly, an outsider if unexplained; faint single effects are
    left out.
    """
    right: Counter[str] = Counter()
    total: Counter[str] = Counter()
    instead: dict[str, Counter[str]] = {}
    for answer in answers:
        single = answer.truth.category == "single"
        if single and answer.truth.ratio < CLEAR:
            continue
        name = answer.truth.effects[0].name
        said = instead.setdefault(name, Counter())
        total[name] += 1
        if answer.exact if single else answer.verdict == "unexplained":
            right[name] += 1
        else:
            said[": ".join(filter(None, (answer.verdict, " + ".join(sorted(answer.found)))))] += 1
    return {
        name: ByEffect(right[name], total[name], dict(instead[name].most_common()))
        for name in sorted(total)
    }
