"""The sections of a control-loading rig: the data of a rig file, checked and frozen.

Each section is a table of the file; a field's key there is its name and its unit, d being m for
column and pedals and rad for a wheel (`schema`). A neutral value (0, or 1 for a factor) leaves an
effect out. Signs: pull, clockwise and right foot forward are positive.
"""

from __future__ import annotations

import re
import unicodedata
from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import Field, PlainValidator, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from coupled.rig.curves import (
    BendCurve,
    CommandCurve,
    DeflectionReading,
    ForceReading,
    FrictionCurve,
    GradientCurve,
    GripLoad,
    LoadCurve,
    SpringCurve,
)
from coupled.schema import Section, derived, named, quantity, text_like

# A name usable in a file name: letters, digits, dot, dash, underscore.
TURN = 6.2832  # rad
PLAIN_NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,79}$"
PlainName = Annotated[
    str,
    text_like(
        PLAIN_NAME,
        "should be letters, digits, dots, dashes and underscores, the first a letter or a digit,"
        " at most 80 characters",
    ),
]


def plain_name(text: str) -> str:
    """Return the nearest valid name: without accents, other characters as dashes."""
    plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode()
    return re.sub("[^A-Za-z0-9_.]+", "-", plain).strip("-_.")[:80] or "unnamed"


MAX_ROWS = 32  # of a schedule's table
MAX_NODES = 64  # deflections of a curve
DELAY_SLOTS = 1024  # of the loader's force history, in substeps; a power of two
GAUGE_SLOTS = 256  # of the gauge's, likewise
SERVO_DAMPING_RATIO = 0.7  # usual; of a servo that a fit adds to a rig without one


class Loader(Section):
    """Electronics, servo and structure: the true hardware."""

    mass: float = quantity("kg", gt=0)
    damping: float = quantity("N_s_per_{d}", ge=0)
    basic_gradient: float = quantity("N_per_{d}", ge=0)
    breakout: float = quantity("N", 0.0, ge=0)
    friction: float = quantity("N", 0.0, ge=0)
    breakaway: float = quantity("N", 0.0, ge=0)
    stribeck_rate: float = quantity("{d}_per_s", 0.002, gt=0)
    friction_stiffness: float = quantity("N_per_{d}", 0.0, ge=0)
    friction_elastic_share: float = quantity("", 0.3, ge=0, le=0.99)
    friction_pull: float = quantity("N", 0.0, ge=0)
    friction_push: float = quantity("N", 0.0, ge=0)
    friction_by_load: float = quantity("", 0.0, ge=0, le=0.9)
    regressor: PlainName | None = None
    regressor_reference: float = quantity("", 0.0)
    regressor_force: float = quantity("N_per_unit", 0.0)
    regressor_friction: float = quantity("N_per_unit", 0.0)
    bob_weight: float = quantity("N_per_g", 0.0)
    offset: float = quantity("N", 0.0)
    cubic: float = quantity("N_per_{d}3", 0.0)
    ripple: float = quantity("N", 0.0)
    ripple_period: float = quantity("{d}", 0.01, gt=0)
    ripple_phase: float = quantity("rad", 0.0)
    gravity: float = quantity("N", 0.0, ge=0)
    gravity_angle: float = quantity("rad", 0.0, ge=-TURN, le=TURN)
    relaxing_stiffness: float = quantity("N_per_{d}", 0.0, ge=0)
    relaxing_time: float = quantity("s", 1.0, gt=0)
    force_limit: float = quantity("N", 0.0, ge=0)
    stop_aft: float = quantity("{d}", 0.0, ge=0)
    stop_forward: float = quantity("{d}", 0.0, ge=0)
    crosstalk: float = quantity("", 0.0, ge=-1, le=1)
    delay: float = quantity("s", 0.0, ge=0, le=0.2)
    multiplier: Literal["hybrid", "digital"] = "hybrid"
    multiplier_offset: float = quantity("N", 0.0)
    multiplier_drift: float = quantity("N_per_s", 0.0)
    modifying_lag: float = quantity("s", 0.0, ge=0, le=10)
    servo_frequency: float = quantity("Hz", 0.0, ge=0, written=True)
    servo_damping_ratio: float = quantity("", SERVO_DAMPING_RATIO, gt=0, written=True)
    servo_delay: float = quantity("s", 0.0, ge=0, le=0.5)
    servo_rate_share: float = quantity("", 0.0, ge=0, le=1)
    servo_rate_limit: float = quantity("{d}_per_s", 0.0, ge=0)
    servo_acceleration_limit: float = quantity("{d}_per_s2", 0.0, ge=0)
    bend: float = quantity("{d}_per_N", 0.0, ge=0)
    bend_push: float | None = quantity("{d}_per_N", None, ge=0)
    bend_limit: float = quantity("{d}", 0.0, ge=0)
    bend_hysteresis_share: float = quantity("", 0.0, ge=0, lt=1)
    bend_hysteresis_width: float = quantity("N", 0.0, ge=0)
    bend_frequency: float = quantity("Hz", 0.0, ge=0)
    bend_damping_ratio: float = quantity("", 0.05, ge=0)
    play: float = quantity("{d}", 0.0, ge=0)
    play_stiffness: float = quantity("N_per_{d}", 0.0, ge=0)
    arc_geometry: bool = False
    force_curve: SpringCurve = SpringCurve()
    friction_curve: FrictionCurve = FrictionCurve()
    load_curve: LoadCurve = LoadCurve()
    bend_curve: BendCurve = BendCurve()

    @property
    def least_bend(self) -> float:
        """The least bend by the force, d/N, without its curve; 0 if the bend has a limit."""
        push = self.bend if self.bend_push is None else self.bend_push
        return 0.0 if self.bend_limit > 0.0 else min(self.bend, push)


class Schedule(Section):
    """Force over deflection and dynamic pressure, and faults of its use.

    One or two gradients at each pressure, or a curve: forces beyond the breakout at `deflection`,
    a row for each pressure. A curve that begins at zero is odd in the deflection.
    """

    dynamic_pressure: list[float] = quantity("Pa", min_length=1)
    deflection: list[float] | None = quantity("{d}", None)
    force: list[list[float]] | None = quantity("N", None)
    total_gradient: list[float] = quantity("N_per_{d}", [], validate_default=True)
    second_gradient: list[float] | None = quantity("N_per_{d}", None)
    break_deflection: float = quantity("{d}", 0.0, ge=0)
    pressure_scale: float = quantity("", 1.0, gt=0)
    pressure_lag: float = quantity("s", 0.0, ge=0)
    slope: float = quantity("", 1.0, ge=0, le=100)
    gradient_curve: GradientCurve = GradientCurve()

    @field_validator("total_gradient")
    @classmethod
    def _is_given(cls, value: list[float], info: ValidationInfo) -> list[float]:
        """Refuse a schedule of neither gradients nor a curve."""
        if not value and all(
            info.data.get(key, "wrong") is None for key in ("deflection", "force")
        ):
            raise PydanticCustomError("missing", "is missing")
        return value

    @property
    def segments(self) -> list[list[float]]:
        """The gradient of each segment at each pressure, N/d."""
        if self.deflection is None or self.force is None:
            first, second = self.total_gradient, self.second_gradient
            return [first] if second is None else [first, second]
        nodes = list(zip(self.deflection, zip(*self.force, strict=True), strict=True))
        return [
            [(f1 - f0) / (d1 - d0) for f0, f1 in zip(low, high, strict=True)]
            for (d0, low), (d1, high) in pairwise(nodes)
        ]

    @property
    def curved(self) -> bool:
        """Whether a curve is specified, not gradients."""
        return self.deflection is not None

    @property
    def gradients(self) -> list[float]:
        """G_T at each pressure, N/d: up to the break, or the steepest gradient of a curve."""
        if not self.curved:
            return self.total_gradient
        return [max(row) for row in zip(*self.segments, strict=True)]


class Compensation(Section):
    """The host's corrections, and the numbers that it assumes of the hardware."""

    deflection: bool
    gradient: bool
    bend: float = quantity("{d}_per_N", 0.0, ge=0)
    basic_gradient: float | None = quantity("N_per_{d}", None, ge=0)
    breakout: float | None = quantity("N", None, ge=0)
    breakout_term: Literal["exact", "printed"] = "exact"
    inertia_gradient: list[float] | None = quantity("N_per_{d}", None, min_length=2)
    mass_factor: list[float] | None = quantity("", None)
    damping_factor: list[float] | None = quantity("", None)
    force_lead: list[float] | None = quantity("s", None)
    force_lead_lag: float = quantity("s", 0.002, gt=0)
    missed_share: float = quantity("", 0.0, ge=0, le=0.95)


class Sensing(Section):
    """Gauge, scales and converters between loader and host (figure 3); 0 bits is no converter.

    Each scale is real over assumed. S₁ has two parts: the electronics' own (`computed_scale`), in
    v₁ for host and analog multiplier alike, and that of the host's reading of v₁ alone.
    """

    computed_scale: float = quantity("", 1.0, gt=0)
    deflection_scale: float = quantity("", 1.0, gt=0)
    modifying_scale: float = quantity("", 1.0, gt=0)
    force_scale: float = quantity("", 1.0, gt=0)
    word_length: int = quantity("bits", 0, ge=0, le=24)
    full_scale: float = quantity("V", 100.0, gt=0)
    s1: float = quantity("V_per_{d}", 0.0, ge=0)
    s2: float = quantity("V_per_N", 0.0, ge=0)
    s3: float = quantity("V_per_N", 0.0, ge=0)
    gauge_mass: float = quantity("kg", 0.0, ge=0)
    gauge_order: Literal["first", "second"] = "second"
    gauge_frequency: float = quantity("Hz", 0.0, ge=0)
    gauge_damping_ratio: float = quantity("", 0.7, gt=0)
    gauge_delay: float = quantity("s", 0.0, ge=0, le=0.1)
    gauge_sampling: float = quantity("Hz", 0.0, ge=0)
    computed_skew: float = quantity("s", 0.0, ge=0)
    force_skew: float = quantity("s", 0.0, ge=0)
    force_zero: float = quantity("N", 0.0)
    deflection_zero: float = quantity("{d}", 0.0)
    scale_drift: float = quantity("per_s", 0.0, ge=-0.1, le=0.1)
    hum: float = quantity("{d}", 0.0)
    hum_frequency: float = quantity("Hz", 50.0, gt=0, le=1000)
    hum_phase: float = quantity("rad", 0.0)
    force_stamp: float = quantity("s", 0.0, ge=-0.5, le=0.5)
    gradient_skew: float = quantity("s", 0.0, ge=0)
    deflection_curve: DeflectionReading = DeflectionReading()
    force_curve: ForceReading = ForceReading()
    grip_curve: DeflectionReading = DeflectionReading()
    grip_load_curve: GripLoad = GripLoad()

    @property
    def read_scale(self) -> float:
        """δc as the host reads it over δc."""
        return self.computed_scale * self.deflection_scale


class Rigging(Section):
    """The chain from the host's command to the surface."""

    stretch_loss: float = quantity("per_Pa", 0.0, ge=0)
    lag: float = quantity("s", 0.0, ge=0)
    rate_limit: float = quantity("norm_per_s", 0.0, ge=0)
    play: float = quantity("norm", 0.0, ge=0)
    offset: float = quantity("norm", 0.0, ge=-1, le=1)
    command_curve: CommandCurve = CommandCurve()


class Services(Section):
    """Services of the loader; 0 leaves a service out (`services`)."""

    trim_release_gradient: float = quantity("N_per_{d}", 0.0, ge=0)
    trim_release_damping: float = quantity("N_s_per_{d}", 0.0, ge=0)
    autopilot_stiffness: float = quantity("N_per_{d}", 0.0, ge=0)
    autopilot_damping: float = quantity("N_s_per_{d}", 0.0, ge=0)
    override: float = quantity("N", 0.0, ge=0)
    override_time: float = quantity("s", 0.0, ge=0)
    other_mass: float = quantity("kg", 0.0, ge=0)
    other_damping: float = quantity("N_s_per_{d}", 0.0, ge=0)
    other_gradient: float = quantity("N_per_{d}", 0.0, ge=0)
    other_share: float = quantity("", 0.0, ge=0, le=1)
    link_stiffness: float = quantity("N_per_{d}", 0.0, ge=0)
    link_damping: float = quantity("N_s_per_{d}", 0.0, ge=0)
    disconnect: float = quantity("N", 0.0, ge=0)
    jam_breaks: float = quantity("N", 0.0, ge=0)
    shaker: float = quantity("N", 0.0, ge=0)
    shaker_frequency: float = quantity("Hz", 12.0, gt=0, le=100)
    shaker_alpha: float = quantity("rad", 0.0, ge=0)
    pusher: float = quantity("N", 0.0, ge=0)
    pusher_rise: float = quantity("s", 0.2, ge=0)
    pusher_alpha: float = quantity("rad", 0.0, ge=0)
    hinge_alpha: float = quantity("N_per_Pa_rad", 0.0)
    hinge_surface: float = quantity("N_per_Pa", 0.0)
    soft_stop: float = quantity("{d}", 0.0, ge=0)
    soft_stop_stiffness: float = quantity("N_per_{d}", 0.0, ge=0)
    soft_stop_damping: float = quantity("N_s_per_{d}", 0.0, ge=0)
    envelope_above: float = quantity("g", 0.0)
    envelope: float = quantity("N_per_g", 0.0, ge=0)
    envelope_below: float = quantity("g", 0.0)
    envelope_push: float = quantity("N_per_g", 0.0, ge=0)


class Gains(Section):
    """Gains set before any readings are taken; 0 for an unknown ratio (figure 3).

    `low_gradient` is the one used for a calibration of S₁ at a low gradient, eq. (7a); 0 for the
    schedule's lowest.
    """

    mechanical_advantage: float = quantity("", 1.0, gt=0)
    s1_over_s2: float = quantity("N_per_{d}", 0.0, ge=0)
    s3_over_s2: float = quantity("", 0.0, ge=0)
    low_gradient: float = quantity("N_per_{d}", 0.0, ge=0)


class Calibration(Section):
    """The results of a calibration, with standard errors, and the gains during it.

    `readings` is 0 without a calibration; S2 is 0 if it was not found.
    """

    readings: int = quantity("", 0, ge=0)
    date: Annotated[
        str, text_like(r"[^\x00-\x1f\x7f]{0,40}", "should be one line of at most 40 characters")
    ] = ""
    s1: float = quantity("V_per_{d}", 0.0, ge=0)
    s1_error: float = quantity("V_per_{d}", 0.0, ge=0)
    s2: float = quantity("V_per_N", 0.0, ge=0)
    s2_error: float = quantity("V_per_N", 0.0, ge=0)
    s3: float = quantity("V_per_N", 0.0, ge=0)
    s3_error: float = quantity("V_per_N", 0.0, ge=0)
    bend: float = quantity("{d}_per_N", 0.0)
    bend_error: float = quantity("{d}_per_N", 0.0, ge=0)
    length: float = quantity("m", 0.0, ge=0)
    mechanical_advantage: float = quantity("", 1.0, gt=0)
    s1_over_s2: float = quantity("N_per_{d}", 0.0, ge=0)
    s3_over_s2: float = quantity("", 0.0, ge=0)


_PART = r"[A-Za-z_][\w.\-]{0,80}(\[\d{1,4}\])?"
_PROPERTY = re.compile(rf"-?{_PART}(/{_PART}){{1,15}}").fullmatch


def _properties(given: Any) -> str | list[str]:
    names = [given] if isinstance(given, str) else given
    if not isinstance(names, list) or len(names) > 8:
        names = [None]
    if not all(isinstance(name, str) and _PROPERTY(name) for name in names):
        raise ValueError(
            "should be a JSBSim property, as fcs/stabilator-pos-rad, or a list of up to 8"
        )
    kept: str | list[str] = given
    return kept


Properties = Annotated[str | list[str], PlainValidator(_properties)]


class SurfaceProperties(Section):
    """A model's own properties of a surface; empty for JSBSim's usual ones.

    `command` are all moved by the control's command; the position is the mean of `position`. One
    with a minus before it has the opposite sign.
    """

    command: list[str] = []
    position: list[str] = []


def stop_of(travel: float, stop: float) -> float:
    """Return a control's stop on one side, d: its `travel` there, or a `stop` within it."""
    return min(travel, stop) if stop > 0.0 else travel


class Control(Section):
    """One control of the rig."""

    surface: Literal["elevator", "aileron", "rudder"]
    command_property: Properties = []
    surface_property: Properties = []
    drive: Literal["force", "displacement", "setpoint"] = "force"
    travel: float = quantity("{d}", gt=0)
    travel_pull: float = quantity("{d}", 0.0, ge=0)
    travel_push: float = quantity("{d}", 0.0, ge=0)
    length: float = quantity("m", 0.0, ge=0)
    loader: Loader
    schedule: Schedule
    compensation: Compensation
    sensing: Sensing = Sensing()
    services: Services = Services()
    gains: Gains = Gains()
    rigging: Rigging = Rigging()
    calibration: Calibration = Calibration()
    # Tolerances of the numbers above: half a 95 % interval by key, in the key's unit.
    tolerance: dict[str, float] = {}
    guesses: list[str] = []  # keys of numbers that nobody measured

    @property
    def pull(self) -> float:
        """Travel in the positive direction, d: a pull, a clockwise turn, right foot forward."""
        return self.travel_pull or self.travel

    @property
    def push(self) -> float:
        """Travel in the negative direction, d, as a size."""
        return self.travel_push or self.travel

    def travel_to(self, side: float) -> float:
        """Return the travel on a side, d: of a pull if `side` is positive, else of a push."""
        return self.pull if side > 0.0 else self.push

    def stop_to(self, side: float) -> float:
        """Return the stop on a side, d: the end of the travel there, or a stop within it."""
        stop = self.loader.stop_aft if side > 0.0 else self.loader.stop_forward
        return stop_of(self.travel_to(side), stop)

    @property
    def properties(self) -> SurfaceProperties:
        """The model's own properties of the surface."""
        command, position = (
            [given] if isinstance(given, str) else given
            for given in (self.command_property, self.surface_property)
        )
        return SurfaceProperties(command=command, position=position)

    @property
    def assumed_basic_gradient(self) -> float:
        """G_B assumed by the host, N/d; by default the loader's own."""
        given = self.compensation.basic_gradient
        return self.loader.basic_gradient if given is None else given

    @property
    def assumed_breakout(self) -> float:
        """F_BO assumed by the host, N; by default the loader's own."""
        given = self.compensation.breakout
        return self.loader.breakout if given is None else given


class Flight(Section):
    """The JSBSim model, its loading and trim, factors on its moments, and the air."""

    model: Annotated[
        str, text_like(r"[^\x00-\x1f\x7f/\\]{1,120}", "should be the name of a JSBSim model")
    ]
    folder: str = named("model_folder", "")
    model_file: Annotated[
        str,
        text_like(r"[^\x00-\x1f\x7f/\\]{0,120}", "should be a file of the model's folder"),
    ] = ""
    altitude: float = quantity("m")
    calibrated_airspeed: float = quantity("m_per_s", gt=0)
    flight_path: float = quantity("rad", 0.0, ge=-0.6, le=0.6)
    trim: Literal["jsbsim", "newton"] = "jsbsim"
    direct_controls: bool = True
    landing: bool = False
    steps_per_frame: int = quantity("", 1, ge=1, le=100)
    elevator_effectiveness: float = quantity("", 1.0, ge=-10, le=10)
    aileron_effectiveness: float = quantity("", 1.0, ge=-10, le=10)
    rudder_effectiveness: float = quantity("", 1.0, ge=-10, le=10)
    pitch_damping: float = quantity("", 1.0, ge=-10, le=10)
    roll_damping: float = quantity("", 1.0, ge=-10, le=10)
    yaw_damping: float = quantity("", 1.0, ge=-10, le=10)
    pitch_stiffness: float = quantity("", 1.0, ge=-10, le=10)
    dihedral_effect: float = quantity("", 1.0, ge=-10, le=10)
    directional_stability: float = quantity("", 1.0, ge=-10, le=10)
    adverse_yaw: float = quantity("", 1.0, ge=-10, le=10)
    pitching_moment: float = quantity("", 0.0, ge=-2, le=2)
    lift_offset: float = quantity("", 0.0, ge=-2, le=2)
    yawing_moment: float = quantity("", 0.0, ge=-2, le=2)
    side_force: float = quantity("", 0.0, ge=-2, le=2)
    lift_slope: float = quantity("", 1.0, ge=0, le=10)
    side_force_slope: float = quantity("", 1.0, ge=-10, le=10)
    drag: float = quantity("", 1.0, ge=0, le=10)
    thrust: float = quantity("", 1.0, ge=0, le=10)
    mass: float = quantity("", 1.0, gt=0, le=10)
    roll_inertia: float = quantity("", 1.0, gt=0, le=10)
    pitch_inertia: float = quantity("", 1.0, gt=0, le=10)
    yaw_inertia: float = quantity("", 1.0, gt=0, le=10)
    cg_aft: float = quantity("m", 0.0, ge=-5, le=5)
    fuel: float = quantity("", 1.0, ge=0, le=100)
    motion_stamp: float = quantity("s", 0.0, ge=-0.5, le=0.5)
    elevator_zero: float = quantity("rad", 0.0, ge=-0.6, le=0.6)
    alpha_zero: float = quantity("rad", 0.0, ge=-0.6, le=0.6)
    sideslip_zero: float = quantity("rad", 0.0, ge=-0.6, le=0.6)
    pitch_zero: float = quantity("rad", 0.0, ge=-0.6, le=0.6)
    load_factor_zero: float = quantity("", 0.0, ge=-2, le=2)
    pitch_rate_zero: float = quantity("rad_per_s", 0.0, ge=-1, le=1)
    roll_rate_zero: float = quantity("rad_per_s", 0.0, ge=-1, le=1)
    yaw_rate_zero: float = quantity("rad_per_s", 0.0, ge=-1, le=1)
    gust_rms: float = quantity("m_per_s", 0.0, ge=0, le=30)
    lateral_gust_rms: float = quantity("m_per_s", 0.0, ge=0, le=30)
    gust_length: float = quantity("m", 150.0, gt=0)
    properties: dict[str, float] = {}
    terms: dict[str, Annotated[float, Field(ge=-10, le=10)]] = {}
    # By control, those of its section of the rig: they belong to the model.
    surfaces: dict[str, SurfaceProperties] = derived({})

    @property
    def main_file(self) -> str:
        """The model's main file, relative to the folder of all models."""
        file = self.model_file.removesuffix(".xml") or self.model
        return f"{self.model}/{file}.xml"

    @property
    def still(self) -> bool:
        """Whether the rig has no gusts."""
        return self.gust_rms == self.lateral_gust_rms == 0.0
