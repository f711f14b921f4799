"""The signals that the signature figures draw, as measured and as predicted with a rig.

Each signal is computed in the same way from the record (`rig` None) and from the prediction with a
rig, so the curves of a figure differ by the rig only. A "missing" or "left" signal is the residual
relative to the base of the scene: the rig without the effect that is drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from coupled.display import System, in_system
from coupled.gap.noise.smooth import rate_of, smoothed
from coupled.gap.signals.output import Floats, Output
from coupled.gap.signals.reading import Reading
from coupled.gap.stages.airframe import gusts_of
from coupled.gap.stages.openloop import command_of
from coupled.gap.stages.surfaces import surface_channel, surface_points
from coupled.record.channels import channel, unit_of
from coupled.rig.packing import COMMAND_SIGN
from coupled.rig.parameters import Loader
from coupled.rig.replay import replay_product, replay_surface
from coupled.rig.rig import Rig
from coupled.units import DEGREE_rad

_SMALLEST_COMMAND_percent = 10.0  # of the travel; smaller commands give no ratio

_SMALLEST_SHARE = 0.1  # share of a signal's size, below which its sign is uncertain


@dataclass(frozen=True)
class Scene:
    """One record, its outputs, and the base rig: the rig without the effect that is drawn."""

    reader: Reading
    outputs: tuple[Output, ...]

    @property
    def base(self) -> Rig:
        """The rig without the effect."""
        return self.reader.rig

    @property
    def loader(self) -> Loader:
        """The loader of the base rig."""
        return self.base.controls[self.reader.control].loader

    @property
    def frame_rate(self) -> float:
        """The frame rate, Hz."""
        return self.base.frame_rate

    @property
    def fine(self) -> float:
        """Factor to the unit of small deflections: mm, or ° for a wheel."""
        return 1000.0 if unit_of(self.reader.control) == "m" else 1.0 / DEGREE_rad

    @property
    def coarse(self) -> float:
        """Factor to the unit of quantities per deflection: m, or ° for a wheel."""
        return 1.0 if unit_of(self.reader.control) == "m" else 1.0 / DEGREE_rad

    def channel(self, quantity: str) -> str:
        """Return the channel of a quantity of the control; a channel name is returned as given."""
        try:
            return channel(self.reader.control, quantity)
        except KeyError:
            return quantity

    def rate(self, signal: Floats) -> Floats:
        """Return the time derivative of a signal, per second."""
        return rate_of(signal, self.frame_rate)

    def raw(self, quantity: str, rig: Rig | None) -> Floats:
        """Return an output as measured or as predicted. Raises KeyError if it is missing."""
        name = self.channel(quantity)
        for output in self.outputs:
            if output.channel == name:
                return output.measured if rig is None else output.predict(rig)
        raise KeyError(name)

    def seen(self, quantity: str, rig: Rig | None) -> Floats:
        """Return the same output with the white noise smoothed out."""
        return smoothed(self.raw(quantity, rig))

    def smooth(self, quantity: str) -> Floats:
        """Return a smoothed channel of the record. Raises KeyError if it is missing."""
        return smoothed(self.recorded(quantity))

    def recorded(self, quantity: str) -> Floats:
        """Return a channel of the record. Raises KeyError with its name if it is missing."""
        name = self.channel(quantity)
        if name not in self.reader.record:
            raise KeyError(name)
        return self.reader.record[name]


def _computed(scene: Scene, rig: Rig | None) -> Floats:
    """Return δc; the measured one if no loader is judged."""
    try:
        seen = scene.seen("computed", rig)
    except KeyError:
        seen = scene.smooth("computed")
    return seen / scene.base.controls[scene.reader.control].sensing.read_scale


def _missing_force(scene: Scene, rig: Rig | None) -> Floats:
    """Return F − m·δc'' − c·δc' − G_B·δc − F_mod with the parameters of the base, in N.

    All further loader forces of the base are subtracted too. The value is NaN where dry friction or
    a breakout holds the loader, since these forces are not determined there.
    """
    at = _computed(scene, rig)
    speed, loader = scene.rate(at), scene.loader
    product = replay_product(scene.base, scene.reader.control, at, scene.reader.feel())
    moved = loader.mass * scene.rate(speed) + loader.damping * speed
    held = loader.friction * np.sign(speed) + loader.breakout * np.sign(at) - loader.offset
    if loader.bob_weight:
        held = held + loader.bob_weight * (scene.smooth("load_factor") - 1.0)
    if (away := scene.reader.regressor()) is not None:
        held = held + loader.regressor_friction * away * np.sign(speed)
        held = held - loader.regressor_force * away
    spring = loader.basic_gradient * at + loader.cubic * at**3 + loader.force_curve.at(at)
    left = scene.smooth("force") - moved - spring - product - held
    sticks = (loader.friction > 0.0) & (np.abs(speed) < _SMALLEST_SHARE * np.std(speed))
    sticks |= (loader.breakout > 0.0) & (np.abs(at) < _SMALLEST_SHARE * np.std(at))
    return np.where(sticks, np.nan, left)


def _against_base(quantity: str) -> Callable[[Scene, Rig | None], Floats]:
    def left(scene: Scene, rig: Rig | None) -> Floats:
        return scene.raw(quantity, rig) - scene.raw(quantity, scene.base)

    return left


def _bent(scene: Scene, rig: Rig | None) -> Floats:
    """Return δ minus the servo position of the base: the bend of the structure under F."""
    return _against_base("deflection")(scene, rig) + scene.loader.bend * scene.smooth("force")


def _servo_speed(scene: Scene, rig: Rig | None) -> Floats:
    unbent = scene.seen("deflection", rig) - scene.loader.bend * scene.smooth("force")
    return scene.fine * scene.rate(unbent)


def _response(scene: Scene, rig: Rig | None) -> Floats:
    """Return the command for which the surface has its position, % about trim, pull positive."""
    control = scene.reader.control
    position = scene.raw(surface_channel(control), rig)
    sign = COMMAND_SIGN[scene.base.controls[control].surface]
    points = surface_points(scene.base, control)
    assert points is not None  # else its stage would not be judged
    return 100.0 * sign * command_of(position, points)


def _command(scene: Scene) -> Floats:
    """Return the surface command of the base one frame later, in %."""
    control = scene.reader.control
    estimate, pressure = scene.recorded("estimate"), scene.recorded("dynamic_pressure_Pa")
    commands = replay_surface(scene.base, control, estimate, pressure)
    sign = COMMAND_SIGN[scene.base.controls[control].surface]
    return 100.0 * sign * np.concatenate(([0.0], commands[:-1]))


def _ratio(scene: Scene, rig: Rig | None) -> Floats:
    """Return the ratio of surface response to command; NaN for small commands."""
    wanted, answer = _command(scene), _response(scene, rig)
    asked = np.abs(wanted) > _SMALLEST_COMMAND_percent
    ratio = np.full(len(wanted), np.nan)
    ratio[asked] = answer[asked] / wanted[asked]
    return ratio


def _air(scene: Scene, rig: Rig | None) -> Floats:
    model = gusts_of(scene.base, scene.reader.record)
    if model is None or model.up is None:
        raise KeyError("altitude_m")
    return model.up.speed


def _crossing_air(scene: Scene, rig: Rig | None) -> Floats:
    model = gusts_of(scene.base, scene.reader.record)
    if model is None or model.across is None:
        raise KeyError("sideslip_rad")
    return model.across.speed


@dataclass(frozen=True)
class Signal:
    """A signal: label, unit ({d} mm or °, {D} m or °), and the function that computes it."""

    label: str
    unit: str
    get: Callable[[Scene, Rig | None], Floats]

    def label_on(self, control: str) -> str:
        """Return the label with the unit for a control."""
        small, large, tiny = ("mm", "m", "µm") if unit_of(control) == "m" else ("°", "°", "0.001°")
        return f"{self.label}, {self.unit.format(d=small, D=large, u=tiny)}"

    def shown_in(self, control: str, system: System) -> Signal:
        """Return the signal in the units of a system; unchanged in SI."""
        if system == "si":
            return self
        length, angle = unit_of(control) == "m", "°"
        whole = self.unit.format(d="m", D="m", u="m") if length else self.unit
        unit = in_system(whole, system)
        factor = unit.factor
        if length:
            factor *= 1e-3 if "{d}" in self.unit else 1e-6 if "{u}" in self.unit else 1.0
        written = unit.unit.replace("{d}", angle).replace("{D}", angle).replace("{u}", "0.001°")
        return Signal(self.label, written, lambda scene, rig: factor * self.get(scene, rig))


def _other_force(scene: Scene) -> Floats:
    """Return the force on the control that leaks into this control. Raises KeyError without one."""
    for force in scene.reader.partner():
        return smoothed(force)
    raise KeyError("force on another control")


def _regressor(scene: Scene) -> Floats:
    """Return the regressor minus its reference. Raises KeyError without a regressor."""
    if (away := scene.reader.regressor()) is None:
        raise KeyError("regressor")
    return away


def _about_trim(scene: Scene, surface: str) -> Floats:
    """Return the surface position relative to the first row, °."""
    position = scene.smooth(surface)
    return np.asarray((position - position[0]) / DEGREE_rad)


def _in_degrees(name: str, scene: Scene, rig: Rig | None) -> Floats:
    return scene.seen(name, rig) / DEGREE_rad


def _left_in_degrees(axis: str, scene: Scene, rig: Rig | None) -> Floats:
    return _against_base(f"{axis}_rate_rad_per_s")(scene, rig) / DEGREE_rad


def _noise(scene: Scene, rig: Rig | None) -> Floats:
    read = scene.recorded("computed")
    return 1000.0 * scene.fine * (read - smoothed(read))


SIGNALS: dict[str, Signal] = {
    "speed": Signal("deflection rate δc′", "{d}/s", lambda s, r: s.fine * s.rate(_computed(s, r))),
    "acceleration": Signal(
        "acceleration δc″", "{D}/s²", lambda s, r: s.coarse * s.rate(s.rate(_computed(s, r)))
    ),
    "computed": Signal("computed deflection δc", "{d}", lambda s, r: s.fine * _computed(s, r)),
    "missing": Signal("missing force\nF − m·δc″ − c·δc′ − G_B·δc − F_mod", "N", _missing_force),
    "force": Signal("pilot's force F", "N", lambda s, r: s.smooth("force")),
    "other_force": Signal("force on the other control", "N", lambda s, r: _other_force(s)),
    "load": Signal("load factor beyond 1", "g", lambda s, r: s.smooth("load_factor") - 1.0),
    "regressor": Signal("regressor minus its reference", "its unit", lambda s, r: _regressor(s)),
    "pressure": Signal(
        "dynamic pressure q̄", "kPa", lambda s, r: 1e-3 * s.smooth("dynamic_pressure_Pa")
    ),
    "gradient": Signal(
        "scheduled gradient G_T", "N/{D}", lambda s, r: s.raw("gradient", r) / s.coarse
    ),
    "computed_left": Signal(
        "δc minus the loader model's", "{d}", lambda s, r: s.fine * _against_base("computed")(s, r)
    ),
    "product_left": Signal("F_mod − ΔG·δc", "N", _against_base("modifying_force")),
    "noise": Signal("noise of the measured δc", "{u}", _noise),
    "bent": Signal("bend δ − x", "{d}", lambda s, r: s.fine * _bent(s, r)),
    "deflection_left": Signal(
        "residual δ − x − K·F",
        "{d}",
        lambda s, r: s.fine * _against_base("deflection")(s, r),
    ),
    "estimate_left": Signal(
        "δ̂ minus the host model's",
        "{d}",
        lambda s, r: s.fine * _against_base("estimate")(s, r),
    ),
    "deflection": Signal("grip δ", "{d}", lambda s, r: s.fine * s.seen("deflection", r)),
    "servo_speed": Signal("rate of the servo (δ − K·F)′", "{d}/s", _servo_speed),
    "wanted": Signal("surface commanded about trim", "%", lambda s, r: _command(s)),
    "wanted_rate": Signal("command rate", "%/s", lambda s, r: s.rate(smoothed(_command(s)))),
    "answer_left": Signal(
        "surface response − command", "%", lambda s, r: _response(s, r) - _command(s)
    ),
    "answer_rate": Signal(
        "rate of the response", "%/s", lambda s, r: s.rate(smoothed(_response(s, r)))
    ),
    "ratio": Signal("surface response over command", "1", _ratio),
    "elevator": Signal("elevator about trim", "°", lambda s, r: _about_trim(s, "elevator_rad")),
    "aileron": Signal("aileron about trim", "°", lambda s, r: _about_trim(s, "aileron_rad")),
    "rudder": Signal("rudder about trim", "°", lambda s, r: _about_trim(s, "rudder_rad")),
    **{
        name: Signal(words, unit, partial(_in_degrees, channel))
        for name, words, unit, channel in (
            ("pitch_rate", "pitch rate", "°/s", "pitch_rate_rad_per_s"),
            ("roll_rate", "roll rate", "°/s", "roll_rate_rad_per_s"),
            ("yaw_rate", "yaw rate", "°/s", "yaw_rate_rad_per_s"),
            ("alpha", "angle of attack", "°", "alpha_rad"),
            ("sideslip", "sideslip", "°", "sideslip_rad"),
        )
    },
    **{
        f"{axis}_left": Signal(
            f"{axis} rate minus the model's", "°/s", partial(_left_in_degrees, axis)
        )
        for axis in ("pitch", "roll", "yaw")
    },
    "load_answer": Signal("load factor", "g", lambda s, r: s.seen("load_factor", r)),
    "air": Signal("vertical wind, up", "m/s", _air),
    "crossing_air": Signal("crosswind, from the left", "m/s", _crossing_air),
}
