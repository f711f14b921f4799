"""The loop through the aircraft: a bob weight, with the hand off the column.

    F_bob = −b·(n_z − 1)  →  loader  →  δ̂ = δc  →  elevator  →  n_z

n_z is read at a frame and its force held over it; the loader responds as held from node to node,
the surface is commanded at the next frame, and the aircraft responds a step later. With P(z) the
loop for one N per g the closed loop is that of 1 + b·P(z), so it begins to oscillate at

    b = 1/|P| at a phase of P of −180°.

The aircraft's frequency response is found by flying it, one frequency at a time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from coupled.authority.stability.linear import added_gradient, exponential
from coupled.authority.stability.planes import linear_rig
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import Step
from coupled.flight.response import Response, elevator_response
from coupled.rig.equations import gradient_at_neutral
from coupled.rig.packing import COMMAND_SIGN
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
_RATES_rad_per_s = np.geomspace(1.0, 30.0, 12)
_TAP_N = 1e-3  # within the linear range, and far above rounding
_FLOWN_s = 12.0
_SETTLED_s = 2.0
_SPAN = 1.2  # factor to either side of the theoretical limit, within which it is searched


@dataclass(frozen=True)
class BobWeight:
    """The bob weight at which the loop through the aircraft begins to oscillate, and the rig's.

    `simulated` is None if no limit is found in flight within a fifth of the theoretical one.
    """

    own_N_per_g: float
    simulated_N_per_g: float | None
    theory_N_per_g: float
    rate_rad_per_s: float


def bob_weight(rig: Rig, file: Path) -> BobWeight | None:
    """Return the limit of a rig's bob weight; None without aircraft, column or limit."""
    if rig.flight is None or "column" not in rig.controls:
        return None
    found = bob_weight_limit(rig, file)
    if found is None:
        return None
    own = rig.controls["column"].loader.bob_weight
    return BobWeight(own, flown_limit(rig, file, *found), *found)


def hands_off_rig(rig: Rig, bob_weight_N_per_g: float, gradient: float) -> Rig:
    """Return the rig's column alone, linear but for its travel, at one gradient in N/m."""
    return linear_rig(rig, "column", gradient).changed(
        {
            "controls.column.loader.bob_weight_N_per_g": bob_weight_N_per_g,
            "controls.column.travel_m": rig.controls["column"].travel,
            "flight": rig.flight,
        }
    )


def bob_weight_limit(rig: Rig, file: Path) -> tuple[float, float] | None:
    """Return the least bob weight, N per g, that oscillates hands off, and its rad/s.

    By theory, at the gradient of the rig's own trim; None if no frequency has that phase.
    """
    response = _response(rig, file)
    pressure = response(float(_RATES_rad_per_s[0])).pressure_Pa
    gradient = gradient_at_neutral(rig.controls["column"].schedule, pressure)
    linear = hands_off_rig(rig, 0.0, gradient)

    def turn(rate: float) -> float:
        """Return the imaginary part of −P, which is zero at a phase of ±180°."""
        return -_loop(linear, response(rate), rate).imag

    rates = _RATES_rad_per_s.tolist()
    turns = [turn(rate) for rate in rates]
    for low, high, before, after in zip(rates, rates[1:], turns, turns[1:], strict=False):
        if before * after < 0.0 and _loop(linear, response(low), low).real < 0.0:
            at = brentq(turn, low, high, xtol=1e-3 * low)
            return 1.0 / abs(_loop(linear, response(at), at)), float(at)
    return None


def flown_limit(rig: Rig, file: Path, near_N_per_g: float, rate_rad_per_s: float) -> float | None:
    """Return the bob weight, N per g, at which a tapped column neither diverges nor settles.

    Found by flying the coupled rig; None if the sign of the growth does not change within a fifth
    of `near`.
    """
    pressure = _response(rig, file)(float(_RATES_rad_per_s[0])).pressure_Pa
    gradient = gradient_at_neutral(rig.controls["column"].schedule, pressure)

    def growth(weight: float) -> float:
        return flown_growth(hands_off_rig(rig, weight, gradient), rate_rad_per_s)

    low, high = near_N_per_g / _SPAN, near_N_per_g * _SPAN
    if growth(low) >= 0.0 or growth(high) <= 0.0:
        return None
    return float(brentq(growth, low, high, rtol=1e-3, xtol=1e-3 * near_N_per_g))


def flown_growth(rig: Rig, rate_rad_per_s: float) -> float:
    """Return the growth of a tapped column's motion at a frequency, 1/s, hands off.

    Half the difference of a push and a pull removes the drift of the trim. The amplitude of each
    period is taken about a straight line.
    """
    up, down = (fly(_tapped(rig, side * _TAP_N)) for side in (1.0, -1.0))
    swing = 0.5 * (up["column_computed_m"] - down["column_computed_m"])
    period = max(4, round(2.0 * math.pi / rate_rad_per_s * rig.frame_rate))
    swing = swing[round(_SETTLED_s * rig.frame_rate) :]
    whole = swing[: swing.size // period * period].reshape(-1, period)
    line = np.linspace(-1.0, 1.0, period)
    level = whole.mean(axis=1, keepdims=True)
    tilt = (whole @ line / (line @ line))[:, None]
    size = np.log(np.std(whole - level - tilt * line, axis=1) + 1e-300)
    times = np.arange(size.size) * period / rig.frame_rate
    return float(np.polyfit(times, size, 1)[0])


def _tapped(rig: Rig, force: float) -> Manoeuvre:
    tap = Step(start_s=0.5, duration_s=0.3, force_N=force)
    return Manoeuvre(rig, {"column": tap}, _FLOWN_s, name="tapped")


def _response(rig: Rig, file: Path) -> Callable[[float], Response]:
    assert rig.flight is not None
    flight, frame_s = rig.flight, 1.0 / rig.frame_rate
    return lambda rate: elevator_response(flight, frame_s, ("column",), file, rate)


def _loop(linear: Rig, response: Response, rate: float) -> complex:
    """Return P at a frequency: load factor over one N per g of bob weight, broken at the force."""
    column, frame_s = linear.controls["column"], 1.0 / linear.frame_rate
    gain = COMMAND_SIGN["elevator"] * 0.5 * (1.0 / column.pull + 1.0 / column.push)
    return gain * _loader(linear, rate, frame_s) * response.load_factor


def _loader(linear: Rig, rate: float, frame_s: float) -> complex:
    """Return δc at a frame over the force, m/N, with the force held from frame to frame."""
    column = linear.controls["column"]
    loader = column.loader
    spring = loader.basic_gradient + added_gradient(column)
    held = np.zeros((3, 3))
    held[0, 1] = 1.0
    held[1] = -spring / loader.mass, -loader.damping / loader.mass, 1.0 / loader.mass
    over = exponential(held * frame_s)
    turned = np.exp(1j * rate * frame_s) * np.eye(2) - over[:2, :2]
    return complex(np.linalg.solve(turned, over[:2, 2])[0])
