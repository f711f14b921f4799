"""A calibration as a whole: what it refuses, whom it accuses, when it is stale."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coupled.calibration.assumedscales import assumed_scales, real_scales, stale
from coupled.calibration.calibrate import calibrate_control
from coupled.calibration.calibrated import with_calibration
from coupled.calibration.errors_in_variables import errors_in_variables
from coupled.calibration.estimate import perfect_instruments, usual_instruments
from coupled.calibration.figures import remarks
from coupled.calibration.readings import Readings
from coupled.calibration.readingsfile import read_readings
from coupled.errors import InputError
from coupled.rig.parameters import Control
from coupled.rig.rigfile import read_rig
from coupled.rig.rigwrite import rig_text
from coupled.units import POUND_N
from tests.support.readings import (
    S1,
    S3,
    K,
    column,
    csv_file,
    grid,
    readings,
    report_rig,
    with_errors,
)

USUAL = usual_instruments("column")


def fit(r: Readings, control: Control | None = None, **tools: Any) -> Any:
    return calibrate_control(r, control or column(), "column", tools.get("tools", USUAL), "r.csv")


def altered(**changes: Any) -> Control:
    """Return the report's column with values changed, {`section__key`: value}."""
    keys = {key.replace("__", "."): value for key, value in changes.items()}
    place = "controls.column"
    return report_rig().changed({f"{place}.{k}": v for k, v in keys.items()}).controls["column"]


def test_typed_readings_give_k_in_inches_a_pound(tmp_path: Path) -> None:
    """Made by hand from K = 0.016 in/lb and 14.286 V/in, to the last digit that a meter shows."""
    found = fit(read_readings(csv_file(tmp_path), "column"))
    assert found.line.bend.value == pytest.approx(K, rel=0.01)
    assert found.line.s1.value == pytest.approx(14.286 / 0.0254, rel=1e-3)
    assert found.s2["the null, eq. (14)"].value == pytest.approx(0.96 * found.s3.value)


@pytest.mark.parametrize(
    ("length", "force", "said"),
    [(1.0, 1.0, ""), (1.0, 1.0 / POUND_N, "looks like pounds"), (0.1, 1.0, "another unit")],
)
def test_readings_in_another_unit_are_doubtful(length: float, force: float, said: str) -> None:
    """K was wrong by the ratio of the units, with a narrow interval and without a remark."""
    delta, pull = grid()
    v1 = S1 * (delta - K * pull)
    found = fit(readings(length * delta, force * pull, v1, S3 * pull))
    remark = " ".join(line for line in remarks(found) if line.startswith("doubtful"))
    assert said in remark if said else not remark


@pytest.mark.parametrize("signal", ["v1", "v3"])
def test_a_zero_error_of_a_meter_is_refused_or_doubtful(signal: str) -> None:
    """A converter's mid-scale in v1 gave K six times too large, with a narrow interval."""
    good = with_errors(*grid(), USUAL, np.random.default_rng(14))
    assert fit(good).doubts == ()
    read = getattr(good, signal)
    most = float(np.max(np.abs(read)))
    [doubt] = fit(replace(good, **{signal: read + 0.05 * most})).doubts
    assert doubt.startswith(f"{signal} is ") and "correct the zero" in doubt
    with pytest.raises(InputError, match=f"{signal}_V: is .* subtract it from each reading"):
        fit(replace(good, **{signal: read + 2.6 * most}))


def test_error_free_readings_have_no_zero_error() -> None:
    delta, pull = grid()
    found = fit(readings(delta, pull, S1 * (delta - K * pull), S3 * pull))
    assert found.doubts == ()


def test_readings_of_a_rigid_structure_converge() -> None:
    """The fit compared the step of b = -K*S1 with b itself, which is nearly 0."""
    made = with_errors(*grid(), USUAL, np.random.default_rng(15))
    for _ in range(8):
        line = errors_in_variables(made, USUAL).line
        made = replace(made, v1=made.v1 + line.bend.value * line.s1.value * made.force)
    assert line.bend.value == pytest.approx(0.0, abs=1e-6 * K)


@pytest.mark.parametrize("labels", ["one", "several"])
def test_one_gradient_is_refused_with_the_reading_that_would_separate(labels: str) -> None:
    delta, force = grid(1, 8)
    r = readings(delta, force, per_set=8 if labels == "one" else 2)
    with pytest.raises(InputError) as caught:
        fit(r)
    text = str(caught.value)
    assert "S1 and K are inseparable" in text
    assert "add a reading at 2189 N/m, at 0.0433 m (94.7 N)" in text
    assert "rows 2 to 9" in text
    assert "\n" not in text


def test_the_reading_that_is_asked_for_does_separate() -> None:
    delta, force = grid(1, 8)
    more = readings(np.append(delta, 0.0432), np.append(force, 94.6), per_set=8)
    assert fit(more, tools=perfect_instruments()).line.bend.value == pytest.approx(K, rel=1e-9)


def test_noise_does_not_pass_for_a_second_gradient() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        with pytest.raises(InputError, match="to within the instruments' errors"):
            fit(with_errors(*grid(1, 12), USUAL, rng))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"force": np.full(25, 40.0)}, "rows 2 to 26: every force is the same"),
        ({"v1": np.full(25, 4.0)}, "every v1 is the same"),
        ({"force": np.zeros(25)}, "is not 0 in 0 rows"),
        ({"v1": -readings(*grid()).v1}, "v1_V: falls as the deflection grows"),
        ({"v3": -readings(*grid()).v3}, "v3_V: falls as the force grows"),
        ({"v3": np.zeros(25)}, "every v3 is the same"),
        ({"v1": S1 * (grid()[0] + K * grid()[1])}, "K is negative"),
        ({"force": grid()[1] * np.where(np.arange(25) < 20, 1.0, -1.0)}, "row 22: force and defl"),
        ({"deflection": 1000.0 * grid()[0]}, "row 2: deflection: is .* another unit"),
    ],
)
def test_readings_that_do_not_determine_k_are_refused(change: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        fit(replace(readings(*grid()), **change))


def test_readings_of_a_rigid_loader_are_accepted() -> None:
    """One to three sets of a hundred were refused: K was below 0 by two standard errors."""
    rng = np.random.default_rng(6)
    delta, force = grid()
    for _ in range(100):
        bent = with_errors(delta, force, USUAL, rng)
        found = fit(replace(bent, v1=bent.v1 + S1 * K * force))
        assert found.line.bend.value == pytest.approx(0.0, abs=0.1 * K)


def test_a_control_held_at_one_deflection_tells_k_by_its_gradients() -> None:
    """As the report found the loss: the same throw at low and high gradients."""
    slopes = np.array([560.4, 900.0, 1300.0, 1700.0, 2189.1])
    r = readings(np.full(5, 0.06), slopes * 0.06, per_set=1)
    assert fit(r, tools=perfect_instruments()).line.bend.value == pytest.approx(K, rel=1e-9)


def test_a_supply_against_the_hand_is_named() -> None:
    good = readings(*grid())
    r = replace(
        good,
        null_row=np.array([27, 28]),
        null_side=np.ones(2),
        null_v1=np.array([9.0, 8.0]),
        null_v2=np.array([5.0, -4.0]),
        null_v3=np.array([5.0, 4.0]),
    )
    with pytest.raises(InputError, match="row 28: v2_V: has another sign than v3"):
        fit(r)


def test_too_few_readings_are_refused() -> None:
    with pytest.raises(InputError, match="in 3 rows; 4 readings are the least"):
        fit(readings(*grid(3, 1), per_set=1))


@pytest.mark.parametrize(
    ("field", "index", "factor", "columns"),
    [
        ("deflection", 7, 10.0, "deflection or v1"),
        ("v1", 12, 0.1, "deflection or v1"),
        ("v1", 3, 1.27, "deflection or v1"),
        ("force", 18, 10.0, "force"),
        ("force", 20, 0.7, "force or v3"),
        ("v3", 4, -1.0, "force or v3"),
    ],
)
def test_a_mistyped_reading_is_named_by_its_row(
    field: str, index: int, factor: float, columns: str
) -> None:
    good = with_errors(*grid(), USUAL, np.random.default_rng(11))
    assert fit(good).suspects == ()
    typed = getattr(good, field).copy()
    typed[index] *= factor
    found = fit(replace(good, **{field: typed}))
    [suspect] = found.suspects
    assert (suspect.row, suspect.columns) == (index + 2, columns)
    assert index + 2 not in found.readings.row
    assert found.line.bend.low < K < found.line.bend.high


def test_a_third_of_the_readings_may_be_wrong() -> None:
    good = with_errors(*grid(), USUAL, np.random.default_rng(12))
    typed = good.v1.copy()
    typed[::3] *= 1.5
    found = fit(replace(good, v1=typed))
    assert {s.row for s in found.suspects} == set(range(2, 27, 3))
    assert found.line.bend.value == pytest.approx(K, rel=0.1)


def test_an_arc_is_corrected_and_what_is_beyond_14_degrees_named() -> None:
    length = 0.5
    control = altered(loader__arc_geometry=True, length_m=length)
    delta, force = grid()
    level = replace(
        readings(delta, force),
        deflection=length * np.sin(delta / length),  # eq. (15)
    )
    found = fit(level, control, tools=perfect_instruments())
    assert found.line.s1.value == pytest.approx(S1, rel=1e-10)
    assert found.line.bend.value == pytest.approx(K, rel=1e-9)
    far = np.flatnonzero(delta / length > np.radians(14.0)) + 2
    assert found.beyond == far.tolist()
    assert len(far) > 3
    left_alone = fit(level, altered(length_m=length))
    assert left_alone.level is None
    assert left_alone.beyond
    assert abs(left_alone.line.s1.value / S1 - 1.0) > 5e-3
    with pytest.raises(InputError, match=r"on an arc of 0\.13 m, which no ruler reads"):
        fit(level, altered(loader__arc_geometry=True, length_m=0.13))


def test_a_calibration_carries_its_gains_and_goes_stale_with_them(tmp_path: Path) -> None:
    rig = report_rig()
    found = fit(with_errors(*grid(), USUAL, np.random.default_rng(1)))
    written = with_calibration(rig, "column", found, date="1974-02-04")
    path = tmp_path / "new.toml"
    path.write_text(rig_text(written), encoding="utf-8")
    again = read_rig(path)
    assert again == written
    control = again.controls["column"]
    assert control.calibration.date == "1974-02-04"
    assert stale(control) == []
    assert stale(column()) == []  # there is none

    def with_changed(key: str, value: float) -> Control:
        return again.changed({f"controls.column.{key}": value}).controls["column"]

    longer = with_changed("length_m", 1.0)
    assert stale(longer) == ["the column's length (m) was 0.9 and is 1"]
    [change] = stale(with_changed("gains.s1_over_s2_N_per_m", 2000.0))
    assert change.startswith("the gain S1/S2 was 2249.72")
    [change] = stale(with_changed("compensation.bend_m_per_N", 1e-4))
    assert change.startswith("the host uses K = 0.0001")
    assert fit(readings(*grid()), longer).changed


def test_a_calibration_changes_what_the_host_assumes_and_not_the_hardware() -> None:
    rig = report_rig()
    found = fit(with_errors(*grid(), USUAL, np.random.default_rng(1)))
    before, new = rig.controls["column"], with_calibration(rig, "column", found)
    after = new.controls["column"]
    one, two = real_scales(before), real_scales(after)
    for name in ("s1", "s2", "s3"):
        assert getattr(two, name) == pytest.approx(getattr(one, name), rel=1e-12)
    assert after.loader == before.loader
    assert after.compensation.bend == found.line.bend.value
    assert assumed_scales(after).s1 == found.line.s1.value
    taken = with_calibration(rig, "column", found, hardware=True).controls["column"]
    assert taken.loader.bend == found.line.bend.value
    assert taken.sensing.deflection_scale == taken.sensing.force_scale == 1.0


@pytest.mark.parametrize("counts", [(3, 9), (12, 4)])
def test_repeated_corners_are_not_taken_for_mistyped(counts: tuple[int, int]) -> None:
    """A plan repeats two corners: the smaller group must not look like outliers to the larger."""
    delta = np.repeat([0.169, 0.0685], counts)
    force = np.repeat([94.7, 150.0], counts)
    rng = np.random.default_rng(6)
    for _ in range(40):
        good = with_errors(delta, force, USUAL, rng)
        good = replace(good, label=tuple(np.repeat(["soft", "stiff"], counts)))
        assert fit(good).suspects == ()
    typed = good.v1.copy()
    typed[-1] *= 1.2
    typed[0] *= 0.8
    found = fit(replace(good, v1=typed))
    assert [s.row for s in found.suspects] == [2, 1 + sum(counts)]


def test_a_reading_at_neutral_does_no_harm() -> None:
    good = readings(np.append(grid()[0], 0.0), np.append(grid()[1], 0.0))
    found = fit(good)
    assert found.suspects == ()
    assert found.line.bend.value == pytest.approx(K, rel=1e-9)
    assert found.s3.value == pytest.approx(0.26, rel=1e-12)
