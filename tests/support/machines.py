"""Substitutes for measured machines: simulated by SciPy, with other laws and integrators.

None of them uses a stage of the package; each is simulated far
finer than it is recorded. Records are in the channels of a column; forces in N, deflections in m.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import expm
from scipy.signal import lfilter

from coupled.record.record import Record
from coupled.rig.rig import Rig
from tests.support.rigs import BENCH, bench

Floats = NDArray[np.float64]
Signal = Callable[[Floats], Floats]
MASS_kg, DAMPING, STIFFNESS, CUBIC = 1.0, 3.0, 4000.0, 4.0e6  # of the oscillator: 10 Hz, ζ 0.024


def plain_rig(frame_rate_Hz: float, changes: Mapping[str, float], gradient: float = 0.0) -> Rig:
    """Return a bench whose column is a mass with damping, with `changes`."""
    schedule = "controls.column.schedule.total_gradient_N_per_m"
    host = "controls.column.compensation."
    given = {"basic_gradient_N_per_m": gradient, "bend_m_per_N": 0.0} | dict(changes)
    still = {host + "deflection": False, host + "gradient": False, host + "bend_m_per_N": 0.0}
    table = {**BENCH, "frame_rate_Hz": frame_rate_Hz}
    level = {schedule: [gradient, gradient], "controls.column.travel_m": 1.0, LENGTH: 2.0}
    return bench({**given, **still, **level}, table)


LENGTH = "controls.column.length_m"


def recorded(rate_Hz: float, **channels: Floats) -> Record:
    """Return a record of channels of a column, named without `column_`."""
    frames = len(next(iter(channels.values())))
    names = ("time_s", *(f"column_{name}" for name in channels))
    return Record(names, np.column_stack((np.arange(frames) / rate_Hz, *channels.values())))


def broadband(rate_Hz: float, seconds: float, to_Hz: float, rng: np.random.Generator) -> Signal:
    """Return a force of unit RMS with a flat spectrum up to `to_Hz` and random phases."""
    lines_Hz = np.arange(1, int(to_Hz * seconds)) / seconds
    phases = rng.uniform(0.0, 2.0 * np.pi, len(lines_Hz))
    times = np.arange(round(8 * rate_Hz * (seconds + 1.0))) / (8 * rate_Hz)
    fine = sum(np.cos(2 * np.pi * f * times + p) for f, p in zip(lines_Hz, phases, strict=True))
    curve = CubicSpline(times, fine / np.std(fine))
    return lambda t: np.asarray(curve(t))


def duffing(
    rate_Hz: float = 100.0,
    seconds: float = 20.0,
    force_N: float = 12.0,
    to_Hz: float = 30.0,
    noise: tuple[float, float] = (0.0, 2e-6),
    seed: int = 1,
    cubic: float = CUBIC,
) -> Record:
    """Return a record of a mass on a cubic spring under a broadband force.

    m·x'' + c·x' + k·x + k₃·x³ = F; `noise` is added to F in N and to x in m.
    """
    rng = np.random.default_rng(seed)
    shape = broadband(rate_Hz, seconds, to_Hz, rng)
    times = np.arange(round(seconds * rate_Hz)) / rate_Hz

    def rates(t: float, y: Floats) -> tuple[float, float]:
        pull = force_N * float(shape(np.asarray(t))) * min(t, 1.0)
        return y[1], (pull - DAMPING * y[1] - STIFFNESS * y[0] - cubic * y[0] ** 3) / MASS_kg

    way = solve_ivp(rates, (0.0, times[-1]), (0.0, 0.0), "DOP853", times, rtol=1e-8, atol=1e-10)
    pull = force_N * shape(times) * np.minimum(times, 1.0)
    hiss = rng.normal(size=(2, len(times)))
    return recorded(
        rate_Hz, force_N=pull + noise[0] * hiss[0], computed_m=way.y[0] + noise[1] * hiss[1]
    )


def duffing_rig(rate_Hz: float = 100.0, damping: float = DAMPING, cubic: float = CUBIC) -> Rig:
    """Return the rig of that oscillator."""
    numbers = {"mass_kg": MASS_kg, "damping_N_s_per_m": damping, "cubic_N_per_m3": cubic}
    return plain_rig(rate_Hz, numbers, STIFFNESS)


def set_points(rate_Hz: float, seconds: float, seed: int, every: int = 1) -> Floats:
    """Return a servo's set points in m: sines of some periods and holds, new each `every` rows."""
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * rate_Hz)) // every * every / rate_Hz
    wave = np.zeros_like(times)
    for size, at_Hz in ((0.1, 0.11), (0.06, 0.37), (0.03, 0.9), (0.015, 1.7)):
        wave += size * np.sin(2.0 * np.pi * at_Hz * times + rng.uniform(0.0, 6.0))
    return np.asarray((wave - wave[0]) * np.clip(times, 0.0, 1.0))


def servo(
    commands: Floats,
    rate_Hz: float = 50.0,
    frequency_Hz: float = 6.0,
    damping_ratio: float = 0.8,
    delay_s: float = 0.06,
    play_m: float = 0.02,
    count_m: float = 1.5e-3,
    most_m_per_s2: float = math.inf,
) -> Record:
    """Return a record of a servo that holds set points, with dead time, play and an encoder.

    Its motor accelerates by no more than `most_m_per_s2`.

    Runge and Kutta's fourth order at 4 kHz; the play is a dead zone that the output sits in.
    """
    fine, way, speed, out = 4000.0, 0.0, 0.0, 0.0
    steps, omega = round(fine / rate_Hz), 2.0 * np.pi * frequency_Hz
    late = round(delay_s * fine)
    wanted = np.concatenate((np.full(late, commands[0]), np.repeat(commands, steps)))
    read, h = np.empty(len(commands)), 1.0 / fine

    def pull(x: float, v: float, u: float) -> float:
        wanted = float(omega * omega * (u - x) - 2.0 * damping_ratio * omega * v)
        return min(max(wanted, -most_m_per_s2), most_m_per_s2)

    for k, u in enumerate(wanted[: len(commands) * steps].tolist()):
        if k % steps == 0:
            read[k // steps] = out
        a1 = pull(way, speed, u)
        a2 = pull(way + 0.5 * h * speed, speed + 0.5 * h * a1, u)
        v2 = speed + 0.5 * h * a1
        a3 = pull(way + 0.5 * h * v2, speed + 0.5 * h * a2, u)
        v3 = speed + 0.5 * h * a2
        a4 = pull(way + h * v3, speed + h * a3, u)
        way += h * (speed + 2.0 * v2 + 2.0 * v3 + speed + h * a3) / 6.0
        speed += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        out = min(max(out, way - 0.5 * play_m), way + 0.5 * play_m)
    counted = count_m * np.round(read / count_m) if count_m else read
    return recorded(rate_Hz, computed_m=commands, deflection_m=counted)


def servo_rig(rate_Hz: float = 50.0, frequency_Hz: float = 6.0, drive: str = "setpoint") -> Rig:
    """Return the rig of that servo, without dead time and play."""
    numbers = {"servo_frequency_Hz": frequency_Hz, "servo_damping_ratio": 0.8}
    rig = plain_rig(rate_Hz, numbers)
    return rig.changed({"controls.column.drive": drive})


def damper(
    rate_Hz: float = 100.0,
    seconds: float = 20.0,
    damping: float = 2000.0,
    play_m: float = 1.5e-3,
    offset_N: float = 0.0,
    noise: tuple[float, float] = (1.0, 2e-6),
    grip: bool = False,
    stiffness: float = 1e7,
) -> Record:
    """Return a record of a damper on a bench that imposes its motion, with play in its joints.

    The joints are a dead zone with an elastic end of a `stiffness` in N/m, which the piston
    follows: Euler's steps at 20 kHz. `noise` is added to F in N and to the motion in m.
    """
    fine, piston = 20_000.0, 0.0
    steps = round(fine / rate_Hz)
    times = np.arange(round(seconds * fine)) / fine
    way = 0.02 * np.sin(2.0 * np.pi * 0.7 * times) + 0.008 * np.sin(2.0 * np.pi * 1.9 * times)
    way *= np.clip(times, 0.0, 1.0)
    force = np.empty(len(times[::steps]))
    for k, at in enumerate(way.tolist()):
        stretched = at - piston
        touching = max(abs(stretched) - 0.5 * play_m, 0.0)
        pull = stiffness * touching * (1.0 if stretched > 0.0 else -1.0)
        if k % steps == 0:
            force[k // steps] = pull
        piston += pull / damping / fine
    hiss = np.random.default_rng(4).normal(size=(2, len(force)))
    imposed = way[::steps] + noise[1] * hiss[1]
    channels = {"force_N": force + offset_N + noise[0] * hiss[0]}
    return recorded(rate_Hz, **channels, **{"deflection_m" if grip else "computed_m": imposed})


def damper_rig(damping: float = 2000.0, drive: str = "displacement") -> Rig:
    """Return the rig of that damper, without play and nearly without mass."""
    rig = plain_rig(100.0, {"mass_kg": 0.01, "damping_N_s_per_m": damping})
    return rig.changed({"controls.column.drive": drive})


def soft_damper(yields_m: float, friction_N: float = 600.0, rate_Hz: float = 100.0) -> Record:
    """Return a record of a damper with a soft spring and friction that yields, in imposed motion.

    900 N·s/m and 1500 N/m. The friction is a Bouc-Wen law with n = 1 and β = γ: along a way s it
    goes to its limit as exp(−s/yields), and back to zero linearly, as −s/yields.
    """
    fine, seconds = 20, 12.0
    times = np.arange(round(seconds * rate_Hz) * fine) / (fine * rate_Hz)
    lines = ((8e-3, 0.6, 0.4), (5e-3, 1.3, 2.0), (2e-3, 2.5, 5.0))
    way = np.sum([a * np.sin(2.0 * np.pi * f * times + phase) for a, f, phase in lines], axis=0)
    speed, dry, bent = np.gradient(way, times), np.zeros(len(times)), 0.0
    for k, moved in enumerate(np.diff(way).tolist(), 1):
        limit = 1.0 if moved > 0.0 else -1.0
        back = min(abs(moved), yields_m * max(-limit * bent, 0.0))
        bent += limit * back / yields_m
        bent = limit - (limit - bent) * float(np.exp((back - abs(moved)) / yields_m))
        dry[k] = bent
    force = 900.0 * speed + 1500.0 * way + friction_N * dry
    hiss = np.random.default_rng(6).normal(size=(2, len(times[::fine])))
    read = {"force_N": force[::fine] + 2.0 * hiss[0], "deflection_m": way[::fine] + 4e-6 * hiss[1]}
    return recorded(rate_Hz, **read)


def soft_damper_rig() -> Rig:
    """Return the rig of that damper, without friction."""
    numbers = {"mass_kg": 1e-3, "damping_N_s_per_m": 900.0, "servo_frequency_Hz": 0.0}
    rig = plain_rig(100.0, numbers, 1500.0)
    return rig.changed({"controls.column.drive": "displacement"})


def axis(
    rate_Hz: float = 25.0,
    seconds: float = 60.0,
    friction_N: float = 20.0,
    noise: tuple[float, float] = (0.3, 2e-6),
    seed: int = 3,
) -> Record:
    """Return a record of a slide without a spring, positioned by a controller, with LuGre friction.

    95 kg and 200 N·s/m; bristles of 1e6 N/m; Euler's steps at 20 kHz. The force is its motor's.
    """
    fine, mass, damping, bristles, creep = 20_000.0, 95.0, 200.0, 1e6, 1e3
    way = speed = bent = 0.0
    steps, rng = round(fine / rate_Hz), np.random.default_rng(seed)
    frames = round(seconds * rate_Hz)
    times = np.arange(frames * steps) / fine
    wanted = 0.1 * np.sin(0.9 * times) + 0.05 * np.sin(2.3 * times + 1.0) - 0.05 * np.sin(1.0)
    read = np.empty((2, frames))
    for k, at in enumerate(wanted.tolist()):
        force = 9000.0 * (at - way) - 1200.0 * speed
        if k % steps == 0:
            read[:, k // steps] = force, way
        slip = speed - bristles * abs(speed) / max(friction_N, 1e-9) * bent
        bent += slip / fine
        rubbing = bristles * bent + creep * slip if friction_N else 0.0
        speed += (force - damping * speed - rubbing) / mass / fine
        way += speed / fine
    read += np.array(noise)[:, None] * rng.normal(size=read.shape)
    still = np.zeros(frames)
    return recorded(rate_Hz, force_N=read[0], computed_m=read[1], gradient_N_per_m=still)


def axis_rig(rate_Hz: float = 25.0, friction_N: float = 0.0) -> Rig:
    """Return the rig of that slide."""
    numbers = {"mass_kg": 95.0, "damping_N_s_per_m": 200.0, "friction_N": friction_N}
    return plain_rig(rate_Hz, numbers)


def sprung(
    friction: Signal,
    rate_Hz: float = 100.0,
    seconds: float = 40.0,
    noise: tuple[float, float] = (0.05, 5e-6),
    seed: int = 5,
) -> Record:
    """Return a record of a mass on a spring with a dry `friction` that depends on time.

    2 kg, 40 N·s/m and 1000 N/m; Friction is tanh of the speed over 0.3 mm/s; scipy's LSODA.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * rate_Hz)) / rate_Hz
    lines = ((14.0, 0.23, 0.3), (9.0, 0.61, 2.0), (5.0, 1.7, 4.0))
    starts = sum(size * np.sin(phase) for size, _, phase in lines)

    def pull(t: Floats) -> Floats:
        wave = sum(size * np.sin(2.0 * np.pi * f * t + phase) for size, f, phase in lines)
        return np.asarray((wave - starts) * np.clip(t, 0.0, 1.0))

    def rates(t: float, y: Floats) -> tuple[float, float]:
        now = np.asarray(t)
        rubbing = float(friction(now)) * np.tanh(y[1] / 3e-4)
        return y[1], (float(pull(now)) - 40.0 * y[1] - 1000.0 * y[0] - rubbing) / 2.0

    way = solve_ivp(
        rates, (0.0, times[-1]), (0.0, 0.0), "LSODA", times, rtol=1e-7, atol=1e-10, max_step=0.01
    )
    hiss = rng.normal(size=(2, len(times)))
    return recorded(
        rate_Hz, force_N=pull(times) + noise[0] * hiss[0], computed_m=way.y[0] + noise[1] * hiss[1]
    )


def sprung_rig(rate_Hz: float = 100.0) -> Rig:
    """Return the rig of that mass, without friction."""
    return plain_rig(rate_Hz, {"mass_kg": 2.0, "damping_N_s_per_m": 40.0}, 1000.0)


MOTOR_kg, MOTOR_DAMPING, MOTOR_DRY_N = 1.2e-4, 1.4e-4, 0.03


def slider(seed: int, factor: float = 1.0, noise_m: float = 2e-3, memory: float = 0.0) -> Record:
    """Return 20 s of a mass of 1 kg with damping, pushed one way by steps of force, at 50 Hz.

    m·x'' + c·x' = F, c = `factor` · 0.6 N·s/m, in closed form over each frame. With a `memory` the
    force is white noise behind a lag, held for a frame.
    """
    rng, rate_Hz, frames, damping = np.random.default_rng(seed), 50.0, 1000, 0.6 * factor
    force = 0.6 + np.repeat(rng.uniform(0.0, 1.4, 20), 50)
    if memory:
        white = 0.4 * math.sqrt(1.0 - memory**2) * rng.normal(size=frames)
        force = 1.3 + lfilter([1.0], [1.0, -memory], white)
    kept = np.exp(-damping / rate_Hz)
    speed, way = 0.0, np.zeros(frames)
    for k, pull in enumerate(force[:-1].tolist()):
        steady = pull / damping
        way[k + 1] = way[k] + steady / rate_Hz + (speed - steady) * (1.0 - kept) / damping
        speed = steady + (speed - steady) * kept
    return recorded(rate_Hz, force_N=force, computed_m=way + noise_m * rng.normal(size=frames))


def slider_rig() -> Rig:
    """Return the rig of that mass, with a `factor` of one."""
    rig = plain_rig(50.0, {"mass_kg": 1.0, "damping_N_s_per_m": 0.6})
    return rig.changed({"controls.column.travel_m": 1000.0})


def held_force(seed: int, factor: float = 1.0, noise_N: float = 0.0) -> Record:
    """Return 30 s of a mass on a spring, 2 kg and 400 N/m, under ±10 N, each held for 0.4 s.

    The damping is `factor` · 30 N·s/m. Each sample of the force is held until the next, 10 ms, in
    closed form.
    """
    rng, rate_Hz, frames = np.random.default_rng(seed), 100.0, 3000
    force = np.repeat(rng.choice([-10.0, 10.0], frames // 40), 40)
    rates = np.array([[0.0, 1.0, 0.0], [-200.0, -15.0 * factor, 0.5], [0.0, 0.0, 0.0]])
    step = expm(rates / rate_Hz)
    state, way = np.zeros(2), np.empty(frames)
    for k, pull in enumerate(force.tolist()):
        way[k] = state[0]
        state = step[:2, :2] @ state + step[:2, 2] * pull
    hiss = rng.normal(size=(2, frames))
    seen = {"force_N": force + noise_N * hiss[0], "computed_m": way + 2e-5 * hiss[1]}
    return recorded(rate_Hz, **seen)


def held_force_rig() -> Rig:
    """Return the rig of that mass, with a `factor` of one."""
    return plain_rig(100.0, {"mass_kg": 2.0, "damping_N_s_per_m": 30.0}, 400.0)


def motor(seed: int = 1, seconds: float = 20.0, rate_Hz: float = 50.0) -> Record:
    """Return a record of a motor that turns one way, under two levels of torque.

    m·x'' + c·x' = F − R while it turns, in closed form. A torque is a force at a radius of 1 m.
    """
    rng = np.random.default_rng(seed)
    times = np.arange(round(seconds * rate_Hz)) / rate_Hz
    late, slow = np.clip(times - 0.5 * seconds, 0.0, None), MOTOR_kg / MOTOR_DAMPING

    def turned(net_N: float, since: Floats) -> Floats:
        return np.asarray(net_N / MOTOR_DAMPING * (since + slow * np.expm1(-since / slow)))

    way = turned(0.05 - MOTOR_DRY_N, times) + turned(0.01, late)
    way += 0.01 * rng.normal(size=len(times))
    return recorded(rate_Hz, force_N=np.where(late > 0.0, 0.06, 0.05), computed_m=way)


def motor_rig() -> Rig:
    """Return its rig, with half of the damping and no friction."""
    filed = {"mass_kg": MOTOR_kg, "damping_N_s_per_m": 0.5 * MOTOR_DAMPING}
    rig = plain_rig(50.0, filed | {"servo_frequency_Hz": 1000.0})
    return rig.changed({"controls.column.travel_m": 1e5, LENGTH: 1e5})
