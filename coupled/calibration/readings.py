"""Readings of one control in SI, as input of the fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from coupled.results import TableResult, frame_of

if TYPE_CHECKING:
    import polars as pl

Floats = NDArray[np.float64]
COLUMNS = ("deflection", "force_N", "v1_V", "v3_V")
Signal = Literal["V", "counts"]
_WHOLE = ("label", "other_names", "gauge", "signal")  # fields that are no columns of numbers


@dataclass(frozen=True)
class Readings(TableResult):
    """Readings in SI, a value for each row: `deflection` in d, `force` in N, `v1` and `v3` in V.

    `row` is the row in the file, `label` the gradient set. `deflection` and `force` are means if
    ruler and scale were read again after the meter; `…_rise` is the second reading less the first,
    NaN if there was one. `null_…` are the rows of the null: v1 and v3 as noted with v2 = 0, v2 that
    restored v1, and `null_side`, +1 for an outward approach and −1 for an inward one. `others` are
    the forces held on other controls of the same structure, N, shape (readings,
    len(`other_names`)), each read once.

    Without a `gauge` there is no v3: F stands in its place with no weight. `signal` is the unit of
    v1, v2 and v3: volts, or counts of a converter.
    """

    row: NDArray[np.int64]
    label: tuple[str, ...]
    deflection: Floats
    force: Floats
    v1: Floats
    v3: Floats
    deflection_rise: Floats
    force_rise: Floats
    null_row: NDArray[np.int64]
    null_v1: Floats
    null_v2: Floats
    null_v3: Floats
    null_side: Floats
    other_names: tuple[str, ...]
    others: Floats
    gauge: bool = True
    signal: Signal = "V"

    def __repr__(self) -> str:
        sets = len(set(self.label))
        nulls = len(self.null_row)
        return f"Readings({len(self.row)} readings in {sets} gradient sets, {nulls} nulls)"

    def to_polars(self) -> pl.DataFrame:
        """Return one row per reading: deflection in m, or rad for a wheel, force in N, signals."""
        columns = (self.deflection, self.force, self.v1, self.v3)
        return frame_of(
            [
                dict(zip(("row", "gradient_set", *COLUMNS), (row, label, *numbers), strict=True))
                for row, label, *numbers in zip(
                    self.row.tolist(), self.label, *(c.tolist() for c in columns), strict=True
                )
            ]
        )

    @property
    def deflection_looks(self) -> Floats:
        """The number of readings of the ruler in each mean."""
        return np.where(np.isnan(self.deflection_rise), 1.0, 2.0)

    @property
    def force_looks(self) -> Floats:
        """The number of readings of the spring scale in each mean."""
        return np.where(np.isnan(self.force_rise), 1.0, 2.0)

    def without(self, rows: Sequence[int]) -> Readings:
        """Return the readings without these rows of the file."""
        keep, null = ~np.isin(self.row, rows), ~np.isin(self.null_row, rows)
        kept = {
            name: values[null if name.startswith("null_") else keep]
            for name, values in self.__dict__.items()
            if name not in _WHOLE
        }
        label = tuple(name for name, ours in zip(self.label, keep, strict=True) if ours)
        own = {name: getattr(self, name) for name in _WHOLE if name != "label"}
        return Readings(label=label, **own, **kept)


def readings_of(
    rows: Sequence[int],
    label: Sequence[str],
    columns: Floats,
    null_rows: Sequence[int],
    null: Floats,
    others: Mapping[str, Floats] | None = None,
    signal: Signal = "V",
) -> Readings:
    """Return readings from their columns in SI.

    `columns`: δ, F, v₁, v₃ and both rises, shape (6, readings); `null`: v₁, v₂, v₃ and the
    side, shape (4, nulls). `others`: {another control: the force held on it in N}. v₃ is NaN
    in every reading where there is no gauge.
    """
    held = others or {}
    deflection, force, v1, v3, deflection_rise, force_rise = columns
    gauge = not (v3.size and np.isnan(v3).all())
    null_v1, null_v2, null_v3, null_side = null
    return Readings(
        row=np.array(rows, np.int64),
        label=tuple(label),
        deflection=deflection,
        force=force,
        v1=v1,
        v3=v3 if gauge else force,
        deflection_rise=deflection_rise,
        force_rise=force_rise,
        null_row=np.array(null_rows, np.int64),
        null_v1=null_v1,
        null_v2=null_v2,
        null_v3=null_v3,
        null_side=null_side,
        other_names=tuple(held),
        others=np.array(list(held.values()), float).reshape(len(held), len(rows)).T,
        gauge=gauge,
        signal=signal,
    )
