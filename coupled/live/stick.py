"""A stick, yoke or gamepad, read by pygame-ce; it needs no screen.

SDL, through pygame-ce, supports the joysticks of Linux, macOS and Windows without a driver of its
own. `hidapi` would require decoding of each device's reports, and `inputs` is not maintained.
"""

from __future__ import annotations

import importlib
import os
from typing import Any, Protocol

from coupled.errors import InputError

AXES = "1,0,3"  # of column, wheel and pedals: the usual axes of a stick with a twist
_CONTROLS = ("column", "wheel", "pedals")
DEAD = 0.02  # dead zone about neutral, of full deflection: potentiometers do not rest at 0


class Device(Protocol):
    """The interface of a stick."""

    def get_name(self) -> str:
        """Return its name."""

    def get_numaxes(self) -> int:
        """Return its number of axes."""

    def get_axis(self, number: int, /) -> float:
        """Return the position of an axis, −1 to 1."""


def axes_of(words: str) -> dict[str, tuple[int, float]]:
    """Return {control: (axis, sign)} of `1,0,3`; a minus reverses an axis. Raises InputError."""
    found = {}
    for control, word in zip(_CONTROLS, words.split(","), strict=False):
        number = word.strip().removeprefix("-")
        if not number.isdecimal() or int(number) > 63:
            problem = f"is {words!r}; give numbers of axes for column, wheel, pedals, as {AXES}"
            raise InputError("--axes", "", problem)
        found[control] = (int(number), -1.0 if word.strip().startswith("-") else 1.0)
    return found


class Stick:
    """A stick as a source of hand positions: a pull, right wheel and right pedal are positive.

    `number` counts the connected sticks; `device` is one that is open already. Raises InputError
    if there is none.
    """

    def __init__(self, axes: str = AXES, number: int = 0, device: Device | None = None) -> None:
        self._axes = axes_of(axes)
        self._pygame: Any = None
        self._device = self._open(number) if device is None else device
        self.name = f"stick {self._device.get_name()}"
        most = self._device.get_numaxes()
        self._axes = {c: (axis, sign) for c, (axis, sign) in self._axes.items() if axis < most}

    def _open(self, number: int) -> Device:
        os.environ.setdefault("SDL_VIDEODRIVER", "dummy")
        os.environ["PYGAME_HIDE_SUPPORT_PROMPT"] = "1"
        os.environ["SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS"] = "1"
        self._pygame = importlib.import_module("pygame")
        self._pygame.display.init()
        self._pygame.joystick.init()
        count = self._pygame.joystick.get_count()
        if number >= count:
            self.close()
            known = f"there are {count}" if count else "none is plugged in, or may be read"
            raise InputError("--hand", "stick", f"no stick {number}: {known}")
        device: Device = self._pygame.joystick.Joystick(number)
        return device

    def read(self, control: str) -> float:
        """Return the position of a control, −1 to 1; 0 for one without an axis."""
        if control not in self._axes:
            return 0.0
        axis, sign = self._axes[control]
        if self._pygame is not None:
            self._pygame.event.pump()
        place = sign * self._device.get_axis(axis)
        return 0.0 if abs(place) < DEAD else place

    def close(self) -> None:
        """Close the device."""
        if self._pygame is not None:
            self._pygame.joystick.quit()
            self._pygame.display.quit()
            self._pygame = None
