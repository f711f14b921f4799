"""The tables of a calibration, of a plan, of readings, and of the checks of a control."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.figures import HEADS, rows
from coupled.calibration.qualification import check_numbers
from coupled.display import System, in_system, percent, pressure_in, pressure_shown
from coupled.record.channels import unit_of
from coupled.tables.table import Row, Table, passed

if TYPE_CHECKING:
    from coupled.calibration.checks import ControlCheck
    from coupled.calibration.coverage import Coverage
    from coupled.calibration.readings import Readings
    from coupled.calibration.readingsplan import ReadingsPlan
    from coupled.calibration.result import CalibrationResult

_DECIMALS = (5, 2, 3, 3, 3)


def results_table(found: CalibrationResult, system: System = "si") -> Table:
    """Return the results of a calibration: value, standard error and 95 % interval."""
    return Table(("", *HEADS), tuple(rows(found, system)))


def readings_table(
    read: Readings,
    deflection: str = "m or rad",
    system: System = "si",
    residual: NDArray[np.float64] | None = None,
) -> Table:
    """Return the readings, with the residual of v1 where a fit gives it.

    `deflection` is the unit of the readings, m or rad.
    """
    units = [in_system(unit, system) for unit in (deflection, "N")]
    columns = {
        f"δ, {units[0].unit}": units[0].factor * read.deflection,
        f"F, {units[1].unit}": units[1].factor * read.force,
        f"v1, {read.signal}": read.v1,
        f"v3, {read.signal}": read.v3 if read.gauge else None,
        f"residual of v1, {read.signal}": residual,
    }
    shown = [
        (head, [f"{value:.{decimals}f}" for value in column])
        for (head, column), decimals in zip(columns.items(), _DECIMALS, strict=True)
        if column is not None
    ]
    names = [[str(int(row)) for row in read.row], [str(label) for label in read.label]]
    cells = zip(*names, *(texts for _, texts in shown), strict=True)
    heads = ("row", "gradient set", *(head for head, _ in shown))
    return Table(heads, tuple(cells), f"{len(read.row)} readings", "llr")


def grids_table(plan: ReadingsPlan, system: System = "si") -> Table:
    """Return the half-width of the 95 % interval of K that grids of readings give."""
    bend = in_system(f"{unit_of(plan.control)}/N", system)
    of = f"K = {bend.written(plan.reached.bend)} {bend.unit}"
    sets, many = (sorted({size[i] for size in plan.grids}) for i in (0, 1))
    cells = tuple(
        (str(few), *(f"{100 * plan.grids[few, n].half_width:.1f}" for n in many)) for few in sets
    )
    caption = f"95 % interval of K, ± %, for {of}: gradients down, deflections across"
    return Table(("", *map(str, many)), cells, caption, "r")


def plan_table(plan: ReadingsPlan, system: System = "si") -> Table:
    """Return the readings to take, by gradient set."""
    d = unit_of(plan.control)
    gradient, deflection, force = (in_system(unit, system) for unit in (f"N/{d}", d, "N"))
    pressure = pressure_shown(system)
    units = {"gradient": gradient, "q̄": pressure, "deflection": deflection, "force": force}
    cells = []
    for station, count in plan.chosen:
        place = (station.gradient, station.pressure_Pa, station.deflection, station.force)
        numbers = (u.written(n, 5) for u, n in zip(units.values(), place, strict=True))
        cells.append((*numbers, str(count)))
    heads = (*(f"{word}, {unit.unit}" for word, unit in units.items()), "readings")
    return Table(heads, tuple(cells), align="r")


def coverage_table(found: Coverage) -> Table:
    """Return how often the intervals of simulated benches included the true value."""
    shares = {
        f"95 % interval of {name} contains true value": share
        for name, share in found.covered.items()
        if not np.isnan(share)
    }
    shares |= {
        "  of K by ordinary least squares": found.ordinary_covered,
        "K within 5 % of the true value": found.within,
    }
    off = {
        "bias of K, errors in all variables": f"{100 * found.bias:+.2f} %",
        "bias of K, ordinary least squares": f"{100 * found.ordinary_bias:+.2f} %",
        "scatter of K, errors in all variables": f"{100 * found.spread:.2f} %",
    }
    after = {
        "benches with a good reading excluded": found.accused,
        "compensated, deflection within 0.5 %": found.deflection,
        "compensated, felt gradient within 1 %": found.felt,
        "  both": found.circle,
    }
    cells = (
        *((label, percent(share)) for label, share in shares.items()),
        *off.items(),
        *((label, percent(share)) for label, share in after.items()),
    )
    return Table((f"{found.benches} benches", ""), cells)


def checks_table(control: str, checks: Sequence[ControlCheck], system: System = "si") -> Table:
    """Return the checks of a control: measured, reference, tolerance and margin."""
    return Table(
        (control, *check_heads(system)),
        tuple(check_row(check, system) for check in checks),
        align="lrrrrlrl",
    )


def check_heads(system: System = "si") -> tuple[str, ...]:
    """Return the headings of the columns of `check_row` after the name of the check."""
    return (f"q̄, {pressure_shown(system).unit}", "rig", "reference", "±", "", "margin", "")


def check_row(check: ControlCheck, system: System = "si") -> Row:
    """Return a check: name, q̄, measured and reference value, tolerance, unit, margin, result."""
    name = check.name.replace(", positive", " +").replace(", negative", " −")
    pressure = pressure_in(check.pressure_Pa, system).partition(" ")[0]
    margin = f"{100 * check.margin:.0f} %"
    return name, pressure, *check_numbers(check, system), margin, passed(check.passed)


def narrowest(checks: Sequence[ControlCheck]) -> list[ControlCheck]:
    """Return all failed checks, and the check with the least margin of each kind."""
    least: dict[str, ControlCheck] = {}
    for check in checks:
        kind = check.name.split(",")[0]
        if kind not in least or check.margin < least[kind].margin:
            least[kind] = check
    kept = list(least.values())
    return [check for check in checks if not check.passed or check in kept]
