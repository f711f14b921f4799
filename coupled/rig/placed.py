"""The frame step as called by a flight: its arrays are at an address, passed only once.

Passing them at every frame would cost half as much as the physics. Numbers cost, too: each some
8 ns to pass, and 20 for a returned command. So `Placed.connect` takes the addresses of an
aircraft's properties: the compiled frame reads the motion there and sets the commands. Without them
`Placed.frame` takes the whole motion and returns three commands. All entries are short: they store
the motion beside the arrays and call one frame step, compiled once for any rig.

A frame may also be run in two halves by the same frame step: the host at t_k, which writes row k of
the record, and then hand, loader and linkage up to t_k+1, under a force that follows from that row.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import ALTITUDE, HEADING, WHOLE_MOTION
from coupled.rig.compiled import (
    bound,
    call_at,
    carray,
    entry,
    machine_code,
    pointer,
    read_at,
    stage,
    write_at,
)
from coupled.rig.control import CONTROL, CONTROL_PARAMETERS, CONTROL_STATE, ControlArray
from coupled.rig.crossing import MOST
from coupled.rig.frame import host_frames, run_loaders, serve_frame, start_controls

Floats = NDArray[np.float64]
Commands = tuple[float, float, float]
_COMMAND, _RATE = WHOLE_MOTION, WHOLE_MOTION + MOST  # beside the arrays, after the motion
_BESIDE = _RATE + 1
# Of the addresses, shapes and flags of a flight, those that the two halves of a frame add.
_PHASE, _KEPT_CONTROLS, _KEPT_ROW, _SUBSTEPS, _GIVEN = 10, 11, 12, 13, 14
_CONNECTED, _NUMBERS = _GIVEN + MOST, _GIVEN + MOST + 1
_PLACES = _NUMBERS + 1
# Of a connected aircraft: functions, and how many nodes of the motion and of commands, with each.
_READ, _WRITE, _READS, _WRITES, _READ_FROM = range(5)
_WRITE_TO = _READ_FROM + WHOLE_MOTION
_NODES_SIZE = _WRITE_TO + MOST
_SAFE, _FACTOR = 0, 1  # its numbers: lowest safe altitude, factors, and commands in trim
_TRIM = _FACTOR + WHOLE_MOTION
_NUMBERS_SIZE = _TRIM + MOST
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


class Connection(NamedTuple):
    """Where compiled code reads an aircraft's motion and sets its commands.

    `read` and `write` are the addresses of functions `double read(node)` and
    `bool write(node, double)`, which raise no error. Each node has its factor to SI (the motion),
    or its value in trim (a control's command).
    """

    read: int
    write: int
    motion: Sequence[tuple[int, float]]  # in the channels' order
    commands: Sequence[tuple[int, float]]  # in the rig's order
    safe_altitude_m: float  # at and below it, a frame is not begun unless it must


class Placed:
    """A flight's arrays for `step_frame_at`, kept alive: those of `step_frame`.

    Column 0 of the record is the time, at `frame_rate_Hz`. `real_loader`: hand and loader are
    measured, not simulated; only the host's part is computed.

    `fly` runs a frame of a connected aircraft: it takes `address`, the frame's number, and whether
    to return True, with nothing done, unless the aircraft is above its safe altitude.
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
        beside[_RATE] = frame_rate_Hz
        before, row = np.zeros_like(controls), np.zeros(record.shape[1])
        nodes, numbers = np.zeros(_NODES_SIZE, np.int64), np.zeros(_NUMBERS_SIZE)
        self._kept = (controls, script, record, beside, before, row)
        self._nodes, self._numbers = nodes, numbers
        substeps = int(controls["parameters"]["clock"]["substeps"][0])
        self._place = np.array(
            [
                *(controls.ctypes.data, len(controls)),
                *(script.ctypes.data, script.shape[2]),
                *(record.ctypes.data, *record.shape),
                *(real_loader, beside.ctypes.data, kernels.step_frame),
                *(_WHOLE, before.ctypes.data, row.ctypes.data, substeps),
                *([0] * MOST),
                *(nodes.ctypes.data, numbers.ctypes.data),
            ]
        )
        self.address = int(self._place.ctypes.data)
        self.fly, self._run = kernels.fly, kernels.run

    def frame(self, k: int, motion: tuple[float, ...]) -> Commands:
        """Run frame k with the whole motion, and return the surface commands of all controls."""
        return self._run(self.address, k, *motion)

    def connect(self, aircraft: Connection) -> None:
        """Let `fly`, and the halves, read the motion of an aircraft and set its commands."""
        read, numbers = len(aircraft.motion), self._numbers
        written = len(aircraft.commands)
        self._nodes[:_READ_FROM] = aircraft.read, aircraft.write, read, written
        self._nodes[_READ_FROM : _READ_FROM + read] = [node for node, _ in aircraft.motion]
        self._nodes[_WRITE_TO : _WRITE_TO + written] = [node for node, _ in aircraft.commands]
        numbers[_SAFE] = aircraft.safe_altitude_m
        numbers[_FACTOR : _FACTOR + read] = [factor for _, factor in aircraft.motion]
        numbers[_TRIM : _TRIM + written] = [trim for _, trim in aircraft.commands]

    def in_halves(self, given: Sequence[int]) -> HalfFrames:
        """Return the frames in two halves; `given` are the controls whose force `finish` takes."""
        self._place[_GIVEN : _GIVEN + MOST] = [i in given for i in range(MOST)]
        controls, _, record, _, before, row = self._kept
        return HalfFrames(self, controls, record, before, row)


class HalfFrames:
    """The frames of a flight in two halves: `begin` and `finish` do what `Placed.frame` does.

    `host` and `loaders` are the same for a connected aircraft, with `address`; `host` as
    `Placed.fly`. `step` finishes frame k, under a force on a given first control, N, and then does
    what `host` does for the next frame.
    """

    def __init__(
        self,
        placed: Placed,
        controls: ControlArray,
        record: Floats,
        before: ControlArray,
        row: Floats,
    ) -> None:
        self.placed, self.address = placed, placed.address
        self._controls, self._record = controls, record
        self._before, self._row = before, row
        kernels = _half_kernels()
        self.step, self.host, self.loaders = kernels.step, kernels.host, kernels.loaders
        self._begin, self._again = kernels.begin, kernels.again

    def begin(self, k: int, motion: tuple[float, ...]) -> Commands:
        """Run the host of frame k, which writes row k, and return the surface commands."""
        return self._begin(self.address, k, *motion)

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

    The commands are stored beside the motion; the first is returned.
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
        first, b[16], b[17] = host_frames(controls, record[k], motion)
        b[15] = first
        record[k, 0] = k / b[18]
    if (at[_PHASE] == _WHOLE or at[_PHASE] == _LOADERS) and at[7] == 0:
        run_loaders(controls, script, k, b[1])
    return first


@stage
def _store(
    address: int,
    along: tuple[float, float, float, float, float, float, float, float],
    beside: tuple[float, float, float, float, float, float, float],
) -> None:
    """Store the motion beside the arrays."""
    at = carray(pointer(address), _PLACES, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7] = along
    b[8], b[9], b[10], b[11], b[12], b[13], b[14] = beside


@stage
def _commands(address: int) -> Commands:
    at = carray(pointer(address), _PLACES, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    return b[15], b[16], b[17]


@stage
def _read_motion(address: int) -> bool:
    """Read a connected aircraft's motion; return whether it is above its safe altitude."""
    at = carray(pointer(address), _PLACES, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    nodes = carray(pointer(at[_CONNECTED]), _NODES_SIZE, np.int64)
    numbers = carray(pointer(at[_NUMBERS]), _NUMBERS_SIZE, np.float64)
    for i in range(nodes[_READS]):
        b[i] = read_at(nodes[_READ], nodes[_READ_FROM + i]) * numbers[_FACTOR + i]
    if b[HEADING] > math.pi:  # from 0 to 2π, where both mean north
        b[HEADING] -= 2.0 * math.pi
    above: bool = b[ALTITUDE] > numbers[_SAFE]  # not NaN
    return above


@stage
def _write_commands(address: int) -> None:
    """Set a connected aircraft's commands."""
    at = carray(pointer(address), _PLACES, np.int64)
    b = carray(pointer(at[8]), _BESIDE, np.float64)
    nodes = carray(pointer(at[_CONNECTED]), _NODES_SIZE, np.int64)
    numbers = carray(pointer(at[_NUMBERS]), _NUMBERS_SIZE, np.float64)
    for i in range(nodes[_WRITES]):
        write_at(nodes[_WRITE], nodes[_WRITE_TO + i], numbers[_TRIM + i] + b[_COMMAND + i])


@entry
def _fly(address: int, k: int, checked: bool) -> bool:
    if not _read_motion(address) and checked:
        return True
    at = carray(pointer(address), _PLACES, np.int64)
    call_at(at[9], address, k)
    _write_commands(address)
    return False


@entry
def _run(
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
    along = (pressure, load_factor, elevator, pitch_rate, alpha, pitch, speed, altitude)
    _store(address, along, (aileron, rudder, roll_rate, yaw_rate, beta, roll, heading))
    at = carray(pointer(address), _PLACES, np.int64)
    call_at(at[9], address, k)
    return _commands(address)


@stage
def _host_of(address: int, k: int, phase: int) -> None:
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
    call_at(at[9], address, k)
    at[_PHASE] = _WHOLE


@stage
def _loaders_of(address: int, k: int, forces: Commands) -> None:
    """Run the loaders of frame k, with its motion, under the forces of given controls."""
    at = carray(pointer(address), _PLACES, np.int64)
    script = carray(pointer(at[2]), (at[1], 2, at[3]), np.float64)
    begun = k * at[_SUBSTEPS]
    for i in range(at[1]):
        if at[_GIVEN + i] != 0:
            for node in range(begun + 1, begun + at[_SUBSTEPS] + 1):
                script[i, 0, node] = forces[i]
    at[_PHASE] = _LOADERS
    call_at(at[9], address, k)
    at[_PHASE] = _WHOLE


@stage
def _host_connected(address: int, k: int, checked: bool) -> bool:
    if not _read_motion(address) and checked:
        return True
    _host_of(address, k, _HOST)
    _write_commands(address)
    return False


@entry
def _host(address: int, k: int, checked: bool) -> bool:
    return _host_connected(address, k, checked)


@entry
def _again(address: int, k: int) -> Commands:
    _host_of(address, k, _HOST_AGAIN)
    _write_commands(address)
    return _commands(address)


@entry
def _begin(
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
    along = (pressure, load_factor, elevator, pitch_rate, alpha, pitch, speed, altitude)
    _store(address, along, (aileron, rudder, roll_rate, yaw_rate, beta, roll, heading))
    _host_of(address, k, _HOST)
    return _commands(address)


@entry
def _loaders(address: int, k: int, first: float, second: float, third: float) -> None:
    _loaders_of(address, k, (first, second, third))


@entry
def _step(address: int, k: int, force: float, checked: bool) -> bool:
    _loaders_of(address, k, (force, 0.0, 0.0))
    return _host_connected(address, k + 1, checked)


class Kernels(NamedTuple):
    """The machine code of the entries; `step_frame` is an address."""

    step_frame: int
    fly: Callable[[int, int, bool], bool]
    run: Callable[..., Commands]


class HalfKernels(NamedTuple):
    """The machine code of the entries of a frame's halves."""

    step: Callable[[int, int, float, bool], bool]
    host: Callable[[int, int, bool], bool]
    begin: Callable[..., Commands]
    again: Callable[[int, int], Commands]
    loaders: Callable[[int, int, float, float, float], None]


@lru_cache(maxsize=1)
def _kernels() -> Kernels:
    """Return the machine code, cached, since numba takes a third of a millisecond to find it."""
    whole = (0.0,) * WHOLE_MOTION
    code = machine_code(step_frame_at, 0, 0)
    return Kernels(code, bound(_fly, 0, 0, True), bound(_run, 0, 0, *whole))


@lru_cache(maxsize=1)
def _half_kernels() -> HalfKernels:
    """Return the machine code of the halves; few flights need it."""
    return HalfKernels(
        bound(_step, 0, 0, 0.0, True),
        bound(_host, 0, 0, True),
        bound(_begin, 0, 0, *(0.0,) * WHOLE_MOTION),
        bound(_again, 0, 0),
        bound(_loaders, 0, 0, 0.0, 0.0, 0.0),
    )
