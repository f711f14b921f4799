"""The loader with imposed motion: its reaction force, as on a test bench for dampers.

The loader's equations, solved for the force instead of the motion:

    F = m·x'' + c·x' + friction + breakout·sgn(x) + springs(x) + F_mod − F_offset + b·(n_z − 1)

If the motion of the grip is imposed, the linkage lies between it and the loader. The structure's
bend is a function of the measured force, and the servo's equation is solved for its command u, x
being the servo's position:

    x = δ − bend(F),     u + (2ζp/ω)·u' = x + (2ζ/ω)·x' + x''/ω²

Backlash lies between the imposed motion and the loader, which follows once the backlash is closed.
While it is open the force is zero, and the loader moves by its own springs against its damping.

A contact with a stiffness k, with a backlash or without, yields by z = δ − x. The force of its
spring and damper is that of the loader, of which the loader's mean speed u over a substep of h
seconds is found (implicit midpoint rule):

    k·(|z| − play/2)·sgn(z) + k·τ·z' = 2m·(u − v)/h + c·u + friction + breakout·sgn(x) + springs(x)
                                       + F_mod − F_offset + b·(n_z − 1)

The left side is 0 in the backlash, and a contact with a backlash does not pull. The damper is that
of a friction's contact, k·τ = 0.3·√(k·m), with τ at most that of the linkage, and h/8 of numerical
damping in addition. The right side increases with u, so that the solution is bracketed, and found
by regula falsi (Illinois).

Rigid friction holds a still loader, and one that turns, with any force up to its level, which the
motion does not determine: the answer is an interval. It is given a presliding of 1e-4 of the
travel, so that sensor noise at rest does not count as slip. The acceleration is the mean over a
frame about the sample, since the impact at the end of a backlash lasts no time and a sampled force
cannot contain it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import solve_banded
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from coupled.record.channels import ControlName
from coupled.rig.compiled import entry, stage
from coupled.rig.control import ControlParameters
from coupled.rig.declaration import Ends
from coupled.rig.events import sign
from coupled.rig.frame import set_product
from coupled.rig.friction import (
    CONTACT_DAMPING,
    added_friction,
    damping_along,
    deflect_bristles,
    running_friction,
)
from coupled.rig.hosted import NO_INPUTS, Feel, OtherInputs
from coupled.rig.linkage import CONTACT_s
from coupled.rig.loader import LoaderState, set_external, set_regressor, start_loader
from coupled.rig.modification import ModificationState
from coupled.rig.nodes import on_nodes
from coupled.rig.packing import pack
from coupled.rig.recorder import stamped
from coupled.rig.replay import bent_by, feel_as_recorded
from coupled.rig.rig import Rig
from coupled.rig.services import soft_stop_force
from coupled.rig.springs import apply_modification, elastic, relax, relaxing_mean

Floats = NDArray[np.float64]
Numbers = NDArray[np.intp]
SOLVES, SOLVED = 80, 1e-10  # most steps for a substep's speed, and their relative tolerance
DAMPED = 0.125  # of a substep: a stiff contact's error falls to 60 % in each
RIGID = 1e-4  # of the travel, presliding of a rigid contact here
NEIGHBOURS = 2  # frames to either side from which the acceleration at a frame is computed
REST_s = 0.25  # a loader that moves by less than that presliding within this time is at rest


class Answer(NamedTuple):
    """The reaction force in N at each frame to an imposed motion.

    `jumps` marks the frames within half a frame of which a backlash closes or opens, where the
    force jumps. At rest and within a frame of a turn rigid dry friction may hold any force from
    `least` to `most`, N; elsewhere both are `force`.
    """

    force: Floats
    jumps: NDArray[np.bool_]
    least: Floats
    most: Floats


def answer_to(
    rig: Rig,
    control: ControlName,
    nodes: Floats,
    feel: Feel,
    inputs: OtherInputs = NO_INPUTS,
) -> Answer:
    """Return a control's reaction force to an imposed motion.

    `nodes` is the motion on the loader's nodes, d, `rig.substeps` for each frame and one more. In
    an open backlash the force is exactly 0.
    """
    packed = pack(rig, only=control)
    p, s = packed["parameters"].copy(), packed["state"].copy()
    frames, h = len(feel.gradient), 1.0 / (rig.frame_rate * rig.substeps)
    answer, mass = np.zeros((6, len(nodes))), np.zeros(frames)
    _answer(p, s, nodes, feel.rows(), inputs.rows(frames), rig.substeps, h, answer, mass)
    # Of the substep that ends at node n: force without inertia, mean speed, whether in contact, by
    # how much friction at rest may hold less and more, and the side to which it slips.
    force, speed, touched, less, more, slips = answer
    half, last = max(1, rig.substeps // 2), len(nodes) - 1
    at = np.arange(frames) * rig.substeps
    before, after = np.clip(at - half + 1, 1, last - 1), np.clip(at + half, 2, last)
    accelerated = (speed[after] - speed[before]) / ((after - before) * h)
    share = _sampled(touched, at)
    accelerated += _lost_in_means(nodes, rig, at, before, after)
    answer = _sampled(force, at) + share * mass * accelerated
    turns = (slips[before] != slips[after]) | (slips[before] == 0.0)
    still = maximum_filter1d(turns, 3)
    still |= _at_rest(nodes[at], rig.frame_rate, RIGID * rig.controls[control].travel)
    return Answer(
        answer,
        touched[before] != touched[after],
        answer - still * share * _sampled(less, at),
        answer + still * share * _sampled(more, at),
    )


def _lost_in_means(nodes: Floats, rig: Rig, at: Numbers, before: Numbers, after: Numbers) -> Floats:
    """Return how much more the imposed motion accelerates at the frames than in the mean, d/s².

    The mean over a frame of the spline's acceleration is too small by (ωh)²/24 at a frequency ω;
    the five-point formula by (ωh)⁴/90. Impacts, which are in the loader's motion, stay means.
    """
    means = (nodes[after] - nodes[after - 1]) - (nodes[before] - nodes[before - 1])
    means *= (rig.frame_rate * rig.substeps) ** 2 / (after - before)
    second = np.zeros(len(at))
    second[1:-1] = np.diff(nodes[at], 2) * rig.frame_rate**2
    lost = np.zeros(len(at))
    lost[2:-2] = (second - means)[2:-2] - np.diff(second, 2)[1:-1] / 12.0
    return lost


def _sampled(answer: Floats, at: Numbers) -> Floats:
    """Return the mean of the substeps before and after each frame."""
    last = len(answer) - 1
    return np.asarray(0.5 * (answer[np.maximum(at, 1)] + answer[np.minimum(at + 1, last)]))


def _at_rest(way: Floats, rate_Hz: float, yields: float) -> NDArray[np.bool_]:
    """Return the frames that lie in `REST_s` within which a motion in d changes by less, d."""
    frames = 2 * max(1, round(0.5 * REST_s * rate_Hz)) + 1
    still = maximum_filter1d(way, frames) - minimum_filter1d(way, frames) < yields
    return np.asarray(maximum_filter1d(still, frames))


def behind_linkage(
    rig: Rig,
    control: ControlName,
    read: Floats,
    force_N: Floats,
    others_N: Mapping[str, Floats] | None = None,
) -> Floats:
    """Return the motion behind the linkage on the loader's nodes, d, from that of the grip.

    `read` is the transducer's reading of δ at the frames, d, without its zero; `force_N` F at the
    frames, N, which bends the structure, and `others_N` the forces on other controls. Backlash and
    its contact are left out: in them the loader's own motion decides (`answer_to`).
    """
    data = rig.controls[control]
    loader, length = data.loader, data.length
    true = read
    if loader.arc_geometry:
        true = length * np.arcsin(np.clip(read / length, -1.0, 1.0))
    place = true - bent_by(rig, control, force_N, others_N)
    nodes = on_nodes(rig, place)
    rate_Hz = rig.frame_rate * rig.substeps
    if loader.servo_frequency > 0.0:
        omega, ratio = 2.0 * np.pi * loader.servo_frequency, loader.servo_damping_ratio
        frames = np.arange(len(place))
        curve = CubicSpline(frames, place)
        speed = on_nodes(rig, curve(frames, 1) * rig.frame_rate)
        gained = on_nodes(rig, curve(frames, 2) * rig.frame_rate**2)
        nodes = nodes + 2.0 * ratio / omega * speed + gained / omega**2
        lag = 2.0 * ratio * loader.servo_rate_share / omega * rate_Hz  # in substeps
        if lag > 0.0:
            kept = np.exp(-1.0 / lag)
            # y[k] − kept·y[k−1] = (1 − kept)·x[k], at rest at the first node.
            bands = np.stack((np.ones(len(nodes)), np.full(len(nodes), -kept)))
            driven = (1.0 - kept) * nodes
            driven[0] = nodes[0]
            nodes = solve_banded((1, 0), bands, driven)
    return stamped(nodes, -loader.servo_delay * rate_Hz)


@stage
def _left_alone(p: ControlParameters, loader: LoaderState, held: float, h: float) -> float:
    """Return the position of a free loader after h seconds, d; `held` is its springs' force, N.

    Without damping, beyond any backlash.
    """
    most = p.friction.running
    net = held - min(max(held, -most), most)
    if loader.damping > 0.0:
        return loader.computed - net / loader.damping * h
    return loader.computed - p.linkage.play * sign(net)


@stage
def _most(p: ControlParameters, load: float, rate: float, side: float) -> float:
    """Return the friction's largest size at a rate in d/s, towards a side, N."""
    return running_friction(p.friction, rate) + added_friction(p.friction, load, side)


@stage
def _rubbing(p: ControlParameters, load: float, dry: float, way: float, h: float) -> float:
    """Return the friction after a displacement in h seconds, N; `dry` is that before, N."""
    rate, stiffness = way / h, p.friction.stiffness
    if stiffness > 0.0:
        return stiffness * deflect_bristles(p.friction, dry / stiffness, rate, way, load)
    if p.friction.dry == 0:
        return 0.0
    most = _most(p, load, rate, rate)
    return min(max(dry + most * way / (RIGID * p.loader.travel), -most), most)


@stage
def _smooth(
    p: ControlParameters,
    m: ModificationState,
    loader: LoaderState,
    x: float,
    rate: float,
) -> float:
    """Return the force against a motion at a place x, d, and rate, d/s, without friction, N.

    Without the relaxing spring.
    """
    breakout = p.loader.breakout + (0.0 if p.loader.held else m.breakout)
    force = elastic(p.loader, m, loader, x) - loader.external + breakout * sign(x)
    force += loader.damping * rate + damping_along(p.friction, rate)
    return force - soft_stop_force(p.services, x, rate)


@stage
def _beyond(
    p: ControlParameters,
    m: ModificationState,
    loader: LoaderState,
    dry: float,
    ends: Ends,
    u: float,
    h: float,
) -> tuple[float, float]:
    """Return the loader's force at a mean speed, N, and by how much it exceeds the contact's, N.

    `ends` are the imposed places before and after h seconds, d, `u` the loader's speed in d/s.
    """
    middle = loader.computed + 0.5 * u * h
    force = 2.0 * loader.mass * (u - loader.rate) / h + _smooth(p, m, loader, middle, u)
    force += _rubbing(p, loader.load, dry, u * h, h)
    if p.loader.relaxing > 0.0:
        kept, damping = relaxing_mean(p.loader, loader, h)
        force += kept + damping * u
    half, stretched = 0.5 * p.linkage.play, 0.5 * (ends[0] + ends[1]) - middle
    side = sign(stretched)
    pressed, rate = abs(stretched) - half, (ends[1] - ends[0]) / h - u
    damps = min(CONTACT_DAMPING * math.sqrt(loader.mass / p.linkage.contact), CONTACT_s)
    pull = p.linkage.contact * (pressed + (damps + DAMPED * h) * side * rate)
    if half > 0.0:
        pull = max(pull, 0.0) if pressed > 0.0 else 0.0
    return force, force - side * pull


@stage
def _speed_by_contact(
    p: ControlParameters,
    m: ModificationState,
    loader: LoaderState,
    dry: float,
    ends: Ends,
    h: float,
) -> float:
    """Return a loader's mean speed over h seconds behind a contact that yields, d/s."""
    u = loader.rate
    force, off = _beyond(p, m, loader, dry, ends, u, h)
    scale = abs(force) + abs(force - off)
    least = 2.0 * loader.mass / h + loader.damping
    other, beyond = u, off
    step = abs(off) / least
    for _ in range(SOLVES):
        if beyond * off <= 0.0:
            break
        other = u - sign(off) * step
        beyond = _beyond(p, m, loader, dry, ends, other, h)[1]
        step *= 4.0
    for _ in range(SOLVES):
        if off == 0.0 or abs(other - u) <= SOLVED * (abs(u) + abs(other)):
            break
        new = (off * other - beyond * u) / (off - beyond)
        now = _beyond(p, m, loader, dry, ends, new, h)[1]
        if abs(now) <= SOLVED * scale:
            return new
        if now * beyond < 0.0:
            u, off = other, beyond
        else:
            off *= 0.5
        other, beyond = new, now
    return u if abs(off) < abs(beyond) else other


@entry
def _answer(
    parameters: Any,
    states: Any,
    nodes: Floats,
    feel: Floats,
    inputs: Floats,
    substeps: int,
    h: float,
    answer: Floats,
    mass: Floats,
) -> None:
    """Write force without inertia, N, speed, contact, friction's range and slip of each substep.

    And each frame's mass, kg; 0 if the force includes the inertia, as that of a contact does.
    """
    p, s = parameters[0], states[0]
    m, loader = s.modification, s.loader
    start_loader(p.loader, loader, 0.0)
    loader.computed, half, dry = nodes[0], 0.5 * p.linkage.play, 0.0
    soft = p.linkage.contact > 0.0
    for k in range(len(mass)):
        feel_as_recorded(p, s, feel, k, False, loader.computed)
        set_product(p, m, loader.computed, loader.computed)
        set_external(p.loader, loader, inputs[0, k])
        set_regressor(p.loader, p.friction, loader, inputs[1, k])
        mass[k] = 0.0 if soft else loader.mass
        for node in range(k * substeps + 1, min((k + 1) * substeps + 1, len(nodes))):
            if p.loader.held:
                apply_modification(p.loader, m, loader, loader.computed)
                apply_modification(p.loader, m, loader, loader.computed)
            loader.load = abs(answer[0, node - 1] + loader.external)
            if soft:
                ends = (nodes[node - 1], nodes[node])
                u = _speed_by_contact(p, m, loader, dry, ends, h)
                way = u * h
                answer[0, node] = _beyond(p, m, loader, dry, ends, u, h)[0]
                stretched = 0.5 * (ends[0] + ends[1]) - loader.computed - 0.5 * way
                touches = half == 0.0 or abs(stretched) > half
                loader.rate = 2.0 * u - loader.rate
            else:
                held = elastic(p.loader, m, loader, loader.computed) + loader.relaxed
                held -= loader.external
                alone = loader.computed if half == 0.0 else _left_alone(p, loader, held, h)
                new = min(max(alone, nodes[node] - half), nodes[node] + half)
                way, touches = new - loader.computed, half == 0.0 or new != alone
            dry = _rubbing(p, loader.load, dry, way, h)
            middle, relaxed = loader.computed + 0.5 * way, loader.relaxed
            if p.loader.relaxing > 0.0:
                relax(p.loader, loader, way, h)
            loader.computed += way
            answer[1, node] = way / h
            if not touches:
                answer[0, node] = 0.0
                continue
            answer[2, node] = 1.0
            if not soft:
                answer[0, node] = _smooth(p, m, loader, middle, way / h)
                answer[0, node] += 0.5 * (relaxed + loader.relaxed) + dry
            if p.friction.rigid:
                answer[3, node] = dry + _most(p, loader.load, 0.0, -1.0)
                answer[4, node] = _most(p, loader.load, 0.0, 1.0) - dry
                slips = abs(dry) >= _most(p, loader.load, way / h, way / h)
                answer[5, node] = sign(dry) if slips else 0.0
            if soft:  # it carries the force of a turn, which is then determined
                answer[5, node] = 1.0
