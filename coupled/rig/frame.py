"""One frame of the rig, all controls together, in the order of the signal chain.

At t_k the host reads q̄, δc and F, sets ΔG and commands the surface. Over the following frame,
hand, loader and linkage are stepped at the loader's own rate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import ALPHA
from coupled.rig.compensation import estimate, misses
from coupled.rig.compiled import entry, seldom, stage
from coupled.rig.control import ControlArray, ControlParameters, ControlState
from coupled.rig.gauge import start_gauge
from coupled.rig.hand import is_scripted
from coupled.rig.inertia import set_inertia
from coupled.rig.joining import bend_by_others, leak_from_others
from coupled.rig.linkage import deflection, start_bend, transducer
from coupled.rig.loader import start_loader
from coupled.rig.mechanism import begin_frame, run_frame, run_node, set_hand
from coupled.rig.modification import (
    ModificationState,
    convert_curve,
    keep_last,
    local_gradient,
    modifying_force,
    set_curve,
    set_gradients,
)
from coupled.rig.reach import free, stop_again
from coupled.rig.schedule import gradients, read_pressure
from coupled.rig.sensing import converted, read_computed, read_force, read_grip
from coupled.rig.services import begin_services, commanded_deflection, note_services
from coupled.rig.surface import command_surface

Floats = NDArray[np.float64]

# Recorded by the kernel for each control, in this order; `record` names the channels.
CHANNELS_PER_CONTROL = 10
_ROUNDS = 24  # iterations for grips at their reach: terms of half the bends leave 1e-14 of a step


@stage
def set_feel(
    p: ControlParameters,
    s: ControlState,
    first: float,
    second: float,
    left: float,
    computed: float,
) -> float:
    """Set what the host makes of its schedule for the frame; return G_T at δc, N/d.

    `first` and `second` are the gradients in N/d of a schedule without a curve, `left` the share
    of the feel that has not failed, `computed` δc about neutral as the host read it, d. A curve is
    that at the schedule's pressure.
    """
    m = s.modification
    gradient = left * first
    set_gradients(p.modification, m, gradient, left * second)
    if p.schedule.nodes > 0:
        set_curve(p.modification, m, p.schedule, s.schedule.pressure, left)
        gradient = local_gradient(p.modification, m, computed)
    set_inertia(p.inertia, s.inertia, p.loader, s.loader, gradient)
    return gradient


@stage
def set_product(
    p: ControlParameters, m: ModificationState, computed: float, computed_read: float
) -> float:
    """Set F_mod for the frame, through the host's converter, and return it at t_k in N.

    A digital host sends the product with δc as it reads it, to be held. A hybrid one sends ΔG, and
    the multiplier uses the electronics' v₁, whose scale is included in ΔG by `set_gradients`
    (figure 5).
    """
    if p.modification.digital:
        product = modifying_force(m, computed_read)
        m.held = converted(product, p.sensing.product_step, p.sensing.product_range)
        return m.held
    step, full = p.sensing.gradient_step, p.sensing.gradient_range
    if m.curved:
        convert_curve(m, step, full)
        return modifying_force(m, computed)
    m.first = converted(m.first, step, full)
    m.second = converted(m.second, step, full)
    return modifying_force(m, computed)


@stage
def sampled_force(p: ControlParameters, s: ControlState) -> float:
    """Return the force in the host's converter at t_k: the gauge's, as sampled, N."""
    if p.sensing.skewed:
        return s.sensing.force
    return s.gauge.force if p.gauge.present else s.hand.force


@stage
def host_frame(
    p: ControlParameters,
    s: ControlState,
    force: float,
    pressure_read: float,
    pressure: float,
    out: Floats,
) -> float:
    """Run host and recorder at t_k; return the surface command over the frame.

    `out` are the channels of one control: F, δc, δ, δ̂, G_T, F_mod, the jump of F_mod here, the
    surface command, the stop reached since the last frame, and the hand's own force. On entry it
    contains the noise of each. The first F is the strain gauge's reading.
    """
    computed, neutral = s.loader.computed, s.loader.neutral
    m = s.modification
    ended = m.held if p.modification.digital else modifying_force(m, computed - neutral)

    sampled = s.sensing.computed if p.sensing.skewed else computed
    force_read = read_force(p.sensing, sampled_force(p, s), out[0])
    computed_read = read_computed(p.sensing, sampled, m.frames, out[1])
    if p.modification.late > 0:
        keep_last(m)
    host = s.compensation
    missed = misses(p.compensation, host)
    if not missed:
        read = read_pressure(p.schedule, s.schedule, pressure_read)
        host.first, host.second = gradients(p.schedule, read)
        host.computed = computed_read
    left = 1.0 - s.services.feel_lost if s.services.on else 1.0
    gradient = set_feel(p, s, host.first, host.second, left, host.computed - neutral)
    product = set_product(p, m, computed - neutral, host.computed - neutral)
    if not missed:
        bent = estimate(p.compensation, computed_read, force_read)
        host.estimated = bent + s.crossing.estimated
    estimated = host.estimated
    commanded = (
        commanded_deflection(p.services, s.services, estimated) if s.services.on else estimated
    )
    command = command_surface(p.surface, s.surface, commanded, pressure)

    out[0] = force_read
    out[1] = computed_read
    out[2] += p.sensing.deflection_zero
    at_grip = transducer(p.linkage, deflection(p.linkage, s.linkage, force))
    out[2] += read_grip(p.sensing, at_grip, force)
    out[3] = estimated
    out[4] = gradient
    out[5] += product
    out[6] = product - ended
    out[7] = command
    out[8] = s.loader.stop
    out[9] = force
    if s.services.on:
        note_services(s.services, s.loader)
    return command


@stage
def angle_of_attack(motion: tuple[float, ...]) -> float:
    """Return α of a motion, rad; 0 on a bench, whose motion has none."""
    alpha = 0.0
    for i in range(len(motion)):  # a constant index beyond a bench's motion would not compile
        if i == ALPHA:
            alpha = motion[i]
    return alpha


@stage
def serve_frame(controls: ControlArray, motion: tuple[float, ...], load_factor: float) -> None:
    """Set the hosts' services for the frame."""
    for i in range(len(controls)):
        p, s = controls[i].parameters.services, controls[i].state.services
        if s.on:
            begin_services(p, s, motion[0], load_factor, angle_of_attack(motion))


@seldom
def read_others(controls: ControlArray, row: Floats) -> None:
    """Read all forces at t_k for the hosts' estimates: Σ_j K̂_ij·F_j. The row has the noise."""
    for j in range(len(controls)):
        p, s = controls[j].parameters, controls[j].state
        noise = row[1 + CHANNELS_PER_CONTROL * j]
        s.crossing.read = read_force(p.sensing, sampled_force(p, s), noise)
    for i in range(len(controls)):
        assumed, added = controls[i].parameters.crossing.assumed, 0.0
        for j in range(len(controls)):
            added += assumed[j] * controls[j].state.crossing.read
        controls[i].state.crossing.estimated = added


@seldom
def run_joined(controls: ControlArray, script: Floats, k: int, load_factor: float) -> None:
    """Run all controls of a common structure over frame k, node by node."""
    substeps = controls[0].parameters.clock.substeps
    begun = k * substeps
    for i in range(len(controls)):
        begin_frame(controls[i].parameters, controls[i].state, load_factor)
    for node in range(begun + 1, begun + substeps + 1):
        for i in range(len(controls)):
            p, s = controls[i].parameters, controls[i].state
            bend_by_others(controls, i)
            leak_from_others(controls, i, script, node)
            scripted = is_scripted(p.hand) and p.reach.reach == 0.0
            run_node(p, s, script[i, 0], script[i, 1], begun, node, scripted)
    settle_others(controls)


@seldom
def settle_others(controls: ControlArray) -> None:
    """Update the controls of a common structure to all forces at the frame's end.

    A grip at its reach is stopped again, which changes its force and thereby the others' position:
    Gauss-Seidel iterations, which converge for every passive structure.
    """
    reaches = False
    for i in range(len(controls)):
        bend_by_others(controls, i)
        reaches = reaches or controls[i].parameters.reach.reach > 0.0
    for _ in range(_ROUNDS if reaches else 0):
        for i in range(len(controls)):
            p, s = controls[i].parameters, controls[i].state
            bend_by_others(controls, i)
            if p.reach.reach > 0.0:
                at = s.loader.computed
                stop_again(p.reach, s.reach, p.linkage, s.linkage, s.hand, at)


@seldom
def start_controls(controls: ControlArray, script: Floats) -> None:
    """Start with each hand on its grip: gauge, delay and structure have its first force."""
    for i in range(len(controls)):
        p, s = controls[i].parameters, controls[i].state
        free(s.reach)
        set_hand(p, s, script[i, 0, 0], script[i, 1, 0], 0.0)
    for i in range(len(controls)):
        p, s = controls[i].parameters, controls[i].state
        leak_from_others(controls, i, script, 0)
        start_loader(p.loader, s.loader, start_gauge(p.gauge, s.gauge, s.hand.force))
        s.sensing.force = s.gauge.force if p.gauge.present else s.hand.force
        start_bend(p.linkage, s.linkage, s.hand.force)


@stage
def host_frames(
    controls: ControlArray, row: Floats, motion: tuple[float, ...]
) -> tuple[float, float, float]:
    """Run host and recorder at t_k for all controls; return the surface commands."""
    first_command = second_command = third_command = 0.0
    pressure_at = 1 + CHANNELS_PER_CONTROL * len(controls)
    # Copied here, not after the flight, so that a frame allocates no object.
    for i in range(min(len(motion), len(row) - pressure_at)):
        row[pressure_at + i] += motion[i]
    if controls[0].parameters.crossing.joined != 0:
        for i in range(len(controls)):
            bend_by_others(controls, i)
        read_others(controls, row)
    for i in range(len(controls)):
        p, s = controls[i].parameters, controls[i].state
        first = 1 + CHANNELS_PER_CONTROL * i
        out = row[first : first + CHANNELS_PER_CONTROL]
        command = host_frame(p, s, s.hand.force, row[pressure_at], motion[0], out)
        if i == 0:
            first_command = command
        elif i == 1:
            second_command = command
        else:
            third_command = command
    return first_command, second_command, third_command


@stage
def run_loaders(controls: ControlArray, script: Floats, k: int, load_factor: float) -> None:
    """Run hand, loader and linkage of all controls over frame k, after its host."""
    if controls[0].parameters.crossing.joined != 0:
        run_joined(controls, script, k, load_factor)
        return
    for i in range(len(controls)):
        p, s = controls[i].parameters, controls[i].state
        run_frame(p, s, script[i, 0], script[i, 1], k * p.clock.substeps, load_factor)


@entry
def step_frame(
    controls: ControlArray,
    script: Floats,
    record: Floats,
    k: int,
    motion: tuple[float, ...],
    load_factor: float,
) -> tuple[float, float, float]:
    """Run frame k of all controls, write row k without its time, return the surface commands.

    controls  shape (n,), n ≤ 3
    script    shape (n, 2, frames·substeps + 1): the hand's force in N and held deflection
    record    shape (frames, channels): t, 10 for each control, the motion; on entry it contains
              the noise of the readings
    motion    of the airframe at t_k, q̄ in Pa first; the record takes as many channels as it has
    The commands are in ±1, one for each control, 0 for a missing control.
    """
    if k == 0:
        start_controls(controls, script)
    serve_frame(controls, motion, load_factor)
    commands = host_frames(controls, record[k], motion)
    run_loaders(controls, script, k, load_factor)
    return commands
