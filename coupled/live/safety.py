"""Limits of a loader's orders, and plausibility of its measurements.

Limits: |ΔG|·travel + breakout, and |F_mod|, stay within `force_N`, and none changes faster than
`rate_N_per_s`. If the host also orders the loader's own spring, the spring is included in the sum.
Forces are faded by a factor that rises from 0 to 1 over `fade_s` and falls likewise. Without a
valid packet for the watchdog's time the factor falls to 0; it rises again when the loader answers.

Plausibility: a force gauge that is constant while the control moves has failed, and δ must agree
with x + K·F, x being the servo's answer to δc. While either test fails, the factor falls to 0.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from coupled.live.link import Measured, Order
from coupled.live.servo import Servo
from coupled.rig.parameters import Control

FASTEST_N_per_s = 5000.0
STRONGEST_N = 600.0  # 14 CFR 25.143(d) allows two hands 75 lbf on the column, both feet 150 lbf
FADE_s = 0.5

# A force held after a step is constant while the control still moves, for some tenths of a second
# until the loader rests. A gauge with noise does not repeat values at all.
STUCK_s = 2.0  # largest time of a constant F, if the control moves in its second half
MOVED = 0.05  # of the travel moved by δc
# Tolerance of δ − x − K·F: this share of the travel, for backlash and zeros, plus all of K·F, since
# a structure may have softened to twice its K. Both exceed the error of a calibration.
APART = 0.05
APART_s = 0.2  # duration of a disagreement; longer than a blow on the grip
AGAIN_s = 1.0  # time without a fault until the forces return


@dataclass(frozen=True)
class Limits:
    """The largest F_mod in N, its largest rate in N/s, and the duration of a fade in s."""

    force_N: float = STRONGEST_N
    rate_N_per_s: float = FASTEST_N_per_s
    fade_s: float = FADE_s


class Fade:
    """The factor on the forces: 0 to 1, linear in time."""

    def __init__(self, fade_s: float, frame_s: float) -> None:
        self._step = frame_s / fade_s if fade_s > 0.0 else 1.0
        self.share = 0.0

    def move(self, on: bool) -> float:
        """Advance the factor by a frame towards on or off, and return it."""
        step = self._step if on else -self._step
        self.share = min(max(self.share + step, 0.0), 1.0)
        return self.share


class Limiter:
    """Limits one control's orders.

    `travel` is in d; `own` is the gradient in N/d that the host orders in addition to ΔG.
    """

    def __init__(self, limits: Limits, travel: float, frame_s: float, own: float = 0.0) -> None:
        self._force, self._travel, self._own = limits.force_N, travel, own
        self._step = limits.rate_N_per_s * frame_s
        self._last: Order | None = None
        self.limited = 0  # frames with a reduced order
        self.cut = False  # the order of the last frame was reduced

    def _within(self, wanted: float, last: float, low: float, high: float, step: float) -> float:
        if math.isnan(wanted):
            wanted = last
        bounded = min(max(wanted, low), high)
        return min(max(bounded, last - step), last + step)

    def total(self, order: Order) -> float:
        """Return the largest force of an order within the travel, N."""
        steepest = max(abs(self._own + order.gradient), abs(self._own + order.second))
        return steepest * self._travel + abs(order.breakout)

    def order(self, asked: Order, share: float) -> Order:
        """Return the order to be sent for a wanted order, faded by `share`."""
        last = self._last or Order(0.0, 0.0, asked.break_at, 0.0, 0.0, asked.total, asked.trim)
        wanted = asked._replace(
            gradient=share * asked.gradient,
            second=share * asked.second,
            breakout=share * asked.breakout,
            force=share * asked.force,
        )
        sent = self._together(self._each(self._shared(wanted), last), last)
        parts = (sent.gradient, sent.second, sent.breakout, sent.force)
        self.cut = parts != (wanted.gradient, wanted.second, wanted.breakout, wanted.force)
        self.limited += self.cut
        self._last = sent
        return sent

    def _shared(self, wanted: Order) -> Order:
        """Return an order scaled so that its total is within the limit."""
        total = self.total(wanted)
        if not self._force < total < math.inf:
            return wanted  # NaN and infinity are limited part by part
        factor = self._force / total
        return wanted._replace(
            gradient=factor * (self._own + wanted.gradient) - self._own,
            second=factor * (self._own + wanted.second) - self._own,
            breakout=factor * wanted.breakout,
        )

    def _each(self, wanted: Order, last: Order) -> Order:
        """Return an order whose parts are within the limits of size and rate."""
        size, step, steepest = self._force, self._step, self._force / self._travel
        low, high, turn = -steepest - self._own, steepest - self._own, step / self._travel
        return wanted._replace(
            gradient=self._within(wanted.gradient, last.gradient, low, high, turn),
            second=self._within(wanted.second, last.second, low, high, turn),
            breakout=self._within(wanted.breakout, last.breakout, -size, size, step),
            force=self._within(wanted.force, last.force, -size, size, step),
        )

    def _together(self, sent: Order, last: Order) -> Order:
        """Return an order whose total is within the limit during changes of its parts.

        A part that would raise the total keeps its last value until the others have fallen.
        """
        if self.total(sent) <= self._force:
            return sent

        def smaller(now: float, before: float, own: float = 0.0) -> float:
            return now if abs(own + now) <= abs(own + before) else before

        return sent._replace(
            gradient=smaller(sent.gradient, last.gradient, self._own),
            second=smaller(sent.second, last.second, self._own),
            breakout=smaller(sent.breakout, last.breakout),
        )


class Plausibility:
    """The consistency of one control's measurements.

    `gauge`: the loader measures F.
    """

    def __init__(self, control: Control, frame_s: float, gauge: bool) -> None:
        self._servo, self._gauge = Servo(control, frame_s), gauge
        self._bend = max(control.loader.bend, control.compensation.bend)
        self._travel, self._frame_s = control.travel, frame_s
        self._stuck_frames = round(STUCK_s / frame_s)
        self._force, self._same = math.nan, 0  # the last F, and the number of equal samples
        self._places: deque[float] = deque(maxlen=self._stuck_frames // 2)
        self._stuck = False
        self._apart_s, self._well_s = 0.0, AGAIN_s
        self._fault = ""

    def miss(self) -> None:
        """Process a frame without a new sample."""
        self._servo.miss()

    def update(self, measured: Measured) -> str:
        """Process a new sample; return its fault, or ""."""
        found = self._stuck_gauge(measured) or self._apart(measured)
        self._well_s = 0.0 if found else self._well_s + self._frame_s
        if found or self._well_s >= AGAIN_s:
            self._fault = found
        return self._fault

    def _stuck_gauge(self, measured: Measured) -> str:
        if not self._gauge:
            return ""
        same = measured.force == self._force
        self._force, self._same = measured.force, self._same + 1 if same else 0
        self._places.append(measured.computed)
        if self._same < self._stuck_frames:
            self._stuck = self._stuck and same
        elif max(self._places) - min(self._places) > MOVED * self._travel:
            self._stuck = True
        return "the force gauge is constant while the control moves" if self._stuck else ""

    def _apart(self, measured: Measured) -> str:
        position = self._servo.move(measured.computed)
        bent = self._bend * measured.force
        away = abs(measured.deflection - position - bent)
        if not self._servo.settled or math.isnan(away):
            return ""
        beyond = away > APART * self._travel + abs(bent)
        self._apart_s = self._apart_s + self._frame_s if beyond else 0.0
        return "δ does not agree with δc + K·F" if self._apart_s > APART_s else ""
