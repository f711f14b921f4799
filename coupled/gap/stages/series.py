"""Loader and linkage in series, for a record of F and δ without δc.

    F → loader → δc → servo, play → + bend(F) → δ

The loader's response to the measured force is predicted, and drives the linkage; the predicted
reading of the transducer at the grip is compared with the record. All effects of loader and
linkage show in this one output. A static record gives one number only, the slope of δ over F,

    dδ/dF = 1/(G_B + ΔG) + K

so a bend, a gradient and a force scale are not separable. The loader's mass and damping make them
separable if the force excites both.

On a bench that imposes the motion, the grip takes up a rigid backlash on the side of the force,
δ = x + sgn(F)·play/2 + bend(F). Within the backlash the force is zero and δ is arbitrary.
"""

from __future__ import annotations

import numpy as np

from coupled.gap.noise.noise import Noise
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.driven import Drive
from coupled.gap.signals.output import Floats, Predict
from coupled.gap.signals.reading import Reading
from coupled.gap.stages.ratchet import (
    Driven,
    creeps,
    without_backlash_creep,
    without_friction_creep,
)
from coupled.record.channels import unit_of
from coupled.rig.hosted import Hosted
from coupled.rig.nodes import Nodes
from coupled.rig.replay import drive_series
from coupled.rig.rig import Rig

NO_FORCE = 3.0  # standard deviations of F's noise within which the force is taken as zero
SAMPLED = 47  # seed of the noise with which creep is tested


class Series:
    """The motion of the grip under a force, as measured and as predicted by a rig."""

    def __init__(self, reading: Reading, force: Drive, hosted: Hosted) -> None:
        self._reading, self.force, self._hosted = reading, force, hosted
        self._gradient, self._second = reading.gradient(), reading.second()
        self._load = reading.load()
        self._others = {name: smoothed(other) for name, other in reading.others().items()}
        self._leaks = [Nodes(smoothed(other)) for other in reading.partner()]
        self._trembling = force.passed(np.random.default_rng(SAMPLED))
        self._trembling_nodes = Nodes(self._trembling)
        self._walks: bool | None = None

    def _driven(self, force: Floats) -> Driven:
        """Return the response to a force, N at the frames, plus a multiple of its noise."""
        reading, nodes = self._reading, Nodes(force)

        def at(rig: Rig, times: float) -> Floats:
            sensed = reading.sensed(rig)
            pull = sensed.force_on_nodes(nodes.of(rig), force)
            bending = sensed.force(force)
            if times:
                pull = pull + times * self._trembling_nodes.of(rig)
                bending = bending + times * self._trembling
            if self._leaks and (share := rig.controls[reading.control].loader.crosstalk):
                pull = pull + share * self._leaks[0].of(rig)
            host = self._hosted._replace(missed=reading.missed.under(rig, reading.control))
            driven_by = (pull, self._gradient, bending, self._load(rig), self._second)
            read = drive_series(rig, reading.control, *driven_by, host, self._others)
            return sensed.zero + read

        def taken_up(rig: Rig, times: float) -> Floats:
            loader = rig.controls[reading.control].loader
            if loader.play == 0.0 or loader.play_stiffness > 0.0:
                return at(rig, times)
            key = f"controls.{reading.control}.loader.play_{unit_of(reading.control)}"
            held, half = at(rig.changed({key: 0.0}), times), 0.5 * loader.play
            true = reading.sensed(rig).force(force)
            free = np.clip(reading.signal("deflection"), held - half, held + half)
            acts = np.abs(true) > NO_FORCE * self.force.noise.rms
            return np.where(acts, held + half * np.sign(true), free)

        return taken_up if reading.by_hand else at

    def _predicted(self, force: Floats, times: float) -> Predict:
        reading, at = self._reading, self._driven(force)
        measured = reading.signal("deflection")

        def predicted(rig: Rig) -> Floats:
            loader = rig.controls[reading.control].loader
            ratchets = loader.play > 0.0 and not reading.by_hand
            if ratchets or loader.bend_hysteresis_share:
                return without_backlash_creep(rig, reading.control, at, measured)
            if self._walks:
                return without_friction_creep(rig, reading.control, at, measured, times)
            return at(rig, 0.0)

        return predicted

    def predict(self, own: Noise) -> Predict:
        """Return the prediction of δ as read, in d at each frame; `own` is the noise of δ."""
        force = self.force
        if self._walks is None:
            answer = self._driven(force.smooth)
            walks = force.smooth is not force.recorded
            given = (self._reading.rig, self._reading.control, answer, own.rms)
            self._walks = walks and creeps(*given)
        return self._predicted(force.smooth, 1.0)

    def noisy(self, rig: Rig, k: int) -> Floats:
        """Return the prediction with sample number k of the error of the smoothed force."""
        return self._predicted(self.force.with_error(k), 2.0**0.5)(rig)
