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
from coupled.flight.modelparts import Part

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
        """Return whether the model has a property."""

    def lever(self, name: str, file: object = None, key: str = "model") -> Lever:
        """Return a property that may be set; faults name a key of a file."""

    def reader(self, name: str) -> Callable[[], float] | None:
        """Return a function that reads a property, in JSBSim's unit; None if it does not exist."""

    def fault(self, key: str, problem: str) -> InputError:
        """Return the fault of a key of the rig's `flight` section."""


class Wrapper:
    """An addition to an aircraft; this base class does nothing."""

    heading = 0.0  # of the aircraft in trim, rad from north

    @property
    def scaled(self) -> tuple[Part, ...]:
        """The parts of the model's forces and moments that it makes scalable at loading."""
        return ()

    @property
    def ballasts(self) -> int:
        """The number of further point masses that it needs (`modelfile.BALLAST`)."""
        return 0

    def load(self, aircraft: Aircraft) -> None:
        """Act on the loaded aircraft before it is trimmed."""

    def weigh(self, aircraft: Aircraft) -> None:
        """Act on the aircraft once JSBSim knows its weight, before it is trimmed."""

    def attach(self, aircraft: Aircraft) -> Hook | None:
        """Act on the aircraft in trim; return a hook for each frame, if any."""


def together(hooks: Sequence[Hook]) -> Hook | None:
    """Return one hook that calls others in their order; None if there are none."""
    if len(hooks) < 2:
        return hooks[0] if hooks else None

    def act() -> None:
        for hook in hooks:
            hook()

    return act


def led_by(hooks: Sequence[Hook], step: Step) -> Step:
    """Return the step with the hooks called before it, in their order."""
    hook = together(hooks)
    if hook is None:
        return step

    def led(commands: tuple[float, float, float], /) -> None:
        hook()
        step(commands)

    return led
