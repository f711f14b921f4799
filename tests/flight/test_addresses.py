"""Frames whose motion is read, and commands are set, by compiled code at addresses."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Iterator

import jsbsim
import numpy as np
import pytest

import coupled
from coupled.flight import addresses as module
from coupled.flight.addresses import addresses, node_functions, node_of
from coupled.flight.everyframe import PlainAircraft, plain_frames
from coupled.flight.loop import fly
from coupled.flight.pilot.own import GivenForce
from coupled.resources import shipped_rigs
from coupled.rig.frame import CHANNELS_PER_CONTROL
from coupled.rig.packing import pack
from coupled.rig.placed import Connection, Placed
from coupled.rig.rigfile import read_rig
from tests.support.runs import shortened

EXPORTED = sys.platform in ("linux", "darwin")
Read = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_void_p)
Write = ctypes.CFUNCTYPE(ctypes.c_bool, ctypes.c_void_p, ctypes.c_double)


def node(fdm: jsbsim.FGFDMExec, name: str) -> jsbsim.FGPropertyNode:
    found = fdm.get_property_manager().get_node(name)
    assert found is not None
    return found


@pytest.mark.skipif(not EXPORTED, reason="JSBSim's names are those of another ABI")
def test_compiled_code_reads_and_sets_a_property_as_python_does() -> None:
    fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    fdm.load_model("c172p")
    names = ("fcs/elevator-cmd-norm", "ic/h-sl-ft", "inertia/mass-slugs", "aero/qbar-psf")
    nodes = [node(fdm, name) for name in names]
    fdm["fcs/elevator-cmd-norm"], fdm["ic/h-sl-ft"] = -0.25, 4321.0
    fdm.run_ic()
    found = addresses(nodes)
    assert found is not None
    functions, at = found
    values = [Read(functions.read)(each) for each in at]
    assert values == [each.get_double_value() for each in nodes]
    assert values[:2] == [-0.25, pytest.approx(4321.0)]
    assert Write(functions.write)(at[0], 0.5)
    assert nodes[0].get_double_value() == 0.5


def test_objects_that_are_no_nodes_have_no_address() -> None:
    fdm = jsbsim.FGFDMExec(jsbsim.get_default_root_dir())
    step = node(fdm, "simulation/dt")
    assert addresses([step, 1.0]) is None
    assert addresses([1.0]) is None
    assert addresses([fdm]) is None
    assert addresses([node_of(lambda: 0.0)]) is None
    assert node_of(step.get_double_value) is step
    assert node_functions("math") is None


def without_addresses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "node_functions", lambda _: None)


@pytest.mark.parametrize("controls", [1, 2, 3])
def test_frames_through_python_are_those_by_addresses(
    controls: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = shortened("three-controls", controls, 150)
    by_addresses = fly(case)
    without_addresses(monkeypatch)
    through_python = fly(case)
    assert np.ptp(by_addresses["column_surface_norm"]) > 0.01
    assert by_addresses.data.tobytes() == through_python.data.tobytes()


@pytest.mark.parametrize("rig", ["report-column", "737"])
def test_steps_through_python_are_those_by_addresses(
    rig: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stepped() -> bytes:
        with coupled.Session(rig, column=GivenForce()) as session:
            for k in range(40):
                session.step(column_force_N=5.0 * k)
                if k == 20:
                    session.deflection_correction = not session.deflection_correction
        return session.record.data.tobytes()

    by_addresses = stepped()
    without_addresses(monkeypatch)
    assert stepped() == by_addresses


def heights() -> Iterator[float]:
    yield from [5000.0] * 100
    yield 50.0  # below the safe altitude, without trouble: read again
    yield 50.0
    yield from [5000.0] * 10
    while True:
        yield float("nan")


def test_frames_end_where_the_height_is_not_a_number() -> None:
    rig = read_rig(shipped_rigs()["report-column"])
    height, set_to = heights(), list[float]()
    read = Read(lambda node: next(height) if node == 8 else 0.0)

    def set_command(_: int, value: float) -> bool:
        set_to.append(value)
        return True

    write = Write(set_command)
    places = [ctypes.cast(call, ctypes.c_void_p).value or 0 for call in (read, write)]
    motion = [(node, 1.0) for node in range(1, 9)]
    connection = Connection(places[0], places[1], motion, [(9, 0.125)], 100.0)

    def trouble() -> str:
        return "the state is not finite" if len(set_to) > 105 else ""

    aircraft = PlainAircraft(connection, (), lambda: True, trouble)
    record = np.zeros((200, 1 + CHANNELS_PER_CONTROL + 8))
    script = np.zeros((1, 2, 200 * rig.substeps + 1))
    placed = Placed(pack(rig), script, record, rig.frame_rate)
    frames = plain_frames(aircraft, placed)
    assert (frames(0, 64), frames(64, 128)) == (64, 111)
    assert len(set_to) == 111
    assert set_to[0] == pytest.approx(0.125 + record[0, 8])
    assert record[100, -1] == 50.0
    assert record[111, 0] == 0.0
