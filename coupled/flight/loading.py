"""The loading of an aircraft: its centre of gravity, its fuel, its mass and moments of inertia.

Every model has an aerodynamic reference point and tanks; few have a mass that could be moved. So
the centre of gravity is moved aft by moving the reference point forward, which does not change
mass, inertia, or the arms of gear and engines. The pitching moment changes by the force normal to
the fuselage times the distance.

A difference from the model's mass is a ballast at the centre of gravity, without moment of inertia.
A difference from its moments of inertia is made by three pairs of equal weights w, each at ±d from
the centre of gravity on a body axis, with the weight −2w there. They have no weight together, and
add 2·w·d² to the moments of inertia about the other two axes, wherever the centre of gravity moves.
"""

from __future__ import annotations

import math
import re

import numpy as np

from coupled.flight.wrapper import Aircraft, Wrapper
from coupled.rig.parameters import Flight
from coupled.units import FOOT_m, INCH_m

_POINT = "metrics/aero-rp-x-in"  # aft positive
_BALLAST = re.compile(r"inertia/pointmass-weight-lbs(?:\[(\d+)\])?").fullmatch
_WEIGHT = "inertia/weight-lbs"
INERTIAS = ("roll_inertia", "pitch_inertia", "yaw_inertia")
_PRODUCTS = ("xx", "yy", "zz", "xy", "xz", "yz")
_FAR_in = 1200.0  # d
Place = tuple[float, float, float]
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
    def ballasts(self) -> int:
        """The ballast of another mass, and those of other moments of inertia."""
        return (self._flight.mass != 1.0) + (7 if self._factors() else 0)

    def weigh(self, aircraft: Aircraft) -> None:
        """Put the ballasts about the centre of gravity of the loaded and fuelled aircraft."""
        if not self.ballasts:
            return
        found = [match for name in aircraft.names() if (match := _BALLAST(name))]
        if not found:
            key = "mass" if self._flight.mass != 1.0 else next(iter(self._factors()))
            raise aircraft.fault(key, f"{self._flight.model} has no mass to add to")
        last = max(int(match[1] or 0) for match in found)
        places = self._inertia_weights(aircraft) if self._factors() else []
        if self._flight.mass != 1.0:
            places.append(((0.0, 0.0, 0.0), (self._flight.mass - 1.0) * _read(aircraft, _WEIGHT)))
        centre = [_read(aircraft, name) for name in _CENTRE.values()]
        for number, (place, weight) in enumerate(places, last + 1 - len(places)):
            index = f"[{number}]" if number else ""
            for axis, middle, off in zip(_CENTRE, centre, place, strict=True):
                at = aircraft.lever(f"inertia/pointmass-location-{axis}-inches{index}")
                at.set(middle + off)
            aircraft.lever(f"inertia/pointmass-weight-lbs{index}").set(weight)

    def _factors(self) -> dict[str, float]:
        """Return the factors of the moments of inertia that are not 1, by their keys."""
        factors = {key: float(getattr(self._flight, key)) for key in INERTIAS}
        return {key: factor for key, factor in factors.items() if factor != 1.0}

    def _inertia_weights(self, aircraft: Aircraft) -> list[tuple[Place, float]]:
        """Return places from the centre of gravity, in, and weights, lb, that change the inertia.

        Weights w on the axes x, y, z add w_y + w_z, w_x + w_z, w_x + w_y, in units of 2·d².
        """
        factors = self._factors()
        read = {p: _read(aircraft, f"inertia/i{p}-slugs_ft2") for p in _PRODUCTS}
        xy, xz, yz = (-read[pair] for pair in ("xy", "xz", "yz"))
        old = np.array([read[pair] for pair in ("xx", "yy", "zz")])
        more = old * [factors.get(key, 1.0) - 1.0 for key in INERTIAS]
        whole = np.diag(old + more) + np.array([[0.0, xy, xz], [xy, 0.0, yz], [xz, yz, 0.0]])
        if np.linalg.eigvalsh(whole)[0] <= 0.0:
            problem = f"with it, the inertia of {self._flight.model} is not positive definite"
            raise aircraft.fault(next(iter(factors)), f"{problem}; choose a larger factor")
        slug_lb = _read(aircraft, _WEIGHT) / _read(aircraft, "inertia/mass-slugs")
        weights = (0.5 * more.sum() - more) * slug_lb / (2.0 * (_FAR_in * INCH_m / FOOT_m) ** 2)
        places: list[tuple[Place, float]] = []
        for (x, y, z), weight in zip(np.eye(3) * _FAR_in, weights.tolist(), strict=True):
            places += [((x, y, z), weight), ((-x, -y, -z), weight)]
        return [*places, ((0.0, 0.0, 0.0), -2.0 * sum(weights.tolist()))]

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
