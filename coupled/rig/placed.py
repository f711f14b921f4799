"""The frame step as called by a flight: its arrays are at an address, passed only once.

Passing them at every frame would cost half as much as the physics. Numbers cost, too: each some
8 ns to pass, and 20 for a returned command. So a rig of a column alone passes the longitudinal
motion and returns one command; other rigs pass the whole motion and return three. Both are short
entries that store the motion beside the arrays and call one frame step, compiled once for any rig.

A frame may also be run in two halves by the same frame step: the host at t_k, which writes row k of
the record, and then hand, loader and linkage up to t_k+1, under a force that follows from that row.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import LONGITUDINAL, WHOLE_MOTION
from coupled.rig.compiled import bound, call_at, carray, entry, machine_code, pointer, stage
from coupled.rig.control import CONTROL, CONTROL_PARAMETERS, CONTROL_STATE, ControlArray
from coupled.rig.crossing import MOST
from coupled.rig.frame import host_frames, run_loaders, serve_frame, start_controls

Floats = NDArray[np.float64]
Commands = tuple[float, float, float]
_BESIDE = WHOLE_MOTION + 3  # the motion, the second and third command, and the frame rate in Hz
# Of the addresses, shapes and flags of a flight, those that the two halves of a frame add.
_PHASE, _KEPT_CONTROLS, _KEPT_ROW, _SUBSTEPS, _GIVEN = 10, 11, 12, 13, 14
_PLACES = _GIVEN + MOST
_WHOLE, _HOST, _HOST_AGAIN, _LOADERS = range(4)  # the part of a frame that is run
# The stages whose state the host changes and a second run of it would change again, in two rows of
# neighbours with the services between; all numbers of a control have eight bytes.
_HOSTED = ("schedule", "modification", "services", "compensation", "crossing", "surface")


def _words(first: str, last: str) -> tuple[int, int]:
    """Return the numbers of a control from a stage's state to another's, as a range."""
    fields: Any = CONTROL_STATE.fields
    start = CONTROL_PARAMETERS.itemsize + int(fields[first][1])
    end = CONTROL_PARAMETERS.itemsize + int(fields[last][1]) + fields[last][0].itemsize
    return start // 8, end // 8


_WORDS = CONTROL.itemsize // 8
_PRODUCT, _PRODUCT_END = _words("schedule", "modification")
# The last of them are the nodes of a curve, of which most rigs have none.
_STATES: Any = CONTROL_STATE.fields
_FIELDS = _STATES["modification"][0].fields
_NODES = _words("modification", "modification")[0] + _FIELDS["node_at"][1] // 8
_CURVED = _words("modification", "modification")[0] + _FIELDS["curved"][1] // 8
_SERVICES, _SERVICES_END = _words("services", "services")
_SURFACE, _SURFACE_END = _words("compensation", "surface")


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
        before, row = np.zeros_like(controls), np.zeros(record.shape[1])
        self._kept = (controls, script, record, beside, before, row)
        substeps = int(controls["parameters"]["clock"]["substeps"][0])
        self._place = np.array(
            [
                *(controls.ctypes.data, len(controls)),
                *(script.ctypes.data, script.shape[2]),
                *(record.ctypes.data, *record.shape),
                *(real_loader, beside.ctypes.data, kernels.step_frame),
                *(_WHOLE, before.ctypes.data, row.ctypes.data, substeps),
                *([0] * MOST),
            ]
        )
        self.address = int(self._place.ctypes.data)
        self.run_column, self.run_all = kernels.run_column, kernels.run_all

    def frame(self, k: int, motion: tuple[float, ...]) -> Commands:
        """Run frame k with the whole motion, and return the surface commands of all controls."""
        return self.run_all(self.address, k, *motion)

    def in_halves(self, given: Sequence[int]) -> HalfFrames:
        """Return the frames in two halves; `given` are the controls whose force `finish` takes."""
        self._place[_GIVEN:] = [i in given for i in range(MOST)]
        controls, _, record, _, before, row = self._kept
        return HalfFrames(self, controls, record, before, row)


class HalfFrames:
    """The frames of a flight in two halves: `begin` and `finish` do what `Placed.frame` does.

    `host_column`, `host` and `loaders` are the same without packing, as in `Placed`. `step_column`
    finishes frame k and begins the next one: it takes `address`, k, the force on a given column, N,
    and the longitudinal motion at t_k+1.
    """

    def __init__(
        self,
        placed: Placed,
        controls: ControlArray,
        record: Floats,
        before: ControlArray,
        row: Floats,
    ) -> None:
        self._placed, self.address = placed, placed.address
        self._controls, self._record = controls, record
        self._before, self._row = before, row
        kernels = _half_kernels()
        self.step_column, self.host_column = kernels.step_column, kernels.host_column
        self.host, self._again, self.loaders = kernels.host, kernels.again, kernels.loaders

    def begin(self, k: int, motion: tuple[float, ...]) -> Commands:
        """Run the host of frame k, which writes row k, and return the surface commands."""
        return self.host(self.address, k, *motion)

    def undo(self, k: int) -> None:
        """Return the host's state and row k to their values before `begin`, for a change."""
        for name in _HOSTED:
            self._controls["state"][name] = self._before["state"][name]
        self._record[k] = self._row

    def begin_again(self, k: int) -> Commands:
        """Run the host of frame k again after `undo`, with the same motion."""
        return self._again(self.address, k)

    def finish(self, k: int, forces: Sequence[float]) -> None:
        """Run hand, loader and linkage over frame k, after its host.

        Each given control has its force, N, over the whole frame.
        """
        first, second, third = forces
        self.loaders(self.address, k, first, second, third)


@entry
def step_frame_at(address: int, k: int) -> float:
    """Run `step_frame`, or one half of it, on the arrays and the motion at `address`.

    Return one command; the other two are stored beside the motion.
    """
    at = carray(pointer(address), _PLACES, np.int64)
    controls = carray(pointer(at[0]), (at[1],), CONTROL)
    script = carray(pointer(at[2]), (at[1], 2, at[3]), np.float64)
    record = carray(pointer(at[4]), (at[5], at[6]), np.float64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    first = 0.0
    if at[_PHASE] != _LOADERS:
        motion = (
            *(b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]),
            *(b[8], b[9], b[10], b[11], b[12], b[13], b[14]),
        )
        if k == 0 and at[7] == 0 and at[_PHASE] != _HOST_AGAIN:
            start_controls(controls, script)
        serve_frame(controls, motion, motion[1])
        first, b[15], b[16] = host_frames(controls, record[k], motion)
        record[k, 0] = k / b[17]
    if (at[_PHASE] == _WHOLE or at[_PHASE] == _LOADERS) and at[7] == 0:
        run_loaders(controls, script, k, b[1])
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
    at = carray(pointer(address), _PLACES, np.int64)
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
    at = carray(pointer(address), _PLACES, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    b[0], b[1], b[2], b[3] = pressure, load_factor, elevator, pitch_rate
    b[4], b[5], b[6], b[7] = alpha, pitch, speed, altitude
    b[8], b[9], b[10], b[11] = aileron, rudder, roll_rate, yaw_rate
    b[12], b[13], b[14] = beta, roll, heading
    first: float = call_at(at[9], address, k)
    return first, b[15], b[16]


@stage
def _host_of(address: int, k: int, phase: int) -> float:
    """Keep the host's state and row k, and run the host on the motion beside them."""
    at = carray(pointer(address), _PLACES, np.int64)
    words = at[1] * _WORDS
    controls = carray(pointer(at[0]), words, np.int64)
    before = carray(pointer(at[_KEPT_CONTROLS]), words, np.int64)
    for i in range(at[1]):
        start = i * _WORDS
        end = _PRODUCT_END if controls[start + _CURVED] != 0 else _NODES
        for j in range(_PRODUCT, end):
            before[start + j] = controls[start + j]
        for j in range(_SERVICES, _SERVICES_END):
            before[start + j] = controls[start + j]
        for j in range(_SURFACE, _SURFACE_END):
            before[start + j] = controls[start + j]
    record = carray(pointer(at[4]), (at[5], at[6]), np.float64)
    row = carray(pointer(at[_KEPT_ROW]), at[6], np.float64)
    for i in range(at[6]):
        row[i] = record[k, i]
    at[_PHASE] = phase
    first: float = call_at(at[9], address, k)
    at[_PHASE] = _WHOLE
    return first


@entry
def _run_again(address: int, k: int) -> Commands:
    at = carray(pointer(address), _PLACES, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    first = _host_of(address, k, _HOST_AGAIN)
    return first, b[15], b[16]


@entry
def _run_host_column(
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
    at = carray(pointer(address), _PLACES, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    b[0], b[1], b[2], b[3] = pressure, load_factor, elevator, pitch_rate
    b[4], b[5], b[6], b[7] = alpha, pitch, speed, altitude
    return _host_of(address, k, _HOST)


@entry
def _run_host(
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
    at = carray(pointer(address), _PLACES, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    b[0], b[1], b[2], b[3] = pressure, load_factor, elevator, pitch_rate
    b[4], b[5], b[6], b[7] = alpha, pitch, speed, altitude
    b[8], b[9], b[10], b[11] = aileron, rudder, roll_rate, yaw_rate
    b[12], b[13], b[14] = beta, roll, heading
    first = _host_of(address, k, _HOST)
    return first, b[15], b[16]


@entry
def _run_loaders(address: int, k: int, first: float, second: float, third: float) -> None:
    at = carray(pointer(address), _PLACES, np.int64)
    script = carray(pointer(at[2]), (at[1], 2, at[3]), np.float64)
    forces = (first, second, third)
    begun = k * at[_SUBSTEPS]
    for i in range(at[1]):
        if at[_GIVEN + i] != 0:
            for node in range(begun + 1, begun + at[_SUBSTEPS] + 1):
                script[i, 0, node] = forces[i]
    at[_PHASE] = _LOADERS
    call_at(at[9], address, k)
    at[_PHASE] = _WHOLE


class Kernels(NamedTuple):
    """The machine code of the entries; `step_frame` is an address."""

    step_frame: int
    run_column: Callable[..., float]
    run_all: Callable[..., Commands]


@entry
def _step_column(
    address: int,
    k: int,
    force: float,
    pressure: float,
    load_factor: float,
    elevator: float,
    pitch_rate: float,
    alpha: float,
    pitch: float,
    speed: float,
    altitude: float,
) -> float:
    at = carray(pointer(address), _PLACES, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    script = carray(pointer(at[2]), (at[1], 2, at[3]), np.float64)
    begun = k * at[_SUBSTEPS]
    for node in range(begun + 1, begun + at[_SUBSTEPS] + 1):
        script[0, 0, node] = force
    at[_PHASE] = _LOADERS
    call_at(at[9], address, k)  # with the motion of frame k
    b[0], b[1], b[2], b[3] = pressure, load_factor, elevator, pitch_rate
    b[4], b[5], b[6], b[7] = alpha, pitch, speed, altitude
    return _host_of(address, k + 1, _HOST)


class HalfKernels(NamedTuple):
    """The machine code of the entries of a frame's halves."""

    step_column: Callable[..., float]
    host_column: Callable[..., float]
    host: Callable[..., Commands]
    again: Callable[[int, int], Commands]
    loaders: Callable[[int, int, float, float, float], None]


@lru_cache(maxsize=1)
def _kernels() -> Kernels:
    """Return the machine code, cached, since numba takes a third of a millisecond to find it."""
    along, whole = (0.0,) * len(LONGITUDINAL), (0.0,) * WHOLE_MOTION
    code = machine_code(step_frame_at, 0, 0)
    return Kernels(code, bound(_run_column, 0, 0, *along), bound(_run_all, 0, 0, *whole))


@lru_cache(maxsize=1)
def _half_kernels() -> HalfKernels:
    """Return the machine code of the halves; few flights need it."""
    along, whole = (0.0,) * len(LONGITUDINAL), (0.0,) * WHOLE_MOTION
    return HalfKernels(
        bound(_step_column, 0, 0, 0.0, *along),
        bound(_run_host_column, 0, 0, *along),
        bound(_run_host, 0, 0, *whole),
        bound(_run_again, 0, 0),
        bound(_run_loaders, 0, 0, 0.0, 0.0, 0.0),
    )
