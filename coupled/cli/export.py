"""The command `export`: writes a loader as JSBSim systems."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from coupled.cli.app import JsonOption, app
from coupled.cli.progress import progress
from coupled.cli.terminal import check_json, err, give_json, out, say
from coupled.errors import InputError, nearest
from coupled.resources import find, shipped_rigs

if TYPE_CHECKING:
    from coupled.exporting.write import Export
    from coupled.flight.manoeuvre import Manoeuvre
    from coupled.rig.rig import Rig


@app.command(
    epilog="[dim]Examples: coupled export t37 --jsbsim out/t37-jsbsim"
    " · coupled export my-rig.toml --jsbsim DIR --run my-run.toml"
    " · coupled export report-column --jsbsim DIR --run multiplier --case 'digital 20 Hz'[/]"
)
def export(
    rig: Annotated[str, typer.Argument(help="A rig file, or the name of a shipped one.")],
    jsbsim: Annotated[Path, typer.Option(help="The folder to write: new, or a former export.")],
    run: Annotated[
        list[str] | None,
        typer.Option(help="A run to write scripts of; may be repeated. (default: the rig's)"),
    ] = None,
    case: Annotated[
        str, typer.Option(help="Export the rig as this case of the run has it, and this case only.")
    ] = "",
    rate: Annotated[
        float, typer.Option("--loader-rate-Hz", help="Least rate of the loader.", min=1)
    ] = 960.0,
    no_check: Annotated[
        bool, typer.Option("--no-check", help="Do not fly the scripts by JSBSim alone.")
    ] = False,
    json_file: JsonOption = "",
) -> None:
    """Write a rig's loader as JSBSim systems, with the aircraft and scripts that JSBSim flies."""
    from coupled.exporting.folder import check_folder, exportable, write_export
    from coupled.exporting.write import export as make
    from coupled.rig.rigfile import read_rig

    file = find(rig, shipped_rigs(), "rig")
    check_folder(jsbsim)
    check_json(json_file, [file])
    exported, cases = _select(read_rig(file), rig, run or [], case)
    flown, others = exportable(exported, cases)
    with progress() as advance:
        made = make(exported, flown, file, rate, not no_check, advance)
    write_export(made, jsbsim)
    if json_file != "-":
        _say(made, jsbsim, others)
    give_json([one.as_dict() for one in made.beside], json_file)


def _select(rig: Rig, name: str, runs: list[str], case: str) -> tuple[Rig, list[Manoeuvre]]:
    """Return the rig to export, and the cases of the scripts."""
    from coupled.exporting.folder import runs_of
    from coupled.flight.runfile import read_run

    named = runs or runs_of(name)
    cases = [each for word in named for each in read_run(word)]
    if not case:
        return rig, cases
    chosen = {each.label: each for each in cases}
    if case not in chosen:
        raise InputError(", ".join(named), "--case", f"no case {case!r}; {nearest(case, chosen)}")
    return chosen[case].rig, [chosen[case]]


def _say(made: Export, folder: Path, others: list[str]) -> None:
    from coupled.cli.tables import print_table
    from coupled.tables.flights import export_table

    if made.beside:
        print_table(out, export_table(made))
    for line in made.left:
        err.print(f"[yellow]left out:[/] {escape(line)}", soft_wrap=True)
    for line in made.scripted:
        err.print(f"[yellow]by the scripts only:[/] {escape(line)}", soft_wrap=True)
    for line in others:
        err.print(f"[yellow]no script:[/] {escape(line)}", soft_wrap=True)
    if made.said:
        err.print(f"[yellow]JSBSim says:[/] {escape(made.said)}", soft_wrap=True)
    if not made.within:
        err.print("[yellow]further off than 1 % of travel, 2 % of force or half a point[/]")
    say(
        f"folder: {folder}  ({len(made.files)} files; the loader takes {made.substeps} steps a run)"
    )
