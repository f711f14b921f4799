"""The loader with imposed motion: its reaction force, as on a test bench for dampers.

The loader's equations, solved for the force instead of the motion:

    F = m·x'' + c·x' + friction + breakout·sgn(x) + springs(x) + F_mod − F_offset + b·(n_z − 1)

If the motion of the grip is imposed, the linkage lies between it and the loader. The structure's
bend is a function of the measured force, and the servo's equation is solved for its command u, x
being the servo's position:

    x = δ − bend(F),     u + (2ζp/ω)·u' = x + (2ζ/ω)·x' + x''/ω²

Backlash lies between the imposed motion and the loader, which follows once the backlash is closed.
While it is open the force is zero, and the loader moves by its own springs against its damping. A
backlash with a contact stiffness also bends by F/stiffness.

Rigid friction holds a still loader, and one that turns, with any force up to its level, which the
motion does not determine: the answer is an interval. It is given a presliding of 1e-4 of the
travel, so that sensor noise at rest does not count as slip. The acceleration is the mean over a
frame about the sample, since the impact at the end of a backlash lasts no time and a sampled force
cannot contain it.
"""

from __future__ import annotations

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
from coupled.rig.events import sign
from coupled.rig.frame import set_product
from coupled.rig.friction import (
    added_friction,
    damping_along,
    deflect_bristles,
    running_friction,
)
from coupled.rig.inertia import set_inertia
from coupled.rig.loader import LoaderState, set_external, start_loader
from coupled.rig.modification import set_gradients
from coupled.rig.nodes import on_nodes
from coupled.rig.packing import pack
from coupled.rig.recorder import stamped
from coupled.rig.replay import bent_by
from coupled.rig.rig import Rig
from coupled.rig.springs import apply_modification, elastic, relax

Floats = NDArray[np.float64]
RIGID = 1e-4  # of the travel, presliding of a rigid contact here
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
    gradient: Floats,
    load_factor: Floats | None = None,
) -> Answer:
    """Return a control's reaction force to an imposed motion.

    `nodes` is the motion on the loader's nodes, d, `rig.substeps` for each frame and one more;
    `gradient` G_T in N/d at each frame, `load_factor` +1 in level flight. In an open backlash the
    force is exactly 0.
    """
    packed = pack(rig, only=control)
    p, s = packed["parameters"].copy(), packed["state"].copy()
    frames, h = len(gradient), 1.0 / (rig.frame_rate * rig.substeps)
    level = np.ones(frames) if load_factor is None else load_factor
    answer, mass = np.zeros((6, len(nodes))), np.zeros(frames)
    _answer(p, s, nodes, np.stack((gradient, level)), rig.substeps, h, answer, mass)
    # Of the substep that ends at node n: force without inertia, mean speed, whether in contact, by
    # how much friction at rest may hold less and more, and the side to which it slips.
    force, speed, touched, less, more, slips = answer
    half, last = max(1, rig.substeps // 2), len(nodes) - 1
    at = np.arange(frames) * rig.substeps
    before, after = np.clip(at - half + 1, 1, last - 1), np.clip(at + half, 2, last)
    accelerated = (speed[after] - speed[before]) / ((after - before) * h)
    share = _sampled(touched, at)
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


def _sampled(answer: Floats, at: NDArray[np.intp]) -> Floats:
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
    frames, N, which bends the structure, and `others_N` the forces on other controls. Backlash is
    left out: in it the loader's own motion decides (`answer_to`).
    """
    data = rig.controls[control]
    loader, length = data.loader, data.length
    true = read
    if loader.arc_geometry:
        true = length * np.arcsin(np.clip(read / length, -1.0, 1.0))
    place = true - bent_by(rig, control, force_N, others_N)
    if loader.play > 0.0 and loader.play_stiffness > 0.0:
        place = place - force_N / loader.play_stiffness
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
def _rubbing(p: ControlParameters, loader: LoaderState, dry: float, way: float, h: float) -> float:
    """Return the friction over a displacement in h seconds, N, and advance its contact."""
    rate = way / h
    if p.friction.stiffness > 0.0:
        loader.bent = deflect_bristles(p.friction, loader.bent, rate, way, loader.load)
        return p.friction.stiffness * loader.bent
    if p.friction.dry == 0:
        return 0.0
    most = running_friction(p.friction, rate) + added_friction(p.friction, loader.load, rate)
    return min(max(dry + most * way / (RIGID * p.loader.travel), -most), most)


@entry
def _answer(
    parameters: Any,
    states: Any,
    nodes: Floats,
    given: Floats,
    substeps: int,
    h: float,
    answer: Floats,
    mass: Floats,
) -> None:
    """Write force without inertia, N, speed, contact, friction's range and slip of each substep.

    And each frame's mass, kg.
    """
    p, s = parameters[0], states[0]
    m, loader = s.modification, s.loader
    start_loader(p.loader, loader, 0.0)
    loader.computed, half, dry = nodes[0], 0.5 * p.linkage.play, 0.0
    for k in range(len(mass)):
        set_gradients(p.modification, m, given[0, k], given[0, k])
        set_inertia(p.inertia, s.inertia, p.loader, loader, given[0, k])
        set_product(p, m, loader.computed, loader.computed)
        set_external(p.loader, loader, given[1, k])
        mass[k] = loader.mass
        for node in range(k * substeps + 1, min((k + 1) * substeps + 1, len(nodes))):
            if p.loader.held:
                apply_modification(p.loader, m, loader, loader.computed)
                apply_modification(p.loader, m, loader, loader.computed)
            held = elastic(p.loader, m, loader, loader.computed) + loader.relaxed - loader.external
            alone = loader.computed if half == 0.0 else _left_alone(p, loader, held, h)
            new = min(max(alone, nodes[node] - half), nodes[node] + half)
            way, loader.load = new - loader.computed, abs(answer[0, node - 1] + loader.external)
            dry = _rubbing(p, loader, dry, way, h)
            if p.loader.relaxing > 0.0:
                relax(p.loader, loader, way, h)
            loader.computed = new
            answer[1, node] = way / h
            if half == 0.0 or new != alone:  # else there is no contact
                breakout = p.loader.breakout + (0.0 if p.loader.held else m.breakout)
                answer[2, node] = 1.0
                force = elastic(p.loader, m, loader, new) + loader.relaxed - loader.external
                force += loader.damping * way / h + damping_along(p.friction, way / h)
                answer[0, node] = force + dry + breakout * sign(new)
                if p.friction.rigid:
                    holds = running_friction(p.friction, 0.0)
                    answer[3, node] = holds + added_friction(p.friction, loader.load, -1.0) + dry
                    answer[4, node] = holds + added_friction(p.friction, loader.load, 1.0) - dry
                    slips = running_friction(p.friction, way / h)
                    slips += added_friction(p.friction, loader.load, way / h)
                    answer[5, node] = sign(dry) if abs(dry) >= slips else 0.0
