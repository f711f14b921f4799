"""A fitted nominal rig on a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from coupled.cli.tables.whole import print_whole
from coupled.gap.findings.summary import figure
from coupled.gap.nominalfit import ChannelFit, NominalFit


def print_numbers(console: Console, fitted: NominalFit) -> None:
    """Print each fitted number: as filed, as found, and its 95 % interval."""
    table = Table("number", box=None)
    for head in ("filed", "found", "95 % interval"):
        table.add_column(head, justify="right")
    for one in fitted.numbers:
        ends = "not determined"
        if one.interval is not None:
            ends = " to ".join(figure(end) for end in one.interval)
        table.add_row(one.key, figure(one.filed), figure(one.found), ends)
    print_whole(console, table, ("filed",))


def print_channels(console: Console, channels: Sequence[ChannelFit]) -> None:
    """Print the RMS error of each channel's prediction on held-out data."""
    table = Table("channel, rms off on stretches held out", box=None)
    for head in ("as filed", "fitted", "noise alone", "it moves by"):
        table.add_column(head, justify="right")
    for one in channels:
        numbers = (one.before, one.after, one.floor, one.moves)
        table.add_row(one.channel, *(f"{number:.3g}" for number in numbers))
    console.print()
    print_whole(console, table, ("noise alone", "it moves by"))
