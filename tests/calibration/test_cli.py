"""The bench's commands as their users meet them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from coupled.authority.compare import fly_and_judge
from coupled.calibration.documentation import document
from coupled.calibration.estimate import Estimate
from coupled.flight.manoeuvre import Configuration
from coupled.flight.runfile import read_run
from coupled.plots.checks import draw_releases, draw_static_checks
from coupled.plots.documentation import draw_deflections, draw_forces, save_pages
from coupled.plots.readings import plus_minus
from coupled.plots.saving import save
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from coupled.rig.rigwrite import rig_text
from tests.support.commands import coupled, files
from tests.support.readings import CSV, K
from tests.support.rigs import bench as bench_rig


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "r.csv").write_text(CSV)
    return tmp_path


def test_help_has_examples(folder: Path) -> None:
    for command in ("bench", "calibrate", "document"):
        done = coupled(folder, command, "--help")
        assert done.returncode == 0
        assert "Examples" in done.stdout


@pytest.mark.slow
def test_the_commands_bench_and_calibrate_write_a_rig_that_calibrates_again(folder: Path) -> None:
    done = coupled(folder, "bench", "-o", "b.csv")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "readings: b.csv  (25 readings, 6 nulls)\n"
    words = ["calibrate", "b.csv", "--write", "new.toml", "--date", "1974-02-04"]
    done = coupled(folder, *words, "--figure", "f.png", "--json", "c.json")
    assert done.returncode == 0, done.stderr
    assert files(folder) == {"r.csv", "b.csv", "new.toml", "f.png", "c.json"}
    assert "K, in/lb" in done.stdout
    assert "by the null, eq. (14)" in done.stdout
    table = json.loads((folder / "c.json").read_text())
    bend = table["errors_in_variables"]["bend_m_per_N"]
    assert bend["low"] < bend["value"] < bend["high"]
    assert bend["value"] == pytest.approx(K, rel=0.08)
    assert table["normal_equations"]["a_V_per_m"] == pytest.approx(
        table["ordinary_least_squares"]["s1_V_per_m"]["value"], rel=1e-12
    )
    control = read_rig(folder / "new.toml").controls["column"]
    assert control.compensation.bend == bend["value"]
    assert control.calibration.date == "1974-02-04"
    printed = coupled(folder, "calibrate", "b.csv", "--json", "-")
    assert json.loads(printed.stdout) == table


def test_readings_in_inches_and_pounds_are_calibrated(folder: Path) -> None:
    done = coupled(folder, "calibrate", "r.csv")
    assert done.returncode == 0, done.stderr
    assert "6 readings of the column in 2 gradient sets, rows 2 to 7" in done.stdout


def yoke(folder: Path, **changes: float) -> Path:
    """Write a rig of one's own: the report's column on a T-37, whose file states no scales."""
    rig = read_rig(shipped_rigs()["report-column"])
    d = "controls.column"
    none = {f"{d}.sensing.{key}": 0.0 for key in ("s1_V_per_m", "s2_V_per_N", "s3_V_per_N")}
    filed = {f"{d}.{key.replace('__', '.')}": value for key, value in changes.items()}
    path = folder / "my.toml"
    path.write_text(rig_text(rig.changed({**none, **filed})), encoding="utf-8")
    return path


def flown_loss(folder: Path, rig: str, configuration: Configuration) -> float:
    """Return the loss of a held column, flown on a rig file."""
    run = PULL.format(rig=rig)
    (folder / "pull.toml").write_text(run, encoding="utf-8")
    [case] = read_run(str(folder / "pull.toml"))
    return fly_and_judge(case.configured(configuration), configuration).outcome.loss


PULL = """
name = "pull"
card = "A held column."
rig = "{rig}"
duration_s = 3.0
configurations = ["compensated"]
[pilot.column]
kind = "clamp"
deflection_m = 0.03
"""


def test_a_rig_without_scales_flown_as_calibrated_meets_the_promise(folder: Path) -> None:
    yoke(folder, travel_m=0.15)  # 100 V over its travel would be 667 V/m; the readings' is 562
    words = ["calibrate", "r.csv", "--rig", "my.toml", "--write", "new.toml", "--json", "c.json"]
    done = coupled(folder, *words)
    assert done.returncode == 0, done.stderr
    assert "s1_V_per_m, s2_V_per_N, s3_V_per_N: not in my.toml" in done.stdout
    assert done.stderr == ""
    promised = json.loads((folder / "c.json").read_text())["outcome"]["deflection_half_width"]
    lost = flown_loss(folder, "new.toml", "compensated")
    assert abs(lost) < promised + 0.002  # the flown rig has friction
    assert flown_loss(folder, "new.toml", "uncompensated") > 0.1


@pytest.mark.parametrize(
    ("filed", "said"),
    [
        ({"sensing__s1_V_per_m": 470.0}, "S1 is 562.6 V/m by the readings and 470 by the file"),
        ({"loader__bend_m_per_N": 0.0}, "m/N by the readings and 0 by the file"),
    ],
)
def test_readings_of_other_hardware_are_refused_and_taken_where_asked(
    folder: Path, filed: dict[str, float], said: str
) -> None:
    yoke(folder, **filed)
    words = ["calibrate", "r.csv", "--rig", "my.toml", "--write", "new.toml"]
    done = coupled(folder, *words)
    assert done.returncode == 2
    assert said in done.stderr, done.stderr
    assert "--hardware" in done.stderr
    assert files(folder) == {"r.csv", "my.toml"}
    assert coupled(folder, "calibrate", "r.csv", "--rig", "my.toml").returncode == 0
    done = coupled(folder, *words, "--hardware")
    assert done.returncode == 0, done.stderr
    assert abs(flown_loss(folder, "new.toml", "compensated")) < 0.01


def test_the_rig_that_is_taken_without_a_word_is_named(folder: Path) -> None:
    done = coupled(folder, "calibrate", "r.csv")
    assert done.stderr.endswith("are report-column's\n")
    assert done.stderr.startswith("note: no --rig given")


def test_a_stale_calibration_is_said(folder: Path) -> None:
    words = ["calibrate", "r.csv", "--hardware", "--write", "new.toml"]
    assert coupled(folder, *words).returncode == 0
    text = (folder / "new.toml").read_text().replace("length_m = 0.9", "length_m = 0.8", 1)
    (folder / "new.toml").write_text(text)
    done = coupled(folder, "calibrate", "r.csv", "--rig", "new.toml")
    assert "stale calibration" in done.stdout
    change = "the column's length (m) was 0.9 and is 0.8"
    assert change in " ".join(done.stdout.split())
    run = """name = "r"\ncard = "c"\nrig = "new.toml"\nduration_s = 0.2\n
[pilot.column]\nkind = "step"\nforce_N = 10.0\n"""
    (folder / "run.toml").write_text(run)
    flown = coupled(folder, "fly", "run.toml", "-o", "f.csv")
    assert flown.returncode == 0
    assert flown.stderr == f"stale calibration: column: {change}\n"


def test_the_command_prints_a_plan_and_writes_its_form(folder: Path) -> None:
    done = coupled(folder, "calibrate", "--plan", "--write", "form.csv", "--json", "p.json")
    assert done.returncode == 0, done.stderr
    assert "fewest for" in done.stdout
    table = json.loads((folder / "p.json").read_text())
    rows = sum(reading["count"] for reading in table["readings"])
    assert len((folder / "form.csv").read_text().splitlines()) == rows + 1
    assert all(np.isfinite(grid["half_width"]) for grid in table["grids"])
    unfilled = coupled(folder, "calibrate", "form.csv")
    assert unfilled.returncode == 2
    assert "row 2: v1_V: is empty" in unfilled.stderr


def test_the_command_counts_intervals_of_many_benches(folder: Path) -> None:
    done = coupled(folder, "bench", "--repeat", "6", "--json", "-")
    table = json.loads(done.stdout)
    assert table["benches"] == 6
    assert 0.0 <= table["within"] <= 1.0
    assert files(folder) == {"r.csv"}


@pytest.mark.slow
def test_a_document_has_its_pages_and_checks(folder: Path) -> None:
    done = coupled(folder, "document", "-o", "doc", "--readings", "r.csv", "--json", "d.json")
    assert done.returncode == 1  # let go, the bent structure fails Part 60, and the table says why
    assert "column: 40 of 44 checks pass\n  Release: the grip springs back" in done.stdout
    pages = ("forces", "deflections", "static", "release", "readings")
    made = {f"doc/column-{page}.png" for page in pages} | {"doc/report-column.pdf"}
    assert files(folder) == made | {"r.csv", "d.json"}
    assert (folder / "doc/report-column.pdf").read_bytes().startswith(b"%PDF")
    checks = json.loads((folder / "d.json").read_text())["column"]
    assert {c["unit"] for c in checks} == {"N", "°", "s", "%", ""}
    assert all(c["passed"] == (c["margin"] >= 0.0) for c in checks)


@pytest.mark.slow
def test_a_documents_pages_are_the_same_bytes_again(tmp_path: Path) -> None:
    found = document(bench_rig(), "column", 0.3)
    for name in ("one", "two"):
        figures = [draw(found) for draw in (draw_deflections, draw_releases)]
        save_pages(figures, tmp_path / f"{name}.pdf")
        save(draw_static_checks(found), tmp_path / f"{name}.png")
    for suffix in ("pdf", "png"):
        one, two = (tmp_path / f"{name}.{suffix}" for name in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()


HOSTILE = [
    (["calibrate"], "give a file of readings, or --plan"),
    (["calibrate", "none.csv"], "none.csv: cannot be read"),
    (["calibrate", "."], "cannot be read"),
    (["calibrate", "r.csv", "--rig", "nothing"], "is no shipped rig"),
    (["calibrate", "r.csv", "--rig", "none.toml"], "there is no such rig file"),
    (["calibrate", "r.csv", "--control", "wheel"], "--control: no 'wheel'"),
    (["calibrate", "r.csv", "--control", "colum"], "did you mean column?"),
    (["calibrate", "r.csv", "--write", "new.csv"], "a rig file ends in .toml"),
    (["calibrate", "r.csv", "--write", "r.csv/new.toml"], "cannot be written"),
    (["calibrate", "r.csv", "--figure", "f.bmp"], "a figure ends in"),
    (["calibrate", "r.csv", "--json", "r.csv"], "is another file of this command"),
    (["calibrate", "r.csv", "--write", "a.toml", "--json", "a.toml"], "is another file"),
    (["calibrate", "r.csv", "--plan"], "give no readings"),
    (["calibrate", "--plan", "--write", "form.toml"], "ends in .csv"),
    (["calibrate", "--plan", "--hardware"], "--hardware: is for a calibration, not for a plan"),
    (["calibrate", "r.csv", "--precision", "2"], "--precision: is for --plan"),
    (["calibrate", "r.csv", "--hardware"], "--hardware: is for --write NEW.toml"),
    (["bench", "--repeat", "5", "-o", "r2.csv"], "--output: leave it out with --repeat"),
    (["bench", "--precision", "5", "--gradients", "3"], "--gradients: leave it out with --pre"),
    (["bench", "--perfect", "--error", "force=1"], "--error: leave it out with --perfect"),
    (["calibrate", "--plan", "--precision", "0"], "'--precision': Input should be"),
    (["calibrate", "--plan", "--precision", "0.1"], "ask for less"),
    (["calibrate", "--plan", "--rig", "737", "--control", "wheel"], "has one gradient only"),
    (["calibrate", "--plan", "--rig", "737", "--strongest-N", "20"], "overcome the breakout"),
    (["calibrate", "r.csv", "--error", "ruler"], "--error: ruler: '' is no number"),
    (["calibrate", "r.csv", "--error", "rular=1"], "did you mean ruler?"),
    (["calibrate", "r.csv", "--error", "hand=nan"], "is no error of an instrument"),
    (["calibrate", "r.csv", "--error", "scale=-1"], "is no error of an instrument"),
    (["calibrate", "r.csv", "--date", "a\nb", "--write", "n.toml"], "calibration.date"),
    (["bench", "--deflections", "0"], "'--deflections': Input should be greater"),
    (["bench", "-o", "r.txt"], "readings are written as .csv"),
    (["bench", "-o", "r.csv/x.csv"], "cannot be written"),
    (["bench", "--rig", "737", "--control", "pedals"], "has one gradient only"),
    (["bench", "--repeat", "-1"], "'--repeat': Input should be"),
    (["bench", "--seed", "-1"], "'--seed': Input should be"),
    (["document", "nothing"], "is no shipped rig"),
    (["document", "-o", "r.csv"], "is a file; give a folder"),
    (["document", "--control", "wheel"], "no 'wheel'"),
    (["document", "--readings", "none.csv"], "cannot be read"),
    (["document", "--json", "."], "is a folder"),
]


@pytest.mark.parametrize(("words", "says"), HOSTILE, ids=[" ".join(w)[:40] for w, _ in HOSTILE])
def test_wrong_arguments_are_refused_in_one_line(folder: Path, words: list[str], says: str) -> None:
    done = coupled(folder, *words)
    assert done.returncode == 2, done.stdout
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert says in done.stderr
    assert done.stdout == ""
    assert files(folder) == {"r.csv"}


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (9.092e-5, 1e-6, "(9.09 ± 0.20)·10⁻⁵"),
        (562.39, 1.0, "562.4 ± 2.0"),
        (0.015922, 1e-4, "0.01592 ± 0.00020"),
        (0.25, 0.0, "0.25 ± 0"),
    ],
)
def test_a_figure_and_its_interval_end_at_the_same_digit(
    value: float, error: float, text: str
) -> None:
    assert plus_minus(Estimate(value, error, 1e9)) == text


def test_every_control_of_a_shipped_rig_is_drawn(tmp_path: Path) -> None:
    rig = read_rig(shipped_rigs()["c172p"])
    found = document(rig, "wheel", 0.3)
    assert "°" in draw_forces(found).axes[0].get_xlabel()
    assert len(draw_static_checks(document(bench_rig(), "column", None)).axes) == 3
