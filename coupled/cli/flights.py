"""The commands that fly: compare, fly, plot, runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.panel import Panel

from coupled.cli.app import (
    JsonOption,
    OverlayOption,
    PanelsOption,
    RunArgument,
    SizeOption,
    UnitsOption,
    app,
)
from coupled.cli.process import INTERRUPTED
from coupled.cli.progress import progress
from coupled.cli.reporting import ReportOption, check_report, say_report, write_report
from coupled.cli.rigs import say_doubts, say_stale
from coupled.cli.terminal import (
    check_json,
    err,
    give_json,
    keep_json,
    out,
    print_json,
    refuse_needless,
    say,
)
from coupled.errors import InputError, nearest, shown
from coupled.files import check_target
from coupled.outputs import Outputs
from coupled.resources import DEFAULT_RUN, shipped_rigs, shipped_runs, shipped_sweeps
from coupled.timing import timed

if TYPE_CHECKING:
    from coupled.authority.compare import Flight
    from coupled.display import System
    from coupled.flight.manoeuvre import Manoeuvre


@app.command(
    epilog="[dim]Examples: coupled compare · coupled compare pull-up-737 --figure out/737.png"
    " · coupled compare my-run.toml --json - · coupled compare --report out/report.html"
    " · coupled compare --panels surface,force --size 8.5x6cm --figure out/paper.pdf[/]"
)
def compare(
    run: RunArgument = DEFAULT_RUN,
    figure: Annotated[
        Path | None,
        typer.Option(help="File of the figure: PNG, PDF or SVG. (default: out/RUN.png)"),
    ] = None,
    json_file: JsonOption = "",
    no_figure: Annotated[bool, typer.Option("--no-figure", help="Draw no figure.")] = False,
    report: ReportOption = None,
    units: UnitsOption = "si",
    panels: PanelsOption = "",
    overlay: OverlayOption = False,
    size: SizeOption = "",
    case: Annotated[str, typer.Option(help="Label of the case to fly. (default: all)")] = "",
) -> None:
    """Fly a run rigid, uncompensated, with each correction, and with both."""
    from coupled.authority.compare import compare as compare_flights
    from coupled.flight.manifest import input_files
    from coupled.flight.runfile import read_run

    if no_figure:
        drawn = {"--figure": figure, "--panels": panels, "--overlay": overlay, "--size": size}
        refuse_needless(run, drawn, "leave it out with --no-figure")
    cases = read_run(run)
    if case:
        cases = [_labelled(case, cases, run)]
    path = figure or Path("out") / f"{cases[0].name}.png"
    inputs = [file for case in cases for file in input_files(case)]
    if not no_figure:
        from coupled.plots.flights import draw_comparison, panels_of
        from coupled.plots.layout import layout_of
        from coupled.plots.saving import check_format, save

        check_format(path)
        check_target(path, inputs)
        layout = layout_of(panels, overlay, size)
        layout.chosen(panels_of(cases[0]))
    own = inputs if no_figure else [*inputs, path]
    check_json(json_file, [*own, *check_report(report, own)])
    say_stale(cases[0].rig)
    with progress() as advance:
        flights = compare_flights(cases, advance)
    stopped = flights[-1].ended_early.startswith("interrupted")
    no_figure = no_figure or stopped  # no drawing after an interruption
    table = flights.as_dict()
    with timed("draw and write"), Outputs() as outputs:
        if not no_figure:
            save(draw_comparison(flights, units, layout), outputs.at(path))
        keep_json(table, json_file, outputs)
        if report is not None:
            from coupled.reports.comparison import comparison_report

            write_report(
                report, outputs, inputs, lambda made: comparison_report(flights, made, units)
            )
    if json_file != "-":
        _print(flights, units)
        if not no_figure:
            say(f"figure: {path}")
        say_report(report)
    print_json(table, json_file)
    _end(flights)


def _print(flights: Sequence[Flight], system: System) -> None:
    """Print a comparison: its card, a table for each case, remarks, and what ended early."""
    from coupled.authority.figures import remarks, tabulated
    from coupled.cli.tables import broken_heads, print_table
    from coupled.tables.flights import comparison_table

    run, groups = flights[0].manoeuvre, tabulated(flights)
    width = min(92, out.width)
    out.print(Panel(escape(" ".join(run.card.split())), title=escape(run.name), width=width))
    for group in groups:
        title = group[0].outcome.case if len(groups) > 1 else ""
        table = replace(comparison_table(group, system), caption=title)
        print_table(out, broken_heads(table), edge=True)
        out.print()
    for sentence in remarks(flights, system):
        out.print(f"{escape(sentence)}\n", highlight=False)
    for flight in flights:
        o = flight.outcome
        if o.ended_early:
            out.print(f"{escape(o.case)}, {o.configuration}: ended early, {o.ended_early}")


@app.command(epilog="[dim]Example: coupled fly pull-up-t37 --output out/t37.parquet[/]")
def fly(
    run: RunArgument = DEFAULT_RUN,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="File of the record: CSV or Parquet. (default: out/RUN.csv)"
        ),
    ] = None,
    case: Annotated[
        str, typer.Option(help="Label of the case to fly. (default: the first case)")
    ] = "",
    configuration: Annotated[
        str,
        typer.Option(
            help="rigid, uncompensated, 'deflection only', 'gradient only', compensated or"
            " 'calibrated low'. (default: bend and corrections as in the rig file)"
        ),
    ] = "",
    json_file: JsonOption = "",
) -> None:
    """Fly one case of a run; write its record, and a manifest beside it."""
    from coupled.authority.compare import AS_THE_RIG, fly_and_judge
    from coupled.flight.manifest import input_files
    from coupled.flight.manoeuvre import EVERY_CONFIGURATION
    from coupled.flight.runfile import read_run
    from coupled.record.record import check_suffix, manifest_path, write_record

    cases = read_run(run)
    manoeuvre = _labelled(case, cases, run) if case else cases[0]
    for known in EVERY_CONFIGURATION:
        if configuration == known:
            manoeuvre = manoeuvre.configured(known)
    if configuration and configuration not in EVERY_CONFIGURATION:
        hint = nearest(configuration, EVERY_CONFIGURATION)
        raise InputError(run, "--configuration", f"no {configuration!r}; {hint}")
    path = output or Path("out") / f"{manoeuvre.name}.csv"
    check_suffix(path)
    inputs = input_files(manoeuvre)
    for target in (path, manifest_path(path)):
        check_target(target, inputs)
    check_json(json_file, [*inputs, path, manifest_path(path)])
    say_doubts(manoeuvre.rig)
    with progress() as advance:
        flight = fly_and_judge(
            manoeuvre,
            configuration or AS_THE_RIG,
            lambda done, total: advance(manoeuvre.label, done, total),
        )
    record, figures = flight.record, flight.outcome.as_dict()
    with timed("write"), Outputs() as outputs:
        write_record(record, outputs.at(path))
        keep_json(figures, json_file, outputs)
    if json_file != "-":
        say(f"record: {path}  ({len(record)} rows, {len(record.channels)} channels)")
        say(f"manifest: {manifest_path(path)}")
        for control, when in record.manifest["stop_first_met_s"].items():
            out.print(f"the {control} met its stop, first at {when:.2f} s")
    print_json(figures, json_file)
    if flight.ended_early:
        err.print(f"[yellow]ended early:[/] {flight.ended_early}; the record so far is kept")
    _end([flight])


def _labelled(label: str, cases: Sequence[Manoeuvre], run: str) -> Manoeuvre:
    """Return the case of a run with a label. Raises InputError if there is none."""
    by_label = {each.label: each for each in cases}
    if label not in by_label:
        raise InputError(run, "--case", f"no case {label!r}; {nearest(label, by_label)}")
    return by_label[label]


@app.command(epilog="[dim]Example: coupled plot out/t37.csv --figure out/t37.pdf[/]")
def plot(
    record: Annotated[Path, typer.Argument(help="A record, CSV or Parquet.")],
    figure: Annotated[
        Path | None,
        typer.Option(help="File of the figure: PNG, PDF or SVG. (default: RECORD.png)"),
    ] = None,
) -> None:
    """Draw the channels of a record over time."""
    from coupled.plots.saving import check_format, save
    from coupled.record.record import check_suffix, read_record

    check_suffix(record)
    path = figure or record.with_suffix(".png")
    check_format(path)
    check_target(path, [record])
    save(read_record(record).plot(title=shown(record.stem)), path)
    say(f"figure: {path}")


@app.command()
def runs(json_file: JsonOption = "") -> None:
    """List the shipped runs and sweeps, what each shows, and the shipped rigs."""
    from coupled.cli.tables import print_table
    from coupled.schema import load_toml
    from coupled.tables.rigs import runs_table

    check_json(json_file, [])
    cards = {name: load_toml(path) for name, path in shipped_runs().items()}
    if json_file != "-":
        print_table(out, runs_table(cards))
        out.print("\nsweeps: " + ", ".join(shipped_sweeps()))
        out.print("rigs: " + ", ".join(shipped_rigs()))
    rows = [
        {"run": n, "rig": c["rig"], "card": " ".join(c["card"].split())} for n, c in cards.items()
    ]
    give_json(rows, json_file)


def _end(flights: Sequence[Flight]) -> None:
    """Exit with the reason if a flight ended early."""
    early = [flight.ended_early for flight in flights if flight.ended_early]
    if early:
        stopped = any(why.startswith("interrupted") for why in early)
        raise typer.Exit(INTERRUPTED if stopped else 1)
