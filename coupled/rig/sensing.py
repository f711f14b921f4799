"""Sensing: the readings of force and deflection by host and recorder (figure 3).

Voltages represent metres and newtons: v₁ = S₁·δc, v₂ = S₂·ΔF, v₃ = S₃·F, eq. (2). A converter of a
given word length rounds them to its step and limits them to its full scale. An error of S₁ or S₃
scales the δc or F as read by that factor. An error of S₁ in the loader's electronics is in the v₁
of the analog multiplier, too; one of the host's reading (transducer to host) is not.

Steps and ranges are those of the resulting quantity: a ΔF, or ΔG, sent by assumed scales results by
the real ones.

A host reads its channels one after the other. With a skew, the δc or F of the frame at t_k is that
of t_k − skew, linear between the loader's nodes; the output may be late, too (`modification`).

A gauge or a transducer may have a zero offset, and S₁ may drift: δc as read at t_k is then
S₁·(1 + rate·t_k)·δc over the assumed S₁. Mains hum may be added, hum·sin(2π·f·t_k + phase): the
host reads it, too, and a converter sampled below 2·f aliases it. Late time stamps are an effect of
the recorder (`recorder`).

Gauge and transducers may be nonlinear: a curve gives the reading over the true value, to which
scale, offset, hum and noise are applied (`curves`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import layout, stage
from coupled.rig.declaration import Declaration, Given
from coupled.rig.parameters import Sensing
from coupled.rig.piecewise import SHAPE, along, count_of, table_of


class SensingParameters(Protocol):
    """Scales and converter steps, already divided into the quantity's own unit."""

    read_scale: float  # S₁ real over assumed, in the host's reading of v₁
    scale_drift: float  # its relative growth in a frame
    hum: float  # of the mains in δc as read, d
    hum_turn: float  # rad a frame
    hum_phase: float  # at t = 0, rad
    force_scale: float  # S₃ real over assumed
    force_zero: float  # reading without a force, N
    deflection_zero: float  # reading of the grip's transducer at neutral, d
    computed_step: float  # converter step of δc, d; 0 for none
    computed_range: float  # converter range of δc, d
    force_step: float  # of F, N
    force_range: float
    product_step: float  # of ΔF (digital), N
    product_range: float
    gradient_step: float  # of ΔG (hybrid), N/d
    gradient_range: float
    skewed: int  # δc or F is read before t_k
    computed_skew: float  # lead of the reading, in substeps
    force_skew: float
    computed_nodes: int  # of the curve of δc as read; 0 without one
    computed_curve: NDArray[np.float64]  # reading less true, d
    force_nodes: int  # of the curve of F as read
    force_curve: NDArray[np.float64]  # reading less true, N
    grip_nodes: int  # of the curve of the grip's transducer
    grip_curve: NDArray[np.float64]  # reading less true, d
    load_nodes: int  # of the curve of what the force adds to it
    load_curve: NDArray[np.float64]  # d over N


class SensingState(Protocol):
    """The values sampled by the host, within the frame that ends at t_k."""

    computed: float  # δc, d
    force: float  # F, N


_SCALES: dict[str, Callable[[Sensing], float]] = {  # full scale of each, in its own unit
    "computed": lambda s: s.full_scale / s.s1,
    "force": lambda s: s.full_scale / s.s3,
    "product": lambda s: s.full_scale / (s.s2 * s.modifying_scale),
    # The multiplier's other input: v₂ = v₁ at full scale, by the electronics' own S₁ and S₂.
    "gradient": lambda s: s.s1 * s.computed_scale / (s.s2 * s.modifying_scale),
}


def _range(of: str) -> Callable[[Given], float]:
    return lambda g: _SCALES[of](g.control.sensing) if g.control.sensing.word_length else 0.0


def _step(of: str) -> Callable[[Given], float]:
    """Return a function for a converter's step: 2ᴺ steps from −full scale to full scale."""
    return lambda g: 2.0 * _range(of)(g) / 2**g.control.sensing.word_length


SENSING = Declaration(
    layout(
        SensingParameters,
        computed_curve=SHAPE,
        force_curve=SHAPE,
        grip_curve=SHAPE,
        load_curve=SHAPE,
    ),
    section="control.sensing",
    derived={
        "read_scale": lambda g: g.control.sensing.read_scale,
        "scale_drift": lambda g: g.control.sensing.scale_drift * g.frame_s,
        "hum_turn": lambda g: 2.0 * math.pi * g.control.sensing.hum_frequency * g.frame_s,
    }
    | {f"{of}_range": _range(of) for of in _SCALES}
    | {f"{of}_step": _step(of) for of in _SCALES}
    | {
        "skewed": lambda g: g.control.sensing.computed_skew + g.control.sensing.force_skew > 0.0,
        "computed_skew": lambda g: g.control.sensing.computed_skew / g.substep_s,
        "force_skew": lambda g: g.control.sensing.force_skew / g.substep_s,
        "computed_nodes": lambda g: count_of(g.control.sensing.deflection_curve),
        "computed_curve": lambda g: table_of(g.control.sensing.deflection_curve),
        "force_nodes": lambda g: count_of(g.control.sensing.force_curve),
        "force_curve": lambda g: table_of(g.control.sensing.force_curve),
        "grip_nodes": lambda g: count_of(g.control.sensing.grip_curve),
        "grip_curve": lambda g: table_of(g.control.sensing.grip_curve),
        "load_nodes": lambda g: count_of(g.control.sensing.grip_load_curve),
        "load_curve": lambda g: table_of(g.control.sensing.grip_load_curve),
    },
    state=layout(SensingState),
)


@stage
def converted(value: float, step: float, full_scale: float) -> float:
    """Return a value after a converter of this step and range; unchanged for step 0."""
    if step == 0.0:
        return value
    rounded = step * math.floor(value / step + 0.5)
    return min(max(rounded, -full_scale), full_scale - step)


@stage
def sample(
    p: SensingParameters, s: SensingState, computed: float, force: float, left: int, first: bool
) -> None:
    """Store δc in d and F in N at a node, `left` substeps before the frame's end.

    `first` is the frame's first node, at which the samples are reset.
    """
    if first:
        s.computed = s.force = 0.0
    s.computed += max(0.0, 1.0 - abs(p.computed_skew - left)) * computed
    s.force += max(0.0, 1.0 - abs(p.force_skew - left)) * force


@stage
def scale_at(p: SensingParameters, frame: int) -> float:
    """Return the ratio of δc as the host reads it to δc, at a frame."""
    return p.read_scale * (1.0 + p.scale_drift * frame)


@stage
def scaled_computed(p: SensingParameters, computed: float, frame: int) -> float:
    """Return δc by the host's transducer at a frame, d, without hum, noise and converter."""
    if p.computed_nodes > 0:
        computed += along(p.computed_curve, p.computed_nodes, computed)
    return scale_at(p, frame) * computed


@stage
def scaled_force(p: SensingParameters, force: float) -> float:
    """Return F by the gauge, N, without zero offset, noise and converter."""
    if p.force_nodes > 0:
        force += along(p.force_curve, p.force_nodes, force)
    return p.force_scale * force


@stage
def hum_at(p: SensingParameters, frame: int) -> float:
    """Return the mains' hum in δc as read at a frame, d."""
    return p.hum * math.sin(p.hum_turn * frame + p.hum_phase)


@stage
def read_computed(p: SensingParameters, computed: float, frame: int, noise: float) -> float:
    """Return δc as the host reads it, d: v₁ of eq. (2), by the assumed scale."""
    read = scaled_computed(p, computed, frame) + noise
    if p.hum != 0.0:
        read += hum_at(p, frame)
    return converted(read, p.computed_step, p.computed_range)


@stage
def read_force(p: SensingParameters, force: float, noise: float) -> float:
    """Return F as the host reads it, N."""
    read = scaled_force(p, force) + (noise + p.force_zero)
    return converted(read, p.force_step, p.force_range)


@stage
def read_grip(p: SensingParameters, shown: float, force: float) -> float:
    """Return the grip's transducer's reading by its curves, d, without zero offset and noise."""
    if p.grip_nodes > 0:
        shown += along(p.grip_curve, p.grip_nodes, shown)
    if p.load_nodes > 0:
        shown += along(p.load_curve, p.load_nodes, force)
    return shown
