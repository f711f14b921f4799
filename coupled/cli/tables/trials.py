"""The score of blind trials on a terminal of 80 columns."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from coupled.blind.trials.result import Score, Share
from coupled.cli.tables.whole import print_whole


def _lines(score: Score) -> list[tuple[str, Share]]:
    """Return the lines of the table, one for each share."""
    clear, faint, outside = score.clear_singles, score.faint_singles, score.outsiders
    return [
        ("single effect, residual doubled: identified", clear.named),
        ("  identified, or among the alternatives", clear.named_or_in_the_set),
        ("  faulty stage correct, and no other", clear.stage),
        ("  wrong effect stated as certain", clear.wrong),
        ("fainter single effect: identified or alternative", faint.right),
        ("  no gap detected", faint.no_gap),
        ("  gap detected, no effect stated", faint.undecided),
        ("  wrong effect stated as certain", faint.wrong),
        ("no effect: false alarms", score.false_alarms),
        ("fault outside the library: left unexplained", outside.unexplained),
        ("  faulty stage correct, and no other", outside.stage),
        ("  attributed to an effect as certain", outside.false_attributions),
        ("two effects: both identified, and no other", score.pairs.whole),
        ("  identified, or among the alternatives", score.pairs.whole_or_in_the_set),
        ("  faulty stages correct, and no others", score.pairs.stages),
        ("missing channels: reported", score.lack_said),
        ("if correct: true value in its 95 % interval", score.intervals.covered),
        ("if correct: shares of the budget within 5 points", score.budget),
        ("if correct: more than 95 % of the gap closed", score.closed),
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
    """Return a share in per cent, empty if there is none."""
    return "" if share is None else f"{100.0 * share:.0f} %"


def span(found: Share) -> str:
    """Return the interval of a share in per cent, empty if there is none."""
    if found.low is None or found.high is None:
        return ""
    return f"{100.0 * found.low:.0f} to {100.0 * found.high:.0f} %"


def _print_power(console: Console, score: Score) -> None:
    table = Table("residual enlarged", box=None, pad_edge=False, title_justify="left")
    for head in ("identified", "95 % interval", "wrong", "of"):
        table.add_column(head, justify="right")
    for row in score.power:
        named = row.named
        size = f"{row.ratio:.1f} times"
        table.add_row(size, percent(named.share), span(named), str(row.wrong), str(named.of))
    console.print()
    print_whole(console, table)


def _print_effects(console: Console, score: Score) -> None:
    table = Table("", "correct", "given instead", box=None, pad_edge=False)
    for name, row in score.effects.items():
        instead = "; ".join(
            (f"{times} × " if times > 1 else "") + said.replace("_", " ")
            for said, times in row.instead.items()
        )
        table.add_row(name.replace("_", " "), f"{row.right}/{row.of}", instead)
    console.print()
    print_whole(console, table)
