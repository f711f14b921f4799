"""The commands `new run`, `sweep`, `map`, `readings` and `feel`: commented templates."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from coupled.cli.app import UnitsOption, app
from coupled.cli.progress import progress
from coupled.cli.rigs import ControlOption, rig_and_control
from coupled.cli.terminal import say
from coupled.errors import InputError, nearest, shown
from coupled.files import check_target, path_from, read_text, write_text
from coupled.outputs import Outputs
from coupled.record.channels import CONTROL_NAMES
from coupled.resources import shipped_rigs, starter

new = typer.Typer(no_args_is_help=True, help="Write a first file, with comments, to edit.")
app.add_typer(new, name="new")


@new.command(
    epilog="[dim]Examples: coupled new run pull.toml, then coupled compare ./pull.toml"
    " · coupled new run pull.toml --rig my-rig.toml[/]"
)
def run(
    file: Annotated[Path, typer.Argument(help="The new file.")] = Path("my-run.toml"),
    rig: Annotated[
        str,
        typer.Option(
            metavar="RIG",
            help="A rig file, or the name of a shipped rig: write cases at speeds where it"
            " trims, with forces that suit it. (default: fixed cases of the T-37)",
        ),
    ] = "",
    control: ControlOption = "column",
) -> None:
    """Write a run file: rig, pilot, cases, measures and expectations."""
    if rig:
        check_new(file, ".toml")
        write_new(file, _run_for(rig, control, file), ".toml", f"coupled compare {word_of(file)}")
        return
    if control != "column":
        raise InputError("new run", "--control", "goes with --rig; the starter pulls the column")
    write_new(file, _text("run.toml"), ".toml", f"coupled compare {word_of(file)}")


@new.command(epilog="[dim]Example: coupled new sweep s.toml, then coupled sweep ./s.toml[/]")
def sweep(
    file: Annotated[Path, typer.Argument(help="The new file.")] = Path("my-sweep.toml"),
) -> None:
    """Write a sweep file: a run flown over two of its parameters."""
    write_new(file, _text("sweep.toml"), ".toml", f"coupled sweep {word_of(file)}")


@new.command(
    "map", epilog="[dim]Example: coupled new map m.toml, then coupled import LOG --map m.toml[/]"
)
def map_(
    file: Annotated[Path, typer.Argument(help="The new file.")] = Path("my-map.toml"),
) -> None:
    """Write a map file: channels of a log from its columns, with units, signs and clock."""
    write_new(file, _text("map.toml"), ".toml", f"coupled import LOG --map {word_of(file)}")


@new.command(
    epilog="[dim]Examples: coupled new readings · coupled new readings w.csv --control wheel[/]"
)
def readings(
    file: Annotated[Path, typer.Argument(help="The new file.")] = Path("my-readings.csv"),
    control: Annotated[str, typer.Option(help="column, wheel or pedals.")] = "column",
    inches: Annotated[
        bool,
        typer.Option("--inches", help="Use in (on a wheel °) and lb. (default: mm or °, and N)"),
    ] = False,
) -> None:
    """Write a form for calibration readings, with an instruction in each row.

    coupled calibrate --plan --write FILE writes one with the most informative readings of your rig.
    """
    from coupled.calibration.form import starting_form

    if control not in CONTROL_NAMES:
        hint = nearest(control, CONTROL_NAMES)
        raise InputError("new readings", "--control", f"no {control!r}; {hint}")
    then = f"coupled calibrate {word_of(file)} --rig RIG --control {control}"
    write_new(file, starting_form(control, inches), ".csv", f"fill it in, then: {then}")


@new.command(
    epilog="[dim]Examples: coupled new feel sweep.csv · coupled new feel w.csv w.toml --control"
    " wheel[/]"
)
def feel(
    readings: Annotated[
        Path, typer.Argument(help="CSV of deflection and force of a sweep, out and back.")
    ],
    file: Annotated[
        Path, typer.Argument(help="The new file; a plot is written beside it as PNG.")
    ] = Path("my-feel.toml"),
    control: Annotated[str, typer.Option(help="column, wheel or pedals.")] = "column",
    units: UnitsOption = "si",
) -> None:
    """Write force curve, breakout and friction from a sweep of a control of the aircraft."""
    from coupled.calibration.feel import fit_feel, read_sweep
    from coupled.cli.feel import keep_feel, print_feel

    named = next((name for name in CONTROL_NAMES if name == control), None)
    if named is None:
        hint = nearest(control, CONTROL_NAMES)
        raise InputError("new feel", "--control", f"no {control!r}; {hint}")
    check_new(file, ".toml")
    check_target(file.with_suffix(".png"), [readings])
    found = fit_feel(read_sweep(readings, named))
    with Outputs() as outputs:
        keep_feel(found, named, shown(readings.name), file, outputs, units)
    print_feel(found, named, file, units)


def _run_for(rig: str, control: str, file: Path) -> str:
    """Return the text of a run for a rig, after a flight of its cases."""
    from coupled.authority.firstrun import first_run
    from coupled.rig.parameters import plain_name

    rig_file, data, name = rig_and_control(rig, control)
    shipped = shipped_rigs().get(rig) == rig_file
    word = rig if shipped else path_from(file.parent, rig_file)
    with progress() as advance:
        return first_run(data, name, word, plain_name(file.stem), advance)


def check_new(file: Path, suffix: str) -> None:
    """Raise InputError unless the name ends in `suffix`, and if the file exists."""
    if file.suffix.lower() != suffix:
        raise InputError(file, "", f"give a name that ends in {suffix}")
    check_target(file)
    if file.exists():
        raise InputError(file, "", "is there already; give the name of a new file")


def write_new(file: Path, text: str, suffix: str, then: str) -> None:
    """Write a template as a new file, and print the next command.

    Raises InputError unless the name ends in `suffix`, and if the file exists.
    """
    check_new(file, suffix)
    write_text(file, text)
    say(f"written: {file}")
    say(f"next: {then}")


def _text(name: str) -> str:
    return read_text(starter(name), "it was shipped as such")


def word_of(file: Path) -> str:
    """Return the file as an argument of a command."""
    return shlex.quote(str(file))
