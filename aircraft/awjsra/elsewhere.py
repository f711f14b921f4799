"""The aircraft away from its published approach: print the last table of validation.md.

    python aircraft/awjsra/elsewhere.py

Trims at 40,000 lb, the column force per g of a pull at constant speed on the rig's schedule, and
the modes that JSBSim's linearisation has there. No figure was published for any of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import jsbsim
import numpy as np
from validate import RIG, column_gradient, force_at_constant_speed, trimmed

from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.units import KNOT_m_per_s

CLEAN = {"fcs/flap-cmd-norm": 0.0, "fcs/nozzle-cmd-deg": 18.5, "gear/gear-cmd-norm": 0.0}
SIDES = ("Beta", "Phi", "P", "R")
# knots, path in degrees, flaps and nozzles in degrees; clean where flaps are up
TRIMS = [
    (50.0, 0.0, 65.0, 50.0),
    (60.0, -7.5, 65.0, 87.7),
    (60.0, 0.0, 65.0, 40.0),
    (70.0, -7.5, 65.0, 87.7),
    (80.0, -3.0, 30.0, 60.0),
    (100.0, 0.0, 0.0, 18.5),
    (130.0, 0.0, 0.0, 18.5),
    (160.0, 0.0, 0.0, 18.5),
]


def rig_at(knots: float, path_deg: float, flaps_deg: float, nozzles_deg: float) -> Rig:
    """Return the rig with its aircraft trimmed elsewhere."""
    rig = read_rig(RIG)
    assert rig.flight is not None
    levers = {"fcs/flap-cmd-norm": flaps_deg / 75.0, "fcs/nozzle-cmd-deg": nozzles_deg}
    return rig.changed(
        {
            "flight.calibrated_airspeed_m_per_s": knots * KNOT_m_per_s,
            "flight.flight_path_rad": math.radians(path_deg),
            "flight.properties": {**rig.flight.properties, **(levers if flaps_deg else CLEAN)},
        }
    )


def modes(model: jsbsim.FGLinearization, states: Sequence[str]) -> list[str]:
    """Return the modes of some states, quickest first: a root in 1/s, or rad/s with its ζ."""
    at = [model.x_names.index(name) for name in states]
    roots = np.linalg.eigvals(np.asarray(model.system_matrix)[np.ix_(at, at)])
    found = []
    for root in sorted(roots, key=lambda root: -abs(root)):
        if root.imag == 0.0:
            found.append(f"{round(root.real, 2) + 0.0:.2f}")
        elif root.imag > 0.0:
            found.append(f"{abs(root):.2f} (ζ {-root.real / abs(root):.2f})")
    return found


def greatest_lift(flaps_deg: float, throttle: float) -> tuple[float, int]:
    """Return the greatest lift coefficient at 60 kt, nozzles aft, and the fuselage's angle, deg."""
    fdm = trimmed(rig_at(60.0, -7.5, 65.0, 87.7))
    fdm.set_trim_status(True)
    fdm["fcs/flap-cmd-norm"], fdm["ic/gamma-deg"] = flaps_deg / 75.0, 0.0
    for engine in range(2):
        fdm[f"fcs/throttle-cmd-norm[{engine}]"] = throttle
    found = []
    for alpha_deg in range(18, 27):
        fdm["ic/alpha-deg"] = alpha_deg
        for _ in range(4):
            fdm.run_ic()
        lift = fdm["forces/fwz-aero-lbs"] / (fdm["aero/qbar-psf"] * fdm["metrics/Sw-sqft"])
        found.append((float(lift), alpha_deg))
    return max(found)


def images() -> tuple[float, float]:
    """Return what the ground would do to the lift at a touchdown in the approach, as shares of it.

    By the images of the vortices, at an unchanged angle: the trailing ones take some of the induced
    angle away (Wieselsberger 1922), the bound one slows the air, an endless one by CL c/(8 pi h).
    The wing is taken to be 4 ft above the CG, and 9.5 ft more above the ground.
    """
    fdm = trimmed(read_rig(RIG))
    height, span = 13.5, fdm["metrics/bw-ft"]
    mean_chord = fdm["metrics/Sw-sqft"] / span
    spread = math.pi * 7.2 + 2.0 * fdm["aero/jet-coefficient"]
    relieved = math.exp(-2.48 * (2.0 * height / span) ** 0.768)
    lifted = relieved * fdm["aero/wing-slope-per_rad"] / spread
    half_width = math.pi * span / 8.0  # of the horseshoe that carries the same lift
    ends = half_width / math.hypot(half_width, 2.0 * height)
    slowed = fdm["aero/CL-wing-body"] * mean_chord / (8.0 * math.pi * height) * ends
    return lifted, -2.0 * slowed


def table() -> str:
    """Return the trims as a Markdown table, and what is to be said beside it."""
    lines = [
        "| kt, path | flaps, nozzles | α | elevator | hot thrust | lb/g | pitch | roll and yaw |"
    ]
    lines.append("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for knots, path, flaps, nozzles in TRIMS:
        rig = rig_at(knots, path, flaps, nozzles)
        fdm = trimmed(rig)
        set_at = f"{knots:.0f}, {path:g}° | {flaps:g}°, {nozzles:g}°"
        elevator = math.degrees(fdm["fcs/elevator-pos-rad"])
        trim = (
            f"{fdm['aero/alpha-deg']:.1f}° | {elevator:.1f}° | {fdm['aero/hot-thrust-lbs']:.0f} lb"
        )
        pounds, speed = column_gradient(rig, fdm), fdm["velocities/vt-fps"]
        model = jsbsim.FGLinearization(fdm)
        force = force_at_constant_speed(model, pounds, speed)
        pitch, sides = modes(model, ("Vt", "Alpha", "Theta", "Q")), modes(model, SIDES)
        lines.append(
            f"| {set_at} | {trim} | {force:.0f} | {', '.join(pitch)} | {', '.join(sides)} |"
        )
    powered, at_powered = greatest_lift(65.0, 0.75)
    idle, at_idle = greatest_lift(65.0, 0.0)
    clean, at_clean = greatest_lift(0.0, 0.0)
    lines.append(
        f"\nMaximum lift coefficient of air and cold jets at 60 kt: {powered:.2f} at"
        f" {at_powered}° with flaps 65° and 75 % throttle, {idle:.2f} at {at_idle}° idle;"
        f" {clean:.2f} at {at_clean}° clean and idle."
    )
    lifted, slowed = images()
    lines.append(
        f"Ground effect is not modelled. At touchdown it would change the wing's lift by"
        f" {100 * lifted:+.0f} % through the induced angle and by {100 * slowed:+.0f} % through the"
        " speed."
    )
    return "\n".join(lines)


if __name__ == "__main__":
    print(table())
