"""Data of the host in a record, as inputs of replays: feel, services, and missed frames."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.rig.serving import ServiceRows

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]


class Feel(NamedTuple):
    """What the host specifies at each frame, of shape (frames,).

    `gradient` and `second` are G_T in N/d below and beyond the break. A schedule of a curve takes
    the host's q̄, `pressure` in Pa, in place of both, and `left`, the share that has not failed.
    """

    gradient: Floats
    second: Floats | None = None
    pressure: Floats | None = None
    left: Floats | float = 1.0

    def rows(self) -> Floats:
        """Return G_T twice, q̄ and the share, of shape (4, frames)."""
        none = np.zeros_like(self.gradient)
        second = self.gradient if self.second is None else self.second
        pressure = none if self.pressure is None else self.pressure
        return np.stack((self.gradient, second, pressure, none + self.left))


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


class OtherInputs(NamedTuple):
    """Inputs of the loader beside force and motion, at each frame; without one, no effect of it.

    `load_factor` is +1 in level flight; `regressor` is r − r₀ of the rig file's regressor, in its
    unit.
    """

    load_factor: Floats | None = None
    regressor: Floats | None = None

    def rows(self, frames: int) -> Floats:
        """Return the load factor and r − r₀, of shape (2, frames)."""
        level = np.ones(frames) if self.load_factor is None else self.load_factor
        away = np.zeros(frames) if self.regressor is None else self.regressor
        return np.stack((level, away))


NO_INPUTS = OtherInputs()


def held_over(signal: Floats, missed: Mask | None) -> Floats:
    """Return a host's output, held over the missed frames (never the first)."""
    if missed is None:
        return signal
    frames = np.arange(len(signal))
    return np.asarray(signal[np.maximum.accumulate(np.where(missed, 0, frames))])
