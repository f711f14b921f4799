"""Gauge: from the hand's force to the force measured for loader and host.

    mass       F_g = F − m_g·x''        the inertia of the parts between gauge and grip
    amplifier  y'' = ω²·(F_g − y) − 2ζω·y',    or  y' = ω·(F_g − y)
    delay      y(t − τ)
    converter  sampled at a rate of its own and held until the next sample

A gauge measures the force in the structure beneath it, not that of the hand. The parts in between
(grip, yoke, the upper part of the column) take m_g·x'' to be accelerated. The gauge of a free
control then reads −m_g·x'', which drives the loader: with the lag of gauge and servo this limits
how small the simulated mass of a loader can be (`authority/stability`).

The mass moves with the servo, below the bend; its own vibration on the structure, at 1/√(K·m_g), is
neglected. x'' is that of the servo's equation at the last node, zero if its speed is at its limit.
The amplifier is stepped exactly for a force linear over a substep. If all numbers are neutral the
stage is skipped, and the hand's own force is used.
"""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compiled import TINY, layout, stage
from coupled.rig.declaration import Declaration, Given
from coupled.rig.linkage import LinkageParameters, LinkageState, servo_weights
from coupled.rig.parameters import GAUGE_SLOTS


class GaugeParameters(Protocol):
    """Mass, amplifier, delay and converter of a gauge; d is m, or rad for a wheel."""

    present: int  # 0 if the gauge gives the hand's force unchanged
    mass: float  # m_g, kg (N per d/s²)
    servo_stiffness: float  # ω², 1/s²
    servo_damping: float  # 2ζω, 1/s
    position: NDArray[np.float64]  # weights of (y, y', F_g before, F_g after) in the next y
    speed: NDArray[np.float64]  # and in the next y'
    delay_substeps: float  # τ over the substep
    samples: float  # in a substep; 0 for continuous sampling


class GaugeState(Protocol):
    """The state between the grip and the loader."""

    acceleration: float  # x'' at the last node, d/s²
    given: float  # F_g at the last node, N
    passed: float  # y, N
    rate: float  # y', N/s
    force: float  # output for loader and host, N
    phase: float  # of the converter's sample, 0 to 1
    node: int  # substeps since the start
    history: NDArray[np.float64]  # y at past nodes, N


def amplifier_weights(
    order: str, frequency_Hz: float, damping_ratio: float, h: float
) -> NDArray[np.float64]:
    """Return the exact one-substep map of an amplifier, shape (2, 4), as `servo_weights`.

    0 Hz is an amplifier without lag.
    """
    if frequency_Hz == 0.0:
        return np.array([[0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
    w = 2.0 * math.pi * frequency_Hz
    if order == "second":
        return servo_weights(w, damping_ratio, h)
    left = math.exp(-w * h)
    ramp = -math.expm1(-w * h) / (w * h)
    return np.array([[left, 0.0, ramp - left, 1.0 - ramp], [0.0, 0.0, 0.0, 0.0]])


def _amplifier(g: Given) -> NDArray[np.float64]:
    s = g.control.sensing
    return amplifier_weights(s.gauge_order, s.gauge_frequency, s.gauge_damping_ratio, g.substep_s)


def _servo_rate(g: Given) -> float:
    return 2.0 * math.pi * g.control.loader.servo_frequency


def _present(g: Given) -> bool:
    s = g.control.sensing
    return any((s.gauge_mass, s.gauge_frequency, s.gauge_delay, s.gauge_sampling))


GAUGE = Declaration(
    layout(GaugeParameters, position=(4,), speed=(4,)),
    section="control.sensing",
    derived={
        "present": _present,
        "mass": lambda g: g.control.sensing.gauge_mass,
        "servo_stiffness": lambda g: _servo_rate(g) ** 2,
        "servo_damping": lambda g: 2.0 * g.control.loader.servo_damping_ratio * _servo_rate(g),
        "position": lambda g: _amplifier(g)[0],
        "speed": lambda g: _amplifier(g)[1],
        "delay_substeps": lambda g: g.control.sensing.gauge_delay / g.substep_s,
        "samples": lambda g: g.control.sensing.gauge_sampling * g.substep_s,
    },
    state=layout(GaugeState, history=(GAUGE_SLOTS,)),
    fixed=("phase",),
)


@stage
def start_gauge(p: GaugeParameters, s: GaugeState, force: float) -> float:
    """Start at rest with the hand's force at the first node, N; return the gauge's output."""
    if p.present == 0:
        return force
    s.given = force
    s.passed = force if p.position[3] == 1.0 else 0.0  # 1 if the amplifier has no lag
    s.history[0] = s.passed
    s.force = s.passed if p.delay_substeps == 0.0 else 0.0
    return s.force


@stage
def gauge_force(p: GaugeParameters, s: GaugeState, force: float) -> float:
    """Return the output for loader and host at the next node, N, from the hand's force there."""
    before, y, rate = s.given, s.passed, s.rate
    s.given = force - p.mass * s.acceleration
    a, b = p.position, p.speed
    s.passed = a[0] * y + a[1] * rate + a[2] * before + a[3] * s.given
    s.rate = b[0] * y + b[1] * rate + b[2] * before + b[3] * s.given
    if abs(s.passed) < TINY and abs(s.rate) < TINY:
        s.passed = s.rate = 0.0
    s.node += 1
    s.history[s.node & (GAUGE_SLOTS - 1)] = s.passed
    late = s.passed
    if p.delay_substeps > 0.0:
        whole = int(p.delay_substeps)
        share = p.delay_substeps - whole
        near = s.history[(s.node - whole) & (GAUGE_SLOTS - 1)] if s.node >= whole else 0.0
        far = s.history[(s.node - whole - 1) & (GAUGE_SLOTS - 1)] if s.node > whole else 0.0
        late = (1.0 - share) * near + share * far
    s.phase += p.samples
    if p.samples == 0.0 or s.phase >= 1.0 - 1e-9:
        s.phase = max(s.phase - math.floor(s.phase + 1e-9), 0.0)
        s.force = late
    return s.force


@stage
def move_gauge(
    p: GaugeParameters,
    s: GaugeState,
    linkage_p: LinkageParameters,
    linkage: LinkageState,
    computed: float,
) -> None:
    """Set the acceleration of the mass beyond the gauge at a node, from δc there, d."""
    s.acceleration = (
        p.servo_stiffness * (computed - linkage.position) - p.servo_damping * linkage.rate
    )
    most = linkage_p.acceleration_limit
    if most > 0.0:
        s.acceleration = min(max(s.acceleration, -most), most)
    limit = linkage_p.rate_limit
    if limit > 0.0 and abs(linkage.rate) >= limit and s.acceleration * linkage.rate > 0.0:
        s.acceleration = 0.0
