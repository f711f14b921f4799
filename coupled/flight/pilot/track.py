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
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from coupled.errors import InputError
from coupled.flight.airframe import ALTITUDE, SPEED
from coupled.flight.pilot.base import STRONGEST, Action, Floats, Pilot, edges
from coupled.flight.pilot.crossover import (
    Acting,
    Compensation,
    Delay,
    adapt,
    compensation_response,
    delay_response,
)
from coupled.flight.pilot.remnant import Remnant
from coupled.flight.response import PITCH, Response, elevator_response, path_angle
from coupled.rig.equations import specified_gradient
from coupled.rig.packing import COMMAND_SIGN, Hand
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.schema import named, quantity

What = Literal["pitch", "flight_path", "airspeed"]


class Track(Pilot):
    """Tracks a target: a change of what the aircraft flew at `start_s`, and a sum of sines."""

    kind: Literal["track"]
    what: What = "pitch"
    crossover: float = quantity("rad_per_s", gt=0.01, le=10)
    phase_margin: float = quantity("rad", 0.7, gt=0, le=1.5)
    integral: float = quantity("rad_per_s", 0.0, ge=0, le=10)
    pitch_crossover: float = quantity("rad_per_s", 1.5, gt=0.01, le=10)
    pitch_phase_margin: float = quantity("rad", 0.7, gt=0, le=1.5)
    change: float = quantity("rad", 0.0, ge=-1.5, le=1.5)
    change_of_speed: float = named("change_m_per_s", 0.0, ge=-200, le=200)
    rise: float = quantity("s", 1.0, ge=0, le=7200)
    sine: float = quantity("rad", 0.0, ge=0, le=0.5)
    sine_of_speed: float = named("sine_m_per_s", 0.0, ge=0, le=50)
    sine_rates: list[float] = quantity("rad_per_s", [])
    delay: float = quantity("s", 0.2, ge=0, le=2)
    lag: float = quantity("s", 0.1, ge=0, le=2)
    arm_stiffness: float = quantity("N_per_{d}", 500.0, ge=0, le=1e5)
    arm_damping: float = quantity("N_s_per_{d}", 10.0, ge=0, le=1e4)
    force_limit: float = quantity("N", 333.6, gt=0, le=STRONGEST)
    lasting_force: float = quantity("N", 44.5, gt=0, le=STRONGEST)
    endurance: float = quantity("s", 60.0, gt=0, le=7200)
    remnant: float = quantity("", 0.0, ge=0, le=1)

    def meet(self, rig: Rig, rig_file: Path, run_file: Path, seed: int) -> Pilot:
        """Return this pilot, practised on the rig as it is specified."""
        assert rig.flight is not None
        frame_s, controls = 1.0 / rig.frame_rate, tuple(rig.controls)

        def element(rate: float) -> Response:
            """Return what the aircraft does per newton of the pilot's command."""
            assert rig.flight is not None
            answer = elevator_response(rig.flight, frame_s, controls, rig_file, rate)
            limbs = self._limbs(rig, answer.pressure_Pa, rate)
            limbs *= delay_response(self.delay, frame_s, rate)
            pitch, path, speed, load = (limbs * motion for motion in answer[:4])
            return Response(pitch, path, speed, load, answer.pressure_Pa)

        at_inner = element(self.crossover if self.what == "pitch" else self.pitch_crossover)
        if self.what == "pitch":
            asked = ("crossover", self.crossover, self.phase_margin, self.integral)
            inner = self._adapted(at_inner.pitch, asked, frame_s, run_file)
            return Practised(**dict(self), inner=inner, frame=frame_s, seed=seed)
        asked = ("pitch_crossover", self.pitch_crossover, self.pitch_phase_margin, 0.0)
        inner = self._adapted(at_inner.pitch, asked, frame_s, run_file)
        answer, by_pilot = (
            element(self.crossover),
            compensation_response(inner, frame_s, self.crossover),
        )
        # A higher nose makes the path steeper, and the airspeed less.
        motion = answer.flight_path if self.what == "flight_path" else -answer.airspeed
        asked = ("crossover", self.crossover, self.phase_margin, self.integral)
        closed = by_pilot * motion / (1.0 + by_pilot * answer.pitch)
        outer = self._adapted(closed, asked, frame_s, run_file)
        if self.what == "airspeed":
            outer = replace(outer, gain=-outer.gain)
        return Practised(**dict(self), inner=inner, outer=outer, frame=frame_s, seed=seed)

    def _limbs(self, rig: Rig, pressure_Pa: float, rate: float) -> complex:
        """Return the elevator command per newton of the pilot's, on the rig as specified."""
        control, s, frame_s = rig.controls["column"], 1j * rate, 1.0 / rig.frame_rate
        loader, rigging = control.loader, control.rigging
        servo = 2.0 * math.pi * loader.servo_frequency
        follows = servo**2 / (s**2 + 2.0 * loader.servo_damping_ratio * servo * s + servo**2)
        gradient = specified_gradient(control.schedule, pressure_Pa)
        feel = loader.mass * s**2 + loader.damping * s + gradient
        arm = (self.arm_stiffness + self.arm_damping * s) * follows
        late = np.exp(-s * (0.5 * frame_s + loader.delay))  # the command is held over a frame
        # The host takes δc, ahead of the servo, which only the arm feels.
        drive: complex = COMMAND_SIGN[control.surface] / control.travel
        drive /= (1.0 + rigging.stretch_loss * pressure_Pa) * (1.0 + rigging.lag * s)
        return complex(drive * late / ((1.0 + self.lag * s) * (feel + arm)))

    def _adapted(
        self, element: complex, asked: tuple[str, float, float, float], frame_s: float, file: Path
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
        after = np.maximum(times - self.start, 0.0)
        sines = np.zeros_like(after)
        for i, rate in enumerate(self.sine_rates):
            phase = 2.4 * i * i  # so that the peaks do not meet; each begins at zero
            sines += np.sin(rate * after + phase) - np.sin(phase) * np.exp(-after)
        step = edges(times, [(self.start, 1.0)], self.rise)
        if self.what == "airspeed":
            return np.asarray(self.change_of_speed * step + self.sine_of_speed * sines)
        return np.asarray(self.change * step + self.sine * sines)


class Practised(Track):
    """A tracking pilot whose compensation has been found, for one rig."""

    inner: Compensation
    outer: Compensation | None = None
    frame: float
    seed: int

    def act(self, control: Control, gradient: float, name: str, folder: Path) -> Action:
        """Return the arm and its command, with a memory of its own."""
        hand = Hand(
            self.arm_stiffness,
            self.arm_damping,
            lag_s=self.lag,
            strongest=self.force_limit,
            lasting=min(self.lasting_force, 0.999 * self.force_limit),
            endurance_s=self.endurance,
        )
        return Action(hand=hand, look=self._look())

    def _look(self) -> Callable[[float, tuple[float, ...]], float]:
        inner, late = Acting(self.inner, self.frame), Delay(self.delay, self.frame)
        outer = Acting(self.outer, self.frame) if self.outer is not None else None
        remnant = Remnant(self.remnant, self.lag, self.frame, self.seed)
        found: tuple[float, float] | None = None
        before = math.nan

        def look(time: float, motion: tuple[float, ...]) -> float:
            nonlocal found, before
            path = 0.0 if math.isnan(before) else path_angle(motion, before, self.frame)
            before = motion[ALTITUDE]
            if time < self.start:
                return 0.0
            seen = {"pitch": motion[PITCH], "flight_path": path, "airspeed": motion[SPEED]}
            found = (motion[PITCH], seen[self.what]) if found is None else found
            pitch, flown = motion[PITCH] - found[0], seen[self.what] - found[1]
            asked = float(self.target(np.array([time]))[0])
            error = (asked if outer is None else outer(asked - flown)) - pitch
            return inner(late(error + remnant(error)))

        return look
