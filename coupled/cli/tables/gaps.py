"""A diagnosis on a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from coupled.gap.batch import Row
from coupled.gap.flown import ChannelAgain
from coupled.gap.power import EffectPower
from coupled.gap.result import StageResult
from coupled.gap.summary import in_figures


def print_stages(console: Console, stages: Sequence[StageResult]) -> None:
    """Print the stages of a diagnosis: residual over floor, and what is left of it."""
    table = Table("stage", box=None)
    for head in ("residual over floor", "with the effects", ""):
        table.add_column(head, justify="right")
    for stage in stages:
        if stage.gap is None:
            lacks = "lacks " + ", ".join(stage.missing)
            table.add_row(stage.name, "not judged", "", stage.why or lacks)
            continue
        left = "" if stage.left is None else f"{stage.left:.2f}"
        within = "within its settings" if stage.within_settings else ""
        remark = "guilty" if stage.guilty else within
        table.add_row(stage.name, f"{stage.gap:.2f}", left, remark)
    console.print()
    console.print(table)


def print_closed_loop(console: Console, channels: Sequence[ChannelAgain]) -> None:
    """Print how far the flights with the record's pilot stay from it, before and after."""
    table = Table("flown again with the record's pilot, rms off by", box=None)
    for head in ("rig as filed", "improved"):
        table.add_column(head, justify="right")
    for one in channels:
        table.add_row(one.channel, f"{one.before:.3g}", f"{one.after:.3g}")
    console.print()
    console.print(table)


def print_power(console: Console, sizes: Sequence[EffectPower]) -> None:
    """Print the least size of each effect that the records would have shown."""
    table = Table("effect", "stage", "would have shown from", box=None)
    for one in sizes:
        if not one.judged:
            least = "its stage is not judged"
        elif not one.shows:
            least = "no size that it may have"
        else:
            each = (f"{name} {in_figures(name, value)}" for name, value in one.parameters)
            least = ", ".join(each) or "it would show"
        table.add_row(one.name, one.stage, least)
    console.print()
    console.print(table)


def print_summary(console: Console, rows: Sequence[Row]) -> None:
    """Print a line a record: verdict, effects, stages."""
    table = Table("record", "verdict", "effects", "guilty", "closed", box=None)
    for row in rows:
        closed = "" if row.closed is None else f"{row.closed:.3f}"
        verdict = row.verdict + (f": {row.why}" if row.why else "")
        table.add_row(row.record, verdict, ", ".join(row.effects), ", ".join(row.guilty), closed)
    console.print(table)
