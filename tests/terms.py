"""Each aerodynamic function of a model scaled by 0.7 in turn, by editing its XML, and diagnosed.

    python -m tests.terms c172p        every function with 1 % of its axis or more
    python -m tests.terms c172p Clp Cnr        those whose names end so

A flight has a doublet and a 3-2-1-1 on each control, 40 s long, with sensor noise. Its surfaces and
motion are diagnosed with `terms`. Prints a row a function: its answers with probabilities, and
whether it was named, alone or in a group that the record does not distinguish.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from coupled.flight import loop
from coupled.flight.airframe import main_file
from coupled.flight.modeltext import functions_of
from coupled.gap.diagnose import diagnose
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.flown import fly_force
from coupled.gap.stages.terms import large_terms
from coupled.record.channels import CONTROL_NAMES, ControlName, noisy_channels
from coupled.record.record import Record
from coupled.resources import shipped_rigs
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from tests.support.models import edited_model, scaled_term

FACTOR = 0.7
SIZES_N: Mapping[str, Mapping[ControlName, float]] = {
    "c172p": {"column": 15.0, "wheel": 8.0, "pedals": 60.0},
    "t37": {"column": 25.0, "wheel": 15.0, "pedals": 100.0},
    "737": {"column": 60.0, "wheel": 30.0, "pedals": 160.0},
}
PULSES_s = ((1.0, 1), (1.0, -1), (4.0, 0), (2.1, 1), (1.4, -1), (0.7, 1), (0.7, -1))
# Standard deviations of white noise, by the end of a channel's name, and of single channels.
NOISE = {"_N": 0.1, "_m": 5e-5, "_Pa": 10.0, "_rad": 3e-4, "_s": 3e-4, "factor": 3e-3}
ITS_OWN = {"true_airspeed_m_per_s": 0.1, "altitude_m": 0.3, "wheel_deflection_rad": 1e-3}


def noisy(rig: Rig) -> Rig:
    """Return a rig with sensor noise on all channels."""
    channels = noisy_channels(list(rig.controls), flown=True)
    ends = {name: next(v for end, v in NOISE.items() if name.endswith(end)) for name in channels}
    return rig.changed({"noise": {**ends, **{n: v for n, v in ITS_OWN.items() if n in ends}}})


def pulses(
    rig: Rig, sizes_N: Mapping[ControlName, float], long_s: float = 40.0
) -> dict[ControlName, NDArray[np.float64]]:
    """Return a doublet and a 3-2-1-1 on each control, one control after the other, N."""
    t = np.arange(round(long_s * rig.frame_rate)) / rig.frame_rate
    made = {}
    for i, control in enumerate(rig.controls):
        force, at = np.zeros_like(t), 2.0 + (long_s - 3.0) / 3.0 * i
        for length, sign in PULSES_s:
            force += sign * np.clip((t - at) / 0.15, 0.0, 1.0)
            force -= sign * np.clip((t - at - length) / 0.15, 0.0, 1.0)
            at += length
        made[control] = sizes_N[control] * force
    return made


def flown(folder: Path, rig: Rig, name: str, term: str, factor: float = FACTOR) -> Record:
    """Return the record of a rig whose model has one function scaled by editing its XML."""
    assert rig.flight is not None
    models = edited_model(folder, rig.flight.model, scaled_term(term, factor))
    with patch.object(loop, "aircraft_folder", lambda: models):
        return motion_of(fly_force(noisy(rig), pulses(rig, SIZES_N[name]), seed=3))


def motion_of(record: Record) -> Record:
    """Return a record's surfaces and motion alone."""
    at = [i for i, name in enumerate(record.channels) if not name.startswith(CONTROL_NAMES)]
    return Record(tuple(record.channels[i] for i in at), record.data[:, at], record.manifest)


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
    healthy = motion_of(fly_force(noisy(rig), pulses(rig, SIZES_N[name]), seed=3))
    for term in sorted(large_terms(rig, healthy, axes)):
        if ends and not term.endswith(ends):
            continue
        with TemporaryDirectory() as folder:
            record = flown(Path(folder), rig, name, term)
        print(row(term, diagnose(rig, {"r": record}, "column", terms=True)), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], tuple(sys.argv[2:]))
