"""Static checks: breakout, force and surface against 14 CFR Part 60's tolerances."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from coupled.calibration.checks import (
    ControlCheck,
    breakout,
    judged,
    legs,
    static_checks,
    surface_checks,
)
from coupled.calibration.documentation import check_feel
from coupled.calibration.specification import SweepLeg, specified_legs, specified_rig
from coupled.calibration.sweeps import feel_pressures, sweep
from coupled.campaign.tolerances import STATIC, SURFACE_rad, force_band
from coupled.flight.manoeuvre import configure
from coupled.rig.equations import bend_loss, uncompensated_loss
from coupled.rig.rig import Rig
from tests.support.rigs import G_STIFF, K_REPORT, bench

LBF = 4.4482216


# 14 CFR Part 60, table A2A, 2.a.1 to 2.a.3 as printed: breakout and force in lbf, surface in °.
PRINTED = {
    "column": (2.0, 5.0, "elevator", 2.0),
    "wheel": (2.0, 3.0, "aileron", 2.0),
    "pedals": (5.0, 5.0, "rudder", 2.0),
}


TRAVEL = 0.1778


def four(force: Any, surface_share: float = 1.0) -> tuple[SweepLeg, ...]:
    """Return the legs of a sweep whose force is a function of the size of δ, odd in it."""
    at = np.linspace(1e-9, TRAVEL, 401)
    size, share = np.broadcast_to(force(at), at.shape), surface_share * at / TRAVEL
    out, back = SweepLeg(at, size, share), SweepLeg(-at, -size, -share)
    return (out, out, back, back)


@pytest.mark.parametrize("control", ["column", "wheel", "pedals"])
def test_static_tolerances_are_those_printed(control: Any) -> None:
    """Breakout by ± lbf; a force by ± 10 % where that is more than its ± lbf."""
    breakout_lbf, force_lbf, surface, degrees = PRINTED[control]
    data = bench().controls["column"]

    def checks(specified: float, more: float) -> dict[str, ControlCheck]:
        felt, wanted = (four(lambda _, f=f: f * LBF) for f in (specified + more, specified))
        return {c.name: c for c in static_checks(data, control, 0.0, felt, wanted)}

    for which, specified, lbf in (
        ("breakout, positive", 10.0, breakout_lbf),
        ("force, out, positive", 10.0, force_lbf),
        ("force, back, negative", 100.0, 10.0),
    ):
        for sign in (1.0, -1.0):
            assert checks(specified, sign * 0.99 * lbf)[which].passed
            assert not checks(specified, sign * 1.01 * lbf)[which].passed
    assert force_band(control, 0.0) == pytest.approx(force_lbf * LBF)
    assert STATIC[control].breakout_N == pytest.approx(breakout_lbf * LBF)
    assert math.degrees(SURFACE_rad[surface]) == pytest.approx(degrees)


@pytest.mark.parametrize(("surface", "degrees"), [("", 2.0), ("aileron", 2.0), ("spoiler", 3.0)])
def test_a_surface_may_be_off_by_two_degrees_and_a_spoiler_by_three(
    surface: str, degrees: float
) -> None:
    """Of 25° for the whole travel, so much is lacking where it is judged last, at 93 %."""
    data, full = bench().controls["column"], math.radians(25.0)
    for off, passed in ((0.98 * degrees, True), (1.02 * degrees, False)):
        felt = four(lambda at: 500.0 * at, 1.0 - off / (0.93 * 25.0))
        for check in surface_checks(data, full, 0.0, felt, surface):
            assert check.passed is passed
            assert check.tolerance == pytest.approx(degrees)
            assert check.name.startswith(surface or "surface")


def test_forces_are_judged_from_3_to_93_percent_of_the_travel_where_they_are_worst() -> None:
    data = bench().controls["column"]
    wanted = four(lambda at: 10.0 + 1000.0 * at)
    at = judged(data, wanted, wanted)
    for leg, side in zip(at, (1.0, 1.0, -1.0, -1.0), strict=True):
        assert leg.deflection[[0, -1]] == pytest.approx(side * np.array([0.03, 0.93]) * TRAVEL)
        assert leg.felt == pytest.approx(side * (10.0 + 1000.0 * side * leg.deflection))
    # 8 % more everywhere: nearest to its limit, the 5 lbf, where it is last judged
    felt = four(lambda at: 1.08 * (10.0 + 1000.0 * at))
    last = 10.0 + 1000.0 * 0.93 * TRAVEL
    for check in static_checks(data, "column", 0.0, felt, wanted)[2:]:
        assert abs(check.reference) == pytest.approx(last)
        assert check.margin == pytest.approx(1.0 - 0.08 * last / (5.0 * LBF), rel=1e-6)


@pytest.mark.parametrize("cubic", [0.0, 4e3])
def test_the_breakout_is_where_the_lines_straight_start_meets_neutral(cubic: float) -> None:
    """A hardening spring, or a slope that ends at a tenth of the travel, does not shift it."""
    hardening = four(lambda at: 12.0 + 800.0 * at + cubic * at**3)[0]
    assert breakout(hardening, TRAVEL, TRAVEL) == pytest.approx(12.0, abs=0.15)
    at = 0.1 * TRAVEL
    broken = four(lambda x: 12.0 + 2000.0 * np.minimum(x, at) + 300.0 * np.maximum(x - at, 0.0))
    for leg in broken:
        assert breakout(leg, TRAVEL, at) == pytest.approx(12.0, abs=1e-6)


FRICTION: dict[str, Any] = {"friction_N": 6.0, "breakout_N": 9.0}


def both(rig: Rig, configuration: Any, pressure: float = 3000.0) -> Any:
    return sweep(configure(rig, configuration), "column", pressure)


def test_a_sweep_shows_friction_and_breakout() -> None:
    response = both(bench(FRICTION), "rigid")
    out = response.time_s < 25.0
    back = (response.time_s > 28.0) & (response.time_s < 45.0)
    for rows, side in ((out, 1.0), (back, -1.0)):
        moving = rows & (response.deflection > 0.02) & (response.deflection < 0.15)
        expected = 9.0 + G_STIFF * response.deflection[moving] + side * 6.0
        # what is left is the damping at the sweep's speed of some 8 mm/s
        assert np.max(np.abs(response.force[moving] - expected)) < 1.0
    assert response.deflection.max() == pytest.approx(0.1778, rel=1e-3)
    assert response.deflection.min() == pytest.approx(-0.1778, rel=1e-3)


def test_a_rig_that_is_as_specified_passes_with_nearly_all_of_its_margin() -> None:
    """What it lacks is the damping at the sweep's 8 mm/s: 0.8 N of a tolerance of 9."""
    checks = check_feel(configure(bench(FRICTION), "rigid"), "column", 0.3)
    assert all(check.margin > 0.9 for check in checks)
    assert {c.name.split(",")[0] for c in checks} >= {"breakout", "force", "surface"}


def test_static_checks_tell_the_compensated_rig_from_the_uncompensated() -> None:
    rig = bench()
    specified = specified_legs(specified_rig(rig), "column", 3000.0)
    data = rig.controls["column"]
    checks = {
        name: static_checks(data, "column", 3000.0, legs(both(rig, name)), specified)
        for name in ("compensated", "uncompensated")
    }
    assert all(c.passed for c in checks["compensated"])
    forces = [c for c in checks["uncompensated"] if c.name.startswith("force")]
    assert not any(c.passed for c in forces)
    lost = bend_loss(K_REPORT, G_STIFF) / (1.0 + bend_loss(K_REPORT, G_STIFF))
    assert forces[0].measured == pytest.approx(forces[0].reference * (1.0 - lost), rel=0.01)
    assert forces[0].reference == pytest.approx(G_STIFF * 0.93 * 0.1778, rel=1e-6)


def test_the_surface_lacks_what_the_bend_takes() -> None:
    rig = bench()
    for name, loss in (
        ("compensated", 0.0),
        ("uncompensated", uncompensated_loss(K_REPORT, G_STIFF)),
    ):
        felt = legs(both(rig, name))
        [check, _] = surface_checks(rig.controls["column"], 0.4, 3000.0, felt)
        assert check.measured == pytest.approx(check.reference * (1.0 - loss), abs=0.05)


def test_a_reference_is_what_the_host_assumes_and_not_what_is_amiss() -> None:
    """G_B twice what the host has, S₂ 30 % off, the schedule's slope halved: each is felt."""
    place = "controls.column"
    amiss: dict[str, dict[str, Any]] = {
        "G_B": {
            f"{place}.loader.basic_gradient_N_per_m": 1120.0,
            f"{place}.compensation.basic_gradient_N_per_m": 560.0,
        },
        "S2": {f"{place}.sensing.modifying_scale": 1.3},
        "slope": {f"{place}.schedule.slope": 0.5},
        "breakout": {
            f"{place}.loader.breakout_N": 12.0,
            f"{place}.compensation.breakout_N": 0.0,
        },
    }
    assert all(check.passed for check in check_feel(bench(), "column") if check.unit == "N")
    for name, changes in amiss.items():
        checks = check_feel(bench().changed(changes), "column")
        failed = {c.name.split(",")[0] for c in checks if not c.passed and c.unit == "N"}
        assert ("breakout" if name == "breakout" else "force") in failed, name
    # at the softest gradient 560 N/m is specified, and the loader holds 1120
    doubled = check_feel(bench().changed(amiss["G_B"]), "column")
    worst = next(c for c in doubled if c.name == "force, out, positive")
    assert worst.reference == pytest.approx(560.0 * 0.93 * 0.1778, rel=1e-6)
    assert worst.measured > 1.7 * worst.reference


def test_one_gradient_is_documented_at_one_pressure() -> None:
    flat = bench({"controls.column.schedule.total_gradient_N_per_m": [800.0, 800.0]})
    assert feel_pressures(flat, "column") == [0.0]
    assert len(feel_pressures(bench(), "column")) == 3
