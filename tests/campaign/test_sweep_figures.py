"""The figures of a sweep: labelled lines or a map, no empty panel, axes that say their scale."""

from __future__ import annotations

from itertools import product

import numpy as np
import polars as pl
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from coupled.plots.campaign import draw_sweep
from coupled.plots.sweepview import is_logarithmic, varying

BEND = "rig.controls.column.loader.bend_m_per_N"
SPEED = "rig.flight.calibrated_airspeed_m_per_s"


def table(bends: np.ndarray, speeds: np.ndarray, ended: bool = False) -> pl.DataFrame:
    """Return a sweep over both, of a loss K·v, compensated but for 7.76e-11."""
    rows = [
        {
            BEND: float(bend),
            SPEED: float(speed),
            "configuration": configuration,
            "loss": bend * speed
            if configuration == "uncompensated"
            else 7.76e-11 * speed / speeds[-1],
            "force_step_N": 7.76e-11 * speed / speeds[-1],
            "felt_ratio": 1.0,
            "ended_early": "hit the ground" if ended and speed == speeds[-1] else "",
        }
        for configuration, bend, speed in product(("uncompensated", "compensated"), bends, speeds)
    ]
    return pl.DataFrame(rows)


def words(figure: Figure) -> str:
    """Return all texts of a figure except tick labels."""
    axes = figure.axes
    said = [figure.get_suptitle(), *(a.get_xlabel() + a.get_ylabel() for a in axes)]
    for legend in figure.legends:
        said += [legend.get_title().get_text(), *(text.get_text() for text in legend.get_texts())]
    return "\n".join(said)


def test_a_short_second_parameter_labels_its_lines() -> None:
    found = table(np.linspace(1e-5, 1e-4, 6), np.array([60.0, 100.0, 140.0]))
    figure = draw_sweep(found, [BEND, SPEED], ["loss"], "bends")
    assert [len(axes.lines) for axes in figure.axes] == [3, 3]
    line = figure.axes[0].lines[1]
    assert np.allclose(line.get_xdata(), np.linspace(1e-5, 1e-4, 6))
    assert np.allclose(line.get_ydata(), 100.0 * 100.0 * np.linspace(1e-5, 1e-4, 6))
    said = words(figure)
    assert said.startswith("bends")
    assert "calibrated airspeed, m/s\n60\n100\n140" in said
    assert not any(axes.get_legend() for axes in figure.axes)


def test_two_long_parameters_make_a_map() -> None:
    found = table(np.geomspace(1e-6, 1e-4, 10), np.linspace(60.0, 140.0, 9), ended=True)
    figure = draw_sweep(found, [BEND, SPEED], ["loss"], "bends")
    meshes = [m for axes in figure.axes for m in axes.collections if isinstance(m, QuadMesh)]
    values: np.ndarray = np.ma.filled(np.ma.asarray(meshes[0].get_array(), float), np.nan).reshape(
        9, 10
    )
    assert np.isnan(values[-1]).all()
    assert values[2, 3] == pytest.approx(100 * np.geomspace(1e-6, 1e-4, 10)[3] * 80.0)
    assert figure.axes[0].get_xscale() == "log"
    assert "column loader bend, m/N (logarithmic)" in words(figure)
    assert "gray: ended early" in words(figure)


def test_what_does_not_vary_has_no_panel_but_is_named() -> None:
    found = table(np.linspace(1e-5, 1e-4, 6), np.array([60.0, 100.0]))
    assert varying(found, ["loss", "force_step_N", "felt_ratio"]) == (
        ["loss"],
        "the same in every flight: force step, N: 0; felt / specified, %: 100",
    )
    figure = draw_sweep(found, [BEND, SPEED], ["loss", "force_step_N", "felt_ratio"], "bends")
    assert len(figure.axes) == 2
    assert "e-11" not in words(figure)


@pytest.mark.parametrize(
    ("values", "is_log"),
    [
        (np.geomspace(1.0, 100.0, 5), True),
        (np.geomspace(1.0, 5.0, 5), False),
        (np.linspace(1.0, 100.0, 5), False),
        (np.array([0.0, 1.0, 100.0]), False),
    ],
)
def test_an_axis_is_logarithmic_where_its_values_are(values: np.ndarray, is_log: bool) -> None:
    assert is_logarithmic(values) == is_log
