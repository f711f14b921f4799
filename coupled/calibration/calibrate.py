"""A calibration: S₁, S₂, S₃ and K from readings, or an error if they are insufficient."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from coupled.arguments import public
from coupled.calibration import arc, scales
from coupled.calibration.accuracy import expected
from coupled.calibration.assumedscales import stale
from coupled.calibration.errors_in_variables import errors_in_variables
from coupled.calibration.estimate import Instruments, usual_instruments
from coupled.calibration.fit import condition, normal_equations, ordinary
from coupled.calibration.readingchecks import SURELY, find_unit_doubts, find_zeros, refuse_poor
from coupled.calibration.readings import Readings
from coupled.calibration.readingsfile import read_readings
from coupled.calibration.result import CalibrationResult
from coupled.calibration.suspects import find_suspects
from coupled.errors import InputError, nearest
from coupled.record.channels import ControlName
from coupled.resources import find, shipped_rigs
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig

Floats = NDArray[np.float64]
DEFAULT_RIG = "report-column"
_COUNT = 0.3  # of a count: least error of a converter's reading, beside its step
EXTREME = 3.0  # standard deviations of the hand by which friction displaces a control


@public
def calibrate(
    readings: Readings | Path | str,
    rig: Rig | Path | str = DEFAULT_RIG,
    control: ControlName = "column",
    instruments: Instruments | None = None,
) -> CalibrationResult:
    """Return S₁ in V/d, S₂ and S₃ in V/N and K in d/N of a control, with their errors.

    `readings` are an object or a file; `rig` is an object, a file, or the name of a shipped rig.
    The rig's travel, arc, gains and schedule are used, not its scales. `instruments` have by
    default the errors of a careful person. d is m, or rad for a wheel; a pull is positive. Raises
    InputError, with file and row, if the readings are insufficient.

    >>> import coupled
    >>> from coupled.calibration.bench import CalibrationBench, take_readings
    >>> from coupled.calibration.estimate import usual_instruments
    >>> from coupled.calibration.plan import stations
    >>> rig = coupled.load_rig("report-column")
    >>> tools = usual_instruments("column")
    >>> bench = CalibrationBench(rig, "column", stations(rig, "column", 3, 3), tools)
    >>> found = coupled.calibrate(take_readings(bench, seed=1), rig)
    >>> found.line.bend.low < rig.controls["column"].loader.bend < found.line.bend.high
    True
    """
    if not isinstance(rig, Rig):
        rig = read_rig(find(str(rig), shipped_rigs(), "rig"))
    rig.check_controlled(rig.file)
    if control not in rig.controls:
        problem = f"the rig has no {control}; {nearest(control, rig.controls)}"
        raise InputError(rig.place, "controls", problem)
    file: Path | str = "readings"
    if not isinstance(readings, Readings):
        file = Path(readings)
        readings = read_readings(file, control)
    tools = instruments or usual_instruments(control)
    return calibrate_control(readings, rig.controls[control], control, tools, file)


def calibrate_control(
    readings: Readings, control: Control, name: str, instruments: Instruments, file: Path | str
) -> CalibrationResult:
    """Return the calibration of the control called `name` from the readings of `file`.

    Raises InputError for insufficient readings: too few, all of one force, or of one gradient.
    """
    if readings.signal == "counts":  # a meter's usual step is no converter's
        own = max(instruments.meter, _COUNT)
        instruments = replace(instruments, meter=own, meter_step=1.0)
    corrected, level, angles = _on_arc(readings, control, file)
    refuse_poor(corrected, control, name, instruments, file)
    suspects = find_suspects(corrected, instruments)
    used = corrected.without([suspect.row for suspect in suspects])
    if suspects:
        kept = np.isin(corrected.row, used.row)
        level = None if level is None else level[kept]
        angles = None if angles is None else angles[kept]
        try:
            refuse_poor(used, control, name, instruments, file)
        except InputError as error:
            rows = ", ".join(str(suspect.row) for suspect in suspects)
            problem = f"without the outliers in rows {rows}: {error.problem}"
            raise InputError(file, error.key, problem) from None
    zeros = find_zeros(used, file)
    d, f = used.deflection, used.force
    plain = ordinary(used, instruments)
    if plain.s1.value <= 0.0:
        raise InputError(file, "v1_V", "falls as the deflection grows; check its sign")
    try:
        fit = errors_in_variables(used, instruments)
    except (FloatingPointError, np.linalg.LinAlgError):
        raise InputError(
            file, "", "the fit does not converge; the readings are insufficient"
        ) from None
    if fit.line.bend.value < -fit.line.bend.half_width_at(SURELY):
        problem = "K is negative, and no structure bends against its force"
        raise InputError(file, "", f"{problem}; check v1, and the gradient set of each reading")
    there = f != 0.0
    s2 = scales.s2_from_gains(fit.line.s1, fit.s3 if used.gauge else None, control.gains)
    loader, sides = control.loader, used.null_side
    rubs = max(loader.friction, loader.breakaway) > 0.0
    one_sided = rubs and len(sides) >= 2 and not scales.both_sides(sides)
    if len(used.null_row) >= 2:
        off = EXTREME * instruments.hand if one_sided else 0.0
        found = scales.s2_by_null(used.null_v2, used.null_v3, sides, fit.s3, off)
        s2["the null, eq. (14)"] = found
    return CalibrationResult(
        name,
        fit,
        plain,
        normal_equations(d, f, used.v1),
        condition(d, f),
        scales.s3_by_ratios(f[there], used.v3[there]) if used.gauge else None,
        s2,
        one_sided,
        expected(fit, next(reversed(s2.values()), None), control, list(s2)[-1:] == [scales.BY_S1])
        if used.gauge
        else None,
        tuple(suspects),
        used,
        level,
        angles,
        tuple(stale(control)),
        (*find_unit_doubts(used, control, name), *zeros),
    )


def _on_arc(
    readings: Readings, control: Control, file: Path | str
) -> tuple[Readings, Floats | None, Floats | None]:
    """Return the readings along the arc, and the level readings and angles in rad if known."""
    length = control.length
    if length <= 0.0 or control.surface == "aileron":
        return readings, None, None
    level = readings.deflection
    if not control.loader.arc_geometry:
        return readings, None, level / length
    far = np.flatnonzero(np.abs(level) >= length)
    if far.size:
        row = int(readings.row[far[0]])
        problem = f"is {level[far[0]]:.4g} m on an arc of {length:g} m, which no ruler reads"
        raise InputError(file, f"row {row}", problem)
    along = replace(readings, deflection=arc.along_arc(level, length))
    return along, level, arc.angle(level, length)
