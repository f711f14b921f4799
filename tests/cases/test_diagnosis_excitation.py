"""A control that is hardly moved, a surface whose slope changes, and what few stretches show."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import coupled as api
from coupled.errors import InputError
from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.gap.findings.budget import ChannelShrink, Shrink
from coupled.gap.findings.summary import closes
from coupled.record.channels import ELEVATOR, ControlName, channel
from coupled.resources import aircraft_folder
from coupled.rig.rig import Rig

SWEEP_s = 12.0


def flown(rig: Rig, force_N: dict[ControlName, float]) -> api.Record:
    sweeps = {
        control: api.FrequencySweep(force_N=force, duration_s=SWEEP_s)
        for control, force in force_N.items()
    }
    return api.fly(api.Manoeuvre(rig, sweeps, duration_s=SWEEP_s + 2.0)).record


@pytest.mark.parametrize(
    ("name", "control", "force_N"),
    [("c172p", "wheel", 6.0), ("report-column", "column", 35.0)],
)
def test_a_surface_whose_slope_changes_at_neutral_has_no_gap(
    name: str, control: ControlName, force_N: float
) -> None:
    """At 60 Hz as at the rig's own rate: travels up and down differ, and so do the slopes."""
    rig = api.load_rig(name).changed({"frame_rate_Hz": 60.0})
    found = api.diagnose(rig, flown(rig, {control: force_N}), control)
    assert found.verdict == "no_gap", found.summary
    gap = found.stage("surface").gap
    assert gap is not None
    assert gap < 0.1


@pytest.mark.parametrize("name", ["c172p", "t37", "737"])
def test_a_surface_map_gives_the_position_between_its_commands(name: str) -> None:
    rig = api.load_rig(name)
    controls = list(rig.controls)

    def model() -> JSBSimAirframe:
        assert rig.flight is not None
        return make_aircraft(rig.flight, 1.0 / rig.frame_rate, controls, [aircraft_folder()])

    commands, positions = model().surface_map("elevator_rad")
    assert all(a < b for a, b in pairwise(commands))
    airframe, between = model(), np.linspace(-1.1, 1.1, 331)
    reached = []
    for command in between.tolist():
        airframe.step((command, 0.0, 0.0))
        reached.append(airframe.motion()[ELEVATOR])
    assert np.interp(between, commands, positions) == pytest.approx(reached, abs=1e-8)


@pytest.mark.parametrize(
    ("force_N", "said"),
    [
        ({"wheel": 20.0}, "no force moves the column, or a sensor is stuck"),
        ({"column": 30.0}, r"30 N do not move the column \(breakout and friction hold 60 N in the"),
        (
            {"column": 77.0},
            r"77 N do not move the column \(.*or a sensor is stuck; record a larger",
        ),
    ],
)
def test_a_control_that_no_force_moves_has_no_stuck_sensor(
    force_N: dict[ControlName, float], said: str
) -> None:
    rig = api.load_rig("737")
    with pytest.raises(InputError, match=f"never changes: {said}"):
        api.diagnose(rig, flown(rig, force_N), "column")


def test_a_sensor_that_is_stuck_while_a_force_moves_the_control_is_named() -> None:
    rig = api.load_rig("t37")
    record = flown(rig, {"column": 40.0})
    data, at = record.data.copy(), record.channels.index(channel("column", "deflection"))
    data[:, at] = data[0, at]
    with pytest.raises(InputError, match="never changes: a sensor that is stuck"):
        api.diagnose(rig, api.Record(record.channels, data))


@pytest.mark.parametrize(
    ("low", "reliable", "said"),
    [
        (None, False, "(too few stretches for an interval)"),
        (0.98, False, "(98 to 100 %; too few stretches to be reliable)"),
        (-0.4, True, "(-40 to 100 %)"),
        (-0.001, True, "(0 to 100 %)"),
    ],
)
def test_stretches_without_a_gap_give_no_interval(
    low: float | None, reliable: bool, said: str
) -> None:
    high = None if low is None else 1.0
    one = ChannelShrink("x", 1.0, 0.0, 0.0, 3, closed=1.0, low=low, high=high, reliable=reliable)
    assert closes(Shrink(one, (one,))) == f"On held-out data 100 % of the gap is closed {said}."


@pytest.mark.parametrize("lacks", ["computed", "estimate"])
def test_an_airframe_whose_command_is_unknown_is_not_judged(lacks: str) -> None:
    """The 737's yaw damper moves the rudder too, so that its position does not give the command."""
    rig = api.load_rig("737")
    record = flown(rig, {"pedals": 150.0})
    dropped = {channel("pedals", quantity) for quantity in ("estimate", lacks)}
    kept = [i for i, name in enumerate(record.channels) if name not in dropped]
    record = api.Record(tuple(record.channels[i] for i in kept), record.data[:, kept])
    found = api.diagnose(rig, record, "pedals")
    assert (found.verdict, found.guilty) == ("no_gap", ()), found.summary
    assert found.stage("airframe").missing == ("pedals_estimate_m",)
