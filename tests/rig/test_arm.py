"""The arm's mass at the grip: what accelerates it the grip does not get."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre, PressureProfile, configure
from coupled.flight.pilot import Action, Step
from coupled.flight.pilot.base import Start
from coupled.record.channels import ControlName
from coupled.record.record import Record
from coupled.rig.growth import growth
from coupled.rig.packing import Hand
from coupled.rig.rig import Rig
from tests.support.rigs import bench

_ARM_kg = 2.0


class HeavyStep(Step):
    """A step of force by an arm that has a mass."""

    damping: ClassVar[float] = 0.0

    def act(self, rig: Rig, control: ControlName, start: Start) -> Action:
        action = super().act(rig, control, start)
        return replace(action, hand=replace(action.hand, mass=_ARM_kg, damping=self.damping))


class DampedStep(HeavyStep):
    """The same with damping in the arm: the structure is undamped."""

    damping: ClassVar[float] = 120.0


def flown(changes: dict[str, Any], kind: type[Step], configuration: Any = "rigid") -> Record:
    rig = configure(bench(changes).changed({"frame_rate_Hz": 1000.0}), configuration)
    pilot = kind(force_N=40.0, rise_s=0.05)
    profile = PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[0.0])
    return fly(Manoeuvre(rig, {"column": pilot}, 4.0, bench=profile))


def test_behind_a_quick_servo_an_arm_is_mass_of_the_loader() -> None:
    """m·δ'' of the loader and m_h·δ'' of the arm add: as heavy a loader moves alike."""
    quick = {"servo_frequency_Hz": 400.0, "servo_damping_ratio": 0.7}
    arm = flown({**quick, "mass_kg": 4.0}, HeavyStep)["column_deflection_m"]
    heavy = flown({**quick, "mass_kg": 4.0 + _ARM_kg}, Step)["column_deflection_m"]
    light = flown({**quick, "mass_kg": 4.0}, Step)["column_deflection_m"]
    assert np.abs(arm - heavy).max() < 0.01 * np.abs(heavy).max()
    assert np.abs(light - heavy).max() > 0.05 * np.abs(heavy).max()


@pytest.mark.parametrize("configuration", ["rigid", "uncompensated"])
def test_the_grip_gets_the_hands_force_less_what_moves_the_arm(configuration: Any) -> None:
    record = flown({}, DampedStep, configuration)
    t, deflection = record.time_s, record["column_deflection_m"]
    rate = np.gradient(deflection, t)
    acceleration = np.gradient(rate, t)
    script = Step(force_N=40.0, rise_s=0.05).act(bench(), "column", Start(0.0)).force
    assert script is not None
    moves = _ARM_kg * acceleration + DampedStep.damping * rate
    assert record["column_force_N"] == pytest.approx(script(t) - moves, abs=0.6)
    assert _ARM_kg * np.abs(acceleration).max() > 3.0


def test_an_arm_at_the_end_of_a_structure_swings_at_its_own_frequency() -> None:
    """√(1/(K·m_h)) = 74 rad/s, on a loader that is held: the bend is the arm's spring."""
    record = flown({"mass_kg": 4000.0}, HeavyStep, "uncompensated")
    bend = record["column_deflection_m"] - record["column_computed_m"]
    late = record.time_s > 1.1
    about = bend[late] - bend[late].mean()
    crossings = np.flatnonzero((about[:-1] < 0.0) & (about[1:] >= 0.0))[:6]
    period = np.diff(record.time_s[late][crossings]).mean()
    structure = bench().controls["column"].loader.bend
    assert 2.0 * np.pi / period == pytest.approx((structure * _ARM_kg) ** -0.5, rel=0.02)


@pytest.mark.parametrize(("damping", "stable"), [(20.0, False), (120.0, True)])
def test_the_reports_structure_needs_a_damped_arm(damping: float, stable: bool) -> None:
    """The roots of D·(1 + K·Z) + Z·S with Z = m_h·s² + c_h·s, S the servo, D the loader.

    Without damping of the structure a heavy arm oscillates against the servo's lag.
    """
    loader = bench().controls["column"].loader
    arm = np.poly1d([_ARM_kg, damping, 0.0])
    feel = np.poly1d([loader.mass, loader.damping, loader.basic_gradient])
    servo = 2.0 * np.pi * loader.servo_frequency
    lag = np.poly1d([1.0, 2.0 * loader.servo_damping_ratio * servo, servo**2])
    roots = (feel * (1.0 + loader.bend * arm) * lag + arm * servo**2).roots
    assert (float(roots.real.max()) < 0.0) == stable
    rig = configure(bench({"controls.column.travel_m": 1e3}), "uncompensated").only("column")
    assert (growth(rig, Hand(mass=_ARM_kg, damping=damping), 4.0) < 0.0) == stable
