"""What a calibration leaves of deflection and feel: the rig's own statics, and the scatter."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from coupled.calibration.accuracy import deflection_off, expected, felt_off, made_of_asked
from coupled.calibration.assumed import Scales
from coupled.calibration.errors_in_variables import errors_in_variables
from coupled.calibration.estimate import Estimate, usual_instruments
from coupled.rig.statics import static_line
from tests.support.readings import S1, S2, S3, K, column, grid, report_rig, with_errors
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
    made = made_of_asked(assumed, true)
    assert made == pytest.approx(0.93 / 1.05)
    felt = felt_off(made, 1.1 * K_REPORT, K_REPORT, (G_STIFF, 560.0))
    assert line.force[0] / line.deflection[0] / G_STIFF - 1.0 == pytest.approx(felt, rel=1e-9)
    # δ̂ at the gradient that is felt, which is not quite the one asked for
    gradient = line.force[0] / line.deflection[0]
    off = deflection_off(assumed, 1.1 * K_REPORT, true, K_REPORT, float(gradient))
    assert line.estimate[0] / line.deflection[0] - 1.0 == pytest.approx(off, rel=1e-9)


@pytest.mark.slow
def test_what_is_promised_is_the_scatter_that_comes() -> None:
    rng, tools, control = np.random.default_rng(17), usual_instruments("column"), column()
    true, offs, felts, errors = Scales(S1, S2, S3), [], [], []
    for _ in range(400):
        fit = errors_in_variables(with_errors(*grid(), tools, rng), tools)
        s2 = Estimate(S2 * (1.0 + 0.002 * rng.standard_normal()), 0.002 * S2, 4.0)
        found = expected(fit, s2, control)
        assert found is not None
        assert found.felt is not None
        g, bend = found.gradient, fit.line.bend.value
        assumed = Scales(fit.line.s1.value, s2.value, fit.s3.value)
        offs.append(deflection_off(assumed, bend, true, K, g))
        made = made_of_asked(assumed, true)
        felts.append(felt_off(made, bend, K, (g, control.loader.basic_gradient)))
        errors.append((found.deflection.error, found.felt.error))
    promised = np.sqrt(np.mean(np.square(errors), axis=0))
    assert promised[0] == pytest.approx(np.std(offs), rel=0.12)
    assert promised[1] == pytest.approx(np.std(felts), rel=0.12)


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
