"""A calibration, a plan and a bench's coverage on a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.console import Console
from rich.table import Table

from coupled.calibration.figures import HEADS, basis, remarks, rows
from coupled.calibration.qualification import written
from coupled.cli.tables.whole import print_whole
from coupled.display import System, convert, in_system
from coupled.record.channels import unit_of

if TYPE_CHECKING:
    from coupled.calibration.checks import ControlCheck
    from coupled.calibration.coverage import Coverage
    from coupled.calibration.plan import DeflectionNeeds
    from coupled.calibration.planned import ReadingsPlan
    from coupled.calibration.result import CalibrationResult


def print_calibration(console: Console, found: CalibrationResult, system: System = "si") -> None:
    """Print a calibration: the figures, their errors, and which to use."""
    table = Table(box=None, pad_edge=False)
    table.add_column("", no_wrap=True)
    for head in HEADS:
        table.add_column(head, justify="right", no_wrap=True)
    for row in rows(found, system):
        table.add_row(*row)
    console.print(basis(found), highlight=False)
    console.print()
    print_whole(console, table)
    console.print()
    for line in remarks(found, system):
        console.print(line, highlight=False, markup=False)


def print_plan(console: Console, plan: ReadingsPlan, system: System = "si") -> None:
    """Print the precision of K for grids of readings, and the smallest sufficient one."""
    d, grids, reached = unit_of(plan.control), plan.grids, plan.reached
    bend = in_system(f"{d}/N", system)
    of = f"K = {bend.written(reached.bend)} {bend.unit}"
    console.print(
        f"95 % interval of K, ± %, for {of}: gradients down, deflections across", highlight=False
    )
    across = sorted({many for _, many in grids})
    table = Table(box=None, pad_edge=False)
    table.add_column("", justify="right")
    for many in across:
        table.add_column(str(many), justify="right")
    for down in sorted({few for few, _ in grids}):
        cells = [f"{100 * grids[down, many].half_width:.1f}" for many in across]
        table.add_row(str(down), *cells)
    print_whole(console, table)
    console.print(
        f"\nfewest for ± {100 * reached.half_width:.1f} %: {reached.readings} readings",
        highlight=False,
    )
    table = Table(box=None, pad_edge=False)
    units = [in_system(unit, system) for unit in (f"N/{d}", "Pa", d, "N")]
    words = ("gradient", "q̄", "deflection", "force")
    for word, unit in zip(words, units, strict=True):
        table.add_column(f"{word}, {unit.unit}", justify="right")
    table.add_column("readings", justify="right")
    for s, count in plan.chosen:
        place = (s.gradient, s.pressure_Pa, s.deflection, s.force)
        numbers = (u.written(number, 5) for u, number in zip(units, place, strict=True))
        table.add_row(*numbers, str(count))
    print_whole(console, table)
    console.print(
        "\nThe softest gradient far out gives S1, the stiffest at full force K. A few readings"
        " between them show whether the bend is straight, which the ends alone cannot."
    )
    console.print(_deflection_line(plan.needs, reached.readings), highlight=False)


def _deflection_line(needs: DeflectionNeeds, readings: int) -> str:
    """Return the expected error of the deflection, and the readings that 0.5 % requires."""
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
    """Print how often intervals contained the true value."""
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
    print_whole(console, table)


_ROUNDED = 1e-9  # of N, s, ° or %: less is rounding


def print_checks(
    console: Console,
    control: str,
    checks: Sequence[ControlCheck],
    every: bool,
    why: Sequence[str] = (),
    system: System = "si",
) -> None:
    """Print a control's checks: failed ones and the narrowest of each kind, or all.

    `why` has the reasons of failures.
    """
    shown = list(checks) if every else _narrowest(checks)
    table = Table(box=None, pad_edge=False)
    table.add_column(control, no_wrap=True)
    pressure = "q̄, kPa" if system == "si" else f"q̄, {in_system('Pa', system).unit}"
    for head in (pressure, "rig", "specified", "±", "", "margin", ""):
        table.add_column(head, justify="left" if head == "" else "right", no_wrap=True)
    for c in shown:
        at = c.pressure_Pa / 1000.0 if system == "si" else convert(c.pressure_Pa, "Pa", system)
        unit = in_system(c.unit, system)
        numbers = (c.measured, c.reference, c.tolerance)
        cells = [f"{at:.2f}", *(written(unit.factor * number) for number in numbers)]
        verdict = "pass" if c.passed else "[red]FAIL[/]"
        name = c.name.replace(", positive", " +").replace(", negative", " −")
        table.add_row(name, *cells, unit.unit, f"{100 * c.margin:.0f} %", verdict)
    print_whole(console, table)
    good = sum(check.passed for check in checks)
    console.print(f"{control}: {good} of {len(checks)} checks pass", highlight=False)
    for sentence in why:
        console.print(f"  {sentence}", highlight=False)
    console.print()


def _narrowest(checks: Sequence[ControlCheck]) -> list[ControlCheck]:
    """Return the failed checks, and the check with the least margin of each kind."""
    least: dict[str, ControlCheck] = {}
    for check in checks:
        kind = check.name.split(",")[0]
        if kind not in least or check.margin < least[kind].margin:
            least[kind] = check
    kept = list(least.values())
    return [check for check in checks if not check.passed or check in kept]
