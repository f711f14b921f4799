"""A control with imposed motion, as on a damper test bench: the force is the output.

The imposed motion is that of the grip if recorded, else δc. The measured force is compared with
the loader's reaction (`rig.imposed`). Structure (which bends under the measured force), servo and
backlash lie between grip and loader.
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
    """The force under an imposed motion: as measured, and as predicted by a rig."""

    def __init__(self, reading: Reading) -> None:
        self._reading = reading
        self._motion = smoothed(reading.signal(reading.imposed))
        self._level: Noise = reading.driving(reading.imposed)
        self._gradient = reading.gradient()
        self._load = reading.load()
        self._force = reading.pulled()
        self._others = {name: smoothed(other) for name, other in reading.others().items()}

    def predict(self, motion: Floats | None = None, force: Floats | None = None) -> Predict:
        """Return the prediction for a motion as read, d at each frame; default: the record's.

        `force`, N, bends the structure behind the grip; default: the record's.
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
            return read_as.before_curve(np.asarray(nodes / read_as.scale_on_nodes(len(nodes))))

        def predicted(rig: Rig) -> Floats:
            data, true = rig.controls[reading.control], at_loader(rig)
            answer = answer_to(rig, reading.control, true, self._gradient, self._load(rig))
            late_s = data.sensing.force_stamp - data.loader.delay

            def read(force: Floats) -> Floats:
                curve = data.sensing.force_curve
                force = curve.at(force) if curve.nodes else force
                gauged = data.sensing.force_scale * force + data.sensing.force_zero
                return stamped(gauged, late_s * rig.frame_rate)

            force = read(answer.force)
            if (answer.most > answer.least).any():
                force = self._within_rests(force, read(answer.least), read(answer.most))
            return self._within_jumps(force, answer.jumps) if answer.jumps.any() else force

        return predicted

    def _within_rests(self, predicted: Floats, least: Floats, most: Floats) -> Floats:
        """Return a prediction that at rest is the force measured, if friction can hold it.

        Beyond its noise: what friction cannot hold is a misfit.
        """
        held = np.clip(self._force.smooth, np.minimum(least, most), np.maximum(least, most))
        return np.where(most != least, held, predicted)

    def _within_jumps(self, predicted: Floats, jumps: NDArray[np.bool_]) -> Floats:
        """Return a prediction with a small weight where the force jumps within a frame.

        A backlash that closes within a frame gives a sample between the forces before and after.
        Only the share `JUMP_COUNTED` of the difference counts, which still guides a fit.
        """
        around = np.stack((np.roll(predicted, 1), np.roll(predicted, -1)))
        held = np.clip(self._reading.signal("force"), around.min(axis=0), around.max(axis=0))
        return np.where(jumps, held + JUMP_COUNTED * (predicted - held), predicted)

    def noisy(self, rig: Rig, k: int) -> Floats:
        """Return the prediction with a sample of the error of the smoothed motion."""
        moved = with_error(self._motion, k, self._level)
        return self.predict(moved, self._force.with_error(k + NOISE_TRIES))(rig)
