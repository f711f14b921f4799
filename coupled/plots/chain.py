"""The signal chain with the normalised residual of each stage, and residuals over time."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from coupled.gap.chain import STAGES
from coupled.gap.findings.result import StageResult
from coupled.gap.signals.output import Output
from coupled.gap.thresholds import FAULTY_FROM
from coupled.plots import gapview as look
from coupled.plots.gapview import View, channel_shown

_MOST = 4  # most residuals drawn
_FILL = {"guilty": "#f6d5bf", "clear": "#cfeae0", "not judged": "0.93"}
_EDGE = {"guilty": look.WRONG, "clear": look.RIGHT, "not judged": "0.6"}


def draw_stages(view: View) -> Figure:
    """Draw the signal chain, and the residuals of the faulty stages before and after the fit."""
    outputs = view.suspects()
    shown = outputs[:_MOST]
    figure = Figure(figsize=(10.4, 2.1 + 2.1 * len(shown)), layout="constrained")
    heights = [1.35, *([2.0] * len(shown))]
    widths = [1.5, 1.0] if view.effects else [1.0]
    grid = figure.add_gridspec(
        1 + len(shown), len(widths), height_ratios=heights, width_ratios=widths
    )
    _draw_chain(figure.add_subplot(grid[0, :]), view.stages)
    for i, output in enumerate(shown):
        for column in range(len(widths)):
            axes = figure.add_subplot(grid[1 + i, column])
            _draw_residual(axes, view, output, column == 0)
            if i == len(shown) - 1:
                axes.set_xlabel("time, s", fontsize=9)
    handles, labels = figure.axes[1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8.5)
    more = len(outputs) - len(shown)
    rest = f" ({more} smaller residuals are not drawn)" if more else ""
    figure.suptitle(f"Where the {view.diagnosis.control}'s gap lies{rest}", fontsize=12)
    return figure


def _draw_chain(axes: Any, stages: dict[str, StageResult]) -> None:
    """Draw one box per stage, in the order of the chain, with its normalised residual."""
    axes.set_axis_off()
    axes.set_xlim(-0.05, len(STAGES) - 0.15)
    axes.set_ylim(0.0, 1.0)
    for i, stage in enumerate(STAGES):
        found = stages.get(stage)
        state = _state(found)
        axes.add_patch(
            FancyBboxPatch(
                (i, 0.08),
                0.8,
                0.84,
                boxstyle="round,pad=0,rounding_size=0.06",
                mutation_aspect=1.0,
                facecolor=_FILL[state],
                edgecolor=_EDGE[state],
                linewidth=2.2 if state == "guilty" else 1.2,
                linestyle="dashed" if state == "not judged" else "solid",
            )
        )
        axes.text(i + 0.4, 0.74, stage, ha="center", va="center", fontsize=9, fontweight="bold")
        axes.text(i + 0.4, 0.34, _caption(found), ha="center", va="center", fontsize=8.5)
        if i:
            arrow = {"arrowstyle": "-|>", "color": "0.35", "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", (i, 0.5), (i - 0.2, 0.5), arrowprops=arrow)


def _state(found: StageResult | None) -> str:
    if found is None or not found.judged:
        return "not judged"
    return "guilty" if found.guilty else "clear"


def _caption(found: StageResult | None) -> str:
    """Return the text in the box of a stage."""
    if found is None:
        return "not in\nthis record"
    if found.gap is None:
        why = "channels lack" if found.missing else textwrap.fill(found.why, 14)
        return f"not judged:\n{why}"
    text = f"{found.gap:.3g} × floor"
    limit = FAULTY_FROM if found.limit is None else found.limit
    if not found.guilty and found.gap < limit:
        return f"{text}\nclear"
    better = found.left is not None and found.left < found.gap
    return f"{text}\nthen {found.left:.3g} ×" if better else text


def _draw_residual(axes: Any, view: View, output: Output, wide: bool) -> None:
    """Draw a residual over time: before and after the fit if `wide`, else after it only."""
    shown = channel_shown(output.channel, view.system, fine=True)
    factor, time = shown.factor * output.floor, view.time(output)
    before = factor * output.residual(view.diagnosis.nominal)
    after = factor * output.residual(view.diagnosis.improved)
    improved = bool(view.effects)
    _shade_held(axes, output, time)
    axes.axhspan(
        -2.0 * factor,
        2.0 * factor,
        color="0.75",
        alpha=0.6,
        linewidth=0.0,
        label="± 2 noise floors",
    )
    if wide:
        clear = view.diagnosis.verdict == "no_gap"
        color = look.RIGHT if clear else look.WRONG
        axes.plot(time, before, color=color, linewidth=0.9, label="measured − nominal")
        title = f"{output.stage}: {shown.words}{view.source(output)}"
        axes.set_title(title, fontsize=9, loc="left")
    if improved:
        axes.plot(time, after, color=look.RIGHT, linewidth=0.8, label="with the effects found")
    if not wide:
        reach = max(4.0 * factor, 1.1 * float(np.percentile(np.abs(after), 99.5)))
        axes.set_ylim(-reach, reach)
        axes.set_title("enlarged: remaining residual", fontsize=9, loc="left")
    axes.set_xlim(time[0], time[-1])
    axes.set_ylabel(shown.labelled("residual"), fontsize=9)
    axes.tick_params(labelsize=8)
    axes.grid(alpha=0.25)


def _shade_held(axes: Any, output: Output, time: Any) -> None:
    """Shade the held-out stretches, which no fit used."""
    edges = np.diff(np.concatenate(([0], output.rows("held").astype(int), [0])))
    starts, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0) - 1
    for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
        axes.axvspan(
            time[start],
            time[end],
            color=look.SHADE,
            linewidth=0.0,
            zorder=0,
            label="held out of the fit" if i == 0 else None,
        )
