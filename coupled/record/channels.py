"""The names of controls, and of a record's channels; each channel ends in its unit.

The channels of a control come from the rig, those of the motion from the airframe. A bench record
has no motion except the dynamic pressure given to the host. Channels of sensors hold readings;
`hand_force` is the true force of the hand.
"""

from __future__ import annotations

import difflib
from collections.abc import Container, Sequence
from functools import cache
from typing import Literal

from coupled.errors import InputError
from coupled.units import parse_unit

ControlName = Literal["column", "wheel", "pedals"]
CONTROL_NAMES: tuple[ControlName, ...] = ("column", "wheel", "pedals")
SURFACES = {"column": "elevator", "wheel": "aileron", "pedals": "rudder"}


def unit_of(control: str) -> str:
    """Return the unit of a control's deflection."""
    return "rad" if control == "wheel" else "m"


TIME = "time_s"

# Of a live record: the validity of each row, and the loader's own time of its sample.
VALIDITY = "validity"
LOADER_TIME = "loader_time_s"
# Values of the channel `validity`; the first that applies from the left:
# LOST      no answer of the loader for longer than the watchdog's time: its last sample is repeated
# REPEATED  no new sample since the row before: its sample is repeated
# FADED     the forces ordered were not those of the rig: they were faded or limited
# SWITCHED  flown with other settings than at the start, which the manifest lists
FRESH, REPEATED, LOST, FADED, SWITCHED = range(5)

# In the order in which the frame kernel writes them; d is m, or rad for a wheel.
_CONTROL = (
    "force_N",
    "computed_{d}",
    "deflection_{d}",
    "estimate_{d}",
    "gradient_N_per_{d}",
    "modifying_force_N",
    "force_step_N",  # the jump of F_mod at this frame
    "surface_norm",  # command about trim over the next frame, JSBSim's sign
    "stop",  # the stop reached over the frame before: −1, 0 or +1
    "hand_force_N",  # the true F of the hand; `force` is the strain gauge's reading
)
_NOISY = (0, 1, 2, 5)

# The aircraft's rotation by each control, as a rate and as an angle.
RATE: dict[ControlName, str] = {
    "column": "pitch_rate_rad_per_s",
    "wheel": "roll_rate_rad_per_s",
    "pedals": "yaw_rate_rad_per_s",
}
ATTITUDE: dict[ControlName, str] = {
    "column": "pitch_rad",
    "wheel": "roll_rad",
    "pedals": "heading_rad",
}
BENCH_MOTION = ("dynamic_pressure_Pa",)
LONGITUDINAL = (
    "dynamic_pressure_Pa",
    "load_factor",
    "elevator_rad",
    "pitch_rate_rad_per_s",
    "alpha_rad",
    "pitch_rad",
    "true_airspeed_m_per_s",
    "altitude_m",
)
# Their indices in the motion, which the airframe gives in this order.
PRESSURE = LONGITUDINAL.index("dynamic_pressure_Pa")
LOAD = LONGITUDINAL.index("load_factor")
ELEVATOR = LONGITUDINAL.index("elevator_rad")
PITCH_RATE = LONGITUDINAL.index("pitch_rate_rad_per_s")
ALPHA = LONGITUDINAL.index("alpha_rad")
PITCH = LONGITUDINAL.index("pitch_rad")
SPEED = LONGITUDINAL.index("true_airspeed_m_per_s")
ALTITUDE = LONGITUDINAL.index("altitude_m")
LATERAL = (
    "aileron_rad",
    "rudder_rad",
    "roll_rate_rad_per_s",
    "yaw_rate_rad_per_s",
    "sideslip_rad",
    "roll_rad",
    "heading_rad",
)
WHOLE_MOTION = len(LONGITUDINAL) + len(LATERAL)  # input of the rig's frame, on any rig
# In the motion of a rig with wheel or pedals they follow the longitudinal ones.
ROLL = len(LONGITUDINAL) + LATERAL.index("roll_rad")
HEADING = len(LONGITUDINAL) + LATERAL.index("heading_rad")
SIDESLIP = len(LONGITUDINAL) + LATERAL.index("sideslip_rad")


def motion_channels(controls: Sequence[str], flown: bool) -> tuple[str, ...]:
    """Return the motion's channels: on a rig with wheel or pedals, the lateral ones too."""
    if not flown:
        return BENCH_MOTION
    return LONGITUDINAL + (LATERAL if set(controls) - {"column"} else ())


@cache
def control_channels(control: str) -> tuple[str, ...]:
    """Return the channels of one control, in the kernel's order."""
    return tuple(f"{control}_{name.format(d=unit_of(control))}" for name in _CONTROL)


def channel(control: str, quantity: str) -> str:
    """Return the channel of a control's quantity, for example `channel("wheel", "computed")`."""
    for name, plain in zip(control_channels(control), _CONTROL, strict=True):
        if plain.split("_{d}")[0].split("_N")[0] == quantity:
            return name
    raise KeyError(quantity)


def motions_in(recorded: Container[str], control: str) -> list[str]:
    """Return the recorded channels of a control's motion, δc before δ."""
    names = (channel(control, quantity) for quantity in ("computed", "deflection"))
    return [name for name in names if name in recorded]


def record_channels(controls: Sequence[str], flown: bool) -> tuple[str, ...]:
    """Return all channels of a flight, or of a bench, in the kernel's order."""
    names = [TIME]
    for control in controls:
        names += control_channels(control)
    return (*names, *motion_channels(controls, flown))


def noisy_channels(controls: Sequence[str], flown: bool) -> list[str]:
    """Return the channels of sensors, for which noise may be given."""
    names = [control_channels(control)[i] for control in controls for i in _NOISY]
    return names + list(motion_channels(controls, flown))


# Similarity by `difflib`, above which a name is a known one, mistyped: two letters exchanged in a
# name of 13 letters give 0.92, and two channels of a record at most 0.86.
_MISTYPED = 0.9


def misnamed(names: Sequence[str]) -> tuple[str, str] | None:
    """Return the first name that is a mistyped channel, or one in another unit, and its right name.

    The right one is absent. Other names are a user's own channels, which a record may have.
    """
    known = record_channels(CONTROL_NAMES, flown=True)
    absent = [name for name in known if name not in names]
    stems = {_stem(name): name for name in absent}
    plain = {name.casefold(): name for name in absent}
    for name in names:
        if name in (*known, VALIDITY, LOADER_TIME):
            continue
        alike = difflib.get_close_matches(name.casefold(), plain, n=1, cutoff=_MISTYPED)
        meant = stems.get(_stem(name)) or (plain[alike[0]] if alike else None)
        if meant is not None:
            return name, meant
    return None


def _stem(name: str) -> str:
    """Return a channel's name without its unit, in lower case."""
    words = name.split("_")
    for i in range(1, len(words)):
        if parse_unit("_".join(words[i:]).replace("_per_", "/")) is not None:
            return "_".join(words[:i]).casefold()
    return name.casefold()


def unit_at_end(name: str) -> str:
    """Return the unit that ends a channel's name: K of `motor_temperature_K`, or its last word."""
    head, per, last = name.rpartition("_per_")
    return head.rpartition("_")[2] + per + last if per else name.rpartition("_")[2]


def control_named(word: str, file: object) -> ControlName:
    """Return the control of a word; raises InputError for another, with the file."""
    for name in CONTROL_NAMES:
        if name == word:
            return name
    raise InputError(file, "--control", f"is {word!r}; one of {', '.join(CONTROL_NAMES)}")
