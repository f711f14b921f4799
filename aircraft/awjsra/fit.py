"""Find the numbers of Systems/estimates.xml anew, and say what they rest on.

    python aircraft/awjsra/fit.py
    python aircraft/awjsra/fit.py --leave-out

A least-squares fit of the aircraft in its published approach to the rows that validate.py marks
`fit`. The published figures are more than the numbers, but do not tell all of them apart; so each
number is also held near what closed forms or like aircraft suggest, within the width given here.

The first command prints each number with its standard deviation, and how much of it the rows tell:
1 less the share of the width's variance that is left. The second leaves out each row in turn, fits
to the rest, and prints what the model then says of the row: the nearest to a prediction that
figures of a single flight condition allow. It takes some minutes.
"""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from validate import RIG, Row, rows, trimmed

from coupled.rig.rigfile import read_rig

Floats = NDArray[np.float64]

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


def modelled(values: Floats) -> list[Row]:
    """Return the rows that are fitted, with these numbers."""
    found = rows(read_rig(RIG), _estimates(values))
    return [row for row in found if row.rests_on == "fit"]


def _estimates(values: Floats) -> dict[str, float]:
    return {f"awjsra/{name}": float(x) for name, x in zip(HELD, values, strict=True)}


def residuals(values: Floats, left_out: str = "") -> Floats:
    """Return what is off, each over what it may be off by."""
    fdm = trimmed(read_rig(RIG), _estimates(values))
    off = [(math.degrees(fdm["aero/alpha-rad"]) - ALPHA_deg[0]) / ALPHA_deg[1]]
    off.append(fdm["fcs/elevator-cmd-norm"] / COLUMN)
    off += [(x - near) / width for x, (near, width) in zip(values, HELD.values(), strict=True)]
    for row in modelled(values):
        if row.what != left_out:
            off.append(row.off / SHARP.get(row.what, row.aim / 3.0))
    return np.array(off)


@dataclass(frozen=True)
class Found:
    """The numbers in the order of `HELD`, their standard deviations, the rows' share in each."""

    values: Floats
    deviations: Floats
    shares: Floats


def fit(left_out: str = "") -> Found:
    """Return the numbers that meet the rows best, all but the one left out."""
    fdm = trimmed(read_rig(RIG))
    # From a tenth of the way back to what they are held near, so that it has to find them.
    start = [0.9 * fdm[f"awjsra/{name}"] + 0.1 * near for name, (near, _) in HELD.items()]
    end = least_squares(residuals, start, diff_step=1e-3, max_nfev=30, args=(left_out,))
    variances = np.diag(np.linalg.inv(end.jac.T @ end.jac))
    widths = np.array([width for _, width in HELD.values()])
    return Found(end.x, np.sqrt(variances), 1.0 - variances / widths**2)


def numbers() -> str:
    """Return the numbers as a Markdown table, and the lines for Systems/estimates.xml."""
    found = fit()
    lines = ["| | value | held near | share from the rows |", "| --- | --- | --- | --- |"]
    for name, (near, width), value, deviation, share in zip(
        HELD, HELD.values(), found.values, found.deviations, found.shares, strict=True
    ):
        held = f"{near:g} ± {width:g}"
        lines.append(f"| `{name}` | {value:.3f} ± {deviation:.3f} | {held} | {100 * share:.0f} % |")
    lines.append(f"\nFrom the rows in all: {np.sum(found.shares):.1f} of {len(HELD)} numbers.\n")
    for name, value in zip(HELD, found.values, strict=True):
        lines.append(f'<property value="{value:.3f}"> awjsra/{name} </property>')
    return "\n".join(lines)


def blind_rows() -> str:
    """Return what the model says of each row when fitted to the rest, as a Markdown table."""
    lines = ["| row | fitted to it | left out | aim |", "| --- | --- | --- | --- |"]
    for row in modelled(fit().values):
        without = modelled(fit(row.what).values)
        blind = next(other for other in without if other.what == row.what)
        met = "" if abs(blind.off) <= row.aim else ", **missed**"
        shares = [f"{round(100 * x) or 0:+d} %" for x in (row.off, blind.off)]
        lines.append(f"| {row.what} | {shares[0]} | {shares[1]}{met} | {100 * row.aim:.0f} % |")
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--leave-out", action="store_true", help="fit without each row in turn")
    print(blind_rows() if parser.parse_args().leave_out else numbers())
