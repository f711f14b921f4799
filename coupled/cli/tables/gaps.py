"""A diagnosis on a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table

from coupled.gap.batch import Row
from coupled.gap.budget import StageBudget
from coupled.gap.flown import ChannelAgain
from coupled.gap.inflight import EffectInFlight
from coupled.gap.power import EffectPower
from coupled.gap.result import EffectResult, ParameterEstimate, StageResult
from coupled.gap.summary import change, figure, in_figures, plain


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


def print_effects(
    console: Console, effects: Sequence[EffectResult], budget: Sequence[StageBudget]
) -> None:
    """Print each effect's numbers, as filed and as found, and its share of its stage's residual."""
    if not effects:
        return
    table = Table("effect", "filed → found", box=None)
    for head in ("95 % interval", "share", "prob."):
        table.add_column(head, justify="right")
    known = {one.stage: one for one in budget}
    for effect in effects:
        shares = known[effect.stage].shares if effect.stage in known else ()
        share = next((one for one in shares if one.name == effect.name), None)
        explains = "" if share is None else f"{100 * share.value:.1f} %"
        first, *rest = effect.parameters or (None,)
        sure = f"{effect.probability:.2f}"
        table.add_row(plain(effect.name), *_number(first), explains, sure)
        for parameter in rest:
            table.add_row("", *_number(parameter), "", "")
    for one in budget:
        for left in (one.unexplained, one.noise):
            table.add_row(f"{one.stage}: {left.name}", "", "", f"{100 * left.value:.1f} %", "")
    console.print()
    console.print(table)


def _number(parameter: ParameterEstimate | None) -> tuple[str, str]:
    """Return a parameter's change and interval, in the rig's own number."""
    if parameter is None:
        return "", ""
    low, high = parameter.found_low, parameter.found_high
    ends = "" if low is None or high is None else f"{figure(low)} to {figure(high)}"
    return change(parameter), ends


def print_closed_loop(console: Console, channels: Sequence[ChannelAgain]) -> None:
    """Print how far the flights with the record's pilot stay from it, before and after."""
    table = Table("flown again with the record's pilot, rms off by", box=None)
    for head in ("rig as filed", "improved"):
        table.add_column(head, justify="right")
    for one in channels:
        table.add_row(one.channel, f"{one.before:.3g}", f"{one.after:.3g}")
    console.print()
    console.print(table)


def print_in_flight(console: Console, effects: Sequence[EffectInFlight]) -> None:
    """Print what leaving each effect out does to the flight, and its share of what all do."""
    table = Table("in flight", box=None)
    table.add_column("share", justify="right")
    table.add_column("channel")
    for head in ("changes by", "of its motion"):
        table.add_column(head, justify="right")
    for one in effects:
        for i, (name, by) in enumerate(one.changes.items()):
            first = ("", "") if i else (plain(one.name), f"{100 * one.share:.0f} %")
            table.add_row(*first, name, f"{by:.3g}", f"{100 * one.of_motion[name]:.3g} %")
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
