"""Each stage alone, driven by its measured input, with the stage functions of a flight.

The chain is cut at every measured signal, so a fault upstream does not affect a stage. Signals are
given at the frames; continuous ones (force, δc) are interpolated by cubic splines (`nodes`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.rig.command import start_command, take_set_point
from coupled.rig.compensation import estimate
from coupled.rig.compiled import long_entry
from coupled.rig.frame import set_product
from coupled.rig.hosted import HOSTED, Hosted, Mask, held_over
from coupled.rig.inertia import lead_force, set_inertia
from coupled.rig.linkage import advance_memory, deflection, move_linkage, start_bend, transducer
from coupled.rig.loader import move_loader, set_external, start_loader
from coupled.rig.modification import assume, assumed_bend, set_gradients
from coupled.rig.nodes import on_nodes
from coupled.rig.packing import crossed_bends, pack
from coupled.rig.reach import bounds, set_reach
from coupled.rig.rig import Rig
from coupled.rig.schedule import gradients, read_pressure
from coupled.rig.sensing import scaled_computed
from coupled.rig.surface import command_surface

Floats = NDArray[np.float64]
# The frames of restarts, and δc in d and its rate in d/s at every frame.
Restart = tuple[Mask, Floats, Floats]


def replay_schedule(
    rig: Rig,
    control: str,
    pressure_Pa: Floats,
    beyond: bool = False,
    missed: Mask | None = None,
) -> Floats:
    """Return G_T in N/d for the host's dynamic pressure at each frame.

    `beyond`: that beyond the break, on a rig of two segments; `missed` are the frames that the
    host missed, never the first.
    """
    p, s = _one(rig, control)
    ran = pressure_Pa if missed is None else pressure_Pa[~missed]
    made = np.asarray(_schedule(p, s, ran, np.empty((2, len(ran))))[int(beyond)])
    return made if missed is None else made[np.cumsum(~missed) - 1]


def replay_loader(
    rig: Rig,
    control: str,
    force_N: Floats,
    gradient: Floats,
    misread: Floats,
    load_factor: Floats | None = None,
    second: Floats | None = None,
    restart: Restart | None = None,
) -> tuple[Floats, Floats]:
    """Return δc in d and F_mod in N at each frame.

    `gradient` is the schedule's G_T in N/d (`second` that beyond the break, if there is one),
    `misread` the host's reading of δc less δc, d, for a digital product. The loader starts at rest
    at neutral; with `restart`, it is reset to measured states.
    """
    nodes = on_nodes(rig, force_N)
    return drive_loader(rig, control, nodes, gradient, misread, load_factor, second, restart)


def drive_loader(
    rig: Rig,
    control: str,
    nodes_N: Floats,
    gradient: Floats,
    misread: Floats,
    load_factor: Floats | None = None,
    second: Floats | None = None,
    restart: Restart | None = None,
    host: Hosted = HOSTED,
) -> tuple[Floats, Floats]:
    """Return the same as `replay_loader`, with the force on the loader's nodes, linear between.

    `nodes_N` has `rig.substeps` values for each frame and one more. The part of the services' force
    held by the host is constant over a frame, the rest follows the spline. A digital product keeps
    its last value in missed frames. G_T is as given.
    """
    p, s = _one(rig, control)
    level = np.ones_like(misread) if load_factor is None else load_factor
    out = np.empty((2, len(misread)))
    h = 1.0 / (rig.frame_rate * rig.substeps)
    none = np.zeros_like(misread)
    begun, position, rate = (none, none, none) if restart is None else restart
    both = (gradient, gradient if second is None else second)
    rows = (*both, misread, level, position, rate, *host.rows(len(misread)), begun)
    served = _served(rig, p, nodes_N, host)
    _loader(p, s, nodes_N, served, np.stack(rows), rig.substeps, h, out, np.empty(0))
    return out[0], out[1]


def _served(rig: Rig, p: Any, nodes_N: Floats, host: Hosted) -> Floats:
    """Return the services' force that follows the motion, N at each node; set the cab's reach."""
    p[0]["reach"]["reach"] = host.reach
    following = host.following()
    return np.zeros_like(nodes_N) if following is None else on_nodes(rig, following)


def drive_series(
    rig: Rig,
    control: str,
    nodes_N: Floats,
    gradients: tuple[Floats, Floats | None],
    force_N: Floats,
    load_factor: Floats | None = None,
    host: Hosted = HOSTED,
    others_N: Mapping[str, Floats] | None = None,
    restart: Restart | None = None,
) -> Floats:
    """Return the reading of the grip's transducer, d, from F alone: loader and linkage in series.

    `nodes_N` is the loader's input F in N on its nodes (with crosstalk), `force_N` F at the frames,
    which bends the structure. `gradients` are G_T and that beyond the break. The other arguments
    are those of `drive_loader` and `replay_linkage`. δc is predicted, not measured, and the host
    reads it without error.
    """
    p, s = _one(rig, control)
    frames = len(force_N)
    level = np.ones(frames) if load_factor is None else load_factor
    h, none = 1.0 / (rig.frame_rate * rig.substeps), np.zeros(frames)
    gradient, second = gradients
    both = (gradient, gradient if second is None else second)
    begun, position, rate = (none, none, none) if restart is None else restart
    rows = (*both, none, level, position, rate, *host.rows(frames), begun)
    given = np.stack(rows).astype(np.float64)
    computed = np.empty((frames - 1) * rig.substeps + 1)
    served = _served(rig, p, nodes_N, host)
    _loader(p, s, nodes_N, served, given, rig.substeps, h, np.empty((2, frames)), computed)
    return drive_linkage(rig, control, computed, force_N, others_N)


def replay_product(
    rig: Rig,
    control: str,
    computed: Floats,
    gradient: Floats,
    second: Floats | None = None,
    missed: Mask | None = None,
    assumed: Floats | None = None,
) -> Floats:
    """Return F_mod in N for δc in d at each frame and G_T in N/d.

    A digital product keeps its last value in the frames `missed` by the host. `assumed` is the
    difference of the host's K̂ in ΔG from the rig's, d/N.
    """
    p, s = _one(rig, control)
    more = np.zeros_like(gradient) if assumed is None else assumed
    given = np.stack((gradient, gradient if second is None else second, more))
    made = _product(p, s, computed, given, np.empty_like(computed))
    return held_over(made, missed) if p[0]["modification"]["digital"] else made


def replay_linkage(
    rig: Rig,
    control: str,
    computed: Floats,
    force_N: Floats,
    others_N: Mapping[str, Floats] | None = None,
) -> Floats:
    """Return the reading of the grip's transducer, d, for δc in d and F in N.

    `others_N` are the forces on other controls of the same structure, at each frame.
    """
    return drive_linkage(rig, control, on_nodes(rig, computed), force_N, others_N)


def drive_linkage(
    rig: Rig,
    control: str,
    nodes: Floats,
    force_N: Floats,
    others_N: Mapping[str, Floats] | None = None,
) -> Floats:
    """Return the same as `replay_linkage`, with δc given on the loader's nodes."""
    p, s = _one(rig, control)
    h = 1.0 / (rig.frame_rate * rig.substeps)
    s[0]["linkage"]["position"] = s[0]["linkage"]["grip"] = nodes[0]
    bent = _by_others(rig, control, others_N or {}, 0, force_N)
    return _linkage(p, s, nodes, force_N, bent, rig.substeps, h, np.empty_like(force_N))


def bent_by(
    rig: Rig, control: str, force_N: Floats, others_N: Mapping[str, Floats] | None = None
) -> Floats:
    """Return the structure's bend in d at each frame under F in N, and the others' forces.

    With its hysteresis and its mode, and without the linkage's backlash.
    """
    p, s = _one(rig, control)
    p[0]["linkage"]["contact"] = 0.0
    h = 1.0 / (rig.frame_rate * rig.substeps)
    bent = _by_others(rig, control, others_N or {}, 0, force_N)
    return _bent(p, s, force_N, bent, rig.substeps, h, np.empty_like(force_N))


def replay_compensation(
    rig: Rig,
    control: str,
    computed: Floats,
    force_N: Floats,
    others_N: Mapping[str, Floats] | None = None,
    missed: Mask | None = None,
) -> Floats:
    """Return δ̂ in d for δc in d and F in N as the host read them, and the others' forces.

    It keeps its last value in the frames `missed` by the host.
    """
    p, _ = _one(rig, control)
    made = _compensation(p, computed, force_N, np.empty_like(force_N))
    return held_over(made + _by_others(rig, control, others_N or {}, 1, force_N), missed)


def _by_others(
    rig: Rig, control: str, others_N: Mapping[str, Floats], assumed: int, like: Floats
) -> Floats:
    """Return the bend by the others' forces at each frame, d, true or as assumed by the host."""
    names = [str(name) for name in rig.controls]
    row = crossed_bends(rig, control, names)[assumed]
    bent = np.zeros_like(like)
    for name, bend in zip(names, row, strict=True):
        if bend != 0.0 and name in others_N:
            bent += bend * others_N[name]
    return bent


def replay_surface(rig: Rig, control: str, estimated: Floats, pressure_Pa: Floats) -> Floats:
    """Return the command about trim, in ±1, over each frame, for δ̂ in d and q̄ in Pa."""
    p, s = _one(rig, control)
    return _surface(p, s, estimated, pressure_Pa, np.empty_like(estimated))


def _one(rig: Rig, control: str) -> tuple[Any, Any]:
    """Return parameters and state of one control at rest, each of shape (1,)."""
    packed = pack(rig, only=control)
    return packed["parameters"], packed["state"]


@long_entry
def _schedule(p: Any, s: Any, pressure: Floats, out: Floats) -> Floats:
    for k in range(len(pressure)):
        read = read_pressure(p[0].schedule, s[0].schedule, pressure[k])
        out[0, k], out[1, k] = gradients(p[0].schedule, read)
    return out


@long_entry
def _loader(
    parameters: Any,
    states: Any,
    force: Floats,
    served: Floats,
    given: Floats,
    substeps: int,
    h: float,
    out: Floats,
    fine: Floats,
) -> None:
    """Run the loader on the inputs `given`, shape (12, frames), and on forces at the nodes.

    `given`: G_T twice, misread δc, load factor, restarts' δc and its rate, `Hosted.rows`, restarts.
    Write δc and F_mod at the frames to `out`, and δc at every node to `fine`, unless that is empty.
    """
    p, s = parameters[0], states[0]
    gradient, misread, level, position, rate = given[:2], given[2], given[3], given[4], given[5]
    neutral, held, jammed, missed = given[6], given[7], given[8], given[9]
    assumed, begun = given[10], given[11]
    bend = assumed_bend(p.modification)
    start_loader(p.loader, s.loader, force[0])
    frames, read = len(misread), 0.0
    if len(fine) > 0:
        fine[0] = s.loader.computed
    for k in range(frames):
        m = s.modification
        if begun[k] > 0.5:
            s.loader.computed, s.loader.rate = position[k], rate[k]
        assume(p.modification, bend + assumed[k])
        set_gradients(p.modification, m, gradient[0, k], gradient[1, k])
        set_inertia(p.inertia, s.inertia, p.loader, s.loader, gradient[0, k])
        if missed[k] < 0.5:
            read = scaled_computed(p.sensing, s.loader.computed, k) + misread[k]
        s.loader.neutral = neutral[k]
        out[1, k] = set_product(p, m, s.loader.computed - neutral[k], read - neutral[k])
        out[0, k] = s.loader.computed
        set_external(p.loader, s.loader, level[k])
        if k + 1 < frames:
            base = s.loader.external
            s.loader.external = base + held[k]
            if p.reach.reach > 0.0:
                stages = (p.loader, p.friction, m, s.loader, p.linkage, s.linkage)
                set_reach(p.reach, s.reach, *stages)
            for node in range(k * substeps + 1, (k + 1) * substeps + 1):
                s.loader.external = base + held[k] + served[node]
                here = bounds(p.reach, s.reach, p.loader, p.linkage, s.loader.computed)
                if jammed[k] > 0.5:
                    here = (s.loader.computed, s.loader.computed)
                led = force[node]
                if p.inertia.rows > 0:
                    led = lead_force(p.inertia, s.inertia, led)
                move_loader(p.loader, p.friction, m, s.loader, led, here, h)
                if len(fine) > 0:
                    fine[node] = s.loader.computed


@long_entry
def _product(p: Any, s: Any, computed: Floats, given: Floats, out: Floats) -> Floats:
    m, bend = s[0].modification, assumed_bend(p[0].modification)
    for k in range(len(out)):
        assume(p[0].modification, bend + given[2, k])
        set_gradients(p[0].modification, m, given[0, k], given[1, k])
        out[k] = set_product(p[0], m, computed[k], computed[k])
    return out


@long_entry
def _linkage(
    parameters: Any,
    states: Any,
    computed: Floats,
    force: Floats,
    others: Floats,
    substeps: int,
    h: float,
    out: Floats,
) -> Floats:
    p, s = parameters[0].linkage, states[0].linkage
    start_bend(p, s, force[0])
    start_command(p, s, computed[0])
    for k in range(len(force)):
        s.others = others[k]
        out[k] = transducer(p, deflection(p, s, force[k]))
        take_set_point(p, s, computed[k * substeps])
        if k + 1 < len(force):
            for node in range(k * substeps, (k + 1) * substeps):
                move_linkage(p, s, computed[node], computed[node + 1], h)
                if p.carries:
                    share = (node + 1 - k * substeps) / substeps
                    advance_memory(p, s, force[k] + share * (force[k + 1] - force[k]), h)
    return out


@long_entry
def _bent(
    parameters: Any,
    states: Any,
    force: Floats,
    others: Floats,
    substeps: int,
    h: float,
    out: Floats,
) -> Floats:
    p, s = parameters[0].linkage, states[0].linkage
    start_bend(p, s, force[0])
    for k in range(len(force)):
        s.others = others[k]
        out[k] = deflection(p, s, force[k])
        if k + 1 < len(force) and p.carries:
            for node in range(1, substeps + 1):
                advance_memory(p, s, force[k] + node / substeps * (force[k + 1] - force[k]), h)
    return out


@long_entry
def _compensation(p: Any, computed: Floats, force: Floats, out: Floats) -> Floats:
    for k in range(len(out)):
        out[k] = estimate(p[0].compensation, computed[k], force[k])
    return out


@long_entry
def _surface(p: Any, s: Any, estimated: Floats, pressure: Floats, out: Floats) -> Floats:
    for k in range(len(out)):
        out[k] = command_surface(p[0].surface, s[0].surface, estimated[k], pressure[k])
    return out
