"""The linkage's effects in the library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from coupled.gap.effects.effect import (
    Effect,
    ModelError,
    Signature,
    added,
    factor,
    limit,
    one,
    real_bend,
    switch,
    value,
)
from coupled.gap.effects.seen import MODES_Hz, modes, saturations
from coupled.gap.thresholds import SETTING, YIELDING_ERROR

SERVO = "loader.servo_frequency_Hz"
DAMPING_RATIO = replace(
    factor("loader.servo_damping_ratio", 1.0),
    name="damping_factor",
    role="other",
    may_end=True,
)
# A stiff contact closes within a frame, so its stiffness is known no better than a friction's.
_CONTACT = limit(
    "stiffness_N_per_{d}",
    "loader.play_stiffness_N_per_{d}",
    1e3,
    1e8,
    5e5,
    1e5,
    2e4,
    model_error=ModelError(YIELDING_ERROR),
)
# Of another effect of the bend: it starts at the nominal value.
_BEND_BESIDE = real_bend(1e-6, above="loader.bend_{d}_per_N")
LINKAGE: tuple[Effect, ...] = (
    one("linkage", "bend", real_bend(5e-5), *("force", "bent")),
    Effect(
        "stiffening_bend",
        "linkage",
        (real_bend(1e-4), limit("limit_{d}", "loader.bend_limit_{d}", 1e-4, 1, 5e-3, 2e-2)),
        Signature("force", "bent"),
        seen=saturations,
        contains=("bend",),
    ),
    one(
        "linkage",
        "backlash",
        added("play_{d}", "loader.play_{d}", 0, 0.1, 1e-3),
        *("computed", "deflection_left", "loop"),
    ),
    Effect(
        "soft_backlash",
        "linkage",
        (
            added("play_{d}", "loader.play_{d}", 0, 0.1, 1e-3),
            replace(_CONTACT, role="shape"),
        ),
        Signature("force", "deflection_left", "loop"),
        contains=("backlash", "yielding_contact"),
    ),
    # Of a loader whose motion is imposed; otherwise, and of the grip, a bend is the same.
    one("linkage", "yielding_contact", _CONTACT, *("speed", "missing", "loop")),
    Effect(
        "bend_hysteresis",
        "linkage",
        (
            _BEND_BESIDE,
            value("share", "loader.bend_hysteresis_share", 0, 0.98, 0.3, role="other"),
            value(
                "width_N", "loader.bend_hysteresis_width_N", 0, 500, 5.0, 1.0, 25.0, role="other"
            ),
        ),
        Signature("force", "bent", "loop", 6.0),
        contains=("bend",),
    ),
    Effect(
        "structural_mode",
        "linkage",
        (
            _BEND_BESIDE,
            limit("frequency_Hz", "loader.bend_frequency_Hz", *MODES_Hz, 8.0),
            value(
                "damping_ratio", "loader.bend_damping_ratio", 0, 2, 0.05, role="other", may_end=True
            ),
        ),
        Signature("force", "bent", "loop", 1.5),
        seen=modes,
        contains=("bend",),
    ),
    one(
        "linkage",
        "servo_lag",
        factor(SERVO, 0.8, tolerance=SETTING),
        *("speed", "deflection_left", "law", 0.8),
    ),
    one(
        "linkage",
        "no_servo",
        switch(SERVO, 0.0),
        *("speed", "deflection_left", "law", 0.8),
    ),
    one(
        "linkage",
        "servo_rate_limit",
        limit("rate_{d}_per_s", "loader.servo_rate_limit_{d}_per_s", 1e-4, 10, 0.1, 0.18),
        *("speed", "servo_speed", "law", 1.5),
    ),
    # A motor's torque limit, or the ramp of a servo's profile; smaller accelerations are unchanged.
    one(
        "linkage",
        "servo_acceleration_limit",
        limit(
            *("acceleration_{d}_per_s2", "loader.servo_acceleration_limit_{d}_per_s2"),
            *(1e-2, 1e4, 30.0, 10.0),
        ),
        *("speed", "servo_speed", "law", 1.5),
    ),
    # A servo fitted without its dead time has too low a frequency: it is fitted again with the
    # delay, and in `servo_tuning` the damping ratio as well.
    *(
        Effect(
            name,
            "linkage",
            (
                added("delay_s", "loader.servo_delay_s", 0, 0.45, 0.02, 0.05, 0.1),
                replace(
                    factor(SERVO, 1.0),
                    starts=(1.0, 3.0, 8.0),
                    role="other",
                    may_end=True,
                ),
                *more,
            ),
            Signature("speed", "deflection_left", "law", 0.8),
            contains=contains,
        )
        for name, more, contains in (
            ("servo_delay", (), ("servo_lag",)),
            ("servo_tuning", (DAMPING_RATIO,), ("servo_lag", "servo_delay")),
        )
    ),
    one(
        "linkage",
        "arc_geometry",
        switch("loader.arc_geometry", True),
        *("deflection", "deflection_left"),
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
        keys = {p.key for p in effect.parameters}
        others = tuple(p for p in effect.parameters if p.key != SERVO and p != DAMPING_RATIO)
        if any(key.startswith("loader.servo_acceleration") for key in keys):
            continue
        if SERVO not in keys:
            found.append(effect)
        elif effect.free and len(others) + 1 == len(keys):
            found.append(replace(effect, parameters=others or (lag,)))
    return found
