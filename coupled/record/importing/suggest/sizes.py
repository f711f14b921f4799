"""Units and signs of a column from the size of its numbers, if unambiguous."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from coupled.record.importing.clock import EVEN_frames
from coupled.record.importing.mapping import factor_of, own_unit
from coupled.record.importing.rows import COARSE
from coupled.rig.parameters import Control
from coupled.units import parse_unit

Floats = NDArray[np.float64]
# The largest value of a channel in a test, in its own unit: of a gentle test, and the limit.
_PEAKS = {
    "m": (0.01, 0.5),
    "rad": (0.02, 3.5),
    "N": (1.0, 2500.0),
    "Pa": (100.0, 60_000.0),
    "m/s": (10.0, 400.0),
    "rad/s": (0.01, 3.0),
    "g": (0.5, 6.0),
}
_UNITS = {
    "m": ("m", "cm", "mm", "in"),
    "rad": ("rad", "deg"),
    "N": ("N", "daN", "lbf", "kgf"),
    "Pa": ("Pa", "hPa", "kPa", "psf"),
    "m/s": ("m/s", "km/h", "kt", "ft/s"),
    "rad/s": ("rad/s", "deg/s"),
    "g": ("g",),
}
_ALTITUDES = ("m", "ft")
RATES_Hz = (5.0, 5000.0)  # range of the rates of test logs
COMMON_Hz = (
    *(10.0, 20.0, 25.0, 30.0, 40.0, 50.0, 60.0, 64.0, 75.0, 80.0, 100.0, 120.0, 125.0, 128.0),
    *(200.0, 240.0, 250.0, 256.0, 400.0, 480.0, 500.0, 1000.0, 2000.0),
)
TIMES = ("s", "ms", "us", "ns", "d")  # days: serial numbers of spreadsheets
USUAL = 0.5  # largest deviation of a usual step from the median one, relative
LEAST_others = 10  # different numbers beside a sentinel
FAR = 5.0  # distance of a sentinel from the other numbers, over their range
COUNTS = 100.0  # integers above this are counts of an encoder or a converter


def units_that_fit(channel: str, values: Floats, control: Control | None = None) -> list[str]:
    """Return the units in which a channel's largest value is realistic.

    The travel of the rig's `control` reduces them: a test covers at least a tenth of it.
    """
    if channel == "altitude_m":
        return list(_ALTITUDES)
    own = own_unit(channel)
    if own not in _PEAKS:
        return [own] if own != "1" else ["1"]
    least, most = _PEAKS[own]
    if control is not None and own in ("m", "rad") and "deflection" in channel + "computed":
        least, most = 0.1 * control.travel, 1.2 * control.travel
    peak = float(np.nanmax(np.abs(values), initial=0.0))
    return [u for u in _UNITS[own] if least <= peak * factor_of(channel, u, "") <= most]


def time_units(values: Floats) -> list[str]:
    """Return the units of time in which the usual time of a row is realistic for a test's log."""
    steps = forward_steps(values)
    step = float(np.median(steps)) * steps.size / (values.size - 1)  # stamps may be coarse
    fit = []
    for name in TIMES:
        unit = parse_unit(name)
        if unit is not None and step > 0.0:
            rate = 1.0 / (step * unit.factor)
            fit += [name] if RATES_Hz[0] <= rate <= RATES_Hz[1] else []
    return fit


def forward_steps(values: Floats) -> Floats:
    """Return the steps of a time from row to row in its main direction, without repetitions."""
    steps = np.diff(values[np.isfinite(values)])
    sign = 1.0 if np.count_nonzero(steps > 0.0) >= np.count_nonzero(steps < 0.0) else -1.0
    return np.asarray(sign * steps[sign * steps > 0.0])


def even_rate(time_s: Floats) -> float | None:
    """Return a rate, in Hz, for frames over uneven rows; None if they are even, or it is unclear.

    It is that of the steps near the median one: gaps and steps back do not change it. A round
    rate, if there is one within 3 % of the rows' own.
    """
    steps = forward_steps(time_s)
    usual = steps[np.abs(steps / np.median(steps) - 1.0) < USUAL]
    if usual.size < (1.0 - COARSE) * (time_s.size - 1):
        return None
    rate = 1.0 / float(usual.mean())
    stray = np.cumsum(usual * rate - 1.0)
    if float(np.ptp(stray)) < EVEN_frames or not RATES_Hz[0] <= rate <= RATES_Hz[1]:
        return None
    near = [each for each in COMMON_Hz if abs(each / rate - 1.0) < 0.03]
    return min(near, key=lambda each: abs(each - rate)) if near else float(f"{rate:.3g}")


def are_counts(values: Floats) -> bool:
    """Tell whether a column has integers as large as those of an encoder."""
    there = values[np.isfinite(values)]
    return bool(there.size and np.all(there == np.rint(there)) and np.ptp(there) >= COUNTS)


def sentinels(values: Floats) -> list[float]:
    """Return the numbers that stand for an empty cell: each repeats, far outside the others."""
    there = values[np.isfinite(values)]
    ends = (there.min(), there.max()) if there.size and not kept_sign(values) else ()
    others = there[(there > ends[0]) & (there < ends[1])] if ends else there
    if np.unique(others).size < LEAST_others:
        return []
    return [
        float(end)
        for end in ends
        if np.count_nonzero(there == end) > 1
        and np.abs(others - end).min() > FAR * float(np.ptp(others))
    ]


def kept_sign(values: Floats) -> str:
    """Return how counts that are never negative may encode a sign, in words, or "".

    With a sign bit there are small and large numbers, and none in between.
    """
    there = values[np.isfinite(values)]
    if not there.size or there.min() < 0.0 or not are_counts(values):
        return ""
    for bit in range(7, 33):
        half = 2.0**bit
        above = there[there >= half]
        below = there[there < half]
        if not (above.size and below.size and there.max() < 2.0 * half):
            continue
        if below.max() < 0.6 * half and above.max() < 1.6 * half:
            return f"sign_bit = {bit}"
        if below.max() < 0.6 * half and above.min() > 1.4 * half:
            return f"wraps_at = {2 * half:.0f}"
    return ""
