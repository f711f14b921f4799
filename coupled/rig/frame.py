"""One frame of the rig, all controls together, in the order of the signal chain.

At t_k the host reads q̄, δc and F, sets ΔG and commands the surface; over the frame
that follows, hand, loader and linkage run on at the loader's own rate.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.rig.compensation import estimate
from coupled.rig.compiled import entry, stage
from coupled.rig.control import ControlArray
from coupled.rig.hand import grip_force, move_muscle
from coupled.rig.linkage import deflection, move_linkage, transducer
from coupled.rig.loader import move_loader, set_external, start_delay
from coupled.rig.modification import modifying_force, set_gradients
from coupled.rig.schedule import gradients, read_pressure
from coupled.rig.sensing import converted, read_computed, read_force
from coupled.rig.surface import command_surface

Floats = NDArray[np.float64]

# What the kernel records of each control, in this order; `record` names the channels.
CHANNELS_PER_CONTROL = 9
MAX_CONTROLS = 3


@stage
def host_frame(
    p: Any,
    s: Any,
    force: float,
    pressure_read: float,
    pressure: float,
    noise: Floats,
    out: Floats,
) -> float:
    """Do what host and recorder do at t_k; return the surface command over the frame.

    `noise` and `out` have the channels of one control: F, δc, δ, δ̂, G_T, F_mod,
    the step that F_mod makes here, the surface command, and the stop met since the
    last frame.
    """
    computed = s.loader.computed
    m = s.modification
    ended = m.held if p.modification.digital else modifying_force(m, computed)

    force_read = read_force(p.sensing, force, noise[0])
    computed_read = read_computed(p.sensing, computed, noise[1])
    first, second = gradients(p.schedule, read_pressure(p.schedule, s.schedule, pressure_read))
    set_gradients(p.modification, m, first, second)
    if p.modification.digital:
        product = modifying_force(m, computed_read)
        m.held = converted(product, p.sensing.product_step, p.sensing.product_range)
        product = m.held
    else:
        step, full = p.sensing.gradient_step, p.sensing.gradient_range
        m.first = converted(m.first, step, full)
        m.second = converted(m.second, step, full)
        product = modifying_force(m, computed)
    believed = estimate(p.compensation, computed_read, force_read)

    out[0] = force_read
    out[1] = computed_read
    out[2] = transducer(p.linkage, deflection(p.linkage, s.linkage, force)) + noise[2]
    out[3] = believed
    out[4] = first
    out[5] = product + noise[5]
    out[6] = product - ended
    command = command_surface(p.surface, s.surface, believed, pressure)
    out[7] = command
    out[8] = s.loader.stop
    return command


@stage
def run_frame(
    p: Any,
    s: Any,
    force: Floats,
    held: Floats,
    first_node: int,
    substeps: int,
    h: float,
    load_factor: float,
) -> None:
    """Run hand, loader and linkage over the frame, `substeps` of h seconds.

    `force` and `held` are the hand's script on the nodes of the whole flight, N and d.
    """
    set_external(p.loader, s.loader, load_factor)
    s.loader.stop = 0
    for node in range(first_node + 1, first_node + substeps + 1):
        move_muscle(p.hand, s.hand)
        # The hand's impedance acts as it stood at the last node; its script runs on.
        ahead = s.hand.force + force[node] - force[node - 1]
        before = s.loader.computed
        move_loader(p.loader, p.friction, s.modification, s.loader, ahead, h)
        move_linkage(p.linkage, s.linkage, before, s.loader.computed, h)
        rate = (held[node] - held[node - 1]) / h
        grip_force(p.hand, s.hand, p.linkage, s.linkage, force[node], held[node], rate, h)


@entry
def step_frame(
    controls: ControlArray,
    states: ControlArray,
    script: Floats,
    noise: Floats,
    record: Floats,
    k: int,
    substeps: int,
    h: float,
    motion: tuple[float, ...],
) -> tuple[float, float, float]:
    """Run frame k of all controls, write row k of the record, return the surface commands.

    controls, states  shape (n,), n ≤ 3
    script            shape (n, 2, frames·substeps + 1): force in N and held deflection
    noise             shape (1 or frames, channels), added to what is read
    record            shape (frames, channels): t, 9 a control, then `motion`
    motion            what the airframe gives: q̄ in Pa and load factor first
    The commands are in ±1, one a control, 0 for a control that is absent.
    """
    commands = np.zeros(MAX_CONTROLS)
    hiss = noise[k % noise.shape[0]]
    row = record[k]
    row[0] = k * substeps * h
    column = 1 + CHANNELS_PER_CONTROL * len(controls)
    for i in range(len(motion)):
        row[column + i] = motion[i] + hiss[column + i]
    for i in range(len(controls)):
        p, s = controls[i], states[i]
        force, held = script[i, 0], script[i, 1]
        node = k * substeps
        if k == 0:
            grip_force(p.hand, s.hand, p.linkage, s.linkage, force[0], held[0], 0.0, h)
            start_delay(p.loader, s.loader, s.hand.force)
        first = 1 + CHANNELS_PER_CONTROL * i
        channels = slice(first, first + CHANNELS_PER_CONTROL)
        commands[i] = host_frame(
            p, s, s.hand.force, row[column], motion[0], hiss[channels], row[channels]
        )
        run_frame(p, s, force, held, node, substeps, h, motion[1])
    return commands[0], commands[1], commands[2]
