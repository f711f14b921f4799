"""The levers of a recorded flight, which move the model's.

The model's lever is moved from its position in trim, as the recorded lever is from its first row.
If a record has a single throttle, it moves the throttles of all engines; mixture and propeller
levers likewise.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import count, takewhile

import numpy as np
from numpy.typing import NDArray

from coupled.flight.wrapper import Aircraft, Hook, Wrapper
from coupled.record.levers import OF_ENGINES, lever_property, levers_of

Floats = NDArray[np.float64]


class Levers(Wrapper):
    """The recorded positions of levers, shape (frames,) each, over the frames of a flight.

    `frames` is the length of a step of the model in frames of the record; it may be a fraction.
    """

    def __init__(self, positions: Mapping[str, Floats], frames: float) -> None:
        self._levers, self._positions, self._frames = levers_of(positions), positions, frames

    def attach(self, aircraft: Aircraft) -> Hook | None:
        """Return a hook that moves the levers; a row of the record ends the frame before it."""
        moves = []
        for name, (kind, engine) in self._levers.items():
            recorded = self._positions[name]
            rows = 1.0 + np.arange(len(recorded) / self._frames) * self._frames
            ends = min(0.0, float(recorded.min())), max(1.0, float(recorded.max()))
            moved = np.interp(rows, np.arange(len(recorded)), recorded - recorded[0])
            for own in self._driven(aircraft, kind, engine):
                lever = aircraft.lever(own)
                moves.append((lever.set, np.clip(lever.read() + moved, *ends).tolist()))
        step, last = 0, max((len(positions) for _, positions in moves), default=0) - 1

        def move_levers() -> None:
            nonlocal step
            for put, positions in moves:
                put(positions[step])
            step = min(step + 1, last)

        return move_levers if moves else None

    def _driven(self, aircraft: Aircraft, kind: str, engine: int) -> list[str]:
        """Return the model's properties that a recorded lever moves."""
        alone = [each for each, _ in self._levers.values()].count(kind) == 1
        if kind in OF_ENGINES and alone:
            return [*takewhile(aircraft.has, (lever_property(kind, i) for i in count()))]
        own = lever_property(kind, engine)
        return [own] if aircraft.has(own) else []
