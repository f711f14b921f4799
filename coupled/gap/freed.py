"""The keys that `coupled fit` frees: the usual ones, and each as an effect with its range."""

from __future__ import annotations

from coupled.errors import InputError, nearest
from coupled.gap.effects.effect import (
    Effect,
    declared_bounds,
    entry,
    fields_of,
    section_of,
    value,
)
from coupled.gap.effects.library import EFFECTS
from coupled.gap.effects.linkage import SERVO
from coupled.gap.thresholds import FAR, SERVO_START_Hz
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig
from coupled.schema import LARGEST, Section

# The stage of a key by its section; keys of the loader with a prefix of `OF_LINKAGE`: linkage.
STAGE_OF_SECTION = {
    "loader": "loader",
    "schedule": "schedule",
    "sensing": "sensing",
    "rigging": "surface",
    "flight": "airframe",
}
OF_LINKAGE = ("servo", "bend", "play", "arc", "structur", "contact")
# The default parameters of a fit, of the loader and of the linkage.
USUAL_OF_LOADER = (
    *("mass", "damping", "basic_gradient", "friction", "offset", "delay"),
    *("regressor_force", "regressor_friction"),
)
USUAL_OF_LINKAGE = ("servo_frequency", "servo_damping_ratio", "bend", "play")
# Parameters whose value 0 means that the component is absent: a fit stays above 0.
NONE_AT_ZERO = (
    *("servo_frequency", "servo_rate_limit", "servo_acceleration_limit", "bend_frequency"),
    *("bend_limit", "force_limit", "play_stiffness", "stop_aft", "stop_forward"),
    "friction_stiffness",
)


def default_keys(
    rig: Rig, control: ControlName, stages: set[str], moved: bool = False
) -> tuple[str, ...]:
    """Return the keys that are fitted by default, of the stages that the records can judge.

    A basic gradient of 0 is no spring, a servo frequency of 0 no servo; they are not fitted, nor is
    a regressor that the file does not name. With imposed motion (`moved`) of the linkage only the
    play shows.
    """
    fields = {f: key for key, f in fields_of(rig, control, "loader").items()}
    loader = rig.controls[control].loader
    absent: set[str] = {"basic_gradient"} if loader.basic_gradient == 0.0 else set()
    if loader.servo_frequency == 0.0:
        absent |= {"servo_frequency", "servo_damping_ratio"}
    if loader.regressor is None:
        absent |= {"regressor_force", "regressor_friction"}
    usual: tuple[str, ...] = USUAL_OF_LOADER if "loader" in stages else ()
    linkage: tuple[str, ...] = USUAL_OF_LINKAGE if "linkage" in stages else ()
    if rig.controls[control].drive == "setpoint":
        linkage = (*linkage, "servo_delay")  # of a bus, or of the servo's own cycle
    usual += ("play",) if moved else linkage
    return tuple(f"loader.{fields[name]}" for name in usual if name not in absent)


def freed(rig: Rig, control: ControlName, key: str) -> Effect:
    """Return the parameter of a key as an effect. Raises InputError if the key has no number."""
    section, _, last = key.partition(".")
    if section not in STAGE_OF_SECTION or (section == "flight" and rig.flight is None):
        hint = nearest(section, STAGE_OF_SECTION)
        raise InputError("--free", key, f'is no number to fit: give "loader.mass_kg"; {hint}')
    if section != "flight" and control not in rig.controls:
        raise InputError("--free", key, f"the rig has no {control}")
    fields = fields_of(rig, control, section)
    if last not in fields:
        raise InputError("--free", key, f"unknown key; {nearest(last, fields)}")
    holder = section_of(rig, control, section)
    filed = getattr(holder, fields[last])
    if not isinstance(filed, float):
        raise InputError("--free", key, "is not a single number; only such are fitted")
    stage = STAGE_OF_SECTION[section]
    if stage == "loader" and last.startswith(OF_LINKAGE):
        stage = "linkage"
    start = filed or _usual_start(key, control)
    low, high = _bounds(holder, fields[last], start)
    number = value("", key, low, high, min(max(start, low), high))
    return entry(stage, key, ("", ""), number)


def _usual_start(key: str, control: ControlName) -> float:
    """Return the library's start value of a key, for a value of 0 in the file."""
    if key == SERVO:
        return SERVO_START_Hz
    for effect in EFFECTS:
        for p in effect.free:
            if p.key_on(control) == key and p.mode in ("added", "value") and not p.is_limit:
                return p.starts[0]
    return 1.0


def _bounds(holder: Section, field: str, start: float) -> tuple[float, float]:
    """Return the bounds of a field from its declaration."""
    far = FAR * abs(start)
    low, high = declared_bounds(holder, field)
    above = any(hasattr(bound, "gt") for bound in type(holder).model_fields[field].metadata)
    if above or field in NONE_AT_ZERO:
        low = max(low, 1e-3 * abs(start))
    return max(low, -far), min(high, far, LARGEST)
