"""The hand of a live flight: the axes of a stick, and the hand that follows it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from coupled.errors import InputError
from coupled.flight.conditions import Conditions
from coupled.flight.event import Event
from coupled.flight.loop import fly
from coupled.flight.pilot import Step
from coupled.live.attach import rig_live, run_live
from coupled.live.hands import PositionFilter
from coupled.live.host import Host, Plan, Request
from coupled.live.session import fly_live
from coupled.live.stick import Stick, axes_of
from tests.support.rigs import bench


class Device:
    """A stick of three axes."""

    def __init__(self) -> None:
        self.places = [0.25, -0.5, 0.01]

    def get_name(self) -> str:
        return "a device"

    def get_numaxes(self) -> int:
        return len(self.places)

    def get_axis(self, number: int, /) -> float:
        return self.places[number]


def test_axes_are_taken_by_number_and_turned_by_a_minus() -> None:
    stick = Stick("-1,0,2", device=Device())
    assert (stick.read("column"), stick.read("wheel"), stick.read("pedals")) == (0.5, 0.25, 0.0)
    assert Stick("1,0,7", device=Device()).read("pedals") == 0.0


@pytest.mark.parametrize("words", ["", "x", "1,,2", "--1", "99"])
def test_invalid_axes_are_refused(words: str) -> None:
    with pytest.raises(InputError, match="--axes"):
        axes_of(words)


def test_a_missing_stick_is_refused() -> None:
    pytest.importorskip("pygame")
    with pytest.raises(InputError, match="no stick"):
        Stick(number=60)


def test_a_follower_is_smooth_and_stays_within_the_stops_of_both_sides() -> None:
    """A stick's full throw is the travel of its side; beyond a stop the hand would push forever."""
    sides = {"travel_m": 0.1, "travel_push_m": 0.06, "loader.stop_forward_m": 0.04}
    rig = bench().changed({f"controls.column.{key}": value for key, value in sides.items()})
    follower = PositionFilter(rig.controls["column"], 1.0 / 120.0)
    way = [follower.move(5.0) for _ in range(120)]
    assert way[0] == pytest.approx(0.1 * -math.expm1(-1.0 / 120.0 / 0.04))
    assert max(way) == pytest.approx(0.1)
    assert follower.move(math.nan) == way[-1]
    for share, place in ((-0.5, -0.03), (-1.0, -0.04), (0.5, 0.05), (0.0, 0.0)):
        assert [follower.move(share) for _ in range(120)][-1] == pytest.approx(place)


class Wanted:
    """Wants the control at 20 % of its travel from the start."""

    name = "test"

    def read(self, control: str) -> float:
        return 0.2

    def close(self) -> None:
        """Nothing is open."""


class Looker:
    """A watcher that gives commands at given times."""

    def __init__(self, *words: tuple[float, Request]) -> None:
        self._words = list(words)

    def begin(self, host: Host) -> None:
        self._host = host

    def observe(self, host: Host, k: int) -> None:
        """Do nothing at a frame."""

    def requests(self) -> list[Request]:
        due = [word for time, word in self._words if time <= self._host.time_s]
        self._words = self._words[len(due) :]
        return due

    def close(self) -> None:
        """Nothing is open."""


@pytest.mark.slow
def test_the_hand_follows_the_stick_with_the_force_that_the_loader_needs() -> None:
    manoeuvre = rig_live("report-column", 4.0)
    record = fly_live(manoeuvre, Plan(paced=False, hand_positions=Wanted())).record
    held = record.between(3.0, 4.0)
    travel = manoeuvre.rig.controls["column"].travel
    assert held["column_deflection_m"] == pytest.approx(0.2 * travel, rel=0.01)
    wanted = held["column_gradient_N_per_m"] * held["column_deflection_m"]
    assert held["column_force_N"] == pytest.approx(wanted, rel=0.02)


def test_switches_marks_and_stop_act_at_their_frame() -> None:
    warned: list[str] = []
    words = [
        (2.0, Request("set", "deflection", "column", 0.0)),
        (2.5, Request("mark", "here")),
        (3.0, Request("set", "friction", "column", 1e6)),
        (3.0, Request("set", "nonsense", "column", 1.0)),
        (3.5, Request("stop")),
    ]
    plan = Plan(paced=False, hand_positions=Wanted(), watchers=[Looker(*words)], warn=warned.append)
    flight = fly_live(rig_live("report-column", None), plan)
    record, live = flight.record, flight.record.manifest["live"]
    assert flight.stopped
    assert record.ended_early is None
    assert len(record) == 420
    gap = record["column_estimate_m"] - record["column_computed_m"]
    assert np.all(gap[240:] == 0.0)
    assert np.all(gap[60:240] > 0.0)
    assert live["marks"] == [[2.5, "here"]] or live["marks"] == [(2.5, "here")]
    assert len(live["switched"]) == 1
    assert (flight.since_s, flight.rig.controls["column"].compensation.deflection) == (2.0, False)
    assert len(warned) == 2


@pytest.mark.slow
def test_a_service_set_live_is_recorded_as_the_event_of_a_run() -> None:
    """The record has the bytes of a batch flight, although the rig file gives no services."""
    led = [("trim_m", 0.5, 0.02), ("feel_lost", 1.0, 0.4), ("jammed", 1.5, 1.0)]
    plain = rig_live("report-column", 2.0)
    plain = replace(plain, pilots={"column": Step(force_N=30.0, start_s=0.2)})
    events = {name: Event(service=name, control="column", at=at, to=to) for name, at, to in led}
    batch = fly(replace(plain, conditions=Conditions(event=events)))
    words = [(at, Request("service", name, "column", to)) for name, at, to in led]
    live = fly_live(plain, Plan(paced=False, watchers=[Looker(*words)])).record
    assert live.channels == batch.channels
    assert np.array_equal(live.data, batch.data)
    assert live["column_jammed"][-1] == 1.0
    asked = live["column_asked_m"][:180]  # before the jam: what the host asks for, from the start
    assert np.array_equal(asked, live["column_estimate_m"][:180])
    quiet = fly_live(plain, Plan(paced=False, watchers=[Looker()])).record
    assert quiet.channels == fly(plain).channels
    assert np.array_equal(quiet.data, fly(plain).data)


@pytest.mark.slow
def test_a_bench_is_flown_live_too() -> None:
    record = fly_live(rig_live("bench", 1.0), Plan(paced=False, hand_positions=Wanted())).record
    assert len(record) > 50
    assert record["column_deflection_m"][-1] > 0.0


def test_an_impossible_duration_is_refused() -> None:
    for bad in (0.0, -1.0, 8000.0):
        with pytest.raises(InputError, match="--duration"):
            run_live("capture", "", bad, "pilot")
    with pytest.raises(InputError, match="--hand"):
        run_live("capture", "", None, "foot")
    with pytest.raises(InputError, match="--case"):
        run_live("capture", "no such", None, "pilot")


@pytest.mark.slow
def test_a_trim_released_live_keeps_its_spring_and_damper_as_in_a_run() -> None:
    kept = {"trim_release_gradient_N_per_m": 200.0, "trim_release_damping_N_s_per_m": 60.0}
    plain = rig_live("report-column", 3.0)
    rig = plain.rig.changed({f"controls.column.services.{key}": to for key, to in kept.items()})
    plain = replace(plain, rig=rig, pilots={"column": Step(force_N=30.0, start_s=0.2)})
    released = Event(service="trim_release", control="column", at=1.0, to=1.0)
    batch = fly(replace(plain, conditions=Conditions(event={"release": released})))
    word = Request("service", "trim_release", "column", 1.0)
    live = fly_live(plain, Plan(paced=False, watchers=[Looker((1.0, word))])).record
    assert np.array_equal(live.data, batch.data)
    assert live["column_service_force_N"][-1] < -10.0
