"""A calibration: from readings to S₁, S₂, S₃ and K, or the reason why they tell too little."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from coupled.calibration import arc, scales
from coupled.calibration.belief import stale
from coupled.calibration.errors_in_variables import JointFit, errors_in_variables
from coupled.calibration.estimate import Estimate, Instruments
from coupled.calibration.fit import LineFit, condition, normal_equations, ordinary
from coupled.calibration.outcome import Outcome, expected
from coupled.calibration.readings import Readings
from coupled.calibration.suspects import Suspect, find_suspects
from coupled.errors import InputError
from coupled.record.channels import unit_of
from coupled.rig.parameters import Control

Floats = NDArray[np.float64]
FEWEST = 4  # a line of two unknowns, and something left to tell their errors by
FAR = 0.1  # of the largest: what lies nearer to neutral may have any sign
BEYOND_TRAVEL = 1.5  # that much more travel than there is, and the unit is wrong
EXTREME = 3.0  # of a hand's wander: as far as friction takes a control with it
SURELY = 0.999  # how sure it must be that the gradients differ


@dataclass(frozen=True)
class Result:
    """What readings tell of a control.

    `fit` allows for errors in all variables, `plain` is ordinary least squares, `printed`
    (a, b) of the normal equations; `s3_mean` is eq. (13); `s2` each way to it; `outcome` what
    that makes of deflection and feel. `one_sided`: nulls from one side only, on a control with
    friction. `readings` are those used, along the arc; `level` as a level ruler read them,
    where they were corrected, and else None.
    """

    control: str
    fit: JointFit
    plain: LineFit
    printed: tuple[float, float]
    condition: float
    s3_mean: Estimate
    s2: dict[str, Estimate]
    one_sided: bool
    outcome: Outcome | None
    suspects: tuple[Suspect, ...]
    readings: Readings
    level: Floats | None
    angle_rad: Floats | None
    changed: tuple[str, ...]

    @property
    def line(self) -> LineFit:
        """S₁ and K with errors in all variables."""
        return self.fit.line

    @property
    def s3(self) -> Estimate:
        """S₃ in V/N with errors in all variables."""
        return self.fit.s3

    @property
    def count(self) -> int:
        """Readings used."""
        return len(self.readings.row)

    @property
    def s2_chosen(self) -> Estimate | None:
        """S₂ as measured by the null, or else from a gain, or none."""
        return next(reversed(self.s2.values()), None)

    @property
    def beyond(self) -> list[int]:
        """Rows beyond 14° of arc."""
        if self.angle_rad is None:
            return []
        return [int(r) for r in self.readings.row[np.abs(self.angle_rad) > arc.LIMIT_rad]]

    def as_dict(self) -> dict[str, Any]:
        """Return the figures as JSON takes them, units in the names."""
        d = unit_of(self.control)
        fits = {"errors_in_variables": self.line, "ordinary_least_squares": self.plain}
        table: dict[str, Any] = {"control": self.control, "readings": self.count}
        for name, fit in fits.items():
            table[name] = {
                f"s1_V_per_{d}": fit.s1.as_dict(),
                f"bend_{d}_per_N": fit.bend.as_dict(),
                "correlation": fit.correlation,
                "residuals_over_instruments": None if np.isnan(fit.excess) else fit.excess,
                "residual_V": fit.residual.tolist(),
            }
        a, b = self.printed
        table["normal_equations"] = {f"a_V_per_{d}": a, "b_V_per_N": b}
        table["condition"] = self.condition
        table["s3_V_per_N"] = {
            "eq_13": self.s3_mean.as_dict(),
            "errors_in_variables": self.s3.as_dict(),
        }
        table["correlation_of_s1_bend_s3"] = self.fit.correlation.tolist()
        table["s2_V_per_N"] = {way: estimate.as_dict() for way, estimate in self.s2.items()}
        if self.outcome is not None:
            table["outcome"] = {f"gradient_N_per_{d}": self.outcome.gradient}
            table["outcome"]["deflection_half_width"] = self.outcome.deflection.half_width
            if self.outcome.felt is not None:
                table["outcome"]["felt_half_width"] = self.outcome.felt.half_width
        table["rows"] = self.readings.row.tolist()
        table["left_out"] = [
            {"row": s.row, "columns": s.columns, "deviations": s.deviations} for s in self.suspects
        ]
        table["rows_beyond_14_deg"] = self.beyond
        table["corrected_to_the_arc"] = self.level is not None
        table["stale"] = list(self.changed)
        return table


def calibrate(
    readings: Readings, control: Control, name: str, instruments: Instruments, file: Path | str
) -> Result:
    """Return what the readings of `file` tell of the control called `name`.

    Raises InputError where they cannot: too few, all of one force, or of one gradient.
    """
    corrected, level, angles = _on_arc(readings, control, file)
    _refuse_poor(corrected, control, name, instruments, file)
    suspects = find_suspects(corrected, instruments)
    used = corrected.without([suspect.row for suspect in suspects])
    if suspects:
        kept = np.isin(corrected.row, used.row)
        level = None if level is None else level[kept]
        angles = None if angles is None else angles[kept]
        try:
            _refuse_poor(used, control, name, instruments, file)
        except InputError as error:
            rows = ", ".join(str(suspect.row) for suspect in suspects)
            problem = f"without the far-off rows {rows}: {error.problem}"
            raise InputError(file, error.key, problem) from None
    d, f = used.deflection, used.force
    plain = ordinary(used, instruments)
    if plain.s1.value <= 0.0:
        raise InputError(file, "v1_V", "falls as the deflection grows; check its sign")
    try:
        fit = errors_in_variables(used, instruments)
    except (FloatingPointError, np.linalg.LinAlgError):
        raise InputError(
            file, "", "the fit does not settle; the readings tell too little"
        ) from None
    if fit.line.bend.high < 0.0:
        problem = "K comes out negative, and no structure bends against its force"
        raise InputError(file, "", f"{problem}; check v1, and which readings are of which gradient")
    there = f != 0.0
    s2 = scales.s2_from_gains(fit.line.s1, fit.s3, control.gains)
    loader, sides = control.loader, used.null_side
    rubs = max(loader.friction, loader.breakaway) > 0.0
    one_sided = rubs and len(sides) >= 2 and not scales.both_sides(sides)
    if len(used.null_row) >= 2:
        off = EXTREME * instruments.hand if one_sided else 0.0
        found = scales.s2_by_null(used.null_v2, used.null_v3, sides, fit.s3, off)
        s2["the null, eq. (14)"] = found
    return Result(
        name,
        fit,
        plain,
        normal_equations(d, f, used.v1),
        condition(d, f),
        scales.s3_by_ratios(f[there], used.v3[there]),
        s2,
        one_sided,
        expected(fit, next(reversed(s2.values()), None), control),
        tuple(suspects),
        used,
        level,
        angles,
        tuple(stale(control)),
    )


def _on_arc(
    readings: Readings, control: Control, file: Path | str
) -> tuple[Readings, Floats | None, Floats | None]:
    """Return the readings along the arc, and where known the level ones and angles in rad."""
    length = control.length
    if length <= 0.0 or control.surface == "aileron":
        return readings, None, None
    level = readings.deflection
    if not control.loader.arc_geometry:
        return readings, None, level / length
    far = np.flatnonzero(np.abs(level) >= length)
    if far.size:
        row = int(readings.row[far[0]])
        problem = f"is {level[far[0]]:.4g} m on an arc of {length:g} m, which no ruler reads"
        raise InputError(file, f"row {row}", problem)
    fields = {**readings.__dict__, "deflection": arc.along_arc(level, length)}
    return Readings(**fields), level, arc.angle(level, length)


def _refuse_poor(
    readings: Readings, control: Control, name: str, instruments: Instruments, file: Path | str
) -> None:
    n, force, deflection = len(readings.row), readings.force, readings.deflection
    if n < FEWEST:
        raise InputError(
            file, "", f"has deflection and force in {n} rows; {FEWEST} readings are the least"
        )
    if np.count_nonzero(force) < FEWEST:
        raise InputError(
            file, "force", f"is not 0 in {np.count_nonzero(force)} rows; {FEWEST} at least"
        )
    rows = f"rows {readings.row[0]} to {readings.row[-1]}"
    for quantity, values in (("force", force), ("v1", readings.v1), ("v3", readings.v3)):
        if np.ptp(values) <= 1e-12 * np.max(np.abs(values)):
            problem = f"every {quantity} is the same; S1 and K need readings that differ"
            raise InputError(file, rows, problem)
    _refuse_signs(readings, control, name, file)
    if len(set(readings.label)) == 1:
        why = f"all readings are of one gradient set, {readings.label[0]!r}"
    elif not _gradients_differ(readings, instruments):
        why = "all gradients F/deflection are the same to within the instruments' errors"
    else:
        return
    slope = float(force @ deflection / (deflection @ deflection))
    separating = _separating(control, slope, float(np.max(np.abs(force))), unit_of(name))
    problem = (
        f"{why}: with one gradient v1 = (S1 - S1*K*G)*deflection, and S1 and K are inseparable"
    )
    raise InputError(file, rows, f"{problem}; {separating}")


def _refuse_signs(readings: Readings, control: Control, name: str, file: Path | str) -> None:
    """Refuse what a wrong sign or unit gives, by its row."""
    deflection, force = readings.deflection, readings.force
    far = np.abs(deflection) > FAR * np.max(np.abs(deflection))
    far &= np.abs(force) > FAR * np.max(np.abs(force))  # friction may turn a small force
    against = far & (deflection * force < 0.0)
    if against.any():
        row = int(readings.row[np.argmax(against)])
        problem = "force and deflection have different signs; a pull moves the control with it"
        raise InputError(file, f"row {row}", problem)
    if force @ readings.v3 < 0.0:
        raise InputError(file, "v3_V", "falls as the force grows; check its sign")
    wrong = readings.null_v2 * readings.null_v3 < 0.0
    if wrong.any():
        row = int(readings.null_row[np.argmax(wrong)])
        problem = "has another sign than v3; the supply takes the hand's place"
        raise InputError(file, f"row {row}: v2_V", problem)
    if np.median(np.abs(deflection)) > BEYOND_TRAVEL * control.travel:
        d = unit_of(name)
        problem = f"is {deflection[0]:.4g} {d}, the {name}'s travel is {control.travel:g} {d}"
        raise InputError(file, f"row {readings.row[0]}: deflection", f"{problem}; another unit?")


def _gradients_differ(readings: Readings, instruments: Instruments) -> bool:
    """Return whether F = G·δ with one G is surely wrong."""
    deflection, force = readings.deflection, readings.force
    slope = float(force @ deflection / (deflection @ deflection))
    ruler = instruments.deflection_variance(deflection, readings.deflection_looks)
    variance = instruments.force_variance(force, readings.force_looks) + slope**2 * ruler
    variance += (1e-7 * np.max(np.abs(force))) ** 2
    excess = float(np.sum((force - slope * deflection) ** 2 / variance))
    return excess > float(chi2.ppf(SURELY, len(force) - 1))


def _separating(control: Control, slope: float, strongest: float, d: str) -> str:
    """Return in words the reading that would separate S₁ and K best."""
    gradients = np.array(control.schedule.total_gradient)
    other = float(gradients[np.argmax(np.abs(gradients - slope))])
    if abs(other - slope) < 0.02 * abs(slope):
        return f"the rig's schedule has no other gradient than {slope:.4g} N/{d}: give it one"
    held = min(0.95 * control.travel, strongest / other) if other > 0.0 else 0.95 * control.travel
    return (
        f"add a reading at {other:.4g} N/{d}, at {held:.3g} {d} ({held * other:.3g} N),"
        f" where these are at {slope:.4g} N/{d}"
    )
