"""The pilot's force in a trial, and the dynamic pressure of a bench.

A force is `level` times a shape in ±1, plus what friction and breakout hold on the shape's side, so
that the control moves. All signals are smooth on the scale of a frame.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from coupled.blind.twin.kernel import NODES
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
Rng = np.random.Generator


def _go(t: Floats, shape: Floats, start: float, change: float, rise: float) -> None:
    """Add a change that begins at `start` and takes `rise` seconds."""
    share = np.clip((t - start) / rise, 0.0, 1.0)
    shape += 0.5 * change * (1.0 - np.cos(np.pi * share))


def _steps(rng: Rng, t: Floats) -> Floats:
    """Add pushes and pulls of random size, each followed by its opposite, and rests."""
    shape, at = np.zeros_like(t), 1.0
    while at < t[-1] - 6.0:
        length, size, rise = rng.uniform(0.5, 2.5), rng.uniform(-1, 1), rng.uniform(0.2, 0.5)
        for start, change in ((at, size), (at + length, -2.0 * size), (at + 2.0 * length, size)):
            _go(t, shape, start, change, rise)
        at += 2.0 * length + rise + rng.choice([0.0, rng.uniform(0.3, 2.0)])
    return shape


def _multistep(rng: Rng, t: Floats) -> Floats:
    """Add 3-2-1-1s of random unit and size."""
    shape, at = np.zeros_like(t), 1.0
    while at < t[-1] - 8.0:
        unit, size = rng.uniform(0.3, 0.9), rng.choice([-1, 1]) * rng.uniform(0.4, 1.0)
        for units, change in ((0, 1.0), (3, -2.0), (5, 2.0), (6, -2.0), (7, 1.0)):
            _go(t, shape, at + units * unit, size * change, 0.2)
        at += 7.0 * unit + rng.uniform(0.5, 3.0)
    return shape


def _doublets(rng: Rng, t: Floats) -> Floats:
    shape, at = np.zeros_like(t), 1.0
    while at < t[-1] - 5.0:
        half, size = rng.uniform(0.3, 1.5), rng.choice([-1, 1]) * rng.uniform(0.3, 1.0)
        for start, change in ((0.0, 1.0), (half, -2.0), (2.0 * half, 1.0)):
            _go(t, shape, at + start, size * change, 0.2)
        at += 2.0 * half + rng.uniform(0.3, 2.0)
    return shape


def _sweep(rng: Rng, t: Floats) -> Floats:
    low, high = rng.uniform(0.08, 0.2), rng.uniform(1.5, 3.5)
    rate = np.log(high / low) / (t[-1] - 2.0)
    phase = 2.0 * np.pi * low * np.expm1(rate * np.maximum(t - 1.0, 0.0)) / rate
    return np.asarray(np.sin(phase))


def _triangles(rng: Rng, t: Floats) -> Floats:
    """Add slow ramps to and fro, their corners rounded over 0.3 s."""
    corners, values, side = [0.0, 1.0], [0.0, 0.0], float(rng.choice([-1, 1]))
    while corners[-1] < t[-1] - 2.0:
        corners.append(corners[-1] + rng.uniform(1.5, 4.5))
        values.append(side * rng.uniform(0.4, 1.0))
        side = -side
    sharp = np.interp(t, [*corners, corners[-1] + 2.0], [*values, 0.0])
    width = max(1, round(0.3 / (t[1] - t[0])))
    return np.convolve(np.pad(sharp, width, "edge"), np.hanning(width) * 2 / width, "same")[
        width:-width
    ]


def _multisine(rng: Rng, t: Floats) -> Floats:
    lines = rng.integers(1, round(2.5 * t[-1]), 12) / t[-1]
    phases = rng.uniform(0.0, 2.0 * np.pi, 12)
    found = np.sum([np.sin(2 * np.pi * f * t + p) for f, p in zip(lines, phases, strict=True)], 0)
    return np.asarray(found / np.max(np.abs(found)))


SHAPES: dict[str, Callable[[Rng, Floats], Floats]] = {
    "steps": _steps,
    "3211": _multistep,
    "doublets": _doublets,
    "sweep": _sweep,
    "triangles": _triangles,
    "multisine": _multisine,
}


def pilot_shape(rng: Rng, frames: int, frame_rate_Hz: float) -> tuple[Floats, list[str]]:
    """Return a shape in ±1 on the force's nodes, shape (frames·NODES + 1,), and its kinds.

    One kind, two in sequence, or a slow and a fast one added.
    """
    t = np.arange(frames * NODES + 1) / (frame_rate_Hz * NODES)
    first, second = rng.choice(sorted(SHAPES), 2, replace=False).tolist()
    kind = rng.choice(["alone", "after", "at once"])
    shape, names = SHAPES[first](rng, t), [first]
    if kind != "alone":
        other = SHAPES[second](rng, t)
        names.append(second)
        half = 0.5 * (1.0 + np.tanh((t - 0.5 * t[-1]) / 0.2)) if kind == "after" else 0.4
        shape = (1.0 - half) * shape + half * other
    ends = np.clip(t / 0.5, 0.0, 1.0) * np.clip((t[-1] - t) / 0.5, 0.0, 1.0)
    return shape * np.sin(0.5 * np.pi * ends) ** 2, names


def pilot_force(rig: Rig, shape: Floats, level_N: float) -> Floats:
    """Return the pilot's force for a shape, N: in addition to what friction and breakout hold."""
    loader = rig.controls["column"].loader
    held = 1.1 * (loader.breakout + loader.friction)
    return level_N * shape + held * np.tanh(4.0 * shape)


def bench_pressure(rng: Rng, rig: Rig, frames: int) -> Floats:
    """Return the q̄ of a bench, shape (frames,), Pa: holds, steps and ramps."""
    table = rig.controls["column"].schedule.dynamic_pressure
    low, high = table[0] + 0.05 * (table[-1] - table[0]), table[-1]
    t = np.arange(frames) / rig.frame_rate
    if rng.uniform() < 0.1:
        return np.full(frames, rng.uniform(low, high))
    times, values = [0.0], [rng.uniform(low, high)]
    while times[-1] < t[-1]:
        hold, ramp = rng.uniform(2.0, 8.0), rng.choice([rng.uniform(0.3, 1.0), 4.0])
        times += [times[-1] + hold, times[-1] + hold + ramp]
        values += [values[-1], rng.uniform(low, high)]
    return np.interp(t, times, values)
