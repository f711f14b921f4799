"""Readings of a home-made yoke: without a force signal v3, and in counts of a converter."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest
from matplotlib.lines import Line2D

from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.calibrate import calibrate_control
from coupled.calibration.estimate import perfect_instruments, usual_instruments
from coupled.calibration.plan import stations
from coupled.calibration.readings import Readings
from coupled.calibration.readingsfile import read_readings, write_readings
from coupled.calibration.result import CalibrationResult
from coupled.errors import InputError
from coupled.plots.readings import draw_readings
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from tests.support.commands import coupled

RIG = read_rig(shipped_rigs()["report-column"])
COLUMN = RIG.controls["column"]
COUNTS_per_V = 300.0


def taken(folder: Path, *, perfect: bool = False) -> Path:
    tools = perfect_instruments() if perfect else usual_instruments("column")
    bench = CalibrationBench(RIG, "column", stations(RIG, "column", 5, 5), tools, 0, again=False)
    file = folder / "whole.csv"
    write_readings(file, take_readings(bench, 3), "column")
    return file


def rewritten(file: Path, drop: tuple[str, ...], counts: bool = False) -> Path:
    """Return a copy of readings without some columns, and with v1 in counts."""
    rows = list(csv.DictReader(file.read_text(encoding="utf-8").splitlines()))
    made = file.with_name("mine.csv")
    for row in rows:
        for name in drop:
            del row[name]
        if counts:
            row["v1_counts"] = str(round(COUNTS_per_V * float(row.pop("v1_V"))))
    with made.open("w", encoding="utf-8", newline="") as target:
        writer = csv.DictWriter(target, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return made


def fitted(file: Path) -> CalibrationResult:
    read: Readings = read_readings(file, "column")
    return calibrate_control(read, COLUMN, "column", usual_instruments("column"), file)


NO_GAUGE = ("v3_V", "v2_V", "approach")


def test_bend_and_scale_need_no_v3(tmp_path: Path) -> None:
    file = rewritten(taken(tmp_path, perfect=True), NO_GAUGE)
    found = fitted(file)
    assert found.s3 is None
    assert found.line.bend.value == pytest.approx(COLUMN.loader.bend, rel=1e-5)
    assert found.line.bend.holds(COLUMN.loader.bend)


def test_without_v3_the_interval_is_wider_and_still_right(tmp_path: Path) -> None:
    whole = taken(tmp_path)
    with_v3, without = fitted(whole), fitted(rewritten(whole, NO_GAUGE))
    assert without.line.bend.holds(COLUMN.loader.bend)
    assert 0.7 < without.line.bend.error / with_v3.line.bend.error < 3.0


def test_counts_give_the_same_bend_and_a_scale_in_counts(tmp_path: Path) -> None:
    volts = fitted(rewritten(taken(tmp_path), NO_GAUGE))
    counts = fitted(rewritten(tmp_path / "whole.csv", NO_GAUGE, counts=True))
    assert counts.readings.signal == "counts"
    assert counts.line.bend.value == pytest.approx(volts.line.bend.value, rel=0.02)
    assert counts.line.s1.value == pytest.approx(COUNTS_per_V * volts.line.s1.value, rel=1e-3)
    assert "s1_counts_per_m" in counts.as_dict()["errors_in_variables"]


def test_the_fit_does_not_wait_for_an_s3_that_nobody_read() -> None:
    # In these readings the steps of S3 alternate between two roundings.
    found = fitted(Path(__file__).parents[1] / "data" / "yoke-readings.csv")
    assert found.line.bend.holds(2.4e-4)
    assert found.line.s1.holds(9800.0)


def test_the_command_writes_a_rig_from_counts_without_v3(tmp_path: Path) -> None:
    file = rewritten(taken(tmp_path), NO_GAUGE, counts=True)
    words = ("--rig", "report-column", "--write", "new.toml", "--figure", "f.svg")
    done = coupled(tmp_path, "calibrate", str(file), *words, "--report", "r.html", "--hardware")
    assert done.returncode == 0, done.stderr
    assert "S1, counts/m" in done.stdout
    assert "v3 was not read" in done.stdout
    assert "S3, " not in done.stdout
    new = read_rig(tmp_path / "new.toml").controls["column"]
    assert new.sensing == COLUMN.sensing
    assert new.compensation.bend == new.loader.bend == pytest.approx(COLUMN.loader.bend, rel=0.1)
    assert coupled(tmp_path, "bench", "--rig", "./new.toml").stderr == ""


def test_the_figure_draws_both_directions(tmp_path: Path) -> None:
    rows = list(csv.DictReader(taken(tmp_path).read_text(encoding="utf-8").splitlines()))
    for row in rows[1::2]:
        for name in ("deflection_m", "force_N", "v1_V", "v3_V"):
            row[name] = str(-float(row[name]))
    file = tmp_path / "both.csv"
    with file.open("w", encoding="utf-8", newline="") as target:
        writer = csv.DictWriter(target, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    top = draw_readings(fitted(file), "both").axes[0]
    lines = [line for line in top.get_lines() if isinstance(line, Line2D)]
    spans = [np.asarray(line.get_xdata()) for line in lines if line.get_linestyle() == "-"]
    assert len(spans) == 5
    assert all(x.min() < 0.0 < x.max() for x in spans)


@pytest.mark.parametrize(
    ("heads", "said"),
    [
        ("gradient_set,deflection_m,force_N,v1_V,v2_V", "needs v3_V as well"),
        ("gradient_set,deflection_m,force_N,v1_V,v3_counts", "mixes units: v1_V with v3_counts"),
        ("gradient_set,deflection_m,force_N,v3_V", "the column v1_V is missing"),
    ],
)
def test_columns_that_do_not_go_together_are_refused(tmp_path: Path, heads: str, said: str) -> None:
    file = tmp_path / "r.csv"
    file.write_text(f"{heads}\n1,0.1,10,1,1\n", encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_readings(file, "column")
