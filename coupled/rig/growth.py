"""The growth or decay of a control's motion from a small deflection, by simulation.

Every frame is that of `frame`. Before the state exceeds the range of doubles it is scaled down,
which changes nothing in a linear rig, and the scale is added to the growth.
"""

from __future__ import annotations

import math
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import entry, stage
from coupled.rig.control import CONTROL, STAGES, ControlArray, ControlState
from coupled.rig.frame import CHANNELS_PER_CONTROL, host_frame
from coupled.rig.gauge import start_gauge
from coupled.rig.loader import start_loader
from coupled.rig.mechanism import run_frame, set_hand
from coupled.rig.packing import Hand, pack
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]
_LEAST_FRAMES = 96
_LARGEST, _SMALLEST = 1e3, 1e-3


def growth(rig: Rig, hand: Hand, seconds: float) -> float:
    """Return the growth rate of the motion of a rig's only control, 1/s; negative for a decay.

    The slope of the logarithm of the state's size over the second half of the time, which must be
    long compared with the motion's period. Infinite if a frame exceeds the range of doubles. The
    rig must be linear: without friction, breakout, backlash and limits.
    """
    frames = max(_LEAST_FRAMES, math.ceil(seconds * rig.frame_rate))
    (name, control), *others = rig.controls.items()
    assert not others
    stiffness = control.loader.basic_gradient + max(control.schedule.gradients)
    packed = pack(rig, {name: hand})
    logs = np.empty(frames)
    rate = math.sqrt(stiffness / control.loader.mass)
    _grow(packed, packed.view(np.float64), growing_numbers(), rate, logs)
    late = logs[frames // 2 :]
    if not np.all(np.isfinite(late)):
        return math.inf
    return float(_slope_weights(late.size) @ late) * rig.frame_rate


@lru_cache(maxsize=64)
def _slope_weights(count: int) -> Floats:
    """Return weights of values, one a frame, that give their slope, a frame.

    The least-squares line with weights that fade at both ends, so that oscillations about the trend
    cancel.
    """
    frames = np.arange(count, dtype=np.float64)
    weights = np.sin(np.pi * (frames + 0.5) / count) ** 2
    levers = weights * (frames - (weights @ frames) / weights.sum())
    return np.asarray(levers / (levers @ frames))


@stage
def _size(s: ControlState, rate: float) -> float:
    """Return the size of a motion, d/s: speeds, and deflections times a typical rate in rad/s."""
    moved = s.loader.rate * s.loader.rate + s.linkage.rate * s.linkage.rate
    away = s.loader.computed * s.loader.computed + s.linkage.position * s.linkage.position
    return math.sqrt(moved + rate * rate * away)


@cache
def growing_numbers() -> NDArray[np.bool_]:
    """Return which of a control's numbers, eight bytes each, scale with its motion."""
    marks = np.zeros(1, CONTROL)
    for name, declared in STAGES.items():
        state = declared.state or np.dtype([])
        for field in set(state.names or ()) - set(declared.fixed):
            if state[field].base == np.float64:
                marks["state"][name][field] = 1.0
    return np.asarray(marks.view(np.int64) != 0)


@entry
def _grow(
    controls: ControlArray, numbers: Floats, growing: NDArray[np.bool_], rate: float, logs: Floats
) -> None:
    """Run a control from a deflection with some speed; write the logarithm of its size each frame.

    `numbers` are the control's own, in the same memory.
    """
    p, s = controls[0].parameters, controls[0].state
    still = np.zeros(p.clock.substeps + 1)
    out = np.zeros(CHANNELS_PER_CONTROL)
    s.loader.computed, s.loader.rate = 1.0, 0.7 * rate
    s.linkage.position = s.linkage.grip = 0.8
    s.hand.at = s.linkage.grip
    set_hand(p, s, 0.0, 0.0, 0.0)
    start_loader(p.loader, s.loader, start_gauge(p.gauge, s.gauge, s.hand.force))
    grown = 0.0
    for k in range(len(logs)):
        out[:] = 0.0  # it contains the noise of the readings
        host_frame(p, s, s.hand.force, 0.0, 0.0, out)
        run_frame(p, s, still, still, 0, 1.0)
        size = _size(s, rate)
        logs[k] = grown + math.log(size) if size > 0.0 else -math.inf
        if size > _LARGEST or 0.0 < size < _SMALLEST:
            grown += math.log(size)
            for i in range(len(numbers)):
                if growing[i]:
                    numbers[i] /= size
