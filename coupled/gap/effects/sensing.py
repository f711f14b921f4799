"""The effects of sensors, and of the host's computations, in the library."""

from __future__ import annotations

from dataclasses import replace

from coupled.gap.effects.effect import (
    Effect,
    ModelError,
    Parameter,
    Sampled,
    Signature,
    added,
    exact,
    factor,
    one,
    value,
)
from coupled.gap.effects.seen import hums
from coupled.gap.signals.missed import shares_missed, spread_of_missed, times_missed
from coupled.gap.thresholds import CLOCK_s


def _force(name: str, parameter: Parameter, x: str, y: str) -> Effect:
    """Return an effect of the sensor, or of the record, of the force."""
    return replace(one("sensing", name, parameter, x, y), outputs=("loader", "linkage"))


COMPENSATION: tuple[Effect, ...] = (
    replace(
        one(
            "compensation",
            "dropped_frames",
            replace(
                added("share", "compensation.missed_share", 0, 0.9, 0.3),
                model_error=ModelError(0.0),
            ),
            *("", "estimate_left", "time", 0.5),
        ),
        outputs=("schedule", "multiplier", "compensation"),
        sampled=Sampled(spread_of_missed, times_missed),
        seen=shares_missed,
    ),
)
SENSING: tuple[Effect, ...] = (
    replace(
        one(
            "sensing",
            "deflection_scale",
            factor("sensing.deflection_scale", 1.03),
            *("computed", "computed_left"),
        ),
        of_sensor=True,
    ),
    _force(
        "force_scale",
        factor("sensing.force_scale", 1.03),
        *("force", "missing"),
    ),
    _force(
        "force_zero",
        added("offset_N", "sensing.force_zero_N", -100, 100, 1.0),
        *("force", "missing"),
    ),
    replace(
        one(
            "sensing",
            "deflection_zero",
            added("offset_{d}", "sensing.deflection_zero_{d}", -0.2, 0.2, 1e-3),
            *("computed", "deflection_left"),
        ),
        outputs=("linkage",),
    ),
    replace(
        one(
            "sensing",
            "scale_drift",
            added("per_s", "sensing.scale_drift_per_s", -0.05, 0.05, 1e-3),
            *("computed", "computed_left", "loop", 1e4),
        ),
        of_sensor=True,
    ),
    Effect(
        "mains_hum",
        "sensing",
        (
            added("amplitude_{d}", "sensing.hum_{d}", 0, 0.1, 1e-4),
            # The start sets the scale of difference steps, 0.1 Hz.
            replace(
                exact(value("frequency_Hz", "sensing.hum_frequency_Hz", 5, 1000, 0.1)),
                kind="aliased",
            ),
            exact(value("phase_rad", "sensing.hum_phase_rad", -7, 7, 1.0)),
        ),
        Signature("", "computed_left", "time", 0.2),
        seen=hums,
        of_sensor=True,
    ),
    _force(
        "force_skew",
        replace(added("delay_s", "sensing.force_stamp_s", -0.3, 0.3, 0.01), tolerance=CLOCK_s),
        *("speed", "missing"),
    ),
    replace(
        one(
            "sensing",
            "motion_skew",
            replace(added("delay_s", "flight.motion_stamp_s", -0.4, 0.4, 0.05), tolerance=CLOCK_s),
            *("elevator", "pitch_rate", "loop", 4.0),
        ),
        outputs=("airframe",),
    ),
)
