"""An axis with a ball screw that moves between points, simulated without the package.

A mass of 400 kg behind a screw of 10 mm, with bristle friction that falls with speed, a ripple once
per turn, and a scale on the table in addition to the motor's encoder. Friction and damping differ
between records, as with temperature.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.machines import plain_rig, recorded

FINE_Hz, RATE_Hz = 20_000.0, 100.0
MASS_kg, DAMPING, FRICTION_N, OFFSET_N = 400.0, 800.0, 150.0, 6.0
STRIBECK_N, RIPPLE_N, TURN_m = 30.0, 8.0, 0.01
COUNT_m = 1e-6


def _wanted(seconds: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return the reference position: moves of 0.02 to 0.1 m/s between points, and rests."""
    t = np.arange(round(seconds * FINE_Hz)) / FINE_Hz
    speed, at, place = np.zeros_like(t), 0.5, 0.0
    while at < seconds - 1.0:
        way = rng.uniform(0.02, 0.3) - place
        ramp_s = min(float(rng.choice([0.02, 0.05, 0.1])) / 0.5, math.sqrt(abs(way) / 0.5))
        top = 0.5 * ramp_s
        length_s = ramp_s + abs(way) / top
        since = t - at
        speed += math.copysign(1.0, way) * np.clip(
            0.5 * np.minimum(since, length_s - since), 0.0, top
        )
        place, at = place + way, at + length_s + rng.uniform(0.2, 0.6)
    return np.asarray(np.cumsum(speed) / FINE_Hz)


def ball_screw(
    seed: int,
    friction: float = 1.0,
    damping: float = 1.0,
    play_m: float = 0.0,
    seconds: float = 20.0,
) -> Record:
    """Return a record of the motor's force, its encoder and the scale at 100 Hz.

    `friction` and `damping` are factors on the healthy values.
    """
    rng = np.random.default_rng(seed)
    wanted = _wanted(seconds, rng)
    level = friction * FRICTION_N * (1.0 + 0.04 * rng.normal())
    thick = damping * DAMPING * (1.0 + 0.06 * rng.normal())
    frames, h, bristles = int(seconds * RATE_Hz), 1.0 / FINE_Hz, 5e6
    read, every = np.empty((3, frames)), round(FINE_Hz / RATE_Hz)
    way = speed = bent = lag = table = 0.0
    for k, aim in enumerate(wanted.tolist()):
        lag += (aim - way) * h
        force = 4e5 * (aim - way) + 2e6 * lag - 2e4 * speed
        if k % every == 0:
            read[:, k // every] = force, way, table
        most = level + STRIBECK_N * math.exp(-((speed / 5e-3) ** 2))
        most += RIPPLE_N * math.sin(2.0 * math.pi * way / TURN_m)
        slip = speed - bristles * abs(speed) / most * bent
        bent += slip * h
        held = bristles * bent + 400.0 * slip
        speed += (force + OFFSET_N - held - thick * speed) / MASS_kg * h
        way += speed * h
        table = min(max(table, way - 0.5 * play_m), way + 0.5 * play_m)
    read[0] += rng.normal(0.0, 2.0, frames)
    read[1:] += rng.normal(0.0, 5e-7, (2, frames))
    counted = COUNT_m * np.round(read[1:] / COUNT_m)
    channels = {"force_N": read[0], "computed_m": counted[0], "deflection_m": counted[1]}
    return recorded(RATE_Hz, **channels, gradient_N_per_m=np.zeros(frames))


def ball_screw_rig() -> Rig:
    """Return its rig by the data sheet: some % off, without offset, ripple and Stribeck effect."""
    numbers = {"mass_kg": 380.0, "damping_N_s_per_m": 900.0, "friction_N": 140.0}
    return plain_rig(RATE_Hz, numbers | {"servo_frequency_Hz": 20_000.0})  # no servo between
