"""Shared by the bench's commands: a rig, its control, and the instruments' errors."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from coupled.cli.terminal import err, say_note
from coupled.errors import InputError, nearest
from coupled.record.channels import CONTROL_NAMES, ControlName
from coupled.resources import find, shipped_rigs

if TYPE_CHECKING:
    from coupled.calibration.estimate import Instruments
    from coupled.rig.rig import Rig

DEFAULT_RIG = "report-column"
RigOption = Annotated[str, typer.Option(help="A rig file, or the name of a shipped rig.")]
ControlOption = Annotated[str, typer.Option(help="column, wheel or pedals.")]
ErrorOption = Annotated[
    list[str] | None,
    typer.Option(
        "--error",
        metavar="NAME=VALUE",
        help="Standard deviation of an instrument: ruler (mm; ° on a wheel), scale (N), meter (V),"
        " hand (% of its force); may be repeated. (default: ruler=0.3, on a wheel 0.2; scale=0.3,"
        " meter=0.01, hand=0.3)",
    ),
]
StrongestOption = Annotated[
    float,
    typer.Option(
        "--strongest-N", help="Largest hand force in planned readings, N.", min=1, max=2000
    ),
]


CrossedOption = Annotated[
    float,
    typer.Option(
        "--crossed-N",
        help="Add readings with this force, of both signs, on each other control, N; 0: none.",
        min=0,
    ),
]


OnceOption = Annotated[
    bool,
    typer.Option(
        "--once", help="Read ruler and scale once per reading, not again after the voltmeter."
    ),
]


def rig_and_control(name: str, control: str) -> tuple[Path, Rig, ControlName]:
    """Return a rig's file, the rig, and the selected control."""
    from coupled.rig.rigfile import read_rig

    file = find(name, shipped_rigs(), "rig")
    rig = read_rig(file)
    rig.check_controlled(file)
    for known in CONTROL_NAMES:
        if known == control and known in rig.controls:
            return file, rig, known
    raise InputError(file, "--control", f"no {control!r}; {nearest(control, rig.controls)}")


def say_doubts(rig: Rig) -> str:
    """Call `say_stale` and `say_guesses`."""
    say_stale(rig)
    return say_guesses(rig)


def say_guesses(rig: Rig, controls: Collection[str] = ()) -> str:
    """Print on standard error which numbers of a rig are guesses.

    Return the sentence, for figures and reports.
    """
    from coupled.rig.guesses import guess_note

    note = guess_note(rig.controls, controls)
    if note:
        say_note(note)
    return note


def say_stale(rig: Rig) -> None:
    """Print on standard error what has changed since a rig's calibrations, and doubtful q̄."""
    from coupled.calibration.assumedscales import stale
    from coupled.rig.bounds import pressure_doubts

    for name, control in rig.controls.items():
        for change in stale(control):
            err.print(f"[yellow]stale calibration:[/] {name}: {escape(change)}", soft_wrap=True)
    for doubt in pressure_doubts(rig):
        say_note(doubt)


def instruments(control: str, errors: Sequence[str] | None) -> Instruments:
    """Return a control's usual instruments with the errors that a user gives as NAME=VALUE."""
    from coupled.calibration.estimate import usual_instruments
    from coupled.units import DEGREE_rad

    factors = {"ruler": DEGREE_rad if control == "wheel" else 1e-3, "scale": 1.0}
    factors |= {"meter": 1.0, "hand": 0.01}
    given = {}
    for word in errors or ():
        name, _, value = word.partition("=")
        if name not in factors:
            raise InputError("--error", name, f"no such instrument; {nearest(name, factors)}")
        try:
            number = float(value)
        except ValueError:
            raise InputError("--error", name, f"{value!r} is no number; as {name}=0.3") from None
        if not (math.isfinite(number) and 0.0 <= factors[name] * number <= 10.0):
            raise InputError("--error", name, f"{value} is no error of an instrument")
        given[name] = factors[name] * number
    return replace(usual_instruments(control), **given)
