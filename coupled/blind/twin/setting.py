"""The setting of a trial: rig, pilot, noise; and the records simulated in it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from coupled.blind.twin.conditions import PLAIN, Conditions, Realism
from coupled.blind.twin.excitation import bench_pressure, pilot_force, pilot_shape
from coupled.blind.twin.kernel import NODES
from coupled.blind.twin.kinds import Clean, Draw, Kind
from coupled.blind.twin.twin import RIG_CHANNELS, LostError, fly_twin, nominal_twin
from coupled.record.channels import LONGITUDINAL
from coupled.record.record import Record
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]

OTHER_FORCE = "wheel_force_N"

# Standard deviation of each channel's white noise on an average rig, and the decimals of its
# logger.
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
    OTHER_FORCE: (0.15, 3),
}
GENTLER = 0.6  # factor on the pilot's force after the aircraft left the envelope
TRIES = 8


SKEW_s = 5e-4  # largest error of a clock: a nuisance parameter, no effect


@dataclass(frozen=True)
class Installed:
    """A kind in a twin: its size, its random numbers, and so its parameters."""

    kind: Kind
    size: float
    draw: Draw


@dataclass(frozen=True)
class Flown:
    """A record as written by a logger, and the parameters of each kind in its rig."""

    record: Record
    parameters: tuple[Mapping[str, float], ...]


@dataclass(frozen=True)
class Other:
    """The force on the wheel, N: on the pilot's nodes, and its noise, shape (frames,)."""

    nodes: Floats
    noise: Floats


@dataclass(frozen=True)
class Setting:
    """A trial without its effects.

    shape      of the pilot's force, in ±1, shape (frames·NODES + 1,)
    pressures  q̄ of a bench, shape (frames,), Pa; None with an aircraft
    noise      shape (frames, channels without time), SI
    other      the force on another control, if recorded
    built      whether its truth is of the rig as built
    """

    rig: Rig
    shape: Floats
    frames: int
    pressures: Floats | None
    noise: Floats
    conditions: Conditions
    other: Other | None = None
    built: bool = False

    def gentler(self) -> Setting:
        """Return the setting with less force."""
        level_N = self.conditions.level_N * GENTLER
        return replace(self, conditions=replace(self.conditions, level_N=level_N))

    @property
    def known(self) -> Rig:
        """The reference rig of the truth: the nominal one, or the one built.

        The latter has properties that the nominal rig lacks, and no effect: its presliding, and the
        delays of its time stamps of force and motion.
        """
        if not self.built:
            return self.rig
        column, late = self.rig.controls["column"], self.conditions
        level_N = max(column.loader.friction, column.loader.breakaway)
        contact = late.bristles
        changes: dict[str, float] = {
            "controls.column.sensing.force_stamp_s": column.sensing.force_stamp + late.force_skew_s
        }
        if level_N > 0.0:
            changes |= {
                "controls.column.loader.friction_stiffness_N_per_m": contact.stiffness(level_N),
                "controls.column.loader.friction_elastic_share": contact.elastic_share,
            }
        if self.rig.flight is not None:
            stamp_s = self.rig.flight.motion_stamp + late.motion_skew_s
            changes["flight.motion_stamp_s"] = stamp_s
        return self.rig.changed(changes)

    def fly(
        self,
        clean: Clean | None = None,
        kinds: Sequence[Installed] = (),
        tolerance: Mapping[str, float] | None = None,
    ) -> Flown:
        """Return the record of a rig with these kinds.

        `clean` is the record of the rig without them, the reference of sizes; `tolerance` are
        factors on the twin's own numbers within their tolerance, which are not effects. Raises
        LostError if the aircraft leaves the envelope.
        """
        twin = nominal_twin(self.rig, self.conditions.bristles)
        twin.set(force_late=self.conditions.force_skew_s)
        twin.air.late_s = self.conditions.motion_skew_s
        twin.others = None if self.other is None else self.other.nodes
        for name, factor in (tolerance or {}).items():
            twin.set(**{name: twin.get(name) * factor})
        found = []
        for put in kinds:
            assert clean is not None
            found.append(put.kind.install(twin, clean, put.size, put.draw))
        nodes = pilot_force(self.rig, self.shape, self.conditions.level_N)
        record = fly_twin(self.rig, twin, nodes, self.frames, self.pressures, self.noise)
        if self.other is not None:
            force = self.other.nodes[: self.frames * NODES : NODES] + self.other.noise
            data = np.column_stack((record.data, force))
            record = Record((*record.channels, OTHER_FORCE), data)
        return Flown(_logged(record), tuple(found))


def with_other(rng: np.random.Generator, setting: Setting) -> Setting:
    """Return the setting with a wheel beside the column: forces at its rim, and their noise."""
    shape, _ = pilot_shape(rng, setting.frames, setting.rig.frame_rate)
    level_N = log_uniform(rng, 10.0, 60.0)
    noise = NOISE[OTHER_FORCE][0] * rng.standard_normal(setting.frames)
    return replace(setting, other=Other(level_N * shape, noise))


def draw_setting(rng: np.random.Generator, rig: Rig, realism: Realism = PLAIN) -> Setting:
    """Return a random setting for a rig: 20 to 60 s of a pilot's force, and noise."""
    frames = round(rng.uniform(20.0, 60.0) * rig.frame_rate)
    shape, shapes = pilot_shape(rng, frames, rig.frame_rate)
    pressures = bench_pressure(rng, rig, frames) if rig.flight is None else None
    reach = (0.1, 0.7) if rig.flight is None else (0.03, 0.25)
    share = log_uniform(rng, *reach)
    column = rig.controls["column"]
    # A force against the gradient in the middle of the table: the order of magnitude.
    gradient = float(np.median(column.schedule.total_gradient))
    level = share * gradient * column.travel
    names = channels(rig)
    common = log_uniform(rng, 0.5, 2.0)
    each = np.exp(rng.uniform(-0.35, 0.35, len(names)))
    factors = np.clip(common * (each if rng.uniform() < 0.5 else 1.0), 0.5, 2.0)
    factors = factors * np.ones(len(names))
    sigma = np.array([NOISE[name][0] for name in names]) * factors
    noise = rng.standard_normal((frames, len(names))) * sigma
    conditions = Conditions(
        duration_s=frames / rig.frame_rate,
        excitation=tuple(shapes),
        level_N=level,
        noise={n: float(s) for n, s in zip(names, sigma, strict=True) if s > 0.0},
    )
    if realism.presliding_m is None:
        conditions = replace(conditions, bristle_J=log_uniform(rng, 3e-7, 1.5e-6))
        return Setting(rig, shape, frames, pressures, noise, conditions)
    conditions = replace(
        conditions,
        presliding_m=log_uniform(rng, *realism.presliding_m),
        elastic_share=float(rng.uniform(0.05, 0.8)),
    )
    if rng.uniform() < realism.coloured_noise:
        corners = {n: log_uniform(rng, *realism.corner_Hz) for n in names if rng.uniform() < 0.5}
        for i, name in enumerate(names):
            if name in corners:
                noise[:, i] = coloured(noise[:, i], corners[name], rig.frame_rate)
        conditions = replace(conditions, corner_Hz=corners)
    if rng.uniform() < realism.skewed_clock:
        late = float(rng.uniform(0.0, SKEW_s))
        of_force = rig.flight is None or rng.uniform() < 0.5
        conditions = replace(
            conditions,
            force_skew_s=late if of_force else 0.0,
            motion_skew_s=0.0 if of_force else late,
        )
    return Setting(rig, shape, frames, pressures, noise, conditions)


def coloured(white: Floats, corner_Hz: float, frame_rate_Hz: float) -> Floats:
    """Return noise of the same standard deviation, with a spectrum that falls beyond a corner.

    A first-order lag, x[k] = a·x[k − 1] + √(1 − a²)·white[k], a = e^(−2π·corner/rate), started in
    its steady state; a is the correlation of neighbours.
    """
    a = float(np.exp(-2.0 * np.pi * corner_Hz / frame_rate_Hz))
    gain = np.sqrt(1.0 - a * a)
    start = [(1.0 - gain) * white[0]] if len(white) else [0.0]
    return np.asarray(lfilter([gain], [1.0, -a], white, zi=start)[0])


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Return a random number between two positive bounds, uniform in its logarithm."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def channels(rig: Rig) -> tuple[str, ...]:
    """Return the channels of a rig's record, without time."""
    return RIG_CHANNELS + (LONGITUDINAL[1:] if rig.flight is not None else ())


def fly_clean(setting: Setting) -> tuple[Setting, Clean] | None:
    """Return the setting, with a force that keeps the aircraft in its envelope, and its record."""
    for _ in range(TRIES):
        try:
            record = setting.fly().record
        except LostError:
            setting = setting.gentler()
            continue
        return setting, Clean(setting.rig, record, setting.conditions.bristles)
    return None


def _logged(record: Record) -> Record:
    """Return the record rounded to the decimals of its logger."""
    data = record.data.copy()
    for i, decimals in enumerate(_decimals(record)):
        data[:, i] = np.round(data[:, i], decimals)
    return Record(record.channels, data)


def _decimals(record: Record) -> list[int]:
    return [NOISE[name][1] if name in NOISE else 6 for name in record.channels]


def csv_text(record: Record) -> str:
    """Return a record as a logger's CSV."""
    line = ",".join(f"%.{n}f" for n in _decimals(record))
    rows = [line % tuple(row) for row in record.data.tolist()]
    return "\n".join([",".join(record.channels), *rows]) + "\n"
