"""What the host computes: F_mod, and the estimate of the deflection.

F_mod is compared with the product of δc itself, or of δc as read. A digital product contains the
sensor noise and scale error of δc, an analog product does not. The part of F_mod that repeats the
noise of δc (`correlated`) is therefore not the channel's own noise: included in the noise floor, it
would hide whether the product is digital.

δ̂ is predicted by the host's equations, from δc and F as read.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise
from coupled.gap.noise.smooth import Smoother, smoothed
from coupled.gap.signals.floors import unsmoothed, with_error
from coupled.gap.signals.output import Floats, Predict
from coupled.gap.signals.reading import Reading
from coupled.gap.thresholds import FAR_SIGMAS, ROUNDING_SPAN
from coupled.rig.hosted import Feel, held_over
from coupled.rig.replay import replay_compensation, replay_product
from coupled.rig.rig import Rig


@dataclass(frozen=True)
class Product:
    """F_mod of a record in N, from δc and G_T; each signal of shape (frames,)."""

    reading: Reading

    @cached_property
    def own(self) -> Noise:
        """The noise of the channel, from its spectrum."""
        return self.reading.channel_noise("modifying_force")

    @cached_property
    def unsure(self) -> NDArray[np.bool_]:
        """The frames in which noise of δc decides the sign of a jump of F_mod at the breakout.

        They include the rows of a live record in which the loader is not judged. The prediction
        there is the measurement. A jump below the noise of F_mod counts too, if it exceeds the
        rise of the gradient: δc as read has the right sign more often than δc smoothed, for both
        kinds of product.
        """
        away, level = self._smooth - self._neutral, self._level.rms
        below, above, beyond = (self._made(self._neutral + k * level) for k in (-1.0, 1.0, 3.0))
        jump, rise = np.abs(above - below), np.abs(beyond - above)
        near = np.abs(away) < FAR_SIGMAS * level
        jumps = near & ((jump > FAR_SIGMAS * self.own.rms) | (jump > 2.0 * rise))
        judged = self.reading.judged
        return np.asarray(jumps if judged is None else jumps | ~judged)

    @cached_property
    def correlated(self) -> Floats:
        """The noise in the product of δc as read that comes from that reading, N."""
        more = self._made(self._computed) - self._made(self._smooth)
        return np.where(self.unsure, 0.0, more)

    def predict(self, rig: Rig, seen: Floats | None = None) -> Floats:
        """Return a rig's product of δc, smoothed or as `seen` in d, N."""
        of = self.reading
        if rig.controls[of.control].loader.multiplier == "digital":
            read = self._computed
        else:
            sensed, smooth = of.sensed(rig), self._likely if seen is None else seen
            still = smooth - sensed.hum(self._computed)
            read = sensed.curve.inverse(still / sensed.scale(len(smooth)))
        return np.where(self.unsure, of.signal("modifying_force"), self._made(read, rig))

    def noisy(self, rig: Rig, k: int) -> Floats:
        """Return the product with the k-th sample of the noise of δc."""
        return self.predict(rig, with_error(self._likely, k, self._level))

    @cached_property
    def _computed(self) -> Floats:
        return self.reading.as_read("computed")

    @cached_property
    def _smooth(self) -> Floats:
        return smoothed(self._computed)

    @cached_property
    def _likely(self) -> Floats:
        """The estimate of δc, d: smoothed, plus the motion's share of what the smoother removes.

        For a fast motion with little noise that share is large. Without it, an analog product,
        which contains the whole motion, would seem to repeat the noise of δc.
        """
        rest = self._computed - self._smooth
        noise = self._level.sample(len(rest), np.random.default_rng(53))
        alone = noise - Smoother.of(self._computed).passed(noise)
        power = float(rest @ rest)
        motion = max(0.0, 1.0 - float(alone @ alone) / power) if power > 0.0 else 0.0
        return self._smooth + motion * rest

    @cached_property
    def _level(self) -> Noise:
        return self.reading.channel_noise("computed")

    @cached_property
    def _feel(self) -> Feel:
        return self.reading.feel()

    @cached_property
    def _neutral(self) -> Floats:
        """The δc of neutral with the services, d."""
        return 0.0 * self._smooth + self.reading.neutral()

    def _made(self, read: Floats, rig: Rig | None = None) -> Floats:
        """Return the product of δc as read, N, by a rig; default: the nominal one."""
        of = self.reading
        rig = of.rig if rig is None else rig
        missed, assumed = of.missed.under(rig, of.control), of.assumed()
        more = None if assumed is None else assumed.gradient
        place = read - self._neutral
        return replay_product(rig, of.control, place, self._feel, missed, more)


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
