"""A map proposed for a log with defects: the import reports them, and no column is lost."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

from coupled.errors import InputError
from coupled.record.importing.account import ImportAccount
from coupled.record.importing.convert import import_log
from coupled.record.importing.suggest.dialect import guess_layout
from coupled.record.importing.suggest.propose import propose
from coupled.record.record import Record
from tests.support.logs import FORCE_N, MAP, imported

ROWS = 360
FORCE = "column_force_N"
TIME_s = np.round(np.arange(ROWS) / 120.0, 6)


def table(folder: Path, stamps: Any, name: str = "Time", **others: Any) -> Path:
    """Write a log of 120 Hz, and return its file."""
    path = folder / "log.csv"
    pl.DataFrame({name: stamps, FORCE: FORCE_N[: len(stamps)], **others}).write_csv(path)
    return path


def suggested(path: Path) -> dict[str, Any]:
    """Write the map proposed for a log, without questions, and return it."""
    proposal = propose([path])
    assert proposal.questions == ()
    path.with_name("map.toml").write_text(proposal.text, encoding="utf-8")
    return tomllib.loads(proposal.text)


def imported_as_suggested(path: Path) -> tuple[Record, ImportAccount]:
    suggested(path)
    return import_log(path, path.with_name("map.toml"))


SECOND = {"Time": {"from": "Time", "unit": "s"}, "Time [s]": {"from": "Time [s]", "unit": "s"}}
MIXED = np.concatenate((TIME_s[:200], TIME_s[230:260], TIME_s[200:230], TIME_s[260:]))


@pytest.mark.parametrize("name", SECOND)
@pytest.mark.parametrize(
    ("stamps", "fault"),
    [
        (np.concatenate((TIME_s[:180], TIME_s[:180])), "time goes back"),  # two runs
        (MIXED, "time goes back.*sort = true"),
        (TIME_s[::-1], "time goes back"),
        (np.append(TIME_s, TIME_s.mean()), "row 362.*time goes back.*drop_rows"),
        (np.delete(TIME_s, slice(100, 112)), "12 rows are missing"),
        (np.floor(TIME_s), "stamps are coarse"),
        (np.repeat(TIME_s[:180], 2), "repeats the time"),
    ],
)
def test_a_time_with_defects_is_the_clock_without_a_rate(
    tmp_path: Path, name: str, stamps: np.ndarray, fault: str
) -> None:
    log = table(tmp_path, stamps, name)
    assert suggested(log)["clock"] == SECOND[name]
    with pytest.raises(InputError, match=fault):
        import_log(log, tmp_path / "map.toml")


def test_rows_that_are_written_twice_are_dropped_as_duplicates(tmp_path: Path) -> None:
    path = table(tmp_path, TIME_s)
    pl.read_csv(path).select(pl.all().repeat_by(2).explode()).write_csv(path)
    with pytest.raises(InputError, match=r"clock.drop_duplicates = true"):
        imported_as_suggested(path)


@pytest.mark.parametrize(
    ("pattern", "stamp"),
    [
        ("%d.%m.%Y %H:%M:%S.%f", lambda t: f"25.10.2026 02:59:{50 + t:09.6f}"),
        ("%d.%m.%Y %H:%M:%S.%f", lambda t: f"05.06.2026 02:59:{50 + t:010.7f}"),
        (
            "%d.%m.%y %H:%M:%S,%f",
            lambda t: f"25.10.26 02:59:{int(50 + t)},{t % 1:.6f}".replace(",0.", ","),
        ),
        ("%m/%d/%Y %I:%M:%S.%f %p", lambda t: f"10/25/2026 02:59:{50 + t:09.6f} AM"),
        ("%d/%m/%Y, %H:%M:%S.%f", lambda t: f"25/10/2026, 2:59:{50 + t:09.6f}"),
        ("%d-%b-%Y %H:%M:%S.%f", lambda t: f"25-Oct-2026 02:59:{50 + t:09.6f}"),
        ("%Y/%m/%d %H:%M:%S.%f", lambda t: f"2026/10/25 02:59:{50 + t:09.6f}"),
        ("%M:%S.%f", lambda t: f"59:{50 + t:09.6f}"),
        ("iso", lambda t: f"02:59:{50 + t:09.6f}"),
    ],
)
@pytest.mark.parametrize("name", ["Time", "x"])
def test_dates_are_the_clock_in_their_own_pattern(
    tmp_path: Path, name: str, pattern: str, stamp: Callable[[float], str]
) -> None:
    cells = [stamp(t) for t in TIME_s]
    log = table(tmp_path, cells, name)
    assert suggested(log)["clock"] == {"from": name, "date": pattern}
    record, account = import_log(log, tmp_path / "map.toml")
    assert account.clock.frame_rate_Hz == 120.0
    np.testing.assert_array_equal(record[FORCE], FORCE_N[:ROWS])


@pytest.mark.parametrize(
    ("later", "fault"),
    [("02:00", "time goes back by an hour, as"), ("04:00", "time goes on by an hour, as")],
)
def test_a_clock_change_is_reported(tmp_path: Path, later: str, fault: str) -> None:
    cells = [f"25.10.2026 02:59:{57 + t:09.6f}" for t in TIME_s]
    cells += [f"25.10.2026 {later}:{t:09.6f}" for t in TIME_s[:200]]
    log = table(tmp_path, cells)
    assert suggested(log)["clock"] == {"from": "Time", "date": "%d.%m.%Y %H:%M:%S.%f"}
    with pytest.raises(InputError, match=fault):
        import_log(log, tmp_path / "map.toml")


def test_the_order_of_day_and_month_is_that_of_the_shorter_log(tmp_path: Path) -> None:
    """11 October follows 10 October, and not 10 November."""
    cells = [f"10/10/2026 23:59:{58 + t:09.6f}" for t in TIME_s[:240]]
    cells += [f"11/10/2026 00:00:{t:09.6f}" for t in TIME_s[:120]]
    _, account = imported_as_suggested(table(tmp_path, cells))
    assert (account.clock.frames, account.clock.frame_rate_Hz) == (ROWS, 120.0)


def test_the_serial_days_of_a_spreadsheet_are_the_clock(tmp_path: Path) -> None:
    path = table(tmp_path, np.round(45992.6341203704 + TIME_s / 86400.0, 10), "Date")
    record, account = imported_as_suggested(path)
    assert account.clock.log_rate_Hz == pytest.approx(120.0, rel=1e-3)
    assert len(record) == ROWS


def test_dates_in_an_unknown_pattern_are_asked(tmp_path: Path) -> None:
    log = table(tmp_path, [f"25 Okt, 2h59m{50 + t:09.6f}" for t in TIME_s])
    proposal = propose([log])
    assert tomllib.loads(proposal.text)["clock"] == {"from": "Time", "date": "?"}
    assert [question.partition(":")[0] for question in proposal.questions] == ["clock.date"]


def test_a_second_time_is_listed_and_the_better_one_used(tmp_path: Path) -> None:
    log = table(tmp_path, np.floor(TIME_s), "UTC [s]", **{"Elapsed [s]": TIME_s})
    assert suggested(log)["clock"]["from"] == "Elapsed [s]"
    assert propose([log]).unmapped == ("UTC [s]",)


def test_a_temperature_named_t_is_not_the_time(tmp_path: Path) -> None:
    noise = np.random.default_rng(2).standard_normal(ROWS)
    proposal = propose([table(tmp_path, 20.0 + noise, "T [degC]")])
    assert tomllib.loads(proposal.text)["clock"] == {"rate_Hz": "?"}
    assert proposal.unmapped == ("T [degC]",)


def test_stamps_rounded_to_ms_keep_their_rate(tmp_path: Path) -> None:
    lost = np.delete(np.round(TIME_s, 3), [100, 101])
    assert suggested(table(tmp_path, lost))["clock"].get("frame_rate_Hz", 120.0) == 120.0


@pytest.mark.parametrize("dates", [False, True])
def test_rows_of_means_below_the_log_are_dropped(tmp_path: Path, dates: bool) -> None:
    cells = [f"2026-10-25 02:59:{t:09.6f}" if dates else str(t) for t in TIME_s]
    log = table(tmp_path, cells)
    log.write_text(log.read_text() + "Mean,1e4\n,2e4\n")
    assert suggested(log)["clock"]["drop_rows"] == ["362-363"]
    record, _ = import_log(log, tmp_path / "map.toml")
    np.testing.assert_array_equal(record[FORCE], FORCE_N[:ROWS])


@pytest.mark.parametrize("mark", [-9999.0, 9999.0])
def test_a_number_far_outside_the_others_is_an_empty_cell(tmp_path: Path, mark: float) -> None:
    force = FORCE_N[:ROWS].copy()
    force[[100, 200, 201]] = mark
    log = tmp_path / "log.csv"
    pl.DataFrame({"Time": TIME_s, FORCE: force}).write_csv(log)
    assert suggested(log)["log"] == {"missing": [str(mark)]}
    record, account = import_log(log, tmp_path / "map.toml")
    assert account.channels[FORCE].filled_cells == 3
    assert np.abs(record[FORCE]).max() < 100.0
    second = tmp_path / "wheel.csv"
    pl.DataFrame({"Time": TIME_s[:90], "wheel_force_N": FORCE_N[:90]}).write_csv(second)
    assert tomllib.loads(propose([log, second]).text)["log"] == {"missing": [str(mark)]}
    others = {"n": np.where(force == mark, mark, 2.0 * mark)}  # where it is one of the numbers
    pl.DataFrame({"Time": TIME_s, FORCE: force, **others}).write_csv(log)
    assert "log" not in suggested(log)


def spreadsheet(decimals: int) -> str:
    rows = [
        ",".join(f'"{value:.{decimals}f}"'.replace(".", ",") for value in row)
        for row in zip(1000.0 * TIME_s, 100.0 * FORCE_N, FORCE_N, strict=False)
    ]
    return "\n".join(['"T","F","D"', *rows])


def test_quoted_decimal_commas_between_commas_are_read(tmp_path: Path) -> None:
    whole_map = '[log]\ndecimal = ","\n' + MAP
    record, _ = imported(tmp_path, spreadsheet(6), whole_map)
    assert record[FORCE][9] == pytest.approx(-4.4482216152605 * 100.0 * FORCE_N[9], abs=1e-5)
    (tmp_path / "log.csv").write_text(spreadsheet(6).replace('"F"', f'"{FORCE}"'))
    assert suggested(tmp_path / "log.csv")["log"] == {"decimal": ","}
    with pytest.raises(InputError, match=r"log.delimiter is the decimal comma as well"):
        imported(tmp_path, spreadsheet(6).replace('"', ""), whole_map)


def test_commas_between_thousands_are_not_taken_for_decimal_ones(tmp_path: Path) -> None:
    rows = [f'{k},"{k % 9 + 1},{k:03d}","{k % 7 + 1},500"' for k in range(99)]
    (tmp_path / "log.csv").write_text("\n".join(["t_ms,column_force_N,x", *rows]))
    assert guess_layout(tmp_path / "log.csv").decimal == "."


@pytest.mark.parametrize("codec", ["utf-16", "utf-16-le", "utf-16-be"])
def test_utf_16_is_read_without_a_byte_order_mark(tmp_path: Path, codec: str) -> None:
    log = table(tmp_path, TIME_s)
    log.write_bytes(log.read_text().encode(codec))
    record, _ = imported_as_suggested(log)
    np.testing.assert_array_equal(record[FORCE], FORCE_N[:ROWS])
    plain = (tmp_path / "map.toml").read_text().replace("utf-16", "utf-8")
    with pytest.raises(InputError, match="utf-16"):
        imported(tmp_path, log.read_bytes(), plain)


def test_each_open_question_of_a_map_is_one_line(tmp_path: Path) -> None:
    open_map = MAP.replace('"T"', '"?"').replace('"lbf"', '"?"').replace("-1", '"?"')
    with pytest.raises(InputError) as raised:
        imported(tmp_path, log_map=open_map)
    lines = [str(fault) for fault in raised.value.every]
    keys = ("clock.from", f"channels.{FORCE}.unit", f"channels.{FORCE}.sign")
    assert len(lines) == len(keys)
    for key, line in zip(keys, lines, strict=True):
        assert f'map.toml: {key}: "?" is a question' in line


def test_a_date_in_the_first_line_is_no_header(tmp_path: Path) -> None:
    log = table(tmp_path, [f"25.10.2026 02:59:{t:09.6f}" for t in TIME_s])
    log.write_text(log.read_text().partition("\n")[2])
    assert not guess_layout(log).header


def test_dates_of_a_parquet_file_need_no_pattern(tmp_path: Path) -> None:
    stamps = pl.Series(1e6 * TIME_s).cast(pl.Int64).cast(pl.Datetime("us"))
    pl.DataFrame({"x": stamps, FORCE: FORCE_N[:ROWS]}).write_parquet(tmp_path / "log.parquet")
    assert suggested(tmp_path / "log.parquet")["clock"] == {"from": "x"}
    record, _ = import_log(tmp_path / "log.parquet", tmp_path / "map.toml")
    np.testing.assert_array_equal(record[FORCE], FORCE_N[:ROWS])


@pytest.mark.parametrize("decimal", [".", ","])
def test_a_mathematical_minus_is_read(tmp_path: Path, decimal: str) -> None:
    pull = FORCE_N[: TIME_s.size]
    rows = [f"{t:.6f};{f:.6f};{1e-3 * f:.6E}" for t, f in zip(TIME_s, pull, strict=True)]
    body = "\n".join(rows).replace("-", "\u2212").replace(".", decimal)
    head = "time [s];column force [N];column encoder [m]\n"
    (tmp_path / "log.csv").write_text(f"{head}{body}\n", encoding="utf-8")
    record, _ = imported_as_suggested(tmp_path / "log.csv")
    np.testing.assert_allclose(record["column_force_N"], pull, atol=1e-6)
    np.testing.assert_allclose(record["column_computed_m"], 1e-3 * pull, rtol=1e-6)
