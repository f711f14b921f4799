"""Lines in a spectrum: tones, such as mains hum, above a channel's noise.

A line is a bin of the tapered spectrum far above its surroundings which one sine removes almost
completely; a resonance or a sweep is broader. In a channel lines are searched above 0.4 of the
Nyquist frequency, where it contains noise alone (`noise`).

By aliasing a tone of f appears at |f − n·rate|: 60 Hz logged at 100 Hz appears at 40 Hz. Mains have
50 or 60 Hz, on aircraft 400 Hz. A line at an alias of one of these is attributed to it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from coupled.gap.noise.noise import Floats
from coupled.gap.thresholds import (
    LESSER,
    LINE_HEIGHT,
    MAINS_OFF,
    MINOR,
    NOISE_FROM,
    PIECE,
    ROUNDS,
    TAPER_BINS,
    WHITE_FRAMES,
    MAINS_Hz,
)


@dataclass(frozen=True)
class Line:
    """A sine: amplitude in the signal's unit, phase at its first frame, and rad a frame, 0 to π."""

    turn: float
    amplitude: float
    phase: float

    def over(self, frames: int) -> Floats:
        """Return the sine over so many frames."""
        return np.asarray(self.amplitude * np.sin(self.turn * np.arange(frames) + self.phase))


@dataclass(frozen=True)
class SeenLine:
    """A line in a record: its apparent frequency, and that of its tone.

    `folded`: the tone is above the Nyquist frequency and appears at an alias.
    """

    seen_Hz: float
    tone_Hz: float
    amplitude: float

    @property
    def folded(self) -> bool:
        """Whether the line is an alias."""
        return abs(self.tone_Hz - self.seen_Hz) > 1e-9 * self.tone_Hz

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {
            "frequency_Hz": self.seen_Hz,
            "amplitude": self.amplitude,
            "aliased": self.folded,
            "tone_Hz": self.tone_Hz,
        }


def lines_in(signal: Floats, lowest: float = NOISE_FROM * math.pi) -> list[Line]:
    """Return the lines of a signal above `lowest`, rad a frame, the most significant first."""
    found: list[Line] = []
    left = signal
    while len(signal) >= WHITE_FRAMES and len(found) < ROUNDS:
        turn = _highest(left, lowest)
        if turn is None:
            return found
        line = _sharpened(left, turn)
        rest = left - line.over(len(left))
        if _power_at(rest, line.turn) > LESSER * _power_at(left, line.turn):
            return found
        found.append(line)
        left = rest
    return found


def seen_as(line: Line, rate_Hz: float) -> SeenLine:
    """Return a line of a signal sampled at `rate_Hz`, with its tone."""
    seen = line.turn * rate_Hz / (2.0 * math.pi)
    return SeenLine(seen, tone_of(seen, rate_Hz), line.amplitude)


def widest_line(left: Floats, floor: float, rate_Hz: float) -> SeenLine | None:
    """Return the tone of largest amplitude in a residual, if it is a notable share of its power.

    The residual is in noise floors, `floor` in the signal's unit.
    """
    lines = sorted(lines_in(left), key=lambda line: -line.amplitude)
    if not lines or 0.5 * lines[0].amplitude ** 2 < MINOR * float(np.mean(left**2)):
        return None
    seen = seen_as(lines[0], rate_Hz)
    return replace(seen, amplitude=seen.amplitude * floor)


def other_side(tone_Hz: float, rate_Hz: float) -> float | None:
    """Return another tone of the same mains with the same alias, if there is one."""
    other = math.ceil(2.0 * tone_Hz / rate_Hz) * rate_Hz - tone_Hz
    below = math.floor(2.0 * tone_Hz / rate_Hz) * rate_Hz - tone_Hz
    for mains in MAINS_Hz:
        for one in (other, below):
            if max(abs(one - mains), abs(tone_Hz - mains)) <= MAINS_OFF * mains:
                return one
    return None


def tone_of(seen_Hz: float, rate_Hz: float) -> float:
    """Return the mains frequency with this alias, else the line's own frequency."""
    for mains in (seen_Hz, *MAINS_Hz):
        for tone in (seen_Hz, *_unfolded(seen_Hz, mains, rate_Hz)):
            if any(abs(tone - known) <= MAINS_OFF * known for known in MAINS_Hz):
                return tone
    return seen_Hz


def _unfolded(seen_Hz: float, near_Hz: float, rate_Hz: float) -> tuple[float, float]:
    """Return the two tones nearest to a frequency that have this alias."""
    around = round((near_Hz - seen_Hz) / rate_Hz), round((near_Hz + seen_Hz) / rate_Hz)
    return abs(around[0] * rate_Hz + seen_Hz), abs(around[1] * rate_Hz - seen_Hz)


def projected(signal: Floats, turn: float) -> Line:
    """Return the least squares fit of a sine of a given frequency, rad a frame, to a signal."""
    at = turn * np.arange(len(signal))
    waves = np.column_stack((np.sin(at), np.cos(at)))
    taper = np.hanning(len(signal))
    sine, cosine = np.linalg.lstsq(waves * taper[:, None], signal * taper, rcond=1e-6)[0]
    return Line(turn, float(np.hypot(sine, cosine)), float(np.arctan2(cosine, sine)))


def _highest(signal: Floats, lowest: float) -> float | None:
    """Return the frequency of the bin highest above its surroundings; None if none is a line."""
    rough = np.diff(signal, 4)
    power = np.abs(np.fft.rfft(rough * np.hanning(len(rough)))) ** 2
    omega = np.linspace(0.0, math.pi, len(power))
    first = int(np.searchsorted(omega, lowest))
    power = power[first:] / (2.0 * np.sin(0.5 * omega[first:])) ** 8
    parts = np.array_split(power, PIECE // 4)
    level = np.concatenate([np.full(len(p), np.median(p) / math.log(2.0)) for p in parts])
    if not np.all(level > 0.0):
        return None
    best = int(np.argmax(power / level))
    if power[best] < LINE_HEIGHT * level[best]:
        return None
    return float(omega[first + best])


def _sharpened(signal: Floats, turn: float) -> Line:
    """Return the sine near a bin's frequency, refined by its phase in both halves of the signal."""
    half = len(signal) // 2
    rough = np.diff(signal, 4)  # removes the slow motion of the rig
    for _ in range(2 * ROUNDS):
        early, late = projected(rough[:half], turn), projected(rough[half:], turn)
        slip = late.phase - early.phase - turn * half
        turn += math.remainder(slip, 2.0 * math.pi) / half
    rougher = projected(rough, turn)
    gain, lead = (2.0 * math.sin(0.5 * turn)) ** 4, 2.0 * turn  # of four differences
    phase = math.remainder(rougher.phase - lead, 2.0 * math.pi)
    return Line(turn, rougher.amplitude / gain, phase)


def _power_at(signal: Floats, turn: float) -> float:
    """Return the power of a signal's fourth differences within a tapered bin of a frequency."""
    rough = np.diff(signal, 4) * np.hanning(len(signal) - 4)
    power = np.abs(np.fft.rfft(rough)) ** 2
    at = round(turn / math.pi * (len(power) - 1))
    return float(np.sum(power[max(0, at - TAPER_BINS) : at + TAPER_BINS + 1]))
