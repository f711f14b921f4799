"""The force document: cover, table of checks, and each test with its conditions and figure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from coupled.calibration.documentation import Documentation
from coupled.calibration.qualification import FeelTest, Issue, check_numbers, cover_rows, feel_tests
from coupled.calibration.reasons import reasons
from coupled.calibration.result import CalibrationResult
from coupled.display import System, pressure_in
from coupled.plots.checks import draw_releases, draw_static_checks
from coupled.plots.documentation import draw_deflections, draw_forces
from coupled.plots.readings import draw_readings
from coupled.plots.saving import svg_text
from coupled.record.channels import ControlName
from coupled.reports.page import (
    Block,
    Cover,
    Drawing,
    Provenance,
    Report,
    Section,
    Verdict,
)
from coupled.tables.calibration import check_heads, check_row, checks_table
from coupled.tables.table import Table
from coupled.version import __version__

_SIGNED = ("Prepared", "Checked", "Accepted")
_NAMED = 8  # failed checks listed on the first page
Fits = Mapping[ControlName, tuple[CalibrationResult, str] | None]


def force_report(
    documents: Sequence[Documentation],
    fits: Fits,
    issue: Issue,
    made: Provenance,
    system: System = "si",
) -> Report:
    """Return the force document of the controls of a rig, in the units of `system`."""
    tests = [
        (found, test) for found in documents for test in feel_tests(found, issue.reference, system)
    ]
    sections = [Section("Checks", (_checks([test for _, test in tests], system),), own_page=True)]
    sections += [_test(found, test, system) for found, test in tests]
    sections += [_beside(found, fits.get(found.control), system) for found in documents]
    rig = documents[0].rig
    cover = Cover(cover_rows(documents, issue, __version__), _SIGNED)
    settings = (("rig", rig.name), ("frame rate", f"{rig.frame_rate:g} Hz"))
    why = [
        f"{d.control}: {each}"
        for d in documents
        for each in reasons(d.rig, d.control, d.checks, system)
    ]
    verdict = _verdict([test for _, test in tests], system)
    verdict = replace(verdict, remarks=(*verdict.remarks, *why))
    return Report("Force documentation", rig.name, verdict, tuple(sections), settings, made, cover)


def force_summary(
    documents: Sequence[Documentation], issue: Issue, made: Provenance, system: System = "si"
) -> Report:
    """Return the report with the table of checks only."""
    tests = [test for found in documents for test in feel_tests(found, issue.reference, system)]
    rig = documents[0].rig
    sections = (Section("Checks", (_checks(tests, system),)),)
    return Report("Force documentation", rig.name, _verdict(tests, system), sections, (), made)


def _verdict(tests: Sequence[FeelTest], system: System) -> Verdict:
    checks = [(test, check) for test in tests for check in test.checks]
    failed = [(test, check) for test, check in checks if not check.passed]
    said = f"{len(checks) - len(failed)} of {len(checks)} checks are within their tolerance."
    remarks = [
        f"{test.number}, {test.title}, q̄ = {pressure_in(check.pressure_Pa, system)}: {check.name}"
        f" is {measured} {unit}, the reference {reference} ± {allowed}."
        for test, check in failed[:_NAMED]
        for measured, reference, allowed, unit in [check_numbers(check, system)]
    ]
    if len(failed) > _NAMED:
        remarks.append(f"{len(failed) - _NAMED} more fail; the table of checks has all.")
    return Verdict(said, "bad" if failed else "good", tuple(remarks))


def _checks(tests: Sequence[FeelTest], system: System) -> Table:
    """Return the table of all checks, each with its test and the number of its figure."""
    rows = tuple(
        (test.number, test.control, *check_row(check, system), str(number))
        for number, test in enumerate(tests, 1)
        for check in test.checks
    )
    heads = ("test", "control", "check", *check_heads(system), "figure")
    return Table(heads, rows, align="lllrrrrlrlr")


def _test(found: Documentation, test: FeelTest, system: System) -> Section:
    """Return the page of one test: conditions, tolerances, results, figure."""
    alone = replace(found, conditions=(test.condition,))
    draw = draw_static_checks if test.kind == "static" else draw_releases
    place = pressure_in(test.condition.pressure_Pa, system)
    caption = f"{test.number}: {test.title}, q̄ = {place}."
    blocks = (
        Table(("conditions", ""), test.conditions, align="l"),
        Table(("tolerances", ""), test.tolerances, align="l"),
        checks_table("", test.checks, system),
        Drawing(svg_text(draw(alone, system)), caption),
    )
    return Section(f"{test.number}: {test.title}", blocks, own_page=True)


def _beside(
    found: Documentation, fit: tuple[CalibrationResult, str] | None, system: System
) -> Section:
    """Return the further figures of a control: forces, deflections, and the calibration."""
    return Section(
        f"{found.control}, further figures", tuple(_drawn(found, fit, system)), own_page=True
    )


def _drawn(
    found: Documentation, fit: tuple[CalibrationResult, str] | None, system: System
) -> Iterator[Block]:
    name = found.control
    forces = "Force against true deflection, swept both ways, with and without compensation."
    yield Drawing(svg_text(draw_forces(found, system)), f"{name}: {forces}")
    computed = "Computed against true deflection, and the error of the host's estimate."
    yield Drawing(svg_text(draw_deflections(found, system)), f"{name}: {computed}")
    if fit is not None:
        shown = f"Readings and fit (the report's figure 4), from {fit[1]}."
        yield Drawing(svg_text(draw_readings(*fit, system)), f"{name}: {shown}")
