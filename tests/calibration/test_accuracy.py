"""What a calibration leaves of deflection and feel: the rig's own statics, and the scatter."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from coupled.calibration.accuracy import actual_over_ordered, deflection_off, expected, felt_off
from coupled.calibration.assumedscales import Scales
from coupled.calibration.errors_in_variables import errors_in_variables
from coupled.calibration.estimate import Estimate, usual_instruments
from coupled.rig.statics import static_line
from tests.support.readings import (
    S1,
    S2,
    S3,
    K,
    column,
    grid,
    readings,
    report_rig,
    with_errors,
)
from tests.support.rigs import G_STIFF, K_REPORT, bench


def test_closed_forms_are_the_rigs_statics() -> None:
    """A host that assumes 1.1·K, with S₁ real 0.93, S₂ 1.05 and S₃ 1.04 of what it assumes.

    By the analog multiplier; `test_multiplied` has the digital product.
    """
    changes = {
        "sensing.computed_scale": 0.93,
        "sensing.modifying_scale": 1.05,
        "sensing.force_scale": 1.04,
        "compensation.bend_m_per_N": 1.1 * K_REPORT,
    }
    rig = bench({f"controls.column.{key}": value for key, value in changes.items()})
    line = static_line(rig, "column", 3000.0, np.array([0.03]))
    true, assumed = Scales(0.93, 1.05, 1.04), Scales(1.0, 1.0, 1.0)
    made = actual_over_ordered(assumed, true)
    assert made == pytest.approx(0.93 / 1.05)
    felt = felt_off(made, 1.1 * K_REPORT, K_REPORT, (G_STIFF, 560.0))
    assert line.force[0] / line.deflection[0] / G_STIFF - 1.0 == pytest.approx(felt, rel=1e-9)
    # δ̂ at the gradient that is felt, which is not quite the one asked for
    gradient = line.force[0] / line.deflection[0]
    off = deflection_off(assumed, 1.1 * K_REPORT, true, K_REPORT, float(gradient))
    assert line.estimate[0] / line.deflection[0] - 1.0 == pytest.approx(off, rel=1e-9)


@pytest.mark.parametrize("tied", [False, True], ids=["S2 by a null", "S2 by the gain S1/S2"])
def test_what_is_promised_is_the_scatter_that_comes(tied: bool) -> None:
    """Of 200 calibrations, whose standard deviation is known to 5 %; the scale errs by 10 N.

    S₂ is found by itself, to 0.5 %, or is Ŝ₁ times a gain that is known.
    """
    rng, control = np.random.default_rng(17), column()
    tools = replace(usual_instruments("column"), scale=10.0)
    true, offs, felts, errors = Scales(S1, S2, S3), [], [], []
    for _ in range(200):
        fit = errors_in_variables(with_errors(*grid(), tools, rng), tools)
        s2 = Estimate(S2 * (1.0 + 0.005 * rng.standard_normal()), 0.005 * S2, 4.0)
        if tied:
            s2 = fit.line.s1.scaled(S2 / S1)
        found = expected(fit, s2, control, tied)
        assert found is not None
        assert found.felt is not None
        g, bend = found.gradient, fit.line.bend.value
        assumed = Scales(fit.line.s1.value, s2.value, fit.s3.value)
        offs.append(deflection_off(assumed, bend, true, K, g))
        made = actual_over_ordered(assumed, true)
        felts.append(felt_off(made, bend, K, (g, control.loader.basic_gradient)))
        errors.append((found.deflection.error, found.felt.error))
    promised = np.sqrt(np.mean(np.square(errors), axis=0))
    assert promised[0] == pytest.approx(np.std(offs), rel=0.15)
    assert promised[1] == pytest.approx(np.std(felts), rel=0.15)


def test_errors_of_a_fit_reach_the_estimate_together() -> None:
    """S₁, K and S₃ drawn with the fit's own covariance scatter δ̂/δ by as much as is promised."""
    rng = np.random.default_rng(5)
    fit = errors_in_variables(
        with_errors(*grid(), usual_instruments("column"), rng), usual_instruments("column")
    )
    found = expected(fit, None, column())
    assert found is not None
    s1, bend, s3 = fit.line.s1.value, fit.line.bend.value, fit.s3.value
    drawn = rng.multivariate_normal((s1, -bend * s1, s3), fit.errors.covariance, 4000)
    true = Scales(s1, S2, s3)
    offs = [
        deflection_off(Scales(a, S2, c), -b / a, true, bend, found.gradient) for a, b, c in drawn
    ]
    assert found.deflection.error == pytest.approx(np.std(offs), rel=0.04)


def test_an_error_of_s2_is_felt_by_the_share_that_the_host_adds() -> None:
    """Found without any other error, felt over specified follows S₂ as its closed form does."""
    delta, force = grid()
    fit = errors_in_variables(readings(delta, force), usual_instruments("column"))
    error = 0.01 * S2
    found = expected(fit, Estimate(S2, error, 1e6), column())
    assert found is not None
    assert found.felt is not None
    gradients = (found.gradient, column().loader.basic_gradient)
    more, less = (felt_off(made, K, K, gradients) for made in (1.01, 0.99))
    assert found.felt.error == pytest.approx(0.5 * (more - less), rel=1e-3)
    assert found.felt.error < 0.01


def test_without_s2_the_feel_is_not_known_and_a_soft_structure_tells_nothing() -> None:
    rng, tools = np.random.default_rng(2), usual_instruments("column")
    fit = errors_in_variables(with_errors(*grid(), tools, rng), tools)
    found = expected(fit, None, column())
    assert found is not None
    assert found.felt is None
    place = "controls.column"
    stiff: dict[str, Any] = {f"{place}.schedule.total_gradient_N_per_m": [560.4] * 3 + [1.1 / K]}
    stiff |= {f"{place}.{which}.bend_m_per_N": 0.0 for which in ("loader", "compensation")}
    assert expected(fit, None, report_rig().changed(stiff).controls["column"]) is None
