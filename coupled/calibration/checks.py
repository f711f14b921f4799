"""Static and dynamic control checks against 14 CFR Part 60, appendix A, table A2A.

The rig is compared with its specification (`specification`), which represents the aircraft. The
force is the hand's own, not the strain gauge's reading. If the rule gives two tolerances for a
force, the wider one applies. In a release the rule's P₀ is the time from 90 % of the displacement
to the first zero crossing, or if overdamped to 10 %, with a tolerance of 10 %; P_n, the n-th full
period after that crossing, has a tolerance of 10·(n + 1) %. Displacements are relative to the final
position.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.calibration.specification import LEGS, SweepLeg
from coupled.calibration.sweeps import Release
from coupled.campaign.tolerances import (
    COUNTED,
    HEIGHT_SHARE,
    STATIC,
    TIME_SHARE,
    SURFACE_rad,
    force_band,
)
from coupled.record.channels import ControlName
from coupled.rig.parameters import Control
from coupled.rig.standalone import History
from coupled.units import DEGREE_rad

Floats = NDArray[np.float64]
INNER, OUTER = 0.03, 0.93  # of the travel, between which a sweep's force is checked
LINE = (0.06, 0.2)  # of the travel: the line whose intercept is the breakout
STILL, STUCK = 1e-3, 0.8  # of the displacement: a control at rest, and one that did not return
RESTING = 10.0  # a final position is at rest if it exceeds the last motion by this factor


@dataclass(frozen=True)
class ControlCheck:
    """One comparison: name, q̄ in Pa, measured and reference value, tolerance, unit.

    `margin` is the share of the tolerance that remains, negative for a failure.
    """

    name: str
    pressure_Pa: float
    measured: float
    reference: float
    tolerance: float
    unit: str

    @property
    def margin(self) -> float:
        """The share of the tolerance that remains."""
        return 1.0 - abs(self.measured - self.reference) / self.tolerance

    @property
    def passed(self) -> bool:
        """Whether it is within the tolerance."""
        return self.margin >= 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {**self.__dict__, "margin": self.margin, "passed": self.passed}


def legs(response: History) -> tuple[SweepLeg, ...]:
    """Return a sweep's four legs, each with δ rising in size."""
    deflection = response.deflection
    stops = int(np.argmax(deflection)), int(np.argmin(deflection))
    neutral = stops[0] + int(np.argmax(deflection[stops[0] :] <= 0.0))
    parts = [slice(0, stops[0]), slice(stops[0], neutral)]
    parts += [slice(neutral, stops[1]), slice(stops[1], len(deflection))]
    found = []
    for i, part in enumerate(parts):
        order = slice(None, None, 1 if i % 2 == 0 else -1)
        columns = (deflection[part], response.hand_force[part], response.surface[part])
        delta, force, surface = (column[order] for column in columns)
        found.append(SweepLeg(delta, force, surface))
    return tuple(found)


@dataclass(frozen=True)
class JudgedLeg:
    """The points of a leg at which forces are compared: δ in d, F felt and specified, N."""

    deflection: Floats
    felt: Floats
    specified: Floats


def judged(
    data: Control, felt: Sequence[SweepLeg], specified: Sequence[SweepLeg]
) -> tuple[JudgedLeg, ...]:
    """Return the felt and the specified forces along each leg at the same δ."""
    found = []
    for now, wanted, (side, _) in zip(felt, specified, LEGS.values(), strict=True):
        travel = data.travel_to(side)
        at = np.linspace(INNER, OUTER, 181) * travel
        if wanted.read:
            at = np.abs(wanted.deflection)
            at = at[(at >= INNER * travel) & (at <= OUTER * travel)]
        if not at.size:
            found.append(JudgedLeg(at, at, at))
            continue
        forces = (np.interp(at, side * leg.deflection, leg.force) for leg in (now, wanted))
        found.append(JudgedLeg(side * at, *forces))
    return tuple(found)


def breakout(leg: SweepLeg, travel: float, straight: float) -> float:
    """Return the force in N at which a control leaves neutral: the intercept of its first line.

    `straight` is the end of its first segment, d.
    """
    share = np.abs(leg.deflection) / travel
    near = (share > LINE[0]) & (share < min(LINE[1], 0.9 * straight / travel))
    if np.count_nonzero(near) < 2:
        near = share < LINE[1]
    return float(np.abs(np.polyfit(leg.deflection[near], leg.force[near], 1)[1]))


def static_checks(
    data: Control,
    control: ControlName,
    pressure_Pa: float,
    felt: Sequence[SweepLeg],
    specified: Sequence[SweepLeg],
) -> list[ControlCheck]:
    """Return the breakout both ways, and the force with the least margin on each leg.

    `data` is the specified control.
    """
    found = []
    nodes = [abs(node) for node in data.schedule.deflection or () if node != 0.0]
    straight = min(nodes, default=data.schedule.break_deflection or data.travel)
    for now, wanted, leg in list(zip(felt, specified, LEGS, strict=True))[::2]:
        travel = data.travel_to(LEGS[leg][0])
        near = np.abs(wanted.deflection) < LINE[1] * travel
        if np.count_nonzero(near) < 2:
            continue  # too few readings for a line
        forces = [breakout(each, travel, straight) for each in (now, wanted)]
        name = f"breakout, {leg.removeprefix('out, ')}"
        allowed = STATIC[control].breakout_N
        found.append(ControlCheck(name, pressure_Pa, forces[0], forces[1], allowed, "N"))
    for at, leg in zip(judged(data, felt, specified), LEGS, strict=True):
        if not at.deflection.size:
            continue
        band = force_band(control, at.specified)
        worst = int(np.argmax(np.abs(at.felt - at.specified) / band))
        felt_there, asked = float(at.felt[worst]), float(at.specified[worst])
        allowed = float(band[worst])
        found.append(ControlCheck(f"force, {leg}", pressure_Pa, felt_there, asked, allowed, "N"))
    return found


def surface_checks(
    data: Control,
    surface_rad: float,
    pressure_Pa: float,
    felt: Sequence[SweepLeg],
    surface: str = "",
    read: Sequence[SweepLeg] = (),
) -> list[ControlCheck]:
    """Return the surface positions with the largest deviations from those of the deflection.

    `surface_rad` is the surface's travel for full travel of the control. `surface` is the surface's
    name if it is not the control's own, such as a spoiler moved by the wheel. On legs `read` on the
    aircraft, the reference is the aircraft's position.
    """
    found = []
    allowed = SURFACE_rad[surface or data.surface] / DEGREE_rad
    degrees = surface_rad / DEGREE_rad
    for k, name in list(enumerate(LEGS))[::2]:
        leg, travel = felt[k], data.travel_to(LEGS[name][0])
        inside = np.abs(leg.deflection) <= OUTER * travel
        at, moved = np.abs(leg.deflection[inside]), np.abs(leg.surface[inside]) * degrees
        asked = at / travel * degrees
        if read and read[k].read and np.isfinite(read[k].surface).any():
            there = np.isfinite(read[k].surface) & (np.abs(read[k].deflection) <= at[-1])
            if not there.any():
                continue
            moved = np.interp(np.abs(read[k].deflection[there]), at, moved)
            asked = read[k].surface[there] * degrees
        worst = int(np.argmax(np.abs(moved - asked)))
        label = f"{surface or 'surface'}, {name.removeprefix('out, ')}"
        pair = (float(moved[worst]), float(asked[worst]))
        found.append(ControlCheck(label, pressure_Pa, *pair, allowed, "°"))
    return found


@dataclass(frozen=True)
class Swing:
    """A release in the rule's terms, times in s from 90 % of the displacement.

    `begin_s` is when the displacement falls through 90 % after the release; `crossings` are those
    of zero, `peaks` the absolute overshoots over the displacement (above 5 %), `fall_s` the time
    from 90 % to 10 %, NaN if it does not get there.
    """

    begin_s: float
    crossings: Floats
    peaks: Floats
    fall_s: float


def swing_of(release: Release) -> Swing:
    """Return a release's crossings, peaks and fall."""
    rest, time = _rest_position(release), release.time_s
    share = (release.deflection - rest) / (release.start - rest)
    begin = _falls_to(time, share, 0.9)
    end = _falls_to(time, share, 0.1)
    change = np.flatnonzero(share[:-1] * share[1:] < 0.0)
    crossings = time[change] - share[change] * (time[change + 1] - time[change]) / (
        share[change + 1] - share[change]
    )
    stretches = np.split(np.abs(share), change + 1)[1:]
    peaks = np.array([stretch.max() for stretch in stretches if stretch.size])
    return Swing(begin, crossings - begin, peaks[peaks > COUNTED], end - begin)


def _rest_position(release: Release) -> float:
    """Return the position at which friction holds a release at its end, d; neutral if it moves."""
    tail = release.deflection[-max(len(release.deflection) // 10, 1) :]
    rest, moves, start = float(tail[-1]), float(np.ptp(tail)), abs(release.start)
    held = moves <= STILL * start and RESTING * moves <= abs(rest) < STUCK * start
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
    """Yield the checks of a release: crossings and overshoots, or if overdamped its fall."""
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
        pair = (100.0 * height, 100.0 * float(peak))
        allowed = 100.0 * HEIGHT_SHARE * float(wanted.peaks[0])
        yield ControlCheck(f"overshoot {n + 1}, {side}", pressure_Pa, *pair, allowed, "%")
    yield ControlCheck(f"overshoots above 5 %, {side}", pressure_Pa, *count, 1.0, "")


def _period(swing: Swing, n: int) -> float:
    """Return the n-th full period after the first zero crossing, n from 1, in s."""
    return float(swing.crossings[2 * n] - swing.crossings[2 * n - 2])
