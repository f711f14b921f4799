"""The setting of a trial: rig, pilot, noise; and the records flown in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.blind.twin.excitation import bench_pressure, pilot_force, pilot_shape
from coupled.blind.twin.kinds import Clean, Draw, Kind
from coupled.blind.twin.twin import RIG_CHANNELS, LostError, fly_twin, nominal_twin
from coupled.record.channels import LONGITUDINAL
from coupled.record.record import Record
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]

# Standard deviation of each channel's white noise on a rig of middling care, and the digits
# after the point that its logger writes.
NOISE = {
    "column_force_N": (0.15, 3),
    "column_computed_m": (2e-5, 7),
    "column_deflection_m": (4e-5, 7),
    "column_estimate_m": (0.0, 7),
    "column_gradient_N_per_m": (0.0, 3),
    "column_modifying_force_N": (0.05, 3),
    "dynamic_pressure_Pa": (1.0, 2),
    "load_factor": (4e-3, 5),
    "elevator_rad": (1.5e-4, 6),
    "pitch_rate_rad_per_s": (2e-4, 6),
    "alpha_rad": (4e-4, 6),
    "pitch_rad": (2e-4, 6),
    "true_airspeed_m_per_s": (0.05, 4),
    "altitude_m": (0.2, 3),
}
GENTLER = 0.6  # factor on the pilot's force after an aircraft is lost
TRIES = 8


@dataclass(frozen=True)
class Conditions:
    """What a record was made with, as its key says it.

    level_N    of the pilot's force
    noise      standard deviation of each channel's noise, SI
    bristle_J  friction times the bristles' length: what a reversal gives back
    """

    duration_s: float
    excitation: tuple[str, ...]
    level_N: float
    noise: Mapping[str, float]
    bristle_J: float

    def as_dict(self) -> dict[str, Any]:
        """Return the conditions as the key has them."""
        return {
            "duration_s": self.duration_s,
            "excitation": list(self.excitation),
            "level_N": self.level_N,
            "noise": dict(self.noise),
            "bristle_J": self.bristle_J,
        }


@dataclass(frozen=True)
class Installed:
    """A kind put into a twin: its size, what was drawn for it, and so its parameters."""

    kind: Kind
    size: float
    draw: Draw


@dataclass(frozen=True)
class Flown:
    """A record as a logger writes it, and the parameters of each kind put into its rig."""

    record: Record
    parameters: tuple[Mapping[str, float], ...]


@dataclass(frozen=True)
class Setting:
    """All of a trial but what is wrong with its rig.

    shape      of the pilot's force, in ±1, shape (frames·NODES + 1,)
    pressures  q̄ of a bench, shape (frames,), Pa; None where the rig flies
    noise      shape (frames, channels without time), SI
    """

    rig: Rig
    shape: Floats
    frames: int
    pressures: Floats | None
    noise: Floats
    conditions: Conditions

    def gentler(self) -> Setting:
        """Return the setting with less force."""
        level_N = self.conditions.level_N * GENTLER
        return replace(self, conditions=replace(self.conditions, level_N=level_N))

    def fly(
        self,
        clean: Clean | None = None,
        kinds: Sequence[Installed] = (),
        tolerance: Mapping[str, float] | None = None,
    ) -> Flown:
        """Return the record of a rig that has these kinds.

        `clean` is the record of the rig without any, which sizes are held against; `tolerance`
        are factors on the twin's own numbers within their setting, which is no effect. Raises
        LostError where the aircraft leaves the envelope.
        """
        twin = nominal_twin(self.rig, self.conditions.bristle_J)
        for name, factor in (tolerance or {}).items():
            twin.set(**{name: twin.get(name) * factor})
        found = []
        for put in kinds:
            assert clean is not None
            found.append(put.kind.install(twin, clean, put.size, put.draw))
        nodes = pilot_force(self.rig, self.shape, self.conditions.level_N)
        record = fly_twin(self.rig, twin, nodes, self.frames, self.pressures, self.noise)
        return Flown(_logged(record), tuple(found))


def draw_setting(rng: np.random.Generator, rig: Rig) -> Setting:
    """Return a setting drawn for a rig: 20 to 60 s of a pilot's work, and noise."""
    frames = round(rng.uniform(20.0, 60.0) * rig.frame_rate)
    shape, shapes = pilot_shape(rng, frames, rig.frame_rate)
    pressures = bench_pressure(rng, rig, frames) if rig.flight is None else None
    reach = (0.1, 0.7) if rig.flight is None else (0.03, 0.25)
    share = float(np.exp(rng.uniform(*np.log(reach))))
    column = rig.controls["column"]
    # A pull goes against the gradient in the middle of the table: the scale of force, no more.
    gradient = float(np.median(column.schedule.total_gradient))
    level = share * gradient * column.travel
    names = channels(rig)
    common = float(np.exp(rng.uniform(np.log(0.5), np.log(2.0))))
    each = np.exp(rng.uniform(-0.35, 0.35, len(names)))
    factors = np.clip(common * (each if rng.uniform() < 0.5 else 1.0), 0.5, 2.0)
    factors = factors * np.ones(len(names))
    sigma = np.array([NOISE[name][0] for name in names]) * factors
    noise = rng.standard_normal((frames, len(names))) * sigma
    bristle = float(np.exp(rng.uniform(np.log(3e-7), np.log(1.5e-6))))
    conditions = Conditions(
        duration_s=frames / rig.frame_rate,
        excitation=tuple(shapes),
        level_N=level,
        noise={n: float(s) for n, s in zip(names, sigma, strict=True) if s > 0.0},
        bristle_J=bristle,
    )
    return Setting(rig, shape, frames, pressures, noise, conditions)


def channels(rig: Rig) -> tuple[str, ...]:
    """Return the channels of a rig's record, without time."""
    return RIG_CHANNELS + (LONGITUDINAL[1:] if rig.flight is not None else ())


def fly_clean(setting: Setting) -> tuple[Setting, Clean] | None:
    """Return the setting, gentle enough for the aircraft to stay, and its clean record."""
    for _ in range(TRIES):
        try:
            record = setting.fly().record
        except LostError:
            setting = setting.gentler()
            continue
        return setting, Clean(setting.rig, record, setting.conditions.bristle_J)
    return None


def _logged(record: Record) -> Record:
    """Return the record rounded to the digits that the logger writes."""
    data = record.data.copy()
    for i, name in enumerate(record.channels):
        data[:, i] = np.round(data[:, i], NOISE[name][1] if name in NOISE else 6)
    return Record(record.channels, data)


def csv_text(record: Record) -> str:
    """Return a record as a logger's CSV."""
    digits = [NOISE[name][1] if name in NOISE else 6 for name in record.channels]
    line = ",".join(f"%.{n}f" for n in digits)
    rows = [line % tuple(row) for row in record.data.tolist()]
    return "\n".join([",".join(record.channels), *rows]) + "\n"
