"""X-Plane's VEHX message against the layout that others' documentation gives, field by field."""

from __future__ import annotations

import math
import socket
import struct
from pathlib import Path

import pytest

from coupled.flight.runfile import read_run
from coupled.live.host import Plan
from coupled.live.session import fly_live
from coupled.live.view import Picture
from coupled.live.xplane import pack, xplane
from tests.support.commands import coupled

# Where each field begins, and its type; names as in XPPython3's documentation.
LAYOUT = {
    "p": (5, "<i"),
    "dat_lat": (9, "<d"),
    "dat_lon": (17, "<d"),
    "dat_ele": (25, "<d"),
    "veh_psi_true": (33, "<f"),
    "veh_the": (37, "<f"),
    "veh_phi": (41, "<f"),
}


def fields(packet: bytes) -> dict[str, float]:
    """Return a message's fields by name."""
    assert packet[:5] == b"VEHX\0"
    assert len(packet) == 45
    return {name: struct.unpack_from(kind, packet, at)[0] for name, (at, kind) in LAYOUT.items()}


def test_each_field_lies_where_the_layout_has_it_in_degrees_and_metres() -> None:
    numbers = dict.fromkeys(Picture._fields, 9.9)
    numbers |= {"latitude_rad": 0.9, "longitude_rad": -2.1, "altitude_m": 3048.0}
    numbers |= {"heading_rad": 4.0, "pitch_rad": 0.1, "roll_rad": -0.5}
    found = fields(pack(Picture(**numbers)))
    assert found.pop("p") == 0
    deg = 180.0 / math.pi
    wanted = {"dat_lat": 0.9 * deg, "dat_lon": -2.1 * deg, "dat_ele": 3048.0}
    wanted |= {"veh_psi_true": 4.0 * deg, "veh_the": 0.1 * deg, "veh_phi": -0.5 * deg}
    assert found == pytest.approx(wanted, rel=1e-7)


def test_a_flight_is_seen_as_it_is_flown() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as view:
        view.bind(("127.0.0.1", 0))
        view.settimeout(5.0)
        plan = Plan(paced=False, watchers=[xplane("127.0.0.1", view.getsockname()[1])])
        record = fly_live(read_run("capture")[0], plan).record
        first = fields(view.recv(1024))
    assert first["veh_the"] == pytest.approx(math.degrees(record["pitch_rad"][0]), rel=1e-6)
    assert first["dat_ele"] == pytest.approx(record["altitude_m"][0], rel=1e-6)
    assert first["veh_phi"] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(
    ("option", "place", "says"),
    [("--xplane", "here", "give HOST:PORT"), ("--flightgear", "here:0", "'0' is no port")],
)
def test_an_invalid_address_names_its_option(
    option: str, place: str, says: str, tmp_path: Path
) -> None:
    result = coupled(tmp_path, "live", "capture", option, place)
    assert result.returncode == 2
    assert f"{option}: " in result.stderr
    assert says in " ".join(result.stderr.split())
    assert not list(tmp_path.iterdir())
