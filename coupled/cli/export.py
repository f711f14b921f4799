"""The command that takes a loader to other simulators: export."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from coupled.cli.app import JsonOption, app
from coupled.cli.progress import progress
from coupled.cli.terminal import check_json, err, give_json, out, refuse_needless, say
from coupled.errors import InputError, nearest
from coupled.resources import find, shipped_rigs

if TYPE_CHECKING:
    from coupled.exporting.fmu.write import Fmu
    from coupled.exporting.write import Export
    from coupled.flight.manoeuvre import Manoeuvre
    from coupled.rig.rig import Rig


@app.command(
    epilog="[dim]Examples: coupled export t37 --jsbsim out/t37-jsbsim"
    " · coupled export t37 --fmu out/t37-column.fmu --control column"
    " · coupled export my-rig.toml --jsbsim DIR --run my-run.toml"
    " · coupled export report-column --jsbsim DIR --run multiplier --case 'digital 20 Hz'[/]"
)
def export(
    rig: Annotated[str, typer.Argument(help="A rig file, or the name of a shipped rig.")],
    jsbsim: Annotated[
        Path | None,
        typer.Option(
            help="Write the JSBSim export to this folder: a new one, or an earlier export."
        ),
    ] = None,
    fmu: Annotated[
        Path | None, typer.Option(help="Write an FMU with machine code for this platform.")
    ] = None,
    control: Annotated[
        str,
        typer.Option(help="With --fmu: its control; required if the rig has several."),
    ] = "",
    fmi: Annotated[
        int, typer.Option(help="With --fmu: version of FMI.", min=2, max=3, show_default=True)
    ] = 3,
    run: Annotated[
        list[str] | None,
        typer.Option(
            help="A run to write scripts for; may be repeated. (default: the rig's shipped runs)"
        ),
    ] = None,
    case: Annotated[
        str,
        typer.Option(help="Label of a case of --run: export this case only, with its rig keys."),
    ] = "",
    rate: Annotated[
        float,
        typer.Option("--loader-rate-Hz", help="Minimum rate of the loader in JSBSim, Hz.", min=1),
    ] = 960.0,
    no_check: Annotated[
        bool,
        typer.Option(
            "--no-check", help="Do not fly the scripts in JSBSim to compare them with coupled."
        ),
    ] = False,
    json_file: JsonOption = "",
) -> None:
    """Write a rig's loader as JSBSim systems with aircraft and scripts, or as an FMU."""
    from coupled.exporting.folder import check_folder, exportable, write_export
    from coupled.exporting.write import RATE_Hz
    from coupled.exporting.write import export as make
    from coupled.rig.rigfile import read_rig

    file = find(rig, shipped_rigs(), "rig")
    if fmu is not None:
        needless = {"--jsbsim": jsbsim, "--run": run and not case, "--no-check": no_check}
        refuse_needless(
            rig, needless | {"--loader-rate-Hz": rate != RATE_Hz}, "leave it out with --fmu"
        )
        exported, _ = (
            _select(read_rig(file), rig, run or [], case) if case else (read_rig(file), [])
        )
        _export_fmu(exported, fmu, control, fmi, file, json_file)
        return
    refuse_needless(rig, {"--control": control, "--fmi": fmi != 3}, "is for --fmu only")
    if jsbsim is None:
        raise InputError(rig, "--jsbsim", "is missing; give it, or --fmu")
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


def _export_fmu(rig: Rig, fmu: Path, control: str, fmi: int, file: Path, json_file: str) -> None:
    from coupled.exporting.fmu.write import check_file, make_fmu, write_fmu

    check_file(fmu)
    check_json(json_file, [file, fmu])
    made = make_fmu(rig, control, 2 if fmi == 2 else 3)
    write_fmu(made, fmu)
    if json_file != "-":
        _say_fmu(made, fmu)
    give_json(made.as_dict(), json_file)


def _say_fmu(made: Fmu, file: Path) -> None:
    for line in made.left:
        err.print(f"[yellow]left out:[/] {escape(line)}", soft_wrap=True)
    say(f"inputs: {', '.join(made.inputs)}")
    say(f"outputs: {', '.join(made.outputs)}")
    say(f"parameters: {len(made.parameters)}; all others are constant")
    say(f"step: {made.frame_s:.9g} s, a frame, or a multiple")
    say(f"FMU: {file}  (FMI {made.fmi}.0, co-simulation, for {made.platform} only)")


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
