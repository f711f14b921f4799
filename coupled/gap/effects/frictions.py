"""The laws of dry friction in the library of effects.

All have a running level. They differ in the force near zero speed.
"""

from __future__ import annotations

from dataclasses import replace

from coupled.gap.effects.effect import Effect, Parameter, Signature
from coupled.gap.thresholds import YIELDING_ERROR

_DRAWN = Signature("speed", "missing")


def _level(*starts_N: float) -> Parameter:
    """Return the running friction above the nominal one."""
    return Parameter("friction_N", "loader.friction_N", "added", 0, 60, starts_N)


_BREAKAWAY = Parameter("breakaway_N", "loader.breakaway_N", "value", 0, 200, (2.0, 3.0, 3.0))
_FADING = Parameter(
    "stribeck_{d}_per_s", "loader.stribeck_rate_{d}_per_s", "value", 2e-4, 0.05, (2e-3,)
)
_CONTACT = Parameter(
    *("stiffness_N_per_{d}", "loader.friction_stiffness_N_per_{d}", "value", 1e2, 1e8, (1e4, 1e5)),
    model_error=YIELDING_ERROR,
)


_ELASTIC = Parameter(
    *("elastic_share", "loader.friction_elastic_share", "value", 0, 0.98, (0.3,)),
    scanned=False,
    shape=True,
    may_end=True,
    model_error=YIELDING_ERROR,
)


def _one_way(name: str, *starts_N: float) -> Parameter:
    """Return the friction in one direction of motion above the nominal one."""
    number = Parameter(name, f"loader.friction_{name}", "added", 0, 60, starts_N)
    return replace(number, may_end=True)


FRICTIONS: tuple[Effect, ...] = (
    Effect("coulomb_friction", "loader", (_level(1.5),), _DRAWN, dry=True),
    Effect(
        "stribeck_friction",
        "loader",
        (
            _level(1.0, 0.3, 0.1),
            replace(_BREAKAWAY, above="loader.friction_N"),
            replace(_FADING, scanned=False, shape=True),
        ),
        _DRAWN,
        dry=True,
        contains=("coulomb_friction", "presliding_friction"),
    ),
    Effect(
        "presliding_friction",
        "loader",
        (_level(1.5), replace(_CONTACT, scanned=False, shape=True, inverse=True), _ELASTIC),
        _DRAWN,
        dry=True,
        contains=("coulomb_friction",),
    ),
    # Equivalent to Coulomb friction of the mean level with a constant force of half the difference.
    Effect(
        "asymmetric_friction",
        "loader",
        (_one_way("pull_N", 1.5, 0.5), _one_way("push_N", 0.5, 1.5)),
        _DRAWN,
        dry=True,
        contains=("coulomb_friction",),
    ),
    Effect(
        "load_friction",
        "loader",
        (Parameter("factor", "loader.friction_by_load", "added", 0, 0.8, (0.03,)),),
        Signature("force", "missing"),
        dry=True,
    ),
)
