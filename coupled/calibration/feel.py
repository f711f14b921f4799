"""A force-deflection sweep of an aircraft as breakout, friction and curve.

A slow sweep out and back at the dynamic pressures q̄_i gives

    F = F_BO·sgn(δ) + f(δ, q̄_i) + F_c·sgn(δ') + F_0

f is linear between nodes, rises with δ and is 0 at neutral. For given nodes F is linear in F_BO,
F_c, the zero error F_0 and the rises between the nodes, of which only F_0 may be negative:
non-negative least squares (Lawson and Hanson, Solving Least Squares Problems, 1974, ch. 23). Nodes
of an even grid are removed one by one, and others moved and added, as far as the Bayesian
information criterion falls. The same criterion decides between one curve for both sides and two,
and whether there is a zero error. Readings near neutral, where the breakout may hold any force, and
at turning points, where the friction reverses, are not used.

The criterion keeps as few nodes as the noise allows, so that a bend of the curve near neutral is as
large as the standard error of the breakout. F_BO and F_c are therefore from a fit with another node
in the middle of the segment at neutral. This undersmoothing makes the bias small beside the
standard error (Wasserman, All of Nonparametric Statistics, 2006, sec. 5.7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.stats import t as student

from coupled.calibration.aircraftdata import motion_of, read_rows
from coupled.errors import InputError
from coupled.record.channels import CONTROL_NAMES, ControlName, channel, unit_of
from coupled.record.importing.plausible import check_size, held_extreme, size_doubt
from coupled.record.record import Record

Floats = NDArray[np.float64]
NEUTRAL = 0.01  # of the largest deflection: readings nearer to neutral are not used
GRID = 12  # nodes on a side to begin with
MOVES = (0.5, 0.25, 0.125, 0.0625)  # of the grid's step
EXACT = 1e-9  # of the largest force: a smaller residual is rounding
LEAST_READINGS = 8
VERY_STRONG = 10.0  # evidence by the criterion, for a zero error (Kass and Raftery, 1995)
READINGS = 400  # of a sweep at one q̄: more rows are averaged, so that a fit takes seconds
LOOSE = 0.05  # of the largest force: a larger residual RMS is no fit
STEADY = 0.05  # of q̄: a larger change is another sweep


@dataclass(frozen=True)
class Sweep:
    """The readings of a sweep in SI: δ in d, F in N, q̄ in Pa; `motion` is sgn(δ')."""

    deflection: Floats
    force: Floats
    pressure: Floats
    motion: Floats

    def doubts(self, control: ControlName) -> list[str]:
        """Return doubts about the forces: a gauge that saturates, another unit."""
        name = channel(control, "force")
        end_N, size = held_extreme(self.force[self.motion != 0.0]), size_doubt(name, self.force)
        found = [] if size is None else [f"{name}: {size}"]
        if end_N is not None:
            found.append(f"{name}: clipped at {end_N:.4g}; friction and curve are wrong there")
        return found

    @property
    def far(self) -> NDArray[np.bool_]:
        """The readings that are not near neutral."""
        size = np.abs(self.deflection)
        return np.asarray(size > NEUTRAL * np.max(size))


@dataclass(frozen=True)
class Feel:
    """Breakout and friction in N with half of their 95 % intervals, and the curve's table.

    `force` in N has a row for each of `pressure` in Pa, over `deflection` in d. `zero_N` is the
    constant part of the forces, which the curve lacks. `rms_N` is that of the residual; `used` are
    the readings used. `straight` is the deflection up to which the curve is taken as straight,
    because too few readings are nearer to neutral; 0 if there are enough. `by_pressure` are
    breakout and friction in N at each pressure, shape (pressures, 2), if they differ; else empty.
    """

    breakout_N: float
    breakout_half_width_N: float
    friction_N: float
    friction_half_width_N: float
    pressure: Floats
    deflection: Floats
    force: Floats
    rms_N: float
    zero_N: float
    straight: float
    sweep: Sweep
    used: NDArray[np.bool_]
    by_pressure: Floats

    def doubts(self, control: ControlName) -> list[str]:
        """Return doubts about the forces, and about a curve that does not follow them."""
        most = float(np.max(np.abs(self.sweep.force[self.used])))
        found = self.sweep.doubts(control)
        if self.rms_N > LOOSE * most:
            share = f"the residual RMS is {100.0 * self.rms_N / most:.0f} % of the largest"
            found.append(f"{channel(control, 'force')}: no rising curve fits the forces: {share}")
        if self.zero_N:
            problem = f"{self.zero_N:.3g} N are in it on both sides: a gauge's zero, or a trim?"
            found.append(f"{channel(control, 'force')}: {problem} The curve is without them")
        if self.straight:
            problem = f"breakout: is right if the curve is straight up to {self.straight:.3g}"
            found.append(f"{problem} {unit_of(control)}; give readings nearer to neutral")
        if len(self.by_pressure):
            each = (
                f"{breakout:.3g} and {friction:.3g} N at {q:g} Pa"
                for q, (breakout, friction) in zip(self.pressure, self.by_pressure, strict=True)
            )
            problem = f"breakout and friction depend on q̄: {', '.join(each)}"
            found.append(f"{problem}; a rig file has one value of each, here those of all readings")
        return found

    def at(self, deflection: Floats, row: int, motion: float) -> Floats:
        """Return the fitted force in N at δ in d, at one of the pressures; motion −1, 0 or 1."""
        odd = self.deflection[0] == 0.0
        size = np.abs(deflection) if odd else deflection
        curve = np.interp(size, self.deflection, self.force[row])
        side = np.sign(deflection)
        return np.asarray(side * self.breakout_N + (side if odd else 1.0) * curve) + (
            motion * self.friction_N + self.zero_N
        )


def read_sweep(path: Path, control: ControlName) -> Sweep:
    """Return the readings of a file; without a column `direction`, in the order of the sweep.

    Raises InputError.
    """
    rows = read_rows(path, control, np.nan)
    columns = np.array([(row.deflection, row.force, row.pressure) for row in rows]).T
    deflection, force, pressure = columns
    given = [row for row in rows if row.direction]
    if given and len(given) < len(rows):
        number = next(row.number for row in rows if not row.direction)
        problem = "names no direction, unlike others; give out or back in each row, or in none"
        raise InputError(path, f"row {number}", problem)
    if given:
        motion = np.array([row.direction for row in rows]) * np.sign(deflection)
        found = Sweep(deflection, force, pressure, motion)
        _check(path, [row.number for row in rows], found, control)
        return found
    sweeps, numbers = [], []
    for q in np.unique(pressure):
        at = np.flatnonzero(pressure == q)
        sweep, firsts = _averaged(deflection[at], force[at], float(q))
        sweeps.append(sweep)
        numbers += [rows[at[first]].number for first in firsts]
    found = Sweep(*map(np.concatenate, zip(*(vars(one).values() for one in sweeps), strict=True)))
    _check(path, numbers, found, control)
    return found


def _averaged(deflection: Floats, force: Floats, pressure: float) -> tuple[Sweep, list[int]]:
    """Return readings in the order of a sweep at one q̄, and the first row of each.

    A reading is one row, or the mean of several, so that there are at most `READINGS`.
    """
    parts = np.array_split(np.arange(len(force)), min(len(force), READINGS))
    means = np.array([np.mean(deflection[rows]) for rows in parts])
    # A mean across neutral holds the breakout of both sides, and is not used.
    one_side = [np.min(deflection[rows]) * np.max(deflection[rows]) > 0.0 for rows in parts]
    motion = np.where(one_side, motion_of(means), 0.0)
    forces = np.array([np.mean(force[rows]) for rows in parts])
    sweep = Sweep(means, forces, np.full(len(parts), pressure), motion)
    return sweep, [int(rows[0]) for rows in parts]


def swept_control(record: Record, file: Path) -> ControlName:
    """Return the control whose force and deflection a record has; raises InputError."""
    found = [
        name
        for name in CONTROL_NAMES
        if channel(name, "force") in record and channel(name, "deflection") in record
    ]
    if not found:
        names = "column_force_N and column_deflection_m"
        problem = f"lacks force and deflection of one control; map both, as {names}"
        raise InputError(file, "--feel", problem)
    moved = {name: float(np.ptp(record[channel(name, "deflection")])) for name in found}
    if max(moved.values()) == 0.0:
        problem = f"never changes: the {found[0]} is at rest, or a sensor is stuck"
        raise InputError(file, channel(found[0], "deflection"), problem)
    away = [name for name in found if moved[name] > 0.1 * max(moved.values())]
    if len(away) > 1:
        problem = f"moves {' and '.join(away)}; give the log of a sweep of one control"
        raise InputError(file, "--feel", problem)
    return away[0]


def sweep_of_record(record: Record, control: ControlName, file: Path) -> Sweep:
    """Return the readings of a slow sweep of a control in a record, means of a few rows each.

    The sweep is at one dynamic pressure, its mean; 0 where the record has none. Raises InputError
    that names `file`.
    """
    name, q = channel(control, "deflection"), "dynamic_pressure_Pa"
    pressure = record[q] if q in record else np.zeros(len(record))
    low, high = float(np.min(pressure)), float(np.max(pressure))
    if high - low > STEADY * max(abs(low), abs(high)):
        problem = f"q̄ goes from {low:.4g} to {high:.4g} Pa; give the log of a sweep at one q̄"
        raise InputError(file, q, problem)
    force = record[channel(control, "force")]
    found, firsts = _averaged(record[name], force, float(np.mean(pressure)))
    _check(file, [first + 2 for first in firsts], found, control)
    return found


def _check(path: Path, numbers: Sequence[int], sweep: Sweep, control: ControlName) -> None:
    """Refuse readings that do not determine friction and curve; `numbers` are their rows."""
    outward = sweep.motion * np.sign(sweep.deflection)
    furthest = int(np.argmax(np.abs(sweep.deflection)))
    most = f"{sweep.deflection[furthest]:g}, in row {numbers[furthest]}"
    for q in np.unique(sweep.pressure):
        here = sweep.pressure == q
        where = f" at {q:g} Pa" if np.ptp(sweep.pressure) > 0.0 else ""
        if np.count_nonzero(here) < LEAST_READINGS:
            problem = f"holds {np.count_nonzero(here)} readings{where}; {LEAST_READINGS} are needed"
            raise InputError(path, "", problem)
        if (count := np.count_nonzero(here & sweep.far)) < LEAST_READINGS:
            problem = f"has {count} of its readings{where} beyond {NEUTRAL:.0%} of the largest"
            problem += f" deflection, {most}; {LEAST_READINGS} are needed: is that one in another"
            raise InputError(path, "", f"{problem} unit?")
        if np.count_nonzero(sweep.motion[here]) < 0.5 * np.count_nonzero(here):
            problem = f"turns at most of its readings{where}: give them in the order of the sweep,"
            raise InputError(path, "", f"{problem} or a column direction, of out and back")
        for way, word in ((1.0, "out"), (-1.0, "back")):
            if not np.any(outward[here] == way):
                problem = f"holds no reading on the way {word}{where}; sweep out and back"
                raise InputError(path, "", f"{problem}: half their difference is the friction")
    pull = sweep.deflection * sweep.force
    if float(np.sum(pull)) <= 0.0:
        problem = "has forces against the deflections, or none; a pull is positive in both"
        raise InputError(path, f"row {numbers[int(np.argmin(pull))]}", problem)
    check_size(channel(control, "deflection"), sweep.deflection, path)


def fit_feel(sweep: Sweep) -> Feel:
    """Return breakout, friction and curve of a sweep."""
    used = sweep.far & (sweep.motion != 0.0)
    both = bool(np.any(sweep.deflection[used] > 0.0) and np.any(sweep.deflection[used] < 0.0))
    kinds = (
        [(True, False), (False, False), (True, True), (False, True)] if both else [(True, False)]
    )
    fits = [(_Fit(sweep, used, odd, zero), zero) for odd, zero in kinds]
    best, _ = min(fits, key=lambda each: each[0].criterion + VERY_STRONG * each[1])
    return best.feel()


class _Fit:
    """The best nodes of a sweep.

    The curve is one for both sides (`odd`), or two; the forces may have a zero error (`zero`).
    """

    def __init__(self, sweep: Sweep, used: NDArray[np.bool_], odd: bool, zero: bool) -> None:
        self._sweep, self._used, self._odd = sweep, used, odd
        self._pressures = np.unique(sweep.pressure)
        at = np.abs(sweep.deflection[used]) if odd else sweep.deflection[used]
        self._at, self._force = at, sweep.force[used]
        self._side = np.sign(sweep.deflection[used])
        self._at_pressure = sweep.pressure[used, None] == self._pressures
        self._levels = [np.unique(at[here]) for here in self._at_pressure.T]
        # F_BO and F_c, and F_0 as two of which one is 0
        columns = [self._side, sweep.motion[used]]
        columns += [np.ones_like(at), -np.ones_like(at)] if zero else []
        self._constant = np.stack(columns, axis=1)
        ends = [end for end in (float(np.min(at)), float(np.max(at))) if end < 0.0 or end > 0.0]
        ends = ends[-1:] if odd else ends
        self._step = max(map(abs, ends)) / GRID
        self._ends = frozenset(ends)
        self._nodes = sorted({0.0, *ends})
        for node in (end * k / GRID for k in range(GRID - 1, 0, -1) for end in ends):
            nodes = sorted([*self._nodes, node])
            self._nodes = nodes if self._determined(nodes) else self._nodes
        self.criterion = self._try(self._nodes)
        self._remove()
        self._move()
        while self._add():
            self._move()
        self._remove()

    def _determined(self, nodes: Sequence[float]) -> bool:
        """Return whether each segment has a deflection, and each at neutral two, at every q̄.

        From two deflections a straight line is extended to neutral, where it gives the breakout.
        """
        ends = np.array(nodes)
        beside_neutral = (ends[:-1] == 0.0) | (ends[1:] == 0.0)
        for at in self._levels:
            below, up_to = (np.diff(np.searchsorted(at, ends, side)) for side in ("left", "right"))
            inside = np.where(ends[:-1] >= 0.0, up_to, below)  # the outer end belongs to a segment
            if np.any(inside < np.where(beside_neutral, 2, 1)):
                return False
        return True

    def _design(self, nodes: Sequence[float]) -> Floats:
        """Return the derivatives of the readings by the constants, and each rise at each q̄."""
        ends, before_neutral = np.array(nodes), np.arange(len(nodes) - 1) < nodes.index(0.0)
        inside = (self._at[:, None] - ends[:-1]) / np.diff(ends)
        share = np.clip(inside, 0.0, 1.0) - before_neutral
        share = self._side[:, None] * share if self._odd else share
        rises = share[:, :, None] * self._at_pressure[:, None, :]
        return np.hstack((self._constant, rises.reshape(len(share), -1)))

    def _solve(self, nodes: Sequence[float]) -> tuple[Floats, Floats]:
        design = self._design(nodes)
        values, _ = nnls(design, self._force)
        return values, self._force - design @ values

    def _try(self, nodes: Sequence[float]) -> float:
        """Return the Bayesian information criterion of some nodes."""
        if not self._determined(nodes):
            return np.inf
        values, residual = self._solve(nodes)
        count = len(residual)
        least = (EXACT * float(np.max(np.abs(self._force)))) ** 2
        # A node that is not on the grid's ends is a parameter too; F_0 is one, of two values.
        free = len(values) + len(nodes) - 1 - len(self._ends) - (self._constant.shape[1] > 2)
        return float(
            count * np.log(np.mean(residual**2) + least) + min(free, count - 1) * np.log(count)
        )

    def _remove(self) -> None:
        """Remove the nodes without which the criterion is lower, the most needless first."""
        while True:
            inner = [node for node in self._nodes if node != 0.0 and node not in self._ends]
            tried = [[each for each in self._nodes if each != node] for node in inner]
            scores = [self._try(nodes) for nodes in tried]
            if not scores or min(scores) > self.criterion:
                return
            self.criterion = min(scores)
            self._nodes = tried[int(np.argmin(scores))]

    def _move(self) -> None:
        """Move each inner node while the criterion falls."""
        for share in MOVES:
            while sum(self._moved(k, share * self._step) for k in range(len(self._nodes))):
                pass

    def _add(self) -> bool:
        """Add the node in the middle of a segment with which the criterion is least, if lower."""
        tried = [sorted([*self._nodes, 0.5 * (a + b)]) for a, b in pairwise(self._nodes)]
        scores = [self._try(nodes) for nodes in tried]
        if min(scores) >= self.criterion - 1e-9 * abs(self.criterion):
            return False
        self.criterion, self._nodes = min(scores), tried[int(np.argmin(scores))]
        return True

    def _moved(self, k: int, by: float) -> bool:
        if self._nodes[k] == 0.0 or self._nodes[k] in self._ends:
            return False
        for way in (-by, by):
            nodes = [*self._nodes[:k], self._nodes[k] + way, *self._nodes[k + 1 :]]
            if nodes[k - 1] + 0.5 * by < nodes[k] < nodes[k + 1] - 0.5 * by:
                score = self._try(nodes)
                if score < self.criterion - 1e-9 * abs(self.criterion):
                    self.criterion, self._nodes = score, nodes
                    return True
        return False

    def _by_pressure(self, nodes: Sequence[float]) -> Floats:
        """Return breakout and friction at each q̄, if their evidence is very strong; else empty."""
        design, pressure = self._design(nodes), self._sweep.pressure[self._used]
        each = [design[:, k] * (pressure == q) for q in self._pressures for k in range(2)]
        split = np.column_stack((*each, design[:, 2:]))
        values, _ = nnls(split, self._force)
        residual, count = self._force - split @ values, len(self._force)
        least = (EXACT * float(np.max(np.abs(self._force)))) ** 2
        _, common = self._solve(nodes)
        gain = count * np.log((np.mean(common**2) + least) / (np.mean(residual**2) + least))
        more = (len(each) - 2) * np.log(count)
        found = np.asarray(values[: len(each)]).reshape(-1, 2)
        return found if gain > more + VERY_STRONG else found[:0]

    def feel(self) -> Feel:
        """Return the fit: the constants with the segments at neutral divided, then the curve."""
        zero = self._nodes.index(0.0)
        beside = self._nodes[max(zero - 1, 0) : zero] + self._nodes[zero + 1 : zero + 2]
        finer = sorted([*self._nodes, *(0.5 * node for node in beside)])
        straight = 0.0 if self._determined(finer) else max(map(abs, beside))
        nodes = self._nodes if straight else finer
        values, residual = self._solve(nodes)
        design = self._design(nodes)
        count = self._constant.shape[1]
        active = values > 0.0
        active[:2] = True
        freedom = max(len(residual) - int(np.count_nonzero(active)), 1)
        inverse = np.linalg.pinv(design[:, active].T @ design[:, active])
        spread = np.sqrt(float(residual @ residual) / freedom * np.diag(inverse)[:2])
        wide = float(student.ppf(0.975, freedom)) * spread
        rest = self._force - self._constant @ values[:count]
        curve = self._design(self._nodes)[:, count:]
        steps, _ = nnls(curve, rest)
        residual = rest - curve @ steps
        freedom = max(len(residual) - int(np.count_nonzero(steps)) - count, 1)
        rises = steps.reshape(len(self._nodes) - 1, len(self._pressures)).T
        force = np.concatenate((np.zeros((len(rises), 1)), np.cumsum(rises, axis=1)), axis=1)
        force -= force[:, [zero]]
        return Feel(
            *(float(values[0]), float(wide[0]), float(values[1]), float(wide[1])),
            *(self._pressures, np.array(self._nodes), force),
            float(np.sqrt(residual @ residual / freedom)),
            float(values[2] - values[3]) if count > 2 else 0.0,
            *(straight, self._sweep, self._used),
            self._by_pressure(nodes),
        )


def feel_text(feel: Feel, control: ControlName, source: str) -> str:
    """Return the keys of a rig file: loader's breakout and friction, and the schedule."""
    d = unit_of(control)

    def interval(half_width_N: float) -> str:
        return f"  # ± {half_width_N:.2g}, 95 %" if half_width_N > 0.0 else ""

    def listed(values: Floats) -> str:
        return "[" + ", ".join(repr(float(f"{value:.5g}") + 0.0) for value in values) + "]"

    rows = ",\n  ".join(listed(row) for row in feel.force)
    doubts = "".join(f"# Doubtful: {doubt}.\n" for doubt in feel.doubts(control))
    return f"""# Breakout, friction and curve of {source}, for a rig file in place of its own keys.
# The residual of the readings is {feel.rms_N:.3g} N RMS.
{doubts}
[controls.{control}.loader]
breakout_N = {feel.breakout_N:.4g}{interval(feel.breakout_half_width_N)}
friction_N = {feel.friction_N:.4g}{interval(feel.friction_half_width_N)}

[controls.{control}.schedule]
dynamic_pressure_Pa = {listed(feel.pressure)}
deflection_{d} = {listed(feel.deflection)}
force_N = [
  {rows},
]
"""
