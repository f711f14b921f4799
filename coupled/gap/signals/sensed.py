"""The inverse of a rig's sensing and recording: from the recorded to the measured signal.

Stages are driven by physical quantities, and a record contains readings: with a scale error, its
drift, mains hum, a zero offset, and late time stamps. The phase of the hum differs between
records; a rig has that of the first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from coupled.gap.noise.lines import projected
from coupled.gap.signals.output import Floats
from coupled.record.channels import ControlName
from coupled.rig.curves import Curve
from coupled.rig.nodes import on_nodes
from coupled.rig.parameters import Sensing
from coupled.rig.recorder import stamped
from coupled.rig.rig import Rig

FAR = 10.0  # of a curve's length, up to which it is inverted beyond its ends
FLAT_SLOPE = 1e-6  # of a map where it is flat, to be inverted


@dataclass(frozen=True)
class Sensed:
    """The conversion from a rig's readings of one control to the measured quantities."""

    rig: Rig
    control: ControlName
    number: int = 0  # of the record, where there are several

    @property
    def _of(self) -> Sensing:
        return self.rig.controls[self.control].sensing

    @property
    def zero(self) -> float:
        """The reading of the transducer at the grip at neutral, d."""
        return self._of.deflection_zero

    def hum(self, read: Floats) -> Floats | float:
        """Return the mains hum at each frame in δc as read, d."""
        of = self._of
        if of.hum == 0.0:
            return 0.0
        turn = 2.0 * math.pi * of.hum_frequency / self.rig.frame_rate
        at = turn * np.arange(len(read))
        if self.number == 0:
            return np.asarray(of.hum * np.sin(at + of.hum_phase))
        phase = projected(np.diff(read, 4), turn).phase - 2.0 * turn  # phase of four differences
        return np.asarray(of.hum * np.sin(at + phase))

    def hum_on_nodes(self, read: Floats) -> Floats | float:
        """Return the hum on the loader's nodes, along the spline used for a record."""
        return on_nodes(self.rig, hum) if isinstance(hum := self.hum(read), np.ndarray) else hum

    def scale(self, frames: int) -> Floats | float:
        """Return the ratio of δc as read to δc, at each frame."""
        return self._scale(frames, self.rig.frame_rate)

    def scale_on_nodes(self, nodes: int) -> Floats | float:
        """Return the ratio of δc as read to δc, at each of the loader's nodes."""
        return self._scale(nodes, self.rig.frame_rate * self.rig.substeps)

    def _scale(self, samples: int, rate_Hz: float) -> Floats | float:
        of = self._of
        if of.scale_drift == 0.0:
            return of.read_scale
        times_s = np.arange(samples, dtype=np.float64) / rate_Hz
        return np.asarray(of.read_scale * (1.0 + of.scale_drift * times_s))

    def force(self, recorded: Floats) -> Floats:
        """Return F in N at each frame from the recorded F."""
        return self._unread(self.as_the_host_had_it(recorded))

    def force_on_nodes(self, nodes: Floats, recorded: Floats) -> Floats:
        """Return F in N at each of the loader's nodes; `nodes` are those of the recorded F."""
        if self._of.force_stamp != 0.0:
            nodes = on_nodes(self.rig, self.as_the_host_had_it(recorded))
        return self._unread(nodes)

    def both(self, computed: Floats, recorded: Floats, read: Floats) -> tuple[Floats, Floats]:
        """Return δc on the nodes and F at the frames from their readings.

        `read` is δc as recorded, which gives the phase of the hum.
        """
        still = computed - self.hum_on_nodes(read)
        true = self.before_curve(still / self.scale_on_nodes(len(computed)))
        return true, self.force(recorded)

    def as_the_host_had_it(self, recorded: Floats) -> Floats:
        """Return F as the host read it, N: without the delay of the recorder's time stamps."""
        return stamped(recorded, -self._of.force_stamp * self.rig.frame_rate)

    def along_curve(self, computed: Floats) -> Floats:
        """Return δc by the transducer's curve, before its scale, d."""
        curve = self._of.deflection_curve
        return curve.at(computed) if curve.nodes else computed

    def before_curve(self, read: Floats) -> Floats:
        """Return δc whose value by the transducer's curve is given, d."""
        return _inverse(self._of.deflection_curve, read)

    def _unread(self, read: Floats) -> Floats:
        of = self._of
        if of.force_scale != 1.0 or of.force_zero != 0.0:
            read = (read - of.force_zero) / of.force_scale
        return _inverse(of.force_curve, read)


def _inverse(curve: Curve, values: Floats) -> Floats:
    """Return the signals at which a map has given values; where it is flat, one of them."""
    if not curve.nodes:
        return values
    nodes = np.array(curve.nodes)
    far = nodes[-1] + FAR * max(float(nodes[-1] - nodes[0]), float(np.ptp(values)))
    least = -far if curve.odd else 2.0 * nodes[0] - far
    at = np.concatenate(([least], -nodes[::-1] if curve.odd else [], nodes, [far]))
    at = np.unique(at)
    found = curve.at(at)
    return np.asarray(np.interp(values, found + FLAT_SLOPE * at, at))
