"""The commands of many flights: check, sweep."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from coupled.cli.app import (
    JsonOption,
    OverlayOption,
    PanelsOption,
    SizeOption,
    UnitsOption,
    app,
    check_cluster,
)
from coupled.cli.process import was_interrupted
from coupled.cli.progress import progress
from coupled.cli.reporting import ReportOption, check_report, say_report, write_report
from coupled.cli.rigs import say_doubts
from coupled.cli.terminal import check_json, err, keep_json, out, print_json, say
from coupled.errors import InputError
from coupled.files import check_target, write_text
from coupled.outputs import Outputs
from coupled.resources import find, shipped_sweeps

if TYPE_CHECKING:
    import polars as pl

    from coupled.campaign.sweep import SweepResult
    from coupled.display import System
    from coupled.plots.layout import Layout


@app.command(
    epilog="[dim]Examples: coupled check worst-case"
    " · coupled check runs/*.toml --junit out/junit.xml --report out/check.html[/]"
)
def check(
    run: Annotated[list[str], typer.Argument(help="Run files, or names of shipped runs.")],
    junit: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the results as JUnit XML.")
    ] = None,
    json_file: JsonOption = "",
    report: ReportOption = None,
    units: UnitsOption = "si",
) -> None:
    """Fly runs and evaluate their expectations; exit code 1 if any fails."""
    from coupled.campaign.check import check as check_runs
    from coupled.campaign.check import read_expecting
    from coupled.campaign.junit import junit_xml
    from coupled.cli.tables import print_table
    from coupled.flight.manifest import input_files
    from coupled.tables.campaign import verdict_tables

    found = [read_expecting(name) for name in run]
    names = [scenarios[0].name for scenarios in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(name, "", "two of the runs given have this name; give each once")
    inputs = [file for scenarios in found for s in scenarios for file in input_files(s)]
    if junit is not None:
        check_target(junit, inputs)
    own = [*inputs, *([junit] if junit else [])]
    check_json(json_file, [*own, *check_report(report, own)])
    notes = [say_doubts(rig) for rig in {s.rig.name: s.rig for s, *_ in found}.values()]
    with progress() as advance:
        checked = check_runs(found, advance)
    if was_interrupted():  # the last run is incomplete
        raise KeyboardInterrupt
    table = [verdict.as_dict() for verdict in checked.verdicts]
    with Outputs() as outputs:
        if junit is not None:
            write_text(outputs.at(junit), junit_xml(checked.verdicts))
        keep_json(table, json_file, outputs)
        if report is not None:
            from coupled.reports.check import check_report as reported

            note = " ".join(dict.fromkeys(filter(None, notes)))
            write_report(report, outputs, inputs, lambda made: reported(checked, made, units), note)
    if json_file != "-":
        for shown in verdict_tables(checked.verdicts, units):
            print_table(out, shown)
            out.print()
        held = sum(verdict.passed for verdict in checked.verdicts)
        out.print(f"{held} of {checked.total} expectations hold", highlight=False)
        if junit is not None:
            say(f"JUnit XML: {junit}")
        say_report(report)
    print_json(table, json_file)
    if not checked.passed:
        raise typer.Exit(1)


@app.command(
    epilog="[dim]Examples: coupled sweep my-sweep.toml · coupled sweep s.toml -j 1"
    " · coupled sweep sensitivity[/]"
)
def sweep(
    name: Annotated[
        str,
        typer.Argument(metavar="FILE", help="A sweep file (TOML), or the name of a shipped sweep."),
    ],
    folder: Annotated[
        Path | None,
        typer.Option(help="Folder of journal, table and figure. (default: out/NAME)"),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            "-j",
            min=1,
            max=512,
            help="Number of processes. (default: one for each core)",
        ),
    ] = None,
    cluster: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address of a dask scheduler, whose workers fly. (default: this computer)",
        ),
    ] = "",
    figure: Annotated[
        Path | None,
        typer.Option(help="File of the figure: PNG, PDF or SVG. (default: FOLDER/sweep.png)"),
    ] = None,
    json_file: JsonOption = "",
    report: ReportOption = None,
    units: UnitsOption = "si",
    panels: PanelsOption = "",
    overlay: OverlayOption = False,
    size: SizeOption = "",
) -> None:
    """Fly a run over values of its parameters; write one table. Repeat the command to resume."""
    from coupled.campaign.journal import JOURNAL
    from coupled.campaign.plan import read_plan
    from coupled.campaign.sensitivity import INDICES
    from coupled.campaign.sweep import TABLE
    from coupled.campaign.sweep import sweep as fly_all
    from coupled.plots.layout import layout_of
    from coupled.plots.results import check_layout
    from coupled.plots.saving import check_format

    file = find(name, shipped_sweeps(), "sweep")
    check_cluster(workers, cluster)
    plan = read_plan(file)
    layout = layout_of(panels, overlay, size)
    check_layout(plan.sweep, layout)
    target = folder or Path("out") / plan.sweep.name
    if target.is_file():
        raise InputError(target, "", "is a file; give a folder")
    path = figure or target / "sweep.png"
    own = [
        file,
        plan.run_file,
        *sorted(plan.files),
        target / JOURNAL,
        target / TABLE,
        target / INDICES,
    ]
    check_format(path)
    check_target(path, own, made=target)
    check_json(json_file, [*own, path, *check_report(report, [*own, path], target)])
    try:
        with progress() as advance:
            found = fly_all(plan, target, workers, cluster, advance, _say_found)
    except KeyboardInterrupt:
        err.print("[yellow]interrupted:[/] finished flights are kept; the same command goes on")
        raise typer.Exit(130) from None
    _show(found, target, (path, layout), json_file, (report, units))


def _say_found(found: int, flights: int) -> None:
    """Print how many flights the folder has already."""
    if found == flights:
        text = f"all {flights} flights are there already; none is flown again"
        err.print(text, highlight=False)
    elif found:
        err.print(f"{found} flights are there already", highlight=False)


def _show(
    found: SweepResult,
    target: Path,
    figure: tuple[Path, Layout],
    json_file: str,
    handed: tuple[Path | None, System],
) -> None:
    """Draw and print a sweep's table, with indices or boundaries if requested.

    `figure` is the figure's file and layout, `handed` the report's file, if any, and the units.
    """
    (path, layout), (report, units) = figure, handed
    from coupled.campaign.sensitivity import INDICES, write_indices
    from coupled.campaign.sweep import TABLE
    from coupled.cli.tables import print_table
    from coupled.plots.results import draw_result
    from coupled.plots.saving import save
    from coupled.tables.campaign import indices_table, spread_table, survival_table

    asked, table = found.plan.sweep, found.table
    rows = [index.as_dict() for index in found.indices] or table.to_dicts()
    with Outputs() as outputs:
        if found.indices:
            write_indices(found.indices, outputs.at(target / INDICES))
        save(draw_result(found, units, layout), outputs.at(path))
        keep_json(rows, json_file, outputs)
        if report is not None:
            from coupled.reports.sweep import sweep_report

            inputs = [found.plan.file, found.plan.run_file, *sorted(found.plan.files)]
            write_report(report, outputs, inputs, lambda made: sweep_report(found, made, units))
    if json_file != "-":
        print_table(out, spread_table(table, asked.keep, units), gap=1)
        _say_ended(table)
        for sentence in found.remarks:
            out.print(sentence, markup=False, highlight=False)
        if found.limits:
            print_table(out, survival_table(found.limits, found.numeric_keys[0]), gap=1)
        say(f"table: {target / TABLE}  ({len(table)} flights)")
        if found.indices:
            print_table(out, indices_table(found.indices), gap=1)
            say(f"indices: {target / INDICES}")
        say(f"figure: {path}")
        say_report(report)
    print_json(rows, json_file)


def _say_ended(table: pl.DataFrame) -> None:
    """Print how many flights ended early, and why the first of them did."""
    ended = table.filter(table["ended_early"] != "")
    if len(ended):
        first = ended.row(0, named=True)
        why = f"the first, flight {first['flight']}: {first['ended_early']}"
        out.print(f"[yellow]{len(ended)} of {len(table)} ended early[/]; {escape(why)}")
