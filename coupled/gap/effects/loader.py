"""The loader's effects in the library."""

from __future__ import annotations

import math
from dataclasses import replace

from coupled.gap.effects.effect import OTHER_FORCE, Effect, Parameter, Signature
from coupled.gap.effects.entries import SETTING, added, factor, limit, one, switch, value
from coupled.gap.effects.frictions import FRICTIONS
from coupled.gap.effects.seen import ripples, stops
from coupled.gap.thresholds import CLOCK_s

QUARTERS_rad = tuple(0.5 * math.pi * k for k in range(-1, 3))  # hanging, level, upright


def _stop(side: str) -> Parameter:
    """Return where a stop lies on one side; it may be beyond all that a record meets."""
    number = limit(f"{side}_{{d}}", f"loader.stop_{side}_{{d}}", 1e-4, 10, 0.05)
    return replace(number, may_end=True)


LOADER: tuple[Effect, ...] = (
    *FRICTIONS,
    one(
        "loader",
        "inertia",
        replace(factor("loader.mass_kg", 1.2), tolerance=SETTING),
        *("acceleration", "missing", "law", 1.5),
    ),
    one(
        "loader",
        "viscous_damping",
        replace(factor("loader.damping_N_s_per_{d}", 1.2), tolerance=SETTING),
        *("speed", "missing"),
    ),
    one(
        "loader",
        "gradient_error",
        replace(factor("loader.basic_gradient_N_per_{d}", 1.05), host="the host's G_B"),
        *("computed", "missing"),
    ),
    one(
        "loader",
        "cubic_stiffness",
        added("cubic_N_per_{d}3", "loader.cubic_N_per_{d}3", 0, 1e9, 2e4, 2e6),
        *("computed", "missing"),
    ),
    one(
        "loader",
        "breakout",
        replace(added("breakout_N", "loader.breakout_N", 0, 60, 2.0), host="the host's F_BO"),
        *("computed", "missing"),
    ),
    one(
        "loader",
        "bob_weight",
        added("force_N_per_g", "loader.bob_weight_N_per_g", -200, 200, 5.0),
        *("load", "missing"),
    ),
    one(
        "loader",
        "force_offset",
        added("offset_N", "loader.offset_N", -100, 100, 1.0),
        *("computed", "missing"),
    ),
    replace(
        one(
            "loader",
            "digital_multiplier",
            switch("loader.multiplier", "digital"),
            *("noise", "product_left", "law", 0.3),
        ),
        outputs=("loader", "multiplier"),
    ),
    one(
        "loader",
        "transport_delay",
        replace(added("delay_s", "loader.delay_s", 0, 0.19, 0.01), unsure=CLOCK_s),
        *("speed", "computed_left", "law", 1.0),
    ),
    Effect(
        "friction_ripple",
        "loader",
        (
            added("ripple_N", "loader.ripple_N", 0, 60, 1.0),
            replace(
                value("period_{d}", "loader.ripple_period_{d}", 2e-4, 0.5, 1e-2), scanned=False
            ),
            replace(value("phase_rad", "loader.ripple_phase_rad", -7, 7, 1.0), scanned=False),
        ),
        Signature("computed", "missing"),
        seen=ripples,
    ),
    Effect(
        "gravity",
        "loader",
        (
            added("gravity_N", "loader.gravity_N", 0, 60, 1.0),
            replace(
                value("angle_rad", "loader.gravity_angle_rad", -7, 7, *QUARTERS_rad),
                scanned=False,
                shape=True,
            ),
        ),
        Signature("computed", "missing"),
    ),
    Effect(
        "relaxation",
        "loader",
        (
            added("stiffness_N_per_{d}", "loader.relaxing_stiffness_N_per_{d}", 0, 1e5, 200.0),
            replace(
                value("time_s", "loader.relaxing_time_s", 5e-3, 100, 0.2, 1.5),
                scanned=False,
                shape=True,
            ),
        ),
        Signature("speed", "missing", "loop", 6.0),
    ),
    one(
        "loader",
        "force_limit",
        limit("limit_N", "loader.force_limit_N", 0.001, 2000, 10.0, 60.0),
        *("computed", "missing"),
    ),
    Effect(
        "travel",
        "loader",
        (
            _stop("aft"),
            _stop("forward"),
        ),
        Signature("computed", "missing"),
        seen=stops,
    ),
    replace(
        one(
            "loader",
            "crosstalk",
            added("factor", "loader.crosstalk", -0.9, 0.9, 0.05),
            *("other_force", "missing"),
        ),
        needs=(OTHER_FORCE,),
    ),
    one(
        "loader",
        "modifying_lag",
        added("lag_s", "loader.modifying_lag_s", 0, 3, 0.01),
        *("speed", "missing", "law", 1.5),
    ),
)
