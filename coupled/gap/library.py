"""The library of effects: what a rig may have and its nominal model lacks.

An entry is data, and all that a diagnosis knows of its effect: a name, the stage where it acts,
the numbers of the rig file that it frees, with their bounds and where a fit starts, and the
traits by which it is scanned, judged, distinguished from its like and drawn.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from coupled.gap.air import NEEDS as AIR
from coupled.gap.air import spread_of_air
from coupled.gap.effect import Drawing, Effect, Parameter, Signature
from coupled.gap.frictions import FRICTIONS

WHOLE_s = 1e4  # a zoom that shows the whole record
# A pot is set, and a servo tuned, to a per cent or two: no effect, but a setting that every fit
# leaves free within that.
SETTING = 0.02


def _factor(key: str, start: float, low: float = 0.1, high: float = 10.0) -> Parameter:
    return Parameter("factor", key, "factor", low, high, (start,))


def _added(name: str, key: str, low: float, high: float, *starts: float) -> Parameter:
    return Parameter(name, key, "added", low, high, starts)


def _value(name: str, key: str, low: float, high: float, *starts: float) -> Parameter:
    return Parameter(name, key, "value", low, high, starts)


def _limit(name: str, key: str, low: float, high: float, *starts: float) -> Parameter:
    return replace(_value(name, key, low, high, *starts), inverse=True)


def _bend(start: float) -> Parameter:
    bend = _value("bend_{d}_per_N", "loader.bend_{d}_per_N", 0, 1e-2, start)
    return replace(bend, scanned=False, host="K̂")


def _switch(key: str, on: Any) -> Parameter:
    return Parameter("", key, "switch", on=on)


def _one(
    stage: str,
    name: str,
    parameter: Parameter,
    x: str,
    y: str,
    drawing: Drawing = "law",
    zoom_s: float = 2.5,
) -> Effect:
    """Return an effect of one parameter; y against x is how it is drawn."""
    return Effect(name, stage, (parameter,), Signature(x, y, drawing, zoom_s))


EFFECTS: tuple[Effect, ...] = (
    _one(
        "schedule",
        "pressure_lag",
        _value("lag_s", "schedule.pressure_lag_s", 0, 10, 0.3),
        *("pressure", "gradient", "loop", 6.0),
    ),
    _one(
        "schedule",
        "pressure_scale",
        _factor("schedule.pressure_scale", 1.05),
        *("pressure", "gradient", "law", WHOLE_s),
    ),
    _one(
        "schedule",
        "schedule_slope",
        _factor("schedule.slope", 1.05),
        *("pressure", "gradient", "law", WHOLE_s),
    ),
    *FRICTIONS,
    replace(
        _one(
            "loader",
            "inertia",
            _factor("loader.mass_kg", 1.2),
            *("acceleration", "missing", "law", 1.5),
        ),
        tolerance=SETTING,
    ),
    replace(
        _one(
            "loader",
            "viscous_damping",
            _factor("loader.damping_N_s_per_{d}", 1.2),
            *("speed", "missing"),
        ),
        tolerance=SETTING,
    ),
    _one(
        "loader",
        "gradient_error",
        replace(_factor("loader.basic_gradient_N_per_{d}", 1.05), host="the host's G_B"),
        *("computed", "missing"),
    ),
    _one(
        "loader",
        "cubic_stiffness",
        _added("cubic_N_per_{d}3", "loader.cubic_N_per_{d}3", 0, 1e9, 2e4, 2e6),
        *("computed", "missing"),
    ),
    _one(
        "loader",
        "breakout",
        replace(_added("breakout_N", "loader.breakout_N", 0, 60, 2.0), host="the host's F_BO"),
        *("computed", "missing"),
    ),
    _one(
        "loader",
        "bob_weight",
        _added("force_N_per_g", "loader.bob_weight_N_per_g", -200, 200, 5.0),
        *("load", "missing"),
    ),
    _one(
        "loader",
        "force_offset",
        _added("offset_N", "loader.offset_N", -100, 100, 1.0),
        *("computed", "missing"),
    ),
    replace(
        _one(
            "loader",
            "digital_multiplier",
            _switch("loader.multiplier", "digital"),
            *("noise", "product_left", "law", 0.3),
        ),
        outputs=("loader", "multiplier"),
    ),
    _one(
        "loader",
        "transport_delay",
        _added("delay_s", "loader.delay_s", 0, 0.19, 0.01),
        *("speed", "computed_left", "law", 1.0),
    ),
    _one(
        "loader",
        "modifying_lag",
        _added("lag_s", "loader.modifying_lag_s", 0, 3, 0.01),
        *("speed", "missing", "law", 1.5),
    ),
    _one(
        "sensing",
        "deflection_scale",
        _factor("sensing.deflection_scale", 1.03),
        *("computed", "computed_left"),
    ),
    _one("linkage", "bend", _bend(5e-5), *("force", "bent")),
    Effect(
        "stiffening_bend",
        "linkage",
        (_bend(1e-4), _limit("limit_{d}", "loader.bend_limit_{d}", 1e-4, 1, 5e-3, 2e-2)),
        Signature("force", "bent"),
    ),
    _one(
        "linkage",
        "backlash",
        _added("play_{d}", "loader.play_{d}", 0, 0.1, 1e-3),
        *("computed", "deflection_left", "loop"),
    ),
    replace(
        _one(
            "linkage",
            "servo_lag",
            _factor("loader.servo_frequency_Hz", 0.8),
            *("speed", "deflection_left", "law", 0.8),
        ),
        tolerance=SETTING,
    ),
    _one(
        "linkage",
        "servo_rate_limit",
        _limit("rate_{d}_per_s", "loader.servo_rate_limit_{d}_per_s", 1e-3, 10, 0.1, 0.18),
        *("speed", "servo_speed", "law", 1.5),
    ),
    _one(
        "linkage",
        "arc_geometry",
        _switch("loader.arc_geometry", True),
        *("deflection", "deflection_left"),
    ),
    _one(
        "surface",
        "cable_stretch",
        _added("loss_per_Pa", "rigging.stretch_loss_per_Pa", 0, 1e-2, 1e-5),
        *("pressure", "ratio"),
    ),
    _one(
        "surface",
        "surface_lag",
        _added("lag_s", "rigging.lag_s", 0, 3, 0.05),
        *("wanted_rate", "answer_left", "law", 1.5),
    ),
    _one(
        "surface",
        "surface_rate_limit",
        _limit("rate_norm_per_s", "rigging.rate_limit_norm_per_s", 1e-2, 50, 0.3, 0.55),
        *("wanted_rate", "answer_rate", "law", 1.5),
    ),
    _one(
        "surface",
        "surface_freeplay",
        _added("play_norm", "rigging.play_norm", 0, 0.5, 0.01),
        *("wanted", "answer_left", "loop"),
    ),
    _one(
        "airframe",
        "elevator_effectiveness",
        _factor("flight.elevator_effectiveness", 0.9),
        *("elevator", "pitch_rate", "loop", 4.0),
    ),
    _one(
        "airframe",
        "pitch_damping",
        _factor("flight.pitch_damping", 1.2),
        *("pitch_rate", "pitch_left", "law", 4.0),
    ),
    replace(
        _one(
            "airframe",
            "vertical_gust",
            _value("rms_m_per_s", "flight.gust_rms_m_per_s", 0, 30, 0.5),
            *("", "air", "time", 6.0),
        ),
        needs=AIR,
        sample_error=spread_of_air,
    ),
    _one(
        "surface",
        "rigging_offset",
        _added("offset_norm", "rigging.offset_norm", -0.5, 0.5, 0.01),
        *("wanted", "answer_left"),
    ),
)
BY_NAME = {effect.name: effect for effect in EFFECTS}


def _setting(effect: Effect) -> Effect:
    """Return the number that an effect frees as a setting, free within its tolerance."""
    low, high = 1.0 - effect.tolerance, 1.0 + effect.tolerance
    (number,) = effect.parameters
    within = replace(number, low=low, high=high, starts=(1.0,))
    return replace(effect, name=f"setting of {effect.name}", parameters=(within,), tolerance=0.0)


# {the effect that frees the same number: the setting}
SETTINGS: dict[str, Effect] = {
    effect.name: _setting(effect) for effect in EFFECTS if effect.tolerance > 0.0
}
