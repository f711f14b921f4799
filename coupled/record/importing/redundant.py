"""The unit of a channel, by comparison with other channels and with the rig.

A channel is compared with a quantity that others determine: q̄ with ½ρV², an angular rate with the
attitude, altitude with the flight path, a force with the spring of the rig. Only a ratio close to
that of a known unit shows another unit. Any other ratio may be a gap.

Two channels alone do not show which of them is wrong, but units do: a dynamic pressure in psf is 48
times too small, and no unit of airspeed in use explains the same ratio. For a force the third
witnesses are the bend of the structure and the damping. A gradient that is off by 4 changes neither
of them, and a force in pounds changes both.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.record.channels import ATTITUDE, RATE, TIME, ControlName, channel, motions_in
from coupled.record.importing import plausible
from coupled.rig.equations import specified_force, specified_gradient
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.units import POUND_N, DEGREE_rad, FOOT_m, KNOT_m_per_s, PSF_Pa

Floats = NDArray[np.float64]
Channels = Mapping[str, Floats]

PRESSURE, SPEED, ALTITUDE = "dynamic_pressure_Pa", "true_airspeed_m_per_s", "altitude_m"
ANGLES = {RATE[name]: ATTITUDE[name] for name in ("column", "wheel")}
_TURNS = tuple(RATE[name] for name in ("wheel", "column", "pedals"))
# Pa, m/s and N in units that are in use; inHg is the conventional one of NIST SP 811.
_PRESSURES = {"psf": PSF_Pa, "hPa": 100.0, "kPa": 1e3, "inHg": 3386.389, "psi": 144.0 * PSF_Pa}
_SPEEDS = {"kt": KNOT_m_per_s, "mph": 5280.0 * FOOT_m / 3600.0, "ft/s": FOOT_m, "km/h": 1.0 / 3.6}
_LARGER_FORCES = {"pounds": POUND_N, **{u: n for u, n in plausible.FORCES.items() if n > 1.0}}
_CLOSE = 0.1  # tolerance of a ratio, as that of a force over its spring
_ROUGHLY = 0.25  # tolerance of a force over its spring, with another witness; as of pounds
_HIGHEST_m = 15_545.0  # 51 000 ft, the highest certified ceiling of transport aircraft
_ALIKE = 0.9  # correlation of a rate's integral with its attitude


@dataclass(frozen=True)
class OtherUnit:
    """The unit that a channel seems to be in, its size in that of the channel, and the reason."""

    unit: str
    factor: float
    reason: str


def other_units(channels: Channels, rig: Rig | None) -> dict[str, OtherUnit]:
    """Return the channels of the motion that seem to be in another unit, with that unit."""
    if not all(np.isfinite(values).all() for values in channels.values()):
        return {}  # refused, or reported, elsewhere
    found = _by_attitude(channels) | _by_flight_path(channels)
    if SPEED in channels:
        return found | _by_airspeed(channels, rig)
    return found | (_by_feel(channels, rig) if rig is not None else {})


def _matching(ratio: float, units: Mapping[str, float], tolerance: float = _CLOSE) -> str | None:
    """Return the unit whose numbers are `ratio` of those that are expected, if any."""
    near = {unit: abs(np.log(max(ratio, 1e-300) * factor)) for unit, factor in units.items()}
    best = min(near, key=lambda unit: near[unit])
    return best if near[best] < np.log1p(tolerance) else None


def _by_airspeed(channels: Channels, rig: Rig | None) -> dict[str, OtherUnit]:
    """Compare q̄ with ½ρV², with the air's density at the altitude of the record or of the rig.

    Without an altitude the density is between those at sea level and at the highest ceiling.
    """
    if PRESSURE not in channels:
        return {}
    source, flight = "by airspeed", rig.flight if rig is not None else None
    if ALTITUDE in channels:
        source, altitudes = "by airspeed and altitude", [channels[ALTITUDE]]
    elif flight is not None:
        source, altitudes = "by airspeed at the rig's altitude", [np.array([flight.altitude])]
    else:
        altitudes = [np.array([height]) for height in (0.0, _HIGHEST_m)]
    ratios = [
        ratio
        for altitude in altitudes
        if (ratio := plausible.pressure_ratio(channels[PRESSURE], channels[SPEED], altitude))
    ]
    if not ratios or _within(ratios, 1.0):
        return {}
    reason = f"is {ratios[0]:.3g} of ½ρV² {source}"
    known = len(altitudes) == 1
    speed = _matching(ratios[0] ** 0.5, {u: 1.0 / f for u, f in _SPEEDS.items()})
    if known and speed is not None:
        reason = f"makes {PRESSURE} {ratios[0]:.3g} of ½ρV²"
        return {SPEED: OtherUnit(speed, _SPEEDS[speed], reason)}
    for unit, factor in _PRESSURES.items():
        if _within(ratios, factor):
            return {PRESSURE: OtherUnit(unit, factor, reason)}
    return {}


def _within(ratios: list[float], factor: float) -> bool:
    """Tell whether a q̄ times a factor is possible at one of the densities or between them."""
    low, high = plausible.SAME_PRESSURE
    return min(ratios) * factor < high and max(ratios) * factor > low


def _by_feel(channels: Channels, rig: Rig) -> dict[str, OtherUnit]:
    """Compare q̄ with that of the rig's trim, and both with the gradient or the force.

    A bench may be run at any q̄, so the trim alone shows no unit. A wrong gradient alone does not
    either.
    """
    if PRESSURE not in channels or rig.flight is None:
        return {}
    speed = np.array([rig.flight.calibrated_airspeed])
    ratio = plausible.pressure_ratio(channels[PRESSURE], speed, np.zeros(1))
    for unit, factor in _PRESSURES.items() if ratio else ():
        if ratio is None or not _within([ratio], factor):
            continue
        for control in rig.controls:
            as_read, converted = (_feel_ratio(channels, control, rig, f) for f in (1.0, factor))
            if as_read is None or converted is None:
                continue
            far = not 1.0 / plausible.FAR_RATIO < as_read < plausible.FAR_RATIO
            if far and abs(converted - 1.0) < _ROUGHLY:
                reason = f"is {ratio:.3g} of the trim's, and {control} forces contradict it"
                return {PRESSURE: OtherUnit(unit, factor, reason)}
    return {}


def _feel_ratio(channels: Channels, control: ControlName, rig: Rig, factor: float) -> float | None:
    """Return the recorded gradient, or else the force, over that of the rig at `factor` times q̄."""
    gradient, pressure = channel(control, "gradient"), factor * channels[PRESSURE]
    data = rig.controls[control]
    if gradient in channels:
        specified = float(np.median(specified_gradient(data.schedule, pressure)))
        return float(np.median(channels[gradient])) / specified if specified > 0.0 else None
    return _spring_ratio(channels, control, rig, pressure)


def _spring_ratio(
    channels: Channels, control: ControlName, rig: Rig, pressure: Floats
) -> float | None:
    """Return the force over that of the rig's feel; None without force or motion.

    At δ if the rig compensates its bend, or else at δc.
    """
    force, moved = channel(control, "force"), motions_in(channels, control)
    if force not in channels or not moved:
        return None
    compensated = rig.controls[control].compensation
    spring = specified_force(rig, control, pressure, channels[moved[-compensated.gradient]])
    return plausible.force_ratio(channels[force], spring, np.ones(1))


def _by_attitude(channels: Channels) -> dict[str, OtherUnit]:
    """Compare the pitch and roll rates with the changes of their angles."""
    found = {}
    for rate, angle in ANGLES.items():
        share = rate_ratio(channels, rate)
        for name, ratio in ((rate, share), (angle, 1.0 / share if share else None)):
            if ratio is not None and _matching(ratio, {"deg": DEGREE_rad}):
                unit = "deg/s" if name == rate else "deg"
                reason = f"is {ratio:.3g} of what {angle if name == rate else rate} shows"
                found[name] = OtherUnit(unit, DEGREE_rad, reason)
    return found


def rate_ratio(channels: Channels, rate: str) -> float | None:
    """Return a pitch or roll rate over the change of its angle; None if they hardly correlate.

    θ̇ = q·cos φ − r·sin φ and φ̇ = p + (q·sin φ + r·cos φ)·tan θ; a channel that is missing is 0. The
    integral of the rate is compared, which has little noise. An offset of the rate is removed.
    """
    angle = ANGLES.get(rate, "")
    if rate not in channels or angle not in channels:
        return None
    none = np.zeros(channels[rate].size)
    roll, pitch, p, q, r = (channels.get(name, none) for name in ("roll_rad", "pitch_rad", *_TURNS))
    turned = q * np.cos(roll) - r * np.sin(roll)
    if angle == "roll_rad":
        turned = p + (q * np.sin(roll) + r * np.cos(roll)) * np.tan(pitch)
    return _slope(_integral(channels[TIME], turned), np.unwrap(channels[angle]))


def reversed_rates(channels: Channels) -> dict[str, str]:
    """Return the angle of each rate that is the negative of its change."""
    ratios = {rate: rate_ratio(channels, rate) for rate in ANGLES}
    return {
        rate: ANGLES[rate]
        for rate, ratio in ratios.items()
        if ratio is not None and _matching(-ratio, {"reversed": 1.0})
    }


def _by_flight_path(channels: Channels) -> dict[str, OtherUnit]:
    """Compare altitude with the integral of V·sin γ, as of wings that are nearly level."""
    if not {SPEED, ALTITUDE, "pitch_rad", "alpha_rad"} <= set(channels):
        return {}
    climb = channels[SPEED] * np.sin(channels["pitch_rad"] - channels["alpha_rad"])
    ratio = _slope(channels[ALTITUDE], _integral(channels[TIME], climb))
    if ratio is None or not _matching(ratio, {"ft": FOOT_m}):
        return {}
    return {ALTITUDE: OtherUnit("ft", FOOT_m, f"changes {ratio:.3g} times as the flight path")}


def _integral(time_s: Floats, values: Floats) -> Floats:
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(time_s)
    return np.concatenate(([0.0], np.cumsum(steps)))


def _slope(signal: Floats, on: Floats) -> float | None:
    """Return the slope of a signal on another, beside a straight line; None if hardly alike."""
    line = np.column_stack([np.ones(signal.size), np.linspace(-1.0, 1.0, signal.size)])
    first, second = (y - line @ np.linalg.lstsq(line, y, rcond=None)[0] for y in (signal, on))
    shared, power = float(first @ second), float(second @ second)
    alike = abs(shared) > _ALIKE * np.sqrt(float(first @ first) * power)
    return shared / power if power > 0.0 and alike else None


def force_unit(channels: Channels, rig: Rig, control: ControlName) -> OtherUnit | None:
    """Return the unit that a control's force seems to be in, if it is another.

    The force is compared with the recorded gradient, or else with the rig's feel at q̄. Bend and
    damping must not contradict. Without both of them, only a close ratio shows a unit.
    """
    data = rig.controls.get(control)
    force, gradient = (channel(control, quantity) for quantity in ("force", "gradient"))
    moved = motions_in(channels, control)
    if data is None or force not in channels or not moved:
        return None
    ratio, source = None, "the rig"
    if gradient in channels:
        spring, source = channels[gradient], "gradient"
        ratio = plausible.force_ratio(channels[force], channels[moved[0]], spring)
    elif (pressure := feel_pressure(channels, data)) is not None:
        ratio = _spring_ratio(channels, control, rig, pressure)
    unit = None if ratio is None else _larger_force(ratio)
    if ratio is None or unit is None:
        return None
    factor = _LARGER_FORCES[unit]
    each = (_bend_ratio(channels, control, data), _damping_ratio(channels, control, data))
    witnesses = [one for one in each if one is not None]
    close = witnesses or _matching(ratio, {unit: factor})
    if not close or any(one > factor**-0.5 for one in witnesses):
        return None
    return OtherUnit(unit, factor, f"is {ratio:.2g} of what deflection and {source} give")


def _larger_force(ratio: float) -> str | None:
    """Return the unit, larger than N, of a force that is `ratio` of the expected one, if any."""
    if plausible.in_pounds(ratio):
        return "pounds"
    return _matching(ratio, _LARGER_FORCES)


def feel_pressure(channels: Channels, data: Control) -> Floats | None:
    """Return q̄ for a rig's table; without q̄, any value if the table is constant, or else None."""
    if PRESSURE in channels:
        return channels[PRESSURE]
    first, *rest = data.schedule.segments[0]
    if len(data.schedule.segments) > 1 or any(each != first for each in rest):
        return None
    return np.zeros(next(iter(channels.values())).size)


def _bend_ratio(channels: Channels, control: ControlName, data: Control) -> float | None:
    """Return the force's unit by the bend: K of the rig over that of the record."""
    moved = [channels[name] for name in motions_in(channels, control)]
    if len(moved) < 2 or data.loader.bend == 0.0:
        return None
    slope = plausible.bend_slope(channels[channel(control, "force")], *moved)
    return data.loader.bend / slope if slope > 0.0 else None


def _damping_ratio(channels: Channels, control: ControlName, data: Control) -> float | None:
    """Return the force correlated with the rate over that by the rig's damping and friction."""
    force, moved = channels[channel(control, "force")], channels[motions_in(channels, control)[0]]
    rate = np.gradient(moved, channels[TIME])
    resists = data.loader.damping * rate + data.loader.friction * np.sign(rate)
    others = np.column_stack([np.ones(rate.size), moved, np.gradient(rate, channels[TIME])])
    left, pull = (y - others @ np.linalg.lstsq(others, y, rcond=None)[0] for y in (resists, force))
    shared, power = float(left @ pull), float(left @ left)
    alike = abs(shared) > plausible.TOGETHER * np.sqrt(power * float(pull @ pull))
    return shared / power if power > 0.0 and alike else None
