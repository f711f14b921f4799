"""A diagnosis on a terminal of 80 columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from coupled.cli.tables.whole import print_whole
from coupled.display import System, in_system
from coupled.gap.batch import Row
from coupled.gap.findings.budget import StageBudget, share_of
from coupled.gap.findings.flown import ChannelAgain
from coupled.gap.findings.inflight import EffectInFlight
from coupled.gap.findings.power import EffectPower
from coupled.gap.findings.result import EffectResult, ParameterEstimate, StageResult
from coupled.gap.findings.summary import (
    change,
    figure,
    in_units,
    labels,
    named_in,
    plain,
    sentences,
    size_in,
    summary_in,
)

if TYPE_CHECKING:
    from coupled.gap.findings.diagnosis import Diagnosis


def print_stages(console: Console, stages: Sequence[StageResult]) -> None:
    """Print the stages of a diagnosis: residual over the noise floor, before and after."""
    table = Table("stage", box=None)
    for head in ("residual over floor", "with the effects"):
        table.add_column(head, justify="right")
    table.add_column("")  # remarks, of several lines where channels lack
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
    print_whole(console, table)


def print_effects(
    console: Console,
    effects: Sequence[EffectResult],
    budget: Sequence[StageBudget],
    system: System = "si",
) -> None:
    """Print each effect's numbers, as filed and as found, and its share of its stage's residual."""
    if not effects:
        return
    table = Table("effect", "filed → found", box=None)
    for head in ("95 % interval", "share", "prob."):
        table.add_column(head, justify="right")
    for effect in effects:
        explains = share_of(budget, effect.stage, effect.name)
        first, *rest = [in_units(p, system) for p in effect.parameters] or (None,)
        sure = f"{effect.probability:.2f}"
        said, *others = labels(effect) or [""]
        table.add_row(f"{plain(effect.name)} {said}".rstrip(), *_number(first), explains, sure)
        for label, parameter in zip(others, rest, strict=True):
            table.add_row(f"  {label}".rstrip(), *_number(parameter), "", "")
    for one in budget:
        for left in (one.unexplained, one.noise):
            table.add_row(f"{one.stage}: {left.name}", "", "", f"{100 * left.value:.1f} %", "")
    console.print()
    print_whole(console, table, ("95 % interval", "prob."))


def _number(parameter: ParameterEstimate | None) -> tuple[str, str]:
    """Return a parameter's change and interval, in the rig's unit."""
    if parameter is None:
        return "", ""
    return change(parameter), parameter.interval(figure)


def in_words(whole: Diagnosis, system: System) -> str:
    """Return a diagnosis's summary; values for a rig file are in the file's unit.

    For two or more effects it is a list of sentences.
    """
    text = summary_in(whole.summary, whole.effects, system)
    if len(whole.effects) < 2:
        return text
    return "\n".join(f"- {sentence}" for sentence in sentences(text))


def print_closed_loop(
    console: Console, channels: Sequence[ChannelAgain], system: System = "si"
) -> None:
    """Print the error of flights with the record's pilot, before and after."""
    table = Table("flown again with the record's pilot, rms off by", box=None)
    for head in ("rig as filed", "improved"):
        table.add_column(head, justify="right")
    for one in channels:
        name, unit = named_in(one.channel, system)
        factor = in_system(unit, system).factor
        table.add_row(name, f"{factor * one.before:.3g}", f"{factor * one.after:.3g}")
    console.print()
    print_whole(console, table)


def print_in_flight(
    console: Console, effects: Sequence[EffectInFlight], system: System = "si"
) -> None:
    """Print the change of the flight without each effect, and its share of the total."""
    table = Table("in flight", box=None)
    table.add_column("share", justify="right")
    table.add_column("channel")
    for head in ("changes by", "of its motion"):
        table.add_column(head, justify="right")
    for one in effects:
        for i, (name, by) in enumerate(one.changes.items()):
            first = ("", "") if i else (plain(one.name), f"{100 * one.share:.0f} %")
            word, unit = named_in(name, system)
            changed = in_system(unit, system).factor * by
            table.add_row(*first, word, f"{changed:.3g}", f"{100 * one.of_motion[name]:.3g} %")
    console.print()
    print_whole(console, table, ("changes by", "of its motion"))


def print_power(console: Console, sizes: Sequence[EffectPower], system: System = "si") -> None:
    """Print the smallest detectable size of each effect."""
    table = Table("effect", "stage", "would have shown from", box=None)
    for one in sizes:
        if not one.judged:
            least = "its stage is not judged"
        elif not one.shows:
            least = "no size that it may have"
        else:
            each = (size_in(name, value, system) for name, value in one.parameters)
            least = ", ".join(each) or "it would show"
        table.add_row(one.name, one.stage, least)
    console.print()
    print_whole(console, table, ("stage",))


def print_summary(console: Console, rows: Sequence[Row]) -> None:
    """Print a line for each record: verdict, effects, stages."""
    table = Table("record", "verdict", "effects", "guilty", "closed", box=None)
    for row in rows:
        closed = "" if row.closed is None else f"{row.closed:.3f}"
        verdict = row.verdict + (f": {row.why}" if row.why else "")
        table.add_row(row.record, verdict, ", ".join(row.effects), ", ".join(row.guilty), closed)
    print_whole(console, table, ("guilty", "closed"))
