"""The score of blind trials on a terminal of 80 columns."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from coupled.blind.trials.result import Score, Share
from coupled.cli.tables.whole import print_whole


def _lines(score: Score) -> list[tuple[str, Share]]:
    """Return what the table says, a line a share."""
    clear, faint, outside = score.clear_singles, score.faint_singles, score.outsiders
    return [
        ("one effect, residual doubled or more: named", clear.named),
        ("  named, or among an ambiguous few", clear.named_or_in_the_set),
        ("  its stage, and no other", clear.stage),
        ("  another named with confidence", clear.wrong),
        ("one effect, fainter: named, or among a few", faint.right),
        ("  no gap seen", faint.no_gap),
        ("  a gap seen, no cause claimed", faint.undecided),
        ("  another named with confidence", faint.wrong),
        ("no gap: false alarms", score.false_alarms),
        ("outside the library: said to be unexplained", outside.unexplained),
        ("  its stage, and no other", outside.stage),
        ("  put down to an effect with confidence", outside.false_attributions),
        ("two effects: both named, nothing else", score.pairs.whole),
        ("  or both among an ambiguous few", score.pairs.whole_or_in_the_set),
        ("  their stages, and no other", score.pairs.stages),
        ("channels lacking, and said so", score.lack_said),
        ("where right: 95 % intervals that hold the truth", score.intervals.covered),
        ("where right: budget's shares within 5 points", score.budget),
        ("where right: more than 95 % of the gap closed", score.closed),
    ]


def print_score(console: Console, score: Score) -> None:
    """Print a score: shares with their exact intervals, power, and the confusions."""
    table = Table("", box=None, pad_edge=False)
    for head in ("share", "95 % interval", "of"):
        table.add_column(head, justify="right", no_wrap=True)
    for label, found in _lines(score):
        if found.share is not None:
            table.add_row(label, percent(found.share), span(found), str(found.of))
    print_whole(console, table)
    stated = score.probabilities
    if stated.brier is not None:
        console.print(f"\nBrier score of {stated.effects} probabilities: {stated.brier:.3f}")
    if score.missing:
        console.print(f"[yellow]without a diagnosis:[/] {score.missing} of {score.records}")
    _print_power(console, score)
    _print_effects(console, score)


def percent(share: float | None) -> str:
    """Return a share in per cent, nothing where there is none."""
    return "" if share is None else f"{100.0 * share:.0f} %"


def span(found: Share) -> str:
    """Return the interval of a share in per cent, nothing where there is none."""
    if found.low is None or found.high is None:
        return ""
    return f"{100.0 * found.low:.0f} to {100.0 * found.high:.0f} %"


def _print_power(console: Console, score: Score) -> None:
    table = Table("residual widened", box=None, pad_edge=False, title_justify="left")
    for head in ("named", "95 % interval", "wrong", "of"):
        table.add_column(head, justify="right")
    for row in score.power:
        named = row.named
        size = f"{row.ratio:.1f} times"
        table.add_row(size, percent(named.share), span(named), str(row.wrong), str(named.of))
    console.print()
    print_whole(console, table)


def _print_effects(console: Console, score: Score) -> None:
    table = Table("", "right", "said instead", box=None, pad_edge=False)
    for name, row in score.effects.items():
        instead = "; ".join(
            (f"{times} × " if times > 1 else "") + said.replace("_", " ")
            for said, times in row.instead.items()
        )
        table.add_row(name.replace("_", " "), f"{row.right}/{row.of}", instead)
    console.print()
    print_whole(console, table)
