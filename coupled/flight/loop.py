"""The frame loop: rig and aircraft, coupled.

Each frame the airframe gives q̄, load factor and motion; the rig's compiled frame step
does the rest; the airframe takes the surface commands for one step. A flight that
meets the ground, loses a finite state or is interrupted keeps its record so far.
"""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.files import sha256
from coupled.flight.airframe import ALTITUDE, JSBSimAirframe
from coupled.flight.bench import Airframe, Bench
from coupled.flight.conditions import meet
from coupled.flight.direct import check_direct_controls
from coupled.flight.pilot import Action, Table
from coupled.flight.scenario import Scenario
from coupled.record.channels import TIME, ControlName, control_channels, record_channels
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.compiled import bound
from coupled.rig.equations import specified_gradient
from coupled.rig.frame import addresses, step_frame_at
from coupled.rig.packing import pack

Progress = Callable[[int, int], None]
Floats = NDArray[np.float64]


def fly(
    scenario: Scenario, progress: Progress | None = None, air_m_per_s: Sequence[float] | None = None
) -> Record:
    """Fly a scenario and return its record, SI, one row a frame.

    `progress` is called now and then with frames done and frames in all. The manifest says
    what went in, and under `ended_early` why and when a flight ended before its time.
    `air_m_per_s` says, in place of the rig's gusts, how fast the air rises at each frame.
    """
    run, rig = scenario.run, scenario.rig
    airframe = make_airframe(scenario, air_m_per_s)
    frames, substeps = scenario.frames, rig.substeps
    h = 1.0 / (rig.frame_rate * substeps)
    actions = _actions(scenario, airframe.motion()[0])
    names = list(rig.controls)
    channels = record_channels(names, rig.flight is not None)
    controls = pack(rig, {str(name): action.hand for name, action in actions.items()})
    script = _script(names, actions, frames * substeps + 1, h)
    data = _noise(channels, rig.noise, frames, run.seed)
    hands = controls["state"]["hand"]
    looks = [(hands[names.index(n)], a.look) for n, a in actions.items() if a.look]
    extra: list[tuple[float, ...]] = []

    read, step, safe_m = airframe.motion, airframe.step, airframe.safe_altitude_m
    arrays = addresses(controls, script, data)
    place = int(arrays.ctypes.data)
    rig_frame = bound(step_frame_at, place, 0, read(), 1.0)
    flown, asked = rig.flight is not None, bool(run.record_properties)
    ended: dict[str, Any] | None = None
    done = 0
    try:
        for k in range(frames):
            motion = read()
            # Not above it: near the ground, or not a number.
            if flown and not motion[ALTITUDE] > safe_m and (why := airframe.trouble()):
                ended = {"reason": why, "time_s": k / rig.frame_rate}
                break
            if looks:
                for state, look in looks:
                    state["command"] = look(k / rig.frame_rate, motion)
            load = motion[1] if flown else 1.0
            commands = rig_frame(place, k, motion, load)
            if asked:
                extra.append(airframe.extra())
            step(commands)
            done = k + 1
            if not done & 63 and progress is not None:
                progress(done, frames)
    except KeyboardInterrupt:
        ended = {"reason": "interrupted", "time_s": done / rig.frame_rate}
    data = data[:done]
    lost = np.flatnonzero(~np.isfinite(data).all(axis=1))
    if lost.size:
        data = data[: lost[0]]
        ended = {"reason": "the state is not finite", "time_s": int(lost[0]) / rig.frame_rate}
    data[:, 0] = np.arange(len(data)) / rig.frame_rate
    if asked:
        channels = (*channels, *run.record_properties)
        data = np.column_stack((data, np.reshape(extra[: len(data)], (len(data), -1))))
    return Record(channels, data, _manifest(scenario, channels, data, ended))


def make_airframe(scenario: Scenario, air_m_per_s: Sequence[float] | None = None) -> Airframe:
    """Return the scenario's aircraft, trimmed and checked, or its bench."""
    rig, run = scenario.rig, scenario.run
    if rig.flight is None:
        assert run.bench is not None
        points = list(zip(run.bench.time, run.bench.dynamic_pressure, strict=True))
        return Bench(1.0 / rig.frame_rate, points)
    where: dict[str, Any] = {"models": [aircraft_folder()], "file": scenario.rig_file}
    frame_s, controls = 1.0 / rig.frame_rate, list(rig.controls)
    try:
        check_direct_controls(rig.flight, frame_s, controls, **where)
        asked: dict[str, Any] = {"record": run.record_properties, "record_file": scenario.file}
        asked |= {"seed": run.seed, "air_m_per_s": air_m_per_s}
        airframe = JSBSimAirframe(rig.flight, frame_s, controls, **asked, **where)
    except InputError as error:
        if error.key not in scenario.changes:
            raise
        place = f"case {scenario.label!r}: rig.{error.key}"
        raise InputError(scenario.file, place, error.problem) from None
    meet(airframe, run, scenario.file, frame_s, run.seed)
    return airframe


def _actions(scenario: Scenario, pressure_Pa: float) -> dict[ControlName, Action]:
    """Return what each pilot does on a control, within reach, at the dynamic pressure of trim."""
    rig, found = scenario.rig, {}
    for name, pilot in scenario.pilots.items():
        control = rig.controls[name]
        gradient = float(specified_gradient(control.schedule, pressure_Pa))
        met = pilot.meet(rig, scenario.rig_file, scenario.file, scenario.run.seed)
        action = met.act(control, gradient, name, scenario.file.parent)
        hand = replace(action.hand, reach=pilot.reach, gradient=gradient)
        found[name] = replace(action, hand=hand)
    return found


def _script(names: Sequence[str], actions: dict[Any, Action], nodes: int, h: float) -> Floats:
    """Return the hands' script on all nodes, shape (controls, 2, nodes): N and d."""
    times = _times(nodes, h)
    script = np.zeros((len(names), 2, nodes))
    for name, action in actions.items():
        force, held = script[names.index(name)]
        if action.force is not None:
            force[:] = action.force(times)
        if action.held is not None:
            held[:] = action.held(times)
    return script


@lru_cache(maxsize=1)
def _times(nodes: int, h: float) -> Floats:
    """Return the times of all nodes, s; flights of a campaign share them."""
    times: Floats = np.arange(nodes, dtype=np.float64) * h
    times.flags.writeable = False
    return times


def _noise(channels: tuple[str, ...], levels: dict[str, float], frames: int, seed: int) -> Floats:
    """Return a record that holds nothing yet but the noise of its channels."""
    sigma = np.array([levels.get(channel, 0.0) for channel in channels])
    if not sigma.any():
        return np.zeros((frames, len(channels)))
    hiss = np.random.default_rng(seed).standard_normal((frames, len(channels)))
    hiss *= sigma
    return hiss


def input_files(scenario: Scenario) -> list[Path]:
    """Return the files that a flight reads: run, rig, and a pilot's tables."""
    tables = [pilot.file for pilot in scenario.pilots.values() if isinstance(pilot, Table)]
    here = scenario.file.parent
    return [scenario.file, scenario.rig_file, *(here / name for name in tables)]


def _manifest(
    scenario: Scenario, channels: tuple[str, ...], data: Floats, ended: dict[str, Any] | None
) -> dict[str, Any]:
    stops = {}
    for control in scenario.rig.controls:
        met = np.flatnonzero(data[:, channels.index(control_channels(control)[-1])])
        if met.size:
            stops[control] = float(data[met[0], channels.index(TIME)])
    return {
        "run": scenario.run.name,
        "case": scenario.label,
        "rig": scenario.rig.model_dump(),
        "seed": scenario.run.seed,
        "channels": list(channels),
        "rows": len(data),
        "ended_early": ended,
        "stop_first_met_s": stops,
        "inputs_sha256": {
            path.name: sha256(path) for path in input_files(scenario) if path.is_file()
        },
        "versions": dict(_versions()),
    }


@lru_cache(maxsize=1)
def _versions() -> dict[str, str]:
    found = {"coupled": version("coupled"), "python": platform.python_version()}
    return found | {name: version(name) for name in ("jsbsim", "numpy", "numba", "scipy")}
