"""Breakout, friction and curve from a measured sweep, recovered from simulated readings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from coupled.calibration.feel import (
    Feel,
    Sweep,
    fit_feel,
    read_sweep,
    sweep_of_record,
    swept_control,
)
from coupled.errors import InputError
from coupled.record.record import Record
from coupled.rig.equations import specified_force
from coupled.rig.rigfile import rig_from_table
from coupled.schema import load_toml
from tests.support.commands import coupled
from tests.support.rigs import BENCH

Floats = NDArray[np.float64]
BREAKOUT_N, FRICTION_N, NOISE_N = 17.8, 9.0, 0.5
NODES = np.array([0.0, 0.02, 0.05, 0.09, 0.13, 0.178])
FORCES = {0.0: [0.0, 20.0, 35.0, 50.0, 70.0, 110.0], 3000.0: [0.0, 42.0, 84.0, 120.0, 164.0, 260.0]}
CYCLIC = np.array([-0.15, -0.06, -0.01, 0.0, 0.01, 0.05, 0.12])
CYCLIC_N = np.array([-60.0, -12.0, 0.0, 0.0, 0.0, 20.0, 48.0])
HEADS = "dynamic_pressure_Pa,deflection_m,force_N"


def swept(low: float, high: float, readings: int = 160) -> tuple[Floats, Floats]:
    """Return δ and the direction of a sweep from neutral to both ends and back."""
    turns = np.array([0.0, high, low, 0.0])
    way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(turns)))))
    at = np.interp(np.linspace(0.0, way[-1], readings), way, turns)
    return at, np.sign(np.gradient(at))


def column_sweep(
    folder: Path, noise: float = NOISE_N, heads: str = HEADS, readings: int = 160
) -> Path:
    """Write the sweeps of a 737-like column, read in the order of the sweep."""
    rng, lines = np.random.default_rng(7), [heads]
    for pressure, forces in FORCES.items():
        at, motion = swept(-NODES[-1], NODES[-1], readings)
        felt = np.sign(at) * (BREAKOUT_N + np.interp(np.abs(at), NODES, forces))
        felt += FRICTION_N * motion + noise * rng.standard_normal(len(at))
        lines += [f"{pressure},{d:.5f},{f:.3f}" for d, f in zip(at, felt, strict=True)]
    path = folder / "sweep.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def fitted(path: Path) -> Feel:
    return fit_feel(read_sweep(path, "column"))


@pytest.fixture(scope="module")
def column(tmp_path_factory: pytest.TempPathFactory) -> Feel:
    return fitted(column_sweep(tmp_path_factory.mktemp("column")))


def test_a_columns_breakout_friction_and_five_segments_are_recovered(column: Feel) -> None:
    found = column
    assert found.breakout_N == pytest.approx(BREAKOUT_N, abs=2.0 * found.breakout_half_width_N)
    assert found.friction_N == pytest.approx(FRICTION_N, abs=2.0 * found.friction_half_width_N)
    assert found.breakout_half_width_N < 0.6
    assert found.friction_half_width_N < 0.1
    assert found.rms_N == pytest.approx(NOISE_N, rel=0.12)
    assert found.deflection[:-1] == pytest.approx(NODES[:-1], abs=0.002)  # of five segments
    for row, forces in zip(found.force, FORCES.values(), strict=True):
        there = np.linspace(0.005, 0.17, 40)
        ours = BREAKOUT_N + np.interp(there, NODES, forces)
        theirs = found.breakout_N + np.interp(there, found.deflection, row)
        assert theirs == pytest.approx(ours, abs=1.0)


def test_breakout_and_friction_that_depend_on_the_pressure_are_doubtful(
    tmp_path: Path, column: Feel
) -> None:
    """Of 12 and 18 N at two pressures the breakout was 14.75 N ± 0.36 N, without a word."""
    assert not len(column.by_pressure)
    path = column_sweep(tmp_path)
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    lines = [head]
    for row in rows:
        pressure, at, felt = map(float, row.split(","))
        lines.append(f"{pressure},{at},{1.5 * felt if pressure else felt}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = fitted(path)
    assert found.by_pressure[1] == pytest.approx(1.5 * found.by_pressure[0], rel=0.1)
    assert found.by_pressure[0] == pytest.approx([BREAKOUT_N, FRICTION_N], rel=0.1)
    (doubt,) = found.doubts("column")
    assert doubt.startswith("breakout and friction depend on q̄: ") and "at 3000 Pa" in doubt


@pytest.mark.slow
def test_the_readings_of_a_fit_are_limited_by_means(tmp_path: Path) -> None:
    sweep = read_sweep(column_sweep(tmp_path, readings=4000), "column")
    assert len(sweep.force) == 400 * len(FORCES)
    found = fit_feel(sweep)
    assert found.friction_N == pytest.approx(FRICTION_N, abs=2.0 * found.friction_half_width_N)
    assert found.rms_N == pytest.approx(NOISE_N / np.sqrt(10.0), rel=0.2)


def test_readings_in_another_order_than_the_sweeps_are_refused(tmp_path: Path) -> None:
    """Their friction was 0, since all of them seemed to turn."""
    path = column_sweep(tmp_path)
    head, *rows = path.read_text().splitlines()
    shuffled = np.random.default_rng(2).permutation(rows).tolist()
    path.write_text("\n".join([head, *shuffled]) + "\n")
    with pytest.raises(InputError, match=r"turns at most of its readings.*order of the sweep"):
        read_sweep(path, "column")


@pytest.mark.slow
def test_exact_readings_give_the_exact_curve(tmp_path: Path) -> None:
    found = fitted(column_sweep(tmp_path, noise=0.0))
    assert found.breakout_N == pytest.approx(BREAKOUT_N, abs=0.05)
    assert found.friction_N == pytest.approx(FRICTION_N, abs=0.02)
    assert found.rms_N < 0.1


def test_readings_at_rest_at_a_turning_point_are_not_used(tmp_path: Path) -> None:
    """Friction holds any force at rest: here between the forces of both directions."""
    end = NODES[-1]
    ways = (
        (0.0, end, 1.0),
        (end, end, 0.3),
        (end, -end, -1.0),
        (-end, -end, 0.2),
        (-end, 0.0, 1.0),
    )
    at = np.concatenate([np.linspace(a, b, 40)[1:] for a, b, _ in ways])
    motion = np.repeat([way for *_, way in ways], 39)
    forces = np.sign(at) * (BREAKOUT_N + np.interp(np.abs(at), NODES, FORCES[0.0]))
    forces += FRICTION_N * motion
    rows = [f"{d:.6f},{f:.6f}" for d, f in zip(at, forces, strict=True)]
    path = tmp_path / "rest.csv"
    path.write_text("\n".join(["deflection_m,force_N", *rows]) + "\n", encoding="utf-8")
    found = fitted(path)
    assert found.friction_N == pytest.approx(FRICTION_N, abs=0.05)
    assert not np.any(found.used & (np.abs(motion) != 1.0))
    places = np.linspace(0.01, 0.17, 17)
    expected = BREAKOUT_N + np.interp(places, NODES, FORCES[0.0])
    assert found.at(places, 0, 0.0) == pytest.approx(expected, abs=0.5)


def test_a_cyclic_flat_about_the_middle_is_unlike_on_its_two_sides(tmp_path: Path) -> None:
    rng, lines = np.random.default_rng(3), ["deflection_m,force_N,direction"]
    at, motion = swept(CYCLIC[0], CYCLIC[-1])
    felt = np.interp(at, CYCLIC, CYCLIC_N) + 2.0 * motion + 0.2 * rng.standard_normal(len(at))
    for d, f, way in zip(at, felt, motion * np.sign(at), strict=True):
        if d != 0.0:
            lines.append(f"{d:.5f},{f:.3f},{'out' if way > 0.0 else 'back'}")
    path = tmp_path / "cyclic.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    found = fitted(path)
    assert found.deflection[0] < 0.0 < found.deflection[-1]
    assert found.breakout_N < 0.3
    assert found.friction_N == pytest.approx(2.0, abs=0.1)
    there = np.linspace(-0.14, 0.11, 60)
    ours = np.interp(there, CYCLIC, CYCLIC_N)
    assert found.at(there, 0, 0.0) == pytest.approx(ours, abs=0.6)


@pytest.mark.parametrize(
    ("lines", "key", "said"),
    [
        (["0,0.01,5"] * 4, "", "holds 4 readings; 8 are needed"),
        ([f"0,{0.01 * k},{9 * k}" for k in range(1, 10)], "", "on the way back; sweep out and"),
        (
            [f"0,{d},{-300 * d}" for d in (*np.arange(1, 9) / 90, *np.arange(7, 0, -1) / 90)],
            "row 9",
            "has forces against the deflections",
        ),
        (
            [f"0,{d / 90},{9 + d}" for d in (*range(1, 9), 3600, *range(8, 0, -1))],
            "",
            "has 1 of its readings beyond 1% of the largest deflection, 40, in row 10",
        ),
    ],
)
def test_readings_that_decide_nothing_are_one_line(
    tmp_path: Path, lines: list[str], key: str, said: str
) -> None:
    path = tmp_path / "sweep.csv"
    path.write_text("\n".join([HEADS, *lines]) + "\n", encoding="utf-8")
    with pytest.raises(InputError) as refused:
        read_sweep(path, "column")
    assert refused.value.key == key
    assert said in refused.value.problem


@pytest.mark.parametrize(
    ("heads", "factor", "reaches"),
    [("deflection_m,force_N", 1e3, "177"), ("force_N,deflection_m", 1.0, "285")],
)
def test_deflections_in_another_unit_or_exchanged_are_refused(
    tmp_path: Path, heads: str, factor: float, reaches: str
) -> None:
    at, motion = swept(-NODES[-1], NODES[-1])
    felt = np.sign(at) * (BREAKOUT_N + np.interp(np.abs(at), NODES, FORCES[3000.0]))
    rows = np.stack((factor * at, felt + FRICTION_N * motion), axis=1)
    path = tmp_path / "sweep.csv"
    np.savetxt(path, rows, delimiter=",", header=heads, comments="")
    with pytest.raises(InputError) as refused:
        read_sweep(path, "column")
    assert refused.value.key == "column_deflection_m"
    assert f"reaches {reaches}, and looks like mm" in refused.value.problem


def test_a_gauge_that_saturates_is_doubtful(tmp_path: Path) -> None:
    column_sweep(tmp_path)
    head, *rows = (tmp_path / "sweep.csv").read_text(encoding="utf-8").split()
    cells = [row.split(",") for row in rows]
    cut = [f"{q},{d},{np.clip(float(force), -60.0, 60.0):g}" for q, d, force in cells]
    (tmp_path / "cut.csv").write_text("\n".join([head, *cut]) + "\n", encoding="utf-8")
    assert read_sweep(tmp_path / "sweep.csv", "column").doubts("column") == []
    done = coupled(tmp_path, "new", "feel", "cut.csv", "cut.toml")
    assert done.returncode == 0
    assert "column_force_N: clipped at 60" in done.stderr
    assert "# Doubtful: column_force_N: clipped at 60" in (tmp_path / "cut.toml").read_text("utf-8")


def test_forces_that_no_rising_curve_fits_are_doubtful(tmp_path: Path, column: Feel) -> None:
    assert column.doubts("column") == []
    at, _ = swept(-0.1, 0.1)
    rows = [f"{d:.5f},{50.0 * np.sin(30.0 * d):.3f}" for d in at]
    path = tmp_path / "waves.csv"
    path.write_text("\n".join(["deflection_m,force_N", *rows]) + "\n", encoding="utf-8")
    (doubt,) = fitted(path).doubts("column")
    assert "no rising curve fits the forces: the residual RMS is " in doubt


def test_the_command_writes_a_schedule_that_a_rig_takes(tmp_path: Path) -> None:
    column_sweep(tmp_path)
    done = coupled(tmp_path, "new", "feel", "sweep.csv", "feel.toml")
    assert done.returncode == 0, done.stderr
    assert "curve        5 segments for both sides, at 2 q̄" in done.stdout
    assert (tmp_path / "feel.png").stat().st_size > 10_000
    keys = load_toml(tmp_path / "feel.toml")["controls"]["column"]
    data = BENCH["controls"]["column"]
    whole = data | {"schedule": keys["schedule"], "loader": data["loader"] | keys["loader"]}
    rig = rig_from_table(BENCH | {"controls": {"column": whole}}, "test")
    felt = specified_force(rig, "column", 3000.0, np.array([0.1]))
    assert felt == pytest.approx(BREAKOUT_N + np.interp(0.1, NODES, FORCES[3000.0]), abs=1.0)
    assert rig.controls["column"].loader.friction == pytest.approx(FRICTION_N, abs=0.2)
    again = coupled(tmp_path, "new", "feel", "sweep.csv", "feel.toml")
    assert again.returncode == 2
    assert "is there already" in again.stderr


LOG_MAP = """[clock]
from = "t"
[channels.column_force_N]
from = "pull"
unit = "lbf"
[channels.column_deflection_m]
from = "column"
unit = "mm"
[channels.wheel_force_N]
from = "rim"
unit = "N"
[channels.wheel_deflection_rad]
from = "wheel"
unit = "rad"
[channels.dynamic_pressure_Pa]
from = "q"
unit = "Pa"
"""


def logged(folder: Path, pressure: float = 3000.0, wheel: float = 0.001) -> Path:
    """Write the log of a slow sweep of the column at 50 Hz, while q̄ and wheel change a little."""
    at, motion = swept(-NODES[-1], NODES[-1], 4000)
    felt = np.sign(at) * (BREAKOUT_N + np.interp(np.abs(at), NODES, FORCES[3000.0]))
    felt += FRICTION_N * motion + NOISE_N * np.random.default_rng(7).standard_normal(len(at))
    time, share = 0.02 * np.arange(len(at)), np.linspace(0.0, 1.0, len(at))
    rim, turned = 5.0 * share, wheel * np.sin(6.0 * share)
    told = 3000.0 + (pressure - 3000.0) * share
    columns = np.stack((time, felt / 4.4482216, 1e3 * at, rim, turned, told), axis=1)
    np.savetxt(
        folder / "log.csv",
        columns,
        fmt="%.8g",
        delimiter=",",
        header="t,pull,column,rim,wheel,q",
        comments="",
    )
    (folder / "map.toml").write_text(LOG_MAP, encoding="utf-8")
    return folder / "log.csv"


IMPORT = ("import", "log.csv", "--map", "map.toml", "--feel", "feel.toml")


def test_a_logged_sweep_gives_record_and_curve(tmp_path: Path) -> None:
    logged(tmp_path, pressure=3020.0)
    done = coupled(tmp_path, *IMPORT)
    assert done.returncode == 0, done.stderr
    assert "segments for both sides, at 1 q̄" in done.stdout
    assert (tmp_path / "out" / "log.csv").is_file()
    assert (tmp_path / "feel.png").stat().st_size > 10_000
    column = load_toml(tmp_path / "feel.toml")["controls"]["column"]
    assert column["loader"]["breakout_N"] == pytest.approx(BREAKOUT_N, abs=0.3)
    assert column["loader"]["friction_N"] == pytest.approx(FRICTION_N, abs=0.1)
    schedule = column["schedule"]
    assert schedule["dynamic_pressure_Pa"] == pytest.approx([3010.0], abs=1.0)
    assert schedule["deflection_m"][-1] == pytest.approx(NODES[-1], rel=0.01)
    felt = np.interp(NODES[1:-1], schedule["deflection_m"], schedule["force_N"][0])
    assert felt == pytest.approx(FORCES[3000.0][1:-1], abs=0.5)


@pytest.mark.parametrize(
    ("log", "words", "said"),
    [
        ({"pressure": 4000.0}, IMPORT, "q̄ goes from 3000 to 4000 Pa"),
        ({"wheel": 0.5}, IMPORT, "moves column and wheel"),
        ({}, ("import", "log.csv", "--suggest", "m.toml", "--feel", "f.toml"), "goes with --map"),
        ({}, (*IMPORT[:-1], "feel.csv"), "ends in .toml"),
    ],
)
def test_a_log_that_is_no_sweep_is_one_line(
    tmp_path: Path, log: dict[str, float], words: tuple[str, ...], said: str
) -> None:
    logged(tmp_path, **log)
    done = coupled(tmp_path, *words)
    assert done.returncode == 2
    assert said in " ".join(done.stderr.split())
    assert {file.name for file in tmp_path.iterdir()} == {"log.csv", "map.toml"}


def test_a_record_without_forces_is_no_sweep(tmp_path: Path) -> None:
    logged(tmp_path)
    pulled = '[channels.column_force_N]\nfrom = "pull"\nunit = "lbf"\n'
    turned = '[channels.wheel_force_N]\nfrom = "rim"\nunit = "N"\n'
    text = LOG_MAP.replace(pulled, "").replace(turned, "")
    (tmp_path / "map.toml").write_text(text, encoding="utf-8")
    done = coupled(tmp_path, *IMPORT)
    assert done.returncode == 2
    assert "lacks force and deflection of one control" in " ".join(done.stderr.split())


def both_sides(rate_Hz: float = 50.0) -> Record:
    """Return a sweep to both sides: 500 N/m, 5 N of friction, 3 N of breakout."""
    t = np.arange(round(40.0 * rate_Hz)) / rate_Hz
    deflection = 0.1 * np.sin(2.0 * np.pi * t / 20.0)
    way = np.sign(np.cos(2.0 * np.pi * t / 20.0))
    force = 500.0 * deflection + 5.0 * way + 3.0 * np.sign(deflection)
    return Record(
        ("time_s", "column_force_N", "column_deflection_m"), np.column_stack((t, force, deflection))
    )


def test_a_sweep_across_neutral_keeps_its_breakout() -> None:
    """Means of rows on both sides of neutral made a steep segment of it."""
    found = fit_feel(sweep_of_record(both_sides(), "column", Path("log.csv")))
    assert found.breakout_N == pytest.approx(3.0, abs=0.05)
    assert found.friction_N == pytest.approx(5.0, abs=0.05)


def test_a_control_at_rest_is_no_sweep() -> None:
    still = both_sides().data.copy()
    still[:, 2] = 0.0
    with pytest.raises(InputError, match="never changes: the column is at rest"):
        swept_control(Record(both_sides().channels, still), Path("log.csv"))


def curved_sweep(
    seed: int, readings: int = 40, zero_N: float = 0.0, stop_N_per_m: float = 0.0
) -> Sweep:
    """Return a sweep of 0.15 m out and back on both sides: 5 N of breakout, 8 N of friction."""
    a = np.linspace(0.0, 0.15, readings + 1)
    at = np.concatenate([a, a[-2::-1], -a[1:], -a[-2::-1]])
    motion = np.concatenate([np.ones(readings + 1), -np.ones(2 * readings), np.ones(readings)])
    size = np.abs(at)
    spring = 5.0 + 400.0 * size + 8000.0 * size**3 + stop_N_per_m * np.maximum(size - 0.14, 0.0)
    noise = np.random.default_rng(seed).standard_normal(at.size)
    force = np.sign(at) * spring + 8.0 * motion + zero_N + noise
    turning = np.isin(at, [0.15, -0.15])
    return Sweep(at, force, np.zeros(at.size), np.where(turning, 0.0, motion))


def test_the_interval_of_a_breakout_contains_it_where_the_curve_bends() -> None:
    """From the nodes that the criterion keeps, none of these four intervals contained it."""
    found = [fit_feel(curved_sweep(seed)) for seed in (10, 13, 14, 17)]
    within = [abs(each.breakout_N - 5.0) <= each.breakout_half_width_N for each in found]
    assert all(within)
    assert all(each.zero_N == each.straight == 0.0 for each in found)


def test_a_gauge_that_is_not_zero_does_not_hide_the_breakout() -> None:
    """The breakout was 0, and the curve had a step."""
    found = fit_feel(curved_sweep(0, zero_N=6.0))
    assert found.breakout_N == pytest.approx(5.0, abs=1.5)
    assert found.zero_N == pytest.approx(6.0, abs=0.3)
    (doubt,) = found.doubts("column")
    assert "N are in it on both sides: a gauge's zero, or a trim?" in doubt


def test_a_stop_at_the_end_of_a_sweep_does_not_hide_the_breakout() -> None:
    """The breakout was 0.04 N, by 2 segments with a residual of 2.7 N."""
    found = fit_feel(curved_sweep(0, stop_N_per_m=4e4))
    assert found.rms_N < 1.3
    assert found.breakout_N == pytest.approx(5.0, abs=1.5)


def test_a_curve_has_no_more_nodes_than_its_readings_determine() -> None:
    """From 12 readings at 3 deflections it had 22 segments, and 20.5 N of breakout."""
    found = fit_feel(curved_sweep(0, readings=4))
    assert len(found.deflection) <= 3
    doubt = found.doubts("column")[-1]
    assert doubt.startswith("breakout: is right if the curve is straight up to 0.")
