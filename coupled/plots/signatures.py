"""The signature of each effect found: a scatter or loop plot of its law, and a zoom in time.

The measured data and the predictions with and without the effect are drawn together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from coupled.display import System
from coupled.gap.chain import AIRFRAME
from coupled.gap.chain import BY_NAME as STAGE_OF
from coupled.gap.effects.effect import Effect, Signature, touched
from coupled.gap.effects.library import WHOLE_s
from coupled.gap.findings.summary import change, in_units, plain
from coupled.gap.signals.output import Floats, Output
from coupled.plots import gapview as look
from coupled.plots.gapview import View, channel_shown, style_of
from coupled.plots.signals import SIGNALS, Scene
from coupled.plots.structure import draw_structure
from coupled.rig.packing import COMMAND_SIGN
from coupled.rig.rig import Rig

_EDGE = 12  # frames at each end of a record where derivatives are inaccurate
_BINS = 36
_FEW = 4  # fewest values in a bin that has a median
_DOTS = 3000
_LOOP_s = 5.0
_SHOWN = (0.5, 99.5)  # percentiles of the values within the axes
# The surface drawn with each channel of the motion (others: the elevator), and its positive sign.
_SURFACE_OF = {
    "roll_rate_rad_per_s": "aileron",
    "roll_rad": "aileron",
    "yaw_rate_rad_per_s": "rudder",
    "sideslip_rad": "rudder",
    "heading_rad": "rudder",
}
_POSITIVE_WAY = {"elevator": "nose up", "aileron": "right wing down", "rudder": "nose right"}


@dataclass(frozen=True)
class _Model:
    """A rig drawn with the measurements: its name in the legend, and its line style."""

    label: str
    rig: Rig
    kind: str


def draw_signature(view: View) -> Figure:
    """Draw the law of each effect found and a zoom in time.

    If no effect was found, or the effects do not explain the residual, draw its structure too.
    """
    effects = view.effects
    rest = not effects or view.diagnosis.verdict == "unexplained"
    heights = [3.9] * len(effects) + ([5.4] if rest else [])
    figure = Figure(figsize=(10.4, 0.5 + sum(heights)), layout="constrained")
    parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    for part, effect in zip(parts, effects, strict=False):
        _draw_effect(part, view, effect)
    if rest:
        draw_structure(parts[-1], view)
    return figure


def _draw_effect(figure: Any, view: View, effect: Effect) -> None:
    others = [other for other in view.effects if other is not effect]
    base = view.rig_with(others)
    pool = touched(view.diagnosis.outputs, [effect])
    widest = max(pool, key=lambda output: output.gap(base))
    reader = view.readers(base)[widest.record]
    ours = tuple(o for o in view.diagnosis.outputs if o.record == widest.record)
    models = _models(view, effect, base)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.15])
    try:
        _draw_law(left, Scene(reader, ours), effect.signature, models, view.system)
    except KeyError as lacking:
        left.set_axis_off()
        left.text(0.5, 0.5, f"the record lacks {lacking.args[0]}", ha="center", fontsize=9)
    _draw_zoom(right, view, widest, models, effect.signature.zoom_s)
    for axes in (left, right):
        axes.grid(alpha=0.25)
        axes.tick_params(labelsize=8)
    figure.suptitle(_title(view, effect) + view.source(widest), fontsize=11)
    handles, labels = right.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=8.5)


def _title(view: View, effect: Effect) -> str:
    """Return the name of an effect with its parameters."""
    found = next(e for e in view.diagnosis.effects if e.name == effect.name)
    numbers = [change(in_units(p, view.system)) for p in found.parameters]
    return ", ".join([f"{effect.stage}: {plain(effect.name)}", *numbers])


def _models(view: View, effect: Effect, base: Rig) -> list[_Model]:
    """Return the rigs to draw: without the effect, with it, and with its first alternative."""
    alone = len(view.effects) == 1
    models = [_Model("nominal" if alone else "without it", base, "wrong")]
    models.append(_Model(f"with {plain(effect.name)}", view.diagnosis.improved, "right"))
    step = next(step for step in view.diagnosis.choice.steps if step.effect is effect)
    for rival in step.rivals[:1]:
        models.append(_Model(f"rival: {plain(rival.effect.name)}", rival.fit.rig, "rival"))
    return models


def _draw_law(
    axes: Any, scene: Scene, signature: Signature, models: Sequence[_Model], system: System
) -> None:
    """Draw the law of an effect: measurements as dots, predictions as lines."""
    control, y = scene.reader.control, SIGNALS[signature.y].shown_in(scene.reader.control, system)
    axes.set_ylabel(y.label_on(control), fontsize=9)
    if signature.drawing == "time":
        time = scene.reader.record.time_s
        axes.plot(time - time[0], y.get(scene, None), color=look.RIGHT, linewidth=1.2)
        axes.axhline(0.0, **style_of("wrong"))
        axes.set_xlabel("time, s", fontsize=9)
        axes.set_title("from kinematics", fontsize=9, loc="left")
        return
    x = SIGNALS[signature.x].shown_in(control, system)
    axes.set_xlabel(x.label_on(control), fontsize=9)
    inner = slice(_EDGE, -_EDGE)
    at, seen = x.get(scene, None)[inner], y.get(scene, None)[inner]
    wide, high = _model_range(at), _model_range(seen)
    known = [
        (m, _cut(wide, x.get(scene, m.rig)[inner]), _cut(high, y.get(scene, m.rig)[inner]))
        for m in models
    ]
    rows = _widest_window(seen - known[0][2], round(_LOOP_s * scene.frame_rate))
    if signature.drawing == "loop":
        axes.plot(at, seen, ".", color="0.75", markersize=1.5, zorder=0, rasterized=True)
        axes.plot(at[rows], seen[rows], **{**style_of("measured"), "linewidth": 1.8})
        title = f"loops of {_LOOP_s:g} s; dots: all measurements"
        for model, across, up in known:
            axes.plot(across[rows], up[rows], **style_of(model.kind))
    else:
        every = max(1, len(at) // _DOTS)
        axes.plot(at[::every], seen[::every], ".", color="0.7", markersize=2.0, rasterized=True)
        for model, across, up in known:
            axes.plot(*_medians(across, up), **style_of(model.kind))
        axes.plot(*_medians(at, seen), "o", color=look.MEASURED, markersize=3.5, zorder=4)
        title = "dots: measured; black: medians; lines: predicted medians"
    axes.set_title(title, fontsize=9, loc="left")
    axes.set_xlim(_limits([at, *(across for _, across, _ in known)]))
    axes.set_ylim(_limits([seen, *(up for _, _, up in known)]))


def _model_range(measured: Floats) -> tuple[float, float]:
    """Return the range in which a model is drawn: the measured range, extended by its span."""
    low, high = np.nanpercentile(measured, _SHOWN)
    span = float(high - low) or 1.0
    return float(low - span), float(high + span)


def _cut(ends: tuple[float, float], values: Floats) -> Floats:
    """Return values with NaN outside the range, for derivatives where a replay restarts."""
    return np.where((values >= ends[0]) & (values <= ends[1]), values, np.nan)


def _limits(series: Sequence[Floats]) -> tuple[float, float]:
    """Return the limits of an axis, without outliers of the derivative."""
    known = [one for one in series if np.isfinite(one).any()]
    each = np.array([np.nanpercentile(one, _SHOWN) for one in known])
    low, high = float(each[:, 0].min()), float(each[:, 1].max())
    room = 0.15 * (high - low) or 1.0
    return low - room, high + room


def _medians(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return the medians of y in bins of x."""
    known = np.isfinite(x) & np.isfinite(y)
    x, y = x[known], y[known]
    if not len(x):
        return x, y
    # Half of the edges at quantiles, for dense data, and half equally spaced, for sparse data.
    shares = np.linspace(0.0, 1.0, _BINS // 2 + 1)
    edges = np.union1d(np.quantile(x, shares), x.min() + shares * np.ptp(x))
    number = np.searchsorted(edges[1:-1], x)
    bins = [number == k for k in range(len(edges) - 1)]
    pairs = [(np.median(x[b]), np.median(y[b])) for b in bins if b.sum() >= _FEW]
    whole = np.array(pairs, dtype=np.float64).reshape(-1, 2)
    return whole[:, 0], whole[:, 1]


def _widest_window(left: Floats, frames: int) -> slice:
    """Return the window of `frames` rows with the largest sum of squared residuals."""
    frames = min(frames, len(left))
    total = np.cumsum(np.concatenate(([0.0], np.nan_to_num(left) ** 2)))
    start = int(np.argmax(total[frames:] - total[:-frames]))
    return slice(start, start + frames)


def _draw_zoom(
    axes: Any, view: View, output: Output, models: Sequence[_Model], length_s: float
) -> None:
    """Draw measurement and predictions over time where they differ most, with the input scaled."""
    shown = channel_shown(output.channel, view.system)
    factor = shown.factor
    made = [(model, factor * output.predict(model.rig)) for model in models]
    rows = _widest_window(made[1][1] - made[0][1], round(length_s * output.frame_rate_Hz))
    time = view.time(output)[rows]
    seen = factor * output.measured[rows]
    driven = _input(view, output)
    if driven is not None:
        label, signal = driven
        part = signal[rows] - np.median(signal[rows])
        size = float(np.ptp(seen)) / max(float(np.ptp(part)), 1e-12)
        axes.plot(
            time,
            size * part + np.median(seen),
            color="#e69f00",
            linewidth=1.0,
            linestyle="dashdot",
            label=f"{label}, scaled",
        )
    axes.plot(time, seen, label="measured", **style_of("measured"))
    for model, whole in made:
        axes.plot(time, whole[rows], label=model.label, **style_of(model.kind))
    axes.set_xlim(time[0], time[-1])
    axes.set_xlabel("time, s", fontsize=9)
    axes.set_ylabel(shown.label, fontsize=9)
    axes.set_title(
        "the whole record" if length_s == WHOLE_s else "where they differ most",
        fontsize=9,
        loc="left",
    )


def _input(view: View, output: Output) -> tuple[str, Floats] | None:
    """Return label and signal of the input of the stage, or None if it is not recorded."""
    control, record = view.diagnosis.part.control, view.records[output.record]
    if output.stage == AIRFRAME:
        surface = _SURFACE_OF.get(output.channel, "elevator")
        if f"{surface}_rad" not in record:
            return None
        sign, way = COMMAND_SIGN[surface], _POSITIVE_WAY[surface]
        return f"{surface}, {way}", sign * record[f"{surface}_rad"]
    label, name = STAGE_OF[output.stage].drive if output.stage in STAGE_OF else ("", "")
    name = f"{control}_force_N" if name == "force" else name
    return (label, record[name]) if name in record else None
