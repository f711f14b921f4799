"""The servo's answer x to δc, frame by frame, by the servo's parameters in the rig file."""

from __future__ import annotations

import math

from coupled.rig.linkage import weights_of_servo
from coupled.rig.parameters import Control

BRIDGED_s = 0.025  # longest gap in the samples over which δc is interpolated


class Servo:
    """The servo of one control.

    Missing samples are interpolated linearly to the next one. After a longer gap the servo
    restarts at rest at δc, and x is valid only after `settle_s`.
    """

    def __init__(self, control: Control, frame_s: float) -> None:
        loader = control.loader
        self._a, self._b = (row.tolist() for row in weights_of_servo(loader, frame_s))
        omega, ratio = 2.0 * math.pi * loader.servo_frequency, loader.servo_damping_ratio
        slowest = ratio if ratio <= 1.0 else ratio - math.sqrt(ratio * ratio - 1.0)
        # Five time constants of its slowest part: less than 1 % of an initial error remains.
        # Without a servo the position is δc itself.
        self._settle_s = 5.0 / (omega * slowest) if omega > 0.0 else 0.0
        self._frame_s = frame_s
        self._speed = self._before = self.position = 0.0
        self._missed = 0
        self._left_s: float | None = None  # time until x is valid; None before the first sample

    @property
    def settled(self) -> bool:
        """Whether the initial error of x has decayed."""
        return self._missed == 0 and self._left_s is not None and self._left_s <= 0.0

    def miss(self) -> None:
        """Process a frame without a new sample."""
        self._missed += 1

    def move(self, computed: float) -> float:
        """Process a new sample of δc in d, and return x in d."""
        frames, self._missed = self._missed + 1, 0
        if self._left_s is None or (frames - 1) * self._frame_s > BRIDGED_s:
            first = self._left_s is None
            self.position = self._before = computed
            self._speed = 0.0
            # A flight begins with the control at rest, where x is δc.
            self._left_s = 0.0 if first else self._settle_s
            frames = 1
        a, b, start = self._a, self._b, self._before
        for n in range(frames):
            x, v = self.position, self._speed
            u = start + (computed - start) * n / frames
            w = start + (computed - start) * (n + 1) / frames
            self.position = a[0] * x + a[1] * v + a[2] * u + a[3] * w
            self._speed = b[0] * x + b[1] * v + b[2] * u + b[3] * w
        self._before = computed
        self._left_s = max(0.0, self._left_s - frames * self._frame_s)
        return self.position
