"""Data of the host in a record, as inputs of replays: its services, and missed frames."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.rig.serving import ServiceRows

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Hosted(NamedTuple):
    """The loader's services and the host's data of a record.

    `missed` are the frames that the host missed, `held` the part of the services' force held over
    each frame, N (`serving.held_force`), `reach` the deflection at which a stop of the cab stops
    the grip, d, 0 for none, `assumed` the change of the host's K̂ in ΔG from its first, d/N.
    """

    services: ServiceRows | None = None
    missed: Mask | None = None
    held: Floats | None = None
    reach: float = 0.0
    assumed: Floats | None = None

    def rows(self, frames: int) -> tuple[Floats, ...]:
        """Return x₀ in d, held force in N and jams of services, misses and K̂, at each frame."""
        none = np.zeros(frames)
        neutral, jammed = none, none
        if self.services is not None:
            neutral, jammed = self.services.neutral, self.services.jammed
        held = none if self.held is None else self.held
        missed = none if self.missed is None else self.missed.astype(np.float64)
        return neutral, held, jammed, missed, none if self.assumed is None else self.assumed

    def a_frame_late(self) -> Hosted:
        """Return the same with the services' rows delayed by a frame."""
        if self.services is None:
            return self
        late = (np.concatenate((row[:1], row[:-1])) for row in self.services)
        return self._replace(services=ServiceRows(*late))

    def following(self) -> Floats | None:
        """Return the part of the services' force that follows the motion, N; None if there is none.

        A row has the force that the host held until then.
        """
        if self.services is None:
            return None
        if self.held is None:
            return self.services.force
        return self.services.force - np.concatenate(([0.0], self.held[:-1]))


HOSTED = Hosted()


def held_over(signal: Floats, missed: Mask | None) -> Floats:
    """Return a host's output, held over the missed frames (never the first)."""
    if missed is None:
        return signal
    frames = np.arange(len(signal))
    return np.asarray(signal[np.maximum.accumulate(np.where(missed, 0, frames))])
