"""The twin's frame, compiled: the rig's equations once more, by other numerical means.

A trial that flies the library's own stages would test them against themselves. The twin
shares nothing with them but the description of the rig:

    loader    averaged vector field (the mean force over a step's path, so a preload that is
              passed within a step acts for its share), 128 steps a frame
    friction  LuGre (Canudas de Wit, Olsson, Åström and Lischinsky, IEEE TAC 40, 1995): bristles
              whose ODE is solved exactly over a step, and damping that fades with speed
    servo     fourth-order Runge–Kutta
    preload   a steep spring about neutral
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from coupled.blind.twin.numbers import TwinParameters, TwinState
from coupled.rig.compiled import entry, stage

Floats = NDArray[np.float64]
STEPS = 128  # of the loader in a frame
NODES = 8  # of the pilot's force in a frame, straight between
ROUNDS = 6  # of the implicit step's fixed point, which shrinks the error tenfold or more each
NEUTRAL_m = 2e-6  # the preload's spring is that wide on either side
FADE_m_per_s = 1e-3  # speed over which the bristles' damping fades


@stage
def _force(nodes: Floats, at: float) -> float:
    """Return the pilot's force at a time in nodes, N; it starts from 0 before the first."""
    if at <= 0.0:
        return float(nodes[0]) if at == 0.0 else 0.0
    low = min(int(at), len(nodes) - 2)
    return float(nodes[low] + (at - low) * (nodes[low + 1] - nodes[low]))


@stage
def _gradient(p: TwinParameters, table: Floats, pressure: float) -> float:
    """Return the schedule's answer with its slope and an outsider's tent and steps, N/m."""
    rows = p.knots
    rest = np.interp(0.0, p.pressures[:rows], table[:rows])
    found = float(rest + p.slope * (np.interp(pressure, p.pressures[:rows], table[:rows]) - rest))
    if p.tent_height != 0.0:
        found *= 1.0 + p.tent_height * max(0.0, 1.0 - abs(pressure - p.tent_at) / p.tent_width)
    if p.gradient_step > 0.0:
        found = p.gradient_step * math.floor(found / p.gradient_step + 0.5)
    return found


@stage
def _product(s: TwinState, x: float) -> float:
    """Return F_mod without its preload at δc = x, N."""
    beyond = abs(x) - s.break_at
    if s.break_at <= 0.0 or beyond <= 0.0:
        return s.first * x
    return s.first * x + (s.second - s.first) * beyond * (1.0 if x > 0.0 else -1.0)


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
        if s.break_at <= 0.0:  # the grip has passed the break before the loader leaves neutral
            preload += (total - beyond) * p.break_deflection
            s.break_at, first = 0.0, beyond
    s.first = first / (1.0 - k * first) - p.host_gradient
    s.second = beyond / (1.0 - k * beyond) - p.host_gradient
    extra = (preload / (1.0 - k * first) - p.host_breakout) * p.exact
    s.preload = 0.0 if p.digital else extra
    if p.digital:
        s.product = _product(s, read) + extra * np.sign(read)
    return total


@stage
def _mean_sign(x0: float, x1: float) -> float:
    """Return the mean over the way from x0 to x1 of the preload's sign, steep about 0."""
    if min(x0, x1) >= NEUTRAL_m:
        return 1.0
    if max(x0, x1) <= -NEUTRAL_m:
        return -1.0
    way = x1 - x0
    if abs(way) < 1e-4 * NEUTRAL_m:
        return min(max(0.5 * (x0 + x1) / NEUTRAL_m, -1.0), 1.0)
    a0, a1 = abs(x0), abs(x1)
    v0 = 0.5 * a0 * a0 / NEUTRAL_m if a0 < NEUTRAL_m else a0 - 0.5 * NEUTRAL_m
    v1 = 0.5 * a1 * a1 / NEUTRAL_m if a1 < NEUTRAL_m else a1 - 0.5 * NEUTRAL_m
    return (v1 - v0) / way


@stage
def _friction(
    p: TwinParameters, s: TwinState, v: float, force: float, h: float
) -> tuple[float, float]:
    """Return LuGre's mean force over a step at speed v, N, and the bristles after it, m."""
    level = p.running
    if p.breakaway > p.running:
        level += (p.breakaway - p.running) * math.exp(-((v / p.stribeck_rate) ** 2))
    level += p.load_friction * abs(force)
    if level <= 0.0 or p.bristle <= 0.0:
        return 0.0, 0.0
    most = level / p.bristle * (1.0 if v > 0.0 else -1.0)
    after = s.z if v == 0.0 else most + (s.z - most) * math.exp(-abs(v) * h / abs(most))
    fading = p.bristle_damping * math.exp(-((v / FADE_m_per_s) ** 2))
    return p.bristle * 0.5 * (s.z + after) + fading * (after - s.z) / h, after


@stage
def _loader(p: TwinParameters, s: TwinState, pull: float, time: float, h: float) -> None:
    """Advance δc by h seconds under the force `pull`, N, whose middle is at `time`, s."""
    x0, v0, z1 = s.x, s.v, s.z
    x1, v1 = x0 + h * v0, v0
    y1, w1 = s.second_x, s.second_v
    felt, lagged = s.felt, h / p.modifying_lag if p.modifying_lag > 0.0 else 0.0
    gradient = p.basic_gradient * (1.0 + p.gradient_drift * time)
    push = pull
    if p.hum_force != 0.0:
        push += p.hum_force * math.sin(p.hum_rate * time)
    for _ in range(ROUNDS):
        x, v, last = 0.5 * (x0 + x1), 0.5 * (v0 + v1), v1
        dry, z1 = _friction(p, s, v, pull, h)
        net = push - dry - (gradient + p.cubic * x * x) * x - p.damping * v
        wanted = s.product if p.digital else _product(s, x)
        side = _mean_sign(x0, x1)
        if lagged > 0.0:  # the trapezoidal rule
            wanted += s.preload * side
            felt = s.felt + lagged * (wanted - s.felt) / (1.0 + 0.5 * lagged)
            net -= 0.5 * (s.felt + felt)
            net -= p.breakout * side
        else:
            net -= wanted
            net -= (p.breakout + s.preload) * side
        net -= p.quadratic_damping * v * abs(v)
        if p.cog_force != 0.0:
            net -= p.cog_force * math.sin(2.0 * math.pi * x / p.cog_pitch)
        if p.second_mass > 0.0:
            y, w = 0.5 * (s.second_x + y1), 0.5 * (s.second_v + w1)
            tie = p.second_stiffness * (x - y) + p.second_damping * (v - w)
            net -= tie
            w1 = s.second_v + h * tie / p.second_mass
            y1 = s.second_x + 0.5 * h * (s.second_v + w1)
        v1 = v0 + h * net / p.mass
        x1 = x0 + 0.5 * h * (v0 + v1)
        if abs(v1 - last) < 1e-13:
            break
    s.z, s.second_x, s.second_v, s.felt = z1, y1, w1, felt
    s.x, s.v = min(max(x1, -p.travel), p.travel), v1
    if s.x != x1:
        s.v = 0.0


@stage
def _servo_slope(p: TwinParameters, wanted: float, x: float, v: float) -> tuple[float, float]:
    limit = p.servo_limit
    speed = min(max(v, -limit), limit) if limit > 0.0 else v
    return speed, p.servo_rate * (p.servo_rate * (wanted - x) - 2.0 * p.servo_ratio * speed)


@stage
def _servo(p: TwinParameters, s: TwinState, before: float, after: float, h: float) -> None:
    """Advance the servo by h seconds in which δc goes straight, and the play behind it."""
    x, v, middle = s.servo, s.servo_v, 0.5 * (before + after)
    a1, b1 = _servo_slope(p, before, x, v)
    a2, b2 = _servo_slope(p, middle, x + 0.5 * h * a1, v + 0.5 * h * b1)
    a3, b3 = _servo_slope(p, middle, x + 0.5 * h * a2, v + 0.5 * h * b2)
    a4, b4 = _servo_slope(p, after, x + h * a3, v + h * b3)
    s.servo = x + h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
    s.servo_v = v + h * (b1 + 2.0 * b2 + 2.0 * b3 + b4) / 6.0
    if p.servo_limit > 0.0:
        s.servo_v = min(max(s.servo_v, -p.servo_limit), p.servo_limit)
    lost = s.servo - s.grip
    if abs(lost) > 0.5 * p.play:
        s.grip += lost - math.copysign(0.5 * p.play, lost)


@stage
def _loop(p: TwinParameters, s: TwinState, force: float) -> None:
    """Advance a Bouc–Wen hysteresis in ±1, driven by the force at the grip."""
    step = (force - s.last_force) / p.loop_yield
    s.last_force = force
    s.loop += step - abs(s.loop) * (0.5 * step + 0.5 * abs(step) * np.sign(s.loop))


@stage
def _grip(p: TwinParameters, s: TwinState, force: float, time: float) -> float:
    """Return what the transducer at the grip reads, m."""
    bend = p.bend * force + p.bend_uneven * abs(force) + p.bend_loop * s.loop
    if p.bend_limit > 0.0:
        bend = p.bend_limit * math.tanh(p.bend * force / p.bend_limit)
    true = s.grip + bend
    if p.arc > 0.0:
        true = p.arc * math.sin(true / p.arc)
    return true + p.read_square * true * true + p.read_drift * time


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
    row: Floats,
    k: int,
    pressure: float,
    load_factor: float,
) -> float:
    """Run frame k; return the surface command about trim.

    parameters, state  shape (1,)
    nodes              shape (frames·NODES + 1,): the pilot's force, N
    row                shape (7,): F, δc, δ, δ̂, G_T, F_mod, q̄; comes holding their noise
    `pressure` is q̄ in Pa, `load_factor` +1 in level flight.
    """
    p, s = parameters[0], state[0]
    time = k * p.frame_s
    force = _force(nodes, float(k * NODES))
    row[6] += pressure
    row[0] += force + p.gauge_loop * s.loop
    row[1] += p.deflection_scale * s.x
    row[2] += _grip(p, s, force, time)
    row[4] = _host(p, s, row[6], row[1])
    row[5] += s.product if p.digital else _product(s, s.x) + s.preload * _mean_sign(s.x, s.x)
    row[3] = row[1] + p.estimate_bend * row[0]
    command = _surface(p, s, row[3], pressure, time)
    s.started = 1
    h = p.frame_s / STEPS
    late = p.delay / p.frame_s * NODES
    constant = p.offset - p.bob_weight * (load_factor - 1.0)
    for step in range(STEPS):
        at = k * NODES + (step + 0.5) * NODES / STEPS
        before = s.x
        _loader(p, s, _force(nodes, at - late) + constant, time + (step + 0.5) * h, h)
        _servo(p, s, before, s.x, h)
        _loop(p, s, _force(nodes, at + 0.5 * NODES / STEPS))
    return command
