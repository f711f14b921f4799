"""The figure, notebook display and report of each class of result.

`DISPLAYS` has one entry per class. A notebook shows the verdict and the first sections of the
report.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

from coupled.authority.authoritymap import AuthorityMap
from coupled.authority.compare import Comparison, Flight
from coupled.authority.stability.stabilitymap import Stability
from coupled.calibration.forcedocument import ForceDocument
from coupled.calibration.readings import Readings
from coupled.calibration.readingsplan import ReadingsPlan
from coupled.calibration.result import CalibrationResult
from coupled.campaign.check import CheckResult
from coupled.campaign.sweep import SweepResult
from coupled.errors import InputError
from coupled.exporting.write import Export
from coupled.files import check_target, write_text
from coupled.gap.findings.diagnosis import Diagnosis, PartDiagnosis, WholeDiagnosis
from coupled.gap.nominal import NominalFit
from coupled.plots.checks import draw_static_checks
from coupled.plots.fits import draw_fit
from coupled.plots.flights import draw_comparison
from coupled.plots.gaps import shown_parts
from coupled.plots.gapview import View
from coupled.plots.histories import Figure, draw_record
from coupled.plots.ladder import draw_ladder
from coupled.plots.raw_readings import draw_raw_readings
from coupled.plots.readings import draw_readings
from coupled.plots.results import draw_result
from coupled.plots.rigs import draw_rig
from coupled.plots.saving import make_drawable, with_note
from coupled.plots.verdicts import draw_verdicts
from coupled.record.record import Record
from coupled.reports.analyses import (
    draw_map,
    draw_planes,
    map_report,
    plan_report,
    readings_report,
    stability_report,
)
from coupled.reports.calibration import calibration_report
from coupled.reports.check import check_report
from coupled.reports.comparison import comparison_report
from coupled.reports.diagnosis import diagnosis_report
from coupled.reports.forces import force_report, force_summary
from coupled.reports.page import InputFile, Provenance, Report, render, render_part
from coupled.reports.provenance import provenance_of
from coupled.reports.records import draw_flight, fit_report, flight_report, record_report
from coupled.reports.rigs import export_report, rig_report, survey_report, terms_report
from coupled.reports.sweep import sweep_report
from coupled.rig.guesses import guess_note
from coupled.rig.rig import Rig
from coupled.surveying.modelsurvey import Survey
from coupled.surveying.terms import ModelTerms

_ALL = 100  # sections


@dataclass(frozen=True)
class _Display:
    """The report and figure functions of a class, and the number of sections in a notebook."""

    report: Callable[[Any, Provenance], Report]
    draw: Callable[[Any], Figure] | None = None
    sections: int = _ALL
    rig: Callable[[Any], Rig | None] = lambda result: None
    brief: Callable[[Any, Provenance], Report] | None = None  # for notebooks


def _diagnosed(found: Diagnosis, made: Provenance) -> Report:
    return diagnosis_report(found, ", ".join(Path(name).name for name in found.records), made)


_DIAGNOSIS = _Display(
    _diagnosed,
    lambda found: draw_ladder(View(shown_parts(found)[0])),
    rig=lambda found: found.nominal,
)
DISPLAYS: dict[type, _Display] = {
    Rig: _Display(rig_report, draw_rig, rig=lambda rig: rig),
    Record: _Display(record_report, draw_record, 1),
    Flight: _Display(flight_report, draw_flight, rig=lambda flight: flight.manoeuvre.rig),
    Comparison: _Display(
        lambda found, made: comparison_report(found.flights, made),
        lambda found: draw_comparison(found.flights),
        3,
        lambda found: found[0].manoeuvre.rig,
    ),
    PartDiagnosis: _DIAGNOSIS,
    WholeDiagnosis: _DIAGNOSIS,
    NominalFit: _Display(fit_report, draw_fit, rig=lambda found: found.rig),
    SweepResult: _Display(sweep_report, draw_result),
    CheckResult: _Display(check_report, draw_verdicts),
    CalibrationResult: _Display(
        lambda found, made: calibration_report(found, "", "readings", "", made),
        lambda found: draw_readings(found, "readings"),
        2,
    ),
    AuthorityMap: _Display(map_report, draw_map, rig=lambda found: found.rig),
    Stability: _Display(stability_report, draw_planes, rig=lambda found: found.rig),
    ForceDocument: _Display(
        lambda found, made: force_report(found.controls, found.fits, found.issue, made),
        lambda found: draw_static_checks(found.controls[0]),
        rig=lambda found: found.rig,
        brief=lambda found, made: force_summary(found.controls, found.issue, made),
    ),
    ReadingsPlan: _Display(plan_report, rig=lambda found: found.rig),
    Readings: _Display(readings_report, draw_raw_readings),
    Survey: _Display(survey_report),
    ModelTerms: _Display(terms_report),
    Export: _Display(export_report, rig=lambda found: found.rig),
}


def draw(result: Any) -> Figure:
    """Return the figure of a result."""
    way = DISPLAYS[type(result)]
    assert way.draw is not None
    figure = way.draw(result)
    note = _guesses(result)
    if "Guesses, not measurements" not in " ".join(figure.get_suptitle().split()):
        with_note(figure, note)
    make_drawable(figure)
    return figure


def html(result: Any) -> str:
    """Return a result as a self-contained part of an HTML page."""
    way = DISPLAYS[type(result)]
    report = way.brief or way.report
    return render_part(_noted(report(result, _made(result)), result), way.sections)


def write_report(result: Any, file: str | PathLike[str]) -> None:
    """Write the report of a result. Raises InputError if `file` is not .html or not writable."""
    path = Path(file)
    if path.suffix.lower() not in (".html", ".htm"):
        raise InputError(path, "", "a report is one HTML file: its name ends in .html")
    check_target(path)
    write_text(path, render(_noted(DISPLAYS[type(result)].report(result, _made(result)), result)))


def _guesses(result: Any) -> str:
    """Return a sentence on the assumed values of the result's rig, or ""."""
    rig = DISPLAYS[type(result)].rig(result)
    return "" if rig is None else guess_note(rig.controls)


def _noted(report: Report, result: Any) -> Report:
    """Return a report whose verdict names the assumed values of the rig, once."""
    note, said = _guesses(result), report.verdict.remarks
    if not note or any("Guesses, not measurements" in remark for remark in said):
        return report
    return replace(report, verdict=replace(report.verdict, remarks=(*said, note)))


def _made(result: Any) -> Provenance:
    """Return the provenance of a result, with the text of its rig."""
    made = provenance_of(f"coupled, from Python: {type(result).__name__}", [])
    rig = DISPLAYS[type(result)].rig(result)
    if rig is None:
        return made
    text = rig.to_toml()
    digest = hashlib.sha256(text.encode()).hexdigest()
    return Provenance(made.command, made.versions, (InputFile(f"{rig.name}.toml", digest, text),))
