"""Tables at 80 columns: fewer columns before a list, and all of them with --wide."""

from __future__ import annotations

from io import StringIO

import pytest

from coupled.cli.tables import print_table
from coupled.cli.terminal import WIDEST, SafeConsole
from coupled.gap.nominal import ChannelFit
from coupled.tables.gaps import channels_table
from coupled.tables.table import Table

TABLE = Table(
    ("number", "filed", "found", "95 % interval", "prob."),
    (("loader.damping_N_s_per_m", *("1234.5678",) * 4),),
    spare=("95 % interval", "prob."),
)


def printed(width: int, wide: bool = False) -> str:
    console = SafeConsole(file=StringIO(), width=width)
    with console.widened(wide):
        print_table(console, TABLE, edge=True)
    assert console.width == width
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


@pytest.mark.parametrize(
    ("width", "left_out"),
    [(100, []), (68, ["prob."]), (58, ["95 % interval", "prob."])],
)
def test_spare_columns_go_before_a_table_becomes_a_list(width: int, left_out: list[str]) -> None:
    text = printed(width)
    head, row, *rest = [line.strip() for line in text.splitlines()]
    for name in ("filed", "found", "95 % interval", "prob."):
        assert (name in head) == (name not in left_out)
    assert row.startswith("loader.damping_N_s_per_m")
    assert rest == ([f"--wide shows also: {', '.join(left_out)}"] if left_out else [])


def test_without_spare_columns_to_leave_out_it_is_a_list() -> None:
    text = printed(30)
    assert "filed: 1234.5678" in text
    assert "prob.: 1234.5678" in text


def test_wide_shows_every_column() -> None:
    text = printed(40, wide=True)
    assert text.splitlines()[0].split() == [
        "number",
        "filed",
        "found",
        "95",
        "%",
        "interval",
        "prob.",
    ]
    assert WIDEST > 200


def test_the_channels_of_a_fit_stay_a_table_at_80_columns() -> None:
    console = SafeConsole(file=StringIO(), width=80)
    channels = [
        ChannelFit(
            "a.csv", "a_channel_with_a_rather_long_name_rad_per_s", 1.23e-5, 1.23e-6, 1e-7, 1e-3
        )
    ]
    print_table(console, channels_table(channels), edge=True)
    assert isinstance(console.file, StringIO)
    text = console.file.getvalue()
    assert "--wide shows also: channel's rms" in text
    assert "1.23e-05" in text
    assert "as filed: " not in text
