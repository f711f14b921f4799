"""The motion of the airframe's surfaces, from their recorded positions.

Each model has its own map from command to position, found by flying it. If the aircraft itself
moves a surface (a yaw damper, the control laws of an F-16), the position depends on the aircraft's
motion too. The input is then the host's command, flown through the model's laws, and the surface
stage is not judged. Without a command in the record, the surface is led to where it was measured.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from coupled.flight.aircraft import make_aircraft
from coupled.flight.airframe import JSBSimAirframe
from coupled.flight.altered import STILL, UNALTERED
from coupled.gap.noise.smooth import Smoother, smoothed
from coupled.gap.signals.conditions import trim_shift
from coupled.gap.signals.floors import left_noise
from coupled.gap.signals.output import Floats, estimate_noise
from coupled.gap.stages.openloop import Moved, Points, about
from coupled.gap.thresholds import (
    KNOWN,
    MOST,
    SMALL,
    TRIM_SIGMAS,
    BRIEF_s,
    SURFACE_GUST_m_per_s,
)
from coupled.record.channels import (
    CONTROL_NAMES,
    SURFACES,
    VALIDITY,
    ControlName,
    channel,
    motion_channels,
)
from coupled.record.record import Record
from coupled.resources import aircraft_folder
from coupled.rig.parameters import Flight
from coupled.rig.replay import replay_surface
from coupled.rig.rig import Rig
from coupled.rig.serving import service_rows
from coupled.schema import changed


@dataclass(frozen=True)
class Trim:
    """A surface's position in trim, rad: the origin of its motion, and the measurement.

    `error` is the standard error of `measured`; `jump` the surface's offset from the second row on.
    """

    position: float
    measured: float
    error: float
    jump: float = 0.0


def surface_channel(control: ControlName) -> str:
    """Return the channel of the surface that a control moves."""
    return f"{SURFACES[control]}_rad"


def flown_by(rig: Rig) -> tuple[ControlName, ...]:
    """Return the controls whose surfaces drive the model: all if the rig has no control."""
    return tuple(rig.controls) or CONTROL_NAMES


def surface_points(rig: Rig, control: ControlName) -> Points | None:
    """Return commands about trim and the surface positions that the model gives them, rad.

    None if the aircraft's own laws move the surface.
    """
    return _points(*_unaltered(rig), control)


def _unaltered(rig: Rig) -> tuple[str, tuple[ControlName, ...], float]:
    """Return the aircraft of a rig without its alterations (JSON), its controls and frame rate."""
    assert rig.flight is not None
    plain = changed(rig.flight, UNALTERED, rig.name, "flight")
    return plain.model_dump_json(), flown_by(rig), rig.frame_rate


@lru_cache(maxsize=64)
def _points(
    flight: str, controls: tuple[ControlName, ...], rate_Hz: float, control: ControlName
) -> Points | None:
    if _moves_itself(_aircraft(flight, controls, rate_Hz), controls, rate_Hz, control):
        return None
    return _aircraft(flight, controls, rate_Hz).surface_map(surface_channel(control))


def _aircraft(
    flight: str, controls: tuple[ControlName, ...], rate_Hz: float, name: str = "rig"
) -> JSBSimAirframe:
    """Return the aircraft of a flight section in JSON, trimmed."""
    section = Flight.model_validate_json(flight)
    return make_aircraft(section, 1.0 / rate_Hz, controls, [aircraft_folder()], name)


def _moves_itself(
    airframe: JSBSimAirframe, controls: Sequence[ControlName], rate_Hz: float, control: ControlName
) -> bool:
    """Tell whether a surface moves with gusts or other controls.

    Also true if it still moves one frame after its own command, as with an actuator in the model.
    """
    at = motion_channels(controls, flown=True).index(surface_channel(control))
    own, frames = controls.index(control), round(BRIEF_s * rate_Hz)

    def goes(moved: int) -> list[float]:
        """Return the surface position frame by frame while one control is held off neutral."""
        places = []
        for _ in range(frames):
            first, second, third = (SMALL * (i == moved) for i in range(3))
            airframe.step((first, second, third))
            places.append(airframe.motion()[at])
        return places

    still = airframe.motion()[at]
    airframe.set_gust(SURFACE_GUST_m_per_s)
    left_alone = goes(-1) + [place for i in range(len(controls)) if i != own for place in goes(i)]
    led = goes(own)
    moved = [*(place - still for place in left_alone), *(place - led[0] for place in led)]
    return max(map(abs, moved)) > KNOWN


def filed_trim(rig: Rig, control: ControlName) -> float:
    """Return a surface's position in the trim to which `surface_points` refers, rad."""
    flight, controls, rate_Hz = _unaltered(rig)
    return _trim(flight, controls, rate_Hz, rig.name)[controls.index(control)]


def own_trim(rig: Rig, control: ControlName) -> float:
    """Return a surface's position in the trim of the rig's own aircraft, rad."""
    assert rig.flight is not None
    still = changed(rig.flight, STILL, rig.name, "flight")
    controls = flown_by(rig)
    each = _trim(still.model_dump_json(), controls, rig.frame_rate, rig.name)
    return each[controls.index(control)]


@lru_cache(maxsize=64)
def _trim(
    flight: str, controls: tuple[ControlName, ...], rate_Hz: float, name: str
) -> tuple[float, ...]:
    motion = _aircraft(flight, controls, rate_Hz, name).motion()
    every = motion_channels(controls, flown=True)
    return tuple(motion[every.index(surface_channel(control))] for control in controls)


def moved(
    rig: Rig,
    record: Record,
    trims: Mapping[ControlName, Trim],
    rng: np.random.Generator,
) -> tuple[list[Moved], list[Moved]]:
    """Return the motion of the surfaces, and the same with a sample of its error.

    In the order of `flown_by`. `trims` are those of the record; a jump is not smoothed. A control
    without any channel in the record is taken as not moved.
    """
    each = [_moved(rig, record, control, trims.get(control), rng) for control in flown_by(rig)]
    wrong = [
        one if error is None else replace(one, values=one.values + error) for one, error in each
    ]
    return [one for one, _ in each], wrong


def _moved(
    rig: Rig, record: Record, control: ControlName, trim: Trim | None, rng: np.random.Generator
) -> tuple[Moved, Floats | None]:
    """Return the motion of a surface, and a sample of its error, rad; None if it has no error."""
    name, points = surface_channel(control), surface_points(rig, control)
    if is_led(rig, record, control):
        position, gain = record[name], _gain_of(rig, control)
        error = Smoother.of(position).wiener_error(estimate_noise(position), len(position), rng)
        return Moved(name, smoothed(position), gain=gain), error
    if name not in record or points is None:
        return Moved(name, _asked(rig, record, control)), None
    position, filed = record[name], filed_trim(rig, control)
    trim = trim or Trim(filed, filed, 0.0)
    given = (points, trim.measured, filed, TRIM_SIGMAS * trim.error)
    if VALIDITY in record:  # the surface of a live flight is the model's: no noise
        return Moved(name, position, *given), None
    left, estimated = position - _led(rig, record, control, trim.position), estimate_noise(position)
    level = left_noise(estimated, position, left)
    if float(np.std(left)) < MOST * estimated.rms:
        # The command explains its roughness, so that is motion of the surface, not noise.
        error = level.sample(len(position), rng)
        error *= min(1.0, float(np.std(left)) / max(level.rms, 1e-300))
        return Moved(name, position, *given), error
    step = np.where(np.arange(len(position)) > 0, trim.jump, 0.0)
    error = Smoother.of(position - step).wiener_error(level, len(position), rng)
    return Moved(name, smoothed(position - step) + step, *given), error


def is_led(rig: Rig, record: Record, control: ControlName) -> bool:
    """Tell whether a surface that the aircraft's laws move is known by its position alone."""
    by_position = surface_channel(control) in record and channel(control, "estimate") not in record
    return by_position and surface_points(rig, control) is None and _gain_of(rig, control) != 0.0


def _gain_of(rig: Rig, control: ControlName) -> float:
    return _gain(*_unaltered(rig), control)


@lru_cache(maxsize=64)
def _gain(
    flight: str, controls: tuple[ControlName, ...], rate_Hz: float, control: ControlName
) -> float:
    """Return how far a surface goes with its command within a frame, rad; 0 if it goes later."""
    at = controls.index(control)
    surface = motion_channels(controls, flown=True).index(surface_channel(control))

    def place(command: float, frames: int) -> float:
        airframe = _aircraft(flight, controls, rate_Hz)
        first, second, third = (command * (i == at) for i in range(3))
        for _ in range(frames):
            airframe.step((first, second, third))
        return float(airframe.motion()[surface])

    once, twice = (place(SMALL, frames) - place(0.0, frames) for frames in (1, 2))
    return once / SMALL if abs(twice - once) < SMALL * abs(once) else 0.0


def _led(rig: Rig, record: Record, control: ControlName, trim: float) -> Floats:
    """Return the position that the host's command gives a surface with this trim, rad."""
    points = surface_points(rig, control)
    assert points is not None
    held = about(trim, filed_trim(rig, control), points)
    shift = trim_shift(record, control, 1.0 / rig.frame_rate)
    shift = np.concatenate(([0.0], shift[:-1]))
    return np.interp(held + _asked(rig, record, control) + shift, *points)


def _asked(rig: Rig, record: Record, control: ControlName) -> Floats:
    """Return the host's command of a surface; zero if the record has no estimate."""
    pressure = "dynamic_pressure_Pa"
    if channel(control, "estimate") not in record or pressure not in record:
        return np.zeros(len(record))
    asked = replay_surface(rig, control, asked_of(record, control), record[pressure])
    return np.concatenate(([0.0], asked[:-1]))


def asked_of(record: Record, control: ControlName) -> Floats:
    """Return the recorded command of a surface, d: δ̂, or as changed by a jam or the other side."""
    rows = service_rows(record, control)
    return record[channel(control, "estimate")] if rows is None else rows.asked
