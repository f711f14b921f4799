"""Parameters that may be changed in flight: corrections, K and K̂, friction and breakout.

A change sets a key of the rig file. It is checked like the file, so the flight continues as a batch
flight of the changed rig would. K, friction and breakout are those of the simulated loader; with a
real loader only the host's parameters can be changed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from coupled.errors import InputError, nearest
from coupled.record.channels import unit_of
from coupled.rig.control import ControlArray
from coupled.rig.packing import Hand, pack
from coupled.rig.rig import Rig

# By the name on the page: the keys of the rig file, d being the control's unit.
KEYS: dict[str, tuple[str, ...]] = {
    "deflection": ("compensation.deflection",),
    "gradient": ("compensation.gradient",),
    "assumed_bend": ("compensation.bend_{d}_per_N",),
    "bend": ("loader.bend_{d}_per_N", "loader.bend_push_{d}_per_N"),
    "friction": ("loader.friction_N", "loader.breakaway_N"),
    "breakout": ("loader.breakout_N",),
}
YES_NO = ("deflection", "gradient")
HARDWARE = ("bend", "friction", "breakout")
_BESIDE = {"bend": None, "friction": 0.0}  # value of the second key
_WIDEST = {"friction": 200.0, "breakout": 200.0}  # N


@dataclass(frozen=True)
class Change:
    """A change in flight, at `time_s`: `what` of a control, to `value` in SI."""

    time_s: float
    control: str
    what: str
    value: float | bool


class Switches:
    """The switches of a flight.

    `rig` is the current rig, `controls` the same in the kernels' arrays, `hands` those of its
    pilots; `real_loader`: the loader is real. `set_rig` is the rig after the user's last change.
    `differs`: `rig` has other settings than at the start.
    """

    def __init__(
        self, rig: Rig, controls: ControlArray, hands: Mapping[str, Hand], real_loader: bool
    ) -> None:
        self.rig = self.set_rig = self._begun = rig
        self._controls, self._hands, self._real_loader = controls, hands, real_loader
        self.changes: list[Change] = []
        self.differs = False

    def values(self, control: str) -> dict[str, float | bool]:
        """Return the current values of a control, SI."""
        data = self.rig.controls[self._control(control)]
        return {
            "deflection": data.compensation.deflection,
            "gradient": data.compensation.gradient,
            "assumed_bend": data.compensation.bend,
            "bend": data.loader.bend,
            "friction": data.loader.friction,
            "breakout": data.loader.breakout,
        }

    def set(self, time_s: float, control: str, what: str, value: float | bool) -> None:
        """Make a change and store it; raises InputError if it cannot be made."""
        self.put(control, what, value)
        self.changes.append(Change(time_s, control, what, value))
        self.set_rig = self.rig

    def put(self, control: str, what: str, value: float | bool) -> None:
        """Make a change without storing it, as an adaptation does."""
        name, place = self._control(control), f"{control}.{what}"
        if what not in KEYS:
            raise InputError("switch", place, f"is no switch; {nearest(what, KEYS)}")
        if what in YES_NO and value not in (0.0, 1.0):
            raise InputError("switch", place, f"is {value:g}; give True or False")
        if what not in YES_NO and isinstance(value, bool):
            raise InputError("switch", place, f"is {value}; give a number")
        if what in HARDWARE and self._real_loader:
            raise InputError("switch", place, "is set on the real loader itself; change it there")
        if what in _WIDEST and value > _WIDEST[what]:
            raise InputError("switch", place, f"is {value:g} N; at most {_WIDEST[what]:g}")
        at = f"controls.{name}"
        first, *others = (f"{at}.{key.format(d=unit_of(name))}" for key in KEYS[what])
        changes: dict[str, Any] = {first: bool(value) if what in YES_NO else float(value)}
        self._pack(self.rig.changed(changes | dict.fromkeys(others, _BESIDE.get(what))))

    def _pack(self, rig: Rig) -> None:
        self._controls["parameters"][:] = pack(rig, self._hands)["parameters"]
        self.rig = rig
        self.differs = rig.controls != self._begun.controls

    def _control(self, control: str) -> Any:
        if control not in self.rig.controls:
            hint = nearest(control, self.rig.controls)
            raise InputError("switch", control, f"no such control; {hint}")
        return control
