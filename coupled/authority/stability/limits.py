"""The stability limits of a rig at its stiffest gradient, and the decay of its own motion."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from coupled.authority.stability.linear import growth as linear_growth
from coupled.authority.stability.planes import (
    Crossing,
    Kind,
    Plane,
    axis,
    crossings,
    kinds_of,
    linear_rig,
    simulated_along,
)
from coupled.record.channels import ControlName
from coupled.rig.growth import growth as simulated_growth
from coupled.rig.packing import Hand
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig

ARM_N_per_d = 500.0  # default stiffness of a pilot's arm
_POINTS = 41
_SIMULATED_s = 8.0
_CLAMP_rad_per_s = 6.0
# The planes searched from above, where the rig is most stable.
_FROM_ABOVE: tuple[Kind, ...] = ("servo", "gauge")


@dataclass(frozen=True)
class Limit:
    """The value of one quantity, at the stiffest gradient, at which a control becomes unstable.

    `stable` is the stable side: `below` or `above` the limit; or `everywhere` or `nowhere` within
    the values tried, from `least` to `greatest`, without a limit. `filed` is the rig's own value,
    None if its file has none.
    """

    kind: Kind
    stable: str
    simulated: float | None
    theory: float | None
    least: float
    greatest: float
    filed: float | None = None

    @property
    def outside(self) -> bool:
        """Whether the rig's own value is on the unstable side."""
        if self.filed is None or self.stable == "everywhere":
            return False
        if self.simulated is None:
            return True
        return (self.filed < self.simulated) == (self.stable == "above")


@dataclass(frozen=True)
class HandGrowth:
    """Growth in 1/s of the motion of a control with a hand, at its stiffest gradient."""

    hand: str
    simulated: float
    theory: float


@dataclass(frozen=True)
class StabilityLimits:
    """A control's largest K·G_T as `share`, its limits, and the decay of its motion as filed."""

    control: ControlName
    gradient: float
    share: float
    limits: tuple[Limit, ...]
    filed: tuple[HandGrowth, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return asdict(self)


def stability_limits(rig: Rig, name: ControlName) -> StabilityLimits:
    """Return a control's limits; its structure must have a bend."""
    control = rig.controls[name]
    stiffest = gradient_range(control)[1]
    limits = tuple(
        replace(_limit(rig, name, kind, stiffest), filed=filed(rig, name, kind))
        for kind in kinds_of(control)
    )
    share, growths = stiffest * control.loader.bend, _growths(rig, name, stiffest)
    return StabilityLimits(name, stiffest, share, limits, growths)


def filed(rig: Rig, name: ControlName, kind: Kind) -> float | None:
    """Return a rig's own value of a plane's quantity, None if its file has none.

    For a hand's stiffness it is the usual one of a pilot's arm.
    """
    control = rig.controls[name]
    bend, loader, sensing = control.loader.bend, control.loader, control.sensing
    own = {
        "assumed": control.compensation.bend / bend,
        "frame": 1.0 / rig.frame_rate,
        "hand": ARM_N_per_d * bend,
        "servo": loader.servo_frequency,
        "gauge": sensing.gauge_frequency,
        "mass": sensing.gauge_mass / loader.mass,
    }[kind]
    return own or None


def gradient_range(control: Control) -> tuple[float, float]:
    """Return the softest and stiffest gradient of a schedule, N/d."""
    table = control.schedule
    places = np.array(sorted({*table.dynamic_pressure, *table.gradient_curve.nodes}))
    added = table.gradient_curve.at(places)
    sloped = [[g[0] + table.slope * (value - g[0]) for value in g] for g in table.segments]
    every = [np.interp(places, table.dynamic_pressure, g) + added for g in sloped]
    return float(np.min(every)), float(np.max(every))


@dataclass(frozen=True)
class Disagreement:
    """The differences of simulated limits from those of linear theory, as shares.

    `most` bounds 95 % of the common ones, `worst` all; None if there are none. `alone` is the
    number of simulated limits that linear theory does not have.
    """

    limits: int
    alone: int
    most: float | None
    worst: float | None

    @property
    def words(self) -> str:
        """The result of the comparison, in a sentence."""
        said = f"{self.limits} limits on the map"
        if self.alone:
            said += f", {self.alone} of which linear theory does not have"
        if self.most is None or self.worst is None:
            return said
        return (
            f"{said}: 95 % of those simulated lie within {100.0 * self.most:.2f} % of linear"
            f" theory, all within {100.0 * self.worst:.2f} %"
        )


def disagreement(planes: Iterable[Plane]) -> Disagreement:
    """Return the differences of simulated limits from linear ones."""
    every = [c.difference for plane in planes for c in plane.crossings]
    found = [share for share in every if share is not None]
    most = float(np.quantile(found, 0.95)) if found else None
    return Disagreement(len(every), len(every) - len(found), most, max(found, default=None))


def _limit(rig: Rig, name: ControlName, kind: Kind, gradient: float) -> Limit:
    values = axis(kind, _POINTS)
    found = simulated_along(rig, name, kind, gradient, values)
    ends = float(values[0]), float(values[-1])
    places = crossings(rig, name, kind, gradient, values, found)
    above = kind in _FROM_ABOVE
    if not places:
        return Limit(kind, "nowhere" if found[0] > 0.0 else "everywhere", None, None, *ends)
    if found[-1 if above else 0] > 0.0:
        return Limit(kind, "nowhere", None, None, *ends)
    first: Crossing = places[-1 if above else 0]
    return Limit(kind, "above" if above else "below", first.simulated, first.theory, *ends)


def _growths(rig: Rig, name: ControlName, gradient: float) -> tuple[HandGrowth, ...]:
    loader, w = rig.controls[name].loader, _CLAMP_rad_per_s
    hands = {
        "free": Hand(),
        "clamp": Hand(w * loader.damping, w * loader.mass, w * gradient),
    }
    linear = linear_rig(rig, name, gradient)
    found = []
    for hand_name, hand in hands.items():
        simulated = simulated_growth(linear, hand, _SIMULATED_s)
        found.append(HandGrowth(hand_name, simulated, linear_growth(linear, hand)))
    return tuple(f for f in found if math.isfinite(f.simulated) and np.isfinite(f.theory))
