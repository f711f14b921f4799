"""Readings as a person types them, and every way to mistype them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from coupled.calibration.bench import CalibrationBench, take_readings
from coupled.calibration.estimate import usual_instruments
from coupled.calibration.plan import stations
from coupled.calibration.readingsfile import read_readings, write_readings
from coupled.errors import InputError
from coupled.units import POUND_N, DEGREE_rad, INCH_m
from tests.support.readings import CSV, csv_file, report_rig


def test_inches_and_pounds_become_si(tmp_path: Path) -> None:
    found = read_readings(csv_file(tmp_path), "column")
    assert found.row.tolist() == [2, 3, 4, 5, 6, 7]
    assert found.label[0] == "soft"
    assert found.deflection[1] == pytest.approx(4.0 * INCH_m)
    assert found.force[1] == pytest.approx(12.8 * POUND_N)
    assert found.null_row.tolist() == [8, 9]
    assert found.null_v2.tolist() == [12.0, 18.0]


def test_second_looks_are_averaged_and_their_rise_kept(tmp_path: Path) -> None:
    text = CSV.replace(",remark", ",deflection_after_in,force_after_lb,approach")
    text = text.replace("7.40,,", "7.40,,2.2,6.2,").replace("14.80,,first try", "14.80,,4.0,,")
    text = "\n".join(line + "," * (8 - line.count(",")) for line in text.splitlines())
    text = text.replace("12.0,,,", "12.0,,,in").replace("18.0,,,", "18.0,,,out")
    found = read_readings(csv_file(tmp_path, text), "column")
    assert found.deflection[0] == pytest.approx(2.1 * INCH_m)
    assert found.deflection_rise[0] == pytest.approx(0.2 * INCH_m)
    assert found.force[0] == pytest.approx(6.3 * POUND_N)
    assert found.deflection_looks.tolist() == [2, 2, 1, 1, 1, 1]
    assert found.force_looks.tolist() == [2, 1, 1, 1, 1, 1]
    assert found.null_side.tolist() == [-1.0, 1.0]


def test_a_wheel_is_read_in_degrees(tmp_path: Path) -> None:
    text = CSV.replace("deflection_in", "deflection_deg")
    found = read_readings(csv_file(tmp_path, text), "wheel")
    assert found.deflection[0] == pytest.approx(2.0 * DEGREE_rad)


def test_a_null_may_be_a_reading_too(tmp_path: Path) -> None:
    text = CSV.replace("null,,,40.0", "null,3.1,10.0,40.0")
    found = read_readings(csv_file(tmp_path, text), "column")
    assert found.row.tolist()[-1] == 8
    assert found.null_row.tolist() == [8, 9]


@pytest.mark.parametrize("inches", [False, True])
def test_what_the_bench_writes_is_read_back(tmp_path: Path, inches: bool) -> None:
    rig = report_rig()
    grid = stations(rig, "column", 2, 2)
    made = take_readings(CalibrationBench(rig, "column", grid, usual_instruments("column"), 2), 3)
    write_readings(tmp_path / "r.csv", made, "column", inches)
    again = read_readings(tmp_path / "r.csv", "column")
    for name, value in made.__dict__.items():
        if name not in ("label", "row", "null_row", "signal"):
            np.testing.assert_allclose(getattr(again, name), value, rtol=1e-11, atol=1e-12)
    assert again.label == made.label


HOSTILE = [
    ("", "holds nothing"),
    ("\n\n", "holds nothing"),
    ("\0", "is not text"),
    (CSV.splitlines()[0], "holds no readings"),
    (CSV.replace(",v3_V", ",v4_V"), "row 1: v4_V: is no column of readings; did you mean v"),
    (CSV.replace("force_lb", "force_kg"), "row 1: force_kg: is no column"),
    (CSV.replace("force_lb", "force_N"), "row 1: mixes units: deflection_in with force_N"),
    (CSV.replace("remark", "deflection_m"), "row 1: mixes units: deflection_in and deflection_m"),
    (CSV.replace("remark", "v1_V"), "row 1: v1_V: duplicate column"),
    (re.sub(r"\n([^,]*),[^,]*,", r"\n\1,1e-320,", CSV, count=1), "smaller than any real one"),
    (CSV.replace("deflection_in", "deflection_deg"), "a column is read in deflection_m"),
    (CSV.replace(",", ";"), "columns are parted by commas"),
    (CSV.replace(",", "\t"), "columns are parted by commas"),
    (
        CSV.replace("force_lb", "Force_LB"),
        "row 1: Force_LB: is no column of readings; did you mean force_lb?",
    ),
    (CSV.replace("54.23", "5_4.23"), "row 3: v1_V: '5_4.23' is no number"),
    (CSV.replace("54.23", "٥٤.23"), "row 3: v1_V: '٥٤.23' is no number"),
    (
        CSV.replace("remark", "deflection_after_m"),
        "row 1: mixes units: deflection_in with deflection_after_m; give one unit",
    ),
    (CSV.replace("remark", "deflection_after_deg"), "a column is read in deflection_m"),
    (
        CSV.replace("remark", "approach").replace(",first try", ",").replace("12.0,", "12.0,side"),
        "row 8: approach: 'side' is neither out nor in",
    ),
    (CSV.replace("gradient_set", "remark").replace(",remark", ",x"), "row 1: x"),
    (CSV.replace("4.0,12.8", "4.0,12.8 lb"), "row 3: force_lb: '12.8 lb' is no number"),
    (
        CSV.replace("4.0,12.8", '4.0,"12,8"'),
        "row 3: force_lb: '12,8' is no number; write it with a",
    ),
    (CSV.replace("54.23", "nan"), "row 3: v1_V: 'nan' is no finite number"),
    (CSV.replace("54.23", "1e300"), "row 3: v1_V: '1e300' is larger than any real one"),
    (CSV.replace("54.23", "inf"), "row 3: v1_V"),
    (CSV.replace("54.23", "1e300"), "row 3: v1_V"),
    (CSV.replace("54.23", "9" * 5000), "row 3: v1_V"),
    (CSV.replace("54.23", ""), "row 3: v1_V: is empty"),
    (CSV.replace("4.0,12.8", "4.0,"), "row 3: force_lb: is empty"),
    (CSV.replace("soft,4.0,12.8,54.23,14.80,,first try", ",,,,,,"), "row 3: is empty"),
    (CSV.replace("soft,4.0,12.8,54.23,14.80,,first try", ""), "row 3: is empty"),
    (CSV.replace("soft,4.0,12.8", "soft,4.0"), "row 3: has 6 cells, the columns are 7"),
    (CSV.replace("soft,4.0", ",4.0"), "row 3: gradient_set: is empty"),
    (CSV + "soft,2.0,6.4,27.11,7.40,,\n", "row 10: is the same as row 2"),
    (CSV.replace("null,,,40.0", "null,,6.0,40.0"), "row 8: has a deflection or a force without"),
    (CSV.replace("12.5,12.0", "12.5,0"), "row 8: a null at 0 V does not determine S2"),
    (CSV.replace("first try", '"first try'), "row 9: is not CSV"),
    (CSV.replace("first try", "x" * 200_000), "is not CSV"),
    (CSV + CSV.splitlines()[1].replace("2.0", "{}"), "row 10"),
]


@pytest.mark.parametrize(("text", "says"), HOSTILE, ids=[str(i) for i in range(len(HOSTILE))])
def test_a_fault_is_one_line_with_its_row(tmp_path: Path, text: str, says: str) -> None:
    with pytest.raises(InputError) as caught:
        read_readings(csv_file(tmp_path, text), "column")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_readings(tmp_path / "none.csv", "column")
    (tmp_path / "b.csv").write_bytes(b"\xff\xfe\x01")
    with pytest.raises(InputError, match="UTF-8"):
        read_readings(tmp_path / "b.csv", "column")


def test_a_byte_order_mark_and_windows_lines_are_no_fault(tmp_path: Path) -> None:
    path = tmp_path / "w.csv"
    path.write_bytes(b"\xef\xbb\xbf" + CSV.replace("\n", "\r\n").encode() + b"\r\n\r\n")
    assert len(read_readings(path, "column").row) == 6
