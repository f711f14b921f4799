"""Vertical and lateral gusts with the Dryden spectrum.

White noise through

    H(s) = σ·√(L/(π·V))·(1 + √3·(L/V)·s)/(1 + (L/V)·s)²      (MIL-F-8785C, components v and w)

with L the scale and V the true airspeed, discretised by the bilinear rule. The air is still at the
start, where the aircraft is trimmed. A lateral gust is horizontal and across the heading, from the
left positive.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.flight.wrapper import Aircraft, Hook, Wrapper, together
from coupled.record.channels import SPEED
from coupled.rig.parameters import Flight
from coupled.units import FOOT_m

GUST_DOWN = "atmosphere/gust-down-fps"  # in addition to wind
_GUST_NORTH, _GUST_EAST = "atmosphere/gust-north-fps", "atmosphere/gust-east-fps"
_HEADING = "attitude/psi-rad"
_UP, _ACROSS = 97, 98  # random streams of a seed
_BLOCK = 1024  # frames made at a time


class GivenAir(NamedTuple):
    """The air velocity over each frame, m/s, instead of the rig's gusts; None if drawn at random.

    `up` is the vertical component, `across` the component across the heading, from the left.
    """

    up: Sequence[float] | None = None
    across: Sequence[float] | None = None

    def repeated(self, times: int) -> GivenAir:
        """Return the air of frames that are divided into equal steps."""
        return GivenAir(*(None if one is None else np.repeat(one, times).tolist() for one in self))

    def in_pairs(self) -> GivenAir:
        """Return the air of frames of twice the length."""
        each = (None if one is None else in_pairs(np.array(one)).tolist() for one in self)
        return GivenAir(*each)


def in_pairs(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the means of pairs of rows, shape (rows/2 rounded up, ...); a last one stays."""
    whole = np.concatenate((values, values[-1:])) if len(values) % 2 else values
    return np.asarray(0.5 * (whole[::2] + whole[1::2]))


DRAWN = GivenAir()


def dryden(
    rms_m_per_s: float,
    length_m: float,
    speed_m_per_s: float,
    frame_s: float,
    seed: int,
    stream: int = _UP,
) -> Iterator[float]:
    """Yield the air's speed in m/s, a frame each, without end."""
    top, bottom = dryden_filter(rms_m_per_s, length_m / speed_m_per_s, frame_s)
    (b0, b1, b2), (_, a1, a2) = top, bottom
    rng = np.random.default_rng([seed, stream])
    later = last = 0.0  # state of the filter in its transposed direct form
    while True:
        # Of unit density over 0 < ω < π/frame.
        for hiss in rng.normal(0.0, np.sqrt(np.pi / frame_s), _BLOCK).tolist():
            speed = later + b0 * hiss
            later = last + b1 * hiss - a1 * speed
            last = b2 * hiss - a2 * speed
            yield speed


def dryden_filter(
    rms_m_per_s: float, lag_s: float, frame_s: float
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return numerator and denominator in z⁻¹ of the spectrum's H(s), with L/V = `lag_s`.

    By the bilinear rule, s = (2/T)·(z − 1)/(z + 1), the denominator's first being 1.
    """
    turn = 2.0 / frame_s
    gain = rms_m_per_s * math.sqrt(lag_s / math.pi)
    zero, pole, back = math.sqrt(3.0) * lag_s * turn, 1.0 + lag_s * turn, 1.0 - lag_s * turn
    scale = gain / pole**2
    top = (scale * (1.0 + zero), scale * 2.0, scale * (1.0 - zero))
    return top, (1.0, 2.0 * back / pole, (back / pole) ** 2)


class Gusts(Wrapper):
    """Gusts drawn from a seed, if the rig has them, or given by frame."""

    def __init__(
        self,
        flight: Flight,
        frame_s: float,
        seed: int = 0,
        air: GivenAir = DRAWN,
    ) -> None:
        self._flight, self._frame_s, self._seed = flight, frame_s, seed
        self._air = air

    def attach(self, aircraft: Aircraft) -> Hook | None:
        """Return a hook that sets the gust of each frame: as given, or from the spectrum."""
        flight, given = self._flight, self._air
        up = self._speeds(aircraft, given.up, flight.gust_rms, _UP)
        across = self._speeds(aircraft, given.across, flight.lateral_gust_rms, _ACROSS)
        hooks = [] if up is None else [_vertical_gust_hook(aircraft, up)]
        hooks += [] if across is None else [_lateral_gust_hook(aircraft, across)]
        return together(hooks)

    def _speeds(
        self,
        aircraft: Aircraft,
        given: Sequence[float] | None,
        rms_m_per_s: float,
        stream: int,
    ) -> Iterator[float] | None:
        if given is not None or rms_m_per_s == 0.0:
            return None if given is None else iter(given)
        lengths = self._flight.gust_length, aircraft.motion()[SPEED]
        return dryden(rms_m_per_s, *lengths, self._frame_s, self._seed, stream)


def _vertical_gust_hook(aircraft: Aircraft, speeds: Iterator[float]) -> Hook:
    down = aircraft.lever(GUST_DOWN).set

    def set_gust() -> None:
        down(-next(speeds, 0.0) / FOOT_m)

    return set_gust


def _lateral_gust_hook(aircraft: Aircraft, speeds: Iterator[float]) -> Hook:
    north, east = aircraft.lever(_GUST_NORTH).set, aircraft.lever(_GUST_EAST).set
    heading = aircraft.reader(_HEADING)
    assert heading is not None

    def set_gust() -> None:
        speed, turned = next(speeds, 0.0) / FOOT_m, heading()
        north(-speed * math.sin(turned))
        east(speed * math.cos(turned))

    return set_gust
