"""A rig whose host uses a calibration.

A calibration changes the host's assumptions, not the hardware: S₁, S₂, S₃ and K̂ become the values
found, and each factor of true over assumed scale is adjusted to the same hardware. v₁ is read at
the host: an S₁ that is wrong in the electronics is corrected for reading and analog product alike.
An error of the host's reading alone (`deflection_scale`) remains: the S₁ found includes it, the
reading is right, and the analog product is wrong by its inverse.

A scale that the rig file does not state is known from the readings only, so the hardware gets the
value found. If the file states a scale or K, and readings of another loader contradict it, the rig
would not fly as the calibration promises, and it is refused.
"""

from __future__ import annotations

from typing import Any

from coupled.arguments import public
from coupled.calibration.accuracy import (
    DEFLECTION_WITHIN,
    FELT_WITHIN,
    actual_over_ordered,
    deflection_off,
    felt_off,
)
from coupled.calibration.assumedscales import GAINS, assumed_scales, real_scales
from coupled.calibration.estimate import Estimate
from coupled.calibration.result import CalibrationResult
from coupled.errors import InputError, nearest
from coupled.record.channels import ControlName, unit_of
from coupled.rig.guesses import without_guesses
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig

_ROUNDING = 1e-15  # relative; a smaller error is rounding
_BEYOND = 3.0  # half widths of a 95 % interval, beyond which the hardware differs


@public
def with_calibration(
    rig: Rig,
    control: ControlName,
    found: CalibrationResult,
    date: str = "",
    hardware: bool = False,
) -> Rig:
    """Return the rig whose host uses a calibration of one of its controls.

    `date` is stored as given. With `hardware` the rig's own structure and scales become those
    found, too: for readings of a real loader, whose rig file is a model. A scale that the file does
    not state becomes that found in any case. Raises InputError if the rig lacks the control, the
    calibration is of another one, or the values give an impossible rig.

    >>> import coupled
    >>> rig = coupled.load_rig("report-column")
    >>> found = coupled.calibrate(coupled.bench(rig, gradients=3, deflections=3), rig)
    >>> calibrated = coupled.with_calibration(rig, "column", found)
    >>> calibrated["controls.column.compensation.bend_m_per_N"] == found.line.bend.value
    True
    """
    if control not in rig.controls:
        problem = f"the rig has no {control}; {nearest(control, rig.controls)}"
        raise InputError(rig.place, "controls", problem)
    if found.control != control:
        problem = f"the calibration is of the {found.control}, not of the {control}"
        raise InputError(rig.place, control, problem)
    data, d = rig.controls[control], unit_of(control)
    place, sensing = f"controls.{control}", data.sensing
    bend = found.line.bend
    real, reading = real_scales(data), sensing.deflection_scale
    figures = _in_volts(found)
    kept = {name: not hardware and _is_filed(data, name, each) for name, each in figures.items()}
    s1, s2, s3 = figures["s1"], figures["s2"], figures["s3"]
    used = max(bend.value, 0.0)  # no structure bends against its force
    changes: dict[str, Any] = {
        f"compensation.bend_{d}_per_N": used,
        "calibration.readings": found.count,
        "calibration.date": date,
        f"calibration.bend_{d}_per_N": bend.value,
        f"calibration.bend_error_{d}_per_N": _error(bend),
        "calibration.length_m": data.length,
    }
    for name, unit in GAINS.items():
        key = f"{name}_{unit.format(d=d)}" if unit else name
        changes[f"calibration.{key}"] = getattr(data.gains, name)
    if s1 is not None:
        computed = (real.s1 / s1.value if kept["s1"] else 1.0) / reading
        changes |= {
            f"sensing.s1_V_per_{d}": s1.value,
            "sensing.computed_scale": 1.0 if hardware else computed,
            "sensing.deflection_scale": 1.0 if hardware else reading,
            f"calibration.s1_V_per_{d}": s1.value,
            f"calibration.s1_error_V_per_{d}": _error(s1),
        }
    if s3 is not None:
        changes |= {
            "sensing.s3_V_per_N": s3.value,
            "sensing.force_scale": real.s3 / s3.value if kept["s3"] else 1.0,
            "calibration.s3_V_per_N": s3.value,
            "calibration.s3_error_V_per_N": _error(s3),
        }
    if s2 is not None:
        changes["sensing.s2_V_per_N"] = s2.value
        changes["sensing.modifying_scale"] = real.s2 / s2.value if kept["s2"] else 1.0
        changes["calibration.s2_V_per_N"] = s2.value
        changes["calibration.s2_error_V_per_N"] = _error(s2)
    if hardware:
        changes[f"loader.bend_{d}_per_N"] = used
    whole = {f"{place}.{key}": value for key, value in changes.items()}
    for name, estimate in found.fit.others.items():
        key = f"{control}_by_{name}_{d}_per_N"
        whole[f"structure.assumed.{key}"] = estimate.value
        if hardware:
            whole[f"structure.{key}"] = estimate.value
    return rig.changed(whole | without_guesses(rig.controls, whole))


def _in_volts(found: CalibrationResult) -> dict[str, Estimate | None]:
    """Return S₁, S₂ and S₃ by name; of a converter's counts, no rig file has a scale."""
    if found.readings.signal == "counts":
        return dict.fromkeys(("s1", "s2", "s3"))
    return {"s1": found.line.s1, "s2": found.s2_chosen, "s3": found.s3}


def _is_filed(control: Control, name: str, found: Estimate | None) -> bool:
    """Return whether the rig file states a scale, or the readings are of its own bench.

    The bench of a rig that states none uses the converters' full scale.
    """
    if found is None or getattr(control.sensing, name) > 0.0:
        return True
    real: float = getattr(real_scales(control), name)
    return abs(found.value - real) <= max(_BEYOND * found.half_width, 1e-6 * abs(real))


def unstated_scales(control: Control, found: CalibrationResult) -> list[str]:
    """Return the keys of the scales found that the rig file does not state."""
    scales = _in_volts(found).items()
    units = {"s1": f"V_per_{unit_of(found.control)}"}
    missing = [name for name, each in scales if not _is_filed(control, name, each)]
    return [f"{name}_{units.get(name, 'V_per_N')}" for name in missing]


def refuse_other_hardware(
    filed: Control, new: Control, found: CalibrationResult, file: object
) -> None:
    """Raise InputError if the calibrated rig would exceed the errors promised in flight.

    `filed` is the control of the rig file, `new` with the calibration. The readings are then of
    other hardware than the file's.
    """
    promise = found.accuracy
    if promise is None:
        return
    g, bend = promise.gradient, new.compensation.bend
    host, true, true_bend = assumed_scales(new), real_scales(new), new.loader.bend
    off = deflection_off(host, bend, true, true_bend, g)
    gradients = (g, new.loader.basic_gradient)
    felt = felt_off(actual_over_ordered(host, true), bend, true_bend, gradients)
    if promise.felt is None or abs(felt) <= max(_BEYOND * promise.felt.half_width, FELT_WITHIN):
        felt = 0.0
    if abs(off) <= max(_BEYOND * promise.deflection.half_width, DEFLECTION_WITHIN):
        off = 0.0
    if off == 0.0 == felt:
        return
    worst = f"{100 * off:+.2g} % of the deflection" if off else f"{100 * felt:+.2g} % of the feel"
    raise InputError(
        file,
        f"controls.{found.control}",
        f"the readings are of other hardware than the file has: {_contradictions(filed, found)}."
        f" Flown, the calibrated rig would be off by {worst}. For readings of a real loader add"
        " --hardware, which takes what was found for the rig's own hardware, too; else give --rig"
        " the file that the readings were taken from",
    )


def _contradictions(filed: Control, found: CalibrationResult) -> str:
    """Return a phrase on the values in which readings and file differ most."""
    d, real, sensing = unit_of(found.control), real_scales(filed), filed.sensing
    figures = [("K", found.line.bend, filed.loader.bend, f"{d}/N")]
    if sensing.s1:
        figures.append(("S1", found.line.s1, real.s1, f"V/{d}"))
    if sensing.s2 and found.s2_chosen is not None:
        figures.append(("S2", found.s2_chosen, real.s2, "V/N"))
    if sensing.s3 and found.s3 is not None:
        figures.append(("S3", found.s3, real.s3, "V/N"))
    far = [
        f"{name} is {estimate.value:.4g} {unit} by the readings and {value:.4g} by the file"
        for name, estimate, value, unit in figures
        if abs(estimate.value - value) > _BEYOND * estimate.half_width
    ]
    return "; ".join(far) or "their figures together"


def _error(figure: Estimate) -> float:
    return figure.error if figure.error > _ROUNDING * abs(figure.value) else 0.0
