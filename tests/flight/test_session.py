"""Stepped flights: the bytes of `fly`, acts between frames, resets, and functions as pilots."""

from __future__ import annotations

import copy
import gc
import mmap
import pickle
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coupled
from coupled.flight import loop
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import EVERY_CONFIGURATION
from coupled.flight.runfile import read_run
from coupled.rig.placed import HalfFrames

RIG = coupled.load_rig("t37")
COLUMN = coupled.load_rig("report-column")
KIND: Any = coupled.Step
LENGTH: dict[str, Any] = {"duration_s": 3.0}


def wandering(seed: int, frames: int) -> list[float]:
    """Return a force for each frame, N, from a seed."""
    rng = np.random.default_rng(seed)
    return [40.0 * float(rng.standard_normal()) for _ in range(frames)]


def held(forces: list[float], rig: coupled.Rig) -> coupled.ForceTable:
    """Return the table of forces that are each held over a frame, on the loader's nodes."""
    nodes = np.arange(len(forces) * rig.substeps + 1, dtype=np.float64) * (
        1.0 / (rig.frame_rate * rig.substeps)
    )
    values = np.concatenate(([0.0], np.repeat(forces, rig.substeps)))
    return coupled.ForceTable(time_s=nodes, force_N=values)


@pytest.mark.parametrize(
    "run",
    [
        "pull-up-737",
        "pull-up-c172p",
        "three-controls",
        "tracking",
        "jam",
        "autopilot",
        "joined",
        "appendix-c",
        "awjsra-shear",
        "sweep",
    ],
)
@pytest.mark.parametrize("noisy", [False, True])
def test_a_run_that_is_stepped_has_the_bytes_of_the_run(run: str, noisy: bool) -> None:
    case = replace(read_run(run)[0], duration_s=2.5)
    if noisy:
        first = next(iter(case.rig.controls))
        d = "rad" if first == "wheel" else "m"
        changes = {f"noise.{first}_force_N": 0.3, f"noise.{first}_computed_{d}": 1e-5}
        changes[f"controls.{first}.sensing.force_stamp_s"] = 0.01
        case = replace(case, rig=case.rig.changed(changes))
    with coupled.Session(case) as session:
        for _ in range(case.frames):
            session.step()
    flown = fly(case)
    assert session.record.data.tobytes() == flown.data.tobytes()
    assert session.record.channels == flown.channels
    assert session.record.manifest == flown.manifest


@pytest.mark.parametrize("configuration", EVERY_CONFIGURATION)
@pytest.mark.parametrize("rig", ["t37", "737", "b747", "c172p", "report-column"])
def test_the_same_forces_give_the_bytes_of_fly(rig: str, configuration: Any) -> None:
    data = coupled.load_rig(rig)
    forces = wandering(3, 60)
    with coupled.Session(data, configuration=configuration) as session:
        for force in forces:
            session.step(column_force_N=force)
    table = held(forces, data)
    flown = coupled.fly(
        data, column=table, duration_s=60 / data.frame_rate, configuration=configuration
    )
    assert session.record.data.tobytes() == flown.record.data.tobytes()
    assert np.max(np.abs(session.record["column_hand_force_N"])) > 50.0


def test_a_flight_longer_than_its_first_arrays_has_the_bytes_of_fly() -> None:
    noisy = COLUMN.changed({"noise.column_force_N": 0.3})
    pull = coupled.Doublet(force_N=20.0, half_period_s=0.5)
    frames = 62 * 120
    with coupled.Session(noisy, column=pull, seed=4) as session:
        for _ in range(frames):
            session.step()
    flown = coupled.fly(noisy, column=pull, seed=4, duration_s=62.0)
    assert session.record.data.tobytes() == flown.record.data.tobytes()


def test_all_three_controls_are_pushed_by_their_names() -> None:
    with coupled.Session(RIG) as session:
        for _ in range(30):
            state = session.step(
                column_force_N=20, wheel_force_N=np.float64(8.0), pedals_force_N=-60.0
            )
    assert (state.column_hand_force_N, state.wheel_hand_force_N) == (20.0, 8.0)
    assert state.pedals_hand_force_N == -60.0
    assert state.wheel_computed_rad > 0.0 > state.pedals_computed_m


def test_a_state_has_the_channels_of_the_record_and_is_frozen() -> None:
    given: dict[str, Any] = {"record_properties": ["fcs/throttle-pos-norm"], "event": JAM}
    with coupled.Session("t37", **given) as session:
        states = [session.state, *(session.step(column_force_N=9.0) for _ in range(5))]
    record = session.record
    assert len(record) == 5
    for k, state in enumerate(states[:5]):
        assert tuple(state) == record.channels
        assert list(state.as_dict().values()) == record.data[k].tolist()
        assert state.column_force_N == state["column_force_N"] == record["column_force_N"][k]
    assert states[5].time_s == session.time_s == 5 / 120
    with pytest.raises(AttributeError, match="frozen"):
        states[0].time_s = 1.0
    with pytest.raises(AttributeError, match="did you mean column_force_N"):
        _ = states[0].column_forces_N
    with pytest.raises(coupled.InputError, match="no channel colum_force_N; did you mean column_f"):
        _ = states[0]["colum_force_N"]
    assert pickle.loads(pickle.dumps(states[1])) == states[1] != states[2]
    assert len({*states}) == 6


JAM = {"stuck": {"at_s": 0.25, "service": "jammed", "control": "column", "to": 1.0}}


def test_a_service_set_in_flight_is_that_of_an_event() -> None:
    def pull(session: coupled.Session, frames: int) -> None:
        for _ in range(frames):
            session.step(column_force_N=15.0)

    with coupled.Session("t37", event=JAM) as planned:
        pull(planned, 60)
    with coupled.Session("t37") as session:
        pull(session, 30)
        before = session.state
        session.set_service("column", "jammed", 1.0)
        assert "column_jammed" not in before
        assert session.state.column_jammed == 1.0
        pull(session, 30)
    assert session.record.channels == planned.record.channels
    assert session.record.data.tobytes() == planned.record.data.tobytes()
    assert session.record.manifest["session"]["services"] == [(0.25, "column", "jammed", 1.0)]


def test_a_switch_acts_from_its_frame_on() -> None:
    """From trim on it is the other configuration; later it changes the state at once."""
    with coupled.Session(COLUMN, configuration="compensated") as session:
        session.deflection_correction = session.gradient_correction = False
        assert not session.deflection_correction
        for force in wandering(5, 40):
            session.step(column_force_N=force)
    with coupled.Session(COLUMN, configuration="uncompensated") as plain:
        for force in wandering(5, 40):
            plain.step(column_force_N=force)
    assert session.record.data.tobytes() == plain.record.data.tobytes()

    with coupled.Session(COLUMN, configuration="compensated") as session:
        for _ in range(20):
            state = session.step(column_force_N=40.0)
        assert state.column_estimate_m > state.column_computed_m
        session.deflection_correction = False
        now = session.state
        assert now.column_estimate_m == now.column_computed_m == state.column_computed_m
        assert state.column_estimate_m > now.column_estimate_m  # a state does not change
        session.step(column_force_N=40.0)
    assert session.record["column_estimate_m"][20] == now.column_estimate_m
    assert session.record.manifest["session"]["switched"][0]["time_s"] == pytest.approx(20 / 120)


@pytest.mark.parametrize("run", ["joined", "stick-pusher", "three-controls", "latency", "capture"])
def test_a_host_that_runs_again_changes_nothing(run: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """`undo` restores all that the host's half of a frame changes, on every frame."""
    case = replace(read_run(run)[0], duration_s=1.5)
    first = next(iter(case.rig.controls))
    more = {f"controls.{first}.compensation.missed_share": 0.2, f"noise.{first}_force_N": 0.2}
    case = replace(case, rig=case.rig.changed(more))
    begin = HalfFrames.begin

    def twice(halves: HalfFrames, k: int, motion: tuple[float, ...]) -> Any:
        begin(halves, k, motion)
        halves.undo(k)
        return halves.begin_again(k)

    flown = fly(case)
    monkeypatch.setattr(HalfFrames, "begin", twice)
    monkeypatch.setattr("coupled.flight.airframe.plain_steps", lambda *_: None)
    with coupled.Session(case) as session:
        for _ in range(case.frames):
            session.step()
    assert session.record.data.tobytes() == flown.data.tobytes()


@pytest.mark.parametrize("rig", ["t37", "c172p"])
def test_a_reset_flies_again_from_trim(rig: str) -> None:
    noisy = coupled.load_rig(rig).changed({"noise.column_force_N": 0.2})
    flown = list[bytes]()
    with coupled.Session(noisy, seed=3) as session:
        at_first = session.state
        for seed in (None, 7, None, 7):
            assert session.reset(seed).altitude_m == at_first.altitude_m
            session.gradient_correction = False
            for force in wandering(1, 60):
                session.step(column_force_N=force)
            flown.append(session.record.data.tobytes())
            session.deflection_correction = not session.deflection_correction
        assert session.reset() == at_first
    assert flown[0] == flown[2] != flown[1] == flown[3]


@pytest.mark.parametrize("rig", ["t37", "c172p"])
def test_a_reset_keeps_the_aircraft(rig: str, monkeypatch: pytest.MonkeyPatch) -> None:
    made = list[str]()

    def make(manoeuvre: coupled.Manoeuvre) -> Any:
        made.append(manoeuvre.rig.name)
        return before(manoeuvre)

    before = loop.make_airframe
    monkeypatch.setattr("coupled.api.sessions.make_airframe", make)
    with coupled.Session(rig) as session:
        for _ in range(3):
            session.step(column_force_N=50.0)
            session.reset()
    assert made == [rig]


def resident_mb() -> float:
    """Return the memory that the process holds now; its largest so far would hide a growth."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * mmap.PAGESIZE / 2**20


@pytest.mark.slow
@pytest.mark.parametrize("rig", ["t37", "c172p", "awjsra"])
def test_many_resets_leak_nothing(rig: str) -> None:
    """Of aircraft that are kept, and of one that is loaded anew."""
    resets = 1000
    with coupled.Session(rig) as session:
        for done in range(resets):
            for _ in range(20):
                session.step(column_force_N=20.0)
            session.reset(seed=done)
            if done == resets // 2:  # the heap grows once, in the first 150
                gc.collect()
                before = resident_mb()
        gc.collect()
        assert resident_mb() - before < 1.0


def test_a_state_keeps_its_values_whatever_the_flight_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("coupled.api.sessions._FIRST_s", 0.1)  # the arrays are replaced soon
    with coupled.Session(COLUMN) as session:
        for force in wandering(1, 9):
            state = session.step(column_force_N=force)
        values, copied = state.as_dict(), pickle.loads(pickle.dumps(state))
        session.gradient_correction = False
        assert session.state != state
        for force in wandering(2, 20):
            session.step(column_force_N=force)
        assert session.record["column_force_N"][9] == values["column_force_N"]
        session.reset(5)
    assert state.as_dict() == values and state == copied and hash(state) == hash(copied)


def test_a_session_at_the_ground_ends_and_begins_again() -> None:
    low = COLUMN.changed({"flight.altitude_m": 60.0})
    with coupled.Session(low) as session:
        while not session.ended_early:
            state = session.step(column_force_N=-60.0)
        assert "met the ground at" in session.ended_early
        assert session.record.ended_early is not None
        assert str(session.record.ended_early) == session.ended_early
        assert state == session.state
        assert len(session.record) == round(session.time_s * 120)
        for act in (session.step, lambda: session.set_switch("column", "friction", 1.0)):
            with pytest.raises(coupled.InputError, match=r"the flight is over: .*; call reset"):
                act()
        session.reset()
        assert session.step().time_s == 1 / 120


def test_a_closed_session_says_so_and_keeps_its_record() -> None:
    with coupled.Session("t37") as session:
        session.step(column_force_N=5.0)
    assert (len(session.record), session.state.time_s, session.time_s) == (1, 1 / 120, 1 / 120)
    acts: list[Callable[[], object]] = [
        session.step,
        session.reset,
        lambda: session.set_service("column", "jammed", 1.0),
        lambda: setattr(session, "deflection_correction", False),
    ]
    for act in acts:
        with pytest.raises(coupled.InputError, match="the session is closed; make a new one"):
            act()
    session.close()


@pytest.mark.parametrize(
    ("forces", "said"),
    [
        ({"column_force_N": "10"}, "column_force_N: is '10'; give a force from -5000 to 5000"),
        ({"column_force_N": float("nan")}, "column_force_N: is nan; give a force from -5000"),
        ({"column_force_N": 5001.0}, "column_force_N: is 5001.0; give a force"),
        ({"column_force_N": True}, "column_force_N: is True; give a force"),
        ({"column_force_N": np.True_}, "column_force_N: is np.True_; give a force"),
        ({"colum_force_N": 1.0}, "colum_force_N: unknown key; did you mean column_force_N?"),
        ({"wheel_force_N": 1.0}, "wheel_force_N: the rig has no wheel; known: column"),
    ],
)
def test_a_wrong_force_is_one_line(forces: dict[str, Any], said: str) -> None:
    with coupled.Session(COLUMN) as session:
        with pytest.raises(coupled.InputError, match=said):
            session.step(**forces)
        assert session.step(column_force_N=1.0).time_s == 1 / 120


@pytest.mark.parametrize(
    ("act", "said"),
    [
        (lambda s: s.set_switch("column", "deflection", 2), "column.deflection: is 2; give True"),
        (lambda s: s.set_switch("column", "friction", True), "column.friction: is True; give a nu"),
        (lambda s: s.set_service("column", "trim_m", float("nan")), "to: is nan; give a number"),
        (lambda s: coupled.Session(COLUMN, **LENGTH), "duration_s: a session has none"),
        (lambda s: coupled.Session("bench"), "dynamic_pressure_Pa: is missing: bench has no air"),
    ],
)
def test_a_wrong_act_is_one_line_and_changes_nothing(
    act: Callable[[coupled.Session], object], said: str
) -> None:
    with coupled.Session(COLUMN) as session:
        with pytest.raises(coupled.InputError, match=said):
            act(session)
        flown = [session.step(column_force_N=5.0) for _ in range(9)]
    with coupled.Session(COLUMN) as other:
        assert flown == [other.step(column_force_N=5.0) for _ in range(9)]
    assert "session" not in session.record.manifest


def test_numbers_of_numpy_are_numbers() -> None:
    given: dict[str, Any] = {"seed": np.int64(3), "dynamic_pressure_Pa": np.float32(3000.0)}
    four: Any = np.int64(4)
    off: Any = np.False_
    with coupled.Session("bench", **given) as session:
        session.reset(four)
        session.deflection_correction = off
        assert not session.deflection_correction
        session.step(column_force_N=5.0)
    assert session.record.manifest["seed"] == 4


def test_a_session_is_not_copied() -> None:
    with coupled.Session(COLUMN) as session, pytest.raises(TypeError, match="make another one"):
        copy.deepcopy(session)


def test_a_mistyped_switch_is_refused() -> None:
    with coupled.Session(COLUMN) as session:
        mistyped = partial(setattr, session, "deflection_corection", False)
        with pytest.raises(AttributeError, match="has no attribute 'deflection_corection'"):
            mistyped()


def test_a_control_with_a_pilot_takes_no_force() -> None:
    session = coupled.Session(COLUMN, column=coupled.Step(force_N=5.0))
    with session, pytest.raises(coupled.InputError, match="the column has a pilot, Step; leave"):
        session.step(column_force_N=1.0)


def damp(state: coupled.State) -> float:
    return -300.0 * state.pitch_rate_rad_per_s - 400.0 * (state.pitch_rad - 0.02)


def test_a_function_is_a_pilot_and_a_session_under_it_the_same_flight() -> None:
    flown = coupled.fly(COLUMN, column=damp, duration_s=1.0).record
    with coupled.Session(COLUMN) as session:
        while session.time_s < 1.0:
            session.step(column_force_N=damp(session.state))
    assert session.record.data.tobytes() == flown.data.tobytes()
    with coupled.Session(COLUMN, column=damp) as other:
        for _ in range(120):
            other.step()
    assert other.record.data.tobytes() == flown.data.tobytes()
    asked = [damp(s) for s in states_of(flown)]
    assert flown["column_hand_force_N"][1:].tolist() == asked[:-1]
    assert max(map(abs, asked)) > 1.0


def states_of(record: coupled.Record) -> list[Any]:
    places = {name: i for i, name in enumerate(record.channels)}
    return [coupled.State(places, row.tobytes()) for row in record.data]


class Counting:
    """A pilot with a state, reset at each flight's start."""

    def __init__(self) -> None:
        self.calls, self.resets = 0, 0

    def reset(self) -> None:
        self.calls, self.resets = 0, self.resets + 1

    def __call__(self, state: coupled.State) -> float:
        assert state.time_s == self.calls / 120
        self.calls += 1
        return float(self.calls)


def test_a_comparison_takes_a_function_and_resets_it_for_each_flight() -> None:
    pilot = Counting()
    table = coupled.compare(
        COLUMN, column=pilot, duration_s=0.5, configurations=["rigid", "uncompensated"]
    )
    assert pilot.resets == 2 and pilot.calls == 60
    for flight in table:
        assert flight.record["column_hand_force_N"].tolist() == [float(k) for k in range(60)]


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (float("nan"), r"pilot.column: pilot returned nan at 0.01667 s; return a force in N"),
        ("50", r"pilot.column: pilot returned '50' at 0.01667 s; return a force in N"),
        (None, r"pilot.column: pilot returned None at 0.01667 s; return a force in N"),
        ([], r"pilot.column: pilot returned \[\] at 0.01667 s; return a force in N"),
        (iter(()), r"pilot.column: pilot returned a value of type tuple_iterator at 0.01667 s"),
        (1e6, r"pilot.column: pilot returned 1e\+06 N at 0.01667 s; give at most ±5000"),
    ],
)
def test_a_pilot_that_returns_no_force_is_one_line(value: Any, said: str) -> None:
    def pilot(state: coupled.State) -> Any:
        return value if state.time_s > 0.01 else 1.0

    with pytest.raises(coupled.InputError, match=said):
        coupled.fly(COLUMN, column=pilot, duration_s=0.5)


def test_an_exception_of_a_pilot_passes_with_its_place() -> None:
    def clumsy(state: coupled.State) -> float:
        return 1.0 / (state.time_s - 0.05)

    with pytest.raises(ZeroDivisionError) as raised:
        coupled.fly(COLUMN, column=clumsy, duration_s=0.5)
    assert raised.value.__notes__ == ["in clumsy, manoeuvre: pilot.column, at 0.05 s"]


def test_a_class_is_no_pilot() -> None:
    with pytest.raises(coupled.InputError, match=r"pilot.column: is <class .*; give a pilot"):
        coupled.fly(COLUMN, column=KIND, duration_s=0.5)


def law(state: coupled.State) -> float:
    return 500.0 + 0.1 * state.dynamic_pressure_Pa


def test_a_law_of_the_user_s_own_is_the_table_of_its_values() -> None:
    """A table that is linear in q̄ gives the same gradient as the function, and so the same flight.

    Where they round differently, the flights differ by rounding only.
    """
    q = [0.0, 20000.0]
    schedule = {
        "dynamic_pressure_Pa": q,
        "total_gradient_N_per_m": [500.0 + 0.1 * each for each in q],
    }
    changes = {f"controls.column.schedule.{key}": value for key, value in schedule.items()}
    pull = coupled.Step(force_N=25.0, start_s=0.1)
    by_table = coupled.fly(COLUMN.changed(changes), column=pull, duration_s=2.0).record
    by_law = coupled.fly(COLUMN, column=pull, duration_s=2.0, gradient=law).record
    assert np.allclose(by_law.data, by_table.data, rtol=1e-9, atol=1e-9)
    felt = by_law["column_gradient_N_per_m"]
    assert felt.tolist() == [law(s) for s in states_of(by_law)]
    assert np.ptp(felt) > 0.5
    with coupled.Session(COLUMN, column=pull, gradient={"column": law}) as session:
        for _ in range(240):
            session.step()
    assert session.record.data.tobytes() == by_law.data.tobytes()


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (-1.0, r"gradient.column: law returned -1 N per m at 0 s; give 0 or more, below"),
        (1e9, r"gradient.column: law returned 1e\+09 N per m at 0 s; give 0 or more, below"),
        ("x", r"gradient.column: law returned 'x' at 0 s; return a gradient in N per m"),
    ],
)
def test_a_law_that_returns_no_gradient_is_one_line(value: Any, said: str) -> None:
    def law(state: coupled.State) -> Any:
        return value

    with pytest.raises(coupled.InputError, match=said):
        coupled.fly(COLUMN, column=coupled.Step(force_N=5.0), duration_s=0.5, gradient=law)


def test_one_law_for_three_controls_is_refused() -> None:
    with pytest.raises(coupled.InputError, match="gradient: is one law for 3 controls; give a tab"):
        coupled.fly(RIG, column=damp, duration_s=0.5, gradient=law)


def test_a_check_takes_a_function_in_place_of_the_run_s_pilot() -> None:
    """Of a pilot that leaves the column alone, the run's expectations do not hold."""
    assert coupled.check("appendix-c").passed
    assert not coupled.check("appendix-c", column=nothing).passed


def nothing(state: coupled.State) -> float:
    return 0.0


def steady(state: coupled.State) -> float:
    return 30.0 if state.time_s > 0.2 else 0.0


SWEEP: dict[str, Any] = {
    "name": "own",
    "run": "appendix-c",
    "configurations": ["uncompensated"],
    "keep": ["force_N"],
    "vary": [{"key": "rig.controls.column.loader.bend_m_per_N", "values": [1e-5, 9e-5]}],
}


def test_a_sweep_takes_a_function_that_can_be_pickled(tmp_path: Path) -> None:
    found = coupled.sweep(SWEEP, tmp_path / "own", workers=1, column=steady).to_polars()
    assert found["force_N"].to_list() == [30.0, 30.0]
    with pytest.raises(coupled.InputError, match="another sweep"):
        coupled.sweep(SWEEP, tmp_path / "own", workers=1, column=nothing)
    said = "column: .*<lambda>.* cannot be pickled for other processes; define it, by its name, at"
    with pytest.raises(coupled.InputError, match=said):
        coupled.sweep(SWEEP, workers=1, column=lambda state: 1.0)
    with pytest.raises(coupled.InputError, match="the rig has no wheel"):
        coupled.sweep(SWEEP, workers=1, wheel=steady)


@pytest.mark.slow
def test_a_sweep_s_workers_fly_the_same_function() -> None:
    one, two = (coupled.sweep(SWEEP, workers=n, column=steady).to_polars() for n in (1, 2))
    assert one.equals(two)
