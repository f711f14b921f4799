"""What a record holds of the host's work, as replays take it: its services, and frames missed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.rig.serving import ServiceRows

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Hosted(NamedTuple):
    """What a record holds of the loader's services, and of its host.

    `missed` are the frames that the host missed, `assumed` is how far its K̂ in ΔG was another than
    its first, d/N.
    """

    services: ServiceRows | None = None
    missed: Mask | None = None
    assumed: Floats | None = None

    def rows(self, frames: int) -> tuple[Floats, ...]:
        """Return neutral x₀ in d, force in N and jams of services, misses and K̂, at each frame."""
        none = np.zeros(frames)
        served = (none, none, none) if self.services is None else self.services[:3]
        missed = none if self.missed is None else self.missed.astype(np.float64)
        return (*served, missed, none if self.assumed is None else self.assumed)


HOSTED = Hosted()


def held_over(signal: Floats, missed: Mask | None) -> Floats:
    """Return what a host puts out, held over the frames that it missed, never the first."""
    if missed is None:
        return signal
    frames = np.arange(len(signal))
    return np.asarray(signal[np.maximum.accumulate(np.where(missed, 0, frames))])
