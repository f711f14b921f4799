"""Effects of the airframe: its forces and moments, its mass, and the motion of the air.

An effect whose moment needs lateral motion is tried only with records that have its channel.
"""

from __future__ import annotations

from dataclasses import replace

from coupled.gap.effects.effect import TERMS, Drawing, Effect, Sampled, added, entry, factor, value
from coupled.gap.signals.air import NEEDS, NEEDS_ACROSS, spread_of_air, spread_of_crossing_air
from coupled.rig.recorder import ZEROS

_ROLL, _YAW, _SLIP = "roll_rate_rad_per_s", "yaw_rate_rad_per_s", "sideslip_rad"
TERM = "term"  # the name of an effect of a named function, in the JSON
_NEEDS = {"ROLL": (_ROLL,), "YAW": (_YAW,), "SIDE": (_SLIP,), "Y": (_SLIP,)}
_DRAWN = {
    "ROLL": ("roll_rate", "roll_left", "law", 4.0),
    "YAW": ("yaw_rate", "yaw_left", "law", 4.0),
    "SIDE": ("sideslip", "yaw_left", "law", 4.0),
    "PITCH": ("alpha", "pitch_rate", "loop", 4.0),
}


# A derivative of a model may be missing or have the wrong sign; a mass or a force is positive.
_ANY_SIGN, _POSITIVE = (-10.0, 10.0), (0.1, 10.0)


def _factor_on(
    name: str,
    start: float,
    x: str,
    y: str,
    drawing: Drawing = "law",
    needs: tuple[str, ...] = (),
    bounds: tuple[float, float] = _ANY_SIGN,
) -> Effect:
    """Return the effect of a factor of the rig's `flight` section."""
    number = factor(f"flight.{name}", start, *bounds)
    return entry("airframe", name, (x, y, drawing, 4.0), number, needs=needs)


def _constant(name: str, x: str, y: str, start: float, needs: tuple[str, ...] = ()) -> Effect:
    """Return the effect of a constant coefficient of a force or moment."""
    number = added("coefficient", f"flight.{name}", -1.0, 1.0, start)
    return entry("airframe", name, (x, y, "loop", 4.0), number, needs=needs)


def _gust(name: str, key: str, drawn: str, needs: tuple[str, ...]) -> Effect:
    """Return the effect of gusts, by the key of their rms."""
    number = value("rms_m_per_s", f"flight.{key}", 0, 30, 0.5)
    error = Sampled(spread_of_crossing_air if name == "lateral_gust" else spread_of_air)
    return entry("airframe", name, ("", drawn, "time", 6.0), number, needs=needs, sampled=error)


AIRFRAME: tuple[Effect, ...] = (
    _factor_on("elevator_effectiveness", 0.9, "elevator", "pitch_rate", "loop"),
    _factor_on("aileron_effectiveness", 0.9, "aileron", "roll_rate", "loop", (_ROLL,)),
    _factor_on("rudder_effectiveness", 0.9, "rudder", "yaw_rate", "loop", (_YAW,)),
    _factor_on("pitch_damping", 1.2, "pitch_rate", "pitch_left"),
    _factor_on("roll_damping", 1.2, "roll_rate", "roll_left", needs=(_ROLL,)),
    _factor_on("yaw_damping", 1.2, "yaw_rate", "yaw_left", needs=(_YAW,)),
    _factor_on("pitch_stiffness", 1.1, "alpha", "pitch_rate", "loop"),
    _factor_on("dihedral_effect", 1.1, "sideslip", "roll_rate", "loop", (_ROLL,)),
    _factor_on("directional_stability", 1.1, "sideslip", "yaw_rate", "loop", (_YAW,)),
    _factor_on("side_force_slope", 1.1, "sideslip", "yaw_left", needs=(_SLIP,)),
    _factor_on("adverse_yaw", 1.2, "aileron", "yaw_rate", "loop", (_YAW,)),
    _factor_on("lift_slope", 0.97, "alpha", "load_answer", "loop", bounds=(0.2, 5.0)),
    _factor_on("drag", 1.1, "alpha", "load_answer", "loop", bounds=_POSITIVE),
    _factor_on("thrust", 1.1, "alpha", "load_answer", "loop", bounds=_POSITIVE),
    _factor_on("mass", 1.03, "alpha", "load_answer", "loop", bounds=(0.3, 3.0)),
    replace(  # mass, centre of gravity along two axes, and three moments of inertia
        _factor_on("fuel", 0.8, "alpha", "load_answer", "loop", bounds=(0.0, 10.0)), changes=6
    ),
    _factor_on("roll_inertia", 1.1, "aileron", "roll_rate", "loop", (_ROLL,), _POSITIVE),
    _factor_on("pitch_inertia", 1.1, "elevator", "pitch_rate", "loop", bounds=_POSITIVE),
    _factor_on("yaw_inertia", 1.1, "rudder", "yaw_rate", "loop", (_YAW,), _POSITIVE),
    entry(
        *("airframe", "center_of_gravity", ("alpha", "pitch_rate", "loop", 4.0)),
        added("aft_m", "flight.cg_aft_m", -2.0, 2.0, 0.02),
    ),
    _constant("pitching_moment", "alpha", "pitch_rate", 0.01),
    _constant("lift_offset", "alpha", "load_answer", 0.01),
    _constant("yawing_moment", "rudder", "yaw_rate", 0.001, (_YAW,)),
    _constant("side_force", "sideslip", "yaw_left", 0.01, (_SLIP,)),
    _gust("vertical_gust", "gust_rms_m_per_s", "air", NEEDS),
    _gust("lateral_gust", "lateral_gust_rms_m_per_s", "crossing_air", NEEDS_ACROSS),
)


def _zero(
    name: str, number: str, key: str, drawn: tuple[str, str], most: float, start: float
) -> Effect:
    """Return the effect of a sensor of the motion that reads other than 0 at zero."""
    offset = added(number, f"flight.{key}", -most, most, start)
    needs = (CHANNEL_OF[name],)
    return entry("sensing", name, (*drawn, "loop", 4.0), offset, outputs=("airframe",), needs=needs)


CHANNEL_OF = {field: channel for channel, field in ZEROS.items()}
MOTION_ZEROS: tuple[Effect, ...] = (
    _zero(
        "elevator_zero", "offset_rad", "elevator_zero_rad", ("elevator", "pitch_rate"), 0.5, 0.01
    ),
    _zero("alpha_zero", "offset_rad", "alpha_zero_rad", ("alpha", "load_answer"), 0.5, 0.01),
    _zero("sideslip_zero", "offset_rad", "sideslip_zero_rad", ("sideslip", "yaw_rate"), 0.5, 0.01),
    _zero("pitch_zero", "offset_rad", "pitch_zero_rad", ("alpha", "load_answer"), 0.5, 0.01),
    _zero("load_factor_zero", "offset", "load_factor_zero", ("alpha", "load_answer"), 2.0, 0.01),
    *(
        _zero(
            *(f"{axis}_rate_zero", "offset_rad_per_s", f"{axis}_rate_zero_rad_per_s"),
            *((x, f"{axis}_rate"), 1.0, 0.01),
        )
        for axis, x in (("pitch", "elevator"), ("roll", "aileron"), ("yaw", "rudder"))
    ),
)


def term(function: str, axis: str) -> Effect:
    """Return the effect of a factor on a named function of an axis of the model's aerodynamics."""
    number = factor(f"flight.{TERMS}{function}", 0.9, *_ANY_SIGN)
    drawn = _DRAWN.get(axis, ("alpha", "load_answer", "loop", 4.0))
    needs = _NEEDS.get(axis, ())
    return entry("airframe", f"{TERM} {function}", drawn, number, needs=needs, of=function)
