"""The report of a calibration: results with intervals, and the readings."""

from __future__ import annotations

from coupled.calibration.figures import basis, remarks, rows
from coupled.calibration.result import CalibrationResult
from coupled.display import System, in_system
from coupled.plots.readings import draw_readings
from coupled.plots.saving import svg_text
from coupled.record.channels import unit_of
from coupled.reports.page import Drawing, Provenance, Report, Section, Text, Verdict
from coupled.tables.calibration import readings_table, results_table

_SHOWN = "The readings, and the fitted lines of S1, K and S3 (figure 4 of the report)."


def calibration_report(
    found: CalibrationResult,
    rig: str,
    readings: str,
    date: str,
    made: Provenance,
    system: System = "si",
) -> Report:
    """Return the report; `rig`, `readings` and `date` are names as given by the user."""
    d = unit_of(found.control)
    read = readings_table(found.readings, d, system, found.line.residual)
    sections = (
        Section(
            "Figures",
            (results_table(found, system), Text(tuple(remarks(found, system)))),
        ),
        Section("Fit", (Drawing(svg_text(draw_readings(found, readings, system)), _SHOWN),)),
        Section("Readings used", (read,)),
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
