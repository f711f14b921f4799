"""The loading of an aircraft: its centre of gravity, its fuel, and its mass.

Every model has an aerodynamic reference point and tanks; few have a mass that could be moved. So
the centre of gravity is moved aft by moving the reference point forward, which does not change
mass, inertia, or the arms of gear and engines. The pitching moment changes by the force normal to
the fuselage times the distance.

A difference from the model's mass is a ballast at the centre of gravity, without moment of inertia.
"""

from __future__ import annotations

import math
import re

from coupled.flight.wrapper import Aircraft, Wrapper
from coupled.rig.parameters import Flight
from coupled.units import INCH_m

_POINT = "metrics/aero-rp-x-in"  # aft positive
_BALLAST = re.compile(r"inertia/pointmass-weight-lbs(?:\[(\d+)\])?").fullmatch
_WEIGHT = "inertia/weight-lbs"
_CENTRE = {axis.upper(): f"inertia/cg-{axis}-in" for axis in "xyz"}
_FUEL = re.compile(r"propulsion/tank(\[\d+\])?/contents-lbs").fullmatch


class Loading(Wrapper):
    """The loading by a rig's `flight` section."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight

    def load(self, aircraft: Aircraft) -> None:
        """Load a model before it is trimmed."""
        if self._flight.cg_aft != 0.0:
            point = aircraft.lever(_POINT)
            point.set(point.read() - self._flight.cg_aft / INCH_m)
        if self._flight.fuel != 1.0:
            self._fill(aircraft)

    @property
    def ballast(self) -> bool:
        """Whether the mass differs from the model's, so that a ballast is needed."""
        return self._flight.mass != 1.0

    def weigh(self, aircraft: Aircraft) -> None:
        """Put the ballast at the centre of gravity of the loaded and fuelled aircraft."""
        if not self.ballast:
            return
        found = [match for name in aircraft.names() if (match := _BALLAST(name))]
        if not found:
            raise aircraft.fault("mass", f"{self._flight.model} has no mass to add to")
        last = max(int(match[1] or 0) for match in found)
        index = f"[{last}]" if last else ""
        for axis, centre in _CENTRE.items():
            place = aircraft.lever(f"inertia/pointmass-location-{axis}-inches{index}")
            place.set(_read(aircraft, centre))
        more = (self._flight.mass - 1.0) * _read(aircraft, _WEIGHT)
        aircraft.lever(f"inertia/pointmass-weight-lbs{index}").set(more)

    def _fill(self, aircraft: Aircraft) -> None:
        flight = self._flight
        tanks = [aircraft.lever(name) for name in sorted(filter(_FUEL, aircraft.names()))]
        if not any(tank.read() > 0.0 for tank in tanks):
            raise aircraft.fault("fuel", f"{flight.model} has no fuel in its tanks")
        for tank in tanks:
            wanted = flight.fuel * tank.read()
            tank.set(wanted)
            if not math.isclose(tank.read(), wanted, rel_tol=1e-6, abs_tol=1e-9):
                problem = f"{flight.fuel:g} is more than the tanks of {flight.model} hold"
                raise aircraft.fault("fuel", problem)


def _read(aircraft: Aircraft, name: str) -> float:
    """Return a property that exists in every model."""
    read = aircraft.reader(name)
    assert read is not None, name
    return read()
