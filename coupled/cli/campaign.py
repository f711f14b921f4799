"""The commands of many flights: check."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coupled.cli.app import JsonOption, app
from coupled.errors import InputError
from coupled.files import check_target, write_text
from coupled.terminal import check_json, give_json, out, progress, say


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
    from coupled.flight.loop import input_files
    from coupled.tables.campaign import print_verdicts

    found = [read_expecting(name) for name in run]
    names = [scenarios[0].run.name for scenarios in found]
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
