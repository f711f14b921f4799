"""Figure 4 of the report: readings at each gradient with the fit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from coupled.display import System, in_system
from coupled.plots.pages import deflection_shown, plain
from coupled.record.channels import unit_of
from coupled.units import POUND_N, INCH_m

if TYPE_CHECKING:
    from coupled.calibration.estimate import Estimate
    from coupled.calibration.result import CalibrationResult

_SETS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "black", "0.5")
_MARKS = "osD^vP*X"
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plus_minus(found: Estimate) -> str:
    """Return a value ± half of its interval, both to the second digit of the half width."""
    if not 0.0 < found.half_width < abs(found.value):
        return f"{found.value:.6g} ± {found.half_width:.2g}"
    power = int(np.floor(np.log10(abs(found.value))))
    power = power if abs(power) > 3 else 0
    value, wide = found.value / 10.0**power, found.half_width / 10.0**power
    digits = max(1 - int(np.floor(np.log10(wide))), 0)
    text = f"{value:.{digits}f} ± {wide:.{digits}f}"
    return f"({text})·10{str(power).translate(_RAISED)}" if power else text


def draw_readings(found: CalibrationResult, source: str, system: System = "si") -> Figure:
    """Draw figure 4 of the report: readings at each gradient, the fit and its residuals."""
    shown = deflection_shown(found.control, system)
    factor, unit = shown.factor, shown.unit
    figure = Figure(figsize=(8.2, 6.8), layout="constrained")
    top, below = figure.subplots(2, 1, height_ratios=(2.4, 1.0), sharex=True)
    readings, line = found.readings, found.line
    a, b = line.s1.value, -line.bend.value * line.s1.value
    labels = np.array(readings.label)
    for i, label in enumerate(dict.fromkeys(readings.label)):
        ours = labels == label
        d, f = readings.deflection[ours], readings.force[ours]
        color, mark = _SETS[i % len(_SETS)], _MARKS[i % len(_MARKS)]
        gradient = float(f @ d / (d @ d))
        own = in_system(f"N/{unit_of(found.control)}", system)
        name = f"set {plain(label)}: {own.written(gradient)} {own.unit}"
        if unit == "cm":
            name += f" ({gradient * INCH_m / POUND_N:.3g} lb/in)"
        style: dict[str, Any] = {"color": color, "marker": mark, "linestyle": "none"}
        top.plot(factor * d, readings.v1[ours], label=name, **style)
        # With a breakout F is not proportional to δ: the fit is drawn from reading to reading.
        at, fit = np.append(d, 0.0), np.append(a * d + b * f, 0.0)
        order = np.argsort(at)
        top.plot(factor * at[order], fit[order], color=color, linewidth=0.9)
        below.plot(factor * d, line.residual[ours], **style)
    below.axhline(0.0, color="black", linewidth=0.8)
    top.set_ylabel(f"v₁, {readings.signal}")
    below.set_ylabel(f"v₁ − fit, {readings.signal}")
    below.set_xlabel(shown.labelled("deflection δ"))
    for axes in (top, below):
        axes.grid(alpha=0.25)
    handles, labels_shown = top.get_legend_handles_labels()
    figure.legend(handles, labels_shown, loc="outside lower center", ncols=3, fontsize=8)
    d_unit = unit_of(found.control)
    bend = line.bend
    per, soft = (in_system(text, system) for text in (f"{readings.signal}/{d_unit}", f"{d_unit}/N"))
    text = f"S₁ = {plus_minus(line.s1.scaled(per.factor))} {per.unit}"
    text += f"\nK = {plus_minus(bend.scaled(soft.factor))} {soft.unit}"
    if unit == "cm":
        inches = bend.scaled(POUND_N / INCH_m)
        text += f"\n   = {plus_minus(inches)} in/lb"
    text += f"\n{found.count} readings, ± 95 %"
    top.annotate(text, (0.98, 0.03), xycoords="axes fraction", ha="right", va="bottom", fontsize=9)
    figure.suptitle(
        f"{found.control}: v₁ = S₁·(δ − K·F) fitted to {plain(source, 50)}", fontsize=12
    )
    return figure
