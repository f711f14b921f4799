"""A control whose motion is imposed, as on a test bench for dampers: the force is its answer.

The grip's motion is imposed where the record has it, else δc; the measured force is compared with
the force by which the loader answers (`rig.imposed`). Between the grip and the loader lie the
structure, which bends under the measured force, the servo, and play.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.gap.noise.noise import Noise
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.floors import with_error
from coupled.gap.signals.output import Floats, Predict
from coupled.gap.signals.reading import Reading
from coupled.gap.thresholds import JUMP_COUNTED, NOISE_TRIES
from coupled.rig.imposed import answer_to, behind_linkage
from coupled.rig.nodes import Nodes
from coupled.rig.recorder import stamped
from coupled.rig.rig import Rig


class Imposed:
    """The force of a control under an imposed motion: as measured, and as a rig predicts it."""

    def __init__(self, reading: Reading) -> None:
        self._reading = reading
        self._motion = smoothed(reading.signal(reading.imposed))
        self._level: Noise = reading.driving(reading.imposed)
        self._gradient = reading.gradient()
        self._load = reading.load()
        self._force = reading.pulled()
        self._others = {name: smoothed(other) for name, other in reading.others().items()}

    def predict(self, motion: Floats | None = None, force: Floats | None = None) -> Predict:
        """Return the prediction for a motion in d at each frame, as read; the record's own.

        `force` in N bends the structure behind the grip; the record's own.
        """
        reading = self._reading
        moved = self._motion if motion is None else motion
        pulled = self._force.smooth if force is None else force
        imposed = Nodes(moved)

        def at_loader(rig: Rig) -> Floats:
            read_as = reading.sensed(rig)
            if reading.imposed == "deflection":
                grip, bending = moved - read_as.zero, read_as.force(pulled)
                return behind_linkage(rig, reading.control, grip, bending, self._others)
            nodes = imposed.of(rig)
            return np.asarray(nodes / read_as.scale_on_nodes(len(nodes)))

        def predicted(rig: Rig) -> Floats:
            data, true = rig.controls[reading.control], at_loader(rig)
            force, jumps = answer_to(rig, reading.control, true, self._gradient, self._load(rig))
            late_s = data.sensing.force_stamp - data.loader.delay
            read = data.sensing.force_scale * force + data.sensing.force_zero
            read = stamped(read, late_s * rig.frame_rate)
            return self._within_jumps(read, jumps) if jumps.any() else read

        return predicted

    def _within_jumps(self, predicted: Floats, jumps: NDArray[np.bool_]) -> Floats:
        """Return a prediction that leaves nearly open when, within a frame, a play was taken up.

        A sample there may hold any force between those before and after; what it holds is counted
        as a small share, by which a fit finds its way.
        """
        around = np.stack((np.roll(predicted, 1), np.roll(predicted, -1)))
        held = np.clip(self._reading.signal("force"), around.min(axis=0), around.max(axis=0))
        return np.where(jumps, held + JUMP_COUNTED * (predicted - held), predicted)

    def noisy(self, rig: Rig, k: int) -> Floats:
        """Return the prediction with a sample of what is wrong with the smoothed motion."""
        moved = with_error(self._motion, k, self._level)
        return self.predict(moved, self._force.with_error(k + NOISE_TRIES))(rig)
