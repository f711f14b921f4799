"""A rig whose host uses a calibration.

A calibration changes what the host assumes, not the hardware: S₁, S₂, S₃ and K̂ become what
was found, and each scale's factor of real over assumed is kept true of the same hardware.
v₁ is read where the host gets it: an S₁ that is off in the electronics is put right for reading
and analog product alike. One that is off in the host's reading alone (`deflection_scale`) stays
what it is: the S₁ found has it, the reading is right, and the analog product wrong by its inverse.
"""

from __future__ import annotations

from typing import Any

from coupled.calibration.assumed import GAINS, real_scales
from coupled.calibration.estimate import Estimate
from coupled.calibration.result import CalibrationResult
from coupled.record.channels import ControlName, unit_of
from coupled.rig.rig import Rig

_ROUNDING = 1e-15  # of a figure: a smaller error is that of a computer alone


def with_calibration(
    rig: Rig,
    control: ControlName,
    found: CalibrationResult,
    date: str = "",
    hardware: bool = False,
) -> Rig:
    """Return the rig whose host uses a calibration of one of its controls.

    `date` is noted as given. With `hardware` the rig's own structure and scales are taken to
    be as found, too: for readings of a real loader, whose rig file is a model. Raises
    InputError where the figures make a rig that cannot be.
    """
    data, d = rig.controls[control], unit_of(control)
    real, place = real_scales(data), f"controls.{control}"
    s1, s2, s3, bend = found.line.s1, found.s2_chosen, found.s3, found.line.bend
    reading = data.sensing.deflection_scale
    used = max(bend.value, 0.0)  # no structure bends against its force
    changes: dict[str, Any] = {
        f"sensing.s1_V_per_{d}": s1.value,
        "sensing.s3_V_per_N": s3.value,
        "sensing.computed_scale": 1.0 if hardware else real.s1 / (reading * s1.value),
        "sensing.deflection_scale": 1.0 if hardware else reading,
        "sensing.force_scale": 1.0 if hardware else real.s3 / s3.value,
        f"compensation.bend_{d}_per_N": used,
        "calibration.readings": found.count,
        "calibration.date": date,
        f"calibration.s1_V_per_{d}": s1.value,
        f"calibration.s1_error_V_per_{d}": _error(s1),
        "calibration.s3_V_per_N": s3.value,
        "calibration.s3_error_V_per_N": _error(s3),
        f"calibration.bend_{d}_per_N": bend.value,
        f"calibration.bend_error_{d}_per_N": _error(bend),
        "calibration.length_m": data.length,
    }
    for name, unit in GAINS.items():
        key = f"{name}_{unit.format(d=d)}" if unit else name
        changes[f"calibration.{key}"] = getattr(data.gains, name)
    if s2 is not None:
        changes["sensing.s2_V_per_N"] = s2.value
        changes["sensing.modifying_scale"] = 1.0 if hardware else real.s2 / s2.value
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
    return rig.changed(whole)


def _error(figure: Estimate) -> float:
    return figure.error if figure.error > _ROUNDING * abs(figure.value) else 0.0
