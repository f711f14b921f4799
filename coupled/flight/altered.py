"""Changes of an aircraft's aerodynamics, by factors of the rig's `flight` section.

An alteration is data: the factor's name, the quantity whose part is scaled, the axes, and the
reference value. `modelfile` scales that part in the model itself, so a moment stays a moment, by
whatever function the model uses, without side effects.

    pitch_damping            C_mq: the pitching moment due to the pitch rate alone
    pitch_stiffness          C_mα: the pitching moment due to the angle of attack; changes the trim
    lift_slope               C_Lα: the lift due to the angle of attack; changes the trim
    elevator_effectiveness   all forces and moments due to the elevator, about its trim position
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.flight.modelfile import Scaled
from coupled.flight.wrapper import Aircraft, Hook, Wrapper
from coupled.rig.parameters import Flight

_TRIM = "fcs/pitch-trim-cmd-norm"
_TRIMS = np.linspace(-2.0, 2.0, 401)  # positions of a moved trim


@dataclass(frozen=True)
class Alteration:
    """A factor of the `flight` section, by its field's name, and the part that it scales.

    `about_trim`: the part is that of the deviation from the quantity's value in trim, not from
    zero.
    """

    part: Scaled
    about_trim: bool = False

    def factor(self, flight: Flight) -> float:
        """Return the factor of a rig."""
        return float(getattr(flight, self.part.name))


ALTERATIONS = (
    Alteration(
        Scaled(
            "pitch_damping",
            "pitching moment due to the pitch rate",
            ("velocities/q-aero-rad_sec", "velocities/q-rad_sec"),
            axes=("PITCH",),
        )
    ),
    Alteration(
        Scaled(
            "pitch_stiffness",
            "pitching moment due to the angle of attack",
            ("aero/alpha-rad", "aero/alpha-deg"),
            axes=("PITCH",),
        )
    ),
    Alteration(
        Scaled(
            "lift_slope",
            "lift due to the angle of attack",
            ("aero/alpha-rad", "aero/alpha-deg"),
            axes=("LIFT", "NORMAL", "Z"),
        )
    ),
    Alteration(
        Scaled(
            "elevator_effectiveness",
            "force or moment due to the elevator",
            ("fcs/elevator-pos-rad", "fcs/elevator-pos-deg", "fcs/elevator-pos-norm"),
        ),
        about_trim=True,
    ),
)
# The changes that restore the filed model, in still air.
UNALTERED = {a.part.name: 1.0 for a in ALTERATIONS} | {"mass": 1.0, "gust_rms_m_per_s": 0.0}


class Alterations(Wrapper):
    """The factors of a rig that are not 1.

    `make_plain` makes a plain aircraft like this one, which reads given properties: if the trim is
    moved in flight, it gives the surface position of the trim alone.
    """

    def __init__(self, flight: Flight, make_plain: Callable[[Sequence[str]], Aircraft]) -> None:
        self._flight, self._make_plain = flight, make_plain
        self._made = [a for a in ALTERATIONS if a.factor(flight) != 1.0]

    @property
    def scaled(self) -> tuple[Scaled, ...]:
        """The parts that the factors scale."""
        return tuple(alteration.part for alteration in self._made)

    def load(self, aircraft: Aircraft) -> None:
        """Set the factors with reference zero, which act in the trim."""
        self._set(aircraft, about_trim=False)

    def attach(self, aircraft: Aircraft) -> Hook | None:
        """Set the factors with reference trim, and follow a moved trim."""
        held = [
            (name, aircraft.lever(alteration.part.held(name)).set)
            for alteration in self._made
            for name in (alteration.part.properties if alteration.about_trim else ())
            if aircraft.has(name)
        ]
        for name, hold in held:
            hold(aircraft.lever(name).read())
        self._set(aircraft, about_trim=True)
        return self._follow(aircraft, held) if held and aircraft.has(_TRIM) else None

    def _set(self, aircraft: Aircraft, *, about_trim: bool) -> None:
        for alteration in self._made:
            if alteration.about_trim == about_trim:
                factor = alteration.factor(self._flight)
                aircraft.lever(alteration.part.factor).set(factor)
                aircraft.lever(alteration.part.rest).set(1.0 - factor)

    def _follow(
        self, aircraft: Aircraft, held: Sequence[tuple[str, Callable[[float], object]]]
    ) -> Hook:
        """Return a hook that holds the quantities at the surface position of the trim alone."""
        trim = aircraft.lever(_TRIM).read
        start = last = trim()
        moved = np.empty((0, len(held)))

        def follow() -> None:
            nonlocal last, moved
            if (now := trim()) == last:
                return
            last = now
            if not moved.size:
                moved = self._moved([name for name, _ in held])
            for values, (_, hold) in zip(moved.T, held, strict=True):
                hold(float(np.interp(now - start, _TRIMS, values)))

        return follow

    def _moved(self, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the quantities at each position of the trim in _TRIMS, (trims, names)."""
        other = self._make_plain(names)
        values = []
        for command in _TRIMS.tolist():
            other.step((command, 0.0, 0.0))
            values.append(other.extra())
        return np.array(values)
