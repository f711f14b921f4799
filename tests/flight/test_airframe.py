"""JSBSim behind its one module: signs, silence, determinism, and models that cannot be flown."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import pytest

from coupled.errors import InputError
from coupled.flight.airframe import JSBSimAirframe, packaged_models
from coupled.flight.directcontrols import check_direct_controls
from coupled.record.channels import ALTITUDE, LOAD, SPEED
from coupled.resources import aircraft_folder, shipped_rigs
from coupled.rig.parameters import Flight
from coupled.rig.rigfile import read_rig
from coupled.schema import build

FRAME = 1 / 120
CONTROLS = ["column", "wheel", "pedals"]
C172 = Flight(model="c172p", altitude=1500.0, calibrated_airspeed=50.0)


@pytest.mark.parametrize("name", [n for n, p in shipped_rigs().items() if n != "bench"])
def test_every_shipped_aircraft_trims_and_answers_to_the_rigs_signs(name: str) -> None:
    rig = read_rig(shipped_rigs()[name])
    assert rig.flight is not None
    travel = check_direct_controls(rig.flight, FRAME, CONTROLS, models=[aircraft_folder()])
    assert all(0.1 < abs(reach) < 0.6 for reach in travel.values())
    airframe = JSBSimAirframe(rig.flight, FRAME, CONTROLS, [aircraft_folder()])
    start = airframe.motion()
    for _ in range(240):
        airframe.step((0.0, 0.0, 0.0))
    end = airframe.motion()
    assert start[LOAD] == pytest.approx(1.0, abs=0.02)
    climb = end[ALTITUDE] - start[ALTITUDE]
    assert climb == pytest.approx(2.0 * start[SPEED] * math.sin(rig.flight.flight_path), abs=1.0)


def test_the_airframe_opens_no_socket_and_writes_no_file_and_prints_nothing(tmp_path: Path) -> None:
    """Loading, trimming, failing to trim and flying, in a process of its own."""
    code = """
import os, sys, pathlib, jsbsim
root = pathlib.Path(jsbsim.get_default_root_dir())
before = {p: p.stat().st_mtime for p in root.rglob("*")}
from coupled.flight.airframe import JSBSimAirframe
from coupled.rig.parameters import Flight
from coupled.errors import InputError
cases = (("737", 130.0), ("c172p", 50.0), ("B17", 80.0), ("737", 20.0), ("f104", 150.0))
for model, speed in cases:
    try:
        flight = Flight(model=model, altitude=1500.0, calibrated_airspeed=speed)
        airframe = JSBSimAirframe(flight, 1/120)
        for _ in range(60):
            airframe.step((0.01, 0.0, 0.0))
    except InputError:
        pass
    for fd in os.listdir("/proc/self/fd"):
        try:
            link = os.readlink(f"/proc/self/fd/{fd}")
        except OSError:
            continue
        assert not link.startswith("socket:"), (model, link)
after = {p: p.stat().st_mtime for p in root.rglob("*")}
changed = [str(p) for p in after if after[p] != before.get(p) and "__pycache__" not in str(p)]
assert not changed, changed
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        check=False,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert done.stderr == ""
    assert list(tmp_path.iterdir()) == []


def test_the_name_of_a_model_leads_to_no_other_folder() -> None:
    table = {"model": "../c172p", "altitude_m": 1000.0, "calibrated_airspeed_m_per_s": 50.0}
    with pytest.raises(InputError, match=r"flight\.model: should be the name of a JSBSim model"):
        build(Flight, table, "my.toml", "flight")


def test_two_aircraft_flown_alike_are_bit_equal() -> None:
    one, other = (JSBSimAirframe(C172, FRAME, CONTROLS) for _ in range(2))
    for k in range(300):
        commands = (0.02 * (k % 7 - 3), 0.01, -0.01)
        one.step(commands)
        other.step(commands)
        assert one.motion() == other.motion()


@pytest.mark.parametrize(
    ("model", "changes", "key", "says"),
    [
        ("c172", {}, "flight.model", "did you mean c172"),
        ("737", {"calibrated_airspeed": 40.0}, "flight.calibrated_airspeed_m_per_s", "trim"),
        ("f104", {"calibrated_airspeed": 150.0}, "flight", ""),
        ("ball", {}, "flight", ""),
        ("c172p", {"properties": {"fcs/flaps": 1.0}}, "flight.properties.fcs/flaps", "none is"),
    ],
)
def test_a_model_that_cannot_be_flown_is_refused(
    model: str, changes: dict[str, object], key: str, says: str
) -> None:
    flight = Flight(**{**C172.model_dump(), "model": model, **changes})
    with pytest.raises(InputError) as caught:
        JSBSimAirframe(flight, FRAME, CONTROLS, file="my.toml")
    assert caught.value.key.startswith(key)
    assert says in str(caught.value)
    assert str(caught.value).startswith("my.toml: flight")


def test_a_fly_by_wire_model_is_refused_for_its_indirect_controls() -> None:
    flight = Flight(model="f16", altitude=3000.0, calibrated_airspeed=180.0)
    with pytest.raises(InputError, match=r"no direct controls|does not trim"):
        check_direct_controls(flight, FRAME, CONTROLS)


def test_the_packaged_models_are_found() -> None:
    assert {"c172p", "T37", "737", "B747"} <= set(packaged_models())
