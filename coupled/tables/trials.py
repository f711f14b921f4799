"""The tables of the score of blind trials."""

from __future__ import annotations

from coupled.blind.trials.result import Score, Share
from coupled.tables.table import Table


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


def score_table(score: Score) -> Table:
    """Return the shares of a score, each with its exact interval."""
    rows = tuple(
        (label, percent(found.share), span(found), str(found.of))
        for label, found in _lines(score)
        if found.share is not None
    )
    return Table(("", "share", "95 % interval", "of"), rows)


def percent(share: float | None) -> str:
    """Return a share in per cent, empty if there is none."""
    return "" if share is None else f"{100.0 * share:.0f} %"


def span(found: Share) -> str:
    """Return the interval of a share in per cent, empty if there is none."""
    if found.low is None or found.high is None:
        return ""
    return f"{100.0 * found.low:.0f} to {100.0 * found.high:.0f} %"


def detection_table(score: Score) -> Table:
    """Return the share of effects identified, by the size of the effect."""
    rows = []
    for row in score.power:
        named = row.named
        numbers = (percent(named.share), span(named), str(row.wrong), str(named.of))
        rows.append((f"{row.ratio:.1f} times", *numbers))
    heads = ("residual enlarged", "identified", "95 % interval", "wrong", "of")
    return Table(heads, tuple(rows))


def confusion_table(score: Score) -> Table:
    """Return how often each effect was identified, and the effects given instead."""
    rows = []
    for name, row in score.effects.items():
        instead = "; ".join(
            (f"{times} × " if times > 1 else "") + said.replace("_", " ")
            for said, times in row.instead.items()
        )
        rows.append((name.replace("_", " "), f"{row.right}/{row.of}", instead))
    return Table(("", "correct", "given instead"), tuple(rows), align="l")
