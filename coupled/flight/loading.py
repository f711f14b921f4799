"""How an aircraft is loaded: its centre of gravity, and its fuel.

Every model has a point at which its aerodynamic forces act on it, and tanks; few have a mass
that could be put elsewhere. So the centre of gravity is moved aft by bringing that point
forward, which leaves mass and inertia as they are, and the arms of gear and engines too. The
pitching moment changes by the force normal to the fuselage times the way.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any

from coupled.rig.parameters import Flight
from coupled.units import INCH_m

_POINT = "metrics/aero-rp-x-in"  # aft positive
_FUEL = re.compile(r"propulsion/tank(\[\d+\])?/contents-lbs").fullmatch


def load(fdm: Any, flight: Flight, properties: Iterable[str]) -> tuple[str, str] | None:
    """Load a model before it is trimmed; return the key that it cannot be, and why, or None."""
    if flight.cg_aft != 0.0:
        fdm[_POINT] -= flight.cg_aft / INCH_m
    if flight.fuel == 1.0:
        return None
    tanks = sorted(filter(_FUEL, properties))
    if not any(fdm[tank] > 0.0 for tank in tanks):
        return "fuel", f"{flight.model} has no fuel in its tanks"
    for tank in tanks:
        wanted = flight.fuel * fdm[tank]
        fdm[tank] = wanted
        if not math.isclose(fdm[tank], wanted, rel_tol=1e-6, abs_tol=1e-9):
            return "fuel", f"{flight.fuel:g} is more than the tanks of {flight.model} hold"
    return None
