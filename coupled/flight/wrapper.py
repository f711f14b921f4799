"""The one face of all that may be put around a plain aircraft.

An aircraft is loaded, trimmed and stepped by `airframe`. What else becomes of it (how it is
loaded, what of its aerodynamics differs, the air, what fails) is a list of wrappers. Each may act
at four moments: as the model's file is read, before the trim, there once JSBSim knows its weight,
and before every frame after it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

from coupled.errors import InputError
from coupled.flight.everyframe import Lever
from coupled.flight.modelfile import Scaled

Motion = Callable[[], tuple[float, ...]]
Step = Callable[[tuple[float, float, float]], None]
Hook = Callable[[], None]  # called before each frame


class Aircraft(Protocol):
    """What a wrapper may ask of an aircraft."""

    motion: Motion
    step: Step

    def extra(self) -> tuple[float, ...]:
        """Return the further properties that were asked for."""

    def names(self) -> Iterable[str]:
        """Return the names of all of the model's properties."""

    def has(self, name: str) -> bool:
        """Tell whether the model has a property."""

    def lever(self, name: str, file: object = None, key: str = "model") -> Lever:
        """Return a property that may be set; a fault is that of a key in a file."""

    def reader(self, name: str) -> Callable[[], float] | None:
        """Return what reads a property, in JSBSim's unit; None where the model has none such."""

    def fault(self, key: str, problem: str) -> InputError:
        """Return the fault of a key of the rig's `flight` section."""


class Wrapper:
    """Something put around an aircraft; by itself it does nothing."""

    @property
    def scaled(self) -> tuple[Scaled, ...]:
        """What it scales of the model's aerodynamics as they are loaded."""
        return ()

    @property
    def ballast(self) -> bool:
        """Whether it needs a point mass beside those of the model (`modelfile.BALLAST`)."""
        return False

    def load(self, aircraft: Aircraft) -> None:
        """Act on the loaded aircraft before it is trimmed."""

    def weigh(self, aircraft: Aircraft) -> None:
        """Act on the aircraft once JSBSim knows its weight, before it is trimmed."""

    def meet(self, aircraft: Aircraft) -> Hook | None:
        """Act on the aircraft in trim; return what is to be done before each frame, if anything."""


def led_by(hooks: Sequence[Hook], step: Step) -> Step:
    """Return the step with the hooks called before it, in their order."""
    if not hooks:
        return step
    if len(hooks) == 1:
        (hook,) = hooks

        def led(commands: tuple[float, float, float], /) -> None:
            hook()
            step(commands)

        return led

    def led_by_all(commands: tuple[float, float, float], /) -> None:
        for hook in hooks:
            hook()
        step(commands)

    return led_by_all
