"""The report of a calibration: the figures with their errors, and the readings that gave them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from coupled.calibration.figures import HEADS, basis, remarks, rows
from coupled.calibration.result import CalibrationResult
from coupled.display import System, in_system
from coupled.plots.readings import draw_readings
from coupled.plots.saving import svg_text
from coupled.record.channels import unit_of
from coupled.reports.page import Drawing, Made, Report, Section, Table, Text, Verdict

_DECIMALS = (5, 2, 3, 3, 3)
_SHOWN = "The readings, and the lines through them that S1, K and S3 are (the report's figure 4)."


def calibration_report(
    found: CalibrationResult,
    rig: str,
    readings: str,
    date: str,
    made: Made,
    system: System = "si",
) -> Report:
    """Return the report; `rig`, `readings` and `date` as the user names them."""
    sections = (
        Section(
            "Figures",
            (Table(("", *HEADS), tuple(rows(found, system))), Text(tuple(remarks(found, system)))),
        ),
        Section("Fit", (Drawing(svg_text(draw_readings(found, readings, system)), _SHOWN),)),
        Section("Readings used", (_readings(found, system),)),
    )
    settings = [("rig", rig), ("control", found.control), ("readings", basis(found))]
    if date:
        settings.append(("date, as given", date))
    return Report("Calibration", readings, _verdict(found, system), sections, tuple(settings), made)


def _verdict(found: CalibrationResult, system: System) -> Verdict:
    v, d = found.readings.signal, unit_of(found.control)
    figures = {
        label: (value, ends) for label, value, _, ends in rows(found, system) if label[0] != " "
    }
    said = [
        f"{name} = {value} {unit} ({ends})"
        for label, (value, ends) in figures.items()
        for name, _, unit in [label.partition(", ")]
        if unit in [in_system(each, system).unit for each in (f"{v}/{d}", f"{d}/N", f"{v}/N")]
    ]
    worth = [line for line in remarks(found, system) if line.startswith("compensated with these")]
    doubts = [f"{len(found.suspects)} readings are left out as mistyped."] if found.suspects else []
    sentences = [f"{line[0].upper()}{line[1:]}." for line in worth]
    return Verdict("; ".join(said) + ", 95 % intervals.", "plain", (*sentences, *doubts))


def _readings(found: CalibrationResult, system: System) -> Table:
    d, read = unit_of(found.control), found.readings
    v = read.signal
    volts = [f"v1, {v}", *([f"v3, {v}"] if read.gauge else []), f"residual of v1, {v}"]
    units = [in_system(unit, system) for unit in (d, "N")]
    heads = ("row", "gradient set", f"δ, {units[0].unit}", f"F, {units[1].unit}", *volts)
    return Table(
        heads,
        tuple(_reading_rows(found, [unit.factor for unit in units])),
        f"{len(read.row)} readings, as fitted",
        2,
    )


def _reading_rows(found: CalibrationResult, factors: Sequence[float]) -> Iterator[tuple[str, ...]]:
    read = found.readings
    columns = [
        factors[0] * read.deflection,
        factors[1] * read.force,
        read.v1,
        read.v3,
        found.line.residual,
    ]
    shown = list(zip(columns, _DECIMALS, strict=True))
    if not read.gauge:
        del shown[3]
    for i, row in enumerate(read.row):
        numbers = (f"{column[i]:.{n}f}" for column, n in shown)
        yield str(int(row)), str(read.label[i]), *numbers
