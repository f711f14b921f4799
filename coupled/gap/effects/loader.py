"""The loader's effects in the library, and the laws of its dry friction.

All laws of dry friction have a running level. They differ in the force near zero speed.
"""

from __future__ import annotations

import math
from functools import partial

from coupled.gap.effects.effect import (
    BY_REGRESSOR,
    OTHER_FORCE,
    Effect,
    ModelError,
    Parameter,
    Switch,
    added,
    entry,
    factor,
    limit,
    value,
)
from coupled.gap.effects.seen import ripples, stops
from coupled.gap.thresholds import OTHER_SCALE, SETTING, YIELDING_ERROR, CLOCK_s

_YIELDING = ModelError(YIELDING_ERROR)
_BY_SPEED, _BY_DEFLECTION = ("speed", "missing"), ("computed", "missing")
_effect = partial(entry, "loader")


def _level(*starts_N: float) -> Parameter:
    """Return the running friction above the nominal one."""
    return added("friction_N", "loader.friction_N", 0, 60, *starts_N)


def _one_way(name: str, *starts_N: float) -> Parameter:
    """Return the friction in one direction of motion above the nominal one."""
    return added(name, f"loader.friction_{name}", 0, 60, *starts_N, may_end=True)


def _per_unit(name: str, key: str) -> Parameter:
    """Return a size for each unit of the regressor, in RMS forces per its standard deviation.

    `settings` converts starts and bounds to those of records.
    """
    return added(name, key, -OTHER_SCALE, OTHER_SCALE, 0.1, -0.1)


FRICTIONS: tuple[Effect, ...] = (
    _effect("coulomb_friction", _BY_SPEED, _level(1.5), dry=True),
    _effect(
        "stribeck_friction",
        _BY_SPEED,
        _level(1.0, 0.3, 0.1),
        value(
            "breakaway_N", "loader.breakaway_N", 0, 200, 2.0, 3.0, 3.0, above="loader.friction_N"
        ),
        value(
            *("stribeck_{d}_per_s", "loader.stribeck_rate_{d}_per_s", 2e-4, 0.05, 2e-3),
            role="shape",
        ),
        dry=True,
        contains=("coulomb_friction", "presliding_friction"),
    ),
    _effect(
        "presliding_friction",
        _BY_SPEED,
        _level(1.5),
        limit(
            *("stiffness_N_per_{d}", "loader.friction_stiffness_N_per_{d}", 1e2, 1e8, 1e4, 1e5),
            role="shape",
            model_error=_YIELDING,
        ),
        value(
            *("elastic_share", "loader.friction_elastic_share", 0, 0.98, 0.3),
            role="shape",
            may_end=True,
            model_error=_YIELDING,
        ),
        dry=True,
        contains=("coulomb_friction",),
    ),
    # Equivalent to Coulomb friction of the mean level with a constant force of half the difference.
    _effect(
        "asymmetric_friction",
        _BY_SPEED,
        *(_one_way("pull_N", 1.5, 0.5), _one_way("push_N", 0.5, 1.5)),
        dry=True,
        contains=("coulomb_friction",),
    ),
    _effect(
        "load_friction",
        ("force", "missing"),
        added("factor", "loader.friction_by_load", 0, 0.8, 0.03),
        dry=True,
    ),
    _effect(
        "regressor_friction", _BY_SPEED, _per_unit("friction_N_per_unit", BY_REGRESSOR[1]), dry=True
    ),
)


QUARTERS_rad = tuple(0.5 * math.pi * k for k in range(-1, 3))  # hanging, level, upright


def _stop(side: str) -> Parameter:
    """Return where a stop lies on one side; it may be beyond all that a record meets."""
    return limit(f"{side}_{{d}}", f"loader.stop_{side}_{{d}}", 1e-4, 10, 0.05, may_end=True)


LOADER: tuple[Effect, ...] = (
    *FRICTIONS,
    _effect(
        "inertia",
        ("acceleration", "missing", "law", 1.5),
        factor("loader.mass_kg", 1.2, tolerance=SETTING),
    ),
    _effect(
        "viscous_damping", _BY_SPEED, factor("loader.damping_N_s_per_{d}", 1.2, tolerance=SETTING)
    ),
    _effect("gradient_error", _BY_DEFLECTION, factor("loader.basic_gradient_N_per_{d}", 1.05)),
    _effect(
        "cubic_stiffness",
        _BY_DEFLECTION,
        added("cubic_N_per_{d}3", "loader.cubic_N_per_{d}3", -1e9, 1e9, 2e4, 2e6),
    ),
    _effect("breakout", _BY_DEFLECTION, added("breakout_N", "loader.breakout_N", 0, 60, 2.0)),
    _effect(
        "bob_weight",
        ("load", "missing"),
        added("force_N_per_g", "loader.bob_weight_N_per_g", -200, 200, 5.0),
    ),
    _effect("force_offset", _BY_DEFLECTION, added("offset_N", "loader.offset_N", -100, 100, 1.0)),
    _effect(
        "regressor_force", ("regressor", "missing"), _per_unit("force_N_per_unit", BY_REGRESSOR[0])
    ),
    _effect(
        "digital_multiplier",
        ("noise", "product_left", "law", 0.3),
        Switch("", "loader.multiplier", "switch", on="digital"),
        outputs=("loader", "multiplier"),
    ),
    _effect(
        "transport_delay",
        ("speed", "computed_left", "law", 1.0),
        added("delay_s", "loader.delay_s", 0, 0.19, 0.01, model_error=ModelError(absolute=CLOCK_s)),
    ),
    _effect(
        "friction_ripple",
        _BY_DEFLECTION,
        added("ripple_N", "loader.ripple_N", 0, 60, 1.0),
        value("period_{d}", "loader.ripple_period_{d}", 2e-4, 0.5, 1e-2, role="other"),
        value("phase_rad", "loader.ripple_phase_rad", -7, 7, 1.0, role="other"),
        seen=ripples,
    ),
    _effect(
        "gravity",
        _BY_DEFLECTION,
        added("gravity_N", "loader.gravity_N", 0, 60, 1.0),
        value("angle_rad", "loader.gravity_angle_rad", -7, 7, *QUARTERS_rad, role="shape"),
    ),
    _effect(
        "relaxation",
        ("speed", "missing", "loop", 6.0),
        added("stiffness_N_per_{d}", "loader.relaxing_stiffness_N_per_{d}", 0, 1e5, 200.0),
        value("time_s", "loader.relaxing_time_s", 5e-3, 100, 0.2, 1.5, role="shape"),
    ),
    _effect(
        "force_limit",
        _BY_DEFLECTION,
        limit("limit_N", "loader.force_limit_N", 0.001, 2000, 10.0, 60.0),
    ),
    _effect("travel", _BY_DEFLECTION, _stop("aft"), _stop("forward"), seen=stops),
    _effect(
        "crosstalk",
        ("other_force", "missing"),
        added("factor", "loader.crosstalk", -0.9, 0.9, 0.05),
        needs=(OTHER_FORCE,),
    ),
    _effect(
        "modifying_lag",
        ("speed", "missing", "law", 1.5),
        added("lag_s", "loader.modifying_lag_s", 0, 3, 0.01),
    ),
)
