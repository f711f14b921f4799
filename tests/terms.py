"""Each aerodynamic function of a model scaled by 0.7 in turn, by editing its XML, and diagnosed.

    python -m tests.terms c172p        every function with 1 % of its axis or more
    python -m tests.terms c172p Clp Cnr        those whose names end so

A flight has a doublet and a 3-2-1-1 on each control, 40 s long, with sensor noise. Its surfaces and
motion are diagnosed with `terms`. Prints a row a function: its answers with probabilities, and
whether it was named, alone or in a group that the record does not distinguish.
"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from coupled.flight.airframe import main_file
from coupled.flight.modeltext import functions_of
from coupled.gap.diagnose import diagnose
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.flown import fly_force
from coupled.gap.stages.tried import large_terms
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from tests.support.airframes import flown, motion_of, noisy, pulses

FACTOR = 0.7


def row(term: str, found: Diagnosis) -> str:
    """Return a row of the table: the term, the answer, and whether it is right."""
    said = []
    right = "no"
    for effect in found.effects:
        (p,) = effect.parameters
        group = next((g for g in found.rivals if g[0] == effect.name), (effect.name,))
        others = "".join(f" or {one.removeprefix('term ')}" for one in group[1:])
        said.append(f"{effect.of or effect.name}{others} {p.value:.3f} ({effect.probability:.2f})")
        inside = p.low is not None and p.high is not None and p.low <= FACTOR <= p.high
        if effect.of == term:
            right = "yes" if inside else "outside its interval"
        elif f"term {term}" in group:
            right = "in its group"
    return f"{term}| {found.verdict}| {'; '.join(said)}| {right}"


def main(name: str, ends: tuple[str, ...]) -> None:
    """Print the table of a shipped rig's model."""
    rig = read_rig(shipped_rigs()[name])
    assert rig.flight is not None
    axes = functions_of(main_file(rig.flight))
    healthy = motion_of(fly_force(noisy(rig), pulses(rig), seed=3))
    for term in sorted(large_terms(rig, healthy, axes)):
        if ends and not term.endswith(ends):
            continue
        with TemporaryDirectory() as folder:
            record = motion_of(flown(Path(folder), rig, term, FACTOR))
        print(row(term, diagnose(rig, {"r": record}, "column", terms=True)), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], tuple(sys.argv[2:]))
