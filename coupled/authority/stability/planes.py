"""Maps of stability: the growth found in simulation over K·G_T and a second quantity.

Each plane is of a control as its rig file has it, without friction, breakout, backlash and limits,
which only hold or bound a motion:

    assumed  K̂/K, a free hand: the commanded spring G_T/(1 − K̂·G_T), eq. (12)
    frame    T, a free hand: the digital product ΔG·δc held over a frame
    hand     K·k_h, hybrid: a hand of that stiffness, on the structure's 1/K
    servo    its frequency, hybrid: the grip held fast
    gauge    the bandwidth of its amplifier, hybrid: a hand as stiff as the structure
    mass     between gauge and grip over the loader's own, hybrid: a free hand

A change of the growth's sign along the second quantity is located by bisection, in simulation and
by theory.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from coupled.authority.stability.linear import growth as linear_growth
from coupled.authority.stability.linear import growths
from coupled.record.channels import ControlName, unit_of
from coupled.rig.growth import growth as simulated_growth
from coupled.rig.packing import Hand
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.rig.structure import Structure
from coupled.schema import changed

Floats = NDArray[np.float64]
Kind = Literal["assumed", "frame", "hand", "servo", "gauge", "mass"]
KINDS: tuple[Kind, ...] = ("assumed", "frame", "hand", "servo", "gauge", "mass")


def kinds_of(control: Control) -> tuple[Kind, ...]:
    """Return the planes of a control; that of a mass at the grip requires a servo."""
    return KINDS if control.loader.servo_frequency > 0.0 else KINDS[:-1]


GAUGE_Hz = 50.0  # default bandwidth of a gauge's amplifier
FIRM = 1.0  # K·k_h of a hand as stiff as the structure
HELD_FAST = 100.0  # K·k_h of a hand that moves by 1 % of the structure's bend

_SIMULATED_s = 4.0
CELLS, POINTS = (31, 25), (61, 49)  # cells of the simulation, points of the theory
_LEFT, _RIGHT = 0.02, 1.2  # of K·G_T
_HALVINGS = 9
_VALUES: dict[Kind, tuple[float, float]] = {
    "assumed": (0.02, 2.0),
    "frame": (0.002, 0.2),
    "hand": (0.01, 100.0),
    "servo": (2.0, 200.0),
    "gauge": (0.5, 200.0),
    "mass": (0.05, 50.0),
}
_FAR = 1e12  # a stop that a linear rig never reaches


@dataclass(frozen=True)
class Crossing:
    """A value of the second quantity at which the growth changes its sign at one K·G_T.

    `theory` is None if it has none in that cell of the simulation or in one beside it.
    """

    share: float
    simulated: float
    theory: float | None

    @property
    def difference(self) -> float | None:
        """The relative difference of simulation and theory; None without theory."""
        return abs(self.simulated / self.theory - 1.0) if self.theory else None


@dataclass(frozen=True)
class Plane:
    """Growth in 1/s over K·G_T (`shares`) and a second quantity (`values`).

    `simulated` and `theory` have shape (shares, values); `fine`, the theory on a finer grid for its
    boundary, (fine_shares, fine_values).
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


@dataclass(frozen=True)
class Question:
    """Values of a linear rig that replace its own, if given."""

    multiplier: Literal["hybrid", "digital"] | None = None
    servo_frequency_Hz: float | None = None
    frame_s: float | None = None
    host_bend: float | None = None  # K̂, d/N
    host_gradient: bool | None = None  # whether the host corrects the gradient
    gauge_frequency_Hz: float | None = None
    gauge_mass: float | None = None  # between gauge and grip, kg


def linear_rig(
    rig: Rig, name: ControlName, gradient: float, question: Question = Question()
) -> Rig:
    """Return the rig with this control alone, linear, at one gradient in N/d.

    The rig may be one that cannot be built, such as one with a gradient stiffer than the structure.
    The rig's own values are checked against their own bounds only.
    """
    return _with_values(_linear(rig, name, gradient), name, question)


def _linear(rig: Rig, name: ControlName, gradient: float) -> Rig:
    d, control = unit_of(name), rig.controls[name]
    linear: dict[str, Any] = {
        f"travel_{d}": _FAR,
        f"loader.stop_aft_{d}": 0.0,
        f"loader.stop_forward_{d}": 0.0,
        "loader.breakout_N": 0.0,
        "loader.friction_N": 0.0,
        "loader.breakaway_N": 0.0,
        f"loader.cubic_N_per_{d}3": 0.0,
        f"loader.play_{d}": 0.0,
        "loader.offset_N": 0.0,
        f"loader.servo_rate_limit_{d}_per_s": 0.0,
        f"loader.servo_acceleration_limit_{d}_per_s2": 0.0,
        f"loader.bend_limit_{d}": 0.0,
        "loader.bend_hysteresis_share": 0.0,
        "loader.bob_weight_N_per_g": 0.0,
        "loader.multiplier_offset_N": 0.0,
        "loader.multiplier_drift_N_per_s": 0.0,
        **_inertia_there(control, gradient, d),
        "schedule.dynamic_pressure_Pa": [0.0, 1.0],
        f"schedule.total_gradient_N_per_{d}": [gradient, gradient],
        f"schedule.break_deflection_{d}": 0.0,
        "schedule.slope": 1.0,
        "schedule.gradient_curve": {},
        "loader.load_curve": {},
        "compensation.breakout_N": 0.0,
        "sensing.word_length_bits": 0,
        f"schedule.second_gradient_N_per_{d}": None,
        f"schedule.deflection_{d}": None,
        "schedule.force_N": None,
        "compensation.mass_factor": None,
        "compensation.damping_factor": None,
        f"loader.bend_push_{d}_per_N": None,
    }
    alone = {name: changed(control, linear, rig.place, f"controls.{name}", d)}
    whole = {"controls": alone, "flight": None, "noise": {}, "structure": Structure()}
    return changed(rig, whole, rig.place)


def _with_values(linear: Rig, name: ControlName, question: Question) -> Rig:
    """Return a linear rig with the values of a question.

    A plane has thousands of them, all within valid bounds, so none is checked again.
    """
    control = linear.controls[name]
    loader = {"multiplier": question.multiplier, "servo_frequency": question.servo_frequency_Hz}
    host = {"bend": question.host_bend, "gradient": question.host_gradient}
    sensing = {"gauge_frequency": question.gauge_frequency_Hz, "gauge_mass": question.gauge_mass}
    sections = {}
    for section, own in (("loader", loader), ("compensation", host), ("sensing", sensing)):
        if put := {key: value for key, value in own.items() if value is not None}:
            sections[section] = getattr(control, section).model_copy(update=put)
    whole: dict[str, Any] = {"controls": {name: control.model_copy(update=sections)}}
    if question.frame_s is not None:
        whole["frame_rate"] = 1.0 / question.frame_s
    return linear.model_copy(update=whole)


def _inertia_there(control: Control, gradient: float, d: str) -> dict[str, Any]:
    """Return m and c at one gradient, in place of their schedules."""
    host, loader = control.compensation, control.loader
    table = host.inertia_gradient
    if table is None:
        return {}
    one, lead = [1.0] * len(table), host.force_lead or [0.0] * len(table)
    mass, damping = (
        float(np.interp(gradient, table, factors or one))
        for factors in (host.mass_factor, host.damping_factor)
    )
    return {
        "loader.mass_kg": mass * loader.mass,
        f"loader.damping_N_s_per_{d}": damping * loader.damping,
        f"compensation.inertia_gradient_N_per_{d}": [gradient, gradient + 1.0],
        "compensation.force_lead_s": [float(np.interp(gradient, table, lead))] * 2,
    }


@dataclass(frozen=True)
class PlaneAtGradient:
    """The rigs of a plane at one gradient, in N/d; the linear rig is made once."""

    rig: Rig
    name: ControlName
    kind: Kind
    gradient: float

    @cached_property
    def linear(self) -> Rig:
        """The linear rig with its own values."""
        return _linear(self.rig, self.name, self.gradient)

    def linear_with(self, value: float) -> tuple[Rig, Hand]:
        """Return the linear rig and hand at a value of the second quantity."""
        control, hand = self.rig.controls[self.name], Hand()
        bend, loader = control.loader.bend, control.loader
        if self.kind == "assumed":
            question = Question(host_bend=value * bend, host_gradient=True)
        elif self.kind == "frame":
            question = Question("digital", frame_s=value)
        elif self.kind == "servo":
            question, hand = Question("hybrid", servo_frequency_Hz=value), Hand(HELD_FAST / bend)
        elif self.kind == "gauge":
            question, hand = Question("hybrid", gauge_frequency_Hz=value), Hand(FIRM / bend)
        elif self.kind == "mass":
            own_Hz, mass = control.sensing.gauge_frequency, value * loader.mass
            question = Question("hybrid", gauge_frequency_Hz=own_Hz or GAUGE_Hz, gauge_mass=mass)
        else:
            question, hand = Question("hybrid"), Hand(value / bend)
        return _with_values(self.linear, self.name, question), hand

    def simulated(self, value: float) -> float:
        """Return the growth found in simulation, 1/s."""
        return simulated_growth(*self.linear_with(value), _SIMULATED_s)

    def theory(self, value: float) -> float:
        """Return the growth by linear theory, 1/s."""
        return linear_growth(*self.linear_with(value))


def axis(kind: Kind, points: int) -> Floats:
    """Return values of a plane's second quantity: K̂/K linearly, the others logarithmically."""
    low, high = _VALUES[kind]
    if kind == "assumed":
        return np.linspace(low, high, points)
    return np.geomspace(low, high, points)


def plane(rig: Rig, name: ControlName, kind: Kind) -> Plane:
    """Return one plane of a control, whose structure must have a bend."""
    bend = rig.controls[name].loader.bend
    shares, values = np.linspace(_LEFT, _RIGHT, CELLS[0]), axis(kind, CELLS[1])
    fine_shares, fine_values = np.linspace(_LEFT, _RIGHT, POINTS[0]), axis(kind, POINTS[1])
    simulated, found = np.empty(CELLS), list[Crossing]()
    for i, share in enumerate(shares.tolist()):
        simulated[i] = simulated_along(rig, name, kind, share / bend, values)
        found += crossings(rig, name, kind, share / bend, values, simulated[i])
    theory = _by_theory(rig, name, kind, shares / bend, values)
    fine = _by_theory(rig, name, kind, fine_shares / bend, fine_values)
    return Plane(
        name, kind, shares, values, simulated, theory, fine_shares, fine_values, fine, tuple(found)
    )


def _by_theory(rig: Rig, name: ControlName, kind: Kind, gradients: Floats, ys: Floats) -> Floats:
    along = [PlaneAtGradient(rig, name, kind, gradient) for gradient in gradients.tolist()]
    return np.array([growths([at.linear_with(y) for y in ys.tolist()]) for at in along])


def simulated_along(
    rig: Rig, name: ControlName, kind: Kind, gradient: float, values: Floats
) -> Floats:
    """Return the simulated growth at each value of a plane's second quantity, 1/s."""
    at = PlaneAtGradient(rig, name, kind, gradient)
    return np.array([at.simulated(value) for value in values.tolist()])


def crossings(
    rig: Rig, name: ControlName, kind: Kind, gradient: float, values: Floats, simulated: Floats
) -> list[Crossing]:
    """Return where the growth, given as simulated, changes its sign along `values`."""
    found, along = [], PlaneAtGradient(rig, name, kind, gradient)
    share = gradient * rig.controls[name].loader.bend
    last = len(values) - 1
    for j in np.flatnonzero((simulated[:-1] > 0.0) != (simulated[1:] > 0.0)).tolist():
        at = _bisected(along.simulated, values[j], values[j + 1])
        assert at is not None
        theory = None
        for before, beyond in ((0, 1), (1, 1), (0, 2), (1, 2)):  # in the same cell, or beside it
            near = values[max(0, j - before)], values[min(last, j + beyond)]
            theory = theory or _bisected(along.theory, *near)
        found.append(Crossing(share, at, theory))
    return found


def _bisected(growth: Callable[[float], float], low: float, high: float) -> float | None:
    """Return the zero of a growth over the logarithm; None if both ends have one sign."""
    low, high = float(low), float(high)
    rising = growth(high) > 0.0
    if (growth(low) > 0.0) == rising:
        return None
    for _ in range(_HALVINGS):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if (growth(middle) > 0.0) == rising else (middle, high)
    return math.sqrt(low * high)
