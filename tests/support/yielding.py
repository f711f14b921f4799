"""Diagnoses of a twin's presliding friction, over friction and presliding length.

`python -m tests.support.yielding` prints a table: the effect found, its probability, and the error
of the friction. `--laws` adds LuGre's bristles, and elastoplastic ones with three shares.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np

from coupled.blind.trials.deck import read_deck
from coupled.blind.twin.kernel import NODES
from coupled.blind.twin.setting import draw_setting
from coupled.blind.twin.twin import Bristles, fly_twin, nominal_twin, set_friction
from coupled.gap.diagnose import diagnose
from coupled.gap.findings.diagnosis import Diagnosis

FRICTIONS_N = (1.0, 2.0, 4.0, 8.0, 12.0)
TRAVELS_m = (5e-6, 2e-5, 5e-5, 1e-4, 2e-4, 3.5e-4, 5e-4)
SHARES = (0.05, 0.3, 0.8)  # of the bristles' length, bent before any of it slips
LAWS = {"coulomb_friction", "presliding_friction"}
LEVEL_N = 60.0  # of the pilot's force
LONGEST_s = 30.0


@dataclass(frozen=True)
class Case:
    """A friction in N, a presliding length in m, and its elastic share."""

    friction_N: float
    travel_m: float
    elastic_share: float


def cases() -> list[Case]:
    """Return each friction at each length, with the elastic shares in turn."""
    return [
        Case(friction, travel, SHARES[(i + j) % len(SHARES)])
        for i, friction in enumerate(FRICTIONS_N)
        for j, travel in enumerate(TRAVELS_m)
    ]


def found_of(case: Case) -> Diagnosis:
    """Return the diagnosis of 20 to 30 s of a bench with this friction.

    The record is by the twin's own integrator.
    """
    rig = read_deck(2).rigs["bench-rigid"]
    seed = [9, round(10.0 * case.friction_N), round(1e6 * case.travel_m)]
    setting = draw_setting(np.random.default_rng(seed), rig)
    frames = min(setting.frames, round(LONGEST_s * rig.frame_rate))
    twin = nominal_twin(rig)
    running = rig.controls["column"].loader.friction + case.friction_N
    bristles = Bristles(case.travel_m, elastic_share=case.elastic_share)
    set_friction(twin, running, running, 0.002, bristles)
    force = LEVEL_N * setting.shape[: frames * NODES + 1]
    pressures = None if setting.pressures is None else setting.pressures[:frames]
    record = fly_twin(rig, twin, force, frames, pressures, setting.noise[:frames])
    return diagnose(rig, {"r.csv": record})


def row(case: Case, found: Diagnosis) -> str:
    """Return a case's line of the table."""
    begun = f"{case.friction_N:4.0f} {1e6 * case.travel_m:5.0f} {case.elastic_share:5.2f}"
    if not found.effects:
        return f"{begun}  {found.verdict}"
    named = " + ".join(effect.name for effect in found.effects)
    law = next((effect for effect in found.effects if effect.name in LAWS), found.effects[0])
    number = law.parameters[0]
    off = 100.0 * (number.value / case.friction_N - 1.0)
    held = "in" if (number.low or 0.0) <= case.friction_N <= (number.high or np.inf) else "out"
    gap = f"{found.stage('loader').gap:5.1f} → {found.stage('loader').left:.2f}"
    rivals = "; ".join(" or ".join(names) for names in found.rivals)
    return (
        f"{begun}  {found.verdict:11} {law.probability:.2f} {off:+5.1f} % {held:3} {gap}  "
        f"{named}{' (' + rivals + ')' if rivals else ''}"
    )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--friction", type=float, help="only this friction, N")
    parser.add_argument("--travel", type=float, help="only this length, μm")
    given = parser.parse_args()
    print("   N    μm share  verdict     prob.  value off, interval, gap, named", flush=True)
    for case in cases():
        if given.friction is not None and case.friction_N != given.friction:
            continue
        if given.travel is not None and abs(1e6 * case.travel_m - given.travel) > 0.5:
            continue
        print(row(case, found_of(case)), flush=True)


if __name__ == "__main__":
    main()
