"""Live flights with a loader that is not this package's: it dies, loses answers, or softens.

Its physics and its end of the protocol are its own (`tests/data/cases/live-clients/loader.py`). The
flights are in lock-step, so that a busy machine loses no more samples than the loader is told to;
what real time adds, samples at uneven times, is in `tests/gap/test_live_record.py`.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from coupled.api.gaps import diagnose
from coupled.api.rigs import load_rig
from coupled.flight.manoeuvre import Manoeuvre
from coupled.live import attached
from coupled.live.hands import LiveHand
from coupled.live.host import Plan
from coupled.live.link import RUN, Order, WATCHDOG_s
from coupled.live.session import fly_live
from coupled.live.udp import UdpLink
from coupled.record.channels import FRESH, LOST, VALIDITY
from coupled.record.record import Record

LOADER = Path(__file__).parents[1] / "data" / "cases" / "live-clients" / "loader.py"
RIG = load_rig("report-column")
BEND = RIG.controls["column"].loader.bend


@contextmanager
def loader(*words: str) -> Iterator[int]:
    """Run the loader, and yield its port."""
    command = [sys.executable, str(LOADER), *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            yield int(process.stdout.readline())
        finally:
            process.kill()


def flown(seconds: float, *words: str, adapt: bool = False) -> Record:
    """Return the record of a flight with the loader."""
    with loader("--lockstep", *words) as port:
        link = UdpLink("127.0.0.1", port, RIG, lockstep=True)
        manoeuvre = Manoeuvre(RIG, {"column": LiveHand()}, seconds)
        return fly_live(manoeuvre, Plan(paced=False, link=link, adapt=adapt)).record


@pytest.mark.slow
@pytest.mark.parametrize(
    ("seconds", "words", "said"),
    [
        (60.0, ("--die", "12"), "in which the loader sent no new sample"),
        (30.0, ("--drop", "0.02"), "samples are missing"),
    ],
)
def test_a_healthy_loader_that_dies_or_loses_answers_has_no_gap(
    seconds: float, words: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(attached, "WATCHDOG_s", 0.03)  # of real time: an answer is waited for
    monkeypatch.setattr(attached, "GONE_s", 1.0)
    record = flown(seconds, *words)
    found = diagnose(RIG, record)
    assert found.verdict == "no_gap", found.summary
    judged = {stage.name for stage in found.stages if stage.gap is not None}
    assert {"loader", "linkage", "airframe"} <= judged
    assert any(said in line for line in found.left_out)
    assert {FRESH, LOST} <= set(record[VALIDITY]) or "--die" not in words


@pytest.mark.slow
def test_a_structure_that_softens_while_k_follows_is_a_bend_and_no_fault_of_the_host() -> None:
    record = flown(55.0, "--soften", "22", "1.4", adapt=True)
    assert record.manifest["live"]["adapted"]
    found = diagnose(RIG, record)
    assert {stage.name for stage in found.stages if stage.guilty} == {"linkage"}
    (effect,) = found.effects
    assert effect.value == pytest.approx(1.4 * BEND, rel=0.02)
    assert any("K̂ in use changed" in line for line in found.left_out)


def answered(link: UdpLink, count: int) -> int:
    """Return how many of so many orders were answered."""
    found = 0
    for _ in range(count):
        link.send((Order(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),), RUN)
        found += link.receive(0.5) is not None
    return found


def test_a_loader_that_was_restarted_answers_the_same_flight() -> None:
    with loader() as port:
        link = UdpLink("127.0.0.1", port, RIG)
        assert answered(link, 50) == 50
    time.sleep(1.5 * WATCHDOG_s)
    with loader("--port", str(port)):
        assert answered(link, 50) == 50
    assert link.dropped == {}
    link.close()
