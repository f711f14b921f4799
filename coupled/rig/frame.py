"""One frame of the rig, all controls together, in the order of the signal chain.

At t_k the host reads q̄, δc and F, sets ΔG and commands the surface; over the frame
that follows, hand, loader and linkage run on at the loader's own rate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compensation import estimate
from coupled.rig.compiled import carray, entry, pointer, stage
from coupled.rig.control import CONTROL, ControlArray, ControlParameters, ControlState
from coupled.rig.hand import ask, hold, move_muscle, only_scripted
from coupled.rig.linkage import carry_bend, deflection, move_linkage, transducer
from coupled.rig.loader import move_loader, set_external, start_delay
from coupled.rig.modification import ModificationState, modifying_force, set_gradients
from coupled.rig.reach import bounds, free, seated, set_reach, stop_linkage, within_reach
from coupled.rig.schedule import gradients, read_pressure
from coupled.rig.sensing import converted, read_computed, read_force
from coupled.rig.surface import command_surface

Floats = NDArray[np.float64]

# What the kernel records of each control, in this order; `record` names the channels.
CHANNELS_PER_CONTROL = 10


@stage
def set_product(
    p: ControlParameters, m: ModificationState, computed: float, computed_read: float
) -> float:
    """Set F_mod for the frame, through the host's converter, and return it at t_k in N.

    A digital host sends the product of δc as it reads it, to be held; a hybrid one sends ΔG,
    and the multiplier takes v₁ as the electronics make it of δc, whose scale `set_gradients`
    has in ΔG (figure 5).
    """
    if p.modification.digital:
        product = modifying_force(m, computed_read)
        m.held = converted(product, p.sensing.product_step, p.sensing.product_range)
        return m.held
    step, full = p.sensing.gradient_step, p.sensing.gradient_range
    m.first = converted(m.first, step, full)
    m.second = converted(m.second, step, full)
    return modifying_force(m, computed)


@stage
def host_frame(
    p: ControlParameters,
    s: ControlState,
    force: float,
    pressure_read: float,
    pressure: float,
    out: Floats,
) -> float:
    """Do what host and recorder do at t_k; return the surface command over the frame.

    `out` are the channels of one control: F, δc, δ, δ̂, G_T, F_mod, the step that F_mod makes
    here, the surface command, the stop met since the last frame, and the hand's own force. It
    comes holding the noise of each: the first F is what the strain gauge reads.
    """
    computed = s.loader.computed
    m = s.modification
    ended = m.held if p.modification.digital else modifying_force(m, computed)

    force_read = read_force(p.sensing, force, out[0])
    computed_read = read_computed(p.sensing, computed, out[1])
    first, second = gradients(p.schedule, read_pressure(p.schedule, s.schedule, pressure_read))
    set_gradients(p.modification, m, first, second)
    product = set_product(p, m, computed, computed_read)
    estimated = estimate(p.compensation, computed_read, force_read) + s.crossing.estimated
    command = command_surface(p.surface, s.surface, estimated, pressure)

    out[0] = force_read
    out[1] = computed_read
    out[2] += transducer(p.linkage, deflection(p.linkage, s.linkage, force))
    out[3] = estimated
    out[4] = first
    out[5] += product
    out[6] = product - ended
    out[7] = command
    out[8] = s.loader.stop
    out[9] = force
    return command


@stage
def set_hand(
    p: ControlParameters, s: ControlState, script: float, held: float, held_rate: float
) -> None:
    """Set the hand's force at a node for a script in N, and a held deflection in d and its rate."""
    h = p.clock.substep
    striving = ask(p.hand, s.hand, p.linkage, s.linkage, script, held, held_rate, h)
    force = s.hand.asked
    if p.reach.reach > 0.0:
        computed = s.loader.computed
        force = within_reach(p.reach, s.reach, p.linkage, s.linkage, computed, force)
        if force != s.hand.asked:
            striving = 0.0  # at its stop a hand does not strive for ever more
    hold(p.hand, s.hand, p.linkage, s.linkage, force, striving, h)


@stage
def run_node(
    p: ControlParameters, s: ControlState, force: Floats, held: Floats, node: int, scripted: bool
) -> None:
    """Run hand, loader and linkage over the substep that ends at a node.

    `force` and `held` are the hand's script on the nodes of the whole flight, N and d;
    `scripted` where it does no more than that.
    """
    h, stopped = p.clock.substep, p.reach.reach > 0.0
    move_muscle(p.hand, s.hand)
    # The hand's impedance acts as it stood at the last node; its script runs on.
    before = s.loader.computed
    acting = s.hand.force
    if stopped and seated(s.reach, p.linkage, before) != 0:
        acting = s.hand.asked  # of which the stop takes what it must
    ahead = acting + force[node] - force[node - 1]
    ends = bounds(p.reach, s.reach, p.loader, p.linkage, before)
    move_loader(p.loader, p.friction, s.modification, s.loader, ahead, ends, h)
    position, grip = s.linkage.position, s.linkage.grip
    move_linkage(p.linkage, s.linkage, before, s.loader.computed, h)
    if scripted:
        s.hand.force = force[node] + s.hand.muscle
    else:
        if stopped:
            stop_linkage(s.reach, p.linkage, s.linkage, position, grip)
        rate = (held[node] - held[node - 1]) / h
        set_hand(p, s, force[node], held[node], rate)
    if p.linkage.share > 0.0:
        carry_bend(p.linkage, s.linkage, s.hand.force)


@stage
def begin_frame(p: ControlParameters, s: ControlState, load_factor: float) -> bool:
    """Set what holds over a frame; return whether the hand does no more than its script."""
    set_external(p.loader, s.loader, load_factor)
    s.loader.stop = 0
    stopped = p.reach.reach > 0.0
    if stopped:
        set_reach(p.reach, s.reach, p.loader, p.friction, s.modification, s.loader, p.linkage)
    return only_scripted(p.hand) and not stopped


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
    scripted = begin_frame(p, s, load_factor)  # asked once a frame, not at every node
    for node in range(first_node + 1, first_node + p.clock.substeps + 1):
        run_node(p, s, force, held, node, scripted)


@stage
def bend_by_others(controls: ControlArray, i: int) -> None:
    """Set what the others' forces bend at control i: Σ_j K_ij·F_j."""
    row, bent = controls[i].parameters.crossing.bends, 0.0
    for j in range(len(controls)):
        bent += row[j] * controls[j].state.hand.force
    controls[i].state.linkage.others = bent


@stage
def read_others(controls: ControlArray, row: Floats) -> None:
    """Read all forces at t_k for the hosts' estimates: Σ_j K̂_ij·F_j. The row holds the noise."""
    for j in range(len(controls)):
        p, s = controls[j].parameters, controls[j].state
        noise = row[1 + CHANNELS_PER_CONTROL * j]
        s.crossing.read = read_force(p.sensing, s.hand.force, noise)
    for i in range(len(controls)):
        assumed, added = controls[i].parameters.crossing.assumed, 0.0
        for j in range(len(controls)):
            added += assumed[j] * controls[j].state.crossing.read
        controls[i].state.crossing.estimated = added


@stage
def run_joined(controls: ControlArray, script: Floats, k: int, load_factor: float) -> None:
    """Run all controls of one structure over frame k, node by node."""
    substeps = controls[0].parameters.clock.substeps
    for i in range(len(controls)):
        begin_frame(controls[i].parameters, controls[i].state, load_factor)
    for node in range(k * substeps + 1, (k + 1) * substeps + 1):
        for i in range(len(controls)):
            p, s = controls[i].parameters, controls[i].state
            bend_by_others(controls, i)
            run_node(
                p,
                s,
                script[i, 0],
                script[i, 1],
                node,
                only_scripted(p.hand) and p.reach.reach == 0.0,
            )
    for i in range(len(controls)):
        bend_by_others(controls, i)


@entry
def step_frame(
    controls: ControlArray,
    script: Floats,
    record: Floats,
    k: int,
    motion: tuple[float, ...],
    load_factor: float,
) -> tuple[float, float, float]:
    """Run frame k of all controls, write row k but for its time, return the surface commands.

    controls  shape (n,), n ≤ 3
    script    shape (n, 2, frames·substeps + 1): the hand's force in N and held deflection
    record    shape (frames, channels): t, 10 a control, the motion; comes holding the noise
              that is added to what is read
    motion    of the airframe at t_k, q̄ in Pa first
    The commands are in ±1, one a control, 0 for a control that is absent.
    """
    first_command = second_command = third_command = 0.0
    row = record[k]
    pressure_at = 1 + CHANNELS_PER_CONTROL * len(controls)
    joined = controls[0].parameters.crossing.joined != 0
    # Here, not after the flight: a frame then leaves no object behind.
    for i in range(len(motion)):
        row[pressure_at + i] += motion[i]
    if k == 0:
        for i in range(len(controls)):
            p, s = controls[i].parameters, controls[i].state
            free(s.reach)
            set_hand(p, s, script[i, 0, 0], script[i, 1, 0], 0.0)
            start_delay(p.loader, s.loader, s.hand.force)
            carry_bend(p.linkage, s.linkage, s.hand.force)
    if joined:
        for i in range(len(controls)):
            bend_by_others(controls, i)
        read_others(controls, row)
    for i in range(len(controls)):
        p, s = controls[i].parameters, controls[i].state
        force, held = script[i, 0], script[i, 1]
        node = k * p.clock.substeps
        first = 1 + CHANNELS_PER_CONTROL * i
        out = row[first : first + CHANNELS_PER_CONTROL]
        command = host_frame(p, s, s.hand.force, row[pressure_at], motion[0], out)
        if not joined:
            run_frame(p, s, force, held, node, load_factor)
        if i == 0:
            first_command = command
        elif i == 1:
            second_command = command
        else:
            third_command = command
    if joined:
        run_joined(controls, script, k, load_factor)
    return first_command, second_command, third_command


def addresses(controls: ControlArray, script: Floats, record: Floats) -> NDArray[np.int64]:
    """Return addresses and sizes of `step_frame`'s arrays for `step_frame_at`; keep all alive."""
    assert all(array.flags.c_contiguous for array in (controls, script, record))
    return np.array(
        [
            *(controls.ctypes.data, len(controls)),
            *(script.ctypes.data, script.shape[2]),
            *(record.ctypes.data, *record.shape),
        ]
    )


@entry
def step_frame_at(
    address: int, k: int, motion: tuple[float, ...], load_factor: float
) -> tuple[float, float, float]:
    """Run `step_frame` on the arrays whose addresses stand at `address`.

    To hand over three arrays at every frame costs as much as half of the physics.
    """
    at = carray(pointer(address), 7, np.int64)
    controls = carray(pointer(at[0]), (at[1],), CONTROL)
    script = carray(pointer(at[2]), (at[1], 2, at[3]), np.float64)
    record = carray(pointer(at[4]), (at[5], at[6]), np.float64)
    return step_frame(controls, script, record, k, motion, load_factor)
