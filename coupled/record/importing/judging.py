"""Checks of each channel of an imported log: by itself, with other channels, and with the rig."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.record.channels import CONTROL_NAMES, TIME, channel, motions_in
from coupled.record.importing import plausible
from coupled.record.importing.redundant import feel_pressure, other_units, reversed_rates
from coupled.rig.equations import specified_gradient
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Judged:
    """A channel's figures, in its own unit, and doubts about it."""

    least: float
    greatest: float
    rms: float
    noise: float
    doubts: tuple[str, ...]


def judge(
    record: Mapping[str, Floats],
    logged: Mapping[str, Floats],
    time_s: Floats,
    rig: Rig | None,
    file: object,
) -> dict[str, Judged]:
    """Return {channel: figures and doubts}.

    `record` are the channels on its frames at `time_s`, shape (frames,); `logged` the same before
    any interpolation, which would hide a copy or a quantisation. Raises InputError for values that
    are impossible on this rig.
    """
    timed = {TIME: time_s, **record}
    units = other_units(timed, rig)
    right = {name: values * units[name].factor for name, values in record.items() if name in units}
    pairs = _by_others({**record, **right}, rig, file)
    for name, one in units.items():
        _add(pairs, name, f"looks like {one.unit}")
    for name, angle in reversed_rates(timed).items():
        _add(pairs, name, f"moves against {angle}: sign?")
    found = {}
    for name, values in record.items():
        raw = logged[name]
        doubts = [] if plausible.is_constant(raw) else _by_itself(name, raw)
        if plausible.is_constant(raw):
            doubts.append("constant")
        twin = plausible.copy_of(name, logged)
        doubts += [f"copy of {twin}"] if twin else []
        size = plausible.size_doubt(name, values)
        doubts += [size] if size and name not in units else []
        doubts += pairs.get(name, [])
        rms = float(np.sqrt(np.mean(np.square(values))))
        extremes = float(values.min()), float(values.max())
        found[name] = Judged(*extremes, rms, plausible.noise_level(raw), tuple(doubts))
    return found


def _by_itself(name: str, values: Floats) -> list[str]:
    values = np.unwrap(values) if name in plausible.TURNING else values
    doubts = []
    clip = plausible.clipped_at(values)
    if clip is not None:
        doubts.append(f"clipped at {clip:.4g}")
    if repeats := plausible.held(values):
        doubts.append(repeats)
    step = None if name.endswith("_stop") else plausible.quantised_step(values)
    if not name.endswith("_stop") and np.unique(values).size == 2:
        doubts.append("only two values: a switch?")
    if step is not None:
        doubts.append(f"quantised, step {step:.3g}")
    row = plausible.starts_again(values) if _is_position(name) else None
    if row is not None:
        doubts.append(f"jumps over its whole range at row {row + 1}: an angle for wraps_at?")
    single = [] if name.endswith(("_stop", "_force_step_N")) else plausible.spikes(values)
    if single:
        doubts.append(f"{len(single)} spike{'s' if len(single) > 1 else ''}")
    return doubts


def _is_position(name: str) -> bool:
    ends = ("computed", "deflection")
    return any(name == channel(control, end) for control in CONTROL_NAMES for end in ends)


def _by_others(record: Mapping[str, Floats], rig: Rig | None, file: object) -> dict[str, list[str]]:
    """Return the doubts from two channels, or from a channel and the rig."""
    doubts: dict[str, list[str]] = {}
    for control in CONTROL_NAMES:
        data = rig.controls.get(control) if rig is not None else None
        own = [name for name in record if name.startswith(f"{control}_")]
        if rig is not None and data is None and own:
            raise InputError(file, own[0], f"the rig has no {control}")
        moved = motions_in(record, control)
        for name in moved:
            if data is not None:
                _add(doubts, name, _travel(name, record[name], data, file))
        force = channel(control, "force")
        if moved:
            if force in record and plausible.move_oppositely(record[force], record[moved[0]]):
                _add(doubts, force, "moves against the deflection: sign?")
            if force in record and plausible.lacks_its_sign(record[force], record[moved[0]]):
                _add(doubts, force, "never negative: a size without its sign?")
            _add(doubts, force, _force(record, control, moved[0], data))
        if len(moved) == 2 and force in record:
            sign = plausible.bend_sign(record[force], record[moved[0]], record[moved[1]])
            if sign < 0:
                problem = f"falls short of {moved[0]} under force: exchanged, or a scale?"
                _add(doubts, moved[1], problem)
    pulled = next((n for n in ("column_computed_m", "column_deflection_m") if n in record), None)
    elevator = record.get("elevator_rad")
    if pulled and elevator is not None and plausible.move_oppositely(-elevator, record[pulled]):
        _add(doubts, "elevator_rad", "positive nose up: sign?")
    air = ("dynamic_pressure_Pa", "true_airspeed_m_per_s", "altitude_m")
    if all(name in record for name in air):
        pressure, airspeed, altitude = (record[name] for name in air)
        ratio = plausible.pressure_ratio(pressure, airspeed, altitude)
        low, high = plausible.SAME_PRESSURE
        if ratio is not None and not low < ratio < high:
            _add(doubts, air[0], f"is {ratio:.3g} of ½ρV² by airspeed and altitude")
    return doubts


def _add(doubts: dict[str, list[str]], name: str, doubt: str | None) -> None:
    if doubt:
        doubts.setdefault(name, []).append(doubt)


def _travel(name: str, values: Floats, data: Control, file: object) -> str | None:
    ratio = plausible.beyond_travel(values, data.travel)
    if ratio is None:
        return None
    if ratio > plausible.FAR_BEYOND:
        most = float(np.max(np.abs(values)))
        problem = f"reaches {most:.3g} on a rig that stops at {data.travel:g}: is its unit right?"
        raise InputError(file, name, problem)
    return f"{ratio:.2f} of the rig's travel"


def _force(
    record: Mapping[str, Floats], control: str, moved: str, data: Control | None
) -> str | None:
    """Compare a force with the gradient, as recorded or of the rig's table."""
    force, gradient = (channel(control, q) for q in ("force", "gradient"))
    if force not in record:
        return None
    total = record[gradient] if gradient in record else _filed_gradient(record, data)
    if total is None:
        return None
    expected = record[force]
    if data is not None:  # breakout and friction may be most of a small pull
        held = data.loader.breakout + data.loader.friction
        expected = np.sign(expected) * np.maximum(np.abs(expected) - held, 0.0)
    plain = plausible.force_ratio(record[force], record[moved], total)
    sprung = plausible.force_ratio(expected, record[moved], total)
    doubts = [
        plausible.unit_doubt(ratio, moved.endswith("_rad"))
        for ratio in (plain, sprung)
        if ratio is not None
    ]
    return doubts[0] if doubts and all(doubts) else None


def _filed_gradient(record: Mapping[str, Floats], data: Control | None) -> Floats | None:
    """Return the gradient of a rig's table at q̄; without q̄ only if it is constant."""
    pressure = feel_pressure(record, data) if data is not None else None
    if data is None or pressure is None:
        return None
    return specified_gradient(data.schedule, pressure)
