"""The curves that a rig may have as laws of one signal: their keys, signals and possible nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.display import split_unit
from coupled.errors import InputError
from coupled.gap.thresholds import CURVE_PLACES
from coupled.record.channels import ControlName, unit_of
from coupled.rig.curves import BendCurve, GradientCurve, LoadCurve
from coupled.rig.curves import Curve as RigCurve
from coupled.rig.rig import Rig
from coupled.schema import SMALLEST, file_keys

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Law:
    """A curve that a rig may have: its key of a control, its stage, and its signal.

    `signal` is a name in `where.signals`, `symbol` that of closed forms. `scale` is a signal of the
    size of its values. `by_size`: of the signal's size only. `anchored`: it vanishes at 0, where a
    named effect acts. `is_map`: its value replaces the signal.
    """

    key: str
    stage: str
    signal: str
    symbol: str
    scale: str
    by_size: bool = False
    anchored: bool = False
    is_map: bool = False


LAWS = (
    Law("loader.force_curve", "loader", "computed_{d}", "δ", "force_N"),
    Law(
        "loader.friction_curve",
        "loader",
        "computed_rate_{d}_per_s",
        "v",
        "force_N",
        by_size=True,
        anchored=True,
    ),
    Law("loader.load_curve", "loader", "force_N", "F", "force_N", by_size=True, anchored=True),
    Law("loader.bend_curve", "linkage", "force_N", "F", "computed_{d}", anchored=True),
    Law("sensing.grip_curve", "linkage", "deflection_{d}", "δ", "deflection_{d}", is_map=True),
    Law("sensing.deflection_curve", "sensing", "computed_{d}", "δ", "computed_{d}", is_map=True),
    Law("sensing.force_curve", "sensing", "force_N", "F", "force_N", is_map=True),
    Law("schedule.gradient_curve", "schedule", "dynamic_pressure_Pa", "q̄", "gradient_N_per_{d}"),
    Law("rigging.command_curve", "surface", "estimate_{d}", "δ̂", "estimate_{d}", is_map=True),
)


def named(name: str, control: ControlName) -> str:
    """Return the name of a signal on a control, with m or rad."""
    return name.format(d=unit_of(control))


def filed_curve(rig: Rig, control: ControlName, law: Law) -> RigCurve:
    """Return the curve of a law that a rig has; without nodes, it has none."""
    section, _, name = law.key.partition(".")
    found: RigCurve = getattr(getattr(rig.controls[control], section), name)
    return found


def units_of(rig: Rig, control: ControlName, law: Law) -> tuple[str, str, str]:
    """Return the keys of a law's nodes and values, and the unit of its values in text."""
    of, values, *_ = file_keys(type(filed_curve(rig, control, law)), unit_of(control))
    return of, values, split_unit(values)[1]


def with_curve(
    rig: Rig, control: ControlName, law: Law, nodes: Floats, values: Floats
) -> Rig | None:
    """Return the rig with a curve; None if no rig can have it.

    The values of a map are added to the signal. Neither a map nor a bend may fall: where one
    would, it is flat. Friction by load is not below 0. A curve of the schedule is constant beyond
    its nodes.
    """
    kind = type(filed_curve(rig, control, law))
    of, value, *_ = file_keys(kind, unit_of(control))
    given = values
    if kind is GradientCurve:  # held at its ends, as the schedule's table
        beyond = 0.01 * float(nodes[-1] - nodes[0])
        nodes = np.concatenate(([nodes[0] - beyond], nodes, [nodes[-1] + beyond]))
        given = np.pad(values, 1, "edge")
    if kind.MAP or kind is BendCurve:
        line = nodes * (1.0 if kind.MAP else rig.controls[control].loader.least_bend)
        raised = np.maximum.accumulate(values + line)
        given = raised if kind.MAP else raised - line - np.interp(0.0, nodes, raised - line)
    if kind is LoadCurve:
        given = np.maximum(values, 0.0)
    lists = {
        name: np.where(np.abs(each) < SMALLEST, 0.0, each).tolist()
        for name, each in ((of, nodes), (value, given))
    }
    try:
        return rig.changed({f"controls.{control}.{law.key}": lists})
    except InputError:
        return None


def rising(places: Floats) -> Floats:
    """Return functions that rise from one place to the next, shape (places, functions).

    They are 0 towards 0 and ±1 beyond; one is constant. A rig that may not have a falling curve
    can have each, and together they span all functions that are linear between the places.
    """
    above = np.tri(len(places))
    zero = np.flatnonzero(places == 0.0)
    for k in range(int(zero[0]) if zero.size else 0):
        above[:, k] = -1.0 * (np.arange(len(places)) <= k)
    if zero.size:
        above[:, zero[0]] = 1.0
    return above


def places_of(signal: Floats, law: Law, entries: Sequence[float]) -> Floats:
    """Return where a curve may have nodes: evenly spaced, at quantiles, at 0 and at entries.

    From the least value of the signal to the largest; through 0, where the signal has both signs.
    """
    low, high = float(signal.min()), float(signal.max())
    if law.by_size:
        low = 0.0
    elif law.stage != "schedule":
        width = max(abs(low), abs(high))
        low, high = min(low, -1e-2 * width), max(high, 1e-2 * width)
    near = 0.4 * (high - low) / CURVE_PLACES
    fixed = [low, high, *(x for x in entries if low < x < high)]
    fixed += [0.0] if low < 0.0 < high else []
    found = list(fixed)
    even = np.linspace(low, high, CURVE_PLACES)
    for x in (*even, *np.quantile(signal, np.linspace(0.0, 1.0, CURVE_PLACES))):
        if all(abs(x - other) > near for other in found):
            found.append(float(x))
    return np.array(sorted(set(found)))
