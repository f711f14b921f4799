"""Authority maps: loss over q̄ and deflection, and stick force per g and per knot.

The loss is the closed form of the rig's statics. Force per g and per knot combine it with the
aircraft: the elevator per g and per knot is found by flying it at speeds over the schedule, each
trimmed in level flight at the rig's altitude.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.errors import InputError, collected
from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import UNTRIMMED, JSBSimAirframe
from coupled.flight.altered import STILL
from coupled.flight.loop import fly
from coupled.flight.manoeuvre import CONFIGURATIONS, Configuration, configure
from coupled.flight.runfile import read_run
from coupled.record.channels import ELEVATOR, LOAD, PRESSURE, ControlName, channel
from coupled.record.record import Record
from coupled.resources import aircraft_folder, shipped_runs
from coupled.rig.equations import bend_loss, gradient_at_neutral
from coupled.rig.packing import COMMAND_SIGN
from coupled.rig.rig import Rig
from coupled.rig.statics import static_line, static_point
from coupled.schema import changed, load_toml
from coupled.units import KNOT_m_per_s

Floats = NDArray[np.float64]
Progress = Callable[[str, int, int], None]

FELT: tuple[Configuration, ...] = ("rigid", "uncompensated", "compensated")
_SEA_LEVEL_kg_per_m3 = 1.225
_LEAST_PRESSURE_Pa = 200.0
_CONSTANT_Pa = 1000.0  # q̄ of the map if the gradient does not depend on it
_PRESSURES, _DEFLECTIONS, _SPEEDS = 33, 65, 9
_STEPS, _BEYOND_STOP = 401, 17  # along δc, and along δ beyond the loader's stop
_STEP, _PULL_s = 0.01, 3.0  # size of the elevator command, in the linear range, and its duration
_TRIMS_kt = 8.0  # between the two trims whose forces are compared


@dataclass(frozen=True)
class LossMap:
    """The lost share of the commanded deflection, for one control and configuration.

    `loss` has shape (pressures, deflections); `deflection` in d, all above zero.
    """

    control: ControlName
    configuration: Configuration
    pressure_Pa: Floats
    deflection: Floats
    loss: Floats


@dataclass(frozen=True)
class Feel:
    """Stick forces at the speeds of level trim, shape (speeds,), for each of `FELT`.

    Per g: for the largest load factor within 3 s of a small step, scaled to 1 g. Per knot: from
    level trims 4 kt to either side, a pull per knot slower being positive. Both exclude the
    breakout.
    """

    calibrated_airspeed_m_per_s: Floats
    pressure_Pa: Floats
    per_g_N: dict[Configuration, Floats]
    per_knot_N: dict[Configuration, Floats]

    def to_polars(self) -> pl.DataFrame:
        """Return one row per speed, in SI; null for a missing force."""
        columns = {
            "calibrated_airspeed_m_per_s": self.calibrated_airspeed_m_per_s,
            "dynamic_pressure_Pa": self.pressure_Pa,
        }
        for name in FELT:
            word = "specified" if name == "rigid" else name
            columns[f"{word}_force_per_g_N"] = self.per_g_N[name]
            columns[f"{word}_pull_per_knot_N"] = self.per_knot_N[name]
        return pl.DataFrame(columns).fill_nan(None)


def loss_maps(rig: Rig, control: ControlName) -> list[LossMap]:
    """Return the maps of one control in all configurations but the rigid one."""
    data = rig.controls[control]
    most = max(data.schedule.dynamic_pressure)
    pressures = np.linspace(0.0, most if most > 0.0 else _CONSTANT_Pa, _PRESSURES)
    deflections = data.pull * np.linspace(0.002, 1.0, _DEFLECTIONS)
    made = []
    for name in CONFIGURATIONS[1:]:
        changed = configure(rig, name)
        rows = [_loss(changed, control, float(q), deflections) for q in pressures]
        made.append(LossMap(control, name, pressures, deflections, np.array(rows)))
    return made


def _pulled(rig: Rig, control: ControlName, pressure_Pa: float) -> tuple[Floats, Floats, Floats]:
    """Return δ and δ̂ in d and F in N of a pull up to the travel, finely enough to draw.

    If the loader reaches its stop before the grip's travel, the structure bends on from there.
    """
    data = rig.controls[control]
    stop = data.stop_to(1.0)
    line = static_line(rig, control, pressure_Pa, stop * np.linspace(1e-6, 1.0, _STEPS))
    parts = [line]
    if line.deflection[-1] < data.pull:
        full = data.pull * (1.0 + 1e-9)  # margin for rounding
        beyond = np.linspace(line.deflection[-1], full, _BEYOND_STOP)[1:]
        points = [static_point(rig, control, pressure_Pa, float(each)) for each in beyond]
        # The grip of a rigid structure stops there.
        parts += [each for each in points if each.deflection[0] > line.deflection[-1]]
    deflection, estimate, force = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("deflection", "estimate", "force")
    )
    return deflection, estimate, force


def _loss(rig: Rig, control: ControlName, pressure_Pa: float, deflections: Floats) -> Floats:
    deflection, estimate, _ = _pulled(rig, control, pressure_Pa)
    # Below the first point the loader rests in its breakout; beyond the last the grip is stopped.
    reached = np.interp(deflections, deflection, estimate, left=np.nan, right=np.nan)
    return np.asarray(1.0 - reached / deflections)


def envelope(records: Sequence[Record], control: ControlName) -> Floats:
    """Return the dynamic pressures in Pa and deflections in d flown, shape (2, points)."""
    flown = [
        np.stack((r["dynamic_pressure_Pa"], np.abs(r[channel(control, "deflection")])))
        for r in records
        if channel(control, "deflection") in r
    ]
    return np.concatenate(flown, axis=1) if flown else np.empty((2, 0))


def shipped_flights(rig: Rig, progress: Progress) -> list[Record]:
    """Return records of all cases of the shipped runs with this rig."""
    named = [n for n, path in shipped_runs().items() if load_toml(path)["rig"] == rig.name]
    scenarios = [case for name in named for case in read_run(name)]
    records = []
    for i, scenario in enumerate(scenarios):
        progress(scenario.name, i, len(scenarios))
        records.append(fly(scenario))
    return records


def feel(rig: Rig, file: Path, progress: Progress) -> Feel | None:
    """Return the stick forces; None for a bench, without a column, or without any trim.

    Raises InputError for an aircraft that does not fly for another reason.
    """
    if rig.flight is None or "column" not in rig.controls:
        return None
    table = rig.controls["column"].schedule
    ends = [max(min(table.dynamic_pressure), _LEAST_PRESSURE_Pa), max(table.dynamic_pressure)]
    slowest, fastest = (math.sqrt(2.0 * q / _SEA_LEVEL_kg_per_m3) for q in ends)
    speeds = np.linspace(slowest, fastest, _SPEEDS)
    found, refused = [], list[InputError]()
    for i, speed in enumerate(speeds.tolist()):
        progress(f"{speed / KNOT_m_per_s:.0f} kt", i, _SPEEDS)
        with collected(refused):  # no level flight at this speed
            found.append((speed, *_elevator_per(rig, file, speed)))
    if not found:
        other = next((one for one in refused if one.key != f"flight.{UNTRIMMED}"), None)
        if other is not None:
            raise other
        return None
    speed, pressure, per_g, per_knot = np.array(found).T
    rigs = {name: configure(rig, name) for name in FELT}
    pull = {
        name: _forces(changed, pressure, per_g) + _bob_weight(changed, pressure)
        for name, changed in rigs.items()
    }
    slower = {
        name: _forces(changed, pressure, _TRIMS_kt * per_knot) / _TRIMS_kt
        for name, changed in rigs.items()
    }
    return Feel(speed, pressure, pull, slower)


def _forces(rig: Rig, pressure: Floats, commands: Floats) -> Floats:
    """Return the forces beyond breakout and offset, N, for elevator commands, by the statics.

    `commands` are shares of the travel, pull positive; the force of a command beyond the travel is
    extrapolated from that of full travel. NaN if the bend alone moves the surface that far, while
    the loader rests in its breakout.
    """
    control = rig.controls["column"]
    out = []
    for q, command in zip(pressure.tolist(), commands.tolist(), strict=True):
        _, estimate, forces = _pulled(rig, "column", q)
        wanted = min(abs(command) * control.pull, estimate[-1])
        force = np.interp(wanted, estimate, forces, left=np.nan)
        past = (force - control.loader.breakout + control.loader.offset) * command * control.pull
        out.append(past / wanted if wanted > 0.0 else 0.0)
    return np.array(out)


def _bob_weight(rig: Rig, pressure: Floats) -> Floats:
    """Return the bob weight's part of the force of 1 g, N.

    It bends the structure too; if the host corrects the deflection by K̂·F, that moves the elevator
    by K̂·b and reduces the force by G_T·K̂·b.
    """
    control = rig.controls["column"]
    host = control.compensation
    gradient = gradient_at_neutral(control.schedule, pressure)
    spared = bend_loss(host.bend if host.deflection else 0.0, gradient)
    return np.asarray(control.loader.bob_weight * (1.0 - spared))


def _elevator_per(rig: Rig, file: Path, speed: float) -> tuple[float, float, float]:
    """Return q̄ in Pa of a level trim, and the elevator command per g and per knot.

    Both are shares of the travel in the column's sense, pull positive.
    """
    sign = COMMAND_SIGN["elevator"]
    middle = _trimmed(rig, file, speed)
    pressure = middle.motion()[PRESSURE]
    up, down = (
        _load_factors(_trimmed(rig, file, speed), sign * s, rig.frame_rate) for s in (_STEP, -_STEP)
    )
    change = 0.5 * (up - down)
    peak = float(change[np.argmax(np.abs(change))])
    commands, positions = middle.surface_map()
    if positions[-1] < positions[0]:
        commands, positions = commands[::-1], positions[::-1]
    half = 0.5 * _TRIMS_kt * KNOT_m_per_s
    slow, fast = (
        np.interp(_trimmed(rig, file, v).motion()[ELEVATOR], positions, commands)
        for v in (speed - half, speed + half)
    )
    return pressure, _STEP / peak, sign * float(slow - fast) / _TRIMS_kt


def _trimmed(rig: Rig, file: Path, speed: float) -> JSBSimAirframe:
    assert rig.flight is not None
    level = {"calibrated_airspeed_m_per_s": speed, "flight_path_rad": 0.0, **STILL}
    flight = changed(rig.flight, level, file, "flight")
    return make_aircraft(
        flight, 1.0 / rig.frame_rate, list(rig.controls), [aircraft_folder()], file
    )


def _load_factors(airframe: JSBSimAirframe, command: float, rate: float) -> Floats:
    """Return the load factor, frame by frame, while the elevator is held."""
    frames = round(_PULL_s * rate)
    out = np.empty(frames)
    for k in range(frames):
        out[k] = airframe.motion()[LOAD]
        airframe.step((command, 0.0, 0.0))
    return out
