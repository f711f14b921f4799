"""A measured signal as the input of a stage: smoothed, constant at rest, with its error."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise
from coupled.gap.noise.resting import Rest, rest_of
from coupled.gap.noise.smooth import Smoother, smoothed
from coupled.gap.signals.floors import unsmoothed, with_error
from coupled.gap.thresholds import LOUDER

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Drive:
    """A signal that drives a stage: as recorded, as used for input, its noise and its rests."""

    recorded: Floats
    smooth: Floats
    noise: Noise
    rest: Rest

    @classmethod
    def of(cls, signal: Floats, noise: Noise) -> Drive:
        """Return a signal smoothed, and held constant at rest; unchanged if it has no noise.

        It is also unchanged if the smoother would remove far more than its noise, since that is
        signal, for example of a hand that moves in steps.
        """
        rest = rest_of(signal, noise)
        smooth = rest.held(smoothed(signal, noise)) if noise.rms else signal
        made = cls(signal, smooth, noise, rest)
        taken = float(np.sqrt(np.mean((signal - smooth) ** 2)))
        return made.unsmoothed(noise) if taken > LOUDER * noise.rms else made

    def unsmoothed(self, noise: Noise) -> Drive:
        """Return the signal as recorded, without smoothing."""
        none = np.zeros(len(self.recorded))
        return replace(self, smooth=self.recorded, noise=noise, rest=Rest(none, none))

    def with_error(self, k: int) -> Floats:
        """Return the signal with a sample of its error, number k; shape (frames,)."""
        if self.smooth is self.recorded:
            return unsmoothed(self.smooth, k, self.noise)
        error = with_error(self.smooth, k, self.noise) - self.smooth
        return self.smooth + self.rest.with_error(error, np.random.default_rng([43, k]))

    def passed(self, rng: np.random.Generator) -> Floats:
        """Return a sample of the noise that passes the smoother, shape (frames,)."""
        sample = self.noise.sample(len(self.recorded), rng)
        return self.rest.beside(Smoother.of(self.recorded, noise=self.noise).smooth(sample))
