"""The interface of everything that may be added to a plain aircraft.

An aircraft is loaded, trimmed and stepped by `airframe`. All else (loading, changed aerodynamics,
the air, failures) is a list of wrappers. Each may act at four moments: when the model's file is
read, before the trim, there once JSBSim knows the weight, and before every frame.
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
    """The interface of an aircraft for wrappers."""

    motion: Motion
    step: Step

    def extra(self) -> tuple[float, ...]:
        """Return the further properties that were requested."""

    def names(self) -> Iterable[str]:
        """Return the names of all of the model's properties."""

    def has(self, name: str) -> bool:
        """Tell whether the model has a property."""

    def lever(self, name: str, file: object = None, key: str = "model") -> Lever:
        """Return a property that may be set; faults name a key of a file."""

    def reader(self, name: str) -> Callable[[], float] | None:
        """Return a function that reads a property, in JSBSim's unit; None if it does not exist."""

    def fault(self, key: str, problem: str) -> InputError:
        """Return the fault of a key of the rig's `flight` section."""


class Wrapper:
    """An addition to an aircraft; this base class does nothing."""

    @property
    def scaled(self) -> tuple[Scaled, ...]:
        """The parts of the model's aerodynamics that it scales at loading."""
        return ()

    @property
    def ballast(self) -> bool:
        """Whether it needs a further point mass (`modelfile.BALLAST`)."""
        return False

    def load(self, aircraft: Aircraft) -> None:
        """Act on the loaded aircraft before it is trimmed."""

    def weigh(self, aircraft: Aircraft) -> None:
        """Act on the aircraft once JSBSim knows its weight, before it is trimmed."""

    def attach(self, aircraft: Aircraft) -> Hook | None:
        """Act on the aircraft in trim; return a hook for each frame, if any."""


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
