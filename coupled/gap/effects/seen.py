"""Start values of effects, estimated from the residuals: hums, ripples, stops, modes and bends.

A ripple is a force proportional to sin or cos of 2π·δc/period. It moves δc by the loader's
equation, m·r'' + c·r' + G·r = −F. The residual is regressed on this response for many periods, as
in a spectrum over the deflection instead of time. The regression is in δc, where the noise is
white; in the force, the equation would amplify noise at short periods. Under an imposed motion the
residual is a force, and is the ripple itself.

The bend of a lightly damped structure is linear in its coefficient, but nearly all of it is within
its bandwidth, a share 2ζ of its frequency. The residual of a rigid structure is therefore regressed
on the bend at frequencies that are one bandwidth apart. A stiffening bend is tried from almost
linear to fully saturated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.gap.noise.lines import lines_in, seen_as
from coupled.gap.noise.smooth import smoothed
from coupled.gap.signals.output import Floats, Output
from coupled.gap.thresholds import FEW, MORE, RIPPLE_PERIODS, TRIES
from coupled.record.channels import ControlName, channel, unit_of
from coupled.rig.rig import Rig, with_values

Complex = NDArray[np.complex128]
HUM_Hz = 5.0  # the slowest hum, or alias of one


def hums(outputs: Sequence[Output], rig: Rig, control: ControlName) -> list[dict[str, float]]:
    """Return amplitude, d, frequency, Hz, and phase, rad, of the strongest hum, if there is one.

    That of the first record: the phase differs between records (`reading`).
    """
    ours = [output for output in outputs if output.stage == "loader"]
    if not ours:
        return []
    first = ours[0]
    slowest = 2.0 * math.pi * HUM_Hz / first.frame_rate_Hz
    for line in lines_in(first.residual(rig) * first.floor, slowest):
        tone_Hz = seen_as(line, first.frame_rate_Hz).tone_Hz
        turns = tone_Hz / first.frame_rate_Hz * 2.0 * math.pi
        # A tone aliased from an odd Nyquist zone has the opposite phase direction.
        backwards = math.cos(turns - line.turn) < math.cos(turns + line.turn)
        phase = math.remainder(math.pi - line.phase, 2.0 * math.pi) if backwards else line.phase
        return [{"amplitude_{d}": line.amplitude, "frequency_Hz": tone_Hz, "phase_rad": phase}]
    return []


def ripples(outputs: Sequence[Output], rig: Rig, control: ControlName) -> list[dict[str, float]]:
    """Return amplitude, N, period, d, and phase, rad, of the strongest ripples, strongest first."""
    ours = [output for output in outputs if output.stage == "loader"]
    ours = [o for o in ours if "force" not in o.channel or o.imposed is not None]  # not F_mod
    if not ours:
        return []
    ways = [smoothed(o.measured if o.imposed is None else o.imposed) for o in ours]
    answers = [_answer(output, rig, control) for output in ours]

    def moved(forces: Sequence[Floats] | Sequence[Complex]) -> Complex:
        each = zip(answers, forces, strict=True)
        return np.concatenate([np.fft.ifft(answer * np.fft.fft(force)) for answer, force in each])

    laws = [[np.ones_like(w), w, np.abs(w), w**3] for w in ways]
    smooth = np.linalg.qr(np.column_stack([moved(law).real for law in zip(*laws, strict=True)]))[0]
    left = np.concatenate([output.residual(rig) * output.floor for output in ours])
    left = left - smooth @ (smooth.T @ left)
    span = max(float(np.ptp(way)) for way in ways)
    periods = span / np.arange(MORE, RIPPLE_PERIODS, 0.25)
    waves = []
    for period in periods.tolist():
        turned = moved([np.exp(2j * np.pi * way / period) for way in ways])
        both = np.column_stack((turned.imag, turned.real))  # by sin and by cos
        waves.append(_wave(both - smooth @ (smooth.T @ both), left, period))
    taken = np.array([0.0, *(power for _, power in waves), 0.0])
    peaks = np.flatnonzero((taken[1:-1] > taken[:-2]) & (taken[1:-1] >= taken[2:]))
    best = sorted(peaks.tolist(), key=lambda k: -waves[k][1])[:TRIES]
    return [waves[k][0] for k in best]


def _wave(both: Floats, left: Floats, period: float) -> tuple[dict[str, float], float]:
    """Return a ripple by its responses to sine and cosine, and the residual's power on them."""
    sine, cosine = np.linalg.lstsq(both, left, rcond=None)[0]
    values = {
        "ripple_N": float(np.hypot(sine, cosine)),
        "period_{d}": period,
        "phase_rad": float(np.arctan2(cosine, sine)),
    }
    return values, float(left @ (both @ np.array([sine, cosine])))


def _answer(output: Output, rig: Rig, control: ControlName) -> Complex:
    """Return the loader's frequency response to a friction force, d/N.

    Under an imposed motion the output is the hand's force, which carries the friction: 1.
    """
    if output.imposed is not None:
        return np.ones(len(output.measured), dtype=np.complex128)
    data = rig.controls[control]
    turns = 2.0 * np.pi * np.fft.fftfreq(len(output.measured), 1.0 / output.frame_rate_Hz)
    gradient = float(np.mean(data.schedule.gradients))
    stiff = gradient + 1j * turns * data.loader.damping - turns**2 * data.loader.mass
    return np.asarray(-1.0 / np.where(stiff == 0.0, np.inf, stiff))


def stops(outputs: Sequence[Output], rig: Rig, control: ControlName) -> list[dict[str, float]]:
    """Return where the control stops aft and forward, d, in one entry; none where nothing stops it.

    A stop is met where the nominal rig goes beyond every measured place. There the control rests
    at it, and the median of what is measured is the stop. A side that is not met has the travel.
    """
    travels = (rig.controls[control].pull, rig.controls[control].push)
    names = [channel(control, quantity) for quantity in ("computed", "deflection")]
    ours = [o for o in outputs if o.stage == "loader" and o.channel in names]
    found: dict[str, float] = {}
    sides = (("aft_{d}", 1.0), ("forward_{d}", -1.0))
    for (name, side), travel in zip(sides, travels, strict=True):
        places = [_met(output, rig, side) for output in ours]
        met = [place for place in places if place is not None]
        found[name] = min([*met, travel])
    return [found] if ours and tuple(found.values()) != travels else []


def _met(output: Output, rig: Rig, side: float) -> float | None:
    """Return how far out a record's stop on one side lies, d; None where it meets none."""
    measured = side * output.measured
    predicted = measured - side * output.residual(rig) * output.floor
    furthest = float(np.max(measured))
    held = predicted > furthest + FEW * float(np.ptp(measured))
    if furthest <= 0.0 or not held.any():
        return None
    return max(float(np.median(measured[held])), 0.0) or None


LIGHT = 0.05  # damping ratio of the modes that are tried; the fit starts there
MODES_Hz = (0.5, 200.0)  # the slowest and fastest mode of a structure
BEND = 1e-6  # d/N, of the modes that are tried; any will do, since the bend is linear in it
SATURATED = (0.5, 1.0, 1.5, 2.0, 3.0, 5.0)  # K·F over the limit: from a slope of 0.8 to none


def modes(outputs: Sequence[Output], rig: Rig, control: ControlName) -> list[dict[str, float]]:
    """Return bend, d/N, frequency, Hz, and damping ratio of the mode that takes most, if any."""
    ours = [output for output in outputs if output.stage == "linkage"]
    if not ours:
        return []
    left = _bent(ours, rig, control, "bend_frequency_Hz", "bend_damping_ratio")
    rigid = left(0.0, 0.0, 0.0)
    fastest_Hz = min([MODES_Hz[1], *(0.5 * output.frame_rate_Hz for output in ours)])
    apart = math.log(1.0 + 2.0 * LIGHT)
    found, most = list[dict[str, float]](), 0.0
    for rate in np.arange(math.log(MODES_Hz[0]), math.log(fastest_Hz), apart):
        frequency_Hz = math.exp(rate)
        bent = (rigid - left(BEND, frequency_Hz, LIGHT)) / BEND
        power, along = float(bent @ bent), float(bent @ rigid)
        if along > most * math.sqrt(power):
            most, bend = along / math.sqrt(power), along / power
            found = [{"bend_{d}_per_N": bend, "frequency_Hz": frequency_Hz, "damping_ratio": LIGHT}]
    return found


def saturations(
    outputs: Sequence[Output], rig: Rig, control: ControlName
) -> list[dict[str, float]]:
    """Return bend, d/N, and limit, d, of the stiffening bend that leaves the smallest residual.

    The linear bend has the mean slope K and the largest deflection A. If K·F is x limits at the
    largest force, the limit is A/tanh(x), and the bend at no force K·x/tanh(x).
    """
    ours = [output for output in outputs if output.stage == "linkage"]
    if not ours:
        return []
    left = _bent(ours, rig, control, "bend_limit_{d}")
    rigid = left(0.0, 0.0)
    bent = (rigid - left(BEND, 0.0)) / BEND
    power, along = float(bent @ bent), float(bent @ rigid)
    if along <= 0.0:
        return []
    floors = np.concatenate([np.full(len(output.measured), output.floor) for output in ours])
    slope = along / power
    largest = slope * float(np.max(np.abs(bent * floors)))
    tried = [(x * slope / math.tanh(x), largest / math.tanh(x)) for x in SATURATED]

    def power_left(one: tuple[float, float]) -> float:
        try:
            return float(np.sum(left(*one) ** 2))
        except InputError:  # the rig's schedule has no gradient as stiff as this structure
            return math.inf

    bend, limit = min(tried, key=power_left)
    return [{"bend_{d}_per_N": bend, "limit_{d}": limit}]


def _bent(
    outputs: Sequence[Output], rig: Rig, control: ControlName, *keys: str
) -> Callable[..., Floats]:
    """Return the residual of outputs as a function of the bend, d/N, and other loader keys."""
    named = [one.replace("{d}", unit_of(control)) for one in ("bend_{d}_per_N", *keys)]

    def left(*values: float) -> Floats:
        paths = (f"controls.{control}.loader.{key}" for key in named)
        bent = with_values(rig, dict(zip(paths, values, strict=True)))
        return np.concatenate([output.residual(bent, coarse=True) for output in outputs])

    return left
