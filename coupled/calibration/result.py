"""The result of a calibration: S₁, S₂, S₃ and K of a control, with errors and readings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.calibration import arc
from coupled.calibration.accuracy import Accuracy
from coupled.calibration.errors_in_variables import JointFit
from coupled.calibration.estimate import Estimate
from coupled.calibration.fit import LineFit
from coupled.calibration.readings import Readings
from coupled.calibration.suspects import Suspect
from coupled.record.channels import unit_of
from coupled.results import Result

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class CalibrationResult(Result):
    """The result of a calibration.

    `fit` has errors in all variables, `plain` is ordinary least squares, `printed` (a, b) of the
    normal equations. `s3_mean` is eq. (13), `s2` has each method for S₂. `accuracy` are the errors
    of deflection and felt gradient, None if no compensation exists. `one_sided`: nulls from one
    side only, on a control with friction. `readings` are those used, along the arc; `level` are the
    level readings if they were corrected, else None. `doubts` are about the units and zeros of the
    readings.
    """

    control: str
    fit: JointFit
    plain: LineFit
    printed: tuple[float, float]
    condition: float
    s3_mean: Estimate | None
    s2: dict[str, Estimate]
    one_sided: bool
    accuracy: Accuracy | None
    suspects: tuple[Suspect, ...]
    readings: Readings
    level: Floats | None
    angle_rad: Floats | None
    changed: tuple[str, ...]
    doubts: tuple[str, ...]

    def __repr__(self) -> str:
        d, bend = unit_of(self.control), self.line.bend
        ends = f"{bend.low:.4g} to {bend.high:.4g}"
        found = f"K = {bend.value:.4g} {d}/N ({ends})"
        return f"CalibrationResult({self.control}: {found}, of {self.count} readings)"

    @property
    def line(self) -> LineFit:
        """S₁ and K with errors in all variables."""
        return self.fit.line

    @property
    def s3(self) -> Estimate | None:
        """S₃ in V/N with errors in all variables; None if v₃ was not read."""
        return self.fit.s3 if self.readings.gauge else None

    @property
    def count(self) -> int:
        """Readings used."""
        return len(self.readings.row)

    @property
    def s2_chosen(self) -> Estimate | None:
        """S₂ by the null, otherwise from a gain, or None."""
        return next(reversed(self.s2.values()), None)

    @property
    def beyond(self) -> list[int]:
        """Rows beyond 14° of arc."""
        if self.angle_rad is None:
            return []
        return [int(r) for r in self.readings.row[np.abs(self.angle_rad) > arc.LIMIT_rad]]

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON, with units in the names."""
        d, signal = unit_of(self.control), self.readings.signal
        fits = {"errors_in_variables": self.line, "ordinary_least_squares": self.plain}
        table: dict[str, Any] = {"control": self.control, "readings": self.count}
        for name, fit in fits.items():
            table[name] = {
                f"s1_{signal}_per_{d}": fit.s1.as_dict(),
                f"bend_{d}_per_N": fit.bend.as_dict(),
                "correlation": fit.correlation,
                "residuals_over_instruments": None if np.isnan(fit.excess) else fit.excess,
                f"residual_{signal}": fit.residual.tolist(),
            }
        a, b = self.printed
        table["normal_equations"] = {f"a_{signal}_per_{d}": a, f"b_{signal}_per_N": b}
        table["condition"] = self.condition
        if self.fit.others:
            table["bend_by_others"] = {
                f"{self.control}_by_{name}_{d}_per_N": one.as_dict()
                for name, one in self.fit.others.items()
            }
        if self.s3 is not None and self.s3_mean is not None:
            table[f"s3_{signal}_per_N"] = {
                "eq_13": self.s3_mean.as_dict(),
                "errors_in_variables": self.s3.as_dict(),
            }
        table["correlation_of_s1_bend_s3"] = self.fit.correlation.tolist()
        table[f"s2_{signal}_per_N"] = {way: estimate.as_dict() for way, estimate in self.s2.items()}
        if self.accuracy is not None:
            table["outcome"] = self.accuracy.as_dict(d)
        table["rows"] = self.readings.row.tolist()
        table["left_out"] = [
            {"row": s.row, "columns": s.columns, "deviations": s.deviations} for s in self.suspects
        ]
        table["rows_beyond_14_deg"] = self.beyond
        table["corrected_to_the_arc"] = self.level is not None
        table["stale"] = list(self.changed)
        table["doubts"] = list(self.doubts)
        return table
