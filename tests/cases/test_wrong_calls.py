"""Every public function, called with each of its arguments wrong: one line, whatever is given."""

from __future__ import annotations

import inspect
import random
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coupled
from coupled.arguments import MARK, hints_of
from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.estimate import usual_instruments
from coupled.calibration.plan import stations
from coupled.envs import LoaderEnv
from coupled.flight.pilot import PILOTS, Pilot
from coupled.flight.pilot.base import Start
from tests.support.rigs import bench
from tests.support.wrong import VALUES, unexpected

Call = tuple[str, Callable[..., Any], dict[str, Any]]
PRESSURE = coupled.PressureProfile(time_s=[0.0], dynamic_pressure_Pa=[3000.0])
PULL = coupled.Step(force_N=20.0)
GIVEN: dict[type[Pilot], dict[str, Any]] = {
    coupled.Step: {"force_N": 20.0},
    coupled.Ramp: {"force_N": 20.0, "ramp_s": 1.0},
    coupled.Doublet: {"force_N": 20.0, "half_period_s": 0.5},
    coupled.ThreeTwoOneOne: {"force_N": 20.0, "unit_s": 0.5},
    coupled.FrequencySweep: {"force_N": 20.0, "duration_s": 1.0},
    coupled.ForceTable: {"time_s": [0.0, 1.0], "force_N": [0.0, 1.0]},
    coupled.Clamp: {"deflection_m": 0.01},
    coupled.Attitude: {"gain_N_per_rad": 900.0},
    coupled.Track: {"crossover_rad_per_s": 1.5},
}


def calls() -> list[Call]:
    """Return each public function with arguments that it takes; its own name for faults."""
    rig = bench()
    record = coupled.Record(
        ("time_s", "column_force_N"), np.stack((np.arange(40) / 60.0, np.zeros(40)), axis=1)
    )
    case = coupled.Manoeuvre(rig, {"column": PULL}, duration_s=0.1, bench=PRESSURE)
    flights = coupled.compare(case, configurations=["rigid"])
    tools = usual_instruments("column")
    readings = take_readings(
        CalibrationBench(rig, "column", stations(rig, "column", 3, 3), tools, 0), 1
    )
    flown = {"what": rig, "column": PULL, "duration_s": 0.1, "dynamic_pressure_Pa": 3000.0}
    flown |= {"seed": 1, "name": "x", "record_properties": (), "progress": None}
    manoeuvre = {field: getattr(case, field) for field in case.__dataclass_fields__}
    plan: dict[str, Any] = {"name": "s", "run": "appendix-c", "configurations": ["rigid"]}
    plan |= {"vary": [{"key": "rig.controls.column.loader.bend_m_per_N", "values": [0.0]}]}
    start = Start(100.0)
    stepped: dict[str, Any] = {
        key: flown[key] for key in ("what", "dynamic_pressure_Pa", "seed", "name")
    }
    stepped |= {"gradient": None, "wheel": None}
    session = coupled.Session(**stepped)
    options: dict[str, Any] = {
        "controls": ["column"],
        "force_limit_N": 10.0,
        "observed": ["pitch_rad"],
    }
    options |= {"reward": None, "change_rad": 0.1, "frames": 1, "terms": {}}
    env = LoaderEnv("report-column", **options)
    found: list[Call] = [
        ("load_rig", coupled.load_rig, {"rig": "t37"}),
        ("load_run", coupled.load_run, {"run": "appendix-c"}),
        (
            "fly",
            coupled.fly,
            {**flown, "configuration": "rigid", "wheel": None, "pedals": None, "gradient": None},
        ),
        ("Session", coupled.Session, {**stepped, "configuration": "rigid", "column": PULL}),
        ("Session.step", session.step, {"column_force_N": 1.0, "wheel_force_N": None}),
        ("Session.reset", session.reset, {"seed": 1}),
        (
            "Session.set_switch",
            session.set_switch,
            {"control": "column", "switch": "friction", "value": 1.0},
        ),
        (
            "Session.set_service",
            session.set_service,
            {"control": "column", "service": "jammed", "value": 1.0},
        ),
        ("Session.deflection_correction", partial(_corrected, session), {"on": True}),
        ("State[…]", session.state.__getitem__, {"channel": "time_s"}),
        ("LoaderEnv", LoaderEnv, {"rig": "report-column", **options}),
        ("LoaderEnv.step", env.step, {"action": [0.1]}),
        ("compare", coupled.compare, {**flown, "configurations": ["rigid"]}),
        ("check", coupled.check, {"runs": [[case]], "progress": None, "column": None}),
        (
            "sweep",
            coupled.sweep,
            {"plan": plan, "folder": None, "workers": 1, "cluster": "", "column": None},
        ),
        ("read_record", coupled.read_record, {"path": "record.csv"}),
        ("write_record", coupled.write_record, {"record": record, "path": "again.csv"}),
        ("import_log", coupled.import_log, {"log": "record.csv", "log_map": "m.toml", "rig": rig}),
        (
            "calibrate",
            coupled.calibrate,
            {"readings": readings, "rig": rig, "control": "column", "instruments": tools},
        ),
        (
            "diagnose",
            coupled.diagnose,
            {"rig": rig, "records": record, "control": "column", "healthy": None},
        ),
        ("Record", coupled.Record, {"channels": record.channels, "data": record.data}),
        ("Record.from_frame", coupled.Record.from_frame, {"frame": record.to_polars()}),
        ("Record.between", record.between, {"start_s": 0.1, "end_s": 0.2}),
        ("Record.__getitem__", record.__getitem__, {"channel": "time_s"}),
        (
            "Record.plot",
            lambda channel, title: record.plot(channel, title=title),
            {
                "channel": "time_s",
                "title": "t",
            },
        ),
        ("Rig", coupled.Rig, {key: getattr(rig, key) for key in type(rig).model_fields}),
        ("Rig.changed", rig.changed, {"changes": {"frame_rate_Hz": 60.0}}),
        *(
            (f"Rig.changed {key}", partial(_changed, rig, key), {"value": None})
            for key in ("controls", "controls.column.loader.mass_kg", "flight", "noise", "name")
        ),
        ("Rig.only", rig.only, {"control": "column"}),
        ("Manoeuvre", coupled.Manoeuvre, manoeuvre),
        ("Manoeuvre.configured", case.configured, {"configuration": "rigid"}),
        ("PressureProfile", coupled.PressureProfile, dict(PRESSURE)),
        ("PressureProfile.check", PRESSURE.check, {"file": "x"}),
        ("Comparison.loss", flights.loss, {"configuration": "rigid", "case": None}),
        ("Comparison.felt_ratio", flights.felt_ratio, {"configuration": "rigid", "case": None}),
        ("Comparison.flight", flights.flight, {"configuration": "rigid", "case": None}),
        ("InputError", coupled.InputError, {"file": "f", "key": "k", "problem": "p", "more": ()}),
    ]
    for kind, given in GIVEN.items():
        name, pilot = kind.__name__, kind(**given)
        found.append((name, kind, {key: getattr(pilot, key) for key in kind.model_fields}))
        where: dict[str, Any] = {"rig": rig, "control": "column"}
        found.append((f"{name}.check", pilot.check, {**where, "file": "x"}))
        found.append((f"{name}.act", pilot.act, {**where, "start": start}))
        found.append((f"{name}.reach", pilot.reach, {"control": "column"}))
        found.append((f"{name}.keys_on", pilot.keys_on, {"control": "column"}))
    return found


def _corrected(session: coupled.Session, on: Any) -> None:
    session.deflection_correction = on


def _changed(rig: coupled.Rig, key: str, value: Any) -> Any:
    return rig.changed({key: value})


def wrong_calls(every: list[Call], seed: int, more: int) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield calls with one argument wrong, each by each value; then `more` with several."""
    rng = random.Random(seed)
    for name, function, given in every:
        yield f"{name}()", function
        yield f"{name}(…, nothing=1)", partial(function, **given, nothing=1)
        yield f"{name}(1, 2, …)", partial(function, *range(30))
        for key in given:
            lacking = {other: value for other, value in given.items() if other != key}
            yield f"{name} without {key}", partial(function, **lacking)
            for number, value in enumerate(VALUES):
                what = f"{name}({key}=VALUES[{number}])"
                yield what, partial(function, **{**given, key: value})
    for _ in range(more):
        name, function, given = rng.choice(every)
        keys = rng.sample(list(given), min(len(given), rng.choice((2, 3))))
        chosen = {key: rng.randrange(len(VALUES)) for key in keys}
        wrong = {key: VALUES[number] for key, number in chosen.items()}
        yield f"{name}({chosen})", partial(function, **{**given, **wrong})


def tracebacks(made: Iterator[tuple[str, Callable[[], Any]]]) -> list[str]:
    """Return what calls end in that is no line, by the call."""
    found = []
    for what, call in made:
        try:
            call()
        except Exception as error:
            if said := unexpected(error):
                found.append(f"{what}: {said}")
    return found


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("record.csv").write_text("time_s,column_force_N\n0.0,1.0\n0.1,2.0\n")
    Path("m.toml").write_text('[clock]\nfrom = "time_s"\n')
    return tmp_path


@pytest.mark.slow
@pytest.mark.usefixtures("folder")
def test_a_sample_of_wrong_calls_ends_in_one_line() -> None:
    made = list(wrong_calls(calls(), seed=35, more=400))
    sample = random.Random(1).sample(made, 300)
    assert tracebacks(iter(sample)) == []


@pytest.mark.slow
@pytest.mark.usefixtures("folder")
def test_every_wrong_call_ends_in_one_line() -> None:
    made = list(wrong_calls(calls(), seed=36, more=3000))
    assert len(made) > 10_000
    assert tracebacks(iter(made)) == []


def public_functions() -> dict[str, Any]:
    """Return the functions of `coupled.__all__`, and the public methods of its classes."""
    found: dict[str, Any] = {}
    for name in coupled.__all__:
        thing = getattr(coupled, name)
        if not isinstance(thing, type):
            found[name] = thing
            continue
        for owner in thing.__mro__:
            if owner.__module__.startswith("coupled."):
                for key, member in vars(owner).items():
                    function = getattr(member, "__func__", member)
                    ours = getattr(function, "__module__", "") == owner.__module__
                    if inspect.isfunction(function) and ours and not key.startswith("_"):
                        found[f"{owner.__name__}.{key}"] = function
    return found


@pytest.mark.parametrize("name", public_functions())
def test_a_public_function_checks_its_arguments(name: str) -> None:
    function = public_functions()[name]
    plain = inspect.unwrap(function)
    takes = [p for p in inspect.signature(plain).parameters if p not in ("self", "cls")]
    if takes:
        assert getattr(function, MARK, False), f"{name} is not marked `public`"
        assert hints_of(plain).keys() == set(takes)


def test_every_pilot_is_called_wrongly() -> None:
    assert set(GIVEN) == set(PILOTS.values())
