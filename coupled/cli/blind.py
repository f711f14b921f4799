"""The commands of blind trials: make, score."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from coupled.cli.app import app
from coupled.errors import InputError
from coupled.terminal import progress, say

blind = typer.Typer(no_args_is_help=True, help="Make sealed trials, and score their diagnoses.")
app.add_typer(blind, name="blind")


@blind.command(epilog="[dim]Example: coupled blind make out/trials --records 60 --key key.json[/]")
def make(
    folder: Annotated[Path, typer.Argument(help="A new folder for records, rigs and seal.")],
    key: Annotated[
        Path | None, typer.Option(metavar="FILE", help="The key.  [default: DIR.key.json]")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, help="For the same bytes again.  [default: drawn]")
    ] = None,
    records: Annotated[int, typer.Option(min=1, max=9999, help="How many.")] = 300,
    rigs: Annotated[int, typer.Option(min=0, max=999, help="Rigs beside the shipped ones.")] = 24,
) -> None:
    """Write sealed records of an independent twin, with and without effects; the key apart."""
    from coupled.blind.make import make as make_trials

    path = key or folder.with_name(folder.name + ".key.json")
    if folder.is_file():
        raise InputError(folder, "", "is a file; give a new folder")
    with progress() as advance:
        make_trials(folder, path, seed, records, rigs, advance)
    say(f"records: {folder / 'records'}  ({records}, with their rigs in {folder / 'records.toml'})")
    say(f"seal: {folder / 'seal.toml'}")
    say(f"key: {path}  (not to be opened before the diagnoses are made)")
