"""The setting of a trial: rig, pilot, noise; and the records flown in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.blind.twin.excitation import pilot_force, pilot_shape, told_pressure
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
class Setting:
    """All of a trial but what is wrong with its rig; `about` is what its key says of it."""

    rig: Rig
    shape: Floats
    level_N: float
    frames: int
    told: Floats | None
    noise: Floats
    bristle_J: float
    about: Mapping[str, Any]

    def gentler(self) -> Setting:
        """Return the setting with less force."""
        return replace(self, level_N=self.level_N * GENTLER)

    def fly(
        self,
        clean: Clean | None = None,
        kinds: Sequence[tuple[Kind, float, Draw]] = (),
        off: Mapping[str, float] | None = None,
    ) -> tuple[Record, list[dict[str, float]]]:
        """Return the record as a logger writes it, and the parameters of the kinds put in.

        `kinds` are put in with their sizes; `off` are factors on the twin's own numbers, which
        are a setting's tolerance and no effect. Raises LostError where the aircraft is.
        """
        twin = nominal_twin(self.rig, self.bristle_J)
        for name, factor in (off or {}).items():
            twin.set(**{name: twin.get(name) * factor})
        found = []
        for kind, size, draw in kinds:
            assert clean is not None
            found.append(kind.install(twin, clean, size, draw))
        nodes = pilot_force(self.rig, self.shape, self.level_N)
        record = fly_twin(self.rig, twin, nodes, self.frames, self.told, self.noise)
        return _logged(record), found


def draw_setting(rng: np.random.Generator, rig: Rig) -> Setting:
    """Return a setting drawn for a rig: 20 to 60 s of a pilot's work, and noise."""
    frames = round(rng.uniform(20.0, 60.0) * rig.frame_rate)
    shape, shapes = pilot_shape(rng, frames, rig.frame_rate)
    told = told_pressure(rng, rig, frames) if rig.flight is None else None
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
    about = {
        "duration_s": frames / rig.frame_rate,
        "excitation": shapes,
        "bristle_J": bristle,
        "noise": {n: float(s) for n, s in zip(names, sigma, strict=True) if s > 0.0},
    }
    return Setting(rig, shape, level, frames, told, noise, bristle, about)


def channels(rig: Rig) -> tuple[str, ...]:
    """Return the channels of a rig's record, without time."""
    return RIG_CHANNELS + (LONGITUDINAL[1:] if rig.flight is not None else ())


def fly_clean(setting: Setting) -> tuple[Setting, Clean] | None:
    """Return the setting, gentle enough for the aircraft to stay, and its clean record."""
    for _ in range(TRIES):
        try:
            record, _ = setting.fly()
        except LostError:
            setting = setting.gentler()
            continue
        return setting, Clean(setting.rig, record, setting.bristle_J)
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
