"""Mass, damping and lead scheduled by the gradient, so that a release is as specified.

Eq. (12) makes the loader oscillate faster than specified, and the structure of a released control
springs back at once: the grip is at δ·(1 − K·G_T), at rest. The specified, rigid control moves
there. Part 60 counts the time from 90 % of the displacement. So

    f_m = f_c = 1/(1 − K̂·G_T)      frequency and damping ratio as specified
    T                              such that the first zero crossing is 6 % late (`LATE`)

T is found by simulation, as it depends on damping and servo. Without both, and for K·G_T of at
least 0.1, the grip is below 90 % at once. The specified control crosses zero asin(0.9)/ω after its
90 %, with ω = √(G_T/m). The remedied loader starts with the speed T·G_T·δ·(1 − K·G_T)/m and
crosses after atan(1/(T·ω))/ω, so that

    T = √(m/G_T)·cot(1.06·asin 0.9) = 0.40·√(m/G_T)

with the filed mass m. Damping requires less, a servo's lag more. An overdamped control needs none.
"""

from __future__ import annotations

from scipy.optimize import brentq

from coupled.calibration.checks import swing_of
from coupled.calibration.specification import specified_rig
from coupled.calibration.sweeps import feel_pressures, release
from coupled.record.channels import ControlName, unit_of
from coupled.rig.equations import specified_gradient, total_to_computed
from coupled.rig.rig import Rig

Row = tuple[float, float, float]  # G_T in N/d, the factor on m and c, T in s
LATE = 0.06  # of the first crossing, within the rule's 10 %: a smaller lead overshoots less
_LONGEST_s = 0.2


def schedule_for_release(rig: Rig, control: ControlName) -> Rig:
    """Return a compensated rig with mass, damping and lead scheduled by the specified gradient.

    The table has the least, middle and greatest gradient of its schedule, as the checks do.
    """
    specified = specified_rig(rig.only(control))
    rows = [_row(rig, control, q, specified) for q in feel_pressures(specified, control)]
    return with_rows(rig, control, sorted(rows))


def with_rows(rig: Rig, control: ControlName, rows: list[Row]) -> Rig:
    """Return the rig with a table of rows by rising gradient; a single row applies everywhere."""
    if len(rows) == 1:
        rows = [rows[0], (rows[0][0] + 1.0, *rows[0][1:])]
    key = f"controls.{control}.compensation"
    factors = [float(f"{factor:.4g}") for _, factor, _ in rows]
    return rig.changed(
        {
            f"{key}.inertia_gradient_N_per_{unit_of(control)}": [row[0] for row in rows],
            f"{key}.mass_factor": factors,
            f"{key}.damping_factor": factors,
            f"{key}.force_lead_s": [float(f"{lead:.4g}") for *_, lead in rows],
        }
    )


def _row(rig: Rig, control: ControlName, pressure: float, specified: Rig) -> Row:
    data = rig.controls[control]
    gradient = float(specified_gradient(data.schedule, pressure))
    factor = total_to_computed(gradient, data.compensation.bend) / gradient
    wanted = swing_of(release(specified, control, pressure, 1.0))
    if not wanted.peaks.size:
        return gradient, factor, 0.0

    def late(lead: float) -> float:
        tried = with_rows(rig, control, [(gradient, factor, lead)])
        now = swing_of(release(tried, control, pressure, 1.0))
        return float(now.crossings[0]) / float(wanted.crossings[0]) - 1.0 - LATE

    if late(0.0) <= 0.0 or late(_LONGEST_s) >= 0.0:
        return gradient, factor, 0.0
    return gradient, factor, float(brentq(late, 0.0, _LONGEST_s, xtol=1e-4))
