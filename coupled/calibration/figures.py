"""The results of a calibration as text: values with units and intervals, and remarks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from coupled.display import System, in_system
from coupled.record.channels import unit_of
from coupled.units import POUND_N, DEGREE_rad, INCH_m, INCH_PER_POUND_m_per_N

if TYPE_CHECKING:
    from coupled.calibration.estimate import Estimate
    from coupled.calibration.result import CalibrationResult

CREEP = 3.0  # standard errors from which the mean rise is significant
LARGE, SMALL = 2.0, 0.4  # residuals over the instruments' errors, beyond which a remark is printed


HEADS = ("value", "std. error", "95 % interval")
Row = tuple[str, str, str, str]


def rows(found: CalibrationResult, system: System = "si") -> Iterator[Row]:
    """Yield each result: its label with the unit, value, standard error and 95 % interval.

    K is given in in/lb (°/lb) as well, the unit of its printed formulas.
    """
    d, bend = unit_of(found.control), found.line.bend
    v = found.readings.signal
    s1, s3, own = (in_system(text, system) for text in (f"{v}/{d}", f"{v}/N", f"{d}/N"))
    unit, factor = ("in/lb", 1.0 / INCH_PER_POUND_m_per_N)
    if d == "rad":
        unit, factor = ("°/lb", POUND_N / DEGREE_rad)
    a, b = found.printed
    plain = found.plain.bend.scaled(factor)
    ordinary = found.plain.s1.scaled(s1.factor)
    yield _row(f"S1, {s1.unit}", found.line.s1.scaled(s1.factor))
    yield _row("  ordinary least squares", ordinary)
    yield ("  normal equations, appendix A", written(a * s1.factor, ordinary.error), "", "")
    if system == "si":
        yield _row(f"K, {d}/N", bend)
    yield _row(f"K, {unit}", bend.scaled(factor))
    yield _row("  ordinary least squares", plain)
    yield ("  normal equations, appendix A", written(-b / a * factor, plain.error), "", "")
    for name, estimate in found.fit.others.items():
        yield _row(f"K by {name}, {own.unit}", estimate.scaled(own.factor))
    if found.s3 is not None and found.s3_mean is not None:
        yield _row(f"S3, {s3.unit}", found.s3.scaled(s3.factor))
        yield _row("  mean of v3/F, eq. (13)", found.s3_mean.scaled(s3.factor))
    for i, (way, estimate) in enumerate(found.s2.items()):
        yield _row(f"{'  ' if i else f'S2, {s3.unit}, '}by {way}", estimate.scaled(s3.factor))


def basis(found: CalibrationResult) -> str:
    """Return the number and kind of the readings."""
    sets, at = len(set(found.readings.label)), found.readings.row
    text = f"{found.count} readings of the {found.control} in {sets} gradient sets"
    return f"{text}, rows {at[0]} to {at[-1]}; S1 and K with errors in all variables"


def _row(name: str, estimate: Estimate) -> Row:
    error = estimate.error
    ends = f"{written(estimate.low, error)} to {written(estimate.high, error)}"
    return name, written(estimate.value, error), f"{error:#.2g}".rstrip("."), ends


def written(value: float, error: float) -> str:
    """Return a number to a tenth of its standard error, with nine digits at most."""
    if value == 0.0:
        return "0"
    figures = 9
    if error > 0.0:
        figures = int(np.floor(np.log10(abs(value))) - np.floor(np.log10(error))) + 2
    return f"{value:#.{min(max(figures, 2), 9)}g}".rstrip(".")


def remarks(found: CalibrationResult, system: System = "si") -> list[str]:
    """Return remarks on residuals, the choice of the fit, excluded readings and accuracy."""
    line, plain, v = found.line, found.plain, found.readings.signal
    size = np.abs(line.residual)
    row = found.readings.row[int(np.argmax(size))]
    lines = [
        f"residuals of v1: {float(np.sqrt(np.mean(size**2))):.3g} {v} rms,"
        f" largest {size.max():.3g} {v} in row {row}",
        f"condition number {found.condition:.3g}; errors of S1 and K correlate by"
        f" {line.correlation:+.2f}",
    ]
    if np.isfinite(line.excess):
        lines[0] += f"; {line.excess:.2f} times the rms that the instruments' errors predict"
        if line.excess > LARGE:
            lines.append(
                "They are larger: an instrument has a larger error, or the bend is nonlinear."
            )
        elif line.excess < SMALL:
            lines.append("They are smaller: the instruments have smaller errors than stated.")
    if line.bend.error > 0.0:
        off = round((plain.bend.value - line.bend.value) / line.bend.error, 2) + 0.0  # no -0.00
        lines.append(
            f"Ordinary least squares ignores the errors of ruler and scale, which biases it: its K"
            f" differs by {off:+.2f} standard errors. Use it only if the voltmeter alone has"
            " errors, or to compare with an older fit."
        )
    if found.s3 is None:
        lines.append("v3 was not read: S3 stays as in the rig file.")
    for s in found.suspects:
        lines.append(
            f"row {s.row} is excluded: {s.columns} is {s.deviations:.0f} standard deviations"
            " off; is it mistyped?"
        )
    lines += _creep_lines(found, system) + _accuracy_lines(found, system) + _arc_lines(found)
    lines += [f"stale calibration in the rig file: {change}" for change in found.changed]
    lines += [f"doubtful: {doubt}" for doubt in found.doubts]
    return lines


def _creep_lines(found: CalibrationResult, system: System) -> list[str]:
    """Return remarks on a control that creeps between readings, and on nulls from one side."""
    lines = []
    d, factor, unit = unit_of(found.control), 1000.0, "mm"
    if d == "rad":
        factor, unit = 1.0 / DEGREE_rad, "°"
    elif system == "us":
        factor, unit = 1.0 / INCH_m, "in"
    rise = found.readings.deflection_rise
    rise = rise[~np.isnan(rise)]
    if len(rise) > 2:
        error = float(np.std(rise, ddof=1) / np.sqrt(len(rise)))
        mean = float(np.mean(rise))
        text = f"ruler's second reading less its first: {factor * mean:+.2g} {unit} on average"
        text += f" (std. error {factor * error:.1g})"
        if abs(mean) > CREEP * error > 0.0:
            text += "; the control creeps between the readings, and their mean is used"
        lines.append(text)
    if found.one_sided:
        lines.append(
            "The control has friction, and there are fewer than four nulls, or nulls from one side"
            " only: the interval of S2 includes the variation of the hand force. Add nulls from"
            " the other side (approach: in)."
        )
    return lines


def _accuracy_lines(found: CalibrationResult, system: System) -> list[str]:
    """Return the accuracy of a rig compensated with these results."""
    if found.accuracy is None or found.accuracy.deflection.error == 0.0:
        return []
    off, felt = found.accuracy.deflection, found.accuracy.felt
    unit = in_system(f"N/{unit_of(found.control)}", system)
    gradient = f"{unit.written(found.accuracy.gradient)} {unit.unit}"
    text = f"compensated with these, at {gradient} the deflection is within"
    text += f" {100 * off.half_width:.2g} %"
    if felt is not None:
        text += f" and the felt gradient within {100 * felt.half_width:.2g} %"
    return [f"{text} (95 %)"]


def _arc_lines(found: CalibrationResult) -> list[str]:
    if found.angle_rad is None or not found.beyond:
        return []
    most = float(np.max(np.abs(found.angle_rad)))
    rows = ", ".join(str(row) for row in found.beyond)
    text = f"rows {rows} are beyond 14° of arc, to {most / DEGREE_rad:.1f}°:"
    share = 100.0 * most**2 / 6.0
    if found.level is not None:
        return [f"{text} a level ruler reads up to {share:.1f} % short; corrected, eqs. (15)-(17)"]
    return [
        f"{text} a level ruler would read {share:.1f} % short there; if yours was level, set"
        " arc_geometry = true in the rig's loader, and they are corrected"
    ]
