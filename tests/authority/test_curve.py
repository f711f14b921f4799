"""What flies a rig with a curve: comparison, map, stability, checks, calibration, figures."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.api.benches import bench as take_readings
from coupled.api.flights import compare
from coupled.authority.maps import loss_maps
from coupled.authority.stability.limits import stability_limits
from coupled.calibration.calibrate import calibrate
from coupled.calibration.checks import ControlCheck
from coupled.calibration.documentation import check_feel
from coupled.calibration.qualification import check_numbers
from coupled.calibration.sweeps import BEYOND, SWEEP_s, TURN_s, sweep
from coupled.flight.manoeuvre import configure
from coupled.flight.pilot import Clamp
from coupled.plots.flights import draw_comparison
from coupled.plots.readings import draw_readings
from coupled.plots.rigs import draw_rig
from tests.support.curves import COLUMN_N, CYCLIC, CYCLIC_N, SEGMENT, column, curved
from tests.support.rigs import K_REPORT


def held(deflection: float) -> float:
    """Return the 737-like column's force at 3000 Pa, N, by hand."""
    return 17.8 + float(np.interp(deflection, SEGMENT, COLUMN_N[1]))


def test_the_authority_lost_and_the_force_felt_are_the_closed_form_to_a_thousandth() -> None:
    """A grip held at 70 mm, on the third segment; without corrections F = F_BO + f(δc)."""
    rig = column({"friction_N": 0.0})
    flown = compare(
        rig, column=Clamp(deflection_m=0.07, rise_s=0.3), duration_s=8, dynamic_pressure_Pa=3000.0
    )
    computed = 0.07
    for _ in range(50):
        computed = 0.07 - K_REPORT * held(computed)
    lost = 1.0 - computed / 0.07
    slack = held(0.07) - 17.8
    assert flown.loss("uncompensated") == pytest.approx(lost, rel=1e-3)
    assert flown.loss("compensated") == pytest.approx(0.0, abs=1e-4)
    assert flown.loss("gradient only") == pytest.approx(K_REPORT * held(0.07) / 0.07, rel=1e-3)
    felt = (held(computed) - 17.8) / slack
    assert flown.felt_ratio("uncompensated") == pytest.approx(felt, rel=1e-3)
    assert flown.felt_ratio("compensated") == pytest.approx(1.0, rel=1e-3)
    (panel,) = (a for a in draw_comparison(flown).axes if a.get_ylabel() == "pilot's force, N")
    (drawn,) = (one for one in panel.get_lines() if one.get_label() == "commanded, specified")
    at, force = np.asarray(drawn.get_xdata(), float) / 100.0, np.asarray(drawn.get_ydata(), float)
    beyond = at > 0.0  # from the first point, the breakout
    assert np.min(at[beyond]) < 1e-6
    for node in (1e-4, *SEGMENT[1:3]):
        assert np.interp(node, at[beyond], force[beyond]) == pytest.approx(held(node), rel=2e-3)
    for flight in flown:
        assert flight.outcome.loss == pytest.approx(flight.outcome.loss_closed_form, abs=2e-5)


def test_the_map_follows_the_curve() -> None:
    maps = {one.configuration: one for one in loss_maps(column(), "column")}
    found = maps["gradient only"]
    inside = (found.deflection > 0.002) & (found.deflection < 0.12)
    force = np.array([held(float(d)) for d in found.deflection[inside]])
    wanted = K_REPORT * force / found.deflection[inside]
    assert found.loss[-1, inside] == pytest.approx(wanted, rel=1e-3)


def test_stability_is_judged_at_the_steepest_segment() -> None:
    found = stability_limits(column(), "column")
    assert found.gradient == pytest.approx(42.0 / 0.02)
    for filed in found.filed:
        assert filed.simulated == pytest.approx(filed.theory, rel=0.02)


def test_the_curve_is_the_reference_of_the_static_checks() -> None:
    """As specified it passes with its margin; a node raised by 20 % fails the force there."""
    rig = configure(column(), "rigid")
    good = [check for check in check_feel(rig, "column") if not check.name.startswith("9")]
    static = [check for check in good if check.name.startswith(("force", "breakout"))]
    assert len(static) >= 12
    assert all(check.passed for check in static)
    raised = [[0.0, 20.0, 35.0, 60.0, 70.0, 110.0], [0.0, 42.0, 84.0, 155.0, 164.0, 260.0]]
    wrong = configure(curved(SEGMENT, raised, {"breakout_N": 17.8, "friction_N": 9.0}), "rigid")
    failed = [c for c in check_feel(wrong, "column", specification=rig) if not c.passed]
    assert any(check.name.startswith("force, out, positive") for check in failed)


def test_a_slow_sweep_crosses_a_flat_curve_evenly() -> None:
    """In the flat middle the hand overcomes friction and damping of the sweep's speed alone."""
    rig = curved(CYCLIC, [CYCLIC_N], {"friction_N": 2.0})
    swept = sweep(rig, "column", 0.0)
    data = rig.controls["column"]
    out = slice(0, int(np.argmax(swept.deflection)))
    flat = (swept.deflection[out] > 0.003) & (swept.deflection[out] < 0.009)
    speed = BEYOND * data.travel / (0.25 * SWEEP_s - TURN_s)
    wanted = 2.0 + data.loader.damping * speed
    assert swept.hand_force[out][flat] == pytest.approx(wanted, abs=0.01)
    assert np.count_nonzero(flat) == pytest.approx(0.006 / speed * rig.frame_rate, rel=0.02)


def test_a_breakout_that_is_not_felt_is_printed_as_zero() -> None:
    check = ControlCheck("breakout, positive", 0.0, 2.4e-15, 60.0, 8.9, "N")
    assert check_numbers(check) == ("0", "60", "8.9", "N")


def test_a_calibration_of_a_rig_with_a_curve_finds_its_bend() -> None:
    rig = column({"friction_N": 0.0})
    found = calibrate(take_readings(rig, seed=2), rig)
    bend = found.line.bend
    assert abs(bend.value - K_REPORT) < 2.0 * bend.half_width
    assert bend.half_width < 0.1 * K_REPORT
    drawn = draw_readings(found, "readings").axes[0].get_lines()
    points, fits = (
        [np.asarray(one.get_xydata(), float) for one in drawn if one.get_linestyle() == style]
        for style in ("None", "-")
    )
    fit = np.concatenate([each[each[:, 0] != 0.0] for each in fits])
    read = np.concatenate(points)
    assert sorted(fit[:, 0]) == pytest.approx(sorted(read[:, 0]))
    left = np.sum(read[:, 1]) - np.sum(fit[:, 1])
    assert left == pytest.approx(np.sum(found.line.residual), abs=1e-9)
    assert len({len(each) for each in fits}) == 1 and len(fits[0]) > 3


def test_the_figure_has_the_specified_curve_beside_what_is_felt() -> None:
    figure = draw_rig(curved(CYCLIC, [CYCLIC_N]))
    lines = {line.get_label(): line for line in figure.axes[0].get_lines()}
    felt = lines["felt at 0 kPa"]
    at, force = np.asarray(felt.get_xdata(), float), np.asarray(felt.get_ydata(), float)
    inside = (at > CYCLIC[0]) & (at < CYCLIC[-1])
    assert force[inside] == pytest.approx(np.interp(at[inside], CYCLIC, CYCLIC_N), abs=1e-6)
    assert "specified" in lines
