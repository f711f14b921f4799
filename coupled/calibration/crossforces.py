"""Forces to hold on other controls, and the precision of the bend K_j that they cause.

K_j = −c_j/a of the fit. c_j is determined by readings with ±F_j held at unchanged force on this
control. Its error is nearly that of the ruler,

    u(K_j) ≈ √(u_δ² + (u_v₁/S₁)²)/(F_j·√n),    n readings with ±F_j

since F_j is orthogonal to the rest of the design. A few readings with a strong force are therefore
better than many with a weak one.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coupled.calibration.assumedscales import real_scales
from coupled.calibration.errors_in_variables import expected_design
from coupled.calibration.estimate import Estimate, Instruments
from coupled.calibration.plan import USUAL_LOSS, Station
from coupled.calibration.readings import readings_of
from coupled.calibration.sandwich import sandwich
from coupled.record.channels import ControlName
from coupled.rig.equations import volts, volts_of_computed
from coupled.rig.rig import Rig

IN_TURN = (1.0, 0.0, -1.0, 0.0)  # sequence of the force on another control, by reading


def crossed_forces(
    rig: Rig, control: ControlName, stations: int, strongest_N: float
) -> dict[ControlName, list[float]]:
    """Return the force on each other control at every station, N: +, − and mostly 0.

    The sequence is +, 0, − and 0 on the first control, and half as fast on the second, so that no
    force is correlated with this control's own or with another's. Empty for 0 N.
    """
    if strongest_N == 0.0:
        return {}
    names = [name for name in rig.controls if name != control]
    at = np.arange(stations)
    return {
        name: [float(sign) for sign in strongest_N * np.array(IN_TURN)[(at // (k + 1) + k) % 4]]
        for k, name in enumerate(names)
    }


def crossed_precision(
    rig: Rig,
    control: ControlName,
    design: Sequence[Station],
    strongest_N: float,
    instruments: Instruments,
    looks: int = 2,
) -> dict[str, float]:
    """Return the half width of the 95 % interval of each K_j in d/N for a design, by control.

    Readings are at the design's stations, with the others held as by `crossed_forces`.
    """
    data, scales = rig.controls[control], real_scales(rig.controls[control])
    bend = data.compensation.bend or USUAL_LOSS / max(data.schedule.gradients)
    delta = np.array([station.deflection for station in design])
    force = np.array([station.force for station in design])
    held = crossed_forces(rig, control, len(design), strongest_N)
    read = (volts_of_computed(scales.s1, delta, force, bend), volts(scales.s3, force))
    rise = np.full((2, len(design)), 0.0 if looks == 2 else np.nan)
    readings = readings_of(
        range(len(design)),
        [station.label for station in design],
        np.stack((delta, force, *read, *rise)),
        [],
        np.empty((4, 0)),
        {str(name): np.array(forces) for name, forces in held.items()},
    )
    figures = (scales.s1, -scales.s1 * bend, scales.s3, *(0.0 for _ in held))
    if len(design) <= len(figures):
        return {str(name): float("inf") for name in held}
    rows = expected_design(readings, instruments, figures)
    errors = sandwich(rows, np.zeros(rows.shape[:2]))
    found = {}
    for j, name in enumerate(held):
        slope = np.eye(len(figures))[3 + j] / scales.s1
        error = float(np.sqrt(np.sum((errors.back.T @ slope) ** 2)))
        found[str(name)] = Estimate(0.0, error, errors.freedom(slope)).half_width
    return found
