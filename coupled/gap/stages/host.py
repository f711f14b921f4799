"""What the host computes: F_mod, and the estimate of the deflection.

F_mod is compared with the product of δc itself, or of δc as read. A digital product contains the
sensor noise and scale error of δc, an analog product does not. The part of F_mod that repeats the
noise of δc (`correlated`) is therefore not the channel's own noise: included in the noise floor, it
would hide whether the product is digital.

δ̂ is predicted by the host's equations, from δc and F as read.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise
from coupled.gap.noise.smooth import Smoother, smoothed
from coupled.gap.signals.floors import unsmoothed, with_error
from coupled.gap.signals.output import Floats, Predict
from coupled.gap.signals.reading import Reading
from coupled.gap.stages.inputs import Noisy
from coupled.gap.thresholds import FAR_SIGMAS, ROUNDING_SPAN
from coupled.rig.hosted import held_over
from coupled.rig.replay import replay_compensation, replay_product
from coupled.rig.rig import Rig


class Product(NamedTuple):
    """F_mod of a record in N, from δc and G_T; each signal of shape (frames,).

    predict     the product of a rig
    noisy       the nominal product, with a numbered sample of the noise of δc
    own         the noise of the channel, from its spectrum
    judged      the frames in which noise of δc does not decide the sign of a jump of F_mod
    correlated  the noise in the product of δc as read that comes from that reading
    """

    predict: Predict
    noisy: Noisy
    own: Noise
    judged: NDArray[np.bool_]
    correlated: Floats


def multiplied(reading: Reading) -> Product:
    """Return the product of δc and the modifying gradient, as a record has it.

    At the breakout the product jumps. Frames in which noise of δc decides the sign of a jump are
    not judged: the prediction there is the measurement. A jump below the noise of F_mod counts too,
    if it exceeds the rise of the gradient: δc as read has the right sign more often than δc
    smoothed, for both kinds of product. Nor are the rows of a live record in which the loader is
    not judged.
    """
    recorded, computed = reading.signal("modifying_force"), reading.as_read("computed")
    own, level = reading.channel_noise("modifying_force"), reading.channel_noise("computed")
    smooth, feel, control = smoothed(computed), reading.feel(), reading.control
    neutral = 0.0 * smooth + reading.neutral()

    def made(read: Floats, rig: Rig = reading.rig) -> Floats:
        """Return the product of δc as read, N."""
        missed, assumed = reading.missed.under(rig, control), reading.assumed()
        more = None if assumed is None else assumed.gradient
        return replay_product(rig, control, read - neutral, feel, missed, more)

    below, above, beyond = (made(neutral + k * level.rms) for k in (-1.0, 1.0, 3.0))
    jump, rise = np.abs(above - below), np.abs(beyond - above)
    near = np.abs(smooth - neutral) < FAR_SIGMAS * level.rms
    judged = ~(near & ((jump > FAR_SIGMAS * own.rms) | (jump > 2.0 * rise)))
    if reading.judged is not None:
        judged &= reading.judged
    likely = _with_motion(computed, smooth, level)

    def predict(rig: Rig, seen: Floats = likely) -> Floats:
        read = computed
        if rig.controls[control].loader.multiplier != "digital":
            sensed = reading.sensed(rig)
            still = seen - sensed.hum(computed)
            read = sensed.curve.inverse(still / sensed.scale(len(seen)))
        return np.where(judged, made(read, rig), recorded)

    def noisy(rig: Rig, k: int) -> Floats:
        return predict(rig, with_error(likely, k, level))

    correlated = np.where(judged, made(computed) - made(smooth), 0.0)
    return Product(predict, noisy, own, judged, correlated)


def _with_motion(computed: Floats, smooth: Floats, level: Noise) -> Floats:
    """Return the estimate of δc, d: smoothed, plus the motion's share of what the smoother removes.

    For a fast motion with little noise that share is large. Without it, an analog product, which
    contains the whole motion, would seem to repeat the noise of δc.
    """
    rest = computed - smooth
    noise = level.sample(len(rest), np.random.default_rng(53))
    alone = noise - Smoother.of(computed).passed(noise)
    power = float(rest @ rest)
    motion = max(0.0, 1.0 - float(alone @ alone) / power) if power > 0.0 else 0.0
    return smooth + motion * rest


def compensated(reading: Reading) -> tuple[Predict, float, float]:
    """Return the prediction of δ̂ by a rig, its floor, and F's part of the floor, d.

    The floor is the noise of δc, although the host reads the same noise, because F may be stamped
    slightly late. If the rig's F is late, the record's noise of F may differ from the host's.
    """
    computed, recorded = reading.as_read("computed"), reading.as_read("force")
    control, others = reading.control, reading.others(as_read=True)
    assumed = reading.assumed()

    def made(rig: Rig, force: Floats) -> Floats:
        missed = reading.missed.under(rig, control)
        made = replay_compensation(rig, control, computed, force, others, missed)
        return made if assumed is None else made + held_over(assumed.estimate * force, missed)

    def predict(rig: Rig) -> Floats:
        return made(rig, reading.sensed(rig).as_the_host_had_it(recorded))

    own = max(reading.channel_noise("computed").rms, ROUNDING_SPAN * float(np.ptp(computed)))
    rig, carried = reading.rig, 0.0
    if rig.controls[control].sensing.force_stamp != 0.0:
        level, late = reading.driving("force"), reading.sensed(rig).as_the_host_had_it
        shaken = late(unsmoothed(recorded, 0, level)), unsmoothed(late(recorded), 0, level)
        carried = math.hypot(*(float(np.std(made(rig, f) - predict(rig))) for f in shaken))
    return predict, math.hypot(own, carried), carried
