"""A view in FlightGear: its native FDM packets, version 24, 408 bytes in network order.

The layout is FlightGear's own, `src/Network/net_fdm.hxx` with FG_NET_FDM_VERSION = 24; the units
are those of its fields. Engines, tanks and wheels are sent as zero in number.
"""

from __future__ import annotations

import math
import struct
import time

from coupled.live.view import Picture, RATE_Hz, View

PORT = 5500
VERSION = 24
# version, padding, longitude latitude altitude, agl to slip; engines; tanks; wheels; time, warp,
# visibility; surfaces.
PACKET = struct.Struct(">II3d6f11f3f2f" + "I4I36f" + "I4f" + "I3I9f" + "Iif" + "10f")
assert PACKET.size == 408


def pack(p: Picture, unix_s: int, visibility_m: float = 20000.0) -> bytes:
    """Return the packet of a picture."""
    moving = (p.alpha_rad, p.beta_rad, *p[9:23])
    surfaces = (p.elevator_norm, 0.0, 0.0, 0.0, p.left_aileron_norm, p.right_aileron_norm)
    return PACKET.pack(
        *(VERSION, 0, p.longitude_rad, p.latitude_rad, p.altitude_m, p.agl_m),
        *(p.roll_rad, p.pitch_rad, p.heading_rad, *moving),
        *(0.0, math.degrees(p.beta_rad)),  # stall warning, slip
        *(0, *[0] * 4, *[0.0] * 36),
        *(0, *[0.0] * 4),
        *(0, *[0] * 3, *[0.0] * 9),
        *(unix_s % (1 << 32), 0, visibility_m),
        *(*surfaces, p.rudder_norm, 0.0, 0.0, 0.0),
    )


def start_line(port: int, rate_Hz: float = RATE_Hz) -> str:
    """Return the command that starts FlightGear as a view."""
    return (
        f"fgfs --fdm=null --native-fdm=socket,in,{rate_Hz:g},,{port},udp --timeofday=noon"
        " --disable-real-weather-fetch --disable-terrasync"
    )


def flightgear(host: str = "127.0.0.1", port: int = PORT) -> View:
    """Return the view in a FlightGear at `host:port`."""
    return View("flightgear", host, port, lambda picture: pack(picture, int(time.time())))
