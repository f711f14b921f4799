"""Signals between the frames, against SciPy's spline and exact cubics."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from coupled.rig.nodes import on_nodes
from tests.support.gaps import nominal_rig


@pytest.mark.parametrize("samples", [4, 5, 40, 1200])
def test_the_interpolant_is_the_not_a_knot_cubic_spline(samples: int) -> None:
    rig = nominal_rig(False)
    values = np.random.default_rng(samples).normal(size=samples)
    nodes = on_nodes(rig, values)
    assert len(nodes) == (samples - 1) * rig.substeps + 1
    at = np.arange(len(nodes)) / rig.substeps
    np.testing.assert_allclose(nodes, CubicSpline(np.arange(samples), values)(at), atol=1e-11)
    np.testing.assert_array_equal(nodes[:: rig.substeps], values)


def test_a_cubic_is_interpolated_exactly() -> None:
    rig = nominal_rig(False)
    at = np.arange(30 * rig.substeps + 1) / rig.substeps
    cubic = 1.0 - 0.4 * at + 0.03 * at**2 - 7e-4 * at**3
    np.testing.assert_allclose(on_nodes(rig, cubic[:: rig.substeps]), cubic, rtol=1e-12)
