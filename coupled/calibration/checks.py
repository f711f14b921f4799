"""Static and dynamic control checks against 14 CFR Part 60, appendix A, table A2A.

The rig as it is against itself with a rigid structure, which stands for the aircraft:
what the schedule specifies, felt through the loader's own mass, damping and friction.
Where the rule gives two tolerances for a force, the wider one holds. Of a release the
rule's P₀ is the time from 90 % of the displacement to the first zero crossing, or overdamped
to 10 %, and may err by 10 %; P_n, the n-th full period after that crossing, by 10·(n + 1) %.
Displacements are counted from where the control comes to rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.sweeps import Release
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig
from coupled.rig.standalone import History
from coupled.units import POUND_N, DEGREE_rad

Floats = NDArray[np.float64]
INNER, OUTER = 0.03, 0.93  # of the travel: where a sweep's force is judged
LINE = (0.06, 0.2)  # of the travel: the straight part whose start is the breakout
FORCE_SHARE = 0.10
SURFACE_rad = 2.0 * DEGREE_rad
TIME_SHARE = 0.10
COUNTED = 0.05  # overshoots above this share of the displacement count
STILL, STUCK = 1e-3, 0.8  # of the displacement: what has come to rest, and what never left
APART = 10.0  # times what still moves, a resting place is no slow return to neutral
LEGS = ("out, positive", "back, positive", "out, negative", "back, negative")


@dataclass(frozen=True)
class Tolerance:
    """What the rule allows a control: breakout and force in N."""

    breakout_N: float
    force_N: float


TOLERANCES: dict[ControlName, Tolerance] = {
    "column": Tolerance(2.0 * POUND_N, 5.0 * POUND_N),
    "wheel": Tolerance(2.0 * POUND_N, 3.0 * POUND_N),
    "pedals": Tolerance(5.0 * POUND_N, 5.0 * POUND_N),
}


@dataclass(frozen=True)
class ControlCheck:
    """One comparison: what, at which q̄ in Pa, measured and reference, allowed deviation, unit.

    `margin` is the share of the tolerance that is left, negative where it fails.
    """

    name: str
    pressure_Pa: float
    measured: float
    reference: float
    tolerance: float
    unit: str

    @property
    def margin(self) -> float:
        """Share of the tolerance left."""
        return 1.0 - abs(self.measured - self.reference) / self.tolerance

    @property
    def passed(self) -> bool:
        """Whether it is within the tolerance."""
        return self.margin >= 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON takes it."""
        return {**self.__dict__, "margin": self.margin, "passed": self.passed}


def legs(response: History) -> list[tuple[Floats, Floats, Floats]]:
    """Return (δ, F, surface) of a sweep's four legs, each with δ rising in size."""
    turn = [
        0,
        int(np.argmax(response.deflection)),
        int(np.argmin(response.deflection)),
        len(response.force),
    ]
    neutral = turn[1] + int(np.argmax(response.deflection[turn[1] :] <= 0.0))
    parts = [slice(0, turn[1]), slice(turn[1], neutral)]
    parts += [slice(neutral, turn[2]), slice(turn[2], turn[3])]
    found = []
    for i, part in enumerate(parts):
        order = slice(None) if i % 2 == 0 else slice(None, None, -1)
        columns = (response.deflection[part], response.force[part], response.surface[part])
        found.append(tuple(column[order] for column in columns))
    return [(d, f, s) for d, f, s in found]


def band(control: ControlName, force: Floats) -> Floats:
    """Return how far a force in N may be off the reference: ±10 % or the rule's pounds."""
    return np.maximum(FORCE_SHARE * np.abs(force), TOLERANCES[control].force_N)


def judged(
    control: ControlName, travel: float, felt: History, specified: History
) -> list[tuple[Floats, Floats, Floats]]:
    """Return (δ, F felt, F specified) along each leg, at the same δ in d, where it is judged."""
    found = []
    for (d, f, _), (d0, f0, _) in zip(legs(felt), legs(specified), strict=True):
        side = 1.0 if d.sum() > 0.0 else -1.0
        at = np.linspace(INNER, OUTER, 181) * travel
        found.append((side * at, np.interp(at, side * d, f), np.interp(at, side * d0, f0)))
    return found


def breakout(deflection: Floats, force: Floats, travel: float, straight: float) -> float:
    """Return the force in N at which a control leaves neutral: where its line starts.

    `straight` is where its first segment ends, d.
    """
    share = np.abs(deflection) / travel
    near = (share > LINE[0]) & (share < min(LINE[1], 0.9 * straight / travel))
    if np.count_nonzero(near) < 2:
        near = share < LINE[1]
    return float(np.abs(np.polyfit(deflection[near], force[near], 1)[1]))


def static_checks(
    rig: Rig, control: ControlName, pressure_Pa: float, felt: History, specified: History
) -> list[ControlCheck]:
    """Return breakout both ways, and the force where it is nearest to its limit on each leg."""
    found = []
    travel = rig.controls[control].travel
    straight = rig.controls[control].schedule.break_deflection or travel
    pairs = zip(legs(felt), legs(specified), LEGS, strict=True)
    for i, ((d, f, _), (d0, f0, _), leg) in enumerate(pairs):
        if i % 2 == 0:
            forces = (breakout(d, f, travel, straight), breakout(d0, f0, travel, straight))
            allowed = TOLERANCES[control].breakout_N
            name = f"breakout, {leg.removeprefix('out, ')}"
            found.append(ControlCheck(name, pressure_Pa, *forces, allowed, "N"))
    for (_, f, f0), leg in zip(judged(control, travel, felt, specified), LEGS, strict=True):
        worst = int(np.argmax(np.abs(f - f0) / band(control, f0)))
        allowed = float(band(control, f0)[worst])
        check = ControlCheck(
            f"force, {leg}", pressure_Pa, float(f[worst]), float(f0[worst]), allowed, "N"
        )
        found.append(check)
    return found


def surface_checks(
    control: ControlName, travel: float, surface_rad: float, pressure_Pa: float, felt: History
) -> list[ControlCheck]:
    """Return the surface's position where it is farthest off the deflection's, both ways.

    `surface_rad` is the surface's travel for the whole of the control's.
    """
    found = []
    for (d, _, s), leg in list(zip(legs(felt), LEGS, strict=True))[::2]:
        inside = np.abs(d) <= OUTER * travel
        moved = np.abs(s[inside]) * surface_rad / DEGREE_rad
        asked = np.abs(d[inside]) / travel * surface_rad / DEGREE_rad
        worst = int(np.argmax(np.abs(moved - asked)))
        name = f"surface, {leg.removeprefix('out, ')}"
        pair = (float(moved[worst]), float(asked[worst]))
        found.append(ControlCheck(name, pressure_Pa, *pair, SURFACE_rad / DEGREE_rad, "°"))
    return found


@dataclass(frozen=True)
class Swing:
    """A release in the rule's terms, times in s from 90 % of the displacement.

    `crossings` of zero, `peaks` of the overshoots over the displacement (signs left out,
    those above 5 %), and the time from 90 % to 10 %, NaN where it never gets there.
    """

    crossings: Floats
    peaks: Floats
    fall_s: float


def swing_of(let_go: Release) -> Swing:
    """Return a release in the rule's terms."""
    rest, time = _resting(let_go), let_go.time_s
    share = (let_go.deflection - rest) / (let_go.start - rest)
    begin = _falls_to(time, share, 0.9)
    end = _falls_to(time, share, 0.1)
    change = np.flatnonzero(share[:-1] * share[1:] < 0.0)
    crossings = time[change] - share[change] * (time[change + 1] - time[change]) / (
        share[change + 1] - share[change]
    )
    stretches = np.split(np.abs(share), change + 1)[1:]
    peaks = np.array([stretch.max() for stretch in stretches if stretch.size])
    return Swing(crossings - begin, peaks[peaks > COUNTED], end - begin)


def _resting(let_go: Release) -> float:
    """Return where friction holds a release at its end, d; neutral where it still moves."""
    tail = let_go.deflection[-max(len(let_go.deflection) // 10, 1) :]
    rest, moves, start = float(tail[-1]), float(np.ptp(tail)), abs(let_go.start)
    held = moves <= STILL * start and APART * moves <= abs(rest) < STUCK * start
    return rest if held else 0.0


def _falls_to(time: Floats, share: Floats, level: float) -> float:
    below = int(np.argmax(share <= level))
    if share[below] > level:
        return float("nan")
    if below == 0:
        return float(time[0])
    before, after = share[below - 1], share[below]
    step = time[below] - time[below - 1]
    return float(time[below - 1] + step * (before - level) / (before - after))


def dynamic_checks(
    pressure_Pa: float, side: str, felt: Release, specified: Release
) -> Iterator[ControlCheck]:
    """Yield the checks of a release: of an underdamped control, or else its fall."""
    now, wanted = swing_of(felt), swing_of(specified)
    if not wanted.peaks.size:
        allowed = TIME_SHARE * wanted.fall_s
        name = f"90 % to 10 %, {side}"
        yield ControlCheck(name, pressure_Pa, now.fall_s, wanted.fall_s, allowed, "s")
        height = 100.0 * float(np.max(now.peaks, initial=0.0))
        yield ControlCheck(f"overshoot, {side}", pressure_Pa, height, 0.0, 100.0 * COUNTED, "%")
        return
    first = wanted.crossings[0]
    crossed = float(now.crossings[0]) if now.crossings.size else float("inf")
    name = f"first zero crossing, {side}"
    yield ControlCheck(name, pressure_Pa, crossed, float(first), TIME_SHARE * float(first), "s")
    count = (float(len(now.peaks)), float(len(wanted.peaks)))
    counted = min(len(now.crossings), len(wanted.crossings), len(wanted.peaks) + 1)
    for n in range(1, (counted + 1) // 2):
        periods = (_period(now, n), _period(wanted, n))
        allowed = TIME_SHARE * (n + 1) * periods[1]
        yield ControlCheck(f"period {n}, {side}", pressure_Pa, *periods, allowed, "s")
    for n, peak in enumerate(wanted.peaks):
        height = float(now.peaks[n]) if n < len(now.peaks) else 0.0
        pair, allowed = (100.0 * height, 100.0 * float(peak)), 10.0 * float(wanted.peaks[0])
        yield ControlCheck(f"overshoot {n + 1}, {side}", pressure_Pa, *pair, allowed, "%")
    yield ControlCheck(f"overshoots above 5 %, {side}", pressure_Pa, *count, 1.0, "")


def _period(swing: Swing, n: int) -> float:
    """Return the n-th full period after the first zero crossing, n from 1, in s."""
    return float(swing.crossings[2 * n] - swing.crossings[2 * n - 2])
