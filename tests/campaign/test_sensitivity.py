"""Sensitivity: indices known in closed form, scipy's own, and a rig's by quadrature."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.stats import sobol_indices, uniform
from typer.testing import CliRunner

from coupled.campaign.flights import fly_sweep
from coupled.campaign.journal import opened
from coupled.campaign.plan import planned_flights, read_plan
from coupled.campaign.sensitivity import Floats, design, sensitivity, sobol
from coupled.cli import app
from coupled.errors import InputError
from coupled.parallel import SerialExecutor
from coupled.resources import shipped_sweeps
from tests.support.runs import PUSH

K_LOW, K_HIGH, SLOPE_LOW, SLOPE_HIGH = 4e-5, 1.6e-4, 0.5, 1.0
SWEEP = f"""
name = "s"
run = "push.toml"
configurations = ["uncompensated"]
method = "sensitivity"
samples = 64
seed = 3
keep = ["loss"]
[[vary]]
key = "rig.controls.column.loader.bend_m_per_N"
also = ["rig.controls.column.compensation.bend_m_per_N"]
low = {K_LOW}
high = {K_HIGH}
[[vary]]
key = "rig.controls.column.schedule.slope"
low = {SLOPE_LOW}
high = {SLOPE_HIGH}
"""
STRAIGHT = """
[[case]]
label = "straight"
[case.rig]
"controls.column.loader.breakout_N" = 0.0
"controls.column.schedule.break_deflection_m" = 0.15
"""
NAMES = [f"x{i}" for i in range(3)]


def ishigami(x: Floats) -> Floats:
    """Return Ishigami's function of shares, its arguments running from −π to π."""
    a, b, c = np.pi * (2.0 * np.moveaxis(x, -1, 0) - 1.0)
    return np.asarray(np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a))


def table_of(values: Floats) -> pl.DataFrame:
    rows = {"flight": range(values.size), "configuration": ["c"] * values.size, "f": values}
    return pl.DataFrame(rows)


def test_the_indices_of_ishigamis_function_are_known() -> None:
    values = ishigami(design(1024, 3, 7))
    indices = sensitivity(table_of(values), NAMES, ["f"], 1024)
    known = [(0.3139, 0.5576), (0.4424, 0.4424), (0.0, 0.2437)]
    for index, (first, total) in zip(indices, known, strict=True):
        for share, true in ((index.first, first), (index.total, total)):
            assert share is not None
            assert share.value == pytest.approx(true, abs=0.03)
            assert share.low <= true <= share.high
        assert index.points == 1024


def independent_points(rng: np.random.Generator, samples: int) -> Floats:
    """Return points as `design` has them, of independent draws in place of a Sobol sequence."""
    a, b = rng.random((2, samples, 3))
    mixed = np.repeat(a[None], 3, axis=0)
    for i in range(3):
        mixed[i, :, i] = b[:, i]
    return np.concatenate((a, b, *mixed))


def test_an_interval_is_of_95_percent() -> None:
    """Half an interval is 1.96 standard deviations of the index over independent samples.

    An interval of 90 % would be 1.64 of them. A thousand samples of 256 points each give the
    standard deviation to 2 %.
    """

    def figure(points: Floats) -> Floats:
        x, y, z = np.moveaxis(points, -1, 0)
        return np.asarray(x + 0.5 * y + 0.3 * x * z)

    rng, samples = np.random.default_rng(1), 256
    found = [
        sobol(figure(independent_points(rng, samples)).reshape(5, samples)) for _ in range(1000)
    ]
    deviation = np.std(found, axis=0)
    halves = []
    for _ in range(8):
        table = table_of(figure(independent_points(rng, samples)))
        indices = sensitivity(table, NAMES, ["f"], samples)
        shares = [[index.first, index.total] for index in indices]
        halves.append([[0.5 * (s.high - s.low) for s in pair if s is not None] for pair in shares])
    ratio = np.mean(halves, axis=0).T / deviation
    assert np.mean(ratio) == pytest.approx(1.96, rel=0.07)


def test_the_indices_are_those_of_scipy() -> None:
    values = ishigami(design(256, 3, 1)).reshape(5, 256)
    blocks = {"f_A": values[:1], "f_B": values[1:2], "f_AB": values[2:, None, :]}
    theirs = sobol_indices(func=blocks, n=256, dists=[uniform()] * 3)
    first, total = sobol(values)
    np.testing.assert_allclose(first, theirs.first_order, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(total, theirs.total_order, rtol=1e-9, atol=1e-12)


def test_a_set_differs_from_the_first_in_one_column() -> None:
    a, b, *mixed = design(16, 3, 2).reshape(5, 16, 3)
    assert np.all(a != b)
    for i, here in enumerate(mixed):
        assert np.array_equal(np.flatnonzero((here != a).any(axis=0)), [i])
        assert np.array_equal(here[:, i], b[:, i])


def test_a_point_that_could_not_be_flown_is_left_out_whole() -> None:
    values = ishigami(design(64, 3, 5))
    holed = values.copy()
    holed[2 * 64 + 9] = np.nan
    kept = np.delete(values.reshape(5, 64), 9, axis=1)
    indices = sensitivity(table_of(holed), NAMES, ["f"], 64)
    assert [index.points for index in indices] == [63] * 3
    np.testing.assert_allclose(
        [index.total.value for index in indices if index.total], sobol(kept)[1], rtol=1e-12
    )


def test_a_figure_that_does_not_vary_has_no_indices() -> None:
    indices = sensitivity(table_of(np.full(5 * 16, 0.3)), NAMES, ["f"], 16)
    assert [(index.first, index.total) for index in indices] == [(None, None)] * 3


def by_quadrature() -> tuple[Floats, Floats]:
    """Return first and total indices of K·G/(1 + K·G) for K and the schedule's slope."""
    nodes, weights = np.polynomial.legendre.leggauss(24)
    weights /= 2.0
    bend = K_LOW + (K_HIGH - K_LOW) * 0.5 * (nodes + 1.0)
    slope = SLOPE_LOW + (SLOPE_HIGH - SLOPE_LOW) * 0.5 * (nodes + 1.0)
    gradient = 560.4 + slope * (2189.1 - 560.4)
    lost = np.multiply.outer(bend, gradient)
    lost /= 1.0 + lost
    mean = weights @ lost @ weights
    variance = weights @ (lost - mean) ** 2 @ weights
    of_bend = weights @ (lost @ weights - mean) ** 2 / variance
    of_slope = weights @ (weights @ lost - mean) ** 2 / variance
    return np.array([of_bend, of_slope]), np.array([1.0 - of_slope, 1.0 - of_bend])


@pytest.mark.slow
def test_flown_losses_have_the_indices_of_their_closed_form(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "push.toml").write_text(PUSH + STRAIGHT)
    (tmp_path / "s.toml").write_text(SWEEP)
    plan = read_plan(tmp_path / "s.toml")
    assert len(planned_flights(plan)) == 64 * 4
    ran = CliRunner().invoke(app, ["sweep", "s.toml", "--folder", "o", "-j", "1"])
    assert ran.exit_code == 0, ran.output
    indices = pl.read_csv(tmp_path / "o/sensitivity.csv")
    for name, expected in zip(("first", "total"), by_quadrature(), strict=True):
        found, low, high = (indices[f"{name}{end}"].to_numpy() for end in ("", "_low", "_high"))
        np.testing.assert_allclose(found, expected, atol=0.06)
        assert np.all((low <= expected) & (expected <= high))
    assert (tmp_path / "o/sweep.png").stat().st_size > 10_000
    assert "column loader bend" in ran.output
    with opened(tmp_path / "o", plan) as journal:  # all are there: nothing is flown
        assert len(fly_sweep(plan, journal, SerialExecutor())) == 64 * 4


@pytest.mark.parametrize("samples", ["100", "4"])
def test_samples_are_a_power_of_two(tmp_path: Path, samples: str) -> None:
    (tmp_path / "push.toml").write_text(PUSH + STRAIGHT)
    (tmp_path / "s.toml").write_text(SWEEP.replace("samples = 64", f"samples = {samples}"))
    with pytest.raises(
        InputError, match="samples: must be a power of two, 8 or more, with sensitivity"
    ):
        read_plan(tmp_path / "s.toml")


def test_the_shipped_sweeps_can_be_flown() -> None:
    assert "sensitivity" in shipped_sweeps()
    for file in shipped_sweeps().values():
        assert planned_flights(read_plan(file))
