"""The commands `models`, `terms` and `new rig`: JSBSim's models, and draft rigs for them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coupled.cli.app import JsonOption, UnitsOption, app
from coupled.cli.new import check_new, new, word_of, write_new
from coupled.cli.progress import progress
from coupled.cli.rigs import ControlOption
from coupled.cli.terminal import check_json, give_json, out, say
from coupled.display import System, in_system
from coupled.errors import InputError, shown
from coupled.files import path_from
from coupled.record.channels import TIME, ControlName, control_named

if TYPE_CHECKING:
    from coupled.record.record import Record
    from coupled.rig.parameters import Flight
    from coupled.surveying.fromlog import LogNumbers
    from coupled.surveying.survey import Surveyed


@app.command(
    epilog="[dim]Examples: coupled models · coupled models T37 DHC6 --json -"
    " · coupled models ~/fgdata/Aircraft[/]"
)
def models(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of JSBSim models, XML files, or folders of models. (default: all known)"
        ),
    ] = None,
    workers: Annotated[
        int,
        typer.Option(
            "--workers",
            "-j",
            help="Number of processes, at most one for each core; 0: one for each core.",
            min=0,
            max=512,
        ),
    ] = 0,
    json_file: JsonOption = "",
) -> None:
    """List JSBSim models: where each trims or why not, how its controls move, its rigs."""
    from coupled.surveying.modelsurvey import survey_models
    from coupled.surveying.survey import chosen_models

    chosen_models(names or ())
    check_json(json_file, [])
    with progress() as advance:
        found = survey_models(names or (), workers, advance)
    if json_file != "-":
        _print(found.models)
    give_json(found.as_dict(), json_file)


@app.command(epilog="[dim]Examples: coupled terms c172p · coupled terms T37 --run pull-up-t37[/]")
def terms(
    model: Annotated[
        str,
        typer.Argument(
            help="Name of a JSBSim model (coupled models), or your model's folder or XML file."
        ),
    ],
    run: Annotated[
        str,
        typer.Option(
            help="A run file, or a shipped run, whose first case is flown. (default: a doublet"
            " and a 3-2-1-1 on each surface)"
        ),
    ] = "",
    json_file: JsonOption = "",
) -> None:
    """List the named functions of a model's aerodynamics, with axis and share in a flight.

    The share is that of the axis's total. The table flight.terms of a rig file scales
    them by name.
    """
    from coupled.cli.tables import print_table
    from coupled.surveying.terms import list_terms
    from coupled.tables.rigs import terms_table

    check_json(json_file, [])
    with progress() as advance:
        found = list_terms(model, run or None, advance)
    if json_file != "-":
        print_table(out, terms_table(found))
        say(f"shares in {found.flown}, {_place(found.flight)}")
    give_json(found.as_dict(), json_file)


def _place(flight: Flight) -> str:
    return f"from {flight.calibrated_airspeed:g} m/s, {flight.altitude:g} m"


def _print(rows: Sequence[Surveyed]) -> None:
    from coupled.cli.tables import print_table
    from coupled.tables.rigs import models_table

    print_table(out, models_table(rows))
    trimmed = [row for row in rows if row.flight is not None]
    led = [row for row in trimmed if row.controls]
    out.print(f"\n{len(trimmed)} of {len(rows)} trim, {len(led)} can be flown by a rig")


@new.command(
    epilog="[dim]Examples:\n\n"
    "coupled new rig DHC6\n\n"
    "coupled new rig path/to/mymodel my-rig.toml\n\n"
    "coupled new rig DHC6 airframe.toml --airframe-only\n\n"
    "coupled new rig --bench yoke.toml\n\n"
    "coupled new rig --bench yoke.toml --set travel=4in --set gradient=12lbf/in --set servo=no\n\n"
    "coupled new rig --from log.csv yoke.toml --units us[/]"
)
def rig(
    model: Annotated[
        str | None,
        typer.Argument(
            help="Name of a JSBSim model (coupled models), or your model's folder or XML file."
        ),
    ] = None,
    file: Annotated[
        Path | None, typer.Argument(help="The new rig file. (default: MODEL.toml)")
    ] = None,
    bench: Annotated[
        bool,
        typer.Option(
            "--bench",
            help="A control without an aircraft: give FILE only; the command asks for its numbers.",
        ),
    ] = False,
    log: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="LOG",
            help="A control without an aircraft, its numbers estimated from a slow sweep and"
            " releases in LOG: a record, or with --map any log that coupled import reads.",
        ),
    ] = None,
    map_file: Annotated[
        Path | None, typer.Option("--map", metavar="MAP.toml", help="With --from: the log's map.")
    ] = None,
    given: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="NAME=VALUE",
            help="With --bench or --from: a known number, as travel=4in; may be repeated. Names:"
            " travel, gradient, breakout, friction, mass, damping, bend, servo (yes or no).",
        ),
    ] = None,
    control: ControlOption = "column",
    airframe_only: Annotated[
        bool,
        typer.Option("--airframe-only", help="Write the aircraft alone, without controls."),
    ] = False,
    units: UnitsOption = "si",
) -> None:
    """Write a rig file for a JSBSim model, or for a control alone; guesses are listed in it."""
    if bench or log is not None:
        if file is not None:
            problem = "give the new rig's file alone: a bench has no model"
            raise InputError("new rig", str(file), problem)
        if airframe_only:
            raise InputError("new rig", "--airframe-only", "a bench has no aircraft")
        path = Path(model or "my-rig.toml")
        _bench(path, (log, map_file), given or [], control_named(control, "new rig"), units)
        return
    if model is None:
        raise InputError("new rig", "", "give a JSBSim model, or --bench, or --from LOG")
    if given or map_file is not None or control != "column" or units != "si":
        used = "--set" if given else "--map" if map_file else "--control"
        used = "--units" if units != "si" and used == "--control" and control == "column" else used
        raise InputError("new rig", used, "goes with --bench or --from")
    _for_model(model, file, airframe_only)


def _bench(
    path: Path,
    logged: tuple[Path | None, Path | None],
    given: list[str],
    control: ControlName,
    units: System,
) -> None:
    """Write a rig without an aircraft; on a terminal, prompt for numbers not given."""
    from coupled.gap.checks import check_record
    from coupled.record.samples import frame_rate_of
    from coupled.rig.parameters import plain_name
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
    found, record, rate_Hz = None, None, 120.0
    if log is not None:
        record = _logged(log, map_file)
        rate_Hz = frame_rate_of(record, log)
        found = numbers_from_log(record, control, log)
    servo = yes(answers["servo"]) if "servo" in answers else False
    if log is None and sys.stdin is not None and sys.stdin.isatty():
        if "servo" not in answers:
            servo = typer.confirm("a servo or motor moves the control?", default=False)
        numbers = _prompt_for_numbers(control, numbers, servo, units)
    source = shown(log.name) if log else ""
    text = bench_rig(plain_name(path.stem), control, numbers, servo, found, source, rate_Hz)
    rig = rig_from_table(loads_toml(text, path), path)  # a rig that cannot be flown is refused
    if record is not None:
        check_record(rig, record, control, log)
    write_new(path, text, ".toml", f"coupled new run --rig {word_of(path)}")
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


def _prompt_for_numbers(
    control: ControlName, known: dict[str, float], servo: bool, units: System
) -> dict[str, float]:
    """Return the known numbers and the answers to prompts; an empty answer is a guess."""
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
    """Print the numbers of a control found in a log, with their errors."""
    from coupled.cli.tables import print_table
    from coupled.surveying.benchrig import found_in, questions
    from coupled.tables.rigs import logged_table

    print_table(out, logged_table(*found_in(found), questions(control), units))


def _for_model(model: str, file: Path | None, airframe_only: bool) -> None:
    """Write a draft rig for a JSBSim model, with computed trim and assumed loader."""
    from coupled.rig.parameters import plain_name
    from coupled.surveying.draft import draft
    from coupled.surveying.survey import chosen_model, surveyed

    chosen = chosen_model(model)
    path = file or Path(f"{chosen.file or chosen.model}.toml")
    check_new(path, ".toml")
    with progress() as advance:
        advance(f"where {chosen.label} trims", 0, 1)
        found = surveyed(model, chosen, airframe_only)
    folder = path_from(path.parent, chosen.home) if chosen.own else ""
    text = draft(found, plain_name(path.stem), folder, airframe_only)
    then = f"coupled new run --rig {word_of(path)}, and coupled compare"
    then = f"coupled diagnose RECORD --rig {word_of(path)}" if airframe_only else then
    write_new(path, text, ".toml", then)
