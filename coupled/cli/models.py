"""The commands about JSBSim's models: models, new rig."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from coupled.cli.app import JsonOption, UnitsOption, app
from coupled.cli.new import check_new, new, write_new
from coupled.cli.progress import progress
from coupled.cli.rigs import ControlOption
from coupled.cli.tables.whole import print_whole
from coupled.cli.terminal import check_json, give_json, out, say
from coupled.display import System, in_system
from coupled.errors import InputError, shown
from coupled.files import path_from
from coupled.record.channels import TIME, ControlName, control_named

if TYPE_CHECKING:
    from coupled.record.record import Record
    from coupled.surveying.fromlog import LogNumbers
    from coupled.surveying.survey import Surveyed


@app.command(
    epilog="[dim]Examples: coupled models · coupled models T37 DHC6 --json -"
    " · coupled models ~/fgdata/Aircraft[/]"
)
def models(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Models, their files, or folders of models. (default: all known)"),
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
    from coupled.surveying.survey import chosen_models
    from coupled.surveying.whole import survey_models

    chosen_models(names or ())
    check_json(json_file, [])
    with progress() as advance:
        found = survey_models(names or (), workers, advance)
    if json_file != "-":
        _print(found.models)
    give_json(found.as_dict(), json_file)


def _print(rows: Sequence[Surveyed]) -> None:
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
    epilog="[dim]Examples:\n\n"
    "coupled new rig DHC6\n\n"
    "coupled new rig path/to/mymodel my-rig.toml\n\n"
    "coupled new rig --bench yoke.toml\n\n"
    "coupled new rig --bench yoke.toml --set travel=4in --set gradient=12lbf/in --set servo=no\n\n"
    "coupled new rig --from log.csv yoke.toml --units us[/]"
)
def rig(
    model: Annotated[
        str | None,
        typer.Argument(help="A JSBSim model that is here, or the folder or file of another."),
    ] = None,
    file: Annotated[
        Path | None, typer.Argument(help="The new rig file. (default: MODEL.toml)")
    ] = None,
    bench: Annotated[
        bool, typer.Option("--bench", help="Without an aircraft: FILE alone; a few questions.")
    ] = False,
    log: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="LOG",
            help="Without an aircraft, by a log of a slow sweep and of releases: a record, or with"
            " --map any log that coupled import takes.",
        ),
    ] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", metavar="MAP.toml", help="The log's map (--from).")
    ] = None,
    given: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="What is known of a control on the bench, instead of a question: travel, gradient,"
            " breakout, friction, mass, damping, bend, servo=yes or no; as travel=4in.",
        ),
    ] = None,
    control: ControlOption = "column",
    units: UnitsOption = "si",
) -> None:
    """Write a first rig: for a JSBSim model, or of a control on the bench. Guesses are listed."""
    if bench or log is not None:
        if file is not None:
            problem = "give the new rig's file alone: a bench has no model"
            raise InputError("new rig", str(file), problem)
        path = Path(model or "my-rig.toml")
        _bench(path, (log, map_file), given or [], control_named(control, "new rig"), units)
        return
    if model is None:
        raise InputError("new rig", "", "give a JSBSim model, or --bench, or --from LOG")
    if given or map_file is not None or control != "column" or units != "si":
        used = "--set" if given else "--map" if map_file else "--control"
        used = "--units" if units != "si" and used == "--control" and control == "column" else used
        raise InputError("new rig", used, "goes with --bench or --from")
    _for_model(model, file)


def _bench(
    path: Path,
    logged: tuple[Path | None, Path | None],
    given: list[str],
    control: ControlName,
    units: System,
) -> None:
    """Write a rig without an aircraft; at a terminal, ask for what is not given."""
    from coupled.rig.rigfile import rig_from_table
    from coupled.schema import loads_toml
    from coupled.surveying.benchrig import answer, bench_rig, questions, split_answers, yes
    from coupled.surveying.fromlog import numbers_from_log

    log, map_file = logged
    check_new(path, ".toml")
    if map_file is not None and log is None:
        raise InputError("new rig", "--map", "goes with --from LOG")
    answers, asked = split_answers(given, control), questions(control)
    numbers = {
        name: answer(text, asked[name], units) for name, text in answers.items() if name in asked
    }
    found = None
    if log is not None:
        found = numbers_from_log(_logged(log, map_file), control, log)
    servo = yes(answers["servo"]) if "servo" in answers else False
    if log is None and sys.stdin is not None and sys.stdin.isatty():
        if "servo" not in answers:
            servo = typer.confirm("a servo or motor moves the control?", default=False)
        numbers = _asked(control, numbers, servo, units)
    text = bench_rig(path.stem, control, numbers, servo, found, shown(log.name) if log else "")
    rig_from_table(loads_toml(text, path), path)  # a rig that cannot be flown is refused
    write_new(path, text, ".toml", f"coupled new run --rig {path}")
    if found is not None:
        _print_found(found, control, units)


def _logged(log: Path, map_file: Path | None) -> Record:
    """Return a log as a record: its own file, or by a map."""
    from coupled.record.importing.convert import import_log
    from coupled.record.record import read_record

    if map_file is not None:
        return import_log(log, map_file)[0]
    try:
        return read_record(log)
    except InputError as error:
        if error.key != TIME:
            raise
        problem = f"is no record: {error.problem}. Give --map MAP.toml, which"
        problem += " coupled import LOG --suggest MAP.toml writes"
        raise InputError(log, error.key, problem) from None


def _asked(
    control: ControlName, known: dict[str, float], servo: bool, units: System
) -> dict[str, float]:
    """Return the numbers known and those that a person answers; an empty answer is a guess."""
    from coupled.surveying.benchrig import answer, guesses, questions

    found = dict(known)
    for name, question in questions(control).items():
        if name in found:
            continue
        unit = in_system(question.unit, units)
        guess = unit.written(guesses(control, servo)[name])
        while True:
            words = f"{question.words}, {unit.unit} (Enter: guess {guess})"
            text = typer.prompt(words, default="", show_default=False)
            if not text.strip():
                break
            try:
                found[name] = answer(text, question, units)
                break
            except InputError as error:
                say(error.problem)
    return found


def _print_found(found: LogNumbers, control: ControlName, units: System) -> None:
    """Print what a log gives of a control, and how sure it is."""
    from coupled.surveying.benchrig import found_in, questions

    numbers, sure = found_in(found)
    table = Table("of the log", "value", "", box=None, pad_edge=False)
    for name, value in numbers.items():
        question = questions(control)[name]
        unit = in_system(question.unit, units)
        words = "determined" if name in sure else "the log does not determine it: a guess"
        if name == "travel":
            words = "the greatest in the log: a guess"
        table.add_row(question.words, f"{unit.written(value)} {unit.unit}", words)
    print_whole(out, table)


def _for_model(model: str, file: Path | None) -> None:
    """Write a first rig for a JSBSim model: where it trims, found; its loader, guessed."""
    from coupled.surveying.draft import draft
    from coupled.surveying.survey import chosen_model, survey

    chosen = chosen_model(model)
    path = file or Path(f"{chosen.file or chosen.model}.toml")
    check_new(path, ".toml")
    with progress() as advance:
        advance(f"where {chosen.label} trims", 0, 1)
        found = survey(chosen, speeds=True)
    if found.flight is None:
        raise InputError(model, "", f"does not trim wherever it was tried: {found.why}")
    if not found.controls:
        raise InputError(model, "", f"has no control that a rig could move: {found.lacking[0]}")
    folder = path_from(path.parent, chosen.home) if chosen.own else ""
    text = draft(found, path.stem, folder)
    write_new(path, text, ".toml", f"coupled new run --rig {path}, and coupled compare")
