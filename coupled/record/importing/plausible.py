"""Plausibility rules for channels, on arrays in SI.

A rule returns its finding, as a few words or a number, or nothing. Findings are doubts for the user
to judge: for example, a constant q̄ is normal in a bench record. `check_size` refuses, for readers
that make numbers of a rig from a channel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from coupled.errors import InputError
from coupled.record.channels import CONTROL_NAMES
from coupled.rig.bounds import REACHED
from coupled.units import POUND_N, FOOT_m, GRAVITY_m_per_s2

Floats = NDArray[np.float64]
FAR_BEYOND = 3.0  # times the travel, from which the unit is wrong
ROUNDING = 1e-9  # of a channel's own spread, for rounding of records in text
# Share of the motion correlated with the rate: a delay τ gives ω·τ, and leaves (ω·τ)²/2.
BESIDE_A_DELAY = 0.3  # up to ω·τ = 0.6, more than the delay of any sensor
FAR_RATIO = 2.0  # of a force over its spring's, from which a diagnosis refuses another rig's file
# N, and m or rad, in other units; lbf has rules of its own.
FORCES = {"kgf or daN": 9.9, "ozf": POUND_N / 16.0, "kN": 1e3}
_LENGTHS = {"in": 0.0254, "cm": 0.01, "mm": 1e-3, "ft": 0.3048}
_ANGLE = {"deg": np.pi / 180.0}
SAME_PRESSURE = (0.7, 1.4)  # q̄ over ½ρV²: the air is not the standard one, and q̄ may be impact
TOGETHER = 0.6  # correlation of a force with a spring's, from which its ratio shows its unit
WHOLE_RANGE = 0.9  # of the range: jump of a position that wraps
# Half and twice of these two change no test of imports and sensors.
END_OVER_STEP = 20.0  # least jump of a spike in the first or last row, over the step beside it
LEAST_POWER = 0.05  # correlation of force and rate from which power has a sign
# Of noise ten times its resolution, 1 of 35 rows repeats by chance, and four in a row in 1 of 10⁶.
RESOLVED, LONGEST_REPEAT = 10.0, 4
ON_GRID = 0.02  # of a step: deviation of levels of a quantised sensor from whole steps
REGULAR = 0.8  # share of steps that a sensor of a slower rate has at its own period, one row off
JUMP = 10.0  # standard deviations of noise; two rows of noise differ by half of it in 1 of 2500
SMALL_STEP = 0.2  # of the range: largest other step of a position from row to row

TURNING = ("roll_rad", "heading_rad")  # angles that wrap
# Bounds of channels of a rig or a transport aircraft in normal flight.
_BOUNDS: dict[str, tuple[float, float]] = {
    "force_N": (-2500.0, 2500.0),
    "modifying_force_N": (-2500.0, 2500.0),
    "dynamic_pressure_Pa": (-50.0, 1e5),
    "true_airspeed_m_per_s": (-1.0, 1000.0),
    "altitude_m": (-500.0, 30_000.0),
    "gradient_N_per_m": (0.0, 1e6),
    "gradient_N_per_rad": (0.0, 1e6),
}
_ANGLES = {"roll_rad": 2.0 * np.pi, "heading_rad": 4.0 * np.pi}
_SMALL_ANGLE_rad = np.pi / 2.0
_FASTEST_rad_per_s = 6.0


def noise_level(values: Floats, order: int = 4) -> float:
    """Return the standard deviation of a channel's white noise, from its fourth differences.

    The median makes it robust to steps and outliers. Differences of another `order` give the same
    for white noise, and higher orders less for a motion.
    """
    if values.size <= order:
        return 0.0
    power = math.comb(2 * order, order)  # the sum of the squared binomial coefficients
    return float(np.median(np.abs(np.diff(values, order))) / (0.6745 * math.sqrt(power)))


def is_constant(values: Floats) -> bool:
    """Tell whether a channel never changes."""
    return bool(np.ptp(values) == 0.0)


def copy_of(name: str, channels: Mapping[str, Floats]) -> str | None:
    """Return the first channel before `name` with exactly the same numbers.

    Not an estimate and the computed deflection, which agree without correction, nor constants.
    """
    values = channels[name]
    if is_constant(values):
        return None
    for other, theirs in channels.items():
        if other == name:
            return None
        same = {name.partition("_")[2], other.partition("_")[2]}
        if same in ({"computed_m", "estimate_m"}, {"computed_rad", "estimate_rad"}):
            continue
        if np.array_equal(values, theirs):
            return other
    return None


def clipped_at(values: Floats) -> float | None:
    """Return the extreme at which a noisy channel is constant for five rows or more."""
    return None if noise_level(values) == 0.0 else held_extreme(values)


def held_extreme(values: Floats) -> float | None:
    """Return the extreme at which a channel that changes is constant for five rows or more."""
    ends = float(values.max()), float(values.min())
    between = ~np.isin(values, ends)
    still = (np.diff(values) == 0.0) & between[1:]
    for extreme in ends:
        if _longest(values == extreme) >= max(5, 4 * (1 + _longest(still))):
            return extreme
    return None


def held(values: Floats, most_rows: float = math.inf) -> str:
    """Return how a sensor repeats its value where it should have moved, or nothing.

    It may renew its value every few rows, at most `most_rows`, by steps far above its resolution.
    Or it stands still in noise that is far above its resolution, and jumps before or after: a
    sensor at rest does not. Noise is seen if its differences of fourth and sixth order agree. The
    largest and least values are not judged (`clipped_at`).
    """
    change, levels = np.diff(values), np.unique(values)
    if levels.size < 3:
        return ""
    # Rows interpolated between counts lie on all levels, but an encoder at rest repeats a count.
    step = _step_of_grid(np.unique(values[1:][change == 0.0])) or float(np.diff(levels).min())
    coarse, moved = RESOLVED * step, np.flatnonzero(change)
    spacing = np.diff(moved)
    every = float(np.median(spacing))
    regular = float(np.mean(np.abs(spacing - every) <= 1.0)) > REGULAR
    steps = regular and float(np.median(np.abs(change[moved]))) > coarse
    if steps and 2.0 <= every <= most_rows:
        return f"holds each value over {every:g} rows"
    noise = _seen_noise(values)
    if noise <= coarse:
        return ""
    still = (change == 0.0) & ~np.isin(values[1:], (values.max(), values.min()))
    jumps = np.abs(np.concatenate(([0.0], change, [0.0]))) > JUMP * noise
    begins, lengths = _runs(still)
    stuck = (lengths >= LONGEST_REPEAT) & (jumps[begins] | jumps[begins + lengths + 1])
    if not stuck.any():
        return ""
    k = int(np.argmax(lengths * stuck))
    rows = f"rows {begins[k] + 2} to {begins[k] + lengths[k] + 2}"
    return f"stands still over {rows}"


def chance_of_repeats(values: Floats) -> float:
    """Return the probability that a row of a channel repeats the row before by chance.

    Of white noise far above a resolution it is the resolution over 2·√π standard deviations. It is
    1 without noise, since a channel at rest then repeats its value.
    """
    noise, levels = _seen_noise(values), np.unique(values)
    if noise == 0.0 or levels.size < 2:
        return 1.0
    return min(1.0, float(np.diff(levels).min()) / (2.0 * math.sqrt(math.pi) * noise))


def _seen_noise(values: Floats) -> float:
    """Return a channel's noise; 0 below rounding, or if orders of differences do not agree."""
    noise = noise_level(values)
    seen = noise > ROUNDING * float(np.ptp(values)) and noise_level(values, 6) >= 0.5 * noise
    return noise if seen else 0.0


def _runs(true: NDArray[np.bool_]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the begins and lengths of the runs of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], true, [False])).astype(np.int8)))
    return edges[::2], edges[1::2] - edges[::2]


def _longest(true: NDArray[np.bool_]) -> int:
    """Return the length of the longest run of true values."""
    return int(_runs(true)[1].max(initial=0))


def _step_of_grid(levels: Floats) -> float | None:
    """Return the least step of sorted levels, if all steps are whole multiples of it, or None."""
    steps = np.diff(levels)
    if steps.size < 2:
        return None
    counts = steps / steps.min()
    return float(steps.min()) if np.all(np.abs(counts - np.rint(counts)) < ON_GRID) else None


def quantised_step(values: Floats) -> float | None:
    """Return the step of a channel whose quantisation hides its noise."""
    levels = np.unique(values)
    if levels.size < 3:
        return None
    step = _step_of_grid(levels)
    if step is None:
        return None
    coarse = step > 1.5 * noise_level(values) and step > 1e-3 * np.ptp(values)
    # Few rows always lie on some levels, so each level must occur more than once on average.
    return step if coarse and 2 * levels.size < values.size else None


def spikes(values: Floats) -> list[int]:
    """Return the rows that differ from neighbours which agree; at an end, from the next two."""
    if values.size < 5:
        return []
    deviation = values[1:-1] - 0.5 * (values[2:] + values[:-2])
    spacing = np.abs(values[2:] - values[:-2])
    least = max(12.0 * noise_level(values), 0.02 * float(np.ptp(values)))
    single = (np.abs(deviation) > least) & (3.0 * spacing < np.abs(deviation))
    found = [int(row) + 1 for row in np.flatnonzero(single)]
    for end, beside, other in ((0, 1, 2), (-1, -2, -3)):
        off, apart = abs(values[end] - values[beside]), abs(values[beside] - values[other])
        if off > max(least, END_OVER_STEP * apart):
            found.append(end % values.size)
    return sorted(found)


def starts_again(values: Floats) -> int | None:
    """Return the first row at which a position jumps over nearly all of its range, or None.

    A wrapped angle or counter does so, with small steps between jumps. A value that returns at the
    next row is a spike.
    """
    steps = np.abs(np.diff(values))
    span = float(np.ptp(values))
    jumps = np.flatnonzero(steps > WHOLE_RANGE * span)
    others = steps[steps <= WHOLE_RANGE * span]
    single = {row - 1 for row in spikes(values)} | set(spikes(values))
    jumps = np.array([row for row in jumps if row not in single], dtype=np.int64)
    if not jumps.size or not others.size or float(others.max()) > SMALL_STEP * span:
        return None
    return int(jumps[0]) + 1


def force_ratio(force_N: Floats, deflection: Floats, gradient: Floats) -> float | None:
    """Return the force over gradient times deflection, by least squares.

    None if they hardly correlate: the force of a fast motion is from inertia and damping.
    """
    expected = gradient * deflection
    shared, power = float(force_N @ expected), float(expected @ expected)
    together = abs(shared) >= TOGETHER * np.sqrt(float(force_N @ force_N) * power)
    return shared / power if power > 0.0 and together else None


def bend_sign(force_N: Floats, computed: Floats, deflection: Floats) -> int:
    """Return the sign of `bend_slope`."""
    return int(np.sign(bend_slope(force_N, computed, deflection)))


def bend_slope(force_N: Floats, computed: Floats, deflection: Floats) -> float:
    """Return the slope of δ − δc on F, d/N; 0 if they hardly correlate.

    A structure bends under a pull, so that δ = δc + K·F with K > 0: −1 means that δ and δc are
    exchanged, or have different scales. The part correlated with the rate of the motion, by a late
    sensor, is removed from both first.
    """
    rate = np.gradient(computed)
    off = np.column_stack([np.ones(rate.size), rate])
    apart = deflection - computed
    left, pull = (y - off @ np.linalg.lstsq(off, y, rcond=None)[0] for y in (apart, force_N))
    scale = float(np.sqrt((left @ left) * (pull @ pull)))
    # The difference of two equal channels is rounding only.
    if float(np.std(apart)) <= ROUNDING * float(np.std(computed)) or scale == 0.0:
        return 0.0
    if float(np.std(left)) < BESIDE_A_DELAY * float(np.std(apart - left)):
        return 0.0
    shared = float(left @ pull)
    return shared / float(pull @ pull) if abs(shared) >= TOGETHER * scale else 0.0


def unit_doubt(ratio: float, turned: bool) -> str | None:
    """Return the unit in which a force would be right that is `ratio` times a spring's, if any.

    `turned`: the deflection is an angle. A ratio within a factor of 2 is in doubt only if it is
    that of pounds.
    """
    size = abs(ratio)
    if in_pounds(size):
        return "looks like pounds"
    if from_newtons(size):
        return "was N already, not lbf?"
    if 1.0 / FAR_RATIO < size < FAR_RATIO:
        return None
    says = f"is {size:.2g} times the spring's force (gradient times deflection)"
    for units, kind in ((FORCES, "force"), (_ANGLE if turned else _LENGTHS, "deflection")):
        for word, factor in units.items():
            wrong = size * factor if kind == "force" else size / factor
            if abs(wrong - 1.0) < 0.1:
                return f"{says}: the {kind} in {word}?"
    return f"{says}: another unit, scale or rig?"


def in_pounds(ratio: float) -> bool:
    """Tell whether a force ratio is that of a force in lbf read as N."""
    return abs(ratio * POUND_N - 1.0) < 0.25


def from_newtons(ratio: float) -> bool:
    """Tell whether a force ratio is that of a force in N read as lbf."""
    return abs(ratio / POUND_N - 1.0) < 0.25


def move_oppositely(first: Floats, second: Floats, most: float = -0.3) -> bool:
    """Tell whether two channels that should have one sign have opposite ones.

    Their correlation is then below `most`.
    """
    a, b = first - np.median(first), second - np.median(second)
    scale = float(np.sqrt((a @ a) * (b @ b)))
    return scale > 0.0 and float(a @ b) / scale < most


def drives_the_hand(force_N: Floats, deflection: Floats) -> bool:
    """Tell whether a force's spring and power are both negative, as of a reversed sensor.

    At a fast motion inertia alone turns the force against the deflection, but a loader takes power
    from the hand at any rate.
    """
    rate = np.gradient(deflection)
    terms = np.column_stack([np.ones(rate.size), deflection, rate, np.gradient(rate)])
    spring = np.linalg.lstsq(terms, force_N, rcond=None)[0][1]
    force = force_N - force_N.mean()
    scale = float(np.sqrt((force @ force) * (rate @ rate)))
    return bool(spring < 0.0) and float(force @ rate) < -LEAST_POWER * scale


def lacks_its_sign(force_N: Floats, deflection: Floats) -> bool:
    """Tell whether a force is never negative while the control moves far to both sides."""
    most, least = float(deflection.max()), float(deflection.min())
    both = min(most, -least) > 0.2 * max(most, -least)
    return both and float(force_N.min()) >= 0.0 and float(np.ptp(force_N)) > 0.0


def beyond_travel(deflection: Floats, travel: float) -> float | None:
    """Return the largest deflection over the travel, if it exceeds it by more than noise."""
    most = float(np.max(np.abs(deflection)))
    return most / travel if most > 1.05 * travel + 5.0 * noise_level(deflection) else None


def check_size(name: str, values: Floats, file: object) -> None:
    """Raise InputError for a channel whose size shows another unit; `file` is named."""
    if (doubt := size_doubt(name, values)) is not None:
        most = float(np.max(np.abs(values)))
        raise InputError(file, name, f"reaches {most:.3g}, and {doubt}; give it in its unit")


def size_doubt(name: str, values: Floats) -> str | None:
    """Return a doubt about a channel's unit from its size: degrees, millimetres, g less one."""
    low, high = float(values.min()), float(values.max())
    most = max(-low, high)
    control, _, rest = name.partition("_")
    plain = rest if control in CONTROL_NAMES else name
    if name == "load_factor":
        return _level_doubt(float(np.median(values)))
    angle, size = _largest(name)
    if most > size:
        return "looks like degrees" if angle else "looks like mm, cm or in"
    least, greatest = _BOUNDS.get(plain, (-np.inf, np.inf))
    return f"beyond {least:g} to {greatest:g}" if low < least or high > greatest else None


def _largest(name: str) -> tuple[bool, float]:
    """Return whether a channel is an angle or its rate, and its largest plausible value."""
    if name.endswith("_rad_per_s"):
        return True, _FASTEST_rad_per_s
    if name.endswith("_rad") and "_N_per_" not in name:
        turns = REACHED["rad"] if name.startswith("wheel_") else _SMALL_ANGLE_rad
        return True, _ANGLES.get(name, turns)
    length = name.endswith("_m") and "_N_per_" not in name and name != "altitude_m"
    return False, REACHED["m"] if length else np.inf


def _level_doubt(median: float) -> str | None:
    """Return a doubt if a load factor is not +1 for most of the time, as in level flight."""
    if abs(median) < 0.3:
        return "is 0 in level flight: offset 1?"
    if median < -0.5:
        return "is -1 in level flight: sign?"
    for unit, size in (("m/s²", GRAVITY_m_per_s2), ("ft/s²", GRAVITY_m_per_s2 / FOOT_m)):
        if abs(median / size - 1.0) < 0.1:
            return f"is {median:.3g} in level flight: looks like {unit}"
    return f"is {median:.3g} in level flight" if median > 5.0 else None


def pressure_ratio(
    pressure_Pa: Floats, airspeed_m_per_s: Floats, altitude_m: Floats
) -> float | None:
    """Return q̄ over ½·ρ·V² of airspeed and altitude, standard atmosphere; None at rest."""
    kelvin = np.maximum(288.15 - 0.0065 * np.clip(altitude_m, -500.0, 11_000.0), 216.65)
    density = 1.225 * (kelvin / 288.15) ** 4.2559
    density *= np.exp(-np.maximum(altitude_m - 11_000.0, 0.0) / 6341.6)
    expected = float(np.median(0.5 * density * airspeed_m_per_s**2))
    return float(np.median(pressure_Pa)) / expected if expected > 50.0 else None
