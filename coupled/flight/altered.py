"""Changes of an aircraft's forces and moments, by factors of the rig's `flight` section.

An alteration is data: the part of the model that a factor scales, named by the factor's key, and
whether the part counts from the trim. `modelparts` scales the part in the model itself, so a moment
stays a moment, by whatever function the model uses, without side effects.

    terms                    named functions of the model's aerodynamics; changes the trim
    drag                     all functions of the drag axis; changes the trim
    thrust                   force and moment of the engines; changes the trim
    lift_slope               C_Lα: the lift due to the angle of attack; changes the trim
    side_force_slope         C_Yβ: the side force due to the sideslip
    pitch_damping            C_mq: the pitching moment due to the pitch rate alone
    roll_damping             C_lp: the rolling moment due to the roll rate
    yaw_damping              C_nr: the yawing moment due to the yaw rate
    pitch_stiffness          C_mα: the pitching moment due to the angle of attack; changes the trim
    pitching_moment          a constant C_m that is added; changes the trim
    lift_offset              a constant C_L that is added; changes the trim
    yawing_moment            a constant C_n that is added; changes the trim
    side_force               a constant C_Y that is added; changes the trim
    dihedral_effect          C_lβ: the rolling moment due to the sideslip
    directional_stability    C_nβ: the yawing moment due to the sideslip
    adverse_yaw              C_nδa: the yawing moment due to the ailerons
    …_effectiveness          all forces and moments due to a surface, about its trim position
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.flight.everyframe import TRIMS
from coupled.flight.loading import INERTIAS
from coupled.flight.modelparts import (
    FORCE,
    LATERAL_MOMENT,
    MOMENT,
    Constant,
    NothingToScaleError,
    Part,
    Scaled,
    Term,
    Thrust,
    Whole,
)
from coupled.flight.modeltext import ModelText
from coupled.flight.wrapper import Aircraft, Hook, Wrapper, together
from coupled.record.channels import ControlName
from coupled.rig.parameters import Flight

_MOVED = np.linspace(-2.0, 2.0, 401)  # positions of a moved trim

_ALPHA = ("aero/alpha-rad", "aero/alpha-deg")
_BETA = ("aero/beta-rad", "aero/beta-deg")
_AILERON = (
    *("fcs/left-aileron-pos-rad", "fcs/left-aileron-pos-deg", "fcs/left-aileron-pos-norm"),
    *("fcs/right-aileron-pos-rad", "fcs/right-aileron-pos-deg", "fcs/right-aileron-pos-norm"),
    *("fcs/aileron-pos-rad", "fcs/aileron-pos-deg", "fcs/aileron-pos-norm"),
    "fcs/effective-aileron-pos",
)
_ELEVATOR = ("fcs/elevator-pos-rad", "fcs/elevator-pos-deg", "fcs/elevator-pos-norm")
_RUDDER = ("fcs/rudder-pos-rad", "fcs/rudder-pos-deg", "fcs/rudder-pos-norm")
_P = ("velocities/p-aero-rad_sec", "velocities/p-rad_sec")
_Q = ("velocities/q-aero-rad_sec", "velocities/q-rad_sec")
_R = ("velocities/r-aero-rad_sec", "velocities/r-rad_sec")
_SIDE, _LIFT = ("SIDE", "Y"), ("LIFT", "NORMAL", "Z")
_ROLL, _PITCH, _YAW = ("ROLL",), ("PITCH",), ("YAW",)


@dataclass(frozen=True)
class Alteration:
    """A part of the model that a key of the `flight` section scales.

    `about_trim` is the control whose surface moves the part, if the part is that of the deviation
    from the surface's trim position; otherwise it counts from zero.
    """

    part: Part
    about_trim: ControlName | None = None


# Those about the trim are last: their parts include what the others change.
ALTERATIONS = (
    Alteration(Whole("drag", "force along the DRAG axis", ("DRAG",))),
    Alteration(Thrust()),
    Alteration(Constant("pitching_moment", "PITCH", MOMENT)),
    Alteration(Constant("lift_offset", "LIFT", FORCE)),
    Alteration(Constant("yawing_moment", "YAW", LATERAL_MOMENT)),
    Alteration(Constant("side_force", "SIDE", FORCE)),
    Alteration(Scaled("lift_slope", "lift due to the angle of attack", _ALPHA, _LIFT)),
    Alteration(Scaled("side_force_slope", "side force due to the sideslip", _BETA, _SIDE)),
    Alteration(Scaled("pitch_damping", "pitching moment due to the pitch rate", _Q, _PITCH)),
    Alteration(Scaled("roll_damping", "rolling moment due to the roll rate", _P, _ROLL)),
    Alteration(Scaled("yaw_damping", "yawing moment due to the yaw rate", _R, _YAW)),
    Alteration(
        Scaled("pitch_stiffness", "pitching moment due to the angle of attack", _ALPHA, _PITCH)
    ),
    Alteration(Scaled("dihedral_effect", "rolling moment due to the sideslip", _BETA, _ROLL)),
    Alteration(Scaled("directional_stability", "yawing moment due to the sideslip", _BETA, _YAW)),
    Alteration(Scaled("adverse_yaw", "yawing moment due to the ailerons", _AILERON, _YAW)),
    Alteration(
        Scaled("elevator_effectiveness", "force or moment due to the elevator", _ELEVATOR), "column"
    ),
    Alteration(
        Scaled("aileron_effectiveness", "force or moment due to the ailerons", _AILERON), "wheel"
    ),
    Alteration(
        Scaled("rudder_effectiveness", "force or moment due to the rudder", _RUDDER), "pedals"
    ),
)
# The changes that restore still air, and the filed model in it.
STILL: Mapping[str, Any] = {"gust_rms_m_per_s": 0.0, "lateral_gust_rms_m_per_s": 0.0}
UNALTERED: Mapping[str, Any] = {
    **{a.part.name: a.part.neutral for a in ALTERATIONS},
    **dict.fromkeys(("mass", *INERTIAS), 1.0),
    "terms": {},
    **STILL,
}


class Altered(NamedTuple):
    """An alteration of a rig's aircraft: part and factor, and whether it counts from the trim."""

    part: Part
    factor: float
    about_trim: ControlName | None


def alterations(flight: Flight) -> list[Altered]:
    """Return a rig's terms, and its alterations whose factors are not neutral, in order.

    A term is made at a factor of 1 as well, so that a wrong name is refused.
    """
    terms = [Altered(Term(name), factor, None) for name, factor in flight.terms.items()]
    others = [Altered(a.part, getattr(flight, a.part.name), a.about_trim) for a in ALTERATIONS]
    return [*terms, *(each for each in others if each.factor != each.part.neutral)]


def parts_of(main: Path) -> frozenset[str]:
    """Return the keys of the parts that a model has, of those that a factor scales.

    `main` is its main file. Raises UnreadableModelError for a file that is not XML.
    """
    state = main.stat()
    return _parts_of(main, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=16)
def _parts_of(main: Path, changed_ns: int, size: int) -> frozenset[str]:
    """Return the same; the time of change and the size key the cache."""
    found = set[str]()
    for part in (alteration.part for alteration in ALTERATIONS):
        with suppress(NothingToScaleError):
            part.make_scalable(ModelText.of(main))
            found.add(part.name)
    return frozenset(found)


class Alterations(Wrapper):
    """The terms and the factors of a rig.

    `make_plain` makes a plain aircraft like this one, led by a control, which reads given
    properties: if the trim is moved in flight, it gives the surface position of the trim alone.
    """

    def __init__(
        self, flight: Flight, make_plain: Callable[[ControlName, Sequence[str]], Aircraft]
    ) -> None:
        self._made, self._make_plain = alterations(flight), make_plain

    @property
    def scaled(self) -> tuple[Part, ...]:
        """The parts that the factors scale."""
        return tuple(each.part for each in self._made)

    def load(self, aircraft: Aircraft) -> None:
        """Set the factors with reference zero, which act in the trim."""
        self._set(aircraft, about_trim=False)

    def attach(self, aircraft: Aircraft) -> Hook | None:
        """Set the factors with reference trim, and follow a moved trim."""
        hooks = list[Hook]()
        for each in self._made:
            if each.about_trim is None or not isinstance(each.part, Scaled):
                continue
            held = {
                name: aircraft.lever(each.part.held(name)).set
                for name in each.part.properties
                if aircraft.has(name)
            }
            for name, hold in held.items():
                hold(aircraft.lever(name).read())
            if held and aircraft.has(TRIMS[each.about_trim]):
                hooks.append(self._follow(aircraft, each.about_trim, held))
        self._set(aircraft, about_trim=True)
        return together(hooks)

    def _set(self, aircraft: Aircraft, *, about_trim: bool) -> None:
        for part, factor, control in self._made:
            if (control is not None) == about_trim:
                for name, value in part.settings(factor).items():
                    aircraft.lever(name).set(value)

    def _follow(
        self,
        aircraft: Aircraft,
        control: ControlName,
        held: Mapping[str, Callable[[float], object]],
    ) -> Hook:
        """Return a hook that holds the quantities at the surface position of the trim alone."""
        trim = aircraft.lever(TRIMS[control]).read
        start = last = trim()
        moved = np.empty((0, len(held)))

        def follow() -> None:
            nonlocal last, moved
            if (now := trim()) == last:
                return
            last = now
            if not moved.size:
                moved = self._moved(control, list(held))
            for values, hold in zip(moved.T, held.values(), strict=True):
                hold(float(np.interp(now - start, _MOVED, values)))

        return follow

    def _moved(self, control: ControlName, names: Sequence[str]) -> NDArray[np.float64]:
        """Return the quantities at each position of the trim in _MOVED, (trims, names)."""
        other = self._make_plain(control, names)
        values = []
        for command in _MOVED.tolist():
            other.step((command, 0.0, 0.0))
            values.append(other.extra())
        return np.array(values)
