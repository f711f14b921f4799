"""Maps of stability: the growth found in simulation over K·G_T and a second quantity.

Each plane asks one question of a control as it is filed, with friction, breakout, play and
limits taken out, which only ever hold or bound a motion:

    belief   K̂/K, a free hand: the commanded spring G_T/(1 − K̂·G_T), eq. (12)
    frame    T, a free hand: the digital product ΔG·δc that stands still over a frame
    hand     K·k_h, hybrid: a hand of that stiffness, on the structure's 1/K
    servo    its frequency, hybrid: the grip held fast

Where a growth changes its sign along the second quantity is found by bisection, in simulation
and by theory.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from coupled.authority.stability.linear import growth as linear_growth
from coupled.record.channels import ControlName
from coupled.rig.growth import growth as simulated_growth
from coupled.rig.packing import Hand
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
Kind = Literal["belief", "frame", "hand", "servo"]
KINDS: tuple[Kind, ...] = ("belief", "frame", "hand", "servo")
HELD_FAST = 100.0  # K·k_h of a hand that gives 1 % of the structure's bend

_SIMULATED_s = 4.0
_COARSE, _FINE = (31, 25), (91, 73)  # cells of the simulation, points of the theory
_LEFT, _RIGHT = 0.02, 1.2  # of K·G_T
_HALVINGS = 9
_VALUES: dict[Kind, tuple[float, float]] = {
    "belief": (0.02, 2.0),
    "frame": (0.002, 0.2),
    "hand": (0.01, 100.0),
    "servo": (2.0, 200.0),
}
_FAR = 1e100  # a stop that a linear rig never meets


@dataclass(frozen=True)
class Crossing:
    """A value of the second quantity at which the growth changes its sign at one K·G_T.

    `theory` is None where it has none in that cell of the simulation or in one beside it.
    """

    share: float
    simulated: float
    theory: float | None

    @property
    def apart(self) -> float:
        """By how much simulation and theory differ, as a share; infinite without theory."""
        return math.inf if self.theory is None else abs(self.simulated / self.theory - 1.0)


@dataclass(frozen=True)
class Plane:
    """Growth in 1/s over K·G_T (`shares`) and a second quantity (`values`).

    `simulated` and `theory` have shape (shares, values), `fine`, the theory once more to draw
    its boundary, (fine_shares, fine_values).
    """

    control: ControlName
    kind: Kind
    shares: Floats
    values: Floats
    simulated: Floats
    theory: Floats
    fine_shares: Floats
    fine_values: Floats
    fine: Floats
    crossings: tuple[Crossing, ...]


def linear_rig(
    rig: Rig, name: ControlName, gradient: float, changes: dict[str, Any] | None = None
) -> Rig:
    """Return the rig with this control alone, linear, at one gradient in N/d.

    `changes` are values by the field's name, as `servo_frequency`; `bend` is the host's K̂.
    """
    control, asked = rig.controls[name], changes or {}
    neutral = dict.fromkeys(("breakout", "friction", "breakaway", "cubic", "play", "offset"), 0.0)
    neutral |= dict.fromkeys(("servo_rate_limit", "bend_limit", "bob_weight"), 0.0)
    own: dict[str, Any] = {
        key: asked[key] for key in ("multiplier", "servo_frequency") if key in asked
    }
    loader = control.loader.model_copy(update={**neutral, **own})
    table = {"dynamic_pressure": [0.0, 1.0], "total_gradient": [gradient, gradient]}
    flat = {"second_gradient": None, "break_deflection": 0.0, "slope": 1.0}
    host = _those(asked, "bend", "gradient")
    changed = {
        "travel": _FAR,
        "loader": loader,
        "schedule": control.schedule.model_copy(update={**table, **flat}),
        "compensation": control.compensation.model_copy(update={"breakout": 0.0, **host}),
        "sensing": control.sensing.model_copy(update={"word_length": 0}),
    }
    rate = {"frame_rate": 1.0 / asked["frame"]} if "frame" in asked else {}
    controls = {name: control.model_copy(update=changed)}
    return rig.model_copy(update={"controls": controls, "flight": None, "noise": {}, **rate})


def _those(values: dict[str, Any], *keys: str) -> dict[str, Any]:
    return {key: values[key] for key in keys if key in values}


def posed(
    rig: Rig, name: ControlName, kind: Kind, gradient: float, value: float
) -> tuple[Rig, Hand]:
    """Return the linear rig and hand of a plane's question at one gradient and value."""
    bend = rig.controls[name].loader.bend
    if kind == "belief":
        return linear_rig(rig, name, gradient, {"bend": value * bend, "gradient": True}), Hand()
    if kind == "frame":
        changes = {"frame": value, "multiplier": "digital"}
        return linear_rig(rig, name, gradient, changes), Hand()
    changes = {"multiplier": "hybrid"}
    if kind == "servo":
        changes["servo_frequency"] = value
        return linear_rig(rig, name, gradient, changes), Hand(HELD_FAST / bend)
    return linear_rig(rig, name, gradient, changes), Hand(value / bend)


def axis(kind: Kind, points: int) -> Floats:
    """Return values of a plane's second quantity: K̂/K evenly, the others by their logarithm."""
    low, high = _VALUES[kind]
    if kind == "belief":
        return np.linspace(low, high, points)
    return np.geomspace(low, high, points)


def plane(rig: Rig, name: ControlName, kind: Kind) -> Plane:
    """Return one plane of a control, whose structure must bend."""
    bend = rig.controls[name].loader.bend
    shares, values = np.linspace(_LEFT, _RIGHT, _COARSE[0]), axis(kind, _COARSE[1])
    fine_shares, fine_values = np.linspace(_LEFT, _RIGHT, _FINE[0]), axis(kind, _FINE[1])
    simulated, found = np.empty(_COARSE), list[Crossing]()
    for i, share in enumerate(shares.tolist()):
        simulated[i] = simulated_along(rig, name, kind, share / bend, values)
        found += crossings(rig, name, kind, share / bend, values, simulated[i])
    theory, fine = (
        np.array([[_theory(rig, name, kind, x / bend, y) for y in ys] for x in xs])
        for xs, ys in (
            (shares.tolist(), values.tolist()),
            (fine_shares.tolist(), fine_values.tolist()),
        )
    )
    return Plane(
        name, kind, shares, values, simulated, theory, fine_shares, fine_values, fine, tuple(found)
    )


def simulated_along(
    rig: Rig, name: ControlName, kind: Kind, gradient: float, values: Floats
) -> Floats:
    """Return the simulated growth at each value of a plane's second quantity, 1/s."""
    return np.array([_simulated(rig, name, kind, gradient, v) for v in values.tolist()])


def crossings(
    rig: Rig, name: ControlName, kind: Kind, gradient: float, values: Floats, simulated: Floats
) -> list[Crossing]:
    """Return where the growth changes its sign along `values`, given it there as simulated."""
    found = []
    share = gradient * rig.controls[name].loader.bend
    last = len(values) - 1
    for j in np.flatnonzero((simulated[:-1] > 0.0) != (simulated[1:] > 0.0)).tolist():
        asked = rig, name, kind, gradient
        at = _bisected(partial(_simulated, *asked), values[j], values[j + 1])
        assert at is not None
        theory = None
        for before, beyond in ((0, 1), (1, 1), (0, 2), (1, 2)):  # in the same cell, or beside it
            near = values[max(0, j - before)], values[min(last, j + beyond)]
            theory = theory or _bisected(partial(_theory, *asked), *near)
        found.append(Crossing(share, at, theory))
    return found


def _bisected(growth: Callable[[float], float], low: float, high: float) -> float | None:
    """Return where a growth changes its sign, by its logarithm; None where the ends agree."""
    low, high = float(low), float(high)
    rising = growth(high) > 0.0
    if (growth(low) > 0.0) == rising:
        return None
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if (growth(middle) > 0.0) == rising else (middle, high)
    return math.sqrt(low * high)


def _simulated(rig: Rig, name: ControlName, kind: Kind, gradient: float, value: float) -> float:
    return simulated_growth(*posed(rig, name, kind, gradient, value), _SIMULATED_s)


def _theory(rig: Rig, name: ControlName, kind: Kind, gradient: float, value: float) -> float:
    return linear_growth(*posed(rig, name, kind, gradient, value))
