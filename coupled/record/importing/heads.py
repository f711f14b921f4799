"""Logs of JSBSim, FlightGear and X-Plane, recognised by their heads: they need no map.

JSBSim (`<output type="CSV">`): `Time`, then names with units, such as `q bar (psf)`, and properties
by their paths, `/fdm/jsbsim/velocities/q-rad_sec`. FlightGear (`/logging/log`, its README.logging):
`Time`, the simulated time in s, then properties by their paths, whose parts are numbered, as
`/orientation[0]/q-body[0]` (logger.cxx), or by titles of the user. X-Plane
(`Data.txt`): names in two parts separated by `|`, such as `_totl,_time |pitch,__deg |`.

Ambiguous columns are left out: X-Plane's `P`, `Q` and `R` (its documentation calls Q the yaw rate,
programs of its users the pitch rate), and positions of controls (shares of an unknown travel).
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from coupled.errors import InputError
from coupled.files import open_file
from coupled.record.importing.mapping import CHANNELS, Channel, Clock, Layout, LogMap
from coupled.record.importing.reading import format_of
from coupled.record.levers import lever_channel

LOOKED_AT_bytes = 2**17  # of a file, which contain its head
ANGLES = ("pitch_rad", "alpha_rad")
# Ratio to later steps, above which the first row precedes JSBSim's trim; half and twice change no
# log of `tests/record/importing/test_heads.py`.
JUMPS = 20.0
LEAST_JUMP_rad = 1e-5
# A column's name, with its channel and unit.
_JSBSIM = {
    "q bar (psf)": ("dynamic_pressure_Pa", "psf"),
    "V_{Total} (ft/s)": ("true_airspeed_m_per_s", "ft/s"),
    "Altitude ASL (ft)": ("altitude_m", "ft"),
    "Elevator Position (deg)": ("elevator_rad", "deg"),
    "Left Aileron Position (deg)": ("aileron_rad", "deg"),
    "Rudder Position (deg)": ("rudder_rad", "deg"),
    "P (deg/s)": ("roll_rate_rad_per_s", "deg/s"),
    "Q (deg/s)": ("pitch_rate_rad_per_s", "deg/s"),
    "R (deg/s)": ("yaw_rate_rad_per_s", "deg/s"),
    "Alpha (deg)": ("alpha_rad", "deg"),
    "Beta (deg)": ("sideslip_rad", "deg"),
    "Phi (deg)": ("roll_rad", "deg"),
    "Theta (deg)": ("pitch_rad", "deg"),
    "Psi (deg)": ("heading_rad", "deg"),
}
_TREE = "/fdm/jsbsim/"
_JSBSIM_PROPERTIES = {
    f"{_TREE}{name}": found
    for name, found in {
        "aero/qbar-psf": ("dynamic_pressure_Pa", "psf"),
        "accelerations/Nz": ("load_factor", "g"),
        "velocities/vt-fps": ("true_airspeed_m_per_s", "ft/s"),
        "position/h-sl-ft": ("altitude_m", "ft"),
        "fcs/elevator-pos-rad": ("elevator_rad", "rad"),
        "fcs/elevator-pos-deg": ("elevator_rad", "deg"),
        "fcs/left-aileron-pos-rad": ("aileron_rad", "rad"),
        "fcs/left-aileron-pos-deg": ("aileron_rad", "deg"),
        "fcs/rudder-pos-rad": ("rudder_rad", "rad"),
        "fcs/rudder-pos-deg": ("rudder_rad", "deg"),
        "velocities/p-rad_sec": ("roll_rate_rad_per_s", "rad/s"),
        "velocities/q-rad_sec": ("pitch_rate_rad_per_s", "rad/s"),
        "velocities/r-rad_sec": ("yaw_rate_rad_per_s", "rad/s"),
        "aero/alpha-rad": ("alpha_rad", "rad"),
        "aero/alpha-deg": ("alpha_rad", "deg"),
        "aero/beta-rad": ("sideslip_rad", "rad"),
        "aero/beta-deg": ("sideslip_rad", "deg"),
        "attitude/phi-rad": ("roll_rad", "rad"),
        "attitude/theta-rad": ("pitch_rad", "rad"),
        "attitude/psi-rad": ("heading_rad", "rad"),
        "attitude/phi-deg": ("roll_rad", "deg"),
        "attitude/theta-deg": ("pitch_rad", "deg"),
        "attitude/psi-deg": ("heading_rad", "deg"),
    }.items()
}
_FLIGHTGEAR = {
    "/position/altitude-ft": ("altitude_m", "ft"),
    "/orientation/roll-deg": ("roll_rad", "deg"),
    "/orientation/pitch-deg": ("pitch_rad", "deg"),
    "/orientation/heading-deg": ("heading_rad", "deg"),
    "/orientation/alpha-deg": ("alpha_rad", "deg"),
    "/orientation/side-slip-rad": ("sideslip_rad", "rad"),
    "/orientation/side-slip-deg": ("sideslip_rad", "deg"),
    "/orientation/p-body": ("roll_rate_rad_per_s", "rad/s"),
    "/orientation/q-body": ("pitch_rate_rad_per_s", "rad/s"),
    "/orientation/r-body": ("yaw_rate_rad_per_s", "rad/s"),
}
_XPLANE = {
    "Vtrue,_ktas": ("true_airspeed_m_per_s", "kt"),
    "__alt,ftmsl": ("altitude_m", "ft"),
    "p-alt,ftMSL": ("altitude_m", "ft"),
    "Gload,norml": ("load_factor", "g"),
    "alpha,__deg": ("alpha_rad", "deg"),
    "_beta,__deg": ("sideslip_rad", "deg"),
    "_roll,__deg": ("roll_rad", "deg"),
    "pitch,__deg": ("pitch_rad", "deg"),
    "hding,_true": ("heading_rad", "deg"),
}
# A lever's column, with JSBSim's property, as FlightGear's JSBSim.cxx copies them.
_ENGINE = r"/controls/engines/engine(\[\d+\])?/"
_LEVERS = [
    (re.compile(pattern), jsbsim)
    for pattern, jsbsim in (
        (rf"{_TREE}(.+)", r"\1"),
        (r"Flap Command \(norm\)", "fcs/flap-cmd-norm"),
        (r"/controls/flight/flaps", "fcs/flap-cmd-norm"),
        (r"/controls/flight/speedbrake", "fcs/speedbrake-cmd-norm"),
        (r"/controls/flight/spoilers", "fcs/spoiler-cmd-norm"),
        (r"/controls/gear/gear-down", "gear/gear-cmd-norm"),
        (r"/surface-positions/(flap|speedbrake|spoiler)s?-pos-norm", r"fcs/\1-pos-norm"),
        (r"/gear/gear/position-norm", "gear/gear-pos-norm"),
        (rf"{_ENGINE}(throttle|mixture)", r"fcs/\2-cmd-norm\1"),
        (rf"{_ENGINE}propeller-pitch", r"fcs/advance-cmd-norm\1"),
    )
]
XPLANE_TIMES = ("_totl,_time", "missn,_time", "_real,_time")


@dataclass(frozen=True)
class _Head:
    """A program's name, and the layout and columns of its log."""

    program: str
    delimiter: str
    time: str
    known: Mapping[str, tuple[str, str]]


def known_map(path: Path) -> tuple[str, LogMap]:
    """Return the program that wrote a log, and the map of its columns.

    Raises InputError if the head, the format or all of its columns are unknown.
    """
    with open_file(path) as file:
        text = file.read(LOOKED_AT_bytes).decode("utf-8-sig", "replace")
    line = next((line for line in text.splitlines() if line.strip()), "")
    found = _head(line)
    if found is None:
        format_of(path)  # no map reads a log of an unknown format
        problem = "its head is not JSBSim's, FlightGear's or X-Plane's: give --map, or --suggest"
        raise InputError(path, "", f"{problem} to have one proposed")
    head, names = found
    channels, levers = dict[str, Channel](), dict[str, Channel]()
    for name in sorted(names, key=_is_position):  # a command before a position
        channel, unit = head.known.get(_plain(name), ("", ""))
        if channel and names.count(name) == 1:
            channels.setdefault(channel, Channel(source=name, unit=unit))
        elif (lever := _lever(name)) and names.count(name) == 1:
            levers.setdefault(lever, Channel(source=name, own=True))
    if not channels:
        problem = f"{head.program} wrote it, but none of a record's motions under its own name"
        raise InputError(path, "", f"{problem}: give --map")
    ordered = {name: channels[name] for name in CHANNELS if name in channels} | levers
    layout = Layout(format="csv", delimiter=head.delimiter)
    angles = [names.index(channels[name].source) for name in ANGLES if name in channels]
    jsbsim = head.program == "JSBSim"
    start_s = _trimmed_from(text, head.delimiter, angles) if jsbsim else 0.0
    clock = Clock(source=head.time, unit="s", start=start_s)
    return head.program, LogMap(log=layout, clock=clock, channels=ordered)


def _trimmed_from(text: str, delimiter: str, columns: Sequence[int]) -> float:
    """Return the start of JSBSim's log in s: its second row if the first is from before the trim.

    An angle that no force can move within a frame then jumps once.
    """
    head, *lines = [line for line in text.splitlines() if line.strip()][:5]
    width = len(head.split(delimiter))
    try:
        rows = np.array([[float(cell) for cell in line.split(delimiter)] for line in lines])
    except ValueError:
        return 0.0
    if rows.shape != (4, width) or not columns:
        return 0.0
    first, *later = np.abs(np.diff(rows[:, list(columns)], axis=0))
    jumps = first > np.maximum(JUMPS * np.max(later, axis=0), LEAST_JUMP_rad)
    return float(rows[1, 0] - rows[0, 0]) if jumps.any() else 0.0


def _lever(name: str) -> str:
    """Return the channel of a lever's column (`levers`); "" for another column."""
    for program, jsbsim in _LEVERS:
        if (found := program.fullmatch(_plain(name))) is not None:
            return lever_channel(found.expand(jsbsim))
    return ""


def _is_position(name: str) -> bool:
    return "-pos-" in name or "/position-norm" in name


def _plain(name: str) -> str:
    """Return a property's path without the numbers of first nodes, as JSBSim has it."""
    return name.replace("[0]", "")


def _head(line: str) -> tuple[_Head, list[str]] | None:
    """Return the program of a head line, and the names of its columns."""
    names = [name.strip() for name in line.split("|")]
    time = next((time for time in XPLANE_TIMES if time in names), "")
    if time:
        return _Head("X-Plane", "|", time, _XPLANE), names
    for delimiter in (",", "\t", ";", " "):
        names = [name.strip() for name in line.split(delimiter)]
        if names[0] != "Time" or len(names) < 2:
            continue
        paths = [name for name in names[1:] if name.startswith("/")]
        if any(not _plain(name).startswith(_TREE) for name in paths):
            known = {**_FLIGHTGEAR, **_JSBSIM_PROPERTIES}
            return _Head("FlightGear", delimiter, "Time", known), names
        if paths or any(name in _JSBSIM for name in names):
            known = {**_JSBSIM, **_JSBSIM_PROPERTIES}
            return _Head("JSBSim", delimiter, "Time", known), names
    return None
