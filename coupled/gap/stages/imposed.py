"""A control with imposed motion, as on a damper test bench: the force is the output.

The imposed motion is that of the grip if recorded, else δc. The measured force is compared with
the loader's reaction (`rig.imposed`). Structure (which bends under the measured force), servo and
backlash lie between grip and loader.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from coupled.gap.effects.effect import Effect, Parameter, dotted
from coupled.gap.noise.noise import Noise
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.floors import with_error
from coupled.gap.signals.output import Floats, Output, Predict
from coupled.gap.signals.reading import Reading
from coupled.gap.thresholds import JUMP_COUNTED, NOISE_TRIES, PLAY_LEAST, PLAYS, PLAYS_ALIKE
from coupled.record.channels import ControlName
from coupled.rig.imposed import answer_to, behind_linkage
from coupled.rig.nodes import Nodes
from coupled.rig.recorder import stamped
from coupled.rig.rig import Rig

OF_PLAY = "loader.play"  # key in the rig file, without the unit


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
            return np.asarray(nodes / read_as.scale_on_nodes(len(nodes)))

        def predicted(rig: Rig) -> Floats:
            data, true = rig.controls[reading.control], at_loader(rig)
            answer = answer_to(rig, reading.control, true, self._gradient, self._load(rig))
            late_s = data.sensing.force_stamp - data.loader.delay

            def read(force: Floats) -> Floats:
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


def under_motion(library: Sequence[Effect], imposed: str) -> list[Effect]:
    """Return a library for imposed motions: the effects of the linkage show in the force.

    If δc is `imposed`, backlash is the only effect of the linkage. Limits of the servo are left
    out, since the motion of the grip is given.
    """
    found = []
    for effect in library:
        keys = [p.key for p in effect.parameters]
        plays = [p for p in effect.parameters if p.key.rpartition("_")[0] == OF_PLAY]
        if effect.stage != "linkage":
            sensed = imposed == "deflection" and "linkage" in effect.shows_in
            found.append(replace(effect, outputs=("loader",)) if sensed else effect)
        elif plays:
            if len(keys) == 1:
                found.append(replace(effect, outputs=("loader",), seen=partial(_plays, plays[0])))
        elif imposed == "deflection" and not any("servo" in k and "limit" in k for k in keys):
            found.append(replace(effect, outputs=("loader",)))
    return found


def _plays(
    number: Parameter, outputs: Sequence[Output], rig: Rig, control: ControlName
) -> list[dict[str, float]]:
    """Return the backlashes with the least residual of the force, where a fit starts, by scans.

    The cost has local minima, since the jumps of a backlash move from sample to sample. The force
    is scanned once as the rig predicts it, and once with a free factor and offset: with an unknown
    damping the prediction may be far off.
    """
    ours = [output for output in outputs if output.stage == "loader"]
    key = dotted(number.key_on(control), control)
    filed, travel = rig.controls[control].loader.play, rig.controls[control].travel

    @cache
    def left(play: float) -> tuple[float, float]:
        other = rig.changed({key: number.entered(filed, play)})
        each = [(one.measured / one.floor, one.residual(other, wide=True)) for one in ours]
        as_filed = sum(float(np.sum(misfit**2)) for _, misfit in each)
        scaled = sum(_beside_factor(seen, seen - misfit) for seen, misfit in each)
        return as_filed, scaled

    found = []
    for i in range(2):
        rough = np.geomspace(PLAY_LEAST * travel, travel, PLAYS).tolist()
        best = min(rough, key=lambda play: left(play)[i])
        fine = (best * np.linspace(0.75, 1.3, PLAYS)).tolist()
        found.append(min(fine, key=lambda play: left(play)[i]))
    alike = abs(found[1] - found[0]) < PLAYS_ALIKE * found[0]
    return [{number.name: play} for play in found[: 1 if alike else 2]]


def _beside_factor(seen: Floats, predicted: Floats) -> float:
    """Return the sum of squares that any positive factor and offset of a prediction leave."""
    about, moves = seen - seen.mean(), predicted - predicted.mean()
    power, shared = float(moves @ moves), float(moves @ about)
    return float(about @ about) - (shared**2 / power if min(power, shared) > 0.0 else 0.0)
