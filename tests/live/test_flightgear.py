"""FlightGear's packet against its published layout, field by field."""

from __future__ import annotations

import socket
import struct

import pytest

from coupled.flight.runfile import read_run
from coupled.live.flightgear import flightgear, pack, start_line
from coupled.live.host import Plan
from coupled.live.session import fly_live
from coupled.live.view import Picture

# FGNetFDM of net_fdm.hxx, version 24: each member, its type and how many of it.
LAYOUT = """
    version I 1, padding I 1, longitude d 1, latitude d 1, altitude d 1, agl f 1, phi f 1,
    theta f 1, psi f 1, alpha f 1, beta f 1, phidot f 1, thetadot f 1, psidot f 1, vcas f 1,
    climb_rate f 1, v_north f 1, v_east f 1, v_down f 1, v_body_u f 1, v_body_v f 1, v_body_w f 1,
    A_X_pilot f 1, A_Y_pilot f 1, A_Z_pilot f 1, stall_warning f 1, slip_deg f 1, num_engines I 1,
    eng_state I 4, rpm f 4, fuel_flow f 4, fuel_px f 4, egt f 4, cht f 4, mp_osi f 4, tit f 4,
    oil_temp f 4, oil_px f 4, num_tanks I 1, fuel_quantity f 4, num_wheels I 1, wow I 3,
    gear_pos f 3, gear_steer f 3, gear_compression f 3, cur_time I 1, warp i 1, visibility f 1,
    elevator f 1, elevator_trim_tab f 1, left_flap f 1, right_flap f 1, left_aileron f 1,
    right_aileron f 1, rudder f 1, nose_wheel f 1, speedbrake f 1, spoilers f 1
"""


def fields(packet: bytes) -> dict[str, float]:
    """Return the packet's members by name, the first of each."""
    found, at = {}, 0
    for member in LAYOUT.split(","):
        name, kind, count = member.split()
        found[name] = struct.unpack_from(f">{kind}", packet, at)[0]
        at += struct.calcsize(f">{kind}") * int(count)
    assert at == len(packet)
    return found


def test_each_field_lies_where_the_layout_has_it() -> None:
    numbers = [float(n) / 64.0 for n in range(1, len(Picture._fields) + 1)]
    picture = Picture(*numbers)
    packet = pack(picture, unix_s=1234567890)
    assert len(packet) == 408
    found = fields(packet)
    assert (found["version"], found["cur_time"]) == (24, 1234567890)
    names = "longitude latitude altitude agl phi theta psi alpha beta phidot thetadot psidot vcas"
    names += " climb_rate v_north v_east v_down v_body_u v_body_v v_body_w A_X_pilot A_Y_pilot"
    names += " A_Z_pilot elevator left_aileron right_aileron rudder"
    for name, wanted in zip(names.split(), picture, strict=True):
        assert found[name] == wanted, name
    assert found["slip_deg"] == pytest.approx(57.29578 * picture.beta_rad, rel=1e-6)
    assert found["visibility"] == 20000.0


@pytest.mark.slow
def test_a_flight_is_seen_as_it_is_flown() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as view:
        view.bind(("127.0.0.1", 0))
        view.settimeout(5.0)
        port = view.getsockname()[1]
        manoeuvre = read_run("capture")[0]
        plan = Plan(paced=False, watchers=[flightgear("127.0.0.1", port)])
        record = fly_live(manoeuvre, plan).record
        first = fields(view.recv(1024))
    assert first["theta"] == pytest.approx(record["pitch_rad"][0], rel=1e-6)
    assert first["altitude"] == pytest.approx(record["altitude_m"][0], rel=1e-6)
    assert first["v_down"] == pytest.approx(-first["climb_rate"], abs=0.01)
    assert f",{port},udp" in start_line(port)
