"""A hand that looks at the pitch attitude, with gains of its own."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from coupled.flight.pilot.base import STRONGEST, Action, Pilot, edges
from coupled.record.channels import LONGITUDINAL
from coupled.rig.packing import Hand
from coupled.rig.parameters import Control
from coupled.schema import quantity


class Attitude(Pilot):
    """A hand that captures a pitch attitude `change_rad` from where it finds it, and holds it.

    Force on the column through the muscle's lag: gain on the error of pitch, its integral,
    and pitch rate. Limited to `force_limit_N`.
    """

    kind: Literal["attitude"]
    change: float = quantity("rad", 0.0, ge=-1.5, le=1.5)
    rise: float = quantity("s", 1.0, ge=0)
    gain: float = quantity("N_per_rad", ge=0, le=1e6)
    rate_gain: float = quantity("N_s_per_rad", 0.0, ge=0, le=1e6)
    integral_gain: float = quantity("N_per_rad_s", 0.0, ge=0, le=1e6)
    lag: float = quantity("s", 0.1, ge=0, le=7200)
    force_limit: float = quantity("N", 330.0, gt=0, le=STRONGEST)
    _PITCH: ClassVar[int] = LONGITUDINAL.index("pitch_rad")
    _RATE: ClassVar[int] = LONGITUDINAL.index("pitch_rate_rad_per_s")

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the hand, with a memory of its own."""
        found, integral, last = None, 0.0, self.start

        def look(time: float, motion: tuple[float, ...]) -> float:
            nonlocal found, integral, last
            if time < self.start:
                return 0.0
            found = motion[self._PITCH] if found is None else found
            wanted = self.change * float(edges(np.array([time]), [(self.start, 1.0)], self.rise)[0])
            error = found + wanted - motion[self._PITCH]
            force = self.gain * error + integral - self.rate_gain * motion[self._RATE]
            if abs(force) < self.force_limit:
                integral += self.integral_gain * error * (time - last)
            last = time
            return min(max(force, -self.force_limit), self.force_limit)

        return Action(hand=Hand(lag_s=self.lag), look=look)
