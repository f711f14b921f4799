"""What flies a rig with a curve: comparison, map, stability, checks, calibration, figures."""

from __future__ import annotations

import numpy as np
import pytest

from coupled.api.benches import bench as take_readings
from coupled.api.flights import compare, fly
from coupled.api.gaps import diagnose
from coupled.authority.maps import loss_maps
from coupled.authority.stability.limits import stability_limits
from coupled.calibration.calibrate import calibrate
from coupled.calibration.documentation import check_feel
from coupled.errors import InputError
from coupled.flight.manoeuvre import configure
from coupled.flight.pilot import Clamp, Step
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


def test_a_calibration_of_a_rig_with_a_curve_finds_its_bend() -> None:
    rig = column({"friction_N": 0.0})
    found = calibrate(take_readings(rig, seed=2), rig)
    bend = found.line.bend
    assert abs(bend.value - K_REPORT) < 2.0 * bend.half_width
    assert bend.half_width < 0.1 * K_REPORT


def test_the_figure_has_the_specified_curve_beside_what_is_felt() -> None:
    figure = draw_rig(curved(CYCLIC, [CYCLIC_N]))
    lines = {line.get_label(): line for line in figure.axes[0].get_lines()}
    felt = lines["felt at 0 kPa"]
    at, force = np.asarray(felt.get_xdata(), float), np.asarray(felt.get_ydata(), float)
    inside = (at > CYCLIC[0]) & (at < CYCLIC[-1])
    assert force[inside] == pytest.approx(np.interp(at[inside], CYCLIC, CYCLIC_N), abs=1e-6)
    assert "specified" in lines


def test_a_diagnosis_refuses_a_curve_in_one_line() -> None:
    rig = column()
    flight = fly(rig, column=Step(force_N=60.0), duration_s=14, dynamic_pressure_Pa=3000.0)
    with pytest.raises(InputError, match="which a diagnosis does not model") as refused:
        diagnose(rig, flight.record)
    assert refused.value.key == "controls.column.schedule.force_N"
