"""The authority map of a rig: loss over q̄ and deflection, flown range, and stick forces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from coupled.authority.maps import Feel, LossMap, envelope, feel, loss_maps, shipped_flights
from coupled.display import percent
from coupled.record.channels import ControlName, unit_of
from coupled.record.record import Record
from coupled.results import TableResult, frame_of
from coupled.rig.rig import Rig

if TYPE_CHECKING:
    import polars as pl

Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True, repr=False)
class AuthorityMap(TableResult):
    """The authority loss over q̄ and deflection, the flown range, and the stick forces (`feel`).

    `losses` has the maps of each control, `flown` q̄ in Pa and deflection in d, shape (2, points).
    `feel` is None without level trim of a column.
    """

    rig: Rig
    losses: Mapping[ControlName, Sequence[LossMap]]
    flown: Mapping[ControlName, Floats]
    feel: Feel | None

    def __repr__(self) -> str:
        greatest = {
            name: max(float(np.nanmax(each.loss)) for each in maps if np.isfinite(each.loss).any())
            for name, maps in self.losses.items()
            if any(np.isfinite(each.loss).any() for each in maps)
        }
        most = ", ".join(f"{name} up to {percent(loss)}" for name, loss in greatest.items())
        return f"AuthorityMap({self.rig.name}: lost {most})"

    def to_polars(self) -> pl.DataFrame:
        """Return the losses, one row per point; the unit of the deflection is in a column."""
        rows = [
            {
                "control": one.control,
                "configuration": one.configuration,
                "dynamic_pressure_Pa": float(q),
                "deflection": float(d),
                "deflection_unit": unit_of(one.control),
                "loss": float(one.loss[i, j]),
            }
            for maps in self.losses.values()
            for one in maps
            for i, q in enumerate(one.pressure_Pa)
            for j, d in enumerate(one.deflection)
        ]
        return frame_of(rows).fill_nan(None)


def map_rig(
    rig: Rig, records: Sequence[Record] | None = None, progress: Progress | None = None
) -> AuthorityMap:
    """Return the maps of a rig; the flown range is of `records`, or of the rig's shipped runs."""

    def tell(what: str, done: int, total: int) -> None:
        if progress is not None:
            progress(what, done, total)

    rig.check_controlled(rig.file)
    flown = shipped_flights(rig, tell) if records is None else list(records)
    felt = feel(rig, Path(rig.place), tell)
    maps = {}
    for done, name in enumerate(rig.controls):
        tell(f"{name}: losses over q̄ and deflection", done, len(rig.controls))
        maps[name] = loss_maps(rig, name)
    return AuthorityMap(rig, maps, {name: envelope(flown, name) for name in rig.controls}, felt)
