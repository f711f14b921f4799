"""What the host may ask of a loader: limits of size and rate, fades, and a watchdog.

Whatever the schedule, a switch or a fault asks for: ΔG over the whole travel, the breakout and
F_mod each stay within `force_N`, and none moves faster than `rate_N_per_s`. Forces come and go by a
share that rises from 0 to 1 over `fade_s`, and falls as long. Without a valid packet for the
watchdog's time the share falls to 0; it rises again when the loader is back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from coupled.live.link import Order

FASTEST_N_per_s = 5000.0
STRONGEST_N = 600.0  # 14 CFR 25.143(d) allows two hands 75 lbf on the column, both feet 150 lbf
FADE_s = 0.5


@dataclass(frozen=True)
class Limits:
    """The largest F_mod in N, its fastest change in N/s, and how long a fade takes in s."""

    force_N: float = STRONGEST_N
    rate_N_per_s: float = FASTEST_N_per_s
    fade_s: float = FADE_s


class Fade:
    """The share of the forces that is on: 0 to 1, straight in time."""

    def __init__(self, fade_s: float, frame_s: float) -> None:
        self._step = frame_s / fade_s if fade_s > 0.0 else 1.0
        self.share = 0.0

    def move(self, on: bool) -> float:
        """Move the share for a frame towards on or off, and return it."""
        step = self._step if on else -self._step
        self.share = min(max(self.share + step, 0.0), 1.0)
        return self.share


class Limiter:
    """Keeps one control's orders within the limits; `travel` in d."""

    def __init__(self, limits: Limits, travel: float, frame_s: float) -> None:
        self._force, self._travel = limits.force_N, travel
        self._step = limits.rate_N_per_s * frame_s
        self._last: Order | None = None
        self.limited = 0  # frames in which an order was cut

    def _within(self, wanted: float, last: float, size: float, step: float) -> float:
        if math.isnan(wanted):
            wanted = last
        bounded = min(max(wanted, -size), size)
        return min(max(bounded, last - step), last + step)

    def order(self, asked: Order, share: float) -> Order:
        """Return what is sent of an order that was asked for, with that share of it on."""
        last = self._last or Order(0.0, 0.0, asked.break_at, 0.0, 0.0, asked.total, asked.trim)
        size, step, travel = self._force, self._step, self._travel
        wanted = (
            share * asked.gradient,
            share * asked.second,
            share * asked.breakout,
            share * asked.force,
        )
        sent = Order(
            self._within(wanted[0], last.gradient, size / travel, step / travel),
            self._within(wanted[1], last.second, size / travel, step / travel),
            asked.break_at,
            self._within(wanted[2], last.breakout, size, step),
            self._within(wanted[3], last.force, size, step),
            asked.total,
            asked.trim,
        )
        self.limited += (sent.gradient, sent.second, sent.breakout, sent.force) != wanted
        self._last = sent
        return sent
