"""The command `fit`: fits a nominal rig to records of a healthy machine."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.cli.app import JsonOption, WideOption, app
from coupled.cli.progress import progress
from coupled.cli.recordfiles import RECORDS, check_rig_target, files_read, read_each
from coupled.cli.rigs import ControlOption, say_guesses
from coupled.cli.terminal import check_json, keep_json, out, print_json, say
from coupled.errors import shown
from coupled.files import write_text
from coupled.outputs import Outputs
from coupled.record.channels import control_named
from coupled.resources import find, shipped_rigs

if TYPE_CHECKING:
    from coupled.gap.nominal import NominalFit


@app.command(
    epilog="[dim]Examples: coupled fit well1.csv well2.csv --rig start.toml --output axis.toml"
    " · coupled fit well.csv --rig start.toml --free loader.mass_kg --free loader.friction_N[/]"
)
def fit(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="RECORD...", help=f"Records of the healthy machine, {RECORDS}."),
    ],
    rig: Annotated[
        str, typer.Option(help="The rig to start from: a rig file, or the name of a shipped rig.")
    ],
    free: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KEY",
            help="Key of the control to fit, as loader.mass_kg; may be repeated. (default: mass,"
            " damping, G_B, friction, offset, delay, servo, bend, play, as the channels allow)",
        ),
    ] = None,
    control: ControlOption = "column",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="NEW.toml",
            help="Write the fitted rig to this file. (default: only print it)",
        ),
    ] = None,
    json_file: JsonOption = "",
    wide: WideOption = False,
) -> None:
    """Fit a nominal rig to records of a healthy machine; list undetermined parameters."""
    from coupled.gap.nominal import fit_nominal
    from coupled.rig.rigfile import read_rig

    name = control_named(control, logs[0])
    rig_file = find(rig, shipped_rigs(), "rig")
    inputs = files_read(logs, rig_file)
    check_json(json_file, [*inputs, *check_rig_target(output, "--output", inputs)])
    start = read_rig(rig_file)
    records = read_each(logs)
    with progress() as advance:
        fitted = fit_nominal(start, records, free or (), name, advance)
    say_guesses(fitted.rig, (name,))
    with Outputs() as outputs:
        if output is not None:
            text = _text(fitted, rig_file, logs)
            write_text(outputs.at(output), text)
        keep_json(fitted.as_dict(), json_file, outputs)
    if json_file != "-":
        with out.widened(wide):
            _print(fitted)
        if output is not None:
            say(f"fitted rig: {output}")
    print_json(fitted.as_dict(), json_file)


def _text(fitted: NominalFit, rig_file: Path, logs: list[Path]) -> str:
    from coupled.files import read_text
    from coupled.rig.rigedit import differences, edited
    from coupled.rig.rigfile import read_rig

    names = ", ".join(shown(log.name) for log in logs)
    remark = f"{shown(rig_file.name)} with what was fitted to {names}.\n"
    remark += "The tolerances are halves of 95 % intervals.\n"
    remark += "".join(f"Not distinguished: {one.words}.\n" for one in fitted.alike)
    as_filed = [number.words for number in fitted.numbers if number.half is None]
    remark += "".join(f"{words[0].upper()}{words[1:]}.\n" for words in as_filed)
    changes = differences(read_rig(rig_file), fitted.rig)
    return edited(read_text(rig_file, "a rig file is wanted"), changes, remark)


def _print(fitted: NominalFit) -> None:
    from coupled.cli.tables import print_table
    from coupled.tables.gaps import channels_table, numbers_table

    print_table(out, numbers_table(fitted.numbers), edge=True)
    out.print()
    print_table(out, channels_table(fitted.channels), edge=True)
    for one in fitted.alike:
        say(f"not distinguished: {one.words}")
    for doubt in fitted.doubts:
        say(f"doubtful: {doubt}")
    for number in fitted.numbers:
        if number.half is None:
            say(number.words)
    for number in fitted.numbers:
        if number.at_bound:
            say(f"at the bound of its range: {number.key}")
