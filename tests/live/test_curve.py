"""A specified curve on a real loader: Brunner's external control, v2, and the open protocol."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.api.rigs import load_rig
from coupled.errors import InputError
from coupled.flight.manoeuvre import Manoeuvre
from coupled.live.attach import open_link
from coupled.live.attached import chord
from coupled.live.hands import LiveHand
from coupled.live.host import Plan
from coupled.live.session import fly_live
from coupled.rig.modification import set_curve
from coupled.rig.packing import pack
from tests.support.curves import CYCLIC, CYCLIC_N, SCHEDULE, SEGMENT, column, curved
from tests.support.loaders import fake_loader

HOST = "127.0.0.1:9"
V2 = f"cls2sim://{HOST}?protocol=v2&counts_per_N=100&profile_N_per_d=1000&scale=100"
PROFILE = np.array([0.0, 20.0, 35.0, 50.0, 70.0, 110.0])
UNBENT = {"controls.column.compensation.gradient": False}


@pytest.mark.slow
def test_external_control_gives_the_curves_force() -> None:
    """The force ordered, from δ̂ − δc = K·F, is the curve's at δ̂ once it is faded in."""
    curve = {"deflection_m": CYCLIC, "force_N": [CYCLIC_N], "dynamic_pressure_Pa": [0.0]}
    schedule = {"total_gradient_N_per_m": []} | curve
    rig = load_rig("report-column").changed(
        {f"{SCHEDULE}.{key}": value for key, value in schedule.items()}
    )
    with fake_loader("cls2sim", hand=30.0) as (port, _):
        url = f"cls2sim://127.0.0.1:{port}?counts_per_N=100"
        link = open_link(url, rig, lockstep=True, deflection=False)
        manoeuvre = Manoeuvre(rig, {"column": LiveHand()}, 6.0)
        record = fly_live(manoeuvre, Plan(paced=False, link=link)).record
    bend = rig.controls["column"].compensation.bend
    computed, estimate = (record[f"column_{name}_m"][120:] for name in ("computed", "estimate"))
    slow = np.abs(np.gradient(computed)) * rig.frame_rate < 0.002  # F as read is a frame old
    force = (estimate - computed) / bend
    assert np.ptp(force[slow]) > 25.0
    assert force[slow] == pytest.approx(np.interp(estimate[slow], CYCLIC, CYCLIC_N), abs=1.0)


def test_the_order_of_a_profile_is_its_force_at_full_travel() -> None:
    rig = curved([-0.1, 0.0, 0.05, 0.2], [[-30.0, 0.0, 20.0, 140.0]], UNBENT)
    packed = pack(rig)[0]
    p, s = packed["parameters"], packed["state"]
    set_curve(p["modification"], s["modification"], p["schedule"], 0.0, 1.0)
    travel = 0.1778
    total = 20.0 + 800.0 * (travel - 0.05)
    assert chord(s["modification"], travel) == pytest.approx(total / travel - 560.0)


@pytest.mark.parametrize(
    ("url", "said"),
    [
        (V2, "give a curve whose rows are proportional"),
        (f"udp://{HOST}", "it has no curve to order"),
    ],
)
def test_a_loader_that_cannot_take_a_curve_is_refused(url: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        open_link(url, column(), lockstep=True, deflection=False)


def test_v2_takes_a_profile_times_a_factor_over_pressure() -> None:
    scaled = curved(SEGMENT, [PROFILE, 2.5 * PROFILE])
    with pytest.raises(InputError, match="would bend; give false"):
        open_link(V2, scaled, lockstep=True, deflection=False)
    flat = scaled.changed(UNBENT)
    with pytest.raises(InputError, match="does not answer"):  # not refused
        open_link(V2, flat, lockstep=True, deflection=False)
