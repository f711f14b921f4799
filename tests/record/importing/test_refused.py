"""Logs and maps that are wrong: one line each, and nothing written."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest
from scipy import io as scipy_io

from coupled.errors import InputError
from coupled.record.importing.heads import known_map
from tests.support.logs import (
    GOOD,
    LINES,
    MAP,
    edited,
    imported,
)


def damaged(kind: str, cut: Callable[[bytes], bytes]) -> bytes:
    frame, buffer = pl.read_csv(io.BytesIO(GOOD.encode())), io.BytesIO()
    if kind == "parquet":
        frame.write_parquet(buffer)
    else:
        vectors = {name: frame[name].to_numpy()[:, None] for name in frame.columns}
        scipy_io.savemat(buffer, vectors, do_compression=kind == "packed")
    return cut(buffer.getvalue())


JUNK = bytes(range(256)) * 40


LOGS: dict[str, tuple[str, str | bytes, str]] = {
    "empty": ("log.csv", b"", "is empty"),
    "junk": ("log.csv", JUNK, "not text in UTF-8"),
    "zeros": ("log.csv", bytes(999), "bytes that are no text"),
    "header only": ("log.csv", "T,F,D\n", "no row of numbers"),
    "one row": ("log.csv", "T,F,D\n0,1,2\n", "fewer than two rows"),
    "two names": (
        "log.csv",
        GOOD.replace("T,F,D", "T,F,F"),
        'F: two columns have this name; give from = "F#1" or "F#2"',
    ),
    "semicolons": ("log.csv", GOOD.replace(",", ";"), "another log.delimiter"),
    "words": ("log.csv", edited(7, "100.0,hello,1"), "F: row 8 holds 'hello'"),
    "inf": ("log.csv", edited(7, "100.0,inf,1"), "F: row 8 holds no finite number"),
    "huge": ("log.csv", edited(7, "100.0,1e300,1"), "F: row 8 holds 1e+300"),
    "no time": ("log.csv", edited(7, ",1,1"), "T: row 8 has no time"),
    "time twice": ("log.csv", edited(7, LINES[6]), "T: row 8 repeats the time"),
    "time back": ("log.csv", edited(7, "20,1,1"), "T: row 8: time goes back"),
    "time nan": ("log.csv", edited(7, "nan,1,1"), "T: row 8 has no time"),
    "a long gap": ("log.csv", "\n".join(LINES[:9] + LINES[20:]), "11 rows are missing"),
    "an open quote": ("log.csv", edited(7, '100,"1,1') + "\n" + "9" * 140_000, "row 8 has a quote"),
    "ragged": ("log.csv", edited(7, "100,1,1,1,1,1"), "row 8 has 6 cells, the first row 3"),
    "cut short": ("log.csv", GOOD[: len(GOOD) // 2] + "\n9999", "log.csv"),
    "no log": ("nolog.xyz", GOOD, "its format is not known"),
    "no mat": ("log.mat", JUNK, "is not a MATLAB file"),
    "empty mat": ("log.mat", b"", "is not a MATLAB file"),
    "text as mat": ("log.mat", GOOD, "is not a MATLAB file"),
    "v7.3": ("log.mat", b"MATLAB 7.3 MAT-file" + bytes(600), "is not an HDF5 or MATLAB v7.3"),
    "hdf5": ("log.mat", b"\x89HDF\r\n\x1a\n" + bytes(600), "is not an HDF5 or MATLAB v7.3"),
    "half a mat": ("log.mat", damaged("mat", lambda b: b[:4000]), "log.mat"),
    "half a packed mat": ("log.mat", damaged("packed", lambda b: b[:4000]), "log.mat"),
    "turned mat": ("log.mat", damaged("packed", lambda b: b[:300] + b[299::-1]), "log.mat"),
    "no parquet": ("log.parquet", JUNK, "is not a Parquet file"),
    "half a parquet": (
        "log.parquet",
        damaged("parquet", lambda b: b[:4000]),
        "is not a Parquet file",
    ),
    "bad parquet": (
        "log.parquet",
        damaged("parquet", lambda b: b[:60] + bytes(len(b) - 120) + b[-60:]),
        "log.parquet",
    ),
}


# Each is read in a process of its own, which takes a second.
SLOW = ("empty mat", "text as mat", "hdf5", "half a packed mat", "turned mat", "half a parquet")


@pytest.mark.parametrize(
    "case",
    [pytest.param(case, marks=pytest.mark.slow) if case in SLOW else case for case in LOGS],
)
def test_a_file_that_is_not_a_log_is_refused_in_one_line(tmp_path: Path, case: str) -> None:
    name, content, says = LOGS[case]
    with pytest.raises(InputError) as refusal:
        imported(tmp_path, content, name=name)
    assert says in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 500


def test_a_log_of_an_unknown_format_needs_another_format_not_a_map(tmp_path: Path) -> None:
    """The advice to give --map, or --suggest, ended in a second refusal."""
    (tmp_path / "log.xlsx").write_bytes(b"PK\x03\x04" + bytes(200))
    with pytest.raises(InputError, match="its format is not known; export it as one of"):
        known_map(tmp_path / "log.xlsx")


MAPS: dict[str, tuple[str, str, str]] = {
    "toml": ("[clock]", "[clock", "is not valid TOML"),
    "twice": ("column_computed_m", "column_force_N", "is not valid TOML"),
    "channel": ("column_computed_m", "column_computd_m", "did you mean column_computed_m"),
    "time": ("column_computed_m", "time_s", "the time is given by [clock]"),
    "unit": ('"lbf"', '"lbff"', "no known unit; did you mean lbf?"),
    "dimension": ('"lbf"', '"in"', "'in' is a length, column_force_N a force: N, daN"),
    "square": ('"lbf"', '"lbf^9"', "no known unit"),
    "long unit": ('"lbf"', '"' + "N/" * 5000 + '"', "no known unit"),
    "no unit": ('unit = "lbf"', "", "channels.column_force_N.unit: is missing"),
    "column": ('"F"', '"Force"', "log.csv has no 'Force'"),
    "no from": ('from = "F"', "", "channels.column_force_N.from: is missing"),
    "key": ("sign = -1", "sgin = -1", "did you mean sign?"),
    "sign": ("sign = -1", "sign = -2", "channels.column_force_N.sign"),
    "true sign": ("sign = -1", "sign = true", "sign: should be 1 or -1, is True"),
    "scale": ("sign = -1", "scale = 0", "must not be 0"),
    "nan": ("sign = -1", "scale = nan", "channels.column_force_N.scale"),
    "huge": ("sign = -1", "scale = 1e11", "larger than any real one"),
    "delay": ("sign = -1", "delay_s = -1", "channels.column_force_N.delay_s"),
    "clock unit": ('"ms"', '"N"', "clock.unit: 'N' is a force"),
    "day": ('"ms"', '"day"', "clock.unit: 'day' is no known unit; known: d, h, min, ms, ns, s, us"),
    "date twice": ('unit = "ms"', 'date = "%H:%M:%M"', "clock.date: '%H:%M:%M' has %M twice"),
    "clock column": ('"T"', '"TT"', "clock.from: log.csv has no 'TT'"),
    "two clocks": ('unit = "ms"', "rate_Hz = 60", "give either from"),
    "no clock": ('from = "T"', "", "give either from"),
    "cut": ('unit = "ms"', 'unit = "ms"\nstart_s = 5\nend_s = 4', "clock.end_s: must lie after"),
    "late": ('unit = "ms"', 'unit = "ms"\nstart_s = 500', "no rows between"),
    "invented": ('unit = "ms"', 'unit = "ms"\nframe_rate_Hz = 2000', "would be invented"),
    "table": ("[clock]", "log = 3\n[clock]", "log: should be a table"),
    "format": ("[clock]", 'log.format = "xls"\n[clock]', "log.format"),
    "commas": ("[clock]", 'log.decimal = ","\n[clock]', "is the decimal comma as well"),
    "delimiter": ("[clock]", 'log.delimiter = ";;"\n[clock]', "log.delimiter"),
    "odd delimiter": ("[clock]", 'log.delimiter = "→"\n[clock]', "delimiter"),
    "quote delimiter": ("[clock]", "log.delimiter = '\"'\n[clock]", "one plain character"),
    "encoding": ("[clock]", 'log.encoding = "utf-16"\n[clock]', "log"),
    "skip": ("[clock]", "log.skip_rows = 90000\n[clock]", "is empty"),
    "channels": ("[channels.column_force_N]", "[chanels.column_force_N]", "unknown key"),
}


@pytest.mark.parametrize("case", MAPS)
def test_an_invalid_map_is_refused_in_one_line(tmp_path: Path, case: str) -> None:
    old, new, says = MAPS[case]
    assert old in MAP
    with pytest.raises(InputError) as refusal:
        imported(tmp_path, log_map=MAP.replace(old, new, 1))
    assert says in str(refusal.value)
    assert len(str(refusal.value)) < 600
