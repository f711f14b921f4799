"""Opened trials of `coupled blind make`."""

from __future__ import annotations

from coupled.blind.trials.answers import Answer


def is_right(answer: Answer) -> bool:
    """Tell whether an answer is right by its record's kind."""
    wanted = {"none": "no_gap", "outsider": "unexplained"}.get(answer.truth.category)
    return answer.exact if wanted is None else answer.verdict == wanted
