"""The machine code of an FMU: a frame of one control, and the numbers of its parameters.

Both are compiled from the kernels of the simulation. They take addresses of flat memory, allocate
nothing and have no state, so that instances share only the code.
"""

from __future__ import annotations

import numpy as np

from coupled.exporting.fmu.laws import number
from coupled.rig.compiled import carray, object_code, pointer
from coupled.rig.control import CONTROL
from coupled.rig.frame import CHANNELS_PER_CONTROL, host_frames, serve_frame, start_controls
from coupled.rig.linkage import deflection, transducer
from coupled.rig.mechanism import run_frame
from coupled.rig.sensing import read_computed, read_grip

_MOTION = 5  # channels of the motion up to the angle of attack
ROW = 1 + CHANNELS_PER_CONTROL + _MOTION + 2  # a record's row, and δc and δ at the frame's end


def frame(
    control: int,
    nodes: int,
    row: int,
    first: int,
    pressure: float,
    load_factor: float,
    alpha: float,
) -> float:
    """Run a frame of the control at an address; return the surface command, as `step_frame`.

    nodes     address of the hand's force in N, then its held deflection, at the frame's nodes
    row       address of `ROW` zeros, for the record's row at the frame's start, and for δc and δ as
              read at its end, d
    first     whether it is the first frame
    """
    controls = carray(pointer(control), (1,), CONTROL)
    p, s = controls[0].parameters, controls[0].state
    script = carray(pointer(nodes), (1, 2, p.clock.substeps + 1), np.float64)
    out = carray(pointer(row), ROW, np.float64)
    motion = (pressure, load_factor, 0.0, 0.0, alpha)
    if first != 0:
        start_controls(controls, script)
    s.hand.force = script[0, 0, 0]
    serve_frame(controls, motion, load_factor)
    command, _, _ = host_frames(controls, out, motion)
    run_frame(p, s, script[0, 0], script[0, 1], 0, load_factor)
    sampled = s.sensing.computed if p.sensing.skewed else s.loader.computed
    out[ROW - 2] = read_computed(p.sensing, sampled, s.modification.frames, 0.0)
    at = transducer(p.linkage, deflection(p.linkage, s.linkage, s.hand.force))
    out[ROW - 1] = read_grip(p.sensing, at, s.hand.force) + p.sensing.deflection_zero
    return float(command)


def object_codes() -> dict[str, bytes]:
    """Return the object files of both functions, by file name."""
    place, value = 0, 0.0
    return {
        "frame.o": object_code(frame, "coupled_frame", *(place,) * 4, *(value,) * 3),
        "number.o": object_code(number, "coupled_number", place, *(value,) * 6),
    }
