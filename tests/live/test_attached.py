"""A loader with faulty measurements: the orders, the record and the warnings."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest

from coupled.api.rigs import load_rig
from coupled.flight.manoeuvre import Manoeuvre
from coupled.live.hands import LiveHand
from coupled.live.host import Plan
from coupled.live.link import Measured, Order, Sample
from coupled.live.session import LiveFlight, fly_live
from coupled.record.channels import FADED, FRESH, LOADER_TIME, REPEATED, VALIDITY

RIG = load_rig("report-column")
COLUMN = RIG.controls["column"]
COMES_s = -0.5  # of the flight, when the loader's time is 0: its forces come in before
Fault = Callable[[float, Measured], Measured | None]


class Spring:
    """A loader without mass under a hand, with a fault in what it measures; a frame a question."""

    name, measures_force, measures_deflection, round_trips = "spring", True, True, None

    def __init__(self, fault: Fault) -> None:
        self.dropped: Counter[str] = Counter()
        self.orders: list[tuple[float, Order]] = []  # and at which of the loader's times
        self._fault, self._time_s, self._gradient = fault, 0.0, 0.0

    def receive(self, wait_s: float) -> Sample | None:
        """Return what is measured a frame later; None where the fault is that nothing comes."""
        del wait_s
        self._time_s += 1.0 / RIG.frame_rate
        time_s = self._time_s
        force = 40.0 * math.sin(2.0 * math.pi * 0.4 * time_s) + 1e-6 * math.sin(1e4 * time_s)
        computed = force / (COLUMN.loader.basic_gradient + self._gradient)
        true = Measured(force, computed, computed + COLUMN.loader.bend * force)
        seen = self._fault(time_s, true)
        return None if seen is None else Sample((seen,), self._time_s)

    def own_load(self, i: int, computed: float) -> float:
        """Return 0."""
        return 0.0

    def ordered_gradient(self, i: int) -> float:
        """Return 0."""
        return 0.0

    def send(self, orders: tuple[Order, ...], mode: int) -> None:
        """Take the orders."""
        self.orders.append((self._time_s, orders[0]))
        self._gradient = orders[0].gradient

    def close(self) -> None:
        """Do nothing."""


def flown(fault: Fault, seconds: float = 10.0) -> tuple[LiveFlight, list[str], Spring]:
    """Return a flight with a loader that has a fault, the warnings, and the loader."""
    said: list[str] = []
    link = Spring(fault)
    manoeuvre = Manoeuvre(RIG, {"column": LiveHand()}, seconds)
    return fly_live(manoeuvre, Plan(paced=False, link=link, warn=said.append)), said, link


def stuck(time_s: float, now: Measured) -> Measured:
    """Lose the gauge from 3 s to 6 s."""
    return now._replace(force=0.0) if 3.0 < time_s < 6.0 else now


def wrong(time_s: float, now: Measured) -> Measured:
    """Let the transducer at the grip slip by 50 mm from 3 s to 6 s."""
    return now._replace(deflection=now.deflection + 0.05) if 3.0 < time_s < 6.0 else now


@pytest.mark.slow
@pytest.mark.parametrize(("fault", "after_s", "why"), [(stuck, 2.1, "gauge"), (wrong, 0.3, "δ")])
def test_forces_fade_while_a_measurement_cannot_be_true(
    fault: Fault, after_s: float, why: str
) -> None:
    flight, said, link = flown(fault)
    live, validity = flight.record.manifest["live"], flight.record[VALIDITY]
    (spell,) = live["implausible"]
    assert spell["control"] == "column"
    assert why in spell["why"]
    assert spell["from_s"] < COMES_s + 3.0 + after_s
    assert COMES_s + 7.0 - 0.1 < spell["to_s"] < COMES_s + 7.0 + 0.1  # after a second without
    assert len(said) == 2
    time = flight.record.time_s
    gone = (time > spell["from_s"] + 0.6) & (time < spell["to_s"])
    assert set(validity[gone]) == {FADED}
    assert set(validity[time > spell["to_s"] + 0.6]) == {FRESH}
    ordered = {o.gradient for at, o in link.orders if 5.8 < at < 6.9}
    assert ordered == {0.0}


@pytest.mark.slow
def test_a_missing_sample_is_marked_and_does_not_change_the_estimate() -> None:
    def lose(time_s: float, now: Measured) -> Measured | None:
        return None if time_s > 1.0 and round(time_s * RIG.frame_rate) % 50 == 0 else now

    flight, said, _ = flown(lose)
    record = flight.record
    repeated = record[VALIDITY] == REPEATED
    assert 15 <= repeated.sum() <= 25
    rows = np.flatnonzero(repeated)
    for quantity in ("force_N", "computed_m", "deflection_m"):
        signal = record[f"column_{quantity}"]
        assert np.array_equal(signal[rows], signal[rows - 1])
    assert record.manifest["live"]["stale_frames"] == len(rows)
    assert said == []
    assert LOADER_TIME not in record  # in lock-step it means nothing
    found = record.manifest["live"]["bend_in_service"]["column"]
    assert found["bend"] == pytest.approx(COLUMN.loader.bend, rel=0.02)


@pytest.mark.slow
def test_a_silent_transducer_does_not_change_the_estimate() -> None:
    def silent(time_s: float, now: Measured) -> Measured:
        return now._replace(deflection=math.nan) if time_s > 4.0 else now

    record = flown(silent)[0].record
    assert set(record.between(6.0, 9.0)[VALIDITY]) == {REPEATED}
    assert np.ptp(record.between(6.0, 9.0)["column_deflection_m"]) == 0.0
    found = record.manifest["live"]["bend_in_service"]["column"]
    assert found["bend"] == pytest.approx(COLUMN.loader.bend, rel=0.02)


def test_what_was_never_measured_is_not_recorded() -> None:
    flight, said, _ = flown(lambda _, now: now._replace(deflection=math.nan), 2.0)
    assert "column_deflection_m" not in flight.record
    assert set(flight.record[VALIDITY]) == {FRESH}
    assert said == ["δ of the column is not measured: neither it nor K is recorded"]


def test_a_transducer_that_begins_in_flight_gives_no_estimate_of_k() -> None:
    """The host has printed that δ and K are not recorded."""
    late = flown(lambda t, now: now if t > 2.0 else now._replace(deflection=math.nan))[0].record
    assert "column_deflection_m" not in late
    assert late.manifest["live"]["bend_in_service"]["column"]["bend"] is None
