"""The linkage's effects in the library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from coupled.gap.effects.effect import (
    Effect,
    ModelError,
    Switch,
    added,
    entry,
    factor,
    keys_of,
    limit,
    real_bend,
    value,
)
from coupled.gap.effects.seen import MODES_Hz, modes, saturations
from coupled.gap.thresholds import SETTING, YIELDING_ERROR

SERVO = "loader.servo_frequency_Hz"
DAMPING_RATIO = replace(
    factor("loader.servo_damping_ratio", 1.0), name="damping_factor", role="other", may_end=True
)
# A stiff contact closes within a frame, so its stiffness is known no better than a friction's.
_CONTACT = limit(
    *("stiffness_N_per_{d}", "loader.play_stiffness_N_per_{d}", 1e3, 1e8, 5e5, 1e5, 2e4),
    model_error=ModelError(YIELDING_ERROR),
)
_PLAY = added("play_{d}", "loader.play_{d}", 0, 0.1, 1e-3)
# Of another effect of the bend: it starts at the nominal value.
_BEND_BESIDE = real_bend(1e-6, above="loader.bend_{d}_per_N")
# A servo fitted without its dead time has too low a frequency: it is fitted again with the delay,
# and in `servo_tuning` the damping ratio as well.
_SERVO_AND_DELAY = (
    added("delay_s", "loader.servo_delay_s", 0, 0.45, 0.02, 0.05, 0.1),
    replace(factor(SERVO, 1.0), starts=(1.0, 3.0, 8.0), role="other", may_end=True),
)
_SERVO_DRAWN = ("speed", "deflection_left", "law", 0.8)
_effect = partial(entry, "linkage")
LINKAGE: tuple[Effect, ...] = (
    _effect("bend", ("force", "bent"), real_bend(5e-5)),
    _effect(
        "stiffening_bend",
        ("force", "bent"),
        real_bend(1e-4),
        limit("limit_{d}", "loader.bend_limit_{d}", 1e-4, 1, 5e-3, 2e-2),
        seen=saturations,
        contains=("bend",),
    ),
    _effect("backlash", ("computed", "deflection_left", "loop"), _PLAY),
    _effect(
        "soft_backlash",
        ("force", "deflection_left", "loop"),
        _PLAY,
        replace(_CONTACT, role="shape"),
        contains=("backlash", "yielding_contact"),
    ),
    # Of a loader whose motion is imposed; otherwise, and of the grip, a bend is the same.
    _effect("yielding_contact", ("speed", "missing", "loop"), _CONTACT),
    _effect(
        "bend_hysteresis",
        ("force", "bent", "loop", 6.0),
        _BEND_BESIDE,
        value("share", "loader.bend_hysteresis_share", 0, 0.98, 0.3, role="other"),
        value("width_N", "loader.bend_hysteresis_width_N", 0, 500, 5.0, 1.0, 25.0, role="other"),
        contains=("bend",),
    ),
    _effect(
        "structural_mode",
        ("force", "bent", "loop", 1.5),
        _BEND_BESIDE,
        limit("frequency_Hz", "loader.bend_frequency_Hz", *MODES_Hz, 8.0),
        value("damping_ratio", "loader.bend_damping_ratio", 0, 2, 0.05, role="other", may_end=True),
        seen=modes,
        contains=("bend",),
    ),
    _effect("servo_lag", _SERVO_DRAWN, factor(SERVO, 0.8, tolerance=SETTING)),
    _effect("no_servo", _SERVO_DRAWN, Switch("", SERVO, "switch", on=0.0)),
    _effect(
        "servo_rate_limit",
        ("speed", "servo_speed", "law", 1.5),
        limit("rate_{d}_per_s", "loader.servo_rate_limit_{d}_per_s", 1e-4, 10, 0.1, 0.18),
    ),
    # A motor's torque limit, or the ramp of a servo's profile; smaller accelerations are unchanged.
    _effect(
        "servo_acceleration_limit",
        ("speed", "servo_speed", "law", 1.5),
        limit(
            *("acceleration_{d}_per_s2", "loader.servo_acceleration_limit_{d}_per_s2"),
            *(1e-2, 1e4, 30.0, 10.0),
        ),
    ),
    _effect("servo_delay", _SERVO_DRAWN, *_SERVO_AND_DELAY, contains=("servo_lag",)),
    _effect(
        "servo_tuning",
        _SERVO_DRAWN,
        *(*_SERVO_AND_DELAY, DAMPING_RATIO),
        contains=("servo_lag", "servo_delay"),
    ),
    _effect(
        "arc_geometry",
        ("deflection", "deflection_left"),
        Switch("", "loader.arc_geometry", "switch", on=True),
    ),
)


def without_servo(effects: Sequence[Effect]) -> list[Effect]:
    """Return the linkage's effects for a rig without a servo.

    A lag has the servo's frequency as its parameter, not a factor on it. Of the other effects of a
    servo, only dead time and rate limit remain.
    """
    lag = limit("frequency_Hz", SERVO, 0.5, 1000, 10.0, 30.0)
    found = []
    for effect in effects:
        keys = keys_of([effect])
        others = tuple(p for p in effect.parameters if p.key != SERVO and p != DAMPING_RATIO)
        if any(key.startswith("loader.servo_acceleration") for key in keys):
            continue
        if SERVO not in keys:
            found.append(effect)
        elif effect.free and len(others) + 1 == len(keys):
            found.append(replace(effect, parameters=others or (lag,)))
    return found
