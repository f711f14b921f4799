"""A pilot who controls the attitude, with given gains."""

from __future__ import annotations

from typing import Literal

import numpy as np

from coupled.arguments import public
from coupled.flight.pilot.base import (
    STRONGEST,
    Action,
    Pilot,
    Start,
    edges,
    needs_aircraft,
    turned,
)
from coupled.record.channels import ATTITUDE, RATE, ControlName, motion_channels
from coupled.rig.packing import Hand
from coupled.rig.rig import Rig
from coupled.schema import quantity


@public
class Attitude(Pilot):
    """A pilot who captures and holds an attitude `change_rad` from the initial one.

    The attitude is pitch on the column, roll on the wheel, heading on the pedals. The force is
    gain on the error, on its integral, and on the rate about that axis, through the muscle's lag,
    limited to `force_limit_N`. Only on a rig with an aircraft. Raises InputError as a run file
    does.

    >>> import coupled
    >>> coupled.Attitude(change_rad=0.05, gain_N_per_rad=900, rate_gain_N_s_per_rad=150).lag_s
    0.1
    """

    kind: Literal["attitude"] = "attitude"
    change_rad: float = quantity("", 0.0, ge=-1.5, le=1.5)
    rise_s: float = quantity("", 1.0, ge=0)
    gain_N_per_rad: float = quantity("", ge=0, le=1e6)
    rate_gain_N_s_per_rad: float = quantity("", 0.0, ge=0, le=1e6)
    integral_gain_N_per_rad_s: float = quantity("", 0.0, ge=0, le=1e6)
    lag_s: float = quantity("", 0.1, ge=0, le=7200)
    force_limit_N: float = quantity("", 330.0, gt=0, le=STRONGEST)

    def check(self, rig: Rig, control: ControlName, file: object) -> None:
        """Refuse a rig without an aircraft."""
        super().check(rig, control, file)
        needs_aircraft(rig, control, file)

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the hand, with its own state."""
        needs_aircraft(rig, control, start.file)
        found, integral, last = None, 0.0, self.start_s
        names = motion_channels(list(rig.controls), flown=True)
        angle, rate = names.index(ATTITUDE[control]), names.index(RATE[control])

        def look(time: float, motion: tuple[float, ...]) -> float:
            nonlocal found, integral, last
            if time < self.start_s:
                return 0.0
            found = motion[angle] if found is None else found
            share = edges(np.array([time]), [(self.start_s, 1.0)], self.rise_s)[0]
            error = self.change_rad * float(share) - turned(found, motion[angle])
            damping = self.rate_gain_N_s_per_rad * motion[rate]
            force = self.gain_N_per_rad * error + integral - damping
            if abs(force) < self.force_limit_N:
                integral += self.integral_gain_N_per_rad_s * error * (time - last)
            last = time
            return min(max(force, -self.force_limit_N), self.force_limit_N)

        return Action(hand=Hand(lag_s=self.lag_s), look=look)
