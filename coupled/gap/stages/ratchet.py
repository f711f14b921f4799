"""Play, dry friction and noise: what smoothing leaves of an input's noise ratchets them.

A play keeps the extremes of what drives it. Where friction holds the loader still, δc as measured
trembles on; each greatest tremble pushes the grip's side of a play, and none draws it back. So a
fit finds the play too large, by 1 % of 0.8 mm at 20 μm of noise, and by 2 % at 40. It is pushed as
far as the tremble is large: the stage is driven once more with as much noise again, and what that
changes is taken off in proportion (simulation and extrapolation: Cook and Stefanski, JASA 89,
1994). With the noise of both signs, what goes straight with it falls out. Noise may be too small to
push what √2 times as much does: then the record shows no push, and none is taken off.

A contact of dry friction that yields walks likewise: where the force rests, each tremble of F as
measured lets it slip a little, and it gives way as the real one, which never felt that, does not.
Of 24 blind records (seed 103) it walked by over half a floor in three, and by ten in one that held
its force for seconds. It walks as far as the tremble is large, and is put back alike. Where the
force rests altogether it is held (`resting`), and does not tremble.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from coupled.gap.effects.settings import CONTACT, is_dry, most_yielding
from coupled.gap.signals.output import Floats
from coupled.gap.thresholds import PUSHED, RATCHET, WALKED, WALKED_BY, WALKED_N
from coupled.parallel import in_threads
from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig

Driven = Callable[[Rig, float], Floats]  # by a rig and so many times a sample of the noise


def unratcheted(rig: Rig, control: ControlName, at: Driven, measured: Floats) -> Floats:
    """Return what a linkage makes of its input, without what noise does to its play.

    `at` drives it with so many times a sample of the input's noise added; shapes (frames,).
    """
    loader = rig.controls[control].loader
    if loader.play == 0.0 and loader.bend_hysteresis_share == 0.0:
        return at(rig, 0.0)
    return _put_back(measured, *in_threads(partial(at, rig), (0.0, 1.0, -1.0)))


def unwalked(
    rig: Rig, control: ControlName, at: Driven, measured: Floats, times: float = 1.0
) -> Floats:
    """Return what a loader makes of its force, without what noise does to a contact that yields.

    The force holds so many `times` the noise that is passed.
    """
    if rig.controls[control].loader.friction_stiffness == 0.0 or not is_dry(rig, control):
        return at(rig, 0.0)
    return _put_back(measured, *in_threads(partial(at, rig), (0.0, times, -times)))


def is_walked(rig: Rig, control: ControlName, at: Driven, noise: float) -> bool:
    """Tell whether noise of the force would walk a contact that yields, by more than it shakes it.

    By the filed friction, or by a little where none is filed, with a contact of a usual length;
    `noise` is δc's own, rms in d.
    """
    loader = rig.controls[control].loader
    level = max(loader.friction, loader.breakaway) or WALKED_N
    length = WALKED_BY * most_yielding(control)
    changes = {} if is_dry(rig, control) else {f"controls.{control}.loader.friction_N": level}
    key = f"controls.{control}.{CONTACT[0]}".format(d=unit_of(control))
    yields = rig.changed({**changes, key: level / length})
    plain, up, down = in_threads(partial(at, yields), (0.0, 1.0, -1.0))
    shaken = np.sqrt(np.mean((0.5 * (up - down)) ** 2) + noise**2)
    walked = np.sqrt(np.mean((plain - 0.5 * (up + down)) ** 2))
    return bool(walked > WALKED * shaken)


def _put_back(measured: Floats, plain: Floats, up: Floats, down: Floats) -> Floats:
    """Return an answer without what noise has pushed it by, from two with as much noise again.

    All that is foretold is taken off, unless the answer then departs from what was measured by
    more: between the two shares of `PUSHED`, part of it. A play's size takes up what is small of a
    push, and what is measured cannot say then how large it was.
    """
    push = RATCHET * (plain - 0.5 * (up + down))
    before, after = (float(np.mean((measured - one) ** 2)) for one in (plain, plain + push))
    some, much = PUSHED
    worse = after / before - 1.0 if before > 0.0 else 0.0
    return plain + min(max((much - worse) / (much - some), 0.0), 1.0) * push
