"""The command `document`: force documentation and control checks."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.cli.app import JsonOption, UnitsOption, app
from coupled.cli.progress import progress
from coupled.cli.reporting import ReportOption, check_report, say_report, write_report
from coupled.cli.rigs import DEFAULT_RIG, rig_and_control, say_doubts
from coupled.cli.terminal import check_json, keep_json, out, print_json, say
from coupled.errors import InputError, shown
from coupled.files import check_target, write_text
from coupled.outputs import Outputs
from coupled.record.channels import ControlName
from coupled.resources import find, shipped_rigs

if TYPE_CHECKING:
    from coupled.calibration.documentation import Documentation
    from coupled.display import System
    from coupled.rig.rig import Rig


@app.command(
    epilog="[dim]Examples: coupled document · coupled document 737 --control column"
    " · coupled document new.toml --readings my.csv --output doc"
    " · coupled document 737 --control column --aircraft measured.csv"
    " · coupled document 737 --revision B --date 2031-05-17 --report out/737.html"
    " · coupled document t37 --control column --write new.toml[/]"
)
def document(
    rig: Annotated[
        str, typer.Argument(help="A rig file, or the name of a shipped rig.")
    ] = DEFAULT_RIG,
    control: Annotated[
        str, typer.Option(help="One control only: column, wheel or pedals. (default: all)")
    ] = "",
    readings: Annotated[
        Path | None, typer.Option(help="Readings to draw, CSV. (default: simulated readings)")
    ] = None,
    specified: Annotated[
        str,
        typer.Option(
            help="A rig file, or a shipped rig, with the specified schedule, mass, damping and"
            " friction. (default: RIG)"
        ),
    ] = "",
    aircraft: Annotated[
        Path | None,
        typer.Option(
            help="CSV of forces measured on the aircraft, the reference of the static checks."
            " (default: the schedule is)"
        ),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(
            help="Write a rig whose mass, damping and force lead depend on the gradient, so that"
            " compensated releases are as specified; document this rig."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of the pages. (default: out/RIG-document)"),
    ] = None,
    every: Annotated[
        bool,
        typer.Option(
            "--all",
            help="Print all checks. (default: failed ones, and the least margin of each kind)",
        ),
    ] = False,
    date: Annotated[str, typer.Option(help="Date of the document, any text.")] = "",
    revision: Annotated[str, typer.Option(help="Revision of the document, any text.")] = "",
    json_file: JsonOption = "",
    report: ReportOption = None,
    units: UnitsOption = "si",
) -> None:
    """Document a rig's forces: X-Y plots, figure 4, and 14 CFR Part 60 control checks.

    Exit code 1 if a check fails; the reason is printed below the checks.
    """
    from coupled.calibration.documentation import controls_of
    from coupled.calibration.forcedocument import document_rig
    from coupled.plots.documentation import draw_pages
    from coupled.rig.rigfile import read_rig

    file = find(rig, shipped_rigs(), "rig")
    data = read_rig(file)
    reference = find(specified, shipped_rigs(), "rig") if specified else None
    wanted = read_rig(reference) if reference else None
    chosen = [rig_and_control(rig, control)[2]] if control else controls_of(data)
    folder = output or Path("out") / f"{data.name}-document"
    pdf = folder / f"{data.name}.pdf"
    inputs = [file, *(path for path in (readings, reference, aircraft) if path is not None)]
    if folder.is_file():
        raise InputError(folder, "--output", "is a file; give a folder")
    check_target(pdf, inputs, made=folder)
    own = [*inputs, pdf, *([write] if write else [])]
    check_json(json_file, [*own, *check_report(report, own, folder)])
    say_doubts(data)
    text = ""
    if write is not None:
        data, text = _with_release_schedule(data, chosen, file, write, [*inputs, pdf])
    only = chosen[0] if control else None
    with progress() as advance:
        found = document_rig(
            data, only, readings, wanted, aircraft, date, revision, progress=advance
        )
    if write is not None:
        name = f"{shown(file.name)}, with mass, damping and a lead that go with the gradient"
        digest = hashlib.sha256(text.encode()).hexdigest()
        found = replace(found, issue=replace(found.issue, rig_file=name, rig_sha256=digest))
    table = found.as_dict()
    with progress("drawing the pages"), Outputs() as outputs:
        written = draw_pages(
            found.controls, found.fits, found.issue, outputs.folder(folder), outputs.at(pdf), units
        )
        if write is not None:
            write_text(outputs.at(write), text)
        keep_json(table, json_file, outputs)
        if report is not None:
            from coupled.reports.forces import force_report

            write_report(
                report,
                outputs,
                inputs,
                lambda made: force_report(found.controls, found.fits, found.issue, made, units),
            )
    if json_file != "-":
        _print(found.controls, every, data.flight is not None, units)
        say(f"{len(written)} figures and {pdf.name} in {folder}")
        if write is not None:
            say(f"rig: {write}")
        say_report(report)
    print_json(table, json_file)
    if not found.passed:
        raise typer.Exit(1)


def _print(documents: Sequence[Documentation], every: bool, judged: bool, units: System) -> None:
    """Print each control's checks and reasons; `judged`: surfaces are checked too."""
    from coupled.calibration.reasons import reasons
    from coupled.cli.tables import print_table
    from coupled.tables.calibration import checks_table, narrowest

    for found in documents:
        shown = found.checks if every else narrowest(found.checks)
        print_table(out, checks_table(found.control, shown, units))
        good = sum(check.passed for check in found.checks)
        out.print(f"{found.control}: {good} of {len(found.checks)} checks pass", highlight=False)
        for sentence in reasons(found.rig, found.control, found.checks, units):
            out.print(f"  {sentence}", highlight=False)
        out.print()
    if not judged:
        out.print("no aircraft: the surface's position is not judged\n")


def _with_release_schedule(
    rig: Rig, chosen: list[ControlName], file: Path, target: Path, inputs: list[Path]
) -> tuple[Rig, str]:
    """Return the rig whose compensated releases are as specified, and its text."""
    from coupled.calibration.releaseschedule import schedule_for_release
    from coupled.rig.rigfile import rig_from_table
    from coupled.rig.rigwrite import rig_text
    from coupled.schema import loads_toml

    if target.suffix.lower() != ".toml":
        raise InputError(target, "--write", "a rig file ends in .toml")
    check_target(target, inputs)
    bent = [name for name in chosen if rig.controls[name].compensation.gradient]
    if not bent:
        key = f"controls.{chosen[0]}.compensation.gradient"
        problem = "is false; only releases with the gradient correction need --write"
        raise InputError(file, key, problem)
    for name in bent:
        rig = schedule_for_release(rig, name)
    remark = f"{shown(file.name)}, mass, damping and a lead by the gradient on {', '.join(bent)}"
    text = rig_text(rig, remark)
    rig_from_table(loads_toml(text, target), target)  # a rig that cannot be flown is refused
    return rig, text
