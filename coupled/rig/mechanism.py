"""The loop over a frame: one control's hand, gauge, loader and linkage, node by node.

The order of a substep is that of the signal chain: the hand's force at the new node, the gauge, the
loader, the linkage, and the resulting motion of the grip.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.rig.command import take_set_point
from coupled.rig.compiled import seldom, stage
from coupled.rig.control import ControlParameters, ControlState
from coupled.rig.gauge import gauge_force, move_gauge
from coupled.rig.hand import command_force, hold, is_scripted, move_muscle
from coupled.rig.inertia import lead_force
from coupled.rig.linkage import advance_memory, move_linkage
from coupled.rig.loader import move_loader, set_external
from coupled.rig.modification import exchange_last
from coupled.rig.reach import bounds, set_reach, side_at_stop, stop_grip, stop_linkage, within_reach
from coupled.rig.sensing import sample
from coupled.rig.services import serve, set_base

Floats = NDArray[np.float64]


@stage
def set_hand(
    p: ControlParameters, s: ControlState, script: float, held: float, held_rate: float
) -> None:
    """Set the hand's force at a node from its script, N, and held deflection, d, with its rate."""
    h = p.clock.substep
    striving = command_force(p.hand, s.hand, p.linkage, s.linkage, script, held, held_rate, h)
    force = s.hand.commanded
    if p.reach.reach > 0.0:
        computed = s.loader.computed
        force = within_reach(p.reach, s.reach, p.linkage, s.linkage, computed, force)
        if force != s.hand.commanded:
            striving = 0.0  # no integral windup at the stop
    hold(p.hand, s.hand, p.linkage, s.linkage, force, striving, h)


@seldom
def force_given(p: ControlParameters, s: ControlState, force: float) -> float:
    """Return the loader's input from the hand's force at the next node, N."""
    if p.gauge.present:
        force = gauge_force(p.gauge, s.gauge, force)
    return lead_force(p.inertia, s.inertia, force) if p.inertia.rows > 0 else force


@seldom
def sample_channels(p: ControlParameters, s: ControlState, left: int, first: bool) -> None:
    """Sample δc and F by the host's converters, `left` substeps before the frame's end."""
    at_gauge = s.gauge.force if p.gauge.present else s.hand.force
    sample(p.sensing, s.sensing, s.loader.computed, at_gauge, left, first)


@stage
def begin_frame(p: ControlParameters, s: ControlState, load_factor: float) -> bool:
    """Set constants of the frame; return whether the hand applies its script only."""
    set_external(p.loader, s.loader, load_factor)
    s.loader.stop = 0
    take_set_point(p.linkage, s.linkage, s.loader.computed)
    if s.services.on:
        set_base(s.services, s.loader)
    stopped = p.reach.reach > 0.0
    if stopped:
        stages = (p.loader, p.friction, s.modification, s.loader, p.linkage, s.linkage)
        set_reach(p.reach, s.reach, *stages)
    if p.sensing.skewed:
        sample_channels(p, s, p.clock.substeps, True)
    if p.modification.late > 0:
        exchange_last(s.modification)
    return is_scripted(p.hand) and not stopped


@seldom
def run_node(
    p: ControlParameters,
    s: ControlState,
    force: Floats,
    held: Floats,
    first_node: int,
    node: int,
    scripted: bool,
) -> None:
    """Run hand, loader and linkage over the substep that ends at a node.

    `force` and `held` are the hand's script on the nodes of the whole flight, N and d; the frame
    began at `first_node`; `scripted`: the hand applies its script only.
    """
    h, stopped, late = p.clock.substep, p.reach.reach > 0.0, p.modification.late
    if late > 0 and node == first_node + 1 + late:
        exchange_last(s.modification)
    move_muscle(p.hand, s.hand)
    # The hand's impedance is that of the last node; its script is that of this one.
    before = s.loader.computed
    acting = s.hand.force
    if stopped and side_at_stop(s.reach, p.linkage, before) != 0:
        acting = s.hand.commanded  # before the stop takes its part
    ahead = acting + force[node] - force[node - 1]
    if p.gauge.present != 0 or p.inertia.rows > 0:
        ahead = force_given(p, s, ahead)
    ends = bounds(p.reach, s.reach, p.loader, p.linkage, before)
    if s.services.on:
        ends = serve(p.services, s.services, p.loader, s.loader, s.modification, ahead, ends, h)
    move_loader(p.loader, p.friction, s.modification, s.loader, ahead, ends, h)
    position, grip = s.linkage.position, s.linkage.grip
    move_linkage(p.linkage, s.linkage, before, s.loader.computed, h)
    if p.gauge.present:
        move_gauge(p.gauge, s.gauge, p.linkage, s.linkage, s.loader.computed)
    if scripted:
        s.hand.force = force[node] + s.hand.muscle
    else:
        if stopped:
            stop_linkage(s.reach, p.linkage, s.linkage, position, grip)
        rate = (held[node] - held[node - 1]) / h
        set_hand(p, s, force[node], held[node], rate)
    if p.linkage.carries:
        advance_memory(p.linkage, s.linkage, s.hand.force, h)
        if stopped:
            stop_grip(p.reach, p.linkage, s.linkage, s.hand.force)
    if p.sensing.skewed:
        sample_channels(p, s, first_node + p.clock.substeps - node, False)


@stage
def stands_alone(p: ControlParameters, s: ControlState) -> bool:
    """Tell whether a control consists of hand, loader and linkage only over a frame.

    No gauge in between, no services, no reach, no delay or memory of the force.
    """
    if p.gauge.present or p.inertia.rows > 0 or p.reach.reach > 0.0 or s.services.on:
        return False
    return not (p.linkage.carries or p.sensing.skewed or p.modification.late > 0)


@stage
def run_frame(
    p: ControlParameters,
    s: ControlState,
    force: Floats,
    held: Floats,
    first_node: int,
    load_factor: float,
) -> None:
    """Run hand, loader and linkage over a frame.

    `force` and `held` are the hand's script on the nodes of the whole flight, N and d.
    """
    scripted = begin_frame(p, s, load_factor)  # once a frame, not at every node
    last = first_node + p.clock.substeps
    if not stands_alone(p, s):
        for node in range(first_node + 1, last + 1):
            run_node(p, s, force, held, first_node, node, scripted)
        return
    # The same without optional stages, whose tests at every node take a fifth of the time.
    h, ends = p.clock.substep, (-p.loader.forward, p.loader.aft)
    for node in range(first_node + 1, last + 1):
        move_muscle(p.hand, s.hand)
        before = s.loader.computed
        ahead = s.hand.force + force[node] - force[node - 1]
        move_loader(p.loader, p.friction, s.modification, s.loader, ahead, ends, h)
        move_linkage(p.linkage, s.linkage, before, s.loader.computed, h)
        if scripted:
            s.hand.force = force[node] + s.hand.muscle
        else:
            set_hand(p, s, force[node], held[node], (held[node] - held[node - 1]) / h)
