"""The command line: parses, calls, prints.

Exit code 0 when all went well, 1 when a flight ended before its time, 2 for input that
cannot be used (one line says why, and nothing is written).
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table
from typer.exceptions import TyperException

from coupled import __version__
from coupled.errors import InputError
from coupled.files import check_target, write_text
from coupled.resources import DEFAULT_RUN, shipped_rigs, shipped_runs
from coupled.terminal import check_json, err, give_json, out, progress, say, say_error

if TYPE_CHECKING:
    from coupled.authority import Flight

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Fly a JSBSim aircraft through a compliant control loader.",
    epilog="[dim]First steps: coupled compare · coupled runs · coupled fly pull-up-t37[/]",
)

RunArgument = Annotated[
    str, typer.Argument(help="A run file, or the name of a shipped one (coupled runs).")
]
JsonOption = Annotated[
    str, typer.Option("--json", metavar="FILE", help="Write the table as JSON; - prints it.")
]


def main() -> None:
    """Run the command line; every fault of input is one line and exit code 2."""
    try:
        code = app(standalone_mode=False)
    except InputError as error:
        say_error(str(error))
        code = 2
    except TyperException as error:  # a word of the command line that it does not know
        say_error(" ".join(str(error).split()) + " (coupled --help shows what there is)")
        code = 2
    except (typer.Abort, KeyboardInterrupt):
        code = 130
    except BrokenPipeError:
        sys.stderr.close()
        code = 1
    sys.exit(code if isinstance(code, int) else 0)


def _version(wanted: bool) -> None:
    if wanted:
        out.print(f"coupled {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Fly a JSBSim aircraft through a compliant control loader."""


@app.command(
    epilog="[dim]Examples: coupled compare · coupled compare pull-up-737 --figure out/737.png"
    " · coupled compare my-run.toml --json -[/]"
)
def compare(
    run: RunArgument = DEFAULT_RUN,
    figure: Annotated[
        Path | None, typer.Option(help="The figure: PNG, PDF or SVG.  [default: out/RUN.png]")
    ] = None,
    json_file: JsonOption = "",
    no_figure: Annotated[bool, typer.Option("--no-figure", help="Draw nothing.")] = False,
) -> None:
    """Fly a run rigid, uncompensated, with each correction, and with both."""
    from coupled.authority import compare as compare_flights
    from coupled.flight.scenario import read_run
    from coupled.tables import print_comparison

    scenarios = read_run(run)
    path = figure or Path("out") / f"{scenarios[0].run.name}.png"
    inputs = [scenarios[0].file, *(scenario.rig_file for scenario in scenarios)]
    if not no_figure:
        from coupled.plots import check_format

        check_format(path)
        check_target(path, inputs)
    check_json(json_file, [*inputs, path])
    with progress() as advance:
        flights = compare_flights(scenarios, advance)
    if json_file != "-":
        print_comparison(out, flights)
    if not no_figure:
        from coupled.plots import draw_comparison, save

        save(draw_comparison(flights), path)
        if json_file != "-":
            say(f"figure: {path}")
    give_json([flight.outcome.as_dict() for flight in flights], json_file)
    _end(flights)


@app.command(epilog="[dim]Example: coupled fly pull-up-t37 --output out/t37.parquet[/]")
def fly(
    run: RunArgument = DEFAULT_RUN,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Record, CSV or Parquet.  [default: out/RUN.csv]"),
    ] = None,
    case: Annotated[str, typer.Option(help="Case to fly, by its label; else the first.")] = "",
    configuration: Annotated[
        str,
        typer.Option(help="One of compare's configurations; else the rig as it is."),
    ] = "",
    json_file: JsonOption = "",
) -> None:
    """Fly one run and write its record, and a manifest beside it."""
    from coupled.authority import judge
    from coupled.errors import nearest
    from coupled.flight.loop import fly as fly_scenario
    from coupled.flight.loop import input_files
    from coupled.flight.scenario import CONFIGURATIONS, read_run
    from coupled.record import check_suffix, manifest_path, write_record

    scenarios = {scenario.label: scenario for scenario in read_run(run)}
    if case and case not in scenarios:
        raise InputError(run, "--case", f"no case {case!r}; {nearest(case, scenarios)}")
    scenario = scenarios[case] if case else next(iter(scenarios.values()))
    for known in CONFIGURATIONS:
        if configuration == known:
            scenario = scenario.configured(known)
    if configuration and configuration not in CONFIGURATIONS:
        hint = nearest(configuration, CONFIGURATIONS)
        raise InputError(run, "--configuration", f"no {configuration!r}; {hint}")
    path = output or Path("out") / f"{scenario.run.name}.csv"
    check_suffix(path)
    inputs = input_files(scenario)
    for target in (path, manifest_path(path)):
        check_target(target, inputs)
    check_json(json_file, [*inputs, path, manifest_path(path)])
    with progress() as advance:
        record = fly_scenario(scenario, lambda done, total: advance(scenario.label, done, total))
    write_record(record, path)
    outcome = judge(scenario, configuration or "as the rig file says", record)
    if json_file != "-":
        say(f"record: {path}  ({len(record)} rows, {len(record.channels)} channels)")
        say(f"manifest: {manifest_path(path)}")
        for control, when in record.manifest["stop_first_met_s"].items():
            out.print(f"the {control} met its stop, first at {when:.2f} s")
    give_json(outcome.as_dict(), json_file)
    if outcome.ended_early:
        err.print(f"[yellow]ended early:[/] {outcome.ended_early}; the record so far is kept")
        raise typer.Exit(1)


@app.command(epilog="[dim]Example: coupled plot out/t37.csv --figure out/t37.pdf[/]")
def plot(
    record: Annotated[Path, typer.Argument(help="A record, CSV or Parquet.")],
    figure: Annotated[
        Path | None, typer.Option(help="PNG, PDF or SVG.  [default: beside the record]")
    ] = None,
) -> None:
    """Draw a record."""
    from coupled.plots import check_format, draw_record, save
    from coupled.record import check_suffix, read_record

    check_suffix(record)
    path = figure or record.with_suffix(".png")
    check_format(path)
    check_target(path, [record])
    save(draw_record(read_record(record), record.stem), path)
    say(f"figure: {path}")


@app.command(epilog="[dim]Example: coupled diagnose out/737.csv --rig 737 --json out/737.json[/]")
def diagnose(
    record: Annotated[Path, typer.Argument(help="A record, CSV or Parquet.")],
    rig: Annotated[str, typer.Option(help="Its rig file, or the name of a shipped one.")],
    control: Annotated[str, typer.Option(help="column, wheel or pedals.")] = "column",
    improve: Annotated[
        Path | None, typer.Option(metavar="NEW.toml", help="Write the rig with the effects found.")
    ] = None,
    json_file: JsonOption = "",
) -> None:
    """Tell where a record departs from its rig, which effect causes it, and how far it shrinks."""
    from coupled.channels import CONTROL_NAMES
    from coupled.gap.diagnose import diagnose as find_gap
    from coupled.gap.diagnose import in_words
    from coupled.record import read_record
    from coupled.resources import find
    from coupled.rig.rigfile import read_rig
    from coupled.rig.rigwrite import rig_text
    from coupled.tables import print_stages

    rig_file = find(rig, shipped_rigs(), "rig")
    inputs = [record, rig_file]
    if improve is not None:
        check_target(improve, inputs)
    check_json(json_file, [*inputs, *([improve] if improve else [])])
    for name in CONTROL_NAMES:
        if name == control:
            nominal = read_rig(rig_file)
            diagnosis, improved = find_gap(nominal, read_record(record), name, record)
            break
    else:
        raise InputError(record, "--control", f"is {control!r}; one of {', '.join(CONTROL_NAMES)}")
    if json_file != "-":
        out.print(in_words(diagnosis, control), markup=False, highlight=False)
        print_stages(out, diagnosis)
    if improve is not None:
        remark = f"{rig_file.name} with what was found in {record.name}:\n"
        write_text(improve, rig_text(improved, remark + in_words(diagnosis, control)))
        if json_file != "-":
            say(f"improved rig: {improve}")
    give_json(diagnosis, json_file)


@app.command()
def runs(json_file: JsonOption = "") -> None:
    """List the shipped run files, what each shows, and the shipped rigs."""
    from coupled.schema import load_toml

    check_json(json_file, [])
    cards = {name: load_toml(path) for name, path in shipped_runs().items()}
    if json_file != "-":
        table = Table("run", "rig", "what it shows", box=None, pad_edge=False)
        for name, card in cards.items():
            table.add_row(name, card["rig"], _sentence(card["card"]))
        out.print(table)
        out.print("\nrigs: " + ", ".join(shipped_rigs()))
    rows = [
        {"run": n, "rig": c["rig"], "card": " ".join(c["card"].split())} for n, c in cards.items()
    ]
    give_json(rows, json_file)


def _sentence(card: str) -> str:
    """Return the first sentence of a card."""
    return " ".join(card.split()).partition(". ")[0].rstrip(".") + "."


def _end(flights: list[Flight]) -> None:
    if any(flight.outcome.ended_early for flight in flights):
        raise typer.Exit(1)
