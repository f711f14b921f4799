"""A simulated bench: a person with ruler, spring scale and voltmeter at a simulated rig.

The rig is the one that flies, stage by stage. The hand holds a force with random variations. The
person reads one instrument after the other, each with its error and rounding: ruler, scale, v₁, v₃,
and then scale and ruler again, so that linear drift cancels. The hand pulls past the target and
eases back, so that friction holds the control still; otherwise the variations of the hand would
move it outward between the readings.

The null for S₂ is simulated as well: the force of a held control is noted without the multiplier;
then, hands off, a supply in place of v₂ is turned until v₁ is back. Every other null is approached
from beyond, with supply and hand alike: friction then keeps the hand's smallest force instead of
its largest, and the mean of both sides is free of this error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from coupled.calibration.assumedscales import real_scales
from coupled.calibration.estimate import Instruments
from coupled.calibration.plan import FULL_TRAVEL, STRONGEST_N, Station
from coupled.calibration.readings import Readings, readings_of
from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig
from coupled.rig.standalone import nodes_of, run_control, smooth, under_supply

Floats = NDArray[np.float64]
PULL_s = 0.3  # time of the hand to its next force
SLOW_s = 2.0  # the same where friction must not matter
GLANCE_s = 0.6  # from one instrument to the next
WANDER_s = 0.2  # correlation time of the hand's variations
PAST = 5.0  # standard deviations of the hand by which it pulls past the target
BEYOND = 0.1  # of the force, plus an allowance for friction, for a null from beyond
ALLOWANCE = 3.0  # times the friction; with 2 the control returns too far
TURNS = 40  # largest number of settings of the supply
MOST_VOLTS = 1e4
NULLS = 6


@dataclass(frozen=True)
class CalibrationBench:
    """A rig on the bench, without its converters, and the plan of its readings.

    `again`: ruler and scale are read a second time, after the voltmeter. `crossed`: {another
    control: the force held on it in N at each station}.
    """

    rig: Rig
    control: ControlName
    stations: Sequence[Station]
    instruments: Instruments
    nulls: int = NULLS
    again: bool = True
    crossed: Mapping[ControlName, Sequence[float]] = field(default_factory=dict)


def take_readings(bench: CalibrationBench, seed: int) -> Readings:
    """Return the readings of one simulated bench session, reproducible by its seed."""
    rng = np.random.default_rng(seed)
    rig, control = _without_converters(bench.rig, bench.control), bench.control
    pressures = np.array([station.pressure_Pa for station in bench.stations])
    forces = np.array([station.force for station in bench.stations])
    scales = real_scales(bench.rig.controls[control])
    tools = bench.instruments
    read = _hold(rig, bench, forces, (1.0 + PAST * tools.hand) * forces, pressures, rng)
    others = _bend_by_others(bench, read, rng)
    count, labels = len(forces), tuple(station.label for station in bench.stations)
    deflection = _reading(read[0], tools.ruler, tools.ruler_step, rng)
    force = _reading(read[1], tools.scale, tools.scale_step, rng)
    v1 = _reading(scales.s1 * read[2], tools.meter, tools.meter_step, rng)
    v3 = _reading(scales.s3 * read[3], tools.meter, tools.meter_step, rng)
    rise = np.full((2, count), np.nan)
    if bench.again:
        force_again = _reading(read[4], tools.scale, tools.scale_step, rng)
        rise[0] = _reading(read[5], tools.ruler, tools.ruler_step, rng) - deflection
        rise[1] = force_again - force
        deflection, force = deflection + 0.5 * rise[0], force + 0.5 * rise[1]
    null = _null(rig, bench, rng)
    columns = np.stack((deflection, force, v1, v3, *rise))
    null_rows = range(count + 2, count + 2 + null.shape[1])
    return readings_of(range(2, count + 2), labels, columns, null_rows, null, others)


def _bend_by_others(
    bench: CalibrationBench, read: Floats, rng: np.random.Generator
) -> dict[str, Floats]:
    """Add the bend by other hands' forces to both readings of δ; return readings of these forces.

    The other hands vary as well; their scales are read together with the first scale.
    """
    tools, structure = bench.instruments, bench.rig.structure
    found = {}
    for name, forces in bench.crossed.items():
        held = np.array(forces, dtype=float)
        row = structure.between([bench.control, name])[0, 1]
        wandered = held * (1.0 + tools.hand * rng.standard_normal((3, len(held))))
        read[0] += row * wandered[0]
        read[5] += row * wandered[2]
        found[str(name)] = _reading(wandered[1], tools.scale, tools.scale_step, rng)
    return found


def _without_converters(rig: Rig, control: ControlName) -> Rig:
    """Return the rig without converters, so that v₁ and v₃ are read by a voltmeter."""
    return rig.changed({f"controls.{control}.sensing.word_length_bits": 0})


def _settling_s(rig: Rig, control: ControlName, precise: bool) -> float:
    """Return the settling time of the control at its softest gradient, s."""
    loader = rig.controls[control].loader
    table = rig.controls[control].schedule
    softest = min(loader.basic_gradient, *(min(segment) for segment in table.segments))
    half = 0.5 * loader.damping / loader.mass
    root = half**2 - softest / loader.mass
    slowest = half - math.sqrt(root) if root > 0.0 else half
    return min(max((24.0 if precise else 9.0) / max(slowest, 1e-3), 0.5), 60.0)


def _hold(
    rig: Rig,
    bench: CalibrationBench,
    forces: Floats,
    peaks: Floats,
    pressures: Floats,
    rng: np.random.Generator,
    pull_s: float = PULL_s,
) -> Floats:
    """Return δ, F, δc, F, F and δ at the times of their readings, shape (6, readings).

    Each force is approached from a peak beyond it.
    """
    settle = _settling_s(rig, bench.control, bench.instruments.hand == 0.0)
    rate = rig.frame_rate
    each = math.ceil((2.0 * pull_s + settle + 5.0 * GLANCE_s) * rate) + 2
    frames = each * len(forces)
    before = np.concatenate(([0.0], forces[:-1]))
    pull = smooth(np.arange(each) / (pull_s * rate))
    ease = smooth(np.arange(each) / (pull_s * rate) - 1.0)
    held = np.repeat(before, each) + np.outer(peaks - before, pull).ravel()
    held += np.outer(forces - peaks, ease).ravel()
    if bench.instruments.hand > 0.0:
        held = held * (1.0 + bench.instruments.hand * _wander(frames, rate, rng))
    ends = np.append(np.arange(frames), frames) / rate
    nodes = np.interp(nodes_of(rig, frames), ends, np.append(held, held[-1]))
    response = run_control(rig, bench.control, nodes, np.repeat(pressures, each))
    first = np.arange(len(forces)) * each + math.ceil((2.0 * pull_s + settle) * rate)
    looks = [first + round(i * GLANCE_s * rate) for i in range(6)]
    deflection, force = response.deflection, response.hand_force
    computed = response.computed / rig.controls[bench.control].sensing.read_scale
    seen = (deflection, force, computed, force, force, deflection)
    return np.stack([signal[at] for signal, at in zip(seen, looks, strict=True)])


def _wander(frames: int, rate: float, rng: np.random.Generator) -> Floats:
    """Return an Ornstein-Uhlenbeck process of unit variance."""
    memory = math.exp(-1.0 / (WANDER_s * rate))
    pushes = rng.standard_normal(frames)
    pushes[1:] *= math.sqrt(1.0 - memory**2)
    return np.asarray(lfilter([1.0], [1.0, -memory], pushes))


def _reading(true: Floats, error: float, step: float, rng: np.random.Generator) -> Floats:
    """Return readings of true values: with the instrument's error, rounded to its step."""
    seen = true + error * rng.standard_normal(np.shape(true))
    return np.asarray(step * np.round(seen / step) if step > 0.0 else seen)


def _null(rig: Rig, bench: CalibrationBench, rng: np.random.Generator) -> Floats:
    """Return v₁ as noted, v₂ that restored it, v₃ as noted and the side, shape (4, nulls).

    A null with a voltage below the voltmeter's error is left out.
    """
    control = bench.control
    loader = rig.controls[control].loader
    if bench.nulls == 0 or loader.basic_gradient <= 0.0:
        return np.empty((4, 0))
    plain = _without_multiplier(rig, control)
    allowance = ALLOWANCE * max(loader.friction, loader.breakaway)
    forces, sides = _null_forces(rig, bench, allowance)
    # From rest each time, and slowly, like the supply: then friction is the same in both.
    held = np.hstack(
        [
            _hold(plain, bench, force, _peaks(force, side, allowance), np.zeros(1), rng, SLOW_s)
            for force, side in zip(forces[:, None], sides, strict=True)
        ]
    )
    scales, tools = real_scales(bench.rig.controls[control]), bench.instruments
    v1 = _reading(scales.s1 * held[2], tools.meter, tools.meter_step, rng)
    v3 = _reading(scales.s3 * held[3], tools.meter, tools.meter_step, rng)
    rests_at = under_supply(plain, control, SLOW_s, _settling_s(plain, control, tools.hand == 0.0))

    def shown(v2: float, side: float) -> float:
        supply = np.array(v2 / scales.s2)
        rest = rests_at(float(_peaks(supply, side, allowance)), float(supply))
        return float(_reading(np.array(scales.s1 * rest), tools.meter, tools.meter_step, rng))

    # A loader held by friction or breakout shows 0 V: there is nothing to restore.
    least = tools.meter + tools.meter_step
    moved = v1 > least
    v2 = [
        _adjust_supply(partial(shown, side=side), wanted, tools)
        for side, wanted in zip(sides[moved], v1[moved], strict=True)
    ]
    # The supply's setting is read as well.
    turned = _reading(np.array(v2), tools.meter, tools.meter_step, rng)
    found = np.stack((v1[moved], turned, v3[moved], sides[moved]))
    return found[:, (np.abs(found[1:3]) > least).all(axis=0)]


def _peaks(force: Floats, side: float, allowance: float) -> Floats:
    """Return the peak force, N, before a force that is approached from a side.

    The way is as long outward as inward, so that the hand varies for the same time on both.
    """
    return (1.0 - BEYOND * side) * force + (allowance if side < 0.0 else 0.0)


def _null_forces(rig: Rig, bench: CalibrationBench, allowance: float) -> tuple[Floats, Floats]:
    """Return the forces of the nulls in N and the sides, −1 for every other one."""
    data = rig.controls[bench.control]
    loader = data.loader
    room = min(STRONGEST_N, loader.breakout + loader.basic_gradient * FULL_TRAVEL * data.travel)
    side = np.where(np.arange(bench.nulls) % 2 == 0, 1.0, -1.0)
    most = np.where(side > 0.0, room, (room - allowance) / (1.0 + BEYOND))
    if np.min(most) <= loader.breakout:  # no room beyond
        side, most = np.ones(bench.nulls), np.full(bench.nulls, room)
    return np.linspace(0.5, 1.0, bench.nulls) * most, side


def _without_multiplier(rig: Rig, control: ControlName) -> Rig:
    """Return the rig with v₂ = 0: its total gradient is the basic gradient assumed by the host."""
    data, place, d = rig.controls[control], f"controls.{control}", unit_of(control)
    return rig.changed(
        {
            f"{place}.schedule.total_gradient_N_per_{d}": [data.assumed_basic_gradient]
            * len(data.schedule.dynamic_pressure),
            f"{place}.schedule.second_gradient_N_per_{d}": None,
            f"{place}.schedule.break_deflection_{d}": 0.0,
            f"{place}.schedule.deflection_{d}": None,
            f"{place}.schedule.force_N": None,
            f"{place}.compensation.gradient": False,
        }
    )


def _adjust_supply(shown: Callable[[float], float], wanted: float, tools: Instruments) -> float:
    """Return the supply's voltage at which the meter shows v₁ as wanted, as a person finds it.

    The voltage is raised beyond the target, then interpolated between two settings, or bisected if
    interpolation does not help (within a breakout, or at a stop).
    """
    near = max(tools.meter + tools.meter_step, 1e-13 * wanted)
    low, high = (0.0, shown(0.0)), (wanted, shown(wanted))
    while high[1] < wanted and high[0] < MOST_VOLTS:
        low, high = high, (2.0 * high[0], shown(2.0 * high[0]))
    setting = high[0]
    for turn in range(TURNS):
        span, rise = high[0] - low[0], high[1] - low[1]
        share = (wanted - low[1]) / rise if rise > 0.0 and turn % 3 < 2 else 0.5
        setting = low[0] + min(max(share, 0.0), 1.0) * span
        sees = shown(setting)
        if abs(sees - wanted) <= near:
            break
        low, high = ((setting, sees), high) if sees < wanted else (low, (setting, sees))
    return setting
