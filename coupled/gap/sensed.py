"""What a rig's sensing and recording made of a signal, undone: the signal as it was.

The stages are driven by what was, and a record holds what was read: by a scale that is off or
drifts, with a zero, stamped late.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from coupled.gap.output import Floats
from coupled.record.channels import ControlName
from coupled.rig.parameters import Sensing
from coupled.rig.recorder import stamped
from coupled.rig.replay import on_nodes
from coupled.rig.rig import Rig


@dataclass(frozen=True)
class Sensed:
    """What a rig's channels of one control have to do with what they measure."""

    rig: Rig
    control: ControlName

    @property
    def _of(self) -> Sensing:
        return self.rig.controls[self.control].sensing

    @property
    def zero(self) -> float:
        """What the transducer at the grip reads at neutral, d."""
        return self._of.deflection_zero

    def scale(self, frames: int) -> Floats | float:
        """Return δc as read over what it is, at each frame."""
        return self._scale(frames, self.rig.frame_rate)

    def scale_on_nodes(self, nodes: int) -> Floats | float:
        """Return the same at each of the loader's nodes."""
        return self._scale(nodes, self.rig.frame_rate * self.rig.substeps)

    def _scale(self, samples: int, rate_Hz: float) -> Floats | float:
        of = self._of
        if of.scale_drift == 0.0:
            return of.read_scale
        times_s = np.arange(samples, dtype=np.float64) / rate_Hz
        return np.asarray(of.read_scale * (1.0 + of.scale_drift * times_s))

    def force(self, recorded: Floats) -> Floats:
        """Return F in N at each frame from what the record holds of it."""
        return self._unread(self.as_the_host_had_it(recorded))

    def force_on_nodes(self, nodes: Floats, recorded: Floats) -> Floats:
        """Return F in N at each of the loader's nodes; `nodes` are those of the record's F."""
        if self._of.force_stamp != 0.0:
            nodes = on_nodes(self.rig, self.as_the_host_had_it(recorded))
        return self._unread(nodes)

    def both(self, computed: Floats, recorded: Floats) -> tuple[Floats, Floats]:
        """Return δc on the nodes and F at the frames from what was read of them there."""
        return computed / self.scale_on_nodes(len(computed)), self.force(recorded)

    def as_the_host_had_it(self, recorded: Floats) -> Floats:
        """Return F as the host read it, N: without the recorder's late stamps."""
        return stamped(recorded, -self._of.force_stamp * self.rig.frame_rate)

    def _unread(self, read: Floats) -> Floats:
        of = self._of
        if of.force_scale == 1.0 and of.force_zero == 0.0:
            return read
        return (read - of.force_zero) / of.force_scale
