"""The frame step as called by a flight: its arrays are at an address, passed only once.

Passing them at every frame would cost half as much as the physics. Numbers cost, too: each some
8 ns to pass, and 20 for a returned command. So a rig of a column alone passes the longitudinal
motion and returns one command; other rigs pass the whole motion and return three. Both are short
entries that store the motion beside the arrays and call one frame step, compiled once for any rig.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import LONGITUDINAL, WHOLE_MOTION
from coupled.rig.compiled import bound, call_at, carray, entry, machine_code, pointer
from coupled.rig.control import CONTROL, ControlArray
from coupled.rig.frame import host_frames, serve_frame, step_frame

Floats = NDArray[np.float64]
Commands = tuple[float, float, float]
_BESIDE = WHOLE_MOTION + 3  # the motion, the second and third command, and the frame rate in Hz


class Placed:
    """A flight's arrays for `step_frame_at`, kept alive: those of `step_frame`.

    Column 0 of the record is the time, at `frame_rate_Hz`. `real_loader`: hand and loader are
    measured, not simulated; only the host's part is computed.

    `run_column` takes `address`, the frame's number and the longitudinal motion (SI, in the
    channels' order), and returns the first control's command; `run_all` also takes the lateral
    motion, and returns three commands.
    """

    def __init__(
        self,
        controls: ControlArray,
        script: Floats,
        record: Floats,
        frame_rate_Hz: float,
        real_loader: bool = False,
    ) -> None:
        assert all(array.flags.c_contiguous for array in (controls, script, record))
        kernels = _kernels()
        beside = np.zeros(_BESIDE)
        beside[-1] = frame_rate_Hz
        self._kept = (controls, script, record, beside)
        self._place = np.array(
            [
                *(controls.ctypes.data, len(controls)),
                *(script.ctypes.data, script.shape[2]),
                *(record.ctypes.data, *record.shape),
                *(real_loader, beside.ctypes.data, kernels.step_frame),
            ]
        )
        self.address = int(self._place.ctypes.data)
        self.run_column, self.run_all = kernels.run_column, kernels.run_all

    def frame(self, k: int, motion: tuple[float, ...]) -> Commands:
        """Run frame k with the whole motion, and return the surface commands of all controls."""
        return self.run_all(self.address, k, *motion)


@entry
def step_frame_at(address: int, k: int) -> float:
    """Run `step_frame` on the arrays and the motion at `address`; return one command.

    The other two are stored beside the motion.
    """
    at = carray(pointer(address), 10, np.int64)
    controls = carray(pointer(at[0]), (at[1],), CONTROL)
    script = carray(pointer(at[2]), (at[1], 2, at[3]), np.float64)
    record = carray(pointer(at[4]), (at[5], at[6]), np.float64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    motion = (
        *(b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]),
        *(b[8], b[9], b[10], b[11], b[12], b[13], b[14]),
    )
    if at[7] != 0:
        serve_frame(controls, motion, motion[1])
        commands = host_frames(controls, record[k], motion)
    else:
        commands = step_frame(controls, script, record, k, motion, motion[1])
    record[k, 0] = k / b[17]
    first, b[15], b[16] = commands
    return first


@entry
def _run_column(
    address: int,
    k: int,
    pressure: float,
    load_factor: float,
    elevator: float,
    pitch_rate: float,
    alpha: float,
    pitch: float,
    speed: float,
    altitude: float,
) -> float:
    at = carray(pointer(address), 10, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    b[0], b[1], b[2], b[3] = pressure, load_factor, elevator, pitch_rate
    b[4], b[5], b[6], b[7] = alpha, pitch, speed, altitude
    first: float = call_at(at[9], address, k)
    return first


@entry
def _run_all(
    address: int,
    k: int,
    pressure: float,
    load_factor: float,
    elevator: float,
    pitch_rate: float,
    alpha: float,
    pitch: float,
    speed: float,
    altitude: float,
    aileron: float,
    rudder: float,
    roll_rate: float,
    yaw_rate: float,
    beta: float,
    roll: float,
    heading: float,
) -> Commands:
    at = carray(pointer(address), 10, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    b[0], b[1], b[2], b[3] = pressure, load_factor, elevator, pitch_rate
    b[4], b[5], b[6], b[7] = alpha, pitch, speed, altitude
    b[8], b[9], b[10], b[11] = aileron, rudder, roll_rate, yaw_rate
    b[12], b[13], b[14] = beta, roll, heading
    first: float = call_at(at[9], address, k)
    return first, b[15], b[16]


class Kernels(NamedTuple):
    """The machine code of the entries; `step_frame` is an address."""

    step_frame: int
    run_column: Callable[..., float]
    run_all: Callable[..., Commands]


@lru_cache(maxsize=1)
def _kernels() -> Kernels:
    """Return the machine code, cached, since numba takes a third of a millisecond to find it."""
    along, whole = (0.0,) * len(LONGITUDINAL), (0.0,) * WHOLE_MOTION
    code = machine_code(step_frame_at, 0, 0)
    return Kernels(code, bound(_run_column, 0, 0, *along), bound(_run_all, 0, 0, *whole))
