"""The commands of blind trials: make, score."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.blind.trials import NEWEST
from coupled.cli.app import JsonOption, app, check_cluster
from coupled.cli.progress import progress
from coupled.cli.terminal import check_json, keep_json, out, print_json, say
from coupled.errors import InputError
from coupled.files import check_target, named
from coupled.outputs import Outputs

if TYPE_CHECKING:
    from coupled.blind.trials.result import Score

blind = typer.Typer(no_args_is_help=True, help="Make sealed trials, and score diagnoses of them.")
app.add_typer(blind, name="blind")


@blind.command(epilog="[dim]Example: coupled blind make out/trials --records 60 --key key.json[/]")
def make(
    folder: Annotated[Path, typer.Argument(help="A new folder for records, rigs and seal.")],
    key: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="File of the key, the true effects. (default: FOLDER.key.json)"
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Seed; the same seed gives the same files. (default: random)"),
    ] = None,
    records: Annotated[int, typer.Option(min=1, max=9999, help="Number of records.")] = 300,
    rigs: Annotated[
        int, typer.Option(min=0, max=999, help="Number of random rigs beside the version's own.")
    ] = 24,
    trials: Annotated[
        int, typer.Option(min=1, help="Version of the trials: effects, sizes, flights.")
    ] = NEWEST,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers",
            "-j",
            min=0,
            max=512,
            help="Number of processes; 0: one for each core. (default: 0)",
        ),
    ] = None,
    cluster: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address of a dask scheduler, whose workers make them. (default: this computer)",
        ),
    ] = "",
) -> None:
    """Write sealed records of an independent twin, with and without effects, and their key."""
    from coupled.blind.trials.make import make as make_trials

    processes, address = check_cluster(workers, cluster)
    path = key or named(folder).with_name(folder.name + ".key.json")
    if folder.is_file():
        raise InputError(folder, "", "is a file; give a new folder")
    try:
        with progress() as advance:
            made = make_trials(
                folder,
                path,
                seed,
                records,
                rigs,
                advance,
                version=trials,
                workers=processes,
                cluster=address,
            )
    except KeyboardInterrupt:
        if folder.is_dir():
            say(f"finished records are kept in {folder}: the same command continues")
        raise
    if made.before:
        say(f"{folder} is finished already, by these numbers: nothing was made")
    say(f"records: {folder / 'records'}  ({records}, with their rigs in {folder / 'records.toml'})")
    say(f"seal: {folder / 'seal.toml'}")
    say(f"key: {path}  (not to be opened before the diagnoses are made)")


@blind.command(
    epilog="[dim]Example: coupled blind score out/diagnoses --key out/trials.key.json[/]"
)
def score(
    diagnoses: Annotated[
        Path, typer.Argument(help="Folder of the diagnoses: rNNN.json for each record.")
    ],
    key: Annotated[Path, typer.Option(metavar="FILE", help="File of the trials' key.")],
    seal: Annotated[
        Path | None,
        typer.Option(
            help="File of the trials' seal. (default: FOLDER/seal.toml for FOLDER.key.json)"
        ),
    ] = None,
    json_file: JsonOption = "",
    figure: Annotated[
        Path | None,
        typer.Option(help="Draw power and reliability: PNG, PDF or SVG. (default: no figure)"),
    ] = None,
) -> None:
    """Score diagnoses of sealed trials against their key, with exact 95 % intervals."""
    from coupled.blind.trials.answers import read_answers
    from coupled.blind.trials.key import SEAL, check_seal, read_key
    from coupled.blind.trials.score import score as score_answers

    own = named(key).name.removesuffix(".json").removesuffix(".key")
    sealed = seal or key.with_name(own) / SEAL
    inputs = [key, sealed, *diagnoses.glob("*.json")]
    if figure is not None:
        from coupled.plots.saving import check_format

        check_format(figure)
        check_target(figure, inputs)
    check_json(json_file, [*inputs, *([figure] if figure else [])])
    truth = read_key(key)
    check_seal(key, sealed)
    found = score_answers(read_answers(diagnoses, truth))
    with Outputs() as outputs:
        if figure is not None:
            from coupled.plots.saving import save
            from coupled.plots.trials import draw_score

            save(draw_score(found), outputs.at(figure))
        keep_json(found.as_dict(), json_file, outputs)
    if json_file != "-":
        _print(found)
        if figure is not None:
            say(f"figure: {figure}")
    print_json(found.as_dict(), json_file)


def _print(found: Score) -> None:
    """Print a score: shares with their exact intervals, power, and the confusions."""
    from coupled.cli.tables import print_table
    from coupled.tables.trials import confusion_table, detection_table, score_table

    print_table(out, score_table(found))
    stated = found.probabilities
    if stated.brier is not None:
        out.print(f"\nBrier score of {stated.effects} probabilities: {stated.brier:.3f}")
    if found.missing:
        out.print(f"[yellow]without a diagnosis:[/] {found.missing} of {found.records}")
    for table in (detection_table(found), confusion_table(found)):
        out.print()
        print_table(out, table)
