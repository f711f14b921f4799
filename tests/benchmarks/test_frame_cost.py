"""What a coupled frame costs, as a ratio to JSBSim's own run(), measured side by side.

By processor time, which other work on the machine changes little.
Run alone, with its figures printed:  pytest -m bench -s
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

import coupled
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.everyframe import PlainAircraft, PlainFrames
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import Manoeuvre
from coupled.flight.pilot.own import GivenForce
from coupled.resources import shipped_runs
from coupled.rig.compiled import bound, entry
from coupled.rig.placed import Placed
from tests.support.benchmarks import FRAME_BOUNDS, keep, kept_figures
from tests.support.runs import shortened

resource = pytest.importorskip("resource")  # not on Windows
pytestmark = pytest.mark.bench

FRAMES = 4800
ROUNDS = 9


def flown_s(scenario: Manoeuvre) -> float:
    start = time.thread_time()
    record = fly(scenario)
    assert len(record) == scenario.frames
    return time.thread_time() - start


def bare_s(scenario: Manoeuvre) -> float:
    assert scenario.rig.flight is not None
    airframe = JSBSimAirframe(scenario.rig.flight, 1.0 / scenario.rig.frame_rate)
    run = airframe._fdm.run
    start = time.thread_time()
    for _ in range(scenario.frames):
        run()
    return time.thread_time() - start


@pytest.mark.parametrize(("controls", "most"), FRAME_BOUNDS.items())
@pytest.mark.parametrize("run", ["pull-up-c172p", "pull-up-737"])
def test_a_coupled_frame_costs_little_more_than_a_run(run: str, controls: int, most: float) -> None:
    load = os.getloadavg()[0]
    long, short = shortened(run, controls, FRAMES), shortened(run, controls, 1)
    flown_s(short)
    bare, flown, start = [], [], []
    ratio = most + 1.0
    for done in range(4 * ROUNDS):  # in turn, so that a machine that drifts does so for all three
        if done >= ROUNDS and ratio <= most:
            break
        bare.append(bare_s(long))
        flown.append(flown_s(long))
        start.append(flown_s(short))
        # What disturbs a measurement only ever adds to it: the least of each is the cost. A
        # machine that does other work all along is given more rounds to show a quiet one.
        ratio = (min(flown) - min(start)) / min(bare)
    print(f"\n{run}, {controls} control(s): {ratio:.2f} times run(), bound {most}")
    name = f"frame cost, {controls} control(s)"
    keep(name, {**kept_figures(name), run: ratio}, load)
    assert ratio <= most


def only_the_rig(spent: list[float]) -> Callable[[PlainAircraft, Placed], PlainFrames]:
    """Return `plain_frames` without the aircraft's step; each flight adds its time, s."""

    def frames(aircraft: PlainAircraft, placed: Placed) -> PlainFrames:
        placed.connect(aircraft.connection)
        rig_frame, address = placed.fly, placed.address

        def fly(first: int, last: int) -> int:
            start = time.thread_time()
            for k in range(first, last):
                rig_frame(address, k, True)
            spent[-1] += time.thread_time() - start
            return last

        return fly

    return frames


def empty_s(frames: int) -> float:
    """Return the time of as many calls of compiled code that does nothing."""
    nothing = bound(entry(_nothing), 1, 1, True)
    start = time.thread_time()
    for k in range(frames):
        nothing(1, k, True)
    return time.thread_time() - start


def _nothing(address: int, k: int, checked: bool) -> bool:
    return False


@pytest.mark.parametrize("controls", FRAME_BOUNDS)
@pytest.mark.parametrize("run", ["pull-up-c172p", "pull-up-737"])
def test_where_the_time_of_a_frame_goes(
    run: str, controls: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In µs: `run()` in trim, the rig's compiled frame without it, the call of such a frame.

    The rest is what `run()` takes longer in a manoeuvre, and both with the caches shared.
    """
    load = os.getloadavg()[0]
    long, short = shortened(run, controls, FRAMES), shortened(run, controls, 1)
    flown_s(short)
    times: dict[str, list[float]] = {"run()": [], "frame": [], "rig": [], "call": []}
    starts = list[float]()
    for _ in range(ROUNDS):
        times["run()"].append(bare_s(long))
        starts.append(flown_s(short))
        times["frame"].append(flown_s(long))
        rig = [0.0]
        with monkeypatch.context() as patched:
            patched.setattr("coupled.flight.airframe.plain_frames", only_the_rig(rig))
            flown_s(long)
        times["rig"] += rig
        times["call"].append(empty_s(FRAMES))
    part = {name: 1e6 * min(each) / FRAMES for name, each in times.items()}
    part["frame"] -= 1e6 * min(starts) / FRAMES
    part["rest"] = part["frame"] - part["run()"] - part["rig"]
    said = ", ".join(f"{name} {value:.2f}" for name, value in part.items())
    print(f"\n{run}, {controls} control(s), µs: {said}")
    name = f"frame parts, {controls} control(s)"
    more = {f"{run}, {each}_us": value for each, value in part.items()}
    keep(name, {**kept_figures(name), **more}, load)
    assert part["call"] < part["rig"] < part["run()"]


STEP_BOUND = 1.15  # times a frame of `fly`, with one control


def stepped_s(scenario: Manoeuvre) -> float:
    with coupled.Session(replace(scenario, pilots={"column": GivenForce()})) as session:
        step = session.step
        start = time.thread_time()
        for _ in range(scenario.frames):
            step(column_force_N=20.0)
        return time.thread_time() - start


@pytest.mark.parametrize("run", ["pull-up-c172p", "pull-up-737"])
def test_a_step_of_a_session_costs_little_more_than_a_frame_of_fly(run: str) -> None:
    load = os.getloadavg()[0]
    long, short = shortened(run, 1, FRAMES), shortened(run, 1, 1)
    flown_s(short)
    stepped_s(short)
    flown, start, stepped = [], [], []
    ratio = STEP_BOUND + 1.0
    for done in range(4 * ROUNDS):
        if done >= ROUNDS and ratio <= STEP_BOUND:
            break
        flown.append(flown_s(long))
        stepped.append(stepped_s(long))
        start.append(flown_s(short))
        ratio = min(stepped) / (min(flown) - min(start))
    print(f"\n{run}: a step costs {ratio:.3f} times a frame of fly, bound {STEP_BOUND}")
    name = "session step, 1 control"
    keep(name, {**kept_figures(name), run: ratio}, load)
    assert ratio <= STEP_BOUND


def test_a_60_s_flight_and_its_record_fit_in_60_mb(tmp_path: object) -> None:
    code = f"""
import resource, sys
from pathlib import Path
from tests.support.runs import shortened
from coupled.flight.loop import fly
from coupled.record.record import write_record
fly(shortened("three-controls", 3, 10))
write_record(fly(shortened("three-controls", 3, 10)), Path({str(tmp_path)!r}) / "a.csv")
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
write_record(fly(shortened("three-controls", 3, 7200)), Path({str(tmp_path)!r}) / "b.csv")
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120
    )
    print(f"\n60 s with three controls: {float(done.stdout):.1f} MB above a short flight's peak")
    assert float(done.stdout) < 60.0


def processor_s(command: list[str], folder: Path) -> float:
    """Return the processor time of a process and those that it starts."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, timeout=120, cwd=folder, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return float(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


STARTS = {
    "--help": (["--help"], "rich.console, typer", 3.0),
    "fly": (["fly", "short.toml", "-o", "a.csv"], "jsbsim, numba, polars, pydantic, typer", 2.2),
    "compare": (
        ["compare", "short.toml", "--figure", "a.png"],
        "jsbsim, matplotlib.figure, matplotlib.backends.backend_agg, numba, pydantic, typer",
        3.2,
    ),
}


@pytest.mark.parametrize("command", STARTS)
def test_a_start_takes_little_more_than_its_libraries(command: str, tmp_path: Path) -> None:
    arguments, libraries, most = STARTS[command]
    run = re.sub(
        r"duration_s = 8.0", "duration_s = 0.1", shipped_runs()["pull-up-c172p"].read_text()
    )
    (tmp_path / "short.toml").write_text(run)
    own = [sys.executable, "-m", "coupled", *arguments]
    bare = [sys.executable, "-c", f"import {libraries}"]
    processor_s(own, tmp_path)  # the first start compiles
    ratio, starts, imports = most + 1.0, list[float](), list[float]()
    for done in range(12):
        if done >= 3 and ratio <= most:
            break
        imports.append(processor_s(bare, tmp_path))
        starts.append(processor_s(own, tmp_path))
        ratio = min(starts) / min(imports)
    print(f"\n{command}: {min(starts):.2f} s, its libraries {min(imports):.2f} s: {ratio:.2f}")
    assert ratio <= most
