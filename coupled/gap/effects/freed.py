"""Free any parameter of a rig for a fit, by its key, within its valid range."""

from __future__ import annotations

from typing import Any

from coupled.errors import InputError, nearest
from coupled.gap.effects.effect import Effect, Parameter, Signature
from coupled.gap.effects.library import EFFECTS
from coupled.gap.effects.linkage import SERVO
from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig
from coupled.schema import LARGEST, Section, file_keys

# The stage of a key by its section; keys of the loader with a prefix of `OF_LINKAGE`: linkage.
STAGE_OF_SECTION = {
    "loader": "loader",
    "schedule": "schedule",
    "sensing": "sensing",
    "rigging": "surface",
    "flight": "airframe",
}
OF_LINKAGE = ("servo", "bend", "play", "arc", "structur", "contact")
# The default parameters of a fit, by the stage that the records can judge.
USUAL = {
    "loader": ("mass", "damping", "basic_gradient", "friction", "offset", "delay"),
    "linkage": ("servo_frequency", "servo_damping_ratio", "bend", "play"),
}
SERVO_START_Hz = 20.0  # chosen, amid the 8 to 30 Hz of control loaders
# Parameters whose value 0 means that the component is absent: a fit stays above 0.
NONE_AT_ZERO = (
    *("servo_frequency", "servo_rate_limit", "servo_acceleration_limit", "bend_frequency"),
    *("bend_limit", "force_limit", "play_stiffness", "stop_aft", "stop_forward"),
)
FAR = 1e3  # bound of a parameter without one, over its start


def default_keys(rig: Rig, control: ControlName, stages: set[str]) -> tuple[str, ...]:
    """Return the keys that are fitted by default, of the stages that the records can judge.

    A basic gradient of 0 is no spring, a servo frequency of 0 no servo; they are not fitted.
    """
    fields = {f: key for key, f in _fields(rig, control, "loader").items()}
    loader, drive = rig.controls[control].loader, rig.controls[control].drive
    absent: set[str] = {"basic_gradient"} if loader.basic_gradient == 0.0 else set()
    if loader.servo_frequency == 0.0:
        absent |= {"servo_frequency", "servo_damping_ratio"}
    found = []
    for stage, names in USUAL.items():
        wanted = names if stage in stages else ()
        if stage == "linkage" and drive == "setpoint":
            wanted = (*wanted, "servo_delay")  # of a bus, or of the servo's own cycle
        found += [f"loader.{fields[name]}" for name in wanted if name not in absent]
    return tuple(found)


def freed(rig: Rig, control: ControlName, key: str) -> Effect:
    """Return the parameter of a key as an effect. Raises InputError if the key has no number."""
    section, _, last = key.partition(".")
    if section not in STAGE_OF_SECTION or (section == "flight" and rig.flight is None):
        hint = nearest(section, STAGE_OF_SECTION)
        raise InputError("--free", key, f'is no number to fit: give "loader.mass_kg"; {hint}')
    fields = _fields(rig, control, section)
    if last not in fields:
        raise InputError("--free", key, f"unknown key; {nearest(last, fields)}")
    holder: Any = rig.flight if section == "flight" else getattr(rig.controls[control], section)
    filed = getattr(holder, fields[last])
    if not isinstance(filed, float):
        raise InputError("--free", key, "is not a single number; only such are fitted")
    stage = STAGE_OF_SECTION[section]
    if stage == "loader" and last.startswith(OF_LINKAGE):
        stage = "linkage"
    start = filed or _usual_start(key, control)
    low, high = _bounds(holder, fields[last], start)
    number = Parameter("", key, "value", low, high, (min(max(start, low), high),))
    return Effect(key, stage, (number,), Signature("", ""))


def _fields(rig: Rig, control: ControlName, section: str) -> dict[str, str]:
    holder = rig.flight if section == "flight" else getattr(rig.controls[control], section)
    assert isinstance(holder, Section)
    return file_keys(type(holder), unit_of(control))


def _usual_start(key: str, control: ControlName) -> float:
    """Return the library's start value of a key, for a value of 0 in the file."""
    if key == SERVO:
        return SERVO_START_Hz
    for effect in EFFECTS:
        for p in effect.free:
            if p.key_on(control) == key and p.mode in ("added", "value") and not p.inverse:
                return p.starts[0]
    return 1.0


def _bounds(holder: Section, field: str, start: float) -> tuple[float, float]:
    """Return the bounds of a field from its declaration."""
    far = FAR * abs(start)
    low, high = -far, far
    for bound in type(holder).model_fields[field].metadata:
        low = max(low, float(getattr(bound, "ge", low)))
        above = hasattr(bound, "gt") or field in NONE_AT_ZERO
        low = max(low, 1e-3 * abs(start) if above else low)
        high = min(high, float(getattr(bound, "le", getattr(bound, "lt", high))))
    return low, min(high, LARGEST)
