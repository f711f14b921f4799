"""A pilot who tracks pitch, flight path or airspeed with the column, by the crossover model.

The pilot has practised on the aircraft with the feel that is specified: gain and lead are
those which, on a rigid rig without friction and breakout, make the loop cross over at the
frequency and with the phase margin that are set. On another rig the same pilot flies with
what practice gave. Path and airspeed are flown through the attitude, as pilots do: an
outer loop asks for pitch.

The muscles' command works against feel and arm together, so a stiffer feel gives a smaller
deflection:

    δ·(m·s² + (c + c_h)·s + G_T + k_h) = u/(T_n·s + 1)
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

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
)
from coupled.flight.pilot.crossover import (
    Acting,
    Compensation,
    Delay,
    adapt,
    compensation_response,
    delay_response,
)
from coupled.flight.pilot.remnant import Remnant
from coupled.flight.response import Response, elevator_response, path_angle
from coupled.record.channels import ALTITUDE, PITCH, SPEED, ControlName
from coupled.rig.equations import specified_gradient
from coupled.rig.packing import COMMAND_SIGN, Hand
from coupled.rig.rig import Rig
from coupled.schema import quantity

What = Literal["pitch", "flight_path", "airspeed"]


class Track(Pilot):
    """Tracks a target: a change of what the aircraft flew at `start_s`, and a sum of sines.

    `what` is `pitch`, `flight_path` or `airspeed`; the open loop crosses over at
    `crossover_rad_per_s` with `phase_margin_rad` (0.7). The target is `change_rad` and
    `sine_rad`, of airspeed `change_m_per_s` and `sine_m_per_s`. On the column of a rig that
    flies. Raises InputError as a run file does, and for a loop that no pilot can give.

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
    force_limit_N: float = quantity("", 333.6, gt=0, le=STRONGEST)
    lasting_force_N: float = quantity("", 44.5, gt=0, le=STRONGEST)
    endurance_s: float = quantity("", 60.0, gt=0, le=7200)
    remnant: float = quantity("", 0.0, ge=0, le=1)

    def check(self, rig: Rig, control: ControlName, file: object) -> None:
        """Refuse a target in the unit of another, and sines that no frame can follow."""
        super().check(rig, control, file)
        needs_aircraft(rig, control, file)
        wrong = "rad" if self.what == "airspeed" else "m_per_s"
        for key in (f"change_{wrong}", f"sine_{wrong}"):
            if key in self.model_fields_set:
                problem = f"is no target for {self.what}; give it in its own unit"
                raise InputError(file, f"pilot.{control}.{key}", problem)
        if any(not 0.0 < rate < rig.frame_rate for rate in self.sine_rates_rad_per_s):
            problem = f"must lie between 0 and {rig.frame_rate:g}, the frame rate"
            raise InputError(file, f"pilot.{control}.sine_rates_rad_per_s", problem)

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        """Return the arm and its command, practised on the rig as it is specified."""
        hand = Hand(
            self.arm_stiffness_N_per_m,
            self.arm_damping_N_s_per_m,
            lag_s=self.lag_s,
            strongest=self.force_limit_N,
            lasting=min(self.lasting_force_N, 0.999 * self.force_limit_N),
            endurance_s=self.endurance_s,
        )
        return Action(hand=hand, look=self._look(rig, *self._practised(rig, start), start.seed))

    def _practised(self, rig: Rig, start: Start) -> tuple[Compensation, Compensation | None]:
        """Return the compensation on pitch, and that of path or airspeed around it, if any."""
        frame_s, controls = 1.0 / rig.frame_rate, tuple(rig.controls)

        def element(rate: float) -> Response:
            """Return what the aircraft does per newton of the pilot's command."""
            assert rig.flight is not None
            answer = elevator_response(rig.flight, frame_s, controls, start.rig_file, rate)
            limbs = self._limbs(rig, answer.pressure_Pa, rate)
            limbs *= delay_response(self.delay_s, frame_s, rate)
            pitch, path, speed, load = (limbs * motion for motion in answer[:4])
            return Response(pitch, path, speed, load, answer.pressure_Pa)

        crossover = self.crossover_rad_per_s
        asked = ("crossover", crossover, self.phase_margin_rad, self.integral_rad_per_s)
        if self.what == "pitch":
            return self._adapted(element(crossover).pitch, asked, frame_s, start.file), None
        inner_rate = self.pitch_crossover_rad_per_s
        of_pitch = ("pitch_crossover", inner_rate, self.pitch_phase_margin_rad, 0.0)
        inner = self._adapted(element(inner_rate).pitch, of_pitch, frame_s, start.file)
        answer, by_pilot = element(crossover), compensation_response(inner, frame_s, crossover)
        # A higher nose makes the path steeper, and the airspeed less.
        motion = answer.flight_path if self.what == "flight_path" else -answer.airspeed
        closed = by_pilot * motion / (1.0 + by_pilot * answer.pitch)
        outer = self._adapted(closed, asked, frame_s, start.file)
        return inner, replace(outer, gain=-outer.gain) if self.what == "airspeed" else outer

    def _limbs(self, rig: Rig, pressure_Pa: float, rate: float) -> complex:
        """Return the elevator command per newton of the pilot's, on the rig as specified."""
        control, s, frame_s = rig.controls["column"], 1j * rate, 1.0 / rig.frame_rate
        loader, rigging = control.loader, control.rigging
        servo = 2.0 * math.pi * loader.servo_frequency
        follows = servo**2 / (s**2 + 2.0 * loader.servo_damping_ratio * servo * s + servo**2)
        gradient = specified_gradient(control.schedule, pressure_Pa)
        feel = loader.mass * s**2 + loader.damping * s + gradient
        arm = (self.arm_stiffness_N_per_m + self.arm_damping_N_s_per_m * s) * follows
        late = np.exp(-s * (0.5 * frame_s + loader.delay))  # the command is held over a frame
        # The host takes δc, ahead of the servo, which only the arm feels.
        drive: complex = COMMAND_SIGN[control.surface] / control.travel
        drive /= (1.0 + rigging.stretch_loss * pressure_Pa) * (1.0 + rigging.lag * s)
        return complex(drive * late / ((1.0 + self.lag_s * s) * (feel + arm)))

    def _adapted(
        self, element: complex, asked: tuple[str, float, float, float], frame_s: float, file: object
    ) -> Compensation:
        key, crossover, margin, integral = asked
        found = adapt(element, crossover, margin, integral, frame_s)
        if isinstance(found, Compensation):
            return found
        word = "lead" if found > 0.0 else "lag"
        problem = f"takes {math.degrees(abs(found)):.0f}° of {word} with this phase margin"
        raise InputError(
            file, f"pilot.column.{key}_rad_per_s", f"{problem}, of which a pilot gives at most 80°"
        )

    def target(self, times: Floats) -> Floats:
        """Return what is tracked over time, about what was flown at the start; rad or m/s."""
        after = np.maximum(times - self.start_s, 0.0)
        sines = np.zeros_like(after)
        for i, rate in enumerate(self.sine_rates_rad_per_s):
            phase = 2.4 * i * i  # so that the peaks do not meet; each begins at zero
            sines += np.sin(rate * after + phase) - np.sin(phase) * np.exp(-after)
        step = edges(times, [(self.start_s, 1.0)], self.rise_s)
        if self.what == "airspeed":
            return np.asarray(self.change_m_per_s * step + self.sine_m_per_s * sines)
        return np.asarray(self.change_rad * step + self.sine_rad * sines)

    def _look(
        self, rig: Rig, on_pitch: Compensation, around: Compensation | None, seed: int
    ) -> Look:
        """Return the pilot's eyes and hands, with a memory of their own."""
        frame_s = 1.0 / rig.frame_rate
        inner, late = Acting(on_pitch, frame_s), Delay(self.delay_s, frame_s)
        outer = Acting(around, frame_s) if around is not None else None
        remnant = Remnant(self.remnant, self.lag_s, frame_s, seed)
        found: tuple[float, float] | None = None
        before = math.nan

        def look(time: float, motion: tuple[float, ...]) -> float:
            nonlocal found, before
            path = 0.0 if math.isnan(before) else path_angle(motion, before, frame_s)
            before = motion[ALTITUDE]
            if time < self.start_s:
                return 0.0
            seen = {"pitch": motion[PITCH], "flight_path": path, "airspeed": motion[SPEED]}
            found = (motion[PITCH], seen[self.what]) if found is None else found
            pitch, flown = motion[PITCH] - found[0], seen[self.what] - found[1]
            asked = float(self.target(np.array([time]))[0])
            error = (asked if outer is None else outer(asked - flown)) - pitch
            return inner(late(error + remnant(error)))

        return look
