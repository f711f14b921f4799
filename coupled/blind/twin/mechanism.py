"""The twin's mechanism, compiled: loader, servo, backlash and structure, by methods of its own.

loader    averaged vector field (the mean force over a step's path, so that a preload passed within
          a step acts for its share), 128 steps a frame
friction  LuGre (Canudas de Wit, Olsson, Åström and Lischinsky, IEEE TAC 40, 1995): bristles whose
          ODE is solved exactly over a step, and damping that fades with speed; or elastoplastic
          (Dupont, Hayward, Armstrong and Altpeter, IEEE TAC 47, 2002): bristles that deflect by a
          share of their length before any slip, solved exactly too
servo     fourth-order Runge–Kutta, and likewise the structure's mode; its dead time uses the δc of
          past steps, linear between two
preload   a steep spring about neutral
relaxing  a spring in series with a damper, exact over a step
"""

from __future__ import annotations

import math

import numpy as np

from coupled.blind.twin.numbers import KEPT, TwinParameters, TwinState
from coupled.rig.compiled import stage

ROUNDS = 6  # fixed-point iterations of the implicit step; each reduces the error tenfold or more
NEUTRAL_m = 2e-6  # half width of the preload's spring
FADE_m_per_s = 1e-3  # speed over which the bristles' damping fades


@stage
def product(s: TwinState, x: float) -> float:
    """Return F_mod without its preload at δc = x, N."""
    beyond = abs(x) - s.break_at
    if s.break_at <= 0.0 or beyond <= 0.0:
        return s.first * x
    return s.first * x + (s.second - s.first) * beyond * (1.0 if x > 0.0 else -1.0)


@stage
def mean_sign(x0: float, x1: float) -> float:
    """Return the mean of the preload's sign, steep about 0, from x0 to x1."""
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
def _fading(p: TwinParameters, v: float) -> float:
    """Return the bristles' damping at speed v, N·s/m."""
    return p.bristle_damping * math.exp(-((v / FADE_m_per_s) ** 2))


@stage
def _bent(p: TwinParameters, most: float, z: float, way: float) -> tuple[float, float]:
    """Return elastoplastic bristles after a displacement, and their mean over it, m.

    In the direction of motion z rises with the displacement up to a share of `most`, and from there
    towards `most` by dz/dx = (most − z)/(most − share·most), which is solved exactly.
    """
    if way == 0.0:
        return z, z
    side = 1.0 if way > 0.0 else -1.0
    slips, soft = p.elastic_share * most, (1.0 - p.elastic_share) * most
    start, left, area = side * z, abs(way), 0.0
    if start < slips:
        straight = min(left, slips - start)
        area += straight * (start + 0.5 * straight)
        start += straight
        left -= straight
    if left > 0.0:
        lost = (most - start) * -math.expm1(-left / soft)
        area += most * left - soft * lost
        start += lost
    return side * start, side * area / abs(way)


@stage
def _relaxing(p: TwinParameters, s: TwinState, v: float, h: float) -> tuple[float, float]:
    """Return the mean force of the relaxing spring over a step at speed v, and after it, N."""
    if p.relaxing <= 0.0:
        return 0.0, 0.0
    steady = p.relaxing * p.relaxing_s * v
    faded = -math.expm1(-h / p.relaxing_s)
    after = s.relaxed + (steady - s.relaxed) * faded
    return steady + (s.relaxed - steady) * faded * p.relaxing_s / h, after


@stage
def _given(p: TwinParameters, force: float) -> float:
    """Return a modifying force limited to the actuator's."""
    if p.force_limit > 0.0:
        return min(max(force, -p.force_limit), p.force_limit)
    return force


@stage
def _friction(
    p: TwinParameters, s: TwinState, v: float, force: float, h: float
) -> tuple[float, float]:
    """Return LuGre's mean force over a step at speed v, N, and the bristles after it, m."""
    level = p.running
    if p.breakaway > p.running:
        level += (p.breakaway - p.running) * math.exp(-((v / p.stribeck_rate) ** 2))
    level += p.load_friction * abs(force)
    level += p.pull_friction if v > 0.0 else p.push_friction
    if level <= 0.0 or p.bristle <= 0.0:
        return 0.0, 0.0
    if p.elastic_share > 0.0:
        after, middle = _bent(p, level / p.bristle, s.z, v * h)
        return p.bristle * middle + _fading(p, v) * (after - s.z) / h, after
    most = level / p.bristle * (1.0 if v > 0.0 else -1.0)
    after = s.z if v == 0.0 else most + (s.z - most) * math.exp(-abs(v) * h / abs(most))
    return p.bristle * 0.5 * (s.z + after) + _fading(p, v) * (after - s.z) / h, after


@stage
def step_loader(p: TwinParameters, s: TwinState, pull: float, time: float, h: float) -> None:
    """Advance δc by h seconds under the force `pull`, N, whose middle is at `time`, s."""
    x0, v0, z1 = s.x, s.v, s.z
    x1, v1, relaxed = x0 + h * v0, v0, s.relaxed
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
        wanted = _given(p, s.product if p.digital else product(s, x))
        side = mean_sign(x0, x1)
        if lagged > 0.0:  # the trapezoidal rule
            wanted += s.preload * side
            felt = s.felt + lagged * (wanted - s.felt) / (1.0 + 0.5 * lagged)
            net -= 0.5 * (s.felt + felt)
            net -= p.breakout * side
        else:
            net -= wanted
            net -= (p.breakout + s.preload) * side
        net -= p.quadratic_damping * v * abs(v)
        pulled, relaxed = _relaxing(p, s, v, h)
        net -= pulled
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
    s.z, s.relaxed, s.second_x, s.second_v, s.felt = z1, relaxed, y1, w1, felt
    s.x, s.v = min(max(x1, -p.forward), p.aft), v1
    if s.x != x1:
        s.v = 0.0


@stage
def heard(p: TwinParameters, s: TwinState, h: float) -> float:
    """Store δc after a step of h seconds; return that of the servo's dead time ago, m.

    Before the start δc was at neutral.
    """
    if p.servo_delay <= 0.0:
        return s.x
    s.kept[s.stepped % KEPT] = s.x
    back = s.stepped - p.servo_delay / h
    earlier = math.floor(back)
    share = back - earlier
    s.stepped += 1
    before, after = s.kept[earlier % KEPT], s.kept[(earlier + 1) % KEPT]
    return float(before + share * (after - before))


@stage
def _servo_slope(p: TwinParameters, wanted: float, x: float, v: float) -> tuple[float, float]:
    limit = p.servo_limit
    speed = min(max(v, -limit), limit) if limit > 0.0 else v
    push = p.servo_rate * (p.servo_rate * (wanted - x) - 2.0 * p.servo_ratio * speed)
    if p.servo_push > 0.0:
        push = min(max(push, -p.servo_push), p.servo_push)
    return speed, push


@stage
def step_servo(p: TwinParameters, s: TwinState, before: float, after: float, h: float) -> None:
    """Advance the servo by h seconds with δc linear, and the backlash behind it."""
    if p.servo_rate > 0.0:
        _step_servo(p, s, before, after, h)
    else:
        s.servo, s.servo_v = after, (after - before) / h
    lost = s.servo - s.grip
    if abs(lost) > 0.5 * p.play:
        s.grip += lost - math.copysign(0.5 * p.play, lost)


@stage
def _step_servo(p: TwinParameters, s: TwinState, before: float, after: float, h: float) -> None:
    x, v, middle = s.servo, s.servo_v, 0.5 * (before + after)
    a1, b1 = _servo_slope(p, before, x, v)
    a2, b2 = _servo_slope(p, middle, x + 0.5 * h * a1, v + 0.5 * h * b1)
    a3, b3 = _servo_slope(p, middle, x + 0.5 * h * a2, v + 0.5 * h * b2)
    a4, b4 = _servo_slope(p, after, x + h * a3, v + h * b3)
    s.servo = x + h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
    s.servo_v = v + h * (b1 + 2.0 * b2 + 2.0 * b3 + b4) / 6.0
    if p.servo_limit > 0.0:
        s.servo_v = min(max(s.servo_v, -p.servo_limit), p.servo_limit)


@stage
def _mode_slope(p: TwinParameters, wanted: float, y: float, v: float) -> tuple[float, float]:
    return v, p.mode_rate * (p.mode_rate * (wanted - y) - 2.0 * p.mode_ratio * v)


@stage
def step_structure(p: TwinParameters, s: TwinState, before: float, after: float, h: float) -> None:
    """Advance the structure by h seconds with the force at the grip, N, linear."""
    if p.mode_rate > 0.0:
        y, v, middle = s.bent, s.bent_v, 0.5 * p.bend * (before + after)
        a1, b1 = _mode_slope(p, p.bend * before, y, v)
        a2, b2 = _mode_slope(p, middle, y + 0.5 * h * a1, v + 0.5 * h * b1)
        a3, b3 = _mode_slope(p, middle, y + 0.5 * h * a2, v + 0.5 * h * b2)
        a4, b4 = _mode_slope(p, p.bend * after, y + h * a3, v + h * b3)
        s.bent = y + h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        s.bent_v = v + h * (b1 + 2.0 * b2 + 2.0 * b3 + b4) / 6.0
    if p.bend_share > 0.0:
        half = 0.5 * p.bend_width
        s.carried = min(max(s.carried, after - half), after + half)
    if p.contact > 0.0:  # the force moves the grip against spring and damper of the contact
        lost = abs(s.touch) - 0.5 * p.play
        held = p.contact * math.copysign(lost, s.touch) if lost > 0.0 else 0.0
        s.touch += h * (0.5 * (before + after) - held) / (p.contact * p.contact_s)


@stage
def step_loop(p: TwinParameters, s: TwinState, force: float) -> None:
    """Advance a Bouc–Wen hysteresis in ±1, driven by the force at the grip."""
    step = (force - s.last_force) / p.loop_yield
    s.last_force = force
    s.loop += step - abs(s.loop) * (0.5 * step + 0.5 * abs(step) * np.sign(s.loop))
