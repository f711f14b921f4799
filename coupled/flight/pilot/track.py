"""A pilot who tracks attitude, path, airspeed, heading or sideslip, by the crossover model.

The pilot has practised on the aircraft with the specified feel: on a rigid rig without friction and
breakout, gain and lead give the set crossover frequency and phase margin. On another rig the same
pilot flies with the same gain and lead. Path and airspeed are controlled through the attitude, by
an outer loop that commands pitch; heading with the wheel likewise through roll.

The muscles' command acts against feel and arm together, so a stiffer feel gives a smaller
deflection:

    δ·((m + m_h)·s² + (c + c_h)·s + G_T + k_h) = u/(T_n·s + 1)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from coupled.arguments import public
from coupled.errors import InputError
from coupled.flight.pilot.base import (
    STRONGEST,
    Action,
    Floats,
    Look,
    Pilot,
    Start,
    edges,
    needs_aircraft,
    turned,
)
from coupled.flight.pilot.crossover import (
    Compensation,
    CompensationFilter,
    Delay,
    Remnant,
    adapt,
    compensation_response,
    delay_response,
)
from coupled.flight.response import Response, control_response, path_angle
from coupled.record.channels import (
    ALTITUDE,
    HEADING,
    PITCH,
    ROLL,
    SIDESLIP,
    SPEED,
    ControlName,
    unit_of,
)
from coupled.rig.equations import specified_gradient
from coupled.rig.packing import COMMAND_SIGN, Hand
from coupled.rig.rig import Rig
from coupled.schema import quantity

What = Literal["pitch", "flight_path", "airspeed", "roll", "heading", "sideslip"]
# The quantities that each control may track, the default first.
FOLLOWED: Mapping[ControlName, tuple[What, ...]] = {
    "column": ("pitch", "flight_path", "airspeed"),
    "wheel": ("roll", "heading"),
    "pedals": ("heading", "sideslip"),
}
# The attitude of each control's inner loop; pedals have none.
_THROUGH: Mapping[ControlName, What] = {"column": "pitch", "wheel": "roll"}
# Quantities that a positive force reduces: a higher nose reduces airspeed, and right pedal turns
# the nose away from a wind that then comes from the left.
_LESSENED: tuple[What, ...] = ("airspeed", "sideslip")


@public
class Track(Pilot):
    """Tracks a target: a change from the condition at `start_s`, and a sum of sines.

    `what` is, on the column, `pitch` (default), `flight_path` or `airspeed`; on the wheel `roll` or
    `heading`; on the pedals `heading` or `sideslip`. The open loop crosses over at
    `crossover_rad_per_s` with `phase_margin_rad` (0.7). The target is `change_rad` and `sine_rad`,
    for airspeed `change_m_per_s` and `sine_m_per_s`. Only on a rig with an aircraft. Raises
    InputError as a run file does, and for a loop beyond a pilot's lead or lag.

    >>> import coupled
    >>> coupled.Track(crossover_rad_per_s=1.5, change_rad=0.05).what
    'pitch'
    """

    kind: Literal["track"] = "track"
    what: What = "pitch"
    crossover_rad_per_s: float = quantity("", gt=0.01, le=10)
    phase_margin_rad: float = quantity("", 0.7, gt=0, le=1.5)
    integral_rad_per_s: float = quantity("", 0.0, ge=0, le=10)
    pitch_crossover_rad_per_s: float = quantity("", 1.5, gt=0.01, le=10)
    pitch_phase_margin_rad: float = quantity("", 0.7, gt=0, le=1.5)
    roll_crossover_rad_per_s: float = quantity("", 1.5, gt=0.01, le=10)
    roll_phase_margin_rad: float = quantity("", 0.7, gt=0, le=1.5)
    change_rad: float = quantity("", 0.0, ge=-1.5, le=1.5)
    change_m_per_s: float = quantity("", 0.0, ge=-200, le=200)
    rise_s: float = quantity("", 1.0, ge=0, le=7200)
    sine_rad: float = quantity("", 0.0, ge=0, le=0.5)
    sine_m_per_s: float = quantity("", 0.0, ge=0, le=50)
    sine_rates_rad_per_s: list[float] = quantity("", [])
    delay_s: float = quantity("", 0.2, ge=0, le=2)
    lag_s: float = quantity("", 0.1, ge=0, le=2)
    arm_stiffness_N_per_m: float = quantity("", 500.0, ge=0, le=1e5)
    arm_damping_N_s_per_m: float = quantity("", 10.0, ge=0, le=1e4)
    arm_stiffness_N_per_rad: float = quantity("", 90.0, ge=0, le=1e5)
    arm_damping_N_s_per_rad: float = quantity("", 2.0, ge=0, le=1e4)
    arm_mass_kg: float = quantity("", 0.0, ge=0, le=20)
    force_limit_N: float = quantity("", 333.6, gt=0, le=STRONGEST)
    lasting_force_N: float = quantity("", 44.5, gt=0, le=STRONGEST)
    endurance_s: float = quantity("", 60.0, gt=0, le=7200)
    remnant: float = quantity("", 0.0, ge=0, le=1)
    _BY_UNIT: ClassVar[tuple[str, ...]] = (
        *Pilot._BY_UNIT,
        "arm_stiffness_N_per",
        "arm_damping_N_s_per",
    )

    def follows(self, control: ControlName) -> What:
        """Return the quantity tracked with a control."""
        return self.what if "what" in self.model_fields_set else FOLLOWED[control][0]

    def check(self, rig: Rig, control: ControlName, file: object) -> None:
        """Refuse quantities of another control, wrong units, and sines too fast for the frames."""
        super().check(rig, control, file)
        needs_aircraft(rig, control, file)
        what = self.follows(control)
        if what not in FOLLOWED[control]:
            problem = f"{what} is not followed with the {control}; give "
            problem += " or ".join(FOLLOWED[control])
            raise InputError(file, f"pilot.{control}.what", problem)
        through = _THROUGH.get(control)
        for inner in ("pitch", "roll"):
            for key in (f"{inner}_crossover_rad_per_s", f"{inner}_phase_margin_rad"):
                if key in self.model_fields_set and (inner != through or inner == what):
                    problem = f"is not used for {what} with the {control}; leave it out"
                    raise InputError(file, f"pilot.{control}.{key}", problem)
        wrong = "rad" if what == "airspeed" else "m_per_s"
        for key in (f"change_{wrong}", f"sine_{wrong}"):
            if key in self.model_fields_set:
                problem = f"is no target for {what}; give it in its own unit"
                raise InputError(file, f"pilot.{control}.{key}", problem)
        if any(not 0.0 < rate < rig.frame_rate for rate in self.sine_rates_rad_per_s):
            problem = f"must lie between 0 and {rig.frame_rate:g}, the frame rate"
            raise InputError(file, f"pilot.{control}.sine_rates_rad_per_s", problem)

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the arm and its command, practised on the specified rig."""
        needs_aircraft(rig, control, start.file)
        hand = Hand(
            *self._arm(control),
            lag_s=self.lag_s,
            strongest=self.force_limit_N,
            lasting=min(self.lasting_force_N, 0.999 * self.force_limit_N),
            endurance_s=self.endurance_s,
            mass=self.arm_mass_kg,
        )
        practised = self._practised(rig, control, start)
        return Action(hand=hand, look=self._look(rig, control, *practised, start.seed))

    def _arm(self, control: ControlName) -> tuple[float, float]:
        """Return the arm's stiffness in N/d and its damping in N·s/d on a control."""
        if unit_of(control) == "rad":
            return self.arm_stiffness_N_per_rad, self.arm_damping_N_s_per_rad
        return self.arm_stiffness_N_per_m, self.arm_damping_N_s_per_m

    def _practised(
        self, rig: Rig, control: ControlName, start: Start
    ) -> tuple[Compensation, Compensation | None]:
        """Return the compensation on the attitude, and that of the outer loop, if any.

        Without an outer loop the first is on the tracked quantity itself.
        """
        frame_s, controls = 1.0 / rig.frame_rate, tuple(rig.controls)

        def element(what: What, rate: float) -> complex:
            """Return the aircraft's response per newton of the pilot's command."""
            assert rig.flight is not None
            file = start.rig_file
            answer = control_response(rig.flight, frame_s, controls, control, file, rate)
            limbs = self._arm_gain(rig, control, answer.pressure_Pa, rate)
            limbs *= delay_response(self.delay_s, frame_s, rate)
            sign = -1.0 if what in _LESSENED else 1.0
            return sign * limbs * _motion(answer, what)

        def adapted(
            key: str, motion: complex, rate: float, margin: float, integral: float
        ) -> Compensation:
            found = adapt(motion, rate, margin, integral, frame_s)
            if isinstance(found, Compensation):
                return found
            word = "lead" if found > 0.0 else "lag"
            problem = f"takes {math.degrees(abs(found)):.0f}° of {word} with this phase margin"
            place = f"pilot.{control}.{key}crossover_rad_per_s"
            raise InputError(start.file, place, f"{problem}, of which a pilot gives at most 80°")

        what, crossover = self.follows(control), self.crossover_rad_per_s
        own = (crossover, self.phase_margin_rad, self.integral_rad_per_s)
        sign = -1.0 if what in _LESSENED else 1.0
        through = _THROUGH.get(control, what)
        if what == through:
            found = adapted("", element(what, crossover), *own)
            return replace(found, gain=sign * found.gain), None
        inner_rate, inner_margin = self.pitch_crossover_rad_per_s, self.pitch_phase_margin_rad
        if through == "roll":
            inner_rate, inner_margin = self.roll_crossover_rad_per_s, self.roll_phase_margin_rad
        inner = adapted(f"{through}_", element(through, inner_rate), inner_rate, inner_margin, 0.0)
        by_pilot = compensation_response(inner, frame_s, crossover)
        closed = by_pilot * element(what, crossover)
        closed /= 1.0 + by_pilot * element(through, crossover)
        outer = adapted("", closed, *own)
        return inner, replace(outer, gain=sign * outer.gain)

    def _arm_gain(self, rig: Rig, name: ControlName, pressure_Pa: float, rate: float) -> complex:
        """Return the surface command per newton of the pilot's, on the specified rig."""
        control, s, frame_s = rig.controls[name], 1j * rate, 1.0 / rig.frame_rate
        loader, rigging = control.loader, control.rigging
        servo, follows = 2.0 * math.pi * loader.servo_frequency, complex(1.0)
        if servo > 0.0:
            follows = servo**2 / (s**2 + 2.0 * loader.servo_damping_ratio * servo * s + servo**2)
        gradient = specified_gradient(control.schedule, pressure_Pa)
        feel = loader.mass * s**2 + loader.damping * s + gradient
        stiffness, damping = self._arm(name)
        arm = (stiffness + damping * s + self.arm_mass_kg * s**2) * follows
        late = np.exp(-s * (0.5 * frame_s + loader.delay))  # the command is held over a frame
        # The host takes δc, before the servo, which only affects the arm.
        # About neutral: the mean of both sides' gains.
        drive: complex = (
            COMMAND_SIGN[control.surface] * 0.5 * (1.0 / control.pull + 1.0 / control.push)
        )
        drive /= (1.0 + rigging.stretch_loss * pressure_Pa) * (1.0 + rigging.lag * s)
        return complex(drive * late / ((1.0 + self.lag_s * s) * (feel + arm)))

    def target(self, times: Floats) -> Floats:
        """Return the target over time, relative to the start; rad or m/s."""
        after = np.maximum(times - self.start_s, 0.0)
        sines = np.zeros_like(after)
        for i, rate in enumerate(self.sine_rates_rad_per_s):
            phase = 2.4 * i * i  # so that the peaks do not coincide; each begins at zero
            sines += np.sin(rate * after + phase) - np.sin(phase) * np.exp(-after)
        step = edges(times, [(self.start_s, 1.0)], self.rise_s)
        if self.what == "airspeed":  # only on a column
            return np.asarray(self.change_m_per_s * step + self.sine_m_per_s * sines)
        return np.asarray(self.change_rad * step + self.sine_rad * sines)

    def _look(
        self,
        rig: Rig,
        control: ControlName,
        on_attitude: Compensation,
        around: Compensation | None,
        seed: int,
    ) -> Look:
        """Return the pilot's function of time and motion, with its own state."""
        frame_s, what = 1.0 / rig.frame_rate, self.follows(control)
        through = _THROUGH.get(control, what)
        inner, late = CompensationFilter(on_attitude, frame_s), Delay(self.delay_s, frame_s)
        outer = CompensationFilter(around, frame_s) if around is not None else None
        remnant = Remnant(self.remnant, self.lag_s, frame_s, seed)
        found: tuple[float, float] | None = None
        before = math.nan

        def look(time: float, motion: tuple[float, ...]) -> float:
            nonlocal found, before
            path = 0.0 if math.isnan(before) else path_angle(motion, before, frame_s)
            before = motion[ALTITUDE]
            if time < self.start_s:
                return 0.0
            now = (_tracked_value(motion, path, through), _tracked_value(motion, path, what))
            found = now if found is None else found
            attitude = _deviation(found[0], now[0], through)
            asked = float(self.target(np.array([time]))[0])
            if outer is not None:
                asked = outer(asked - _deviation(found[1], now[1], what))
            error = asked - attitude
            return inner(late(error + remnant(error)))

        return look


def _tracked_value(motion: tuple[float, ...], path_rad: float, what: What) -> float:
    """Return the tracked quantity, rad or m/s."""
    if what == "flight_path":
        return path_rad
    places = {"pitch": PITCH, "airspeed": SPEED, "roll": ROLL}
    return motion[(places | {"heading": HEADING, "sideslip": SIDESLIP})[what]]


def _deviation(found: float, now: float, what: What) -> float:
    """Return the deviation of the tracked quantity from its start; a heading the shorter way."""
    return turned(found, now) if what in ("roll", "heading") else now - found


def _motion(answer: Response, what: What) -> complex:
    """Return the aircraft's response of the tracked quantity to a command."""
    motions = {"pitch": answer.pitch, "flight_path": answer.flight_path}
    motions |= {"airspeed": answer.airspeed, "roll": answer.roll}
    return (motions | {"heading": answer.heading, "sideslip": answer.sideslip})[what]
