"""The twin's frame, compiled: the rig's equations, with other numerical methods.

A trial with the library's own stages would test them against themselves. The twin shares with them
only the description of the rig.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from coupled.blind.twin.mechanism import (
    heard,
    mean_sign,
    product,
    step_loader,
    step_loop,
    step_servo,
    step_structure,
)
from coupled.blind.twin.numbers import TwinParameters, TwinState
from coupled.rig.compiled import entry, stage

Floats = NDArray[np.float64]
STEPS = 128  # of the loader in a frame
NODES = 8  # of the pilot's force in a frame, linear in between


@stage
def _force(nodes: Floats, at: float) -> float:
    """Return the pilot's force at a time in nodes, N; it starts from 0 before the first."""
    if at <= 0.0:
        return float(nodes[0]) if at == 0.0 else 0.0
    low = min(int(at), len(nodes) - 2)
    return float(nodes[low] + (at - low) * (nodes[low + 1] - nodes[low]))


@stage
def _gradient(p: TwinParameters, table: Floats, pressure: float) -> float:
    """Return the schedule's gradient with its slope and an outsider's tent and steps, N/m."""
    rows = p.knots
    rest = np.interp(0.0, p.pressures[:rows], table[:rows])
    found = float(rest + p.slope * (np.interp(pressure, p.pressures[:rows], table[:rows]) - rest))
    if p.tent_height != 0.0:
        found *= 1.0 + p.tent_height * max(0.0, 1.0 - abs(pressure - p.tent_at) / p.tent_width)
    if p.gradient_step > 0.0:
        found = p.gradient_step * math.floor(found / p.gradient_step + 0.5)
    return found


@stage
def _host(p: TwinParameters, s: TwinState, pressure: float, read: float) -> float:
    """Set F_mod for the frame from q̄ and δc as read; return G_T, N/m."""
    asked = p.pressure_scale * pressure
    if s.started == 0:
        s.pressure = s.held_pressure = asked
    s.pressure += p.pressure_gain * (asked - s.pressure)
    half = 0.5 * p.pressure_play
    s.held_pressure = min(max(s.held_pressure, s.pressure - half), s.pressure + half)
    total = _gradient(p, p.first, s.held_pressure)
    beyond = _gradient(p, p.second, s.held_pressure)
    k, preload = p.gradient_bend, p.host_breakout * p.exact
    s.break_at, first = p.break_deflection, total
    if s.break_at > 0.0:
        s.break_at -= k * (preload + total * p.break_deflection)
        if s.break_at <= 0.0:  # the grip passes the break before the loader leaves neutral
            preload += (total - beyond) * p.break_deflection
            s.break_at, first = 0.0, beyond
    s.first = first / (1.0 - k * first) - p.host_gradient
    s.second = beyond / (1.0 - k * beyond) - p.host_gradient
    extra = (preload / (1.0 - k * first) - p.host_breakout) * p.exact
    s.preload = 0.0 if p.digital else extra
    if p.digital:
        s.product = product(s, read) + extra * np.sign(read)
    return total


@stage
def _grip(p: TwinParameters, s: TwinState, force: float, time: float) -> float:
    """Return the reading of the grip's transducer, m."""
    bend = p.bend * force + p.bend_uneven * abs(force) + p.bend_loop * s.loop
    if p.bend_limit > 0.0:
        bend = p.bend_limit * math.tanh(p.bend * force / p.bend_limit)
    if p.mode_rate > 0.0:
        bend = s.bent
    if p.bend_share > 0.0:
        bend -= p.bend_share * p.bend * (force - s.carried)
    true = (s.servo + s.touch if p.contact > 0.0 else s.grip) + bend
    if p.arc > 0.0:
        true = p.arc * math.sin(true / p.arc)
    return true + p.read_square * true * true + p.read_drift * time + p.deflection_zero


@stage
def _misses(p: TwinParameters, s: TwinState) -> bool:
    """Tell whether the host misses this frame, by a pseudorandom number."""
    if p.missed_share <= 0.0:
        return False
    s.random = math.sin(12.9898 * s.random + p.missed_seed) * 43758.5453 % 1.0
    return s.started != 0 and s.random < p.missed_share


@stage
def _surface(
    p: TwinParameters, s: TwinState, estimate: float, pressure: float, time: float
) -> float:
    """Return the surface's position about trim at the end of the frame, in command units."""
    asked = min(max(p.command_gain * estimate, -1.0), 1.0)
    asked *= 1.0 + p.surface_uneven * np.sign(asked)
    asked = np.sign(asked) * max(0.0, abs(asked) - p.dead_zone)
    s.lagged += p.lag_gain * (asked / (1.0 + p.stretch * pressure) - s.lagged)
    reach = p.rate_step if p.rate_step > 0.0 else math.inf
    s.moved += min(max(s.lagged - s.moved, -reach), reach)
    lost = s.moved - s.position
    if abs(lost) > 0.5 * p.surface_play:
        s.position += lost - math.copysign(0.5 * p.surface_play, lost)
    return s.position + p.surface_offset + p.flutter * math.sin(p.flutter_rate * time)


@entry
def twin_frame(
    parameters: NDArray[np.void],
    state: NDArray[np.void],
    nodes: Floats,
    others: Floats,
    row: Floats,
    k: int,
    pressure: float,
    load_factor: float,
) -> float:
    """Run frame k; return the surface command about trim.

    parameters, state  shape (1,)
    nodes, others      shape (frames·NODES + 1,): the pilot's force, and that on another control, N
    row                shape (7,): F, δc, δ, δ̂, G_T, F_mod, q̄; contains their noise on entry
    `pressure` is q̄ in Pa, `load_factor` +1 in level flight.
    """
    p, s = parameters[0], state[0]
    time = k * p.frame_s
    force = _force(nodes, float(k * NODES))
    stamped = _force(nodes, k * NODES - p.force_late / p.frame_s * NODES)
    row[6] += pressure
    loop = p.gauge_loop * s.loop
    read = row[0] + (p.force_scale * force + p.force_zero + loop)
    row[0] += p.force_scale * stamped + p.force_zero + loop
    row[1] += p.deflection_scale * (1.0 + p.scale_drift * time) * s.x
    if p.tone != 0.0:
        row[1] += p.tone * math.sin(p.tone_rate * time + p.tone_phase)
    row[2] += _grip(p, s, force, time)
    if _misses(p, s):
        row[4], row[3] = s.last_gradient, s.last_estimate
    else:
        row[4] = _host(p, s, row[6], row[1])
        row[3] = row[1] + p.estimate_bend * read
    s.last_gradient, s.last_estimate = row[4], row[3]
    row[5] += s.product if p.digital else product(s, s.x) + s.preload * mean_sign(s.x, s.x)
    command = _surface(p, s, row[3], pressure, time)
    s.started = 1
    h = p.frame_s / STEPS
    late = p.delay / p.frame_s * NODES
    constant = p.offset - p.bob_weight * (load_factor - 1.0)
    for step in range(STEPS):
        at = k * NODES + (step + 0.5) * NODES / STEPS
        pull = _force(nodes, at - late) + constant
        if p.crosstalk != 0.0:
            pull += p.crosstalk * _force(others, at - late)
        step_loader(p, s, pull, time + (step + 0.5) * h, h)
        before, s.heard = s.heard, heard(p, s, h)
        step_servo(p, s, before, s.heard, h)
        half = 0.5 * NODES / STEPS
        step_structure(p, s, _force(nodes, at - half), _force(nodes, at + half), h)
        step_loop(p, s, _force(nodes, at + half))
    return command
