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
from coupled.rig.compiled import long_entry, stage
from coupled.rig.control import ControlParameters, ControlState
from coupled.rig.frame import set_feel, set_product
from coupled.rig.hosted import (
    HOSTED,
    NO_INPUTS,
    Feel,
    Hosted,
    Mask,
    OtherInputs,
    held_over,
)
from coupled.rig.inertia import lead_force
from coupled.rig.linkage import advance_memory, deflection, move_linkage, start_bend, transducer
from coupled.rig.loader import move_loader, set_external, set_regressor, start_loader
from coupled.rig.modification import assume, assumed_bend
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
    computed: Floats | None = None,
) -> Floats:
    """Return G_T in N/d for the host's dynamic pressure at each frame.

    `beyond`: that beyond the break, on a rig of two segments; `missed` are the frames that the
    host missed, never the first. G_T of a curve is that at `computed`, δc about neutral as read, d.
    """
    p, s = _one(rig, control)
    ran = np.ones(len(pressure_Pa), dtype=np.bool_) if missed is None else ~missed
    place = np.zeros_like(pressure_Pa) if computed is None else computed
    made = _schedule(p, s, pressure_Pa[ran], place[ran], np.empty((2, int(ran.sum()))))
    return np.asarray(made[int(beyond), np.cumsum(ran) - 1])


def drive_loader(
    rig: Rig,
    control: str,
    nodes_N: Floats,
    feel: Feel,
    misread: Floats,
    inputs: OtherInputs = NO_INPUTS,
    restart: Restart | None = None,
    host: Hosted = HOSTED,
) -> tuple[Floats, Floats]:
    """Return δc in d and F_mod in N at each frame, with the force on the loader's nodes.

    `nodes_N` has `rig.substeps` values for each frame and one more, linear between. `misread` is
    the host's reading of δc less δc, d, for a digital product. The loader starts at rest at
    neutral; with `restart`, it is reset to measured states. The part of the services' force held by
    the host is constant over a frame, the rest follows the spline. A digital product keeps its last
    value in missed frames.
    """
    p, s = _one(rig, control)
    out = np.empty((2, len(misread)))
    h = 1.0 / (rig.frame_rate * rig.substeps)
    none = np.zeros_like(misread)
    begun, position, rate = (none, none, none) if restart is None else restart
    frames = len(misread)
    begins = (position, rate, *host.rows(frames), begun)
    rows = (*feel.rows(), misread, *inputs.rows(frames), *begins)
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
    feel: Feel,
    force_N: Floats,
    inputs: OtherInputs = NO_INPUTS,
    host: Hosted = HOSTED,
    others_N: Mapping[str, Floats] | None = None,
    restart: Restart | None = None,
) -> Floats:
    """Return the reading of the grip's transducer, d, from F alone: loader and linkage in series.

    `nodes_N` is the loader's input F in N on its nodes (with crosstalk), `force_N` F at the frames,
    which bends the structure. The other arguments are those of `drive_loader` and `replay_linkage`.
    δc is predicted, not measured, and the host reads it without error.
    """
    p, s = _one(rig, control)
    frames = len(force_N)
    h, none = 1.0 / (rig.frame_rate * rig.substeps), np.zeros(frames)
    begun, position, rate = (none, none, none) if restart is None else restart
    rows = (*feel.rows(), none, *inputs.rows(frames), position, rate, *host.rows(frames), begun)
    given = np.stack(rows).astype(np.float64)
    computed = np.empty((frames - 1) * rig.substeps + 1)
    served = _served(rig, p, nodes_N, host)
    _loader(p, s, nodes_N, served, given, rig.substeps, h, np.empty((2, frames)), computed)
    return drive_linkage(rig, control, computed, force_N, others_N)


def replay_product(
    rig: Rig,
    control: str,
    computed: Floats,
    feel: Feel,
    missed: Mask | None = None,
    assumed: Floats | None = None,
) -> Floats:
    """Return F_mod in N for δc in d about neutral at each frame.

    A digital product keeps its last value in the frames `missed` by the host. `assumed` is the
    difference of the host's K̂ in ΔG from the rig's, d/N.
    """
    p, s = _one(rig, control)
    computed, none = _contiguous(computed), np.zeros_like(computed)
    host = Hosted(missed=missed, assumed=assumed).rows(len(none))[3:]
    made = _product(p, s, computed, feel.rows(), np.stack(host), none)
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
    nodes, force_N = _contiguous(nodes), _contiguous(force_N)
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
    force_N = _contiguous(force_N)
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
    computed, force_N = _contiguous(computed), _contiguous(force_N)
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
    estimated, pressure_Pa = _contiguous(estimated), _contiguous(pressure_Pa)
    return _surface(p, s, estimated, pressure_Pa, np.empty_like(estimated))


def _contiguous(signal: Floats) -> Floats:
    """Return a signal in contiguous memory; for a column of a table kernels are compiled anew."""
    return np.ascontiguousarray(signal, dtype=np.float64)


def _one(rig: Rig, control: str) -> tuple[Any, Any]:
    """Return parameters and state of one control at rest, each of shape (1,)."""
    packed = pack(rig, only=control)
    return packed["parameters"], packed["state"]


@long_entry
def _schedule(p: Any, s: Any, pressure: Floats, computed: Floats, out: Floats) -> Floats:
    for k in range(len(pressure)):
        read = read_pressure(p[0].schedule, s[0].schedule, pressure[k])
        first, out[1, k] = gradients(p[0].schedule, read)
        out[0, k] = set_feel(p[0], s[0], first, out[1, k], 1.0, computed[k])
    return out


@stage
def feel_as_recorded(
    p: ControlParameters, s: ControlState, feel: Floats, k: int, missed: bool, computed: float
) -> None:
    """Set the feel of frame k from `Feel.rows`, at δc about neutral as the host read it, d."""
    if p.schedule.nodes > 0 and not missed:
        read_pressure(p.schedule, s.schedule, feel[2, k])
    set_feel(p, s, feel[0, k], feel[1, k], feel[3, k], computed)


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
    """Run the loader on the inputs `given`, shape (15, frames), and on forces at the nodes.

    `given`: `Feel.rows`, misread δc, `OtherInputs.rows`, restarts' δc and its rate, `Hosted.rows`,
    restarts. Write δc and F_mod at the frames to `out`, and δc at every node to `fine`, unless that
    is empty.
    """
    p, s = parameters[0], states[0]
    feel, misread, level, away = given[:4], given[4], given[5], given[6]
    position, rate, neutral, held = given[7], given[8], given[9], given[10]
    jammed, missed, assumed, begun = given[11], given[12], given[13], given[14]
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
        if missed[k] < 0.5:
            read = scaled_computed(p.sensing, s.loader.computed, k) + misread[k]
        feel_as_recorded(p, s, feel, k, missed[k] > 0.5, read - neutral[k])
        s.loader.neutral = neutral[k]
        out[1, k] = set_product(p, m, s.loader.computed - neutral[k], read - neutral[k])
        out[0, k] = s.loader.computed
        set_external(p.loader, s.loader, level[k])
        set_regressor(p.loader, p.friction, s.loader, away[k])
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
def _product(p: Any, s: Any, computed: Floats, feel: Floats, host: Floats, out: Floats) -> Floats:
    m, bend = s[0].modification, assumed_bend(p[0].modification)
    for k in range(len(out)):
        assume(p[0].modification, bend + host[1, k])
        feel_as_recorded(p[0], s[0], feel, k, host[0, k] > 0.5, computed[k])
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
