"""A first rig without an aircraft: by answers in either system of units, or by a log."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from coupled.errors import InputError
from coupled.exporting.keys import check_keys
from coupled.record.record import Record, record_of
from coupled.rig.rig import Rig
from coupled.rig.rigfile import read_rig
from coupled.rig.standalone import nodes_of, run_control
from coupled.surveying.benchrig import answer, questions
from coupled.surveying.fromlog import numbers_from_log
from tests.support.commands import coupled, files
from tests.support.rigs import bench

TRUE = {
    "mass_kg": 3.0,
    "damping_N_s_per_m": 30.0,
    "basic_gradient_N_per_m": 800.0,
    "breakout_N": 6.0,
    "friction_N": 4.0,
    "servo_frequency_Hz": 0.0,
    "bend_m_per_N": 0.0,
}
FIRST_s, EACH_s = 30.0, 4.5


def yoke() -> Rig:
    rows = {"dynamic_pressure_Pa": [0.0], "total_gradient_N_per_m": [800.0]}
    place = "controls.column"
    loader: dict[str, object] = {f"{place}.loader.{key}": value for key, value in TRUE.items()}
    loader |= {f"{place}.schedule": rows, f"{place}.compensation.bend_m_per_N": 0.0}
    return bench().changed(loader)


def log_of(rig: Rig, noise: float, releases: bool = True, both: bool = False) -> Record:
    """Return a log of a slow sweep, then of six releases from alternate sides."""
    frames = round((FIRST_s + (6 * EACH_s if releases else 0.0)) * rig.frame_rate)
    t = nodes_of(rig, frames)
    force = np.where(t < FIRST_s, 110.0 * np.sin(2.0 * np.pi * t / 15.0), 0.0)
    for k in range(6 if releases else 0):
        after = t - FIRST_s - 1.0 - k * EACH_s
        held = (after > 0.0) & (after < 2.0)
        force += np.where(held, (-1.0) ** k * 100.0 * np.minimum(1.0, after), 0.0)
    h = run_control(rig, "column", force, np.zeros(frames))
    rng = np.random.default_rng(1)
    columns = {
        "time_s": h.time_s,
        "column_force_N": h.hand_force + 0.3 * noise * rng.standard_normal(frames),
        "column_deflection_m": h.deflection + 1e-4 * noise * rng.standard_normal(frames),
    }
    if both:
        columns["column_computed_m"] = h.computed + 1e-4 * noise * rng.standard_normal(frames)
    return record_of(columns, "log")


@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_a_sweep_and_releases_give_every_number(noise: float) -> None:
    found = numbers_from_log(log_of(yoke(), noise), "column", "log")
    assert found.gradient == pytest.approx(800.0, rel=0.005)
    assert found.mass == pytest.approx(3.0, rel=0.03)
    assert found.damping == pytest.approx(30.0, rel=0.03)
    assert found.breakout_N == pytest.approx(6.0, abs=0.1)
    assert found.friction_N == pytest.approx(4.0, abs=0.1)
    assert found.sure == {"mass", "damping", "gradient", "breakout_N", "friction_N"}


def test_a_sweep_alone_does_not_determine_the_mass() -> None:
    found = numbers_from_log(log_of(yoke(), 1.0, releases=False), "column", "log")
    assert {"gradient", "friction_N"} <= found.sure
    assert "mass" not in found.sure


@pytest.mark.parametrize(("noise", "bend"), [(0.0, 9e-5), (0.0, 2e-4), (1.0, 2e-4)])
def test_of_both_deflections_the_loader_is_that_of_the_computed_one(
    noise: float, bend: float
) -> None:
    """The grip moves by K·F more: the loader's numbers are not those of the grip's motion."""
    rig = yoke().changed({"controls.column.loader.bend_m_per_N": bend})
    found = numbers_from_log(log_of(rig, noise, both=True), "column", "log")
    assert found.bend == pytest.approx(bend, rel=0.01)
    assert found.gradient == pytest.approx(800.0 / (1.0 + 800.0 * bend), rel=0.01)
    assert found.mass == pytest.approx(3.0, rel=0.03)
    assert found.damping == pytest.approx(30.0, rel=0.03)
    assert found.breakout_N == pytest.approx(6.0, abs=0.1)
    assert found.friction_N == pytest.approx(4.0, abs=0.1)
    assert "bend" in found.sure


@pytest.mark.parametrize("lacking", ["column_force_N", "column_deflection_m"])
def test_a_log_without_force_or_deflection_is_refused(lacking: str) -> None:
    record = log_of(yoke(), 0.0)
    columns = {name: record[name] for name in record.channels if name != lacking}
    with pytest.raises(InputError, match=f"log: {lacking}: is missing"):
        numbers_from_log(record_of({"time_s": record.time_s, **columns}, "log"), "column", "log")


def test_a_rig_from_a_log_has_its_numbers_and_guesses_the_rest(tmp_path: Path) -> None:
    record = log_of(yoke(), 1.0)
    names = ["time_s", "column_force_N", "column_deflection_m"]
    np.savetxt(
        tmp_path / "log.csv",
        np.column_stack([record[name] for name in names]),
        delimiter=",",
        header=",".join(names),
        comments="",
    )
    done = coupled(tmp_path, "new", "rig", "--from", "log.csv", "yoke.toml", "--units", "us")
    assert done.returncode == 0, done.stderr
    printed = " ".join(done.stdout.split())
    gradient = float(printed.partition("force gradient ")[2].partition(" lb/in determined")[0])
    assert gradient == pytest.approx(800.0 / 175.1268, rel=0.005)
    column = read_rig(tmp_path / "yoke.toml").controls["column"]
    assert column.loader.mass == pytest.approx(3.0, rel=0.03)
    assert column.loader.servo_frequency == 0.0
    assert column.schedule.total_gradient == [pytest.approx(800.0, rel=0.005)]
    assert column.guesses == [
        "travel_m",
        "length_m",
        "loader.bend_m_per_N",
        "compensation.bend_m_per_N",
    ]


def test_a_bench_rig_takes_answers_in_us_units(tmp_path: Path) -> None:
    words = ["--set", "travel=4", "--set", "gradient=12lbf/in", "--set", "servo=yes"]
    done = coupled(tmp_path, "new", "rig", "--bench", "yoke.toml", *words, "--units", "us")
    assert done.returncode == 0, done.stderr
    rig = read_rig(tmp_path / "yoke.toml")
    column = rig.controls["column"]
    assert rig.flight is None
    assert column.travel == pytest.approx(0.1016)
    assert column.schedule.total_gradient == [pytest.approx(12.0 * 175.1268, rel=1e-4)]
    assert column.loader.servo_frequency > 0.0
    assert "travel_m" not in column.guesses
    assert "loader.mass_kg" in column.guesses


def test_a_constant_gradient_is_one_row_for_every_command(tmp_path: Path) -> None:
    words = ["--set", "travel=0.1", "--set", "gradient=800"]
    assert coupled(tmp_path, "new", "rig", "--bench", "yoke.toml", *words).returncode == 0
    check_keys(read_rig(tmp_path / "yoke.toml"), "yoke.toml")
    assert coupled(tmp_path, "new", "run", "pull.toml", "--rig", "./yoke.toml").returncode == 0
    assert coupled(tmp_path, "check", "./pull.toml").returncode == 0


@pytest.mark.parametrize(
    ("text", "name", "value"),
    [("4in", "travel", 0.1016), ("12lbf/in", "gradient", 2101.52), ("2 lbf", "friction", 8.8964)],
)
def test_an_answer_may_have_its_own_unit(text: str, name: str, value: float) -> None:
    assert answer(text, questions("column")[name], "si") == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--bench", "a.toml", "--set", "mass=4lb"), "mass: 'lb' is no unit of it"),
        (("--bench", "a.toml", "--set", "travel=4"), "travel: '4' is in another unit: a hand re"),
        (("--bench", "a.toml", "--set", "travel=0"), "travel: '0' is no number above 0, in m"),
        (("--bench", "a.toml", "--set", "mass=4", "--set", "mass=5"), "gives mass twice"),
        (("--bench", "a.toml", "--set", "weight=3"), "--set: 'weight=3' is no NAME=VALUE"),
        (("--bench", "a.toml", "--set", "servo=maybe"), "servo: 'maybe' is neither yes nor no"),
        (("--bench", "a.toml", "b.toml"), "give the new rig's file alone"),
        (("--from", "none.csv", "a.toml"), "none.csv: cannot be read"),
        (("T37", "--set", "mass=3"), "--set: goes with --bench or --from"),
        ((), "give a JSBSim model, or --bench, or --from LOG"),
    ],
)
def test_what_cannot_be_a_bench_is_refused_in_a_line(
    tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    done = coupled(tmp_path, "new", "rig", *words)
    assert done.returncode == 2
    assert said in " ".join(done.stderr.split())
    assert files(tmp_path) == set()


def swept(rate_Hz: float = 50.0) -> dict[str, np.ndarray]:
    """Return a log of 20 s of a control with friction and a spring, but no breakout."""
    t = np.arange(round(20.0 * rate_Hz)) / rate_Hz
    x = 0.05 * np.sin(0.4 * np.pi * t)
    force = 2000.0 * x + 5.0 * np.sign(np.cos(0.4 * np.pi * t))
    return {"time_s": t, "column_force_N": force, "column_deflection_m": x}


def test_a_rig_from_a_log_has_its_rate_and_a_number_that_it_determines_as_0(tmp_path: Path) -> None:
    pl.DataFrame(swept()).write_csv(tmp_path / "log.csv")
    done = coupled(tmp_path, "new", "rig", "--from", "log.csv", "yoke.toml")
    assert done.returncode == 0, done.stderr
    rig = read_rig(tmp_path / "yoke.toml")
    column = rig.controls["column"]
    assert (rig.frame_rate, column.loader.breakout) == (50.0, 0.0)
    assert "loader.breakout_N" not in column.guesses
    assert column.loader.friction == pytest.approx(5.0, abs=0.1)


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("time_s", lambda t: 1e3 * t, "runs at 0.05 Hz: is it in milliseconds?"),
        ("column_deflection_m", lambda x: 1e3 * x, "reaches 50, and looks like mm, cm or in"),
        ("time_s", lambda t: np.where(t > 5.0, t + 1.0, t), "has a gap or a jump after 5.000 s"),
        ("column_force_N", lambda f: -f, "moves against column_deflection_m"),
        ("column_force_N", lambda f: np.where(f == f[7], np.nan, f), "row 9 holds no number"),
    ],
)
def test_a_log_that_no_diagnosis_would_take_gives_no_rig(
    tmp_path: Path, name: str, change: Callable[[np.ndarray], np.ndarray], said: str
) -> None:
    log = swept()
    frame = pl.DataFrame(log | {name: change(log[name])}, nan_to_null=True)
    frame.write_csv(tmp_path / "log.csv")
    done = coupled(tmp_path, "new", "rig", "--from", "log.csv", "yoke.toml")
    assert done.returncode == 2
    assert f"log.csv: {name}: {said}" in " ".join(done.stderr.split())
    assert files(tmp_path) == {"log.csv"}
