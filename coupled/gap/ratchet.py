"""Play and noise: what smoothing leaves of an input's noise ratchets a play.

A play keeps the extremes of what drives it. Where friction holds the loader still, δc as measured
trembles on; each greatest tremble pushes the grip's side of a play, and none draws it back. So a
fit finds the play too large, by 1 % of 0.8 mm at 20 μm of noise, and by 2 % at 40. It is pushed as
far as the tremble is large: the stage is driven once more with as much noise again, and what that
changes is taken off in proportion (simulation and extrapolation: Cook and Stefanski, JASA 89,
1994). With the noise of both signs, what goes straight with it falls out.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from coupled.gap.noise import Noise
from coupled.gap.output import Floats
from coupled.gap.smooth import Smoother
from coupled.gap.thresholds import RATCHET
from coupled.record.channels import ControlName
from coupled.rig.nodes import on_nodes
from coupled.rig.rig import Rig


def passed_noise(
    rig: Rig, signals: tuple[Floats, Floats], noises: tuple[Noise, Noise]
) -> tuple[Floats, Floats]:
    """Return samples of what the smoothers of δc and F pass of their noise.

    δc's on the loader's nodes, in d, F's at the frames, in N.
    """
    rng = np.random.default_rng(47)
    computed, force = (
        Smoother.of(signal).smooth(noise.sample(len(signal), rng))
        for signal, noise in zip(signals, noises, strict=True)
    )
    return on_nodes(rig, computed), force


def unratcheted(rig: Rig, control: ControlName, at: Callable[[Rig, float], Floats]) -> Floats:
    """Return what a linkage makes of its input, without what noise does to its play.

    `at` drives it with so many times a sample of the input's noise added.
    """
    loader = rig.controls[control].loader
    plain = at(rig, 0.0)
    if loader.play == 0.0 and loader.bend_hysteresis_share == 0.0:
        return plain
    pushed = 0.5 * (at(rig, 1.0) + at(rig, -1.0))
    return plain + RATCHET * (plain - pushed)
