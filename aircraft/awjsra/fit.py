"""Find the numbers of Systems/estimates.xml anew, and say what they rest on.

    python aircraft/awjsra/fit.py
    python aircraft/awjsra/fit.py --leave-out

A least-squares fit of the aircraft in its published approach to the rows that validate.py marks
`fit`. There are more published figures than numbers, but they do not separate all of them; so each
number is also held near what closed forms or like aircraft suggest, within the width given here.
Two more assumptions are in the fit that nobody published: the angle of attack in trim, and a column
near its neutral. And three rows are met more sharply than a third of their aim.

The first command prints each number with its standard deviation, and how much of it is determined:
1 less the share of the width's variance that is left, by all that is in the fit, and by the rows
alone. The second leaves out each row in turn, fits to the rest, and prints what the model then says
of the row: the nearest to a prediction that figures of a single flight condition allow. It takes
some minutes; `inputs()` names what its table was made from, so that a stale one is found at once.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from validate import RIG, Row, rows, trimmed

from coupled.rig.rigfile import read_rig

HERE = Path(__file__).parent
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
NAMES = {
    "cold-per-hot": "cold thrust per hot thrust",
    "blown-share": "augmentor's lift over a full-span jet flap's",
    "recovery": "cold momentum recovered as thrust",
    "flap-lift": "unblown lift of the flap, per sine",
    "flap-drag": "its drag, per squared sine",
    "induced": "factor on the induced drag",
    "downwash": "factor on the downwash",
    "tail-slope": "factor on the tail's slope",
    "elevator": "elevator's slope over the tail's lifting line",
    "fuselage-moment": "moment of fuselage and nacelles, per rad",
    "moment-at-zero": "moment coefficient at no angle",
    "moment-blown": "arm of the jet's lift, MAC",
}
# What a row may be off by; else a third of its aim. The numerator roots pull against the rest.
SHARP = {
    "hot thrust in trim, lb": 0.01,
    "pitch numerator root, low, rad/s": 0.02,
    "pitch numerator root, high, rad/s": 0.02,
}
# Assumed of the trim, not published: the fuselage's angle of attack, and the column's place.
ALPHA_deg = (5.0, 2.0)  # held near, width
COLUMN = 0.02  # of full travel: near the column's neutral
ASSUMED = 2  # so many residuals stand ahead of the others


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
            off.append(row.off / SHARP.get(row.what, third_of_aim(row)))
    return np.array(off)


def third_of_aim(row: Row) -> float:
    """Return what a row may be off by where it is not sharpened."""
    return row.aim / 3.0


@dataclass(frozen=True)
class Found:
    """The numbers in the order of `HELD`, their standard deviations, and what determines them.

    `shares` is by all that is in the fit; `unassumed` without what is assumed of the trim;
    `rows_alone` also without sharpening.
    """

    values: Floats
    deviations: Floats
    shares: Floats
    unassumed: Floats
    rows_alone: Floats


def fit(left_out: str = "") -> Found:
    """Return the numbers that meet the rows best, all but the one left out."""
    fdm = trimmed(read_rig(RIG))
    # From a tenth of the way back to what they are held near, so that it has to find them.
    start = [0.9 * fdm[f"awjsra/{name}"] + 0.1 * near for name, (near, _) in HELD.items()]
    end = least_squares(residuals, start, diff_step=1e-3, max_nfev=30, args=(left_out,))
    widths = np.array([width for _, width in HELD.values()])
    assumed, held, of_rows = np.split(end.jac, [ASSUMED, ASSUMED + len(HELD)])
    met = [row for row in modelled(end.x) if row.what != left_out]
    blunted = [SHARP.get(row.what, third_of_aim(row)) / third_of_aim(row) for row in met]

    def variances(*parts: Floats) -> Floats:
        whole = np.vstack([held, *parts])
        return np.asarray(np.diag(np.linalg.inv(whole.T @ whole)))

    return Found(
        end.x,
        np.sqrt(variances(assumed, of_rows)),
        1.0 - variances(assumed, of_rows) / widths**2,
        1.0 - variances(of_rows) / widths**2,
        1.0 - variances(of_rows * np.array(blunted)[:, None]) / widths**2,
    )


def determined(found: Found) -> str:
    """Return how many numbers are determined, and by what, as a sentence."""
    rows, count = len(modelled(found.values)), len(HELD)
    return (
        f"The {rows} fitted rows determine {np.sum(found.rows_alone):.1f} of the {count} numbers if"
        f" each has a standard deviation of a third of its aim, {np.sum(found.unassumed):.1f} with"
        f" {len(SHARP)} of them weighted more, and {np.sum(found.shares):.1f} with two assumptions"
        f" on the trim: an angle of attack of {ALPHA_deg[0]:g}° ± {ALPHA_deg[1]:g}°, and a column"
        f" within {100 * COLUMN:g} % of its neutral. Neither has a published figure. The priors"
        " determine the rest."
    )


def numbers() -> str:
    """Return the numbers as a Markdown table, and how many of them are determined."""
    found = fit()
    lines = ["| | value | prior | share, rows alone | share, all |"]
    lines.append("| --- | --- | --- | --- | --- |")
    for name, (near, width), value, deviation, alone, share in zip(
        HELD,
        HELD.values(),
        found.values,
        found.deviations,
        found.rows_alone,
        found.shares,
        strict=True,
    ):
        lines.append(
            f"| {NAMES[name]} (`{name}`) | {value:.3f} ± {deviation:.3f} | {near:g} ± {width:g}"
            f" | {100 * alone:.0f} % | {100 * share:.0f} % |"
        )
    return "\n".join([*lines, "", determined(found)])


def properties(values: Floats) -> str:
    """Return the lines for Systems/estimates.xml."""
    pairs = zip(HELD, values, strict=True)
    return "\n".join(f'<property value="{x:.3f}"> awjsra/{name} </property>' for name, x in pairs)


def inputs() -> str:
    """Return a hash of all that the tables rest on: aircraft, its trim, and the two scripts."""
    with RIG.open("rb") as file:
        trim = json.dumps(tomllib.load(file)["flight"], sort_keys=True)
    made = hashlib.sha256(trim.encode())
    files = sorted([*HERE.glob("*.xml"), *HERE.glob("*/*.xml")])
    for path in [*files, HERE / "fit.py", HERE / "validate.py"]:
        made.update(path.read_bytes())
    return made.hexdigest()[:16]


def blind_rows() -> str:
    """Return what the model says of each row when fitted to the rest, as a Markdown table."""
    lines = ["| row | fitted to it | left out | aim |", "| --- | --- | --- | --- |"]
    met = 0
    fitted = modelled(fit().values)
    for row in fitted:
        without = modelled(fit(row.what).values)
        blind = next(other for other in without if other.what == row.what)
        met += blind.met
        missed = "" if blind.met else ", **missed**"
        shares = [f"{round(100 * x) or 0:+d} %" for x in (row.off, blind.off)]
        lines.append(f"| {row.what} | {shares[0]} | {shares[1]}{missed} | {100 * row.aim:.0f} % |")
    lines += ["", f"{met} of {len(fitted)} are predicted within their aim."]
    return "\n".join([*lines, f"Made from inputs {inputs()}."])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--leave-out", action="store_true", help="fit without each row in turn")
    if parser.parse_args().leave_out:
        print(blind_rows())
    else:
        print(f"{numbers()}\n\n{properties(fit().values)}")
