"""A view in X-Plane 11 or later: its UDP message VEHX, 45 bytes, little-endian.

The layout is that of XPPython3's documentation ("VEHX - Drive X-Planes Visuals") and of issue 3 of
libXPlane-UDP-Client: aircraft, latitude, longitude and elevation, true heading, pitch and roll.
According to the former, X-Plane then no longer flies that aircraft itself. Laminar Research's own
text was not read, and this was not tried with X-Plane.
"""

from __future__ import annotations

import math
import struct

from coupled.live.view import Picture, View

PORT = 49000
OWN_AIRCRAFT = 0
PACKET = struct.Struct("<4sxi3d3f")
assert PACKET.size == 45


def pack(p: Picture) -> bytes:
    """Return the message of a picture."""
    place = (math.degrees(p.latitude_rad), math.degrees(p.longitude_rad), p.altitude_m)
    turned = (p.heading_rad, p.pitch_rad, p.roll_rad)
    return PACKET.pack(b"VEHX", OWN_AIRCRAFT, *place, *map(math.degrees, turned))


def xplane(host: str = "127.0.0.1", port: int = PORT) -> View:
    """Return the view in an X-Plane at `host:port`."""
    return View("xplane", host, port, pack)
