"""A stage's declaration of its part of a control: its numbers and their origin.

A stage's kernels see two classes of numbers, its parameters and its state. A parameter with the
name of a field of the rig's section is that field; any other is computed by a function of the
stage's module. `control` lists the declarations once; layouts and packing follow from that list.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from coupled.rig.parameters import Control

Ends = tuple[float, float]  # stops of a control, at its travel or within it: least and greatest, d


@dataclass(frozen=True)
class Hand:
    """The impedance of a hand on one control; all zero is a hand with a given force only.

    stiffness in N/d, damping in N·s/d, integral in N/(d·s), muscle lag in s. `mass`, kg (N per
    d/s²), is the arm's at the grip. `strongest` (0: no limit) can be held for `endurance_s`,
    `lasting` for any time, N. `reach`, d (0: none), is the hand's largest deflection.
    """

    stiffness: float = 0.0
    damping: float = 0.0
    integral: float = 0.0
    lag_s: float = 0.0
    strongest: float = 0.0
    lasting: float = 0.0
    endurance_s: float = 0.0
    reach: float = 0.0
    mass: float = 0.0


@dataclass(frozen=True)
class Given:
    """The inputs of a control's parameters; times in s, the substep being the loader's."""

    control: Control
    hand: Hand
    frame_s: float
    substep_s: float
    substeps: int
    joined: bool = False  # forces act between controls, in the structure or for the host
    bends: tuple[float, ...] = ()  # d/N, bend here by each control's force, its own left out
    assumed: tuple[float, ...] = ()  # the same as assumed by the host
    leaks: tuple[float, ...] = ()  # shares of their forces that act on this loader


@dataclass(frozen=True)
class Declaration:
    """A stage's numbers and their origin.

    parameters   layout of the parameters
    section      the part of `Given` whose fields are parameters of the same name, dotted
    derived      {parameter: its value}, for all others
    state        layout of the state, if the stage has one
    fixed        fields of the state that do not grow with the control's motion
    """

    parameters: np.dtype[np.void]
    section: str = "control"
    derived: Mapping[str, Callable[[Given], ArrayLike]] = field(default_factory=dict)
    state: np.dtype[np.void] | None = None
    fixed: tuple[str, ...] = ()

    def value(self, name: str, given: Given) -> ArrayLike:
        """Return the value of a parameter; AttributeError if the rig has no such name."""
        if name in self.derived:
            return self.derived[name](given)
        value: ArrayLike = getattr(self._holder(given), name)
        return value

    def values(self, given: Given) -> tuple[ArrayLike, ...]:
        """Return the values of all parameters, in their order."""
        own, holder = self.derived, self._holder(given)
        names = self.parameters.names or ()
        return tuple([own[n](given) if n in own else getattr(holder, n) for n in names])

    def _holder(self, given: Given) -> Any:
        """Return the part of the rig whose fields are the stage's own parameters."""
        holder: Any = given
        for part in self.section.split("."):
            holder = getattr(holder, part)
        return holder


def first_order_gain(lag_s: float, step_s: float) -> float:
    """Return the step response of a first-order lag after one step; 1 without lag."""
    return -math.expm1(-step_s / lag_s) if lag_s > 0.0 else 1.0
