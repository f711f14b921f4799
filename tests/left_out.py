"""What is said of each single effect by a library without it, and without its nested laws.

    python -m tests.left_out        every effect of `tests.support.singles`
    python -m tests.left_out bend breakout        some of them

A fault that the library lacks should be left unexplained, unless another effect is equivalent to
it within the noise. Prints a row an effect: the verdict, the effects with their probabilities, and
each faulty stage's gap without and with them.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from coupled.gap import prepare
from coupled.gap.diagnose import diagnose
from coupled.gap.effects.effect import Effect, contains
from coupled.gap.effects.library import BY_NAME, library_of
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.thresholds import CERTAIN
from tests.support.gaps import made, nominal_rig
from tests.support.singles import SINGLES


def without(flown: bool, name: str, values: dict[str, float]) -> Diagnosis:
    """Return the diagnosis of an effect by a library without it and its nested laws."""
    lacking, nominal = BY_NAME[name], nominal_rig(flown)

    def is_other(one: Effect) -> bool:
        nested = contains(one, lacking) or contains(lacking, one)
        return one.name != name and not nested

    with TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(prepare, "library_of", lambda *asked: [*filter(is_other, library_of(*asked))])
        return diagnose(nominal, {"r": made(Path(folder), nominal, {name: values}, 4)}, "column")


def answer(found: Diagnosis) -> str:
    """Return how a diagnosis counts: unexplained, equivalent within the noise, or wrong."""
    sure = any(effect.probability >= CERTAIN for effect in found.effects)
    if found.verdict in ("effect", "ambiguous"):
        return "equivalent"
    return "wrong" if sure else "unexplained"


def main(asked: list[str]) -> None:
    """Print the table, and how many rows count as what."""
    counts = dict[str, int]()
    for flown, name, values in SINGLES:
        if asked and name not in asked:
            continue
        found = without(flown, name, values)
        said = answer(found)
        counts[said] = counts.get(said, 0) + 1
        effects = ", ".join(f"{one.name} {one.probability:.2f}" for one in found.effects)
        judged = (one for one in found.stages if one.guilty and one.left is not None)
        gaps = ", ".join(f"{one.name} {one.gap:.1f} to {one.left:.1f}" for one in judged)
        print(f"{name}| {said}| {effects}| {gaps}", flush=True)
    print(counts)


if __name__ == "__main__":
    main(sys.argv[1:])
