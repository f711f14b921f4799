"""The library of effects: what a rig may have and its nominal model lacks.

An entry is data: a name, the stage where it acts, and the parameters of the rig that it
frees, with their bounds and where a fit starts. Adding an effect to a rig means writing
values into the rig's own data, which the same stages then fly.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig

Mode = Literal["value", "factor", "added", "switch"]


@dataclass(frozen=True)
class Parameter:
    """One freed number of the rig: `section.field`, and how a fitted value enters it.

    The section is one of the control's, or `flight`.

    `value` replaces the nominal one, `factor` multiplies it, `added` is added to it; a
    `switch` has no number, and sets the field to `on`. `{d}` in the name is m, or rad on a wheel.
    """

    name: str
    section: str
    field: str
    mode: Mode
    low: float = 0.0
    high: float = 0.0
    starts: tuple[float, ...] = (0.0,)
    on: Any = None
    above: str = ""  # a field of the section from whose nominal value the starts count


@dataclass(frozen=True)
class Effect:
    """A named effect of one stage."""

    name: str
    stage: str
    parameters: tuple[Parameter, ...]

    @property
    def free(self) -> tuple[Parameter, ...]:
        """The parameters that have a number to fit."""
        return tuple(p for p in self.parameters if p.mode != "switch")


def _one(stage: str, name: str, parameter: Parameter) -> Effect:
    return Effect(name, stage, (parameter,))


def _factor(
    section: str, field: str, start: float, low: float = 0.1, high: float = 10.0
) -> Parameter:
    return Parameter("factor", section, field, "factor", low, high, (start,))


def _added(
    name: str, section: str, field: str, low: float, high: float, *starts: float
) -> Parameter:
    return Parameter(name, section, field, "added", low, high, starts)


def _value(
    name: str, section: str, field: str, low: float, high: float, *starts: float
) -> Parameter:
    return Parameter(name, section, field, "value", low, high, starts)


def _switch(section: str, field: str, on: Any) -> Parameter:
    return Parameter("", section, field, "switch", on=on)


EFFECTS: tuple[Effect, ...] = (
    _one("schedule", "pressure_lag", _value("lag_s", "schedule", "pressure_lag", 0, 10, 0.3)),
    _one("schedule", "pressure_scale", _factor("schedule", "pressure_scale", 1.05)),
    _one("schedule", "schedule_slope", _factor("schedule", "slope", 1.05)),
    _one("loader", "coulomb_friction", _added("friction_N", "loader", "friction", 0, 60, 1.5)),
    Effect(
        "stribeck_friction",
        "loader",
        (
            _added("friction_N", "loader", "friction", 0, 60, 1.0, 0.3, 0.1),
            Parameter(
                "breakaway_N",
                "loader",
                "breakaway",
                "value",
                0,
                200,
                (2.0, 3.0, 3.0),
                above="friction",
            ),
            _value("stribeck_{d}_per_s", "loader", "stribeck_rate", 2e-4, 0.05, 2e-3),
        ),
    ),
    _one("loader", "viscous_damping", _factor("loader", "damping", 1.2)),
    _one("loader", "inertia", _factor("loader", "mass", 1.2)),
    _one("loader", "gradient_error", _factor("loader", "basic_gradient", 1.05)),
    _one(
        "loader", "cubic_stiffness", _added("cubic_N_per_{d}3", "loader", "cubic", 0, 1e9, 2e4, 2e6)
    ),
    _one("loader", "breakout", _added("breakout_N", "loader", "breakout", 0, 60, 2.0)),
    _one("loader", "bob_weight", _added("force_N_per_g", "loader", "bob_weight", -200, 200, 5.0)),
    _one("loader", "force_offset", _added("offset_N", "loader", "offset", -100, 100, 1.0)),
    _one("loader", "digital_multiplier", _switch("loader", "multiplier", "digital")),
    _one("loader", "transport_delay", _added("delay_s", "loader", "delay", 0, 0.19, 0.01)),
    _one("sensing", "deflection_scale", _factor("sensing", "deflection_scale", 1.03)),
    _one("linkage", "bend", _value("bend_{d}_per_N", "loader", "bend", 0, 1e-2, 5e-5)),
    Effect(
        "stiffening_bend",
        "linkage",
        (
            _value("bend_{d}_per_N", "loader", "bend", 0, 1e-2, 1e-4),
            _value("limit_{d}", "loader", "bend_limit", 1e-4, 1, 5e-3, 2e-2),
        ),
    ),
    _one("linkage", "backlash", _added("play_{d}", "loader", "play", 0, 0.1, 1e-3)),
    _one("linkage", "servo_lag", _factor("loader", "servo_frequency", 0.8)),
    _one(
        "linkage",
        "servo_rate_limit",
        _value("rate_{d}_per_s", "loader", "servo_rate_limit", 1e-3, 10, 0.1, 0.18),
    ),
    _one("linkage", "arc_geometry", _switch("loader", "arc_geometry", True)),
    _one(
        "surface", "cable_stretch", _added("loss_per_Pa", "rigging", "stretch_loss", 0, 1e-2, 1e-5)
    ),
    _one("surface", "surface_lag", _added("lag_s", "rigging", "lag", 0, 3, 0.05)),
    _one(
        "surface",
        "surface_rate_limit",
        _value("rate_norm_per_s", "rigging", "rate_limit", 1e-2, 50, 0.3, 0.55),
    ),
    _one("surface", "surface_freeplay", _added("play_norm", "rigging", "play", 0, 0.5, 0.01)),
    _one("airframe", "elevator_effectiveness", _factor("flight", "elevator_effectiveness", 0.9)),
    _one("airframe", "pitch_damping", _factor("flight", "pitch_damping", 1.2)),
    _one("airframe", "vertical_gust", _value("rms_m_per_s", "flight", "gust_rms", 0, 30, 0.5)),
    _one("surface", "rigging_offset", _added("offset_norm", "rigging", "offset", -0.5, 0.5, 0.01)),
)
# A pot is set, and a servo tuned, to a per cent or two: no effect, but a nuisance that fits profile
# out. {the effect that frees the same number: the setting}
TOLERANCE = {"inertia": 0.02, "viscous_damping": 0.02, "servo_lag": 0.02}


def _setting(effect: str, name: str, field: str) -> Effect:
    stage = "linkage" if field == "servo_frequency" else "loader"
    low, high = 1.0 - TOLERANCE[effect], 1.0 + TOLERANCE[effect]
    return _one(stage, name, _factor("loader", field, 1.0, low, high))


SETTINGS: dict[str, Effect] = {
    "inertia": _setting("inertia", "mass_setting", "mass"),
    "viscous_damping": _setting("viscous_damping", "damping_setting", "damping"),
    "servo_lag": _setting("servo_lag", "servo_setting", "servo_frequency"),
}
BY_NAME = {effect.name: effect for effect in EFFECTS}
STAGES = ("schedule", "loader", "sensing", "linkage", "compensation", "surface", "airframe")


def parameter_name(parameter: Parameter, control: str) -> str:
    """Return a parameter's name with its unit on this control."""
    return parameter.name.format(d=unit_of(control))


def _entered(parameter: Parameter, nominal: Any, value: float) -> Any:
    """Return the rig's new number for a fitted value."""
    if parameter.mode == "switch":
        return parameter.on
    if parameter.mode == "factor":
        return nominal * value
    return nominal + value if parameter.mode == "added" else value


def apply(
    rig: Rig, control: ControlName, effects: Sequence[Effect], values: Mapping[str, float]
) -> Rig:
    """Return the rig with effects added; `values` by "effect.parameter".

    The host goes on believing what it believed: its G_B and F_BO are pinned to the nominal.
    """
    data = rig.controls[control]
    sections: dict[str, dict[str, Any]] = {}
    for effect in effects:
        for p in effect.parameters:
            holder = rig.flight if p.section == "flight" else getattr(data, p.section)
            nominal = getattr(holder, p.field)
            new = _entered(p, nominal, values.get(f"{effect.name}.{p.name}", 0.0))
            sections.setdefault(p.section, {})[p.field] = new
    host = data.compensation
    believed = {
        "basic_gradient": data.assumed_basic_gradient,
        "breakout": data.assumed_breakout,
    }
    flight = sections.pop("flight", None)
    changed = {name: getattr(data, name).model_copy(update=new) for name, new in sections.items()}
    changed["compensation"] = host.model_copy(update=believed)
    controls = {**rig.controls, control: data.model_copy(update=changed)}
    whole: dict[str, Any] = {"controls": controls}
    if flight is not None and rig.flight is not None:
        whole["flight"] = rig.flight.model_copy(update=flight)
    return rig.model_copy(update=whole)
