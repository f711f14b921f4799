"""The commands of many flights: check, sweep."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.cli.app import JsonOption, app
from coupled.cli.terminal import check_json, err, give_json, out, progress, say
from coupled.errors import InputError
from coupled.files import check_target, write_text
from coupled.resources import find, shipped_sweeps

if TYPE_CHECKING:
    import polars as pl

    from coupled.campaign.plan import Plan


@app.command(
    epilog="[dim]Examples: coupled check worst-case"
    " · coupled check runs/*.toml --junit out/junit.xml[/]"
)
def check(
    run: Annotated[list[str], typer.Argument(help="Run files, or names of shipped ones.")],
    junit: Annotated[Path | None, typer.Option(metavar="FILE", help="Write JUnit XML.")] = None,
    json_file: JsonOption = "",
) -> None:
    """Fly runs and hold them against their expectations; exit code 1 if any fails."""
    from coupled.campaign.check import check_run, read_expecting
    from coupled.campaign.junit import junit_xml
    from coupled.cli.tables.campaign import print_verdicts
    from coupled.flight.loop import input_files

    found = [read_expecting(name) for name in run]
    names = [scenarios[0].name for scenarios in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(name, "", "two of the runs have this name")
    inputs = [file for scenarios in found for s in scenarios for file in input_files(s)]
    if junit is not None:
        check_target(junit, inputs)
    check_json(json_file, [*inputs, *([junit] if junit else [])])
    with progress() as advance:
        verdicts = [verdict for scenarios in found for verdict in check_run(scenarios, advance)]
    if json_file != "-":
        print_verdicts(out, verdicts)
    if junit is not None:
        write_text(junit, junit_xml(verdicts))
        if json_file != "-":
            say(f"JUnit XML: {junit}")
    give_json([verdict.as_dict() for verdict in verdicts], json_file)
    if not all(verdict.passed for verdict in verdicts):
        raise typer.Exit(1)


@app.command(
    epilog="[dim]Examples: coupled sweep my-sweep.toml · coupled sweep s.toml -j 1"
    " · coupled sweep sensitivity[/]"
)
def sweep(
    name: Annotated[
        str, typer.Argument(metavar="FILE", help="A sweep file, TOML, or a shipped one's name.")
    ],
    folder: Annotated[
        Path | None,
        typer.Option(help="Of the flights and their table.  [default: out/NAME]"),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", "-j", min=1, max=512, help="Processes.  [default: all cores]"),
    ] = None,
    cluster: Annotated[
        str, typer.Option(metavar="ADDRESS", help="Of a dask scheduler, to fly there instead.")
    ] = "",
    figure: Annotated[
        Path | None, typer.Option(help="PNG, PDF or SVG.  [default: FOLDER/sweep.png]")
    ] = None,
    json_file: JsonOption = "",
) -> None:
    """Fly a run over values of its parameters, to one table; called again, it goes on."""
    from coupled.campaign.journal import JOURNAL, opened
    from coupled.campaign.plan import read_plan
    from coupled.campaign.sensitivity import INDICES
    from coupled.campaign.sweep import TABLE, fly_sweep, write_table
    from coupled.parallel import executor
    from coupled.plots.saving import check_format

    file = find(name, shipped_sweeps(), "sweep")
    if cluster and workers is not None:
        raise InputError("--workers", "", "a cluster has its own; leave it out")
    plan = read_plan(file)
    target = folder or Path("out") / plan.sweep.name
    if target.is_file():
        raise InputError(target, "", "is a file; give a folder")
    path = figure or target / "sweep.png"
    own = [file, plan.run_file, target / JOURNAL, target / TABLE, target / INDICES]
    check_format(path)
    check_target(path, own)
    check_json(json_file, [*own, path])
    pool_of = workers or os.cpu_count() or 1
    try:
        with executor(pool_of, cluster) as pool, opened(target, plan.identity) as journal:
            if journal.done:
                err.print(f"{len(journal.done)} flights are there already", highlight=False)
            with progress() as advance:
                found = fly_sweep(plan, journal, pool, advance)
            write_table(found, target / TABLE)
    except KeyboardInterrupt:
        err.print("[yellow]interrupted:[/] finished flights are kept; the same command goes on")
        raise typer.Exit(130) from None
    _show(plan, found, target, path, json_file)


def _show(plan: Plan, found: pl.DataFrame, target: Path, path: Path, json_file: str) -> None:
    """Draw and print a sweep's table, with its indices or boundaries where they are asked for."""
    from coupled.campaign.sensitivity import INDICES, sensitivity, write_indices
    from coupled.campaign.survival import limits
    from coupled.campaign.sweep import TABLE
    from coupled.cli.tables.campaign import print_indices, print_survival, print_sweep
    from coupled.plots.campaign import draw_sweep
    from coupled.plots.saving import save
    from coupled.plots.sensitivity import draw_sensitivity
    from coupled.plots.survival import draw_survival

    asked, told = plan.sweep, []
    if asked.method == "sensitivity" and asked.samples is not None:
        told = sensitivity(found, plan.keys, asked.keep, asked.samples)
        write_indices(told, target / INDICES)
    numeric = [key for key in plan.keys if found[key].dtype.is_numeric()]
    alive = limits(found, numeric[0]) if asked.survive and numeric else []
    if told:
        drawn = draw_sensitivity(told)
    elif alive:
        drawn = draw_survival(asked.name, numeric[0], alive)
    else:
        drawn = draw_sweep(found, plan.keys, asked.keep)
    save(drawn, path)
    if json_file != "-":
        print_sweep(out, found, asked.keep)
        print_survival(out, alive)
        say(f"table: {target / TABLE}  ({len(found)} flights)")
        if told:
            print_indices(out, told)
            say(f"indices: {target / INDICES}")
        say(f"figure: {path}")
    give_json([asdict(index) for index in told] if told else found.to_dicts(), json_file)
