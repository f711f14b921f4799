"""A user's own log made a record: units, clocks, gaps, verdicts, and everything that is refused."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import io as scipy_io

from coupled.cli import app
from coupled.errors import InputError
from coupled.logs import plausible
from coupled.logs.importing import import_log
from coupled.logs.mapping import CHANNELS, factor_of, own_unit
from coupled.record import read_record
from coupled.resources import shipped_rigs
from coupled.rig.rigfile import read_rig
from coupled.units import parse_unit, unit_names, units_like

ROWS = 600
RNG = np.random.default_rng(3)
TIME_s = np.arange(ROWS) / 60.0
DEFLECTION_m = 0.03 * np.sin(TIME_s) + 2e-5 * RNG.standard_normal(ROWS)
GRADIENT = 560.0
FORCE_N = GRADIENT * 0.03 * np.sin(TIME_s) + 0.1 * RNG.standard_normal(ROWS)

MAP = """
[clock]
from = "T"
unit = "ms"

[channels.column_force_N]
from = "F"
unit = "lbf"
sign = -1

[channels.column_computed_m]
from = "D"
unit = "in"
"""


def text(time_ms: Any = None, force: Any = None, deflection: Any = None, form: str = ".12g") -> str:
    columns = (
        1000.0 * TIME_s if time_ms is None else time_ms,
        -FORCE_N / 4.4482216152605 if force is None else force,
        DEFLECTION_m / 0.0254 if deflection is None else deflection,
    )
    rows = [",".join(format(x, form) for x in row) for row in zip(*columns, strict=True)]
    return "T,F,D\n" + "\n".join(rows) + "\n"


GOOD = text()


def imported(folder: Path, log: str | bytes = GOOD, log_map: str = MAP, name: str = "log.csv"):
    (folder / name).write_bytes(log.encode() if isinstance(log, str) else log)
    (folder / "map.toml").write_text(log_map, encoding="utf-8")
    return import_log(folder / name, folder / "map.toml")


# Units


@given(st.sampled_from(CHANNELS), st.data())
def test_a_unit_and_back_is_the_same_number(channel: str, data: st.DataObject) -> None:
    own = parse_unit(own_unit(channel))
    assert own is not None
    name = data.draw(st.sampled_from(units_like(own)))
    value = data.draw(st.floats(-1e6, 1e6, allow_subnormal=False))
    factor = factor_of(channel, name, "map.toml")
    unit = parse_unit(name)
    assert unit is not None
    assert value * factor * own.factor / unit.factor == pytest.approx(value, rel=1e-12)


@given(st.sampled_from(CHANNELS), st.sampled_from(unit_names()))
def test_a_unit_of_another_dimension_is_refused(channel: str, name: str) -> None:
    own, unit = parse_unit(own_unit(channel)), parse_unit(name)
    assert own is not None and unit is not None
    if unit.dimension == own.dimension or (channel == "load_factor" and name in ("1", "%")):
        assert factor_of(channel, name, "m") > 0.0
    else:
        with pytest.raises(InputError, match=own_unit(channel).replace("^", r"\^")):
            factor_of(channel, name, "m")


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        *[("lbf", 4.4482216152605), ("kgf", 9.80665), ("daN", 10.0), ("in", 0.0254)],
        *[("lbf/in", 175.126835246), ("psf", 47.88025898), ("psi", 6894.757293), ("hPa", 100.0)],
        *[("kt", 0.514444444), ("km/h", 0.2777777778), ("ft/s", 0.3048), ("fpm", 0.00508)],
        *[("deg", 0.01745329252), ("[°/s]", 0.01745329252), ("m/s²", 1.0), ("m/s/s", 1.0)],
        *[("lbf/ft^2", 47.88025898), ("N/mm", 1000.0), ("lbf / deg", 254.8643249), ("%", 0.01)],
    ],
)
def test_units_have_the_factors_of_the_books(name: str, factor: float) -> None:
    unit = parse_unit(name)
    assert unit is not None
    assert unit.factor == pytest.approx(factor, rel=1e-9)


# What a map makes of a log


def test_units_signs_and_clock_give_the_record_back(tmp_path: Path) -> None:
    record, account = imported(tmp_path)
    assert record.channels == ("time_s", "column_force_N", "column_computed_m")
    assert account["clock"]["method"] == "rows as they are"
    assert account["clock"]["frame_rate_Hz"] == 60.0
    np.testing.assert_array_equal(record.time_s, np.arange(ROWS) / 60.0)
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-10)
    np.testing.assert_allclose(record["column_computed_m"], DEFLECTION_m, rtol=1e-10)
    assert [c["doubts"] for c in account["channels"].values()] == [[], []]
    assert account["channels"]["column_force_N"]["noise"] == pytest.approx(0.1, rel=0.15)


def test_scale_and_offset_are_in_the_logs_unit(tmp_path: Path) -> None:
    scaled = MAP.replace('unit = "in"', 'unit = "in"\nscale = 2.0\noffset = -0.5')
    record, _ = imported(tmp_path, log_map=scaled)
    expected = 2.0 * DEFLECTION_m - 0.5 * 0.0254
    np.testing.assert_allclose(record["column_computed_m"], expected, atol=1e-12)


def test_every_format_gives_the_same_record(tmp_path: Path) -> None:
    first, _ = imported(tmp_path)
    frame = pl.read_csv(io.BytesIO(GOOD.encode()))
    frame.write_parquet(tmp_path / "log.parquet")
    vectors = {name: frame[name].to_numpy()[:, None] for name in frame.columns}
    scipy_io.savemat(tmp_path / "flat.mat", vectors)
    scipy_io.savemat(tmp_path / "old.mat", vectors, format="4")
    scipy_io.savemat(tmp_path / "packed.mat", vectors, do_compression=True)
    scipy_io.savemat(tmp_path / "struct.mat", {"LOG": {"in": vectors}, "f": np.array([[{}]])})
    names = np.array(frame.columns, dtype=object)
    table = {"data": frame.to_numpy(), "signals": names}
    scipy_io.savemat(tmp_path / "matrix.mat", table)
    struct = MAP.replace('from = "', 'from = "LOG.in.')
    matrix = '[log]\nmatrix = "data"\n' + MAP
    listed = '[log]\nmatrix = "data"\nnames = ["T", "F", "D"]\n' + MAP
    german = '[log]\ndelimiter = ";"\ndecimal = ","\n' + MAP
    semicolon = "\ufeff" + GOOD.replace(",", ";").replace(".", ",").replace("\n", "\r\n")
    (tmp_path / "german.csv").write_text(semicolon, encoding="utf-8")
    (tmp_path / "tab.tsv").write_text(GOOD.replace(",", "\t"))
    (tmp_path / "space.txt").write_text(GOOD.replace(",", "   "))
    head = "made by a rig\n# a remark\n T , F , D \nms,lbf,[in]\n"
    (tmp_path / "units.csv").write_text(head + GOOD.partition("\n")[2].replace("\n", "\n# x\n", 1))
    units = '[log]\nskip_rows = 1\ncomment = "#"\nunits_row = true\n' + MAP.replace(
        'unit = "in"', ""
    )
    (tmp_path / "bare.csv").write_text(GOOD.partition("\n")[2])
    bare = "[log]\nheader = false\n" + MAP
    for name, number in (("T", "1"), ("F", "2"), ("D", "3")):
        bare = bare.replace(f'"{name}"', f'"{number}"')
    cases = {
        **{"log.parquet": MAP, "flat.mat": MAP, "old.mat": MAP, "packed.mat": MAP},
        **{"struct.mat": struct, "matrix.mat": matrix, "german.csv": german},
        **{"tab.tsv": MAP, "space.txt": '[log]\ndelimiter = " "\n' + MAP},
        **{"units.csv": units, "bare.csv": bare},
    }
    for file, log_map in [*cases.items(), ("matrix.mat", listed)]:
        (tmp_path / "map.toml").write_text(log_map)
        record, _ = import_log(tmp_path / file, tmp_path / "map.toml")
        np.testing.assert_array_equal(record.data, first.data, err_msg=file)


# Clocks


def test_rounded_stamps_leave_every_row_as_it_is(tmp_path: Path) -> None:
    stamps = np.rint(1000.0 * TIME_s)  # 0, 17, 33, 50 ms
    record, account = imported(tmp_path, text(time_ms=stamps))
    assert account["clock"]["method"] == "rows as they are"
    assert account["clock"]["frame_rate_Hz"] == 60.0
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-10)


def test_a_jittering_clock_is_interpolated_to_where_the_signal_was(tmp_path: Path) -> None:
    time = TIME_s + np.random.default_rng(5).uniform(-4e-3, 4e-3, ROWS)
    log = text(1000.0 * time, -np.sin(time), np.sin(time))
    wished = MAP.replace('unit = "ms"', 'unit = "ms"\nframe_rate_Hz = 50')
    record, account = imported(tmp_path, log, wished)
    assert account["clock"]["method"] == "pchip"
    expected = 4.4482216152605 * np.sin(time[0] + record.time_s)
    assert np.max(np.abs(record["column_force_N"] - expected)) < 1e-3  # h²: flat at the crests
    with pytest.raises(InputError, match=r"unevenly.*frame_rate_Hz = 60"):
        imported(tmp_path, log)


def test_a_step_is_not_overshot(tmp_path: Path) -> None:
    force = np.where(TIME_s > 5.0, -10.0, 0.0)
    wished = MAP.replace('unit = "ms"', 'unit = "ms"\nframe_rate_Hz = 100')
    record, account = imported(tmp_path, text(force=force), wished)
    pounds = record["column_force_N"] / 4.4482216152605
    assert pounds.min() == 0.0
    assert pounds.max() <= 10.0 + 1e-12
    assert "no longer white" in account["warnings"][0]


def test_a_delay_is_taken_off_and_a_cut_starts_on_a_row(tmp_path: Path) -> None:
    late = MAP.replace("sign = -1", "sign = -1\ndelay_s = 0.1")
    late = late.replace('unit = "ms"', 'unit = "ms"\nstart_s = 1.99\nend_s = 7.0')
    log = text(force=-np.sin(TIME_s - 0.1) / 4.4482216152605, deflection=np.sin(TIME_s) / 0.0254)
    record, account = imported(tmp_path, log, late)
    assert account["clock"]["start_s"] == pytest.approx(2.0)
    assert record.time_s[-1] == pytest.approx(5.0)
    np.testing.assert_allclose(record["column_force_N"], np.sin(2.0 + record.time_s), atol=1e-6)
    np.testing.assert_allclose(record["column_computed_m"], np.sin(2.0 + record.time_s), atol=1e-9)


def test_a_clock_since_1970_keeps_its_digits(tmp_path: Path) -> None:
    ns = 1_750_000_000_000_000_000 + np.rint(1e9 * TIME_s).astype(np.int64)
    columns = {"T": ns, "F": -FORCE_N, "D": DEFLECTION_m}
    frame = pl.DataFrame(columns)
    frame.write_parquet(tmp_path / "ns.parquet")
    frame.with_columns(pl.col("T").cast(pl.Datetime("ns"))).write_parquet(tmp_path / "at.parquet")
    for file in ("ns.parquet", "at.parquet"):
        (tmp_path / "map.toml").write_text(MAP.replace('"ms"', '"ns"'))
        record, account = import_log(tmp_path / file, tmp_path / "map.toml")
        assert account["clock"]["frame_rate_Hz"] == 60.0
        assert len(record) == ROWS


def test_missing_rows_and_empty_cells_are_led_over_and_counted(tmp_path: Path) -> None:
    lines = GOOD.splitlines()
    del lines[100]
    lines[200] = lines[200].rpartition(",")[0] + ","
    record, account = imported(tmp_path, "\n".join(lines))
    assert len(record) == ROWS
    assert account["clock"]["missing_rows"] == 1
    assert account["warnings"] == ["1 missing rows were led over"]
    assert account["channels"]["column_computed_m"]["filled_cells"] == 1
    assert account["channels"]["column_force_N"]["filled_cells"] == 0
    there = np.arange(ROWS) != 99
    np.testing.assert_allclose(record["column_force_N"][there], FORCE_N[there], rtol=1e-10)
    strict = MAP.replace('unit = "in"', 'unit = "in"\nlongest_gap_rows = 0')
    with pytest.raises(InputError, match="row 201: 1 empty cells"):
        imported(tmp_path, "\n".join(lines), strict)
    strict = MAP.replace('unit = "ms"', 'unit = "ms"\nlongest_gap_rows = 0')
    with pytest.raises(InputError, match=r"row 101: 1 rows are missing after 1.63"):
        imported(tmp_path, "\n".join(lines), strict)


def test_a_heading_is_led_through_north(tmp_path: Path) -> None:
    heading = np.mod(350.0 + 5.0 * TIME_s, 360.0)
    log_map = MAP.replace("column_computed_m", "heading_rad").replace('"in"', '"deg"')
    log_map = log_map.replace('unit = "ms"', 'unit = "ms"\nframe_rate_Hz = 50')
    record, _ = imported(tmp_path, text(deflection=heading), log_map)
    turned = np.rad2deg(np.unwrap(record["heading_rad"]))
    np.testing.assert_allclose(turned, 350.0 + 5.0 * record.time_s, atol=1e-9)


# Verdicts


def doubts(folder: Path, log: str = GOOD, log_map: str = MAP) -> dict[str, list[str]]:
    _, account = imported(folder, log, log_map)
    return {name: found["doubts"] for name, found in account["channels"].items()}


def test_doubts_name_what_is_wrong(tmp_path: Path) -> None:
    inches = DEFLECTION_m / 0.0254
    assert doubts(tmp_path, text(deflection=np.full(ROWS, 0.5)))["column_computed_m"] == [
        "constant"
    ]
    wrong = MAP.replace("sign = -1\n", "")
    assert doubts(tmp_path, log_map=wrong)["column_force_N"] == [
        "moves against the deflection: sign?"
    ]
    bad = inches.copy()
    bad[77] += 1.0
    assert doubts(tmp_path, text(deflection=bad))["column_computed_m"] == ["1 spike"]
    clipped = np.minimum(inches, 1.0)
    assert doubts(tmp_path, text(deflection=clipped))["column_computed_m"] == ["clipped at 0.0254"]
    coarse = np.rint(inches / 0.05) * 0.05
    assert doubts(tmp_path, text(deflection=coarse))["column_computed_m"] == [
        "quantised, step 0.00127"
    ]
    metres = MAP.replace('unit = "in"', 'unit = "m"')
    big = doubts(tmp_path, text(deflection=1000 * inches), metres)
    assert big["column_computed_m"] == ["looks like mm, cm or in"]
    two = MAP + '[channels.column_deflection_m]\nfrom = "D"\nunit = "in"\n'
    assert doubts(tmp_path, log_map=two)["column_deflection_m"] == ["copy of column_computed_m"]
    angle = MAP.replace("column_computed_m", "pitch_rad").replace('"in"', '"rad"')
    assert doubts(tmp_path, text(deflection=5 * inches), angle)["pitch_rad"] == [
        "looks like degrees"
    ]
    less_one = MAP.replace("column_computed_m", "load_factor").replace('"in"', '"g"')
    assert doubts(tmp_path, text(deflection=0.1 * inches), less_one)["load_factor"] == [
        "is 0 in level flight: offset 1?"
    ]


def test_a_force_in_pounds_is_seen_against_the_rig(tmp_path: Path) -> None:
    rig = read_rig(shipped_rigs()["report-column"])
    rate = rig.frame_rate
    pressure = rig.controls["column"].schedule.dynamic_pressure[0]
    gradient = rig.controls["column"].schedule.total_gradient[0]
    log = "T,F,D,q\n" + "\n".join(
        f"{1000 * k / rate},{gradient * x / 4.448},{x},{pressure}"
        for k, x in enumerate(0.05 * np.sin(np.arange(900) / rate))
    )
    log_map = MAP.replace("sign = -1", "").replace('"lbf"', '"N"').replace('"in"', '"m"')
    log_map += '[channels.dynamic_pressure_Pa]\nfrom = "q"\nunit = "Pa"\n'
    imported(tmp_path, log, log_map)
    _, account = import_log(tmp_path / "log.csv", tmp_path / "map.toml", rig)
    assert account["channels"]["column_force_N"]["doubts"] == ["looks like pounds"]
    assert account["channels"]["dynamic_pressure_Pa"]["doubts"] == ["constant"]
    (tmp_path / "map.toml").write_text(log_map.replace("ms", 'ms"\nframe_rate_Hz = 77\n#"'))
    with pytest.raises(InputError, match="frame_rate_Hz: is 77, the rig's"):
        import_log(tmp_path / "log.csv", tmp_path / "map.toml", rig)
    (tmp_path / "map.toml").write_text(log_map.replace('unit = "m"', 'unit = "m"\nscale = 100'))
    with pytest.raises(InputError, match="is its unit right"):
        import_log(tmp_path / "log.csv", tmp_path / "map.toml", rig)


def test_figures_on_white_noise_raise_no_doubt() -> None:
    noise = np.random.default_rng(8).standard_normal(20_000)
    assert plausible.noise_level(noise) == pytest.approx(1.0, rel=0.03)
    assert plausible.noise_level(noise + np.arange(20_000) ** 3) == pytest.approx(1.0, rel=0.03)
    assert plausible.clipped_at(noise) is None
    assert plausible.quantised_step(noise) is None
    assert plausible.quantised_step(np.round(noise, 2)) is None
    assert plausible.spikes(noise) == []
    assert (
        plausible.pressure_doubt(noise * 0 + 10195.0, noise * 0 + 149.7, noise * 0 + 3000) is None
    )
    assert (
        plausible.pressure_doubt(noise * 0 + 213.0, noise * 0 + 149.7, noise * 0 + 3000)
        == "looks like psf"
    )


# What is refused: one line, nothing written


def damaged(kind: str, cut: Callable[[bytes], bytes]) -> bytes:
    frame, buffer = pl.read_csv(io.BytesIO(GOOD.encode())), io.BytesIO()
    if kind == "parquet":
        frame.write_parquet(buffer)
    else:
        vectors = {name: frame[name].to_numpy()[:, None] for name in frame.columns}
        scipy_io.savemat(buffer, vectors, do_compression=kind == "packed")
    return cut(buffer.getvalue())


JUNK = bytes(range(256)) * 40
LINES = GOOD.splitlines()


def edited(row: int, line: str) -> str:
    return "\n".join([*LINES[:row], line, *LINES[row + 1 :]])


LOGS: dict[str, tuple[str, str | bytes, str]] = {
    "empty": ("log.csv", b"", "is empty"),
    "junk": ("log.csv", JUNK, "not text in UTF-8"),
    "zeros": ("log.csv", bytes(999), "bytes that are no text"),
    "header only": ("log.csv", "T,F,D\n", "no row of numbers"),
    "one row": ("log.csv", "T,F,D\n0,1,2\n", "fewer than two rows"),
    "two names": ("log.csv", GOOD.replace("T,F,D", "T,F,F"), "F: stands there twice"),
    "semicolons": ("log.csv", GOOD.replace(",", ";"), "another log.delimiter"),
    "words": ("log.csv", edited(7, "100.0,hello,1"), "F: row 8 holds 'hello'"),
    "inf": ("log.csv", edited(7, "100.0,inf,1"), "F: row 8 holds no finite number"),
    "huge": ("log.csv", edited(7, "100.0,1e300,1"), "F: row 8 holds 1e+300"),
    "no time": ("log.csv", edited(7, ",1,1"), "T: row 8 has no time"),
    "time twice": ("log.csv", edited(7, LINES[6]), "T: row 8 repeats the time"),
    "time back": ("log.csv", edited(7, "20,1,1"), "T: row 8: time goes back"),
    "time nan": ("log.csv", edited(7, "nan,1,1"), "T: row 8 has no time"),
    "a long gap": ("log.csv", "\n".join(LINES[:9] + LINES[20:]), "11 rows are missing"),
    "ragged": ("log.csv", edited(7, "100,1,1,1,1,1"), "is not a table"),
    "cut short": ("log.csv", GOOD[: len(GOOD) // 2] + "\n9999", "log.csv"),
    "no log": ("nolog.xyz", GOOD, "its format is not known"),
    "no mat": ("log.mat", JUNK, "is not a MATLAB file"),
    "empty mat": ("log.mat", b"", "is not a MATLAB file"),
    "text as mat": ("log.mat", GOOD, "is not a MATLAB file"),
    "v7.3": ("log.mat", b"MATLAB 7.3 MAT-file" + bytes(600), "save it with -v7"),
    "hdf5": ("log.mat", b"\x89HDF\r\n\x1a\n" + bytes(600), "save it with -v7"),
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


@pytest.mark.parametrize("case", LOGS)
def test_a_log_that_is_none_is_one_line(tmp_path: Path, case: str) -> None:
    name, content, says = LOGS[case]
    with pytest.raises(InputError) as refusal:
        imported(tmp_path, content, name=name)
    assert says in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 500


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
    "scale": ("sign = -1", "scale = 0", "must not be 0"),
    "nan": ("sign = -1", "scale = nan", "channels.column_force_N.scale"),
    "huge": ("sign = -1", "scale = 1e11", "larger than any real one"),
    "delay": ("sign = -1", "delay_s = -1", "channels.column_force_N.delay_s"),
    "clock unit": ('"ms"', '"N"', "clock.unit: 'N' is a force"),
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
def test_a_map_that_is_wrong_is_one_line(tmp_path: Path, case: str) -> None:
    old, new, says = MAPS[case]
    assert old in MAP
    with pytest.raises(InputError) as refusal:
        imported(tmp_path, log_map=MAP.replace(old, new, 1))
    assert says in str(refusal.value)
    assert len(str(refusal.value)) < 600


def test_an_even_log_without_stamps(tmp_path: Path) -> None:
    rate = MAP.replace('from = "T"\nunit = "ms"', "rate_Hz = 60")
    record, account = imported(tmp_path, log_map=rate)
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-10)
    assert account["unmapped"] == ["T"]


# The command


def coupled(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "coupled", *words],
        check=False,
        cwd=folder,
        env={**os.environ, "COLUMNS": "80", "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )


def test_the_command_writes_a_record_and_says_what_it_thinks(tmp_path: Path) -> None:
    imported(tmp_path)
    done = coupled(tmp_path, "import", "log.csv", "--map", "map.toml", "-o", "a/r.csv")
    assert done.returncode == 0, done.stderr
    assert max(len(line) for line in done.stdout.splitlines()) <= 80
    assert "even, taken as they are" in done.stdout
    np.testing.assert_allclose(read_record(tmp_path / "a/r.csv")["column_force_N"], FORCE_N)
    manifest = json.loads((tmp_path / "a/r.manifest.json").read_text())
    assert set(manifest["inputs_sha256"]) == {"log.csv", "map.toml"}
    assert manifest["map"]["channels"]["column_force_N"]["sign"] == -1
    assert manifest["import"]["clock"]["frames"] == ROWS
    (tmp_path / "log.csv").write_text(edited(7, "20,1,1"))
    bad = coupled(tmp_path, "import", "log.csv", "--map", "map.toml", "-o", "b.csv")
    assert (bad.returncode, bad.stdout, bad.stderr.count("\n")) == (2, "", 1)
    assert bad.stderr.startswith("error: log.csv: T: row 8: time goes back")
    assert not (tmp_path / "b.csv").exists()


@pytest.mark.parametrize(
    "words",
    [
        ["log.csv", "--map", "map.toml", "-o", "log.csv"],
        ["log.csv", "--map", "map.toml", "-o", "link.csv"],
        ["log.csv", "--map", "map.toml", "-o", "r.xls"],
        ["log.csv", "--map", "map.toml", "-o", "log.csv/r.csv"],
        ["log.csv", "--map", "map.toml", "--json", "map.toml"],
        ["log.csv", "--map", "map.toml", "-o", "r.csv", "--json", "r.manifest.json"],
        ["log.csv", "--map", "map.toml", "--rig", "nothing"],
        ["log.csv", "--map", "none.toml"],
        ["log.csv", "--map", "log.csv"],
        ["none.csv", "--map", "map.toml"],
        [".", "--map", "map.toml"],
        ["folder.csv", "--map", "map.toml"],
        ["a" * 5000 + ".csv", "--map", "map.toml"],
        ["/dev/zero", "--map", "dev.toml"],
    ],
    ids=lambda words: " ".join(words)[:40],
)
def test_words_that_lead_nowhere_write_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: list[str]
) -> None:
    imported(tmp_path)
    (tmp_path / "dev.toml").write_text('log.format = "csv"\n' + MAP)
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "link.csv").symlink_to(tmp_path / "log.csv")
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError):
        app(["import", *words], standalone_mode=False)
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")} == before


def test_the_map_of_the_manual_reads_the_log_that_it_describes(tmp_path: Path) -> None:
    manual = (Path(__file__).parents[2] / "docs" / "files.md").read_text(encoding="utf-8")
    log_map = manual.partition("## Map of a log")[2].partition("```toml\n")[2].partition("```")[0]
    time = np.arange(1200) / 120.0
    late = np.sin(time - 0.004)
    lines = ["# test 7", "TIME;FORCE_LB;COL_IN;GRIP;QBAR;NOTE", "ms;lbf;in;;psf;"]
    for k, t in enumerate(time):
        counts = 2048 + 409.6 * np.sin(t)
        pressure = "" if k % 10 and k != len(time) - 1 else "20.9"
        row = f"{1000 * t:.3f};{-late[k]:.9f};{np.sin(t):.9f};{counts:.6f};{pressure};ok"
        lines.append(row.replace(".", ","))
    record, account = imported(tmp_path, "\r\n".join(lines), log_map)
    signal = np.sin(record.time_s)
    np.testing.assert_allclose(record["column_force_N"], 4.4482216152605 * signal, atol=2e-4)
    np.testing.assert_allclose(record["column_computed_m"], 0.0254 * signal, atol=1e-9)
    np.testing.assert_allclose(record["column_deflection_m"], 0.0254 * signal, atol=1e-8)
    np.testing.assert_allclose(record["dynamic_pressure_Pa"], 20.9 * 47.88025898)
    assert account["unmapped"] == ["NOTE"]
    assert account["channels"]["dynamic_pressure_Pa"]["filled_cells"] > 1000
