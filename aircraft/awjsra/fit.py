"""Find the numbers of Systems/estimates.xml anew, and print them.

    python aircraft/awjsra/fit.py

A least-squares fit of the aircraft in its published approach to the rows that validate.py marks as
fitted. The published figures are more than the numbers, but do not tell all of them apart; so each
number is also held near what closed forms or like aircraft suggest, within the width given here.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from validate import RIG, rows, trimmed

from coupled.rig.rigfile import read_rig

# name: (held near, width). Factors on a closed form are held near 1.
HELD = {
    "cold-per-hot": (0.6, 0.3),  # a bypass ratio of 0.6
    "blown-share": (0.8, 0.2),  # the share of the span that is blown
    "recovery": (0.6, 0.3),
    "flap-lift": (0.6, 0.15),
    "flap-drag": (0.15, 0.1),
    "induced": (1.0, 0.25),
    "downwash": (1.0, 0.12),
    "tail-slope": (0.9, 0.2),
    "elevator": (0.5, 0.3),  # thin-airfoil theory at 35 % of the chord gives 0.7, without gap
    "fuselage-moment": (0.8, 0.6),
    "moment-at-zero": (0.3, 1.0),
    "moment-blown": (-0.1, 0.2),
}
# What a row may be off by; else a third of its aim. The numerator roots pull against the rest.
SHARP = {
    "hot thrust in trim, lb": 0.01,
    "pitch numerator root, low, rad/s": 0.02,
    "pitch numerator root, high, rad/s": 0.02,
}
ALPHA_deg = (5.0, 2.0)  # of the fuselage in the approach, held near; no figure was at hand
COLUMN = 0.02  # of full travel: trim near the column's neutral


def residuals(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what is off, each over what it may be off by."""
    rig = read_rig(RIG)
    estimates = {f"awjsra/{name}": float(x) for name, x in zip(HELD, values, strict=True)}
    fdm = trimmed(rig, estimates)
    off = [(math.degrees(fdm["aero/alpha-rad"]) - ALPHA_deg[0]) / ALPHA_deg[1]]
    off.append(fdm["fcs/elevator-cmd-norm"] / COLUMN)
    off += [(x - near) / width for x, (near, width) in zip(values, HELD.values(), strict=True)]
    for row in rows(rig, estimates):
        if row.fitted and "per g" not in row.what:  # which the rig's gradient is set by
            off.append(row.off / SHARP.get(row.what, row.aim / 3.0))
    return np.array(off)


if __name__ == "__main__":
    fdm = trimmed(read_rig(RIG))
    # From a tenth of the way back to what they are held near, so that it has to find them.
    start = [0.9 * fdm[f"awjsra/{name}"] + 0.1 * near for name, (near, _) in HELD.items()]
    found = least_squares(residuals, start, diff_step=1e-3, max_nfev=30)
    for name, value in zip(HELD, found.x, strict=True):
        print(f'<property value="{value:.3f}"> awjsra/{name} </property>')
