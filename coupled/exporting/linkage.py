"""The linkage as JSBSim components: servo, backlash, bend and hand (`rig/linkage`, `rig/hand`).

The servo's map over a substep is exact, like the rig's own: its weights are computed in every run
from JSBSim's step, so that the system is valid at any rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from coupled.exporting.controlexport import ControlExport
from coupled.exporting.expression import (
    Expr,
    cosine,
    either,
    exponential,
    less,
    sine,
    within,
)
from coupled.exporting.loader import Motion


@dataclass(frozen=True)
class Grip:
    """Positions of servo and grip, d and d/s, and the hand's force and its integral, N."""

    position: Expr
    rate: Expr
    grip: Expr
    force: Expr
    integral: Expr
    carried: Expr | None = None  # the force behind the bend's play, N


def add_weights(made: ControlExport) -> None:
    """Add the servo's weights for a δc linear over a substep (`servo_weights`)."""
    loader, system, h = made.control.loader, made.system, made.own("step-s")
    if loader.servo_frequency == 0.0:
        return
    w, z = 2.0 * math.pi * loader.servo_frequency, loader.servo_damping_ratio
    system.channel("servo's weights", "x'' = ω²·(δc − x) − 2ζω·x', stepped exactly")
    decay = exponential(-z * w * h)
    turn = w * math.sqrt(abs(1.0 - z * z))
    if turn < 1e-3 * w:
        wave, swing = decay, decay * h
    elif z < 1.0:
        wave, swing = decay * cosine(turn * h), decay * sine(turn * h) / turn
    else:
        ahead, behind = exponential((turn - z * w) * h), exponential((-turn - z * w) * h)
        wave, swing = 0.5 * (ahead + behind), (ahead - behind) / (2.0 * turn)
    wave, swing = system.add("servo/wave", wave), system.add("servo/swing", swing)
    lag = 2.0 * z / w
    own = system.add("servo/x-by-x", wave + z * w * swing)
    after = system.add("servo/x-by-after", (h - lag + lag * own - swing) / h)
    system.add("servo/x-by-before", 1.0 - own - after)
    back = system.add("servo/v-by-x", -w * w * swing)
    speed = system.add("servo/v-by-v", wave - z * w * swing)
    after = system.add("servo/v-by-after", (1.0 + lag * back - speed) / h)
    system.add("servo/v-by-before", -1.0 * back - after)


def add_servo(made: ControlExport, place: str, was: Motion, now: Motion, grip: Grip) -> Grip:
    """Add one substep of servo and backlash; the hand's part is unchanged."""
    system, loader, own = made.system, made.control.loader, made.own
    x, v = grip.position, grip.rate
    if loader.servo_frequency == 0.0:
        position, rate = now.computed, (now.computed - was.computed) / own("step-s")
    else:
        position = own("servo/x-by-x") * x + own("servo/swing") * v
        position = position + own("servo/x-by-before") * was.computed
        position = position + own("servo/x-by-after") * now.computed
        rate = own("servo/v-by-x") * x + own("servo/v-by-v") * v
        rate = rate + own("servo/v-by-before") * was.computed
        rate = rate + own("servo/v-by-after") * now.computed
    limit = loader.servo_rate_limit
    if limit > 0.0:
        step = limit * own("step-s")
        position, rate = within(position, x - step, x + step), within(rate, -limit, limit)
    moved = system.add(f"{place}/servo", position)
    moving = system.add(f"{place}/servo-rate", rate)
    at = moved
    if loader.play > 0.0:
        half = 0.5 * loader.play
        at = system.add(f"{place}/grip", within(grip.grip, moved - half, moved + half))
    return Grip(moved, moving, at, grip.force, grip.integral, grip.carried)


def bend(made: ControlExport, force: Expr) -> Expr:
    """Return the structure's bend under a force, d, with its switch."""
    loader = made.control.loader
    limit = loader.bend_limit
    bent = _compliance(made, force) * force
    if limit > 0.0:  # tanh(y) = 1 − 2/(exp(2y) + 1)
        turned = 2.0 / (exponential((2.0 / limit) * bent) + 1.0)
        bent = limit * (1.0 - turned)
    return made.own("bend") * bent


def _compliance(made: ControlExport, force: Expr) -> Expr:
    loader = made.control.loader
    push = loader.bend if loader.bend_push is None else loader.bend_push
    return either(less(force, 0.0), push, loader.bend)


def _slope(made: ControlExport, force: Expr) -> Expr:
    """Return the bend's derivative by force, d/N; that of the whole bend with hysteresis."""
    compliance, limit = _compliance(made, force), made.control.loader.bend_limit
    if limit > 0.0:  # 1/cosh²(y) = 4·e/(e + 1)², e = exp(2y)
        e = exponential((2.0 / limit) * compliance * force)
        compliance = 4.0 * compliance * e / ((e + 1.0) * (e + 1.0))
    return made.own("bend") * compliance


def deflection(made: ControlExport, grip: Expr, force: Expr, carried: Expr | None) -> Expr:
    """Return δ at the grip under a force, d."""
    loader = made.control.loader
    bent = bend(made, force)
    if carried is not None:
        share = loader.bend_hysteresis_share
        behind = _carried(made, carried, force)
        bent = (1.0 - share) * bent + share * bend(made, behind)
    return grip + bent


def _carried(made: ControlExport, carried: Expr, force: Expr) -> Expr:
    half = 0.5 * made.control.loader.bend_hysteresis_width
    return within(carried, force - half, force + half)


def add_hand(made: ControlExport, place: str, script: Expr, target: Expr, grip: Grip) -> Grip:
    """Add the hand's force at the end of a substep: the given force, and that of holding.

    `script` is the given force there, N, `target` the position at which the hand holds the grip, d.
    The bend's local slope is taken implicitly, as in `rig/hand`.
    """
    system, own, h = made.system, made.own, made.own("step-s")
    hold, damping = own("hand/stiffness-now"), own("hand/damping-now")
    at = deflection(made, grip.grip, grip.force, grip.carried)
    error = system.add(f"{place}/hand-error", target - at)
    asked = script + hold * error + grip.integral
    asked = asked + damping * (own("hand/target-rate") - grip.rate)
    implicit = 1.0 + _slope(made, grip.force) * (hold + damping / h)
    change = system.add(f"{place}/hand-change", (asked - grip.force) / implicit)
    held = own("hand/integral-now") * h * (error - _slope(made, grip.force) * change)
    force = system.add(f"{place}/force", grip.force + change)
    integral = system.add(f"{place}/hand-integral", own("hand") * (grip.integral + held))
    carried = grip.carried
    if carried is not None:
        carried = system.add(f"{place}/carried", _carried(made, carried, force))
    return Grip(grip.position, grip.rate, grip.grip, force, integral, carried)


def begin(made: ControlExport) -> Grip:
    """Return servo and grip at the end of the run before."""
    add, kept = made.system.add, made.kept
    hysteresis = made.control.loader.bend_hysteresis_share > 0.0
    position = add("step-0/servo", kept(f"servo-{made.d}"))
    return Grip(
        position,
        add("step-0/servo-rate", kept("servo-rate")),
        add("step-0/grip", kept(f"grip-{made.d}")) if made.control.loader.play > 0.0 else position,
        add("step-0/force", kept("force-held-N")),
        add("step-0/hand-integral", kept("hand-integral-N")),
        add("step-0/carried", kept("carried-N")) if hysteresis else None,
    )
