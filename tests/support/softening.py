"""The flight in which the structure softens by 40 %, with a fixed and with an adapted K̂.

`python -m tests.support.softening` draws docs/softening.png.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from coupled.api.rigs import load_rig
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import FrequencySweep
from coupled.live.host import Host, Plan, Request
from coupled.live.session import fly_live
from coupled.plots.saving import save
from coupled.plots.service import draw_service
from coupled.record.record import Record

SOFTENS_s, TIMES, END_s = 30.0, 1.4, 90.0
NOISE = {"column_force_N": 0.2, "column_computed_m": 2e-5, "column_deflection_m": 2e-5}


class StructureSoftening:
    """Changes the structure's K in flight."""

    def __init__(self, at_s: float, bend: float) -> None:
        self._at_s, self._bend = at_s, bend

    def begin(self, host: Host) -> None:
        self._host = host

    def observe(self, host: Host, k: int) -> None:
        """Do nothing at a frame."""

    def requests(self) -> Sequence[Request]:
        if self._host.time_s < self._at_s:
            return ()
        self._at_s = float("inf")
        return [Request("set", "bend", "column", self._bend)]

    def close(self) -> None:
        """Do nothing."""


def softened(adapt: bool) -> Record:
    """Fly the report's column through a sweep of 40 N; its structure softens in flight."""
    rig = load_rig("report-column").changed({"noise": NOISE})
    sweep = FrequencySweep(force_N=40, duration_s=END_s - 2.0, low_Hz=0.2, high_Hz=0.6)
    saboteur = StructureSoftening(SOFTENS_s, TIMES * rig.controls["column"].loader.bend)
    plan = Plan(paced=False, adapt=adapt, watchers=[saboteur])
    return fly_live(Manoeuvre(rig, {"column": sweep}, END_s), plan).record


def main() -> None:
    """Draw the two flights."""
    figure = draw_service(softened(adapt=False), softened(adapt=True), SOFTENS_s)
    save(figure, Path(__file__).parents[2] / "docs" / "softening.png")


if __name__ == "__main__":
    main()
