"""The linkage's effects in the library."""

from __future__ import annotations

from dataclasses import replace

from coupled.gap.effect import Effect, Signature
from coupled.gap.entries import SETTING, added, factor, limit, one, real_bend, switch

LINKAGE: tuple[Effect, ...] = (
    one("linkage", "bend", real_bend(5e-5), *("force", "bent")),
    Effect(
        "stiffening_bend",
        "linkage",
        (real_bend(1e-4), limit("limit_{d}", "loader.bend_limit_{d}", 1e-4, 1, 5e-3, 2e-2)),
        Signature("force", "bent"),
    ),
    one(
        "linkage",
        "backlash",
        added("play_{d}", "loader.play_{d}", 0, 0.1, 1e-3),
        *("computed", "deflection_left", "loop"),
    ),
    replace(
        one(
            "linkage",
            "servo_lag",
            factor("loader.servo_frequency_Hz", 0.8),
            *("speed", "deflection_left", "law", 0.8),
        ),
        tolerance=SETTING,
    ),
    one(
        "linkage",
        "servo_rate_limit",
        limit("rate_{d}_per_s", "loader.servo_rate_limit_{d}_per_s", 1e-3, 10, 0.1, 0.18),
        *("speed", "servo_speed", "law", 1.5),
    ),
    one(
        "linkage",
        "arc_geometry",
        switch("loader.arc_geometry", True),
        *("deflection", "deflection_left"),
    ),
)
