"""Which rows of a log are used: stale stamps, late rows, duplicates, counters that wrap."""

from __future__ import annotations

from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from coupled.errors import InputError
from tests.support.logs import FORCE_N, LINES, MAP, ROWS, DEFLECTION_m, TIME_s, edited, imported


def clocked(*keys: str) -> str:
    """Return the map with further keys of its clock."""
    return MAP.replace("[clock]", "\n".join(["[clock]", *keys]))


def rows(folder: Path, log: str, *keys: str) -> np.ndarray:
    record, _ = imported(folder, log, clocked(*keys))
    return np.asarray(record["column_force_N"])


def test_a_stale_first_stamp_is_named_as_one(tmp_path: Path) -> None:
    for stamp in ("99999", "-99999"):
        log = edited(1, f"{stamp},{LINES[1].partition(',')[2]}")
        with pytest.raises(InputError, match=r"row 2: the first stamp .*drop_rows = \[2\]"):
            imported(tmp_path, log)
        np.testing.assert_allclose(rows(tmp_path, log, "drop_rows = [2]"), FORCE_N[1:], rtol=1e-9)


@pytest.mark.parametrize(("first", "last"), [(301, 600), (301, 320)])
def test_rows_of_a_clock_set_back_are_named_by_a_range_that_leaves_them_out(
    tmp_path: Path, first: int, last: int
) -> None:
    back = [
        f"{float(time) - 20_000.0:.6f},{rest}" if first <= row <= last else f"{time},{rest}"
        for row, (time, _, rest) in enumerate(line.partition(",") for line in LINES)
        if row
    ]
    log = "\n".join([LINES[0], *back])
    span = f'["{first + 1}-{last + 1}"]'
    with pytest.raises(InputError) as refused:
        imported(tmp_path, log)
    assert f"row {first + 1}: time goes back" in str(refused.value)
    assert f"drop_rows = {span}" in str(refused.value)
    assert ("sort = true" in str(refused.value)) == (last < 600)
    if last == 600:
        found = rows(tmp_path, log, f"drop_rows = {span}")
        np.testing.assert_allclose(found, FORCE_N[: first - 1], rtol=1e-9)


def test_rows_that_came_late_are_put_back(tmp_path: Path) -> None:
    late = [*LINES[:50], *LINES[51:55], LINES[50], *LINES[55:]]
    with pytest.raises(InputError, match=r"row 55: time goes back .* sort = true"):
        imported(tmp_path, "\n".join(late))
    np.testing.assert_allclose(rows(tmp_path, "\n".join(late), "sort = true"), FORCE_N, rtol=1e-9)
    turned = "\n".join([LINES[0], *reversed(LINES[1:])])  # the newest row first
    np.testing.assert_allclose(rows(tmp_path, turned, "sort = true"), FORCE_N, rtol=1e-9)
    _, account = imported(tmp_path, "\n".join(late), clocked("sort = true"))
    assert account.warnings == ("5 of 600 rows moved, by clock.sort",)


def test_only_rows_that_repeat_all_that_is_read_are_duplicates(tmp_path: Path) -> None:
    double = "\n".join([*LINES[:80], LINES[79], *LINES[80:]])
    np.testing.assert_allclose(rows(tmp_path, double, "drop_duplicates = true"), FORCE_N, rtol=1e-9)
    other = "\n".join([*LINES[:80], LINES[79] + "1", *LINES[80:]])
    with pytest.raises(InputError, match=r"the two rows differ: clock.drop_rows = \[81\]"):
        imported(tmp_path, other, clocked("drop_duplicates = true"))
    np.testing.assert_allclose(rows(tmp_path, other, "drop_rows = [81]"), FORCE_N, rtol=1e-9)
    coarse = "\n".join([LINES[0], *(f"{i // 9},1,{i}" for i in range(90))])
    with pytest.raises(InputError, match=r"stamps are coarse: .* clock.rate_Hz"):
        imported(tmp_path, coarse)


@pytest.mark.parametrize("whole", [True, False])
def test_a_counter_that_wraps_is_followed(tmp_path: Path, whole: bool) -> None:
    step = 17 if whole else 16.5
    count = (65_000 + step * np.arange(ROWS)) % 65_536
    table = zip(count, FORCE_N / -4.4482216152605, DEFLECTION_m / 0.0254, strict=True)
    lines = [f"{int(t) if whole else t},{f:.12g},{d:.12g}" for t, f, d in table]
    log = "\n".join(["T,F,D", *lines])
    np.testing.assert_allclose(rows(tmp_path, log, "wraps_at = 65536"), FORCE_N, rtol=1e-9)
    with pytest.raises(InputError, match=r"clock.wraps_at: is 300, and T spans"):
        imported(tmp_path, log, clocked("wraps_at = 300"))


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("drop_rows = [1]", r"1 is no row of log.csv; its rows are 2 to 601"),
        ('drop_rows = ["9-3"]', "'9-3' is no row"),
        ('drop_rows = ["2-601"]', "no rows left"),
        ("drop_rows = [true]", "clock.drop_rows: should be a list of rows"),
        ("drop_rows = 3", "clock.drop_rows: should be a list of rows"),
        ('date = "iso"\nwraps_at = 9', "clock.wraps_at: is for a counter"),
    ],
)
def test_a_wrong_row_is_one_line(tmp_path: Path, key: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        imported(tmp_path, log_map=clocked(key))


def test_a_log_without_a_clock_has_rows_to_drop_and_none_to_sort(tmp_path: Path) -> None:
    even = MAP.replace('from = "T"\nunit = "ms"', "rate_Hz = 60\ndrop_rows = [601]")
    record, _ = imported(tmp_path, log_map=even)
    assert len(record) == ROWS - 1
    with pytest.raises(InputError, match=r"clock.sort: needs a column of times"):
        imported(tmp_path, log_map=even.replace("drop_rows = [601]", "sort = true"))


def test_a_row_without_a_time_can_be_left_out(tmp_path: Path) -> None:
    log = edited(7, ",1,1")
    with pytest.raises(InputError, match=r"row 8 has no time; clock.drop_rows = \[8\]"):
        imported(tmp_path, log)
    there = TIME_s != TIME_s[6]
    found = rows(tmp_path, log, "drop_rows = [8]")
    np.testing.assert_allclose(found[there], FORCE_N[there], rtol=1e-9)


@pytest.mark.parametrize(
    ("set_h", "zone", "what"),
    [(-1, "", "goes back"), (1, "", "goes on"), (0, "+02:00", "")],
)
def test_local_time_that_is_set_by_an_hour_is_named_as_daylight_saving(
    tmp_path: Path, set_h: int, zone: str, what: str
) -> None:
    """Before, the message named another run or clock, and proposed to omit rows."""
    start = datetime.fromisoformat("2025-10-26T02:59:55")
    stamps = [
        start + timedelta(hours=set_h * (row >= 300), seconds=row / 60) for row in range(ROWS)
    ]
    cells = zip(stamps, LINES[1:], strict=True)
    log = [f"{stamp.isoformat()}{zone},{rest.partition(',')[2]}" for stamp, rest in cells]
    if zone:  # of the winter's time, for the same instants
        log[300:] = [line.replace("T03", "T02").replace(zone, "+01:00") for line in log[300:]]
    text, dates = "\n".join(["T,F,D", *log]), MAP.replace('unit = "ms"', 'date = "iso"', 1)
    if not what:
        record, _ = imported(tmp_path, text, dates)
        np.testing.assert_allclose(record["column_force_N"], FORCE_N, rtol=1e-9)
        return
    with pytest.raises(InputError, match=f"row 302: time {what} by an hour.*daylight saving"):
        imported(tmp_path, text, dates)
    even = MAP.replace('from = "T"\nunit = "ms"', "rate_Hz = 60")  # the remedy
    np.testing.assert_allclose(imported(tmp_path, text, even)[0]["column_force_N"], FORCE_N, 1e-9)
