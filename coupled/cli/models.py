"""The commands about JSBSim's models: models, new rig."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from coupled.cli.app import JsonOption, app
from coupled.cli.new import new, write_new
from coupled.cli.progress import progress
from coupled.cli.tables.whole import print_whole
from coupled.cli.terminal import check_json, give_json, out
from coupled.errors import InputError, nearest

if TYPE_CHECKING:
    from coupled.surveying.survey import Surveyed


@app.command(epilog="[dim]Examples: coupled models · coupled models T37 DHC6 --json -[/]")
def models(
    names: Annotated[
        list[str] | None, typer.Argument(help="Models to look at. (default: all that are here)")
    ] = None,
    workers: Annotated[
        int,
        typer.Option(
            "--workers", "-j", help="Processes, at most one a core; 0: one a core.", min=0, max=512
        ),
    ] = 0,
    json_file: JsonOption = "",
) -> None:
    """List JSBSim's models: where each trims or why not, how its controls move, its rigs."""
    from coupled.parallel import as_done, cores, executor
    from coupled.surveying.survey import known_models, survey

    known = known_models()
    for name in names or ():
        if name not in known:
            problem = f"there is no JSBSim model {name!r}; {nearest(name, known)}"
            raise InputError("coupled models", "", problem)
    check_json(json_file, [])
    chosen = list(names or known)
    found: dict[str, Surveyed] = {}
    # A survey keeps a core busy, and each process holds a model: more than the cores only cost.
    count = 1 if len(chosen) < 4 else min(cores(workers), cores(0), len(chosen))
    with progress() as advance, executor(count) as pool:
        calls = [(name, known[name]) for name in chosen]
        for one in as_done(pool, survey, calls, 2 * count):
            found[one.model] = one
            advance(one.model, len(found), len(chosen))
    rows = [found[name] for name in chosen]
    if json_file != "-":
        _print(rows)
    give_json([row.as_dict() for row in rows], json_file)


def _print(rows: list[Surveyed]) -> None:
    table = Table("model", "trims at", "controls", "rigs", box=None, pad_edge=False)
    for row in rows:
        where, controls = f"[yellow]no:[/] {escape(row.why)}", ""
        if row.flight is not None:
            speed, height = row.flight.calibrated_airspeed, row.flight.altitude
            held = "" if row.holds else ", does not hold"
            where = f"{speed:g} m/s, {height:g} m{held}"
            controls = ", ".join(row.controls) or "none"
            controls += "" if row.direct or not row.controls else " (by a law or lag)"
        table.add_row(row.model, where, controls, ", ".join(row.rigs))
    print_whole(out, table)
    trimmed = [row for row in rows if row.flight is not None]
    led = [row for row in trimmed if row.controls]
    out.print(f"\n{len(trimmed)} of {len(rows)} trim, {len(led)} can be flown by a rig")


@new.command(
    epilog="[dim]Examples: coupled new rig DHC6 · coupled new rig path/to/mymodel my-rig.toml[/]"
)
def rig(
    model: Annotated[
        str, typer.Argument(help="A JSBSim model that is here, or the folder of another.")
    ],
    file: Annotated[
        Path | None, typer.Argument(help="The new rig file. (default: MODEL.toml)")
    ] = None,
) -> None:
    """Write a first rig for a JSBSim model: where it trims, found; its loader, guessed."""
    from coupled.surveying.draft import draft
    from coupled.surveying.survey import survey

    name, home, own = _model(model)
    path = file or Path(f"{name}.toml")
    with progress() as advance:
        advance(f"where {name} trims", 0, 1)
        found = survey(name, home, speeds=True)
    if found.flight is None:
        raise InputError(model, "", f"does not trim wherever it was tried: {found.why}")
    if not found.controls:
        raise InputError(model, "", f"has no control that a rig could move: {found.lacking[0]}")
    folder = os.path.relpath(home, path.resolve().parent) if own else ""
    text = draft(found, path.stem, folder)
    write_new(path, text, ".toml", "coupled new run, with this rig in it, and coupled compare")


def _model(word: str) -> tuple[str, Path, bool]:
    """Return a model's name, the folder that its own lies in, and whether it is unknown."""
    from coupled.surveying.survey import known_models

    known = known_models()
    if word in known:
        return word, known[word], False
    folder = Path(word)
    if ("/" in word or folder.is_dir()) and (folder / f"{folder.resolve().name}.xml").is_file():
        return folder.resolve().name, folder.resolve().parent, True
    problem = f"is no JSBSim model and no folder of one (NAME/NAME.xml); {nearest(word, known)}"
    raise InputError(word, "", problem)
