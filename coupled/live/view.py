"""The picture of a live flight, and views that receive it over UDP, frame by frame."""

from __future__ import annotations

import contextlib
import socket
import struct
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from coupled.live.udp import resolved
from coupled.units import FOOT_m

if TYPE_CHECKING:
    from coupled.live.host import Host, Request

RATE_Hz = 60.0  # at most; a view draws no faster


class Picture(NamedTuple):
    """The data of a view: JSBSim's properties, each in its field's unit."""

    longitude_rad: float
    latitude_rad: float
    altitude_m: float
    agl_m: float
    roll_rad: float
    pitch_rad: float
    heading_rad: float
    alpha_rad: float
    beta_rad: float
    roll_rate_rad_per_s: float
    pitch_rate_rad_per_s: float
    heading_rate_rad_per_s: float
    calibrated_kt: float
    climb_ft_per_s: float
    north_ft_per_s: float
    east_ft_per_s: float
    down_ft_per_s: float
    body_u_ft_per_s: float
    body_v_ft_per_s: float
    body_w_ft_per_s: float
    pilot_x_ft_per_s2: float
    pilot_y_ft_per_s2: float
    pilot_z_ft_per_s2: float
    elevator_norm: float
    left_aileron_norm: float
    right_aileron_norm: float
    rudder_norm: float


_FOOT = FOOT_m
# JSBSim's property behind each field of a picture, and the factor on it.
PROPERTIES: tuple[tuple[str, float], ...] = (
    ("position/long-gc-rad", 1.0),
    ("position/lat-geod-rad", 1.0),
    ("position/h-sl-ft", _FOOT),
    ("position/h-agl-ft", _FOOT),
    ("attitude/phi-rad", 1.0),
    ("attitude/theta-rad", 1.0),
    ("attitude/psi-rad", 1.0),
    ("aero/alpha-rad", 1.0),
    ("aero/beta-rad", 1.0),
    ("velocities/phidot-rad_sec", 1.0),
    ("velocities/thetadot-rad_sec", 1.0),
    ("velocities/psidot-rad_sec", 1.0),
    ("velocities/vc-kts", 1.0),
    ("velocities/h-dot-fps", 1.0),
    ("velocities/v-north-fps", 1.0),
    ("velocities/v-east-fps", 1.0),
    ("velocities/v-down-fps", 1.0),
    ("velocities/u-fps", 1.0),
    ("velocities/v-fps", 1.0),
    ("velocities/w-fps", 1.0),
    ("accelerations/a-pilot-x-ft_sec2", 1.0),
    ("accelerations/a-pilot-y-ft_sec2", 1.0),
    ("accelerations/a-pilot-z-ft_sec2", 1.0),
    ("fcs/elevator-pos-norm", 1.0),
    ("fcs/left-aileron-pos-norm", 1.0),
    ("fcs/right-aileron-pos-norm", 1.0),
    ("fcs/rudder-pos-norm", 1.0),
)
assert len(PROPERTIES) == len(Picture._fields)


class Pictures:
    """Reads the pictures of a host's aircraft; properties that its model lacks are 0."""

    def __init__(self, host: Host) -> None:
        assert host.access is not None
        read: Callable[[str], Callable[[], float] | None]
        read = getattr(host.access.airframe, "reader", lambda name: None)
        found = [(read(name), factor) for name, factor in PROPERTIES]
        self._reads = [(one, factor) for one, factor in found if one is not None]
        self._at = [i for i, (one, _) in enumerate(found) if one is not None]

    def now(self) -> Picture:
        """Return the current picture."""
        values = [0.0] * len(PROPERTIES)
        for i, (read, factor) in zip(self._at, self._reads, strict=True):
            values[i] = factor * read()
        return Picture(*values)


class View:
    """Sends pictures to `host:port`, each packed by `packet`; it does not wait for answers."""

    def __init__(self, name: str, host: str, port: int, packet: Callable[[Picture], bytes]) -> None:
        family, self._address = resolved(host, port, f"{name} {host}:{port}")
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._packet = packet

    def begin(self, host: Host) -> None:
        """Start."""
        self._pictures = Pictures(host)
        self._every = max(1, round(1.0 / (host.frame_s * RATE_Hz)))

    def observe(self, host: Host, k: int) -> None:
        """Send the picture; errors of the network are ignored."""
        if k % self._every == 0:
            with contextlib.suppress(OSError, OverflowError, struct.error):
                self._socket.sendto(self._packet(self._pictures.now()), self._address)

    def requests(self) -> Sequence[Request]:
        """Return no requests."""
        return ()

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
