"""User functions called once per frame: a pilot's force, or a scheduled gradient.

A function maps the state at t_k, read by the host, to a number for the frame from t_k to t_k+1. If
it has a function `reset` as an attribute, that is called at the start of each flight.
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
    PilotOrLaw = Pilot | Law  # a manoeuvre also takes a function for a pilot
_WANTED = "give a function of the state, as `lambda state: 50.0`"


class GivenForce(Pilot):
    """A hand whose force is given frame by frame, and held over each frame."""

    kind: Literal["given", "own"] = "given"
    start_s: float = 0.0

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return a hand without impedance; its force is given in flight."""
        return Action()


class OwnPilot(GivenForce):
    """A pilot defined by a user function: `law` maps the state of a frame to a force, N."""

    kind: Literal["own"] = "own"
    law: Callable[..., Any]

    @property
    def title(self) -> str:
        """The name of the function."""
        return name_of(self.law)


def as_pilot(given: Any) -> Any:
    """Return a pilot, or the pilot of a function; other objects are returned unchanged."""
    if isinstance(given, (Pilot, type)) or not callable(given):
        return given  # refused by the manoeuvre
    return OwnPilot(law=given)


def given_laws(
    column: Law | None, wheel: Law | None, pedals: Law | None, file: object
) -> dict[ControlName, Pilot]:
    """Return the pilots of functions by control. Raises InputError for another type."""
    found: dict[ControlName, Pilot] = {}
    for control, law in zip(CONTROL_NAMES, (column, wheel, pedals), strict=True):
        if law is not None:
            check_law(law, file, control)
            found[control] = OwnPilot(law=law)
    return found


def check_pickled(pilots: Mapping[ControlName, Pilot], file: object) -> None:
    """Raise InputError for a function that cannot be pickled, as other processes require."""
    for control, pilot in pilots.items():
        try:
            pickle.dumps(pilot)
        except (pickle.PicklingError, AttributeError, TypeError):
            problem = f"{pilot.title} cannot be pickled for other processes; define it, by its"
            problem += " name, at the top level of a module"
            raise InputError(file, control, problem) from None


def name_of(law: object) -> str:
    """Return the name of a user function, for messages."""
    own = getattr(law, "__qualname__", type(law).__qualname__)
    return shown(str(own).rpartition("<locals>.")[2], 60)


def check_law(law: object, file: object, place: str) -> None:
    """Raise InputError for an object that is not a function of a state; `place` is its key."""
    if isinstance(law, type) or not callable(law):
        what = f"the class {law.__name__}" if isinstance(law, type) else shown_value(law)
        raise InputError(file, place, f"is {what}; {_WANTED}")


def reset_law(law: Any) -> None:
    """Call the `reset` of a function, if it has one."""
    reset = getattr(law, "reset", None)
    if callable(reset):
        reset()


def force_of(law: Law, state: State, file: object, control: str) -> float:
    """Return a pilot's force, N. Raises InputError for an impossible force."""
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
    """Return the value of a function for a state, as a finite number."""
    try:
        value: object = law(state)
    except Exception as error:  # an error of the user's function, with its location
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
