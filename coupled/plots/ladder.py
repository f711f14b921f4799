"""The ladder of a diagnosis: gains at each search depth, and the residual after each effect."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coupled.display import split_unit
from coupled.gap.chain import CHAIN, stage_of
from coupled.gap.effects.library import EFFECTS
from coupled.gap.findings.summary import figure as written
from coupled.gap.findings.summary import in_units, plain
from coupled.gap.search.found import Found
from coupled.gap.signals.output import stage_gaps
from coupled.gap.thresholds import RIVAL_GAIN
from coupled.plots import gapview as look
from coupled.plots.gapview import View

_COLORS = {stage.name: stage.color for stage in CHAIN}
_LINEAR = 10.0  # gain up to which the axis is linear
_ROOM = 12.0  # space beyond the bars for their numbers
_HALF = 0.38  # half of the width of a step
_WIDE = 62  # characters of a headline
Gaps = list[dict[str, float]]


def draw_ladder(view: View) -> Figure:
    """Draw the gain of each effect tried, the residual after each step, and the values found."""
    rounds = [gains for gains in view.diagnosis.choice.rounds if gains]
    gaps = _all_gaps(view)
    heights = [len(gains) + 1.6 for gains in rounds] or [4.0]
    numbers = _numbers(view)
    height = max(5.2, 1.1 + 0.27 * sum(heights))
    figure = Figure(figsize=(10.4, min(height, 14.0)), layout="constrained")
    left, right = figure.subfigures(1, 2, width_ratios=[1.15, 1.0], squeeze=False)[0]
    if rounds:
        grid = left.subplots(len(rounds), 1, height_ratios=heights, sharex=True, squeeze=False)
        for k, axes in enumerate(grid[:, 0]):
            _draw_round(axes, view, k, rounds, gaps)
        _finish_gains(left, grid[:, 0], rounds)
    else:
        _write_text(left.subplots(), "No stage exceeds its noise floor:\nno effect was fitted.")
    rungs, table = right.subplots(2, 1, height_ratios=[3.0, max(1.0, 0.3 * (len(numbers) + 1))])
    _draw_rungs(rungs, view, gaps)
    _draw_numbers(table, numbers)
    verdict = plain(view.diagnosis.verdict).replace("effect", "explained")
    figure.suptitle(f"Ladder of the {view.diagnosis.control}'s gap: {verdict}", fontsize=12)
    return figure


def _all_gaps(view: View) -> Gaps:
    """Return the residuals of the stages after each step; the last are those of the diagnosis."""
    gaps = [_gaps(view, rig) for _, rig in view.rungs()]
    if view.effects:
        left = {s.name: s.left for s in view.diagnosis.stages if s.left is not None}
        gaps[-1] = {stage: left.get(stage, gap) for stage, gap in gaps[-1].items()}
    return gaps


def _gaps(view: View, rig: Any) -> dict[str, float]:
    """Return the normalised residual of each stage with a rig."""
    found: dict[str, float] = {}
    for output, gap in stage_gaps(view.diagnosis.outputs, rig).items():
        stage = stage_of(output)
        found[stage] = max(found.get(stage, 0.0), gap)
    return found


def _accepted_effect(view: View, k: int, rounds: list[dict[str, float]]) -> Found | None:
    """Return the effect accepted at a depth, if it is not in a later round."""
    later = {name for gains in rounds[k + 1 :] for name in gains}
    least = max(0.0, max(rounds[k].values()) - RIVAL_GAIN)
    for step in view.diagnosis.choice.steps:
        name = step.effect.name
        if name not in later and rounds[k].get(name, -np.inf) >= least:
            return step
    return None


def _draw_round(axes: Any, view: View, k: int, rounds: list[dict[str, float]], gaps: Gaps) -> None:
    gains = sorted(rounds[k].items(), key=lambda item: item[1])
    step = _accepted_effect(view, k, rounds)
    rivals = {rival.effect.name for rival in step.rivals} if step else set()
    for place, (name, gain) in enumerate(gains):
        found = step is not None and name == step.effect.name
        style: dict[str, Any] = {"color": look.RIGHT} if found else {"color": "0.78"}
        if name in rivals:
            style = {"facecolor": "white", "edgecolor": look.RIVAL, "hatch": "////"}
        axes.barh(place, gain, 0.72, **style)
        _write_gain(axes, place, gain, "bold" if found else "normal")
    axes.set_yticks(range(len(gains)), [plain(name) for name, _ in gains], fontsize=8)
    axes.set_ylim(-0.7, len(gains) - 0.3)
    axes.axvline(0.0, color="black", linewidth=0.8)
    axes.set_title(_headline(k, step), fontsize=9, loc="left")
    axes.grid(alpha=0.25, axis="x")
    out = _screened(view, rounds[k], gaps[min(k, len(gaps) - 1)])
    if out:
        text = "screened out: " + ", ".join(plain(name) for name in out)
        axes.set_xlabel("\n".join(textwrap.wrap(text, 74)), fontsize=7, color="0.45", loc="left")


def _headline(k: int, step: Found | None) -> str:
    if step is None:
        return f"depth {k + 1}: no effect gains"
    rivals = ", ".join(dict.fromkeys(plain(rival.effect.name) for rival in step.rivals))
    doubt = f" (rivals: {rivals})" if rivals else ""
    return textwrap.fill(f"depth {k + 1}: {plain(step.effect.name)}{doubt}", _WIDE)


def _write_gain(axes: Any, place: int, gain: float, weight: str) -> None:
    side = 1 if gain >= 0.0 else -1
    axes.annotate(
        _short(gain),
        (gain, place),
        textcoords="offset points",
        xytext=(3 * side, 0),
        ha="left" if side > 0 else "right",
        va="center",
        fontsize=7.5,
        fontweight=weight,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
    )


def _short(gain: float) -> str:
    """Return a gain without an exponent, rounded to a tenth."""
    if abs(gain) < 1000.0:
        return "0" if abs(gain) < 0.05 else f"{gain:.3g}"
    return f"{gain:.0f}"


def _finish_gains(figure: Any, column: Any, rounds: list[dict[str, float]]) -> None:
    """Set the shared axis with space for the numbers, and the legend."""
    every = [gain for gains in rounds for gain in gains.values()]
    last = column[-1]
    last.set_xscale("symlog", linthresh=_LINEAR, linscale=0.8)
    last.set_xlim(min(-_LINEAR, _ROOM * min(every)), _ROOM * max(_LINEAR, *every))
    left, right = last.get_xlim()
    span = [-1e6, -1e4, -100, 0, 100, 1e4, 1e6]
    if right < 1e3 and left > -1e3:
        span = [-100, -10, 0, 10, 100]
    ticks = [tick for tick in span if left <= tick <= right]
    last.set_xticks(ticks, [f"{tick:,.0f}".replace(",", " ") for tick in ticks], fontsize=8)
    last.minorticks_off()
    figure.supxlabel(
        f"gain in log evidence (logarithmic beyond ±{_LINEAR:g})",
        fontsize=9,
    )
    marks = [
        _bar(last, {"color": look.RIGHT}, "found"),
        _bar(last, {"facecolor": "white", "edgecolor": look.RIVAL, "hatch": "////"}, "rival"),
        _bar(last, {"color": "0.78"}, "tried"),
    ]
    figure.legend(handles=marks, loc="outside upper center", ncols=3, fontsize=8, frameon=False)


def _bar(axes: Any, style: dict[str, Any], label: str) -> Any:
    return axes.barh([np.nan], [0.0], label=label, **style)


def _screened(view: View, tried: dict[str, float], gaps: dict[str, float]) -> list[str]:
    """Return the effects of the then faulty stages that were screened out or hit a bound."""
    guilty = {stage for stage, gap in gaps.items() if gap > view.threshold(stage)}
    known = {effect.name for effect in view.effects}
    return [
        effect.name
        for effect in EFFECTS
        if effect.name not in tried
        and effect.name not in known
        and guilty & {stage_of(output) for output in effect.shows_in}
        and effect.can_be_tried(view.records, view.diagnosis.part.control)
    ]


def _draw_rungs(axes: Any, view: View, gaps: Gaps) -> None:
    """Draw the normalised residual of each suspected stage from the nominal to the improved rig."""
    names = [name for name, _ in view.rungs()]
    suspects = {stage_of(output.stage) for output in view.suspects()}
    stages = [stage for stage in _COLORS if stage in suspects and stage in gaps[0]]
    places = np.arange(len(names))
    for i, stage in enumerate(stages):
        color, way = _COLORS[stage], [gap.get(stage, np.nan) for gap in gaps]
        half = _HALF / len(stages)
        at = places - _HALF + (2 * i + 1) * half
        axes.step(at, way, where="mid", color=color, linewidth=0.9, linestyle=(0, (2, 2)))
        axes.hlines(way, at - 0.9 * half, at + 0.9 * half, color=color, linewidth=3.5, label=stage)
        for place, gap in zip(at, way, strict=True):
            axes.annotate(
                f"{gap:.3g}",
                (place, gap),
                (0, 4 if gap >= 1.0 else -4),  # away from the line of the noise floor
                textcoords="offset points",
                ha="center",
                va="bottom" if gap >= 1.0 else "top",
                fontsize=8,
                color=color,
            )
        axes.axhline(view.threshold(stage), color=color, linewidth=0.8, linestyle="dotted")
    axes.axhline(1.0, color="black", linewidth=1.2)
    top = max(max(gap.get(stage, 1.0) for stage in stages) for gap in gaps) if stages else 2.0
    axes.set_yscale("log")
    axes.set_ylim(0.72, max(2.0, 1.6 * top))
    ticks = [
        t
        for t in (
            1,
            *((1.2, 1.5) if top < 2.0 else ()),
            2,
            5,
            10,
            20,
            50,
            100,
            200,
            500,
            1000,
            2000,
            5000,
        )
        if t <= 1.6 * top
    ]
    axes.set_yticks(ticks, [str(tick) for tick in ticks], fontsize=8)
    axes.minorticks_off()
    axes.set_xlim(-0.6, len(names) - 0.4)
    axes.set_xticks(places, ["\n".join(textwrap.wrap(name, 16)) for name in names], fontsize=8)
    axes.set_ylabel("residual over its noise floor, 1 (logarithmic)", fontsize=9)
    axes.set_title(
        "residual after each effect\n(black: noise floor; dotted: explained below it)",
        fontsize=9,
        loc="left",
    )
    axes.grid(alpha=0.25, axis="y")
    if stages:
        axes.legend(
            fontsize=8,
            loc="upper left",
            bbox_to_anchor=(0.0, -0.16),
            ncols=min(len(stages), 4),
            frameon=False,
        )


def _numbers(view: View) -> list[tuple[str, str, str]]:
    """Return one line per effect and per parameter: name, value, 95 % interval."""
    lines = []
    for effect in view.diagnosis.effects:
        lines.append((f"{plain(effect.name)}, p = {effect.probability:.2f}", "", ""))
        for p in (in_units(each, view.system) for each in effect.parameters):
            interval = p.interval(written) or "not determined"
            value = f"{written(p.found)} {p.unit}".rstrip()
            key = p.key.rpartition(".")[2]
            name = key if view.system == "si" else split_unit(key)[0].replace("_", " ")
            lines.append((f"    {name}", value, interval))
    return lines


def _draw_numbers(axes: Any, lines: list[tuple[str, str, str]]) -> None:
    if not lines:
        _write_text(axes, "No effect found.")
        return
    axes.set_axis_off()
    heads = ("effect", "value", "95 % interval")
    table = axes.table(
        cellText=lines,
        colLabels=heads,
        loc="upper center",
        cellLoc="left",
        colLoc="left",
        colWidths=[0.4, 0.3, 0.3],
        edges="horizontal",
    )
    table.auto_set_font_size(False)
    table.set_fontsize(7.5)
    for (row, _), cell in table.get_celld().items():
        cell.set_linewidth(0.5)
        cell.PAD = 0.02
        if row == 0:
            cell.set_text_props(fontweight="bold")


def _write_text(axes: Any, text: str) -> None:
    axes.set_axis_off()
    axes.text(0.5, 0.5, text, ha="center", va="center", transform=axes.transAxes, fontsize=10)
