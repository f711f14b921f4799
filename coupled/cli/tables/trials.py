"""The score of blind trials on a terminal of 80 columns."""

from __future__ import annotations

from typing import Any

from rich.console import Console
from rich.table import Table

# Group and key of the score, and what the line says.
_LINES = (
    ("clear_singles", "named", "one effect, residual doubled or more: named"),
    ("clear_singles", "named_or_in_the_set", "  named, or among an ambiguous few"),
    ("clear_singles", "stage", "  its stage, and no other"),
    ("clear_singles", "wrong", "  another named with confidence"),
    ("faint_singles", "right", "one effect, fainter: named, or among a few"),
    ("faint_singles", "no_gap", "  no gap seen"),
    ("faint_singles", "undecided", "  a gap seen, no cause claimed"),
    ("faint_singles", "wrong", "  another named with confidence"),
    ("no_gap", "false_alarms", "no gap: false alarms"),
    ("outsiders", "unexplained", "outside the library: said to be unexplained"),
    ("outsiders", "stage", "  its stage, and no other"),
    ("outsiders", "false_attributions", "  put down to an effect with confidence"),
    ("pairs", "whole", "two effects: both named, nothing else"),
    ("pairs", "whole_or_in_the_set", "  or both among an ambiguous few"),
    ("pairs", "stages", "  their stages, and no other"),
    ("lacking", "lack_said", "channels lacking, and said so"),
    ("intervals", "covered", "where right: 95 % intervals that hold the truth"),
)


def print_score(console: Console, score: dict[str, Any]) -> None:
    """Print a score: shares with their exact intervals, power, and the confusions."""
    table = Table("", box=None, pad_edge=False)
    for head in ("share", "95 % interval", "of"):
        table.add_column(head, justify="right", no_wrap=True)
    for group, key, words in _LINES:
        _row(table, words, score[group][key])
    _row(table, "where right: more than 95 % of the gap closed", score["closed"])
    console.print(table)
    told = score["probabilities"]
    if told["brier"] is not None:
        console.print(f"\nBrier score of {told['effects']} probabilities: {told['brier']:.3f}")
    if score["missing"]:
        console.print(f"[yellow]without a diagnosis:[/] {score['missing']} of {score['records']}")
    _print_power(console, score)
    _print_effects(console, score)


def _row(table: Table, words: str, found: dict[str, Any]) -> None:
    if found["of"]:
        low, high = 100.0 * found["low"], 100.0 * found["high"]
        share = f"{100.0 * found['share']:.0f} %"
        table.add_row(words, share, f"{low:.0f} to {high:.0f} %", str(found["of"]))


def _print_power(console: Console, score: dict[str, Any]) -> None:
    table = Table("residual widened", box=None, pad_edge=False, title_justify="left")
    for head in ("named", "95 % interval", "wrong", "of"):
        table.add_column(head, justify="right")
    for row in score["power"]:
        size = f"{row['ratio']:.1f} times"
        span = f"{100 * row['low']:.0f} to {100 * row['high']:.0f} %"
        named = f"{100 * row['share']:.0f} %"
        table.add_row(size, named, span, str(row["wrong"]), str(row["of"]))
    console.print()
    console.print(table)


def _print_effects(console: Console, score: dict[str, Any]) -> None:
    table = Table("", "right", "said instead", box=None, pad_edge=False)
    for name, row in score["effects"].items():
        instead = "; ".join(
            (f"{times} × " if times > 1 else "") + said.replace("_", " ")
            for said, times in row["instead"].items()
        )
        table.add_row(name.replace("_", " "), f"{row['right']}/{row['of']}", instead)
    console.print()
    console.print(table)
