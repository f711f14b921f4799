"""Functions of the user's own, called once a frame: a pilot's force, or a scheduled gradient.

A function maps the state at t_k, read by the host, to a number for the frame from t_k to t_k+1. One
with a state of its own may have a function `reset`, which is called at the start of each flight.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Mapping
from numbers import Real
from typing import TYPE_CHECKING, Any, Literal

from coupled.errors import InputError, shown, shown_value
from coupled.flight.pilot.base import STRONGEST, Action, Pilot, Start
from coupled.flight.state import State, time_of
from coupled.record.channels import CONTROL_NAMES, ControlName, unit_of
from coupled.rig.rig import Rig

Law = Callable[[State], float]
if TYPE_CHECKING:
    PilotOrLaw = Pilot
else:
    PilotOrLaw = Pilot | Law  # a manoeuvre may be given a function, and has a pilot
_WANTED = "give a function of the state, as `lambda state: 50.0`"


class GivenForce(Pilot):
    """A hand whose force is given frame by frame, and held over each frame."""

    kind: Literal["given", "own"] = "given"
    start_s: float = 0.0

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return a hand without impedance; its force is given in flight."""
        return Action()


class OwnPilot(GivenForce):
    """A pilot of the user's own: `law` maps the state of a frame to the hand's force, N."""

    kind: Literal["own"] = "own"
    law: Callable[..., Any]

    @property
    def title(self) -> str:
        """The name of the function."""
        return name_of(self.law)


def as_pilot(given: Any) -> Any:
    """Return a pilot, or the pilot of a function."""
    if isinstance(given, (Pilot, type)) or not callable(given):
        return given  # a manoeuvre refuses what is no pilot
    return OwnPilot(law=given)


def given_laws(
    column: Law | None, wheel: Law | None, pedals: Law | None, file: object
) -> dict[ControlName, Pilot]:
    """Return the pilots of functions, by their controls; raises InputError for what is none."""
    found: dict[ControlName, Pilot] = {}
    for control, law in zip(CONTROL_NAMES, (column, wheel, pedals), strict=True):
        if law is not None:
            check_law(law, file, control)
            found[control] = OwnPilot(law=law)
    return found


def check_pickled(pilots: Mapping[ControlName, Pilot], file: object) -> None:
    """Raise InputError for a function that other processes cannot be given."""
    for control, pilot in pilots.items():
        try:
            pickle.dumps(pilot)
        except (pickle.PicklingError, AttributeError, TypeError):
            problem = f"{pilot.title} cannot be pickled for other processes; define it, by its"
            problem += " name, at the top level of a module"
            raise InputError(file, control, problem) from None


def name_of(law: object) -> str:
    """Return the name of a user's function, for messages."""
    own = getattr(law, "__qualname__", type(law).__qualname__)
    return shown(str(own).rpartition("<locals>.")[2], 60)


def check_law(law: object, file: object, place: str) -> None:
    """Raise InputError for what is no function of a state; `place` is its key."""
    if isinstance(law, type) or not callable(law):
        what = f"the class {law.__name__}" if isinstance(law, type) else shown_value(law)
        raise InputError(file, place, f"is {what}; {_WANTED}")


def reset_law(law: Any) -> None:
    """Call a function's own `reset`, if it has one."""
    reset = getattr(law, "reset", None)
    if callable(reset):
        reset()


def force_of(law: Law, state: State, file: object, control: str) -> float:
    """Return a pilot's force, N; raises InputError for what is no force of a hand."""
    force = _number(law, state, file, f"pilot.{control}", "a force in N")
    if not -STRONGEST <= force <= STRONGEST:
        problem = f"{name_of(law)} returned {force:g} N {time_of(state)}; give at most"
        raise InputError(file, f"pilot.{control}", f"{problem} ±{STRONGEST:g}")
    return force


def gradient_of(law: Law, state: State, file: object, control: ControlName, most: float) -> float:
    """Return a law's gradient, N/d; raises InputError unless it is from 0 to below `most`."""
    unit = f"N per {unit_of(control)}"
    gradient = _number(law, state, file, f"gradient.{control}", f"a gradient in {unit}")
    if not 0.0 <= gradient < most:
        problem = f"{name_of(law)} returned {gradient:g} {unit} {time_of(state)}"
        wanted = f"give 0 or more, below {most:.4g}, at which K·G_T reaches 1"
        raise InputError(file, f"gradient.{control}", f"{problem}; {wanted}")
    return gradient


def _number(law: Law, state: State, file: object, place: str, wanted: str) -> float:
    """Return what a function gives for a state, as a finite number."""
    try:
        value: object = law(state)
    except Exception as error:  # the user's own, with where it happened
        error.add_note(f"in {name_of(law)}, {file}: {place}, {time_of(state)}")
        raise
    if type(value) is not float:
        if isinstance(value, bool) or not isinstance(value, Real):
            said = shown_value(value).replace("of type", "a value of type")
            problem = f"{name_of(law)} returned {said} {time_of(state)}; return {wanted}"
            raise InputError(file, place, problem)
        value = float(value)
    if value - value != 0.0:  # NaN or infinite
        problem = f"{name_of(law)} returned {value} {time_of(state)}; return {wanted}"
        raise InputError(file, place, problem)
    return value
