"""The Augmentor Wing aircraft's forces and moments, against the closed forms that its README names.

Worked out here from the published geometry, by hand; of the model only the fitted numbers and the
state of flight are read. A sign, a unit or a number that is wrong in the model's files shows.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.support.awjsra import LEVERS, place, trimmed

Floats = NDArray[np.float64]

AREA, SPAN, MAC, ASPECT = 865.0, 78.75, 12.1, 7.2  # published, ft² and ft
ROOT, TIP, DIHEDRAL_FROM = 12.58, 7.74, 17.6
TAIL, TAIL_ARM = 233.0, 46.3
FIN, FIN_ARM = 152.0, 43.4
AILERON_SPAN, AILERON_CHORD, AILERON_AT = 11.5, 2.01, 33.7
CG_BEHIND_QUARTER = 0.035 * MAC


def strips() -> tuple[float, float, float]:
    """Return Clp, Clβ of the dihedral, Clδa of the ailerons, by strips of a straight taper."""
    slope = 2.0 * math.pi * ASPECT / (ASPECT + 4.0)
    y = np.linspace(0.0, SPAN / 2.0, 20001)
    chord = ROOT + (TIP - ROOT) * y / y[-1]
    share = AILERON_CHORD / float(np.interp(AILERON_AT, y, chord))
    angle = math.acos(2.0 * share - 1.0)
    effect = 1.0 - (angle - math.sin(angle)) / math.pi  # thin aerofoil with a plain flap
    outside, aileron = y > DIHEDRAL_FROM, abs(y - AILERON_AT) < AILERON_SPAN / 2.0
    over = 2.0 * slope / (AREA * SPAN)
    damping = -2.0 * over / SPAN * np.trapezoid(chord * y * y, y)
    dihedral = -over * math.radians(5.0) * np.trapezoid(np.where(outside, chord * y, 0.0), y)
    roll = over * effect * np.trapezoid(np.where(aileron, chord * y, 0.0), y)
    return float(damping), float(dihedral), float(roll)


def jet(fdm: Any) -> dict[str, float]:
    """Return the lifts of wing, flap and jet: Spence's, at Maskell's and Spence's finite span."""
    own = {name: fdm[f"awjsra/{name}"] for name in ("cold-per-hot", "blown-share", "flap-lift")}
    cold = own["cold-per-hot"] * fdm["aero/hot-thrust-lbs"]
    c = cold / (fdm["aero/qbar-psf"] * AREA)
    span = (ASPECT + 2.0 * c / math.pi) / (ASPECT + 2.0 + 0.604 * math.sqrt(c) + 0.876 * c)
    slope = 2.0 * math.pi * (1.0 + 0.151 * math.sqrt(c) + 0.219 * c) * span
    per_jet = math.sqrt(4.0 * math.pi * c * (1.0 + 0.151 * math.sqrt(c) + 0.139 * c)) * span
    flap = math.radians(fdm["fcs/flap-pos-deg"])
    return {
        "cold": cold,
        "spread": math.pi * ASPECT + 2.0 * c,
        "slope": slope,
        "wing": slope * (fdm["aero/alpha-rad"] + math.radians(2.5 + 2.0)),
        "flap": own["flap-lift"] * math.sin(flap),
        "jet": own["blown-share"] * per_jet * flap,
    }


def by_hand(fdm: Any) -> Floats:
    """Return (X, Y, Z, L, M, N) of the air about the CG, lb and lb·ft, flow attached."""
    own = {name: fdm[f"awjsra/{name}"] for name in ("recovery", "flap-drag", "induced", "downwash")}
    own |= {name: fdm[f"awjsra/{name}"] for name in ("tail-slope", "elevator", "moment-blown")}
    own |= {name: fdm[f"awjsra/{name}"] for name in ("fuselage-moment", "moment-at-zero")}
    alpha, beta = fdm["aero/alpha-rad"], fdm["aero/beta-rad"]
    p, q, r = (fdm[f"velocities/{axis}-aero-rad_sec"] for axis in "pqr")
    speed, area = fdm["velocities/vt-fps"], fdm["aero/qbar-psf"] * AREA
    lifts = jet(fdm)
    body = lifts["wing"] + lifts["flap"] + lifts["jet"]
    # The tail, in the wash that left the wing a distance earlier
    wash = own["downwash"] * 2.0 / lifts["spread"]
    slow = q + wash * lifts["slope"] * fdm["aero/alphadot-rad_sec"]
    at_tail = math.radians(1.0) + alpha - wash * body + TAIL_ARM / speed * slow
    tail_slope = 2.0 * math.pi * 4.4 / (4.4 + 2.0)
    elevator = own["elevator"] * fdm["fcs/elevator-pos-rad"]
    tail = tail_slope * (own["tail-slope"] * at_tail + elevator) * TAIL / AREA
    parasite = 0.035 + 0.015 * fdm["gear/gear-pos-norm"] + 0.6 * math.sin(beta) ** 2
    parasite += own["flap-drag"] * math.sin(math.radians(fdm["fcs/flap-pos-deg"])) ** 2
    lift = area * (body + tail * math.cos(alpha))
    drag = area * (parasite + own["induced"] * body**2 / lifts["spread"])
    drag -= own["recovery"] * lifts["cold"] * math.cos(alpha)
    # Fin and rudder: a lifting line (Helmbold) at the aspect ratio that the end plate makes 1.9
    fin = 2.0 * math.pi * 1.9 / (2.0 + math.sqrt(1.9**2 + 4.0)) * FIN / AREA
    pp, rr = p * SPAN / (2.0 * speed), r * SPAN / (2.0 * speed)
    rudder, aileron = fdm["fcs/rudder-pos-rad"], fdm["fcs/left-aileron-pos-rad"]
    arm = FIN_ARM / SPAN
    side = area * (-(fin + 0.3) * math.sin(beta) + fin * (2.0 * arm * rr + 0.6 * rudder))
    damping, dihedral, roll_per_aileron = strips()
    roll = (dihedral - 0.06) * beta + damping * pp + 1.2 * roll_per_aileron * aileron
    roll += 0.25 * (lifts["wing"] + lifts["flap"] + 0.3 * lifts["jet"]) * rr
    roll += 0.6 * fin * 6.0 / SPAN * rudder
    yaw = (fin * arm - 0.12) * beta - (2.0 * fin * arm**2 + 0.02) * rr - 0.6 * fin * arm * rudder
    yaw += -body / 8.0 * pp - 1.2 * roll_per_aileron / 30.0 * aileron
    pitch = own["moment-at-zero"] + own["fuselage-moment"] * math.sin(2.0 * alpha) / 2.0
    pitch += own["moment-blown"] * lifts["jet"] - tail * TAIL_ARM / MAC
    wing_damping = 0.1 * 2.0 * tail_slope * TAIL * TAIL_ARM**2 / (AREA * MAC**2)
    pitch -= wing_damping * q * MAC / (2.0 * speed)
    x = -drag * math.cos(alpha) * math.cos(beta) - side * math.cos(alpha) * math.sin(beta)
    x += lift * math.sin(alpha)
    y = -drag * math.sin(beta) + side * math.cos(beta)
    z = -drag * math.sin(alpha) * math.cos(beta) - side * math.sin(alpha) * math.sin(beta)
    z -= lift * math.cos(alpha)
    moments = np.array([roll * SPAN, pitch * MAC, yaw * SPAN]) * area
    moments += np.array([0.0, -CG_BEHIND_QUARTER * z, CG_BEHIND_QUARTER * y])
    return np.array([x, y, z, *moments])


def of_jsbsim(fdm: Any) -> Floats:
    names = [f"forces/fb{axis}-aero-lbs" for axis in "xyz"]
    names += [f"moments/{axis}-aero-lbsft" for axis in "lmn"]
    return np.array([fdm[name] for name in names])


FLIGHTS: dict[str, dict[str, dict[str, float]]] = {
    "the approach": {"levers": {}, "state": {}},
    "turning, rolling and slipping in it": {
        "levers": {
            "fcs/elevator-cmd-norm": -0.6,
            "fcs/aileron-cmd-norm": 0.7,
            "fcs/rudder-cmd-norm": 0.5,
        },
        "state": {
            "alpha__deg": 9.0,
            "beta__deg": 7.0,
            "p__rad_sec": 0.12,
            "q__rad_sec": 0.1,
            "r__rad_sec": -0.15,
        },
    },
    "clean at 150 kt": {
        "levers": {
            "fcs/flap-cmd-norm": 0.0,
            "gear/gear-cmd-norm": 0.0,
            "fcs/rudder-cmd-norm": -0.4,
            "fcs/throttle-cmd-norm[0]": 1.0,
        },
        "state": {"vc__kts": 150.0, "alpha__deg": -3.0, "beta__deg": -12.0, "p__rad_sec": -0.3},
    },
}


# What three digits in the model's files leave open
ROUNDED = np.array([1e-4, 1.5e-4, 5e-4, 1e-4, 6e-4, 1e-4])


@pytest.mark.parametrize("name", list(FLIGHTS))
def test_forces_and_moments_are_the_closed_forms(name: str) -> None:
    fdm = place(trimmed(), FLIGHTS[name]["levers"], **FLIGHTS[name]["state"])
    off = (of_jsbsim(fdm) - by_hand(fdm)) / (fdm["aero/qbar-psf"] * AREA)
    off /= np.array([1.0, 1.0, 1.0, SPAN, MAC, SPAN])
    assert np.all(np.abs(off) < ROUNDED), off


@pytest.mark.parametrize("alpha_deg", [90.0, -90.0])
def test_the_forces_at_90_degrees_are_those_of_a_flat_plate(alpha_deg: float) -> None:
    """No lift; the drag of wing and tail as plates, 1.25 and 1.2; the tail turns it back."""
    still = dict.fromkeys(LEVERS, 0.0)
    fdm = place(trimmed(), still, gamma__deg=0.0, alpha__deg=alpha_deg)
    x, y, z, roll, pitch, yaw = of_jsbsim(fdm) / (fdm["aero/qbar-psf"] * AREA)
    up = math.copysign(1.0, alpha_deg)
    parasite = 0.05 + fdm["awjsra/flap-drag"] * math.sin(math.radians(65.0)) ** 2
    assert z == pytest.approx(-up * (1.25 * (1.0 + TAIL / AREA) + parasite), abs=1e-3)
    assert x == pytest.approx(0.0, abs=1e-3)
    assert (y, roll, yaw) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
    weathercock = TAIL / AREA * 1.2 * TAIL_ARM
    assert -up * pitch == pytest.approx(weathercock + 0.25 * 1.25 * MAC, rel=0.25)
