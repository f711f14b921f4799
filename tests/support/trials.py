"""Opened trials of `coupled blind make`."""

from __future__ import annotations

from coupled.blind.trials.answers import Answer


def is_right(answer: Answer) -> bool:
    """Return whether an answer is correct for the kind of its record."""
    wanted = {"none": "no_gap", "outsider": "unexplained"}.get(answer.truth.category)
    return answer.exact if wanted is None else answer.verdict == wanted
