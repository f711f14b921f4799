"""Curves of a rig: functions of one signal as nodes and values, linear between the nodes.

Beyond its ends a curve continues at the slope of its last segment. One that begins at 0 is odd,
f(−x) = −f(x). A curve without nodes leaves the effect out. `piecewise` has them for the kernels.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from coupled.errors import MISSING, InputError
from coupled.schema import Section, file_keys, quantity

Floats = NDArray[np.float64]
MOST_NODES = 24  # of a curve
FAR = 10.0  # of a curve's length, up to which it is inverted beyond its ends
FLAT_SLOPE = 1e-6  # of a map where it is flat, to be inverted


class Curve(Section):
    """A function of one signal: `LISTS` are its fields of nodes and values."""

    LISTS: ClassVar[tuple[str, str]]
    SIGNED: ClassVar[bool] = True  # the signal has both signs
    MAP: ClassVar[bool] = False  # the value replaces the signal; others are added to a law

    @property
    def nodes(self) -> list[float]:
        """The values of the signal, rising."""
        found: list[float] = getattr(self, self.LISTS[0])
        return found

    @property
    def values(self) -> list[float]:
        """The value of the function at each node."""
        found: list[float] = getattr(self, self.LISTS[1])
        return found

    @property
    def odd(self) -> bool:
        """Whether the curve begins at 0 and is the same to both sides."""
        return self.SIGNED and self.nodes[:1] == [0.0]

    def at(self, signal: float | Floats) -> Floats:
        """Return the function at values of the signal; without nodes 0, or of a map the signal."""
        given = np.asarray(signal, dtype=np.float64)
        if not self.nodes:
            return given.copy() if self.MAP else np.zeros_like(given)
        nodes, values = np.array(self.nodes), np.array(self.values)
        size = np.abs(given) if self.odd else given
        left = np.clip(np.searchsorted(nodes, size, "right") - 1, 0, len(nodes) - 2)
        slope = np.diff(values) / np.diff(nodes)
        found = values[left] + slope[left] * (size - nodes[left])
        return np.asarray(np.sign(given) * found if self.odd else found)

    def inverse(self, values: Floats) -> Floats:
        """Return the signals at which a map has given values; where it is flat, one of them."""
        if not self.nodes:
            return values
        nodes = np.array(self.nodes)
        far = nodes[-1] + FAR * max(float(nodes[-1] - nodes[0]), float(np.ptp(values)))
        least = -far if self.odd else 2.0 * nodes[0] - far
        at = np.concatenate(([least], -nodes[::-1] if self.odd else [], nodes, [far]))
        at = np.unique(at)
        return np.asarray(np.interp(values, self.at(at) + FLAT_SLOPE * at, at))

    @property
    def slopes(self) -> list[float]:
        """The slope of each segment."""
        pairs = pairwise(zip(self.nodes, self.values, strict=True))
        return [(b - a) / (after - before) for (before, a), (after, b) in pairs]


class SpringCurve(Curve):
    """A force against δc by its distance from neutral, added to the loader's springs."""

    LISTS = ("deflection", "force")

    deflection: list[float] = quantity("{d}", [])
    force: list[float] = quantity("N", [])


class FrictionCurve(Curve):
    """A force against the motion by its rate, added to friction and damping.

    Its value at rest is dry friction. `force_push` is that of motion forward, by default the same.
    """

    SIGNED = False
    LISTS = ("rate", "force")

    rate: list[float] = quantity("{d}_per_s", [])
    force: list[float] = quantity("N", [])
    force_push: list[float] = quantity("N", [])

    @property
    def forward(self) -> list[float]:
        """The force at each rate of motion forward, N."""
        return self.force_push or self.force


class LoadCurve(Curve):
    """Dry friction by the size of the force carried, added to the friction."""

    SIGNED = False
    LISTS = ("load", "friction")

    load: list[float] = quantity("N", [])
    friction: list[float] = quantity("N", [])


class BendCurve(Curve):
    """A bend of the structure by the force on the grip, added to K·F."""

    LISTS = ("force", "bend")

    force: list[float] = quantity("N", [])
    bend: list[float] = quantity("{d}", [])


class DeflectionReading(Curve):
    """A transducer's reading over δc, before the scales of `Sensing`, or over δ at the grip."""

    MAP = True
    LISTS = ("deflection", "reading")

    deflection: list[float] = quantity("{d}", [])
    reading: list[float] = quantity("{d}", [])


class GripLoad(Curve):
    """What the force on the grip adds to the reading of δ there; it may fall, as no bend does."""

    LISTS = ("force", "reading")

    force: list[float] = quantity("N", [])
    reading: list[float] = quantity("{d}", [])


class ForceReading(Curve):
    """The reading of F by the host over F, before the scale of `Sensing`."""

    MAP = True
    LISTS = ("force", "reading")

    force: list[float] = quantity("N", [])
    reading: list[float] = quantity("N", [])


class GradientCurve(Curve):
    """A gradient by the schedule's q̄, added to G_T of every segment."""

    SIGNED = False
    LISTS = ("dynamic_pressure", "gradient")

    dynamic_pressure: list[float] = quantity("Pa", [])
    gradient: list[float] = quantity("N_per_{d}", [])


class CommandCurve(Curve):
    """The command of the surface over δ̂ as a share of the travel, pull positive; 1 is all of it."""

    MAP = True
    LISTS = ("deflection", "command")

    deflection: list[float] = quantity("norm", [])
    command: list[float] = quantity("norm", [])


def curves_of(section: Section, d: str) -> Iterator[tuple[str, Curve]]:
    """Yield the curves of a section by their keys in a file, absent ones too."""
    for key, field in _curve_fields(type(section), d):
        yield key, getattr(section, field)


@cache
def _curve_fields(section: type[Section], d: str) -> tuple[tuple[str, str], ...]:
    """Return the keys in a file, and the fields, of a section's curves."""
    kinds = {name: field.annotation for name, field in section.model_fields.items()}
    return tuple(
        (key, field)
        for key, field in file_keys(section, d).items()
        if isinstance(kind := kinds[field], type) and issubclass(kind, Curve)
    )


def check_curves(section: Section, file: object, path: str, d: str) -> None:
    """Raise InputError for a curve of a section whose lists are not those of a function."""
    for key, curve in curves_of(section, d):
        if not curve.model_fields_set:  # absent
            continue
        _check_lists(curve, file, f"{path}.{key}", d)
        if curve.nodes:
            _check_values(curve, file, f"{path}.{key}", d)


def _check_lists(curve: Curve, file: object, path: str, d: str) -> None:
    """Refuse lists of different lengths, and nodes that do not rise."""
    given = {key: getattr(curve, field) for key, field in file_keys(type(curve), d).items()}
    of, values, *_ = given
    for key in (of, values):
        if not given[key] and any(given.values()):
            raise InputError(file, f"{path}.{key}", f"{MISSING}; a curve needs {of} and {values}")
    nodes = given[of]
    if nodes and len(nodes) < 2:
        raise InputError(file, f"{path}.{of}", "has one value; a curve needs at least two")
    if len(nodes) > MOST_NODES:
        raise InputError(file, f"{path}.{of}", f"has more than {MOST_NODES} values")
    if any(b <= a for a, b in pairwise(nodes)):
        raise InputError(file, f"{path}.{of}", "must rise from value to value")
    for key, each in given.items():
        if each and len(each) != len(nodes):
            problem = f"has {len(each)} values, {of} {len(nodes)}; give as many"
            raise InputError(file, f"{path}.{key}", problem)


def _check_values(curve: Curve, file: object, path: str, d: str) -> None:
    """Refuse a curve that jumps where it may not, or that no rig can have."""
    of, values, *_ = (f"{path}.{key}" for key in file_keys(type(curve), d))
    nodes, begun = curve.nodes, curve.values[0]
    if curve.SIGNED and not nodes[0] <= 0.0 < nodes[-1]:
        problem = "should rise from 0, for the same curve to both sides, or from below through 0"
        raise InputError(file, of, problem)
    if curve.odd and begun != 0.0:
        problem = f"begins at {begun:g}; a curve from 0, the same to both sides, begins at 0"
        raise InputError(file, values, problem)
    if isinstance(curve, BendCurve) and float(curve.at(0.0)) != 0.0:
        problem = (
            f"is {float(curve.at(0.0)):g} {d} without a force; give the node 0 with the bend 0"
        )
        raise InputError(file, values, problem)
    if isinstance(curve, (FrictionCurve, LoadCurve)) and nodes[0] != 0.0:
        raise InputError(file, of, f"begins at {nodes[0]:g}; it should begin at 0")
    _check_rubs(curve, file, path, d)
    if curve.MAP and min(curve.slopes) < 0.0:
        low = nodes[curve.slopes.index(min(curve.slopes))]
        raise InputError(file, values, f"falls beyond {low:g}; it may not fall from value to value")


def _check_rubs(curve: Curve, file: object, path: str, d: str) -> None:
    """Refuse added dry friction below zero; at rates above 0 a curve is damping, and may fall."""
    if not isinstance(curve, (FrictionCurve, LoadCurve)):
        return
    for key, field in list(file_keys(type(curve), d).items())[1:]:
        given = getattr(curve, field)
        rubs = given if isinstance(curve, LoadCurve) else given[:1]
        for node, value in zip(curve.nodes, rubs, strict=False):
            if value < 0.0:
                problem = f"is {value:g} at {node:g}; dry friction is not below 0, give at least 0"
                raise InputError(file, f"{path}.{key}", problem)
