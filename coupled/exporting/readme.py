"""The README of an exported folder: how to fly it, its properties, its errors, parts left out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from coupled.exporting.comparison import FlightErrors
from coupled.exporting.keys import approximated
from coupled.exporting.model import model_name
from coupled.exporting.system import System
from coupled.flight.altered import alterations
from coupled.record.channels import SURFACES
from coupled.rig.rig import Rig

_HAND = """\
Move the grip by a force: set `coupled/{control}/force-N`. Or by a hand that holds a position: set
`coupled/{control}/hand` to 1, and the position by `hand-deflection-…` or a joystick. A value of
`{command}` from another program is taken as the joystick's axis, and replaced by the loader's
output plus the trim."""


def readme_text(
    rig: Rig,
    systems: Mapping[str, System],
    substeps: int,
    rate_Hz: float,
    scripts: Sequence[str],
    flights: Sequence[FlightErrors],
    left: Sequence[str],
    scripted: Sequence[str],
) -> str:
    """Return the README's text.

    `rate_Hz` is JSBSim's, `flights` are the comparisons with our own, `left` are the parts of the
    rig left out, `scripted` those set by the scripts only.
    """
    name = model_name(rig.flight)
    parts = [
        f"# {name} with the control loader of `{rig.name}`",
        f"Made by `coupled export`: the JSBSim model {name}, its files unchanged except for a line"
        f" that includes each `Systems/coupled-….xml`{_changed(rig)}, and the loaders of the rig's"
        f" {', '.join(systems)}.",
        _flying(rig, name, rate_Hz, substeps, scripts),
        _HAND.format(control=next(iter(systems)), command=_command(rig)),
        _properties(systems),
    ]
    if flights:
        parts.append(_errors(flights))
    about = approximated(rig)
    if about:
        lines = [f"- {one}" for one in about]
        parts.append("## Approximated\n\nThe errors above include it.\n\n" + "\n".join(lines))
    if scripted:
        head = "## Set by the scripts only\n\nWithout a script, the aircraft does not have it.\n"
        parts.append("\n".join([head, *(f"- {one}" for one in scripted)]))
    if left:
        parts.append("## Left out\n\n" + "\n".join(f"- {one}" for one in left))
    return "\n\n".join(parts) + "\n"


def _changed(rig: Rig) -> str:
    """Return the other changes of the model's files, for use in a sentence."""
    flight = rig.flight
    if flight is None:
        return ""
    changes = list[str]()
    if flight.cg_aft != 0.0:
        changes.append(f"a centre of gravity {flight.cg_aft:g} m further aft")
    if flight.fuel != 1.0:
        changes.append(f"{flight.fuel:g} times the fuel")
    changes += [
        f"{part.name} {'times' if part.neutral else 'of'} {factor:g}"
        for part, factor, _ in alterations(flight)
    ]
    return f", for {', '.join(changes)}" if changes else ""


def _command(rig: Rig) -> str:
    name, control = next(iter(rig.controls.items()))
    return next(iter(control.properties.command), f"fcs/{SURFACES[name]}-cmd-norm")


def _flying(rig: Rig, name: str, rate_Hz: float, substeps: int, scripts: Sequence[str]) -> str:
    script = scripts[0] if scripts else "scripts/NAME.xml"
    lines = ["## Flying it", "", "In this folder:", "", "```sh"]
    lines += [
        f"python fly.py {script} > flight.csv    # pip install jsbsim; nothing else",
        f"JSBSim --root=. --script={script}",
    ]
    if rig.flight is not None:
        lines += [
            f"fgfs --fdm=jsbsim --aero={name} --aircraft-dir=$PWD/aircraft/{name}"
            f" --aircraft={name} --model-hz={rate_Hz:g}",
        ]
    lines += ["```", ""]
    lines.append(
        f"The loader takes {substeps} steps in a step of JSBSim, {substeps * rate_Hz:g} Hz at the"
        f" {rate_Hz:g} Hz of the scripts; it works at any other rate, with an error that grows with"
        " its steps. A run of JSBSim of zero time (its start, its trim) resets it."
    )
    return "\n".join(lines)


def _properties(systems: Mapping[str, System]) -> str:
    lines = ["## Properties", "", "| property | what |", "| --- | --- |"]
    for system in systems.values():
        lines += [f"| `{path}` | {what} |" for path, what in system.documented.items()]
    return "\n".join(lines)


def _errors(flights: Sequence[FlightErrors]) -> str:
    lines = [
        "## Comparison with coupled's own flights",
        "",
        "Each script flown by JSBSim alone, at the worst frame and control: deflection in % of"
        " travel, force and F_mod in % of the largest (F_mod jumps at neutral, and is compared"
        " beyond 1 % of travel), the lost authority in percentage points.",
        "",
        "| run | case | configuration | deflection | force | F_mod | lost |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for one in flights:
        lost = "" if one.loss is None else f"{100.0 * one.loss:+.3f}"
        lines.append(
            f"| {one.run} | {one.case} | {one.configuration} | {100.0 * one.deflection:.3f} |"
            f" {100.0 * one.force:.3f} | {100.0 * one.modifying_force:.3f} | {lost} |"
        )
    return "\n".join(lines)
