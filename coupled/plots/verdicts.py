"""The verdicts of a check: each value within its bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from coupled.plots.pages import GREEN, ORANGE, plain

if TYPE_CHECKING:
    from coupled.campaign.check import CheckResult
    from coupled.campaign.verdict import Verdict

_LONGEST = 70


def draw_verdicts(checked: CheckResult) -> Figure:
    """Draw the margin of each value to its nearest bound, as a share of the bounds."""
    rows = checked.verdicts
    figure = Figure(figsize=(9.0, 1.4 + 0.3 * max(len(rows), 2)), layout="constrained")
    axes = figure.subplots()
    for place, verdict in enumerate(rows):
        share = _share(verdict)
        color = GREEN if verdict.passed else ORANGE
        if share is None:
            axes.plot(0.0, place, "x", color=color)
        else:
            axes.barh(place, share, color=color, height=0.6)
    words = [f"{v.case}: {v.what} [{v.configuration}]" for v in rows]
    axes.set_yticks(range(len(rows)), [plain(word, _LONGEST) for word in words], fontsize=7)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.axvline(0.0, color="black", linewidth=1.0)
    axes.set_xlabel("margin, % of half the bounds' width or of the one bound; ×: not judged")
    axes.grid(alpha=0.25, axis="x")
    held = sum(verdict.passed for verdict in rows)
    figure.suptitle(f"{held} of {len(rows)} expectations hold", fontsize=12)
    return figure


def _share(verdict: Verdict) -> float | None:
    """Return a margin in per cent of its bounds, or None if the value is not available."""
    if verdict.margin is None or verdict.value is None:
        return None
    least, most = verdict.least, verdict.most
    if least is not None and most is not None:
        scale = 0.5 * (most - least)
    else:
        scale = abs((most if least is None else least) or verdict.value)
    return 100.0 * verdict.margin / scale if scale else 100.0 * float(verdict.passed)
