"""Several logs with stamps of their own, lists in a cell, dates, and signs kept in a bit."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coupled.errors import InputError
from coupled.record.importing.cells import signed
from coupled.record.importing.convert import import_log
from coupled.record.importing.mapping import Channel
from coupled.record.record import Record
from tests.support.commands import coupled
from tests.support.logs import FORCE_N, GOOD, MAP, DEFLECTION_m, TIME_s, imported
from tests.support.readhere import in_process

ROWS = 300
TWO = """
[clock]
from = "stamp"
unit = "us"

[channels.column_force_N]
from = "pull"
unit = "N"

[channels.column_computed_m]
log = "state.csv"
from = "positions"
element = 2
unit = "mm"
"""


def two_logs(folder: Path, late_us: float = 0.0, begins: int = 0) -> list[Path]:
    """Write a force at 60 Hz and a position at 97 Hz, both of one clock since 1970."""
    epoch = 1_767_225_600_000_000
    force = [f"{epoch + round(1e6 * t)},{40 * np.sin(2 * t):.6f}" for t in np.arange(ROWS) / 60.0]
    times = np.arange(begins, 500) / 97.0
    state = [
        f'{epoch + round(1e6 * t + late_us)},"[0.5, {30 * np.sin(2 * t):.6f}, 7]"' for t in times
    ]
    files = [folder / "force.csv", folder / "state.csv"]
    files[0].write_text("stamp,pull\n" + "\n".join(force))
    files[1].write_text("stamp,positions\n" + "\n".join(state))
    (folder / "map.toml").write_text(TWO)
    return files


def test_a_second_logs_channel_stands_where_its_own_stamps_say(tmp_path: Path) -> None:
    record, account = import_log(two_logs(tmp_path, late_us=0.0), tmp_path / "map.toml")
    assert account.clock.frame_rate_Hz == 60.0
    expected = 0.03 * np.sin(2 * record.time_s)
    # PCHIP through 97 rows a second of a sine of 2 rad/s: h²/8 times its curvature at most.
    bound = (1 / 97.0) ** 2 / 8 * 4 * 0.03 + 1e-8
    assert np.max(np.abs(record["column_computed_m"] - expected)) < bound
    assert record.manifest["imported_from"] == ["force.csv", "state.csv"]
    assert set(record.manifest["inputs_sha256"]) == {"force.csv", "state.csv", "map.toml"}


def test_a_later_clock_is_seen_to_the_microsecond(tmp_path: Path) -> None:
    record, _ = import_log(two_logs(tmp_path, late_us=40_000.0), tmp_path / "map.toml")
    expected = 0.03 * np.sin(2 * (record.time_s + record_start(record) - 0.04))
    assert np.max(np.abs(record["column_computed_m"] - expected)) < 3e-6


def record_start(record: Record) -> float:
    return float(record.manifest["import"]["clock"]["start_s"])


def test_the_record_lasts_as_long_as_all_logs_do(tmp_path: Path) -> None:
    _, account = import_log(two_logs(tmp_path, begins=97), tmp_path / "map.toml")
    assert account.clock.start_s == pytest.approx(1.0, abs=1e-9)  # the state's first row
    last_s = account.clock.start_s + (account.clock.frames - 1) / 60.0
    assert last_s == pytest.approx((ROWS - 1) / 60.0, abs=1e-9)


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (('log = "state.csv"', 'log = "states.csv"'), r"map.toml: channels.column_computed_m.log"),
        (("element = 2", "element = 4"), r"state.csv: positions: row 2 holds 3 numbers"),
        (("element = 2", "element = 0"), r"map.toml: channels.column_computed_m.element"),
        (('from = "stamp"\nunit = "us"', "rate_Hz = 60"), r"map.toml: clock.from"),
        (("[clock]", '[clocks."x.csv"]\nfrom = "t"\n[clock]'), r"map.toml: clocks.x.csv: no log"),
    ],
)
def test_a_fault_of_the_map_is_named(tmp_path: Path, edit: tuple[str, str], said: str) -> None:
    files = two_logs(tmp_path)
    (tmp_path / "map.toml").write_text(TWO.replace(*edit))
    with pytest.raises(InputError, match=said):
        import_log(files, tmp_path / "map.toml")


def test_logs_that_do_not_meet_are_refused(tmp_path: Path) -> None:
    files = two_logs(tmp_path, late_us=1e9)
    with pytest.raises(InputError, match=r"state.csv: stamp: begins .* after force.csv ends"):
        import_log(files, tmp_path / "map.toml")


@pytest.mark.parametrize("late_s", [1000.0, -1_767_225_600.0])
def test_the_difference_of_two_clocks_is_added(tmp_path: Path, late_s: float) -> None:
    files = two_logs(tmp_path, late_us=1e6 * late_s)
    with pytest.raises(InputError, match=r'clocks\."state\.csv"\.shift_s adds'):
        import_log(files, tmp_path / "map.toml")
    state = '[clocks."state.csv"]\nfrom = "stamp"\nunit = "us"'
    (tmp_path / "map.toml").write_text(f"{state}\nshift_s = {-late_s}\n{TWO}")
    record, _ = import_log(files, tmp_path / "map.toml")
    expected = 0.03 * np.sin(2 * (record.time_s + record_start(record)))
    assert np.max(np.abs(record["column_computed_m"] - expected)) < 3e-6


def test_a_further_logs_clock_may_be_another(tmp_path: Path) -> None:
    files = two_logs(tmp_path)
    state = files[1].read_text().splitlines()
    rows = [row.partition(",") for row in state[1:]]
    files[1].write_text("ms,positions\n" + "\n".join(f"{int(a) / 1e3},{c}" for a, _, c in rows))
    other = '[clocks."state.csv"]\nfrom = "ms"\nunit = "ms"\n'
    (tmp_path / "map.toml").write_text(other + TWO)
    record, _ = import_log(files, tmp_path / "map.toml")
    assert np.max(np.abs(record["column_computed_m"] - 0.03 * np.sin(2 * record.time_s))) < 5e-6


def test_the_unit_of_a_further_logs_times_is_doubted_until_it_is_stated(tmp_path: Path) -> None:
    """Stamps in ms, read as s, were two rows within the record, and a line between them."""
    files = two_logs(tmp_path)
    lines = files[0].read_text().splitlines()[1:]
    seconds = [f"{k / 60.0},{line.partition(',')[2]}" for k, line in enumerate(lines)]
    files[0].write_text("stamp,pull\n" + "\n".join(seconds))
    rows = [f'{1e3 * k / 97.0},"[0, {30 * np.sin(2 * k / 97.0):.6f}]"' for k in range(500)]
    files[1].write_text("stamp,positions\n" + "\n".join(rows))
    in_s = TWO.replace('"us"', '"s"')
    (tmp_path / "map.toml").write_text(in_s)
    with pytest.raises(InputError, match=r"state.csv: stamp: its rows come at 0\.097 Hz.*unit"):
        import_log(files, tmp_path / "map.toml")
    clock = '\n[clocks."state.csv"]\nfrom = "stamp"\nunit = '
    (tmp_path / "map.toml").write_text(f'{in_s}{clock}"s"\n')
    with pytest.raises(InputError, match="has fewer than two numbers in this span"):
        import_log(files, tmp_path / "map.toml")
    (tmp_path / "map.toml").write_text(f'{in_s}{clock}"ms"\n')
    record, _ = import_log(files, tmp_path / "map.toml")
    assert np.max(np.abs(record["column_computed_m"] - 0.03 * np.sin(2 * record.time_s))) < 5e-6


@pytest.mark.parametrize(
    ("date", "form"),
    [
        ("iso", "%Y-%m-%d %H:%M:%S.%f"),
        ("iso", "%Y-%m-%dT%H:%M:%S.%fZ"),
        ("iso", "%H:%M:%S.%f"),
        ("%d.%m.%Y %H:%M:%S,%f", "%d.%m.%Y %H:%M:%S,%f"),
        ("%H-%M-%S.%f", "%H-%M-%S.%f"),
        ("%I:%M:%S.%f", "%I:%M:%S.%f"),
        ("%I:%M:%S.%f %p", "%I:%M:%S.%f %p"),
        ("%M:%S.%f", "%M:%S.%f"),
    ],
)
def test_dates_and_times_of_day_run_on_past_midnight(tmp_path: Path, date: str, form: str) -> None:
    start = datetime(2026, 2, 28, 23, 59, 57)
    stamps = [(start + timedelta(seconds=float(t))).strftime(form) for t in TIME_s]
    rows = [
        f'"{s}",{-f / 4.4482216152605:.12g},{d / 0.0254:.12g}'
        for s, f, d in zip(stamps, FORCE_N, DEFLECTION_m, strict=True)
    ]
    log_map = MAP.replace('unit = "ms"', f'date = "{date}"')
    record, _ = imported(tmp_path, "T,F,D\n" + "\n".join(rows), log_map)
    np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-10)
    np.testing.assert_array_equal(record.time_s, TIME_s)


def test_times_of_day_of_a_table_run_on_past_midnight(tmp_path: Path) -> None:
    start = datetime(2026, 2, 28, 23, 59, 57)
    stamps = [(start + timedelta(seconds=float(t))).time() for t in TIME_s]
    table = {"T": stamps, "F": -FORCE_N / 4.4482216152605, "D": DEFLECTION_m / 0.0254}
    pl.DataFrame(table).write_parquet(tmp_path / "log.parquet")
    (tmp_path / "map.toml").write_text(MAP.replace('unit = "ms"\n', "", 1))
    with in_process():
        record, _ = import_log(tmp_path / "log.parquet", tmp_path / "map.toml")
    np.testing.assert_array_equal(record.time_s, TIME_s)


def test_a_cell_that_is_no_date_is_named_by_its_row(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"log.csv: T: row 2: '0' is no date of the pattern"):
        imported(tmp_path, GOOD, MAP.replace('unit = "ms"', 'date = "iso"'))


@given(st.lists(st.integers(-1023, 1023), min_size=1, max_size=20))
def test_a_sign_bit_and_a_wrap_give_the_number_back(numbers: list[int]) -> None:
    exact = np.array(numbers, dtype=np.float64)
    bit = Channel(source="x", sign_bit=10)
    raw = np.where(exact < 0, 1024 - exact, exact)
    np.testing.assert_array_equal(signed(raw, bit, "log", lambda row: row), exact)
    wrapped = Channel(source="x", wraps_at=2048.0, unwrap=False)
    np.testing.assert_array_equal(signed(exact % 2048, wrapped, "log", lambda row: row), exact)


def test_what_no_such_count_can_be_is_refused_by_its_row() -> None:
    channel = Channel(source="load", sign_bit=10)
    with pytest.raises(InputError, match=r"log: load: row 1 is 2048, not 0 to 2047"):
        signed(np.array([1.0, 2048.0]), channel, "log", lambda row: row)


def test_a_load_without_its_sign_is_doubted(tmp_path: Path) -> None:
    rows = [f"{1e3 * t},{abs(f)},{d / 0.0254}" for t, f, d in zip(*COLUMNS, strict=True)]
    log_map = MAP.replace('unit = "lbf"\nsign = -1', 'unit = "N"')
    _, account = imported(tmp_path, "T,F,D\n" + "\n".join(map(str, rows)), log_map)
    assert any("never negative" in d for d in account.channels["column_force_N"].doubts)
    _, account = imported(tmp_path)
    assert account.channels["column_force_N"].doubts == ()


COLUMNS = (TIME_s, FORCE_N, DEFLECTION_m)


def test_the_command_takes_several_logs(tmp_path: Path) -> None:
    two_logs(tmp_path)
    done = coupled(tmp_path, "import", "force.csv", "state.csv", "--map", "map.toml", "-o", "r.csv")
    assert done.returncode == 0, done.stderr
    assert "column_computed_m" in done.stdout
    again = coupled(tmp_path, "import", "force.csv", "force.csv", "--map", "map.toml")
    assert again.returncode == 2
    assert "has the name of another log" in again.stderr
