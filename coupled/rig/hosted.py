"""What a record holds of the host's work, as replays take it: its services, and frames missed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.rig.serving import ServiceRows

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Hosted(NamedTuple):
    """What a record holds of the loader's services, and the frames that its host missed."""

    services: ServiceRows | None = None
    missed: Mask | None = None

    def rows(self, frames: int) -> tuple[Floats, ...]:
        """Return neutral x₀ in d, force in N and jams of services, and misses, at each frame."""
        none = np.zeros(frames)
        served = (none, none, none) if self.services is None else self.services[:3]
        return (*served, none if self.missed is None else self.missed.astype(np.float64))


HOSTED = Hosted()


def held_over(signal: Floats, missed: Mask | None) -> Floats:
    """Return what a host puts out, held over the frames that it missed, never the first."""
    if missed is None:
        return signal
    frames = np.arange(len(signal))
    return np.asarray(signal[np.maximum.accumulate(np.where(missed, 0, frames))])
