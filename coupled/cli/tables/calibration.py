"""A calibration, a plan and a bench's coverage on a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from coupled.record.channels import unit_of
from coupled.units import POUND_N, DEGREE_rad, INCH_PER_POUND_m_per_N

if TYPE_CHECKING:
    from coupled.calibration.checks import ControlCheck
    from coupled.calibration.coverage import Coverage
    from coupled.calibration.estimate import Estimate
    from coupled.calibration.plan import DeflectionNeeds, Precision, Station
    from coupled.calibration.result import CalibrationResult

CREEP = 3.0  # standard errors of the mean rise that are no chance
LARGE, SMALL = 2.0, 0.4  # residuals over the instruments' errors that call for a word


def print_calibration(console: Console, found: CalibrationResult) -> None:
    """Print what readings tell: the figures, how far to trust them, and which to use."""
    d = unit_of(found.control)
    bend = found.line.bend
    unit, factor = ("in/lb", 1.0 / INCH_PER_POUND_m_per_N)
    if d == "rad":
        unit, factor = ("°/lb", POUND_N / DEGREE_rad)
    table = Table(box=None, pad_edge=False)
    table.add_column("", no_wrap=True)
    for head in ("value", "std. error", "95 % interval"):
        table.add_column(head, justify="right", no_wrap=True)
    a, b = found.printed
    _row(table, f"S1, V/{d}", found.line.s1)
    _row(table, "  ordinary least squares", found.plain.s1)
    table.add_row("  normal equations, appendix A", _number(a, found.plain.s1.error), "", "")
    _row(table, f"K, {d}/N", bend)
    _row(table, f"K, {unit}", bend.scaled(factor))
    _row(table, "  ordinary least squares", found.plain.bend.scaled(factor))
    error = factor * found.plain.bend.error
    table.add_row("  normal equations, appendix A", _number(-b / a * factor, error), "", "")
    for name, estimate in found.fit.others.items():
        _row(table, f"K by {name}, {d}/N", estimate)
    _row(table, "S3, V/N", found.s3)
    _row(table, "  mean of v3/F, eq. (13)", found.s3_mean)
    for i, (way, estimate) in enumerate(found.s2.items()):
        _row(table, f"{'  ' if i else 'S2, V/N, '}by {way}", estimate)
    sets = len(set(found.readings.label))
    rows = found.readings.row
    console.print(
        f"{found.count} readings of the {found.control} in {sets} gradient sets,"
        f" rows {rows[0]} to {rows[-1]}; S1 and K with errors in all variables",
        highlight=False,
    )
    console.print()
    console.print(table)
    console.print()
    for line in _remarks(found):
        console.print(line, highlight=False, markup=False)


def _row(table: Table, name: str, estimate: Estimate) -> None:
    error = estimate.error
    ends = f"{_number(estimate.low, error)} to {_number(estimate.high, error)}"
    table.add_row(name, _number(estimate.value, error), f"{error:#.2g}".rstrip("."), ends)


def _number(value: float, error: float) -> str:
    """Return a number to a tenth of its standard error, nine figures at most."""
    if value == 0.0:
        return "0"
    figures = 9
    if error > 0.0:
        figures = int(np.floor(np.log10(abs(value))) - np.floor(np.log10(error))) + 2
    return f"{value:#.{min(max(figures, 2), 9)}g}".rstrip(".")


def _remarks(found: CalibrationResult) -> list[str]:
    line, plain = found.line, found.plain
    size = np.abs(line.residual)
    row = found.readings.row[int(np.argmax(size))]
    lines = [
        f"residuals of v1: {float(np.sqrt(np.mean(size**2))):.3g} V rms,"
        f" largest {size.max():.3g} V in row {row}",
        f"condition number {found.condition:.3g}; errors of S1 and K correlate by"
        f" {line.correlation:+.2f}",
    ]
    if np.isfinite(line.excess):
        lines[0] += f"; {line.excess:.2f} of what the instruments explain"
        if line.excess > LARGE:
            lines.append("They are larger: an instrument errs more, or the bend is not straight.")
        elif line.excess < SMALL:
            lines.append("They are smaller: the instruments are better than stated.")
    if line.bend.error > 0.0:
        off = (plain.bend.value - line.bend.value) / line.bend.error
        lines.append(
            f"Ordinary least squares takes ruler and scale as exact, which biases it: its K is"
            f" {off:+.2f} standard errors off. Use the figures with errors in all variables;"
            " the ordinary ones only where the voltmeter alone errs, or beside an old fit."
        )
    for s in found.suspects:
        lines.append(
            f"row {s.row} is left out: {s.columns} is {s.deviations:.0f} standard deviations"
            " off, mistyped?"
        )
    lines += _creep_lines(found) + _accuracy_lines(found) + _arc_lines(found)
    lines += [f"stale calibration in the rig file: {change}" for change in found.changed]
    return lines


def _creep_lines(found: CalibrationResult) -> list[str]:
    """Return what the second looks show of a control that crept, and a null from one side."""
    lines = []
    d, factor, unit = unit_of(found.control), 1000.0, "mm"
    if d == "rad":
        factor, unit = 1.0 / DEGREE_rad, "°"
    rise = found.readings.deflection_rise
    rise = rise[~np.isnan(rise)]
    if len(rise) > 2:
        error = float(np.std(rise, ddof=1) / np.sqrt(len(rise)))
        mean = float(np.mean(rise))
        text = f"ruler's second look less its first: {factor * mean:+.2g} {unit} on the mean"
        text += f" (std. error {factor * error:.1g})"
        if abs(mean) > CREEP * error > 0.0:
            text += "; the control creeps while it is read, their mean allows for it"
        lines.append(text)
    if found.one_sided:
        lines.append(
            "The nulls are not four or more from both sides, and the control has friction: S2 is"
            " widened for what a wandering hand does then. Take more from beyond (approach: in)."
        )
    return lines


def _accuracy_lines(found: CalibrationResult) -> list[str]:
    """Return what the figures give to those who fly with them."""
    if found.accuracy is None or found.accuracy.deflection.error == 0.0:
        return []
    off, felt = found.accuracy.deflection, found.accuracy.felt
    gradient = f"{found.accuracy.gradient:.4g} N/{unit_of(found.control)}"
    text = f"compensated with these, at {gradient} the aircraft gets the deflection to within"
    text += f" {100 * off.half_width:.2g} %"
    if felt is not None:
        text += f" and the hand the gradient to within {100 * felt.half_width:.2g} %"
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


def print_plan(
    console: Console,
    control: str,
    grids: dict[tuple[int, int], Precision],
    chosen: Sequence[tuple[Station, int]],
    reached: Precision,
    needs: DeflectionNeeds,
) -> None:
    """Print how precise K gets by grids of readings, and the fewest that reach what is wanted."""
    d = unit_of(control)
    console.print(
        f"95 % interval of K, ± %, for K = {reached.bend:.4g} {d}/N: gradients down,"
        " deflections across",
        highlight=False,
    )
    across = sorted({many for _, many in grids})
    table = Table(box=None, pad_edge=False)
    table.add_column("", justify="right")
    for many in across:
        table.add_column(str(many), justify="right")
    for down in sorted({few for few, _ in grids}):
        cells = [f"{100 * grids[down, many].half_width:.1f}" for many in across]
        table.add_row(str(down), *cells)
    console.print(table)
    console.print(
        f"\nfewest for ± {100 * reached.half_width:.1f} %: {reached.readings} readings",
        highlight=False,
    )
    table = Table(box=None, pad_edge=False)
    for head in (f"gradient, N/{d}", "q̄, Pa", f"deflection, {d}", "force, N", "readings"):
        table.add_column(head, justify="right")
    for s, count in chosen:
        place = (s.gradient, s.pressure_Pa, s.deflection, s.force)
        table.add_row(*(f"{number:.5g}" for number in place), str(count))
    console.print(table)
    console.print(
        "\nThe softest gradient far out gives S1, the stiffest at full force K. A few readings"
        " between them show whether the bend is straight, which the ends alone cannot."
    )
    console.print(_deflection_line(needs, reached.readings), highlight=False)


def _deflection_line(needs: DeflectionNeeds, readings: int) -> str:
    """Return what the readings give of the deflection, and what it takes to have it right."""
    wanted = f"{100 * needs.wanted:g} %"
    text = "Compensated with these, the aircraft gets the deflection to"
    text += f" {100 * needs.half_width:.2g} % (95 %)."
    if needs.half_width <= needs.wanted:
        return text
    ways = []
    if needs.readings is not None:
        ways.append(f"{needs.readings} readings")
    if needs.ruler is not None:
        ways.append(f"these {readings} with a ruler {needs.ruler:.2g} times finer")
    elif needs.all is not None:
        better = f"{needs.all:.2g} times better"
        ways.append(f"these {readings} with every instrument and the hand {better}")
    return f"{text} For {wanted} it takes {', or '.join(ways) or 'more than readings give'}."


def print_coverage(console: Console, coverage: Coverage) -> None:
    """Print how often intervals held the truth."""
    table = Table(box=None, pad_edge=False)
    table.add_column(f"{coverage.benches} benches", no_wrap=True)
    table.add_column("", justify="right")
    for name, share in coverage.covered.items():
        if not np.isnan(share):
            table.add_row(f"95 % interval of {name} holds the truth", f"{100 * share:.1f} %")
    table.add_row("  of K by ordinary least squares", f"{100 * coverage.ordinary_covered:.1f} %")
    table.add_row("K within 5 % of the truth", f"{100 * coverage.within:.1f} %")
    table.add_row("bias of K, errors in all variables", f"{100 * coverage.bias:+.2f} %")
    table.add_row("bias of K, ordinary least squares", f"{100 * coverage.ordinary_bias:+.2f} %")
    table.add_row("scatter of K, errors in all variables", f"{100 * coverage.spread:.2f} %")
    table.add_row("a good reading taken for mistyped", f"{100 * coverage.accused:.1f} %")
    table.add_row("compensated, deflection within 0.5 %", f"{100 * coverage.deflection:.1f} %")
    table.add_row("compensated, felt gradient within 1 %", f"{100 * coverage.felt:.1f} %")
    table.add_row("  both", f"{100 * coverage.circle:.1f} %")
    console.print(table)


def print_checks(
    console: Console, control: str, checks: Sequence[ControlCheck], every: bool
) -> None:
    """Print a control's checks: those that fail and each kind's narrowest, or every one."""
    shown = list(checks) if every else _narrowest(checks)
    table = Table(box=None, pad_edge=False)
    table.add_column(control, no_wrap=True)
    for head in ("q̄, kPa", "rig", "specified", "±", "", "margin", ""):
        table.add_column(head, justify="left" if head == "" else "right", no_wrap=True)
    for c in shown:
        numbers = (c.pressure_Pa / 1000.0, c.measured, c.reference, c.tolerance)
        cells = [f"{numbers[0]:.2f}", *(_short(number) for number in numbers[1:])]
        verdict = "pass" if c.passed else "[red]FAIL[/]"
        name = c.name.replace(", positive", " +").replace(", negative", " −")
        table.add_row(name, *cells, c.unit, f"{100 * c.margin:.0f} %", verdict)
    console.print(table)
    good = sum(check.passed for check in checks)
    console.print(f"{control}: {good} of {len(checks)} checks pass\n", highlight=False)


def _short(number: float) -> str:
    """Return a number in three figures, or to a whole where it is large."""
    return f"{number:.0f}" if abs(number) >= 100.0 else f"{number:.3g}"


def _narrowest(checks: Sequence[ControlCheck]) -> list[ControlCheck]:
    """Return every check that fails, and of each kind the one with the least margin."""
    least: dict[str, ControlCheck] = {}
    for check in checks:
        kind = check.name.split(",")[0]
        if kind not in least or check.margin < least[kind].margin:
            least[kind] = check
    kept = list(least.values())
    return [check for check in checks if not check.passed or check in kept]
