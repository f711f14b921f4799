"""What of a live record is judged: validity of rows, the loader's clock, and switches."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.api.gaps import diagnose
from coupled.api.rigs import load_rig
from coupled.errors import InputError
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot import FrequencySweep
from coupled.gap.signals.live import Live, judged_part, live_of
from coupled.live.host import Host, Plan, Request
from coupled.live.session import LiveFlight, fly_live
from coupled.record.channels import FADED, LOST, REPEATED, SWITCHED, VALIDITY
from coupled.record.record import Record

Floats = NDArray[np.float64]
RATE_Hz, ROWS = 120.0, 2400
FORCE = "column_force_N"
TABLES = {
    "compensation": {"bend_m_per_N": 9e-5, "deflection": True, "gradient": True},
    "loader": {"bend_m_per_N": 9e-5, "friction_N": 0.0, "breakout_N": 0.0},
}


def signal(time_s: Floats) -> Floats:
    return np.asarray(np.sin(2.0 * np.pi * 1.3 * time_s))


def made(
    taken_s: Floats | None = None,
    validity: Floats | None = None,
    live: dict[str, Any] | None = None,
) -> Record:
    """Return a record of a signal whose samples were taken at times of the loader's clock."""
    time = np.arange(ROWS) / RATE_Hz
    taken = time if taken_s is None else taken_s
    marks = np.zeros(ROWS) if validity is None else validity
    repeated = (marks == REPEATED) | (marks == LOST)
    at = np.maximum.accumulate(np.where(repeated, 0, np.arange(ROWS)))
    data = np.column_stack((time, signal(taken)[at], marks, taken[at]))
    manifest = {"live": live or {}, "rig": {"controls": {"column": TABLES}}}
    return Record(("time_s", FORCE, VALIDITY, "loader_time_s"), data, manifest)


def judged_of(record: Record) -> Live:
    live = live_of(record)
    assert live is not None
    return live


def test_samples_are_brought_to_equal_steps_of_the_loader_s_clock() -> None:
    random = np.random.default_rng(2)
    time = np.arange(ROWS) / RATE_Hz
    late = 0.004 * random.random(ROWS)
    taken = 17.0 + (time + late) * (1.0 + 80e-6)  # its clock has another origin and rate
    lost = np.where(random.random(ROWS) < 0.02, REPEATED, 0.0)
    lost[0] = 0.0
    record = made(taken, lost)
    live = judged_of(record)
    usual = 17.0 + (time + 0.002) * (1.0 + 80e-6)
    wrong = np.abs(live.signals[FORCE] - signal(usual))
    assert np.abs(record[FORCE] - signal(usual)).max() > 0.05
    assert np.sqrt(np.mean(wrong**2)) < 5e-4
    assert live.judged.all()
    assert "samples are missing" in live.left_out[0]


def test_a_record_as_it_should_be_is_taken_as_it_is() -> None:
    record = made()
    live = judged_of(record)
    assert np.array_equal(live.signals[FORCE], record[FORCE])
    assert live.judged.all()
    assert live.left_out == ()
    assert judged_part(record, "r.csv") is record
    batch = Record(record.channels[:2], record.data[:, :2])
    assert live_of(batch) is None


def test_a_deadline_that_the_host_missed_begins_a_new_stretch() -> None:
    time = np.arange(ROWS) / RATE_Hz
    taken = np.where(np.arange(ROWS) < 1000, time, time + 3.0 / RATE_Hz)
    live = judged_of(made(taken))
    out = np.flatnonzero(~live.judged)
    assert out[0] in (999, 1000, 1001)
    assert len(out) == pytest.approx(0.25 * RATE_Hz, abs=2)
    assert np.flatnonzero(live.starts) == pytest.approx(1006, abs=1)


def test_rows_without_an_answer_or_with_faded_forces_are_left_out() -> None:
    marks = np.zeros(ROWS)
    marks[600:660], marks[660:700], marks[1200:1203], marks[1500:1504] = (
        LOST,
        FADED,
        REPEATED,
        REPEATED,
    )
    live = judged_of(made(validity=marks))
    assert not live.judged[600:729].any()
    assert live.judged[731:1500].all()  # three frames are bridged, four are not
    assert not live.judged[1500:1533].any()
    assert live.judged[1535:].all()
    assert live.starts.sum() == 2


def test_a_record_ends_where_its_loader_did() -> None:
    marks = np.zeros(ROWS)
    marks[720:] = LOST
    record = made(validity=marks)
    part = judged_part(record, "r.csv")
    assert len(part) == 720
    assert "in which the loader sent no new sample" in judged_of(record).left_out[0]
    marks[500:] = LOST
    marks[100:110] = FADED
    with pytest.raises(
        InputError, match=r"r\.csv: validity: .* at 4\.2 s; .* Left out: 16 s"
    ) as said:
        judged_part(made(validity=marks), "r.csv")
    assert ".." not in str(said.value)


def test_spells_of_an_older_record_are_known_by_its_manifest() -> None:
    record = made(live={"spells": [[6.0, None]]})
    older = Record(record.channels[:2], record.data[:, :2], record.manifest)
    assert len(judged_part(older, "r.csv")) == 720


@pytest.mark.parametrize("factor", [0.0, 1e-3, 1000.0])
def test_a_clock_in_another_unit_is_not_used_and_that_is_said(factor: float) -> None:
    record = made(np.asarray(factor * np.arange(ROWS) / RATE_Hz, dtype=np.float64))
    live = judged_of(record)
    assert np.array_equal(live.signals[FORCE], record[FORCE])
    assert "clock" in live.left_out[0]


def switched(at: float, what: str, value: float) -> dict[str, Any]:
    return {"time_s": at, "control": "column", "what": what, "value": value}


def test_k_is_that_of_each_moment() -> None:
    marks = np.where(np.arange(ROWS) < 600, 0.0, SWITCHED)
    changes = {
        "switched": [switched(5.0, "deflection", 0.0), switched(10.0, "deflection", 1.0)],
        "adapted": [[15.0, "column", 12e-5]],
    }
    live = judged_of(made(validity=marks, live=changes))
    used = live.assumed["column"]
    at = {name: getattr(used, name)[[599, 600, 1199, 1200, 1800, 1801]] for name in vars(used)}
    assert at["estimate"] == pytest.approx([0.0, -9e-5, -9e-5, 0.0, 0.0, 3e-5])
    assert at["gradient"] == pytest.approx([0.0, 0.0, 0.0, 0.0, 0.0, 3e-5])
    assert live.judged.all()
    later = judged_of(made(validity=marks, live=changes).rows(700, ROWS))  # its first K̂ is 0
    assert later.assumed["column"].estimate[[0, 499, 500]] == pytest.approx([0.0, 0.0, 9e-5])


def test_other_hardware_is_not_judged_and_neither_is_what_nothing_is_known_of() -> None:
    marks = np.where(np.arange(ROWS) < 600, 0.0, SWITCHED)
    hardware = {"switched": [switched(5.0, "friction", 8.0)]}
    live = judged_of(made(validity=marks, live=hardware))
    assert live.judged[:600].all()
    assert not live.judged[600:].any()
    assert "as switched in flight" in live.left_out[0]
    after = made(validity=marks, live=hardware).rows(600, ROWS)
    assert judged_of(after).judged.all()  # of one kind
    assert not judged_of(made(validity=marks)).judged[600:].any()


@pytest.mark.parametrize(
    "live", [{"switched": [3]}, {"adapted": [["x", "column"]]}, {"switched": [{"time_s": "x"}]}]
)
def test_a_damaged_manifest_is_said(live: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="is not as coupled live writes it"):
        live_of(made(live=live))


class Switcher:
    """A watcher that switches as it is told to: when, s, and what."""

    def __init__(self, *words: tuple[float, Request]) -> None:
        self._words, self._time_s = list(words), 0.0

    def begin(self, host: Host) -> None:
        """Begin."""
        self._host = host

    def observe(self, host: Host, k: int) -> None:
        """Do nothing."""

    def requests(self) -> list[Request]:
        """Return what is due."""
        due = [word for at, word in self._words if at <= self._host.time_s]
        self._words = [(at, word) for at, word in self._words if at > self._host.time_s]
        return due

    def close(self) -> None:
        """End."""


def swept(*words: tuple[float, Request]) -> LiveFlight:
    rig = load_rig("report-column")
    noise = {FORCE: 0.15, "column_computed_m": 2e-5, "column_deflection_m": 2e-5}
    pilot = FrequencySweep(force_N=40, start_s=0.5, low_Hz=0.2, high_Hz=2.0, duration_s=14.0)
    manoeuvre = Manoeuvre(rig.changed({"noise": noise}), {"column": pilot}, 15.0)
    return fly_live(manoeuvre, Plan(paced=False, watchers=[Switcher(*words)]))


@pytest.mark.slow
def test_a_host_that_was_switched_in_flight_has_no_gap() -> None:
    flight = swept(
        (4.0, Request("set", "deflection", "column", 0.0)),
        (6.0, Request("set", "assumed_bend", "column", 5e-5)),
        (8.0, Request("set", "deflection", "column", 1.0)),
        (11.0, Request("set", "gradient", "column", 0.0)),
    )
    found = diagnose(load_rig("report-column"), flight.record)
    gaps = {stage.name: stage.gap for stage in found.stages}
    assert found.verdict == "no_gap", gaps
    assert (gaps["compensation"] or 0.0) < 0.1
    assert "K̂ in use changed" in found.summary
    assert found.as_dict()["left_out"]
