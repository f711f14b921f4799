"""The part of an FMU's C source that depends on the rig: `model.h`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from coupled.exporting.fmu.kernel import ROW
from coupled.exporting.fmu.laws import ARGUMENTS, Law, laws
from coupled.exporting.fmu.numbers import Place, Words, place_of, value
from coupled.exporting.fmu.variables import ROWS, Variable
from coupled.rig.parameters import Control

MOST_FRAMES = 1_000_000  # of one step
_HEAD = """\
/* Generated from a rig file. */

#ifndef MODEL_H
#define MODEL_H

#include <stdint.h>

typedef enum { INDEPENDENT, INPUT, OUTPUT_ONLY, PARAMETER } Role;
typedef struct {
    const char *name;
    int role, above, whole, rises; /* above: without `least`; whole: 0 or 1; rises: row by row */
    double start, least, most;
} Variable;
/* A row of a table of gradients, and the first of its table: value references. */
typedef struct {
    int row, first;
} Gradient;
/* A number of the control: its word there, and the law that gives it from variables. */
typedef struct {
    int law, word, whole;
    double factor;
    int arguments[5]; /* value references; beyond these, constants */
} Number;
"""
_ROLES = {
    "independent": "INDEPENDENT",
    "input": "INPUT",
    "output": "OUTPUT_ONLY",
    "parameter": "PARAMETER",
}


def model_header(
    token: str,
    frame_s: float,
    substeps: int,
    memory: Words,
    control: Control,
    variables: Sequence[Variable],
) -> str:
    """Return `model.h` for a control, its memory at rest, and its variables."""
    names = [one.name for one in variables]
    roles = [one.role for one in variables]
    known = laws(control, frame_s, frame_s / substeps)
    numbers, constants = _numbers(control, variables, known)
    gradients = _gradients(names)
    defined: dict[str, object] = {
        "TOKEN": f'"{token}"',
        "FRAME_s": repr(frame_s),
        "SUBSTEPS": substeps,
        "SUBSTEP_s": repr(frame_s / substeps),
        "MOST_FRAMES": f"{MOST_FRAMES}.0",
        "ROW": ROW,
        "CONTROL_WORDS": len(memory),
        "VARIABLES": len(variables),
        "NUMBERS": len(numbers),
        "TIME": 0,
        "FORCE": 1,
        "FORCE_RATE": 2,
        "PRESSURE": names.index("dynamic_pressure_Pa"),
        "LOAD_FACTOR": names.index("load_factor"),
        "ALPHA": names.index("alpha_rad") if "alpha_rad" in names else -1,
        "BEND": names.index(next(n for n in names if n.startswith("compensation.bend_"))),
        "SLOPE": names.index("schedule.slope"),
        "GRADIENTS": len(gradients),
        "OUTPUT": roles.index("output"),
        "OUTPUTS": len(ROWS),
    }
    lines = [_HEAD]
    lines += [f"#define {name} {value}" for name, value in defined.items()]
    lines += [_array("int", "STARTS_AT", [first for first, _ in ROWS.values()])]
    lines += [_array("int", "ENDS_AT", [last for _, last in ROWS.values()])]
    lines += [_array("Variable", "VARIABLE", [_variable(one) for one in variables])]
    lines += [_array("Gradient", "GRADIENT", gradients)]
    lines += [_array("Number", "NUMBER", numbers)]
    lines += [_array("double", "CONSTANT", map(repr, constants))]
    words = [hex(word) for word in memory.view(np.uint64).tolist()]
    lines += [_array("uint64_t", "CONTROL", words)]
    return "\n".join([*lines, "", "#endif", ""])


def _gradients(names: Sequence[str]) -> list[str]:
    """Return the rows of the schedule's gradients with the first of their table."""
    rows, first = [], 0
    for reference, name in enumerate(names):
        if name.startswith(("schedule.total_gradient", "schedule.second_gradient")):
            first = reference if name.endswith("[1]") else first
            rows.append(f"{{{reference}, {first}}}")
    return rows


def _numbers(
    control: Control, variables: Sequence[Variable], known: Mapping[str, Law]
) -> tuple[list[str], list[float]]:
    """Return the kernels' numbers that depend on a parameter, and the laws' other arguments.

    An argument is a value reference, or follows these in the list of constants.
    """
    at = {one.of.name: reference for reference, one in enumerate(variables) if one.of}
    constants = [1.0]
    at[""] = len(variables)  # a missing argument
    names = set(at)
    rows = []
    for place, law in known.items():
        if not any(name and name in names for name in law.of):
            continue
        arguments = []
        for name in (*law.of, *("",) * (ARGUMENTS - len(law.of))):
            if name not in at:
                at[name] = len(variables) + len(constants)
                constants.append(value(control, name))
            arguments.append(at[name])
        rows.append(_number(law, place_of(place), arguments))
    return rows, constants


def _array(kind: str, name: str, rows: Iterable[object]) -> str:
    inner = ",\n    ".join(map(str, rows))
    return f"\nstatic const {kind} {name}[] = {{\n    {inner}\n}};"


def _variable(one: Variable) -> str:
    flags = (one.bounds.above, one.of is not None and one.of.whole, one.of and one.of.rises)
    numbers = (one.start, one.bounds.least, one.bounds.most)
    plain = [f'"{one.name}"', _ROLES[one.role], *(str(int(flag or 0)) for flag in flags)]
    return "{" + ", ".join([*plain, *map(repr, numbers)]) + "}"


def _number(law: Law, place: Place, arguments: Sequence[int]) -> str:
    given = ", ".join(map(str, arguments))
    return f"{{{law.law}, {place.word}, {int(place.whole)}, {law.factor!r}, {{{given}}}}}"
