"""Correction of noise-induced creep: residual input noise ratchets backlash and friction.

A backlash keeps the extremes of its input. While friction holds the loader still, the smoothed δc
still contains noise; each maximum of it moves the grip's side of the backlash. A fit then finds the
backlash too large, by 1 % of 0.8 mm at 20 μm of noise. Friction with presliding creeps likewise
while the force rests: each noise peak of F makes the contact slip a little. Where the force is
found to rest completely it is held constant (`resting`).

The creep grows with the noise. The stage is replayed with as much noise again, in both signs, so
that linear contributions cancel, and the change is extrapolated to zero noise (SIMEX: Cook and
Stefanski, JASA 89, 1994). Noise may be too small for a creep that √2 times as much would cause.
Then the record does not show the creep, and the correction is not applied.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from coupled.gap.effects.settings import CONTACT, is_dry, most_yielding
from coupled.gap.signals.output import Floats
from coupled.gap.thresholds import CREEP_FRICTION_N, CREEP_FROM, CREEP_LENGTH, CREEP_WORSE, RATCHET
from coupled.parallel import in_threads
from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig

Driven = Callable[[Rig, float], Floats]  # response of a rig with a multiple of a noise sample


def without_backlash_creep(rig: Rig, control: ControlName, at: Driven, measured: Floats) -> Floats:
    """Return a linkage's response without noise-induced creep of its backlash.

    `at` gives the response with a multiple of a sample of input noise added; shapes (frames,).
    """
    loader = rig.controls[control].loader
    if loader.play == 0.0 and loader.bend_hysteresis_share == 0.0:
        return at(rig, 0.0)
    return _without_creep(measured, *in_threads(partial(at, rig), (0.0, 1.0, -1.0)))


def without_friction_creep(
    rig: Rig, control: ControlName, at: Driven, measured: Floats, times: float = 1.0
) -> Floats:
    """Return a loader's response without noise-induced creep of presliding friction.

    The force contains `times` the noise that the smoother passes.
    """
    if rig.controls[control].loader.friction_stiffness == 0.0 or not is_dry(rig, control):
        return at(rig, 0.0)
    return _without_creep(measured, *in_threads(partial(at, rig), (0.0, times, -times)))


def creeps(rig: Rig, control: ControlName, at: Driven, noise: float) -> bool:
    """Tell whether noise of the force makes presliding friction creep by more than it vibrates.

    Tested with the filed friction, or a little if none is filed, and a usual presliding length.
    `noise` is the noise of δc, rms in d.
    """
    loader = rig.controls[control].loader
    level = max(loader.friction, loader.breakaway) or CREEP_FRICTION_N
    length = CREEP_LENGTH * most_yielding(control)
    changes = {} if is_dry(rig, control) else {f"controls.{control}.loader.friction_N": level}
    key = f"controls.{control}.{CONTACT[0]}".format(d=unit_of(control))
    yields = rig.changed({**changes, key: level / length})
    plain, up, down = in_threads(partial(at, yields), (0.0, 1.0, -1.0))
    shaken = np.sqrt(np.mean((0.5 * (up - down)) ** 2) + noise**2)
    walked = np.sqrt(np.mean((plain - 0.5 * (up + down)) ** 2))
    return bool(walked > CREEP_FROM * shaken)


def _without_creep(measured: Floats, plain: Floats, up: Floats, down: Floats) -> Floats:
    """Return a response without creep, from two responses with as much noise again.

    The predicted creep is removed unless this increases the mean square residual. Between the two
    shares of `CREEP_WORSE` it is removed in part. A fitted backlash absorbs a small creep, so that
    the residual does not show it.
    """
    push = RATCHET * (plain - 0.5 * (up + down))
    before, after = (float(np.mean((measured - one) ** 2)) for one in (plain, plain + push))
    some, much = CREEP_WORSE
    worse = after / before - 1.0 if before > 0.0 else 0.0
    return plain + min(max((much - worse) / (much - some), 0.0), 1.0) * push
