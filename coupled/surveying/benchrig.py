"""A draft rig without an aircraft: one control, from the user's values or a log.

Values are in SI or in US units, a bare number or one with its unit, as `12.5lbf/in`. Missing values
are those of the light aircraft of `draft`, and are listed as guesses.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace

from coupled.display import System, in_system
from coupled.errors import InputError, nearest, shown
from coupled.record.channels import ControlName, unit_of
from coupled.rig.bounds import REACHED
from coupled.rig.rigwrite import toml_string
from coupled.surveying.draft import HOW_TO_SETTLE, BEND_m_per_N, RIM_m, control_lines, kind_of
from coupled.surveying.fromlog import LogNumbers
from coupled.units import parse_unit

_NUMBER = re.compile(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*)")
_GRADIENT = "schedule.total_gradient"
_YES, _NO = ("yes", "y", "true"), ("no", "n", "false")


@dataclass(frozen=True)
class Question:
    """A question on a control: its name, its text, its SI unit, and the field of the rig."""

    name: str
    words: str
    unit: str
    field: str


def questions(control: ControlName) -> dict[str, Question]:
    """Return the questions on a control by name, in order."""
    d = unit_of(control)
    mass = "kg" if d == "m" else "N·s²/rad"
    asked = (
        Question("travel", "travel to each side", d, "travel"),
        Question("gradient", "force gradient", f"N/{d}", _GRADIENT),
        Question("breakout", "breakout force", "N", "loader.breakout"),
        Question("friction", "friction force", "N", "loader.friction"),
        Question("mass", "moving mass at the grip", mass, "loader.mass"),
        Question("damping", "viscous damping", f"N·s/{d}", "loader.damping"),
        Question("bend", "bend K of the structure, 0 if unknown", f"{d}/N", "loader.bend"),
    )
    return {each.name: each for each in asked}


def answer(text: str, asked: Question, system: System) -> float:
    """Return an answer in SI: a bare number in the system's unit, or a number with a unit.

    Raises InputError for an answer that is not a number or has the unit of another quantity.
    """
    shown = in_system(asked.unit, system)
    found = _NUMBER.fullmatch(text)
    value = math.nan
    if found is not None:
        factor, own, wanted = 1.0 / shown.factor, found[2].strip(), parse_unit(asked.unit)
        if own and own not in (shown.unit, asked.unit):
            given = parse_unit(own)
            if given is None or wanted is None or given.dimension != wanted.dimension:
                problem = f"{own!r} is no unit of it; give a number in {shown.unit}"
                raise InputError("new rig", asked.name, problem)
            factor = given.factor
        elif own == asked.unit:
            factor = 1.0
        try:
            value = factor * float(found[1])
        except ValueError:
            value = math.nan
    least = 0.0 if asked.name in ("travel", "gradient", "mass") else -1e-30
    if not least < value < 1e6:
        above = "above 0" if least == 0.0 else "of 0 or more"
        raise InputError("new rig", asked.name, f"{text!r} is no number {above}, in {shown.unit}")
    if asked.name == "travel" and value > REACHED[asked.unit]:
        most = f"{shown.factor * REACHED[asked.unit]:.3g} {shown.unit}"
        problem = f"{text!r} is in another unit: a hand reaches {most} at most"
        raise InputError("new rig", asked.name, problem)
    return value


def yes(text: str) -> bool:
    """Return whether there is a servo. Raises InputError for an answer that is not yes or no."""
    if text.lower() not in (*_YES, *_NO):
        raise InputError("new rig", "servo", f"{text!r} is neither yes nor no")
    return text.lower() in _YES


def split_answers(words: list[str], control: ControlName) -> dict[str, str]:
    """Return NAME=VALUE words as answers by name. Raises InputError for an unknown name."""
    known = [*questions(control), "servo"]
    answers = {}
    for word in words:
        name, sign, value = word.partition("=")
        if not sign or name not in known:
            problem = f"{word!r} is no NAME=VALUE of {', '.join(known)}; {nearest(name, known)}"
            raise InputError("new rig", "--set", problem)
        if name in answers:
            raise InputError("new rig", "--set", f"gives {name} twice")
        answers[name] = value
    return answers


def guesses(control: ControlName, servo: bool) -> dict[str, float]:
    """Return the default values, in SI, by name."""
    guess = kind_of(0.0).controls[control]
    bend = 0.0
    if servo:
        bend = BEND_m_per_N / (RIM_m if unit_of(control) == "rad" else 1.0)
    return {
        "travel": guess.travel,
        "gradient": guess.full_force_N / guess.travel,
        "breakout": guess.breakout_N,
        "friction": guess.friction_N,
        "mass": guess.mass,
        "damping": guess.damping,
        "bend": bend,
    }


def found_in(log: LogNumbers) -> tuple[dict[str, float], set[str]]:
    """Return the numbers of a log by name, and the names of those that it determines."""
    numbers = {
        "travel": log.travel,
        "gradient": log.gradient,
        "breakout": log.breakout_N,
        "friction": log.friction_N,
        "mass": log.mass,
        "damping": log.damping,
    }
    if "bend" in log.sure:
        numbers["bend"] = log.bend
    return numbers, {name.removesuffix("_N") for name in log.sure}


def bench_rig(
    name: str,
    control: ControlName,
    given: Mapping[str, float],
    servo: bool,
    log: LogNumbers | None = None,
    source: str = "",
    rate_Hz: float = 120.0,
) -> str:
    """Return the text of a rig file without an aircraft.

    `given` are known values in SI by name. Further values are from a `log`, whose file is `source`
    with rows at `rate_Hz`; the others are guesses. The gradient is the same at any q̄: one row of a
    table.
    """
    asked = questions(control)
    values, known = guesses(control, servo), set(given)
    measured: dict[str, float] = {}
    if log is not None:
        measured, sure = found_in(log)
        measured = {k: value for k, value in measured.items() if value > 0.0 or k in sure}
        known |= sure
    values |= measured | dict(given)
    remarks = {
        asked[key].field: f"from {source}" if key in known else f"from {source}, roughly"
        for key in measured
        if key not in given
    }
    if "travel" in measured and "travel" not in given:
        remarks["travel"] = f"the greatest in {source}"
    fields = {asked[key].field for key in known}
    if "gradient" in known:
        fields.add("loader.basic_gradient")
    if "bend" in known:
        fields.add("compensation.bend")
    if _GRADIENT in remarks:
        remarks["schedule"] = f"one row: the same gradient at any q̄, {remarks.pop(_GRADIENT)}"
    remarks.setdefault("schedule", "one row: the same gradient at any q̄")
    hardware = replace(
        kind_of(0.0).controls[control],
        travel=values["travel"],
        mass=values["mass"],
        damping=values["damping"],
        breakout_N=values["breakout"],
        friction_N=values["friction"],
    )
    lines = [
        f"# {shown(name)}: a {control} on the bench, without an aircraft, by `coupled new rig`.",
        "#",
        *HOW_TO_SETTLE,
        "",
        f"name = {toml_string(name)}",
        f"frame_rate_Hz = {rate_Hz!r}",
        *control_lines(
            control,
            hardware,
            gradients=[values["gradient"]],
            pressures=[0.0],
            bend=values["bend"],
            servo=servo,
            known=fields,
            remarks=remarks,
        ),
    ]
    return "\n".join([*lines, ""])
