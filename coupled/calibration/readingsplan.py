"""A plan of readings with its precision, and the precision of reading grids."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from coupled.calibration.crossforces import crossed_forces, crossed_precision
from coupled.calibration.estimate import Instruments
from coupled.calibration.form import form
from coupled.calibration.plan import (
    STRONGEST_N,
    DeflectionNeeds,
    Precision,
    Station,
    deflection_needs,
    fewest,
    precision,
    stations,
)
from coupled.display import System
from coupled.record.channels import ControlName
from coupled.results import Displayed, Tabular, frame_of
from coupled.rig.rig import Rig

if TYPE_CHECKING:
    import polars as pl

Progress = Callable[[str, int, int], None]
_SIZES = [(few, many) for few in range(2, 7) for many in range(2, 7)]


@dataclass(frozen=True, repr=False)
class ReadingsPlan(Displayed, Tabular):
    """The readings that give K to a precision, by station, and the number of each.

    `grids` is the precision of grids of (gradients, deflections); `others` half the 95 % interval
    of the bend by each other control, in d/N, if forces are held on them.
    """

    rig: Rig
    control: ControlName
    chosen: tuple[tuple[Station, int], ...]
    reached: Precision
    needs: DeflectionNeeds
    grids: Mapping[tuple[int, int], Precision]
    others: Mapping[str, float]
    held: Mapping[ControlName, list[float]]
    looks: int

    def __repr__(self) -> str:
        count, half = self.reached.readings, self.reached.half_width
        return f"ReadingsPlan({self.control}: {count} readings give K to ±{100 * half:.1f} %)"

    def form(self, system: System = "si") -> str:
        """Return the CSV form of the plan, in the units of a system."""
        return form(self.chosen, self.control, self.looks, self.held, system)

    def as_dict(self) -> dict[str, Any]:
        """Return the plan as JSON data."""
        table: dict[str, Any] = {
            "half_width": self.reached.half_width,
            "bend": self.reached.bend,
            "deflection": asdict(self.needs),
            "readings": [{**station.__dict__, "count": n} for station, n in self.chosen],
            "grids": [
                {"gradients": few, "deflections": many, "half_width": grid.half_width}
                for (few, many), grid in self.grids.items()
            ],
        }
        return table | ({"bend_by_others_half_width": dict(self.others)} if self.held else {})

    def to_polars(self) -> pl.DataFrame:
        """Return one row per station: q̄ in Pa, gradient in N/d, deflection in d, force in N."""
        return frame_of(self.as_dict()["readings"])


def plan_readings(
    rig: Rig,
    control: ControlName,
    instruments: Instruments,
    share: float,
    strongest_N: float = STRONGEST_N,
    looks: int = 2,
    crossed_N: float = 0.0,
    progress: Progress | None = None,
) -> ReadingsPlan:
    """Return the fewest readings whose 95 % interval of K is ± `share` of it.

    `looks` is the number of readings of ruler and scale; `crossed_N` is held on each other control.
    """
    grids = {}
    for done, (few, many) in enumerate(_SIZES):
        if progress is not None:
            progress(f"{few} gradients by {many} deflections", done, len(_SIZES))
        grid = stations(rig, control, few, many, strongest_N)
        grids[few, many] = precision(rig, control, grid, instruments, looks)
    if progress is not None:
        progress("the fewest readings that reach it", len(_SIZES), len(_SIZES))
    chosen = fewest(rig, control, instruments, share, strongest_N, looks)
    design = [station for station, count in chosen for _ in range(count)]
    held = crossed_forces(rig, control, len(design), crossed_N)
    others: Mapping[str, float] = {}
    if held:
        others = crossed_precision(rig, control, design, crossed_N, instruments, looks)
    reached = precision(rig, control, design, instruments, looks)
    needs = deflection_needs(rig, control, design, instruments, looks)
    return ReadingsPlan(rig, control, tuple(chosen), reached, needs, grids, others, held, looks)
