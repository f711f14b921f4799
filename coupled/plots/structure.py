"""The structure of an unexplained residual: its dependence on each signal, strongest first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from coupled.display import Shown
from coupled.gap.findings.summary import plain
from coupled.gap.noise.smooth import rate_of, smoothed
from coupled.gap.signals.output import Floats, Output
from coupled.plots import gapview as look
from coupled.plots.gapview import View, channel_shown
from coupled.record.channels import unit_of

_BINS = 24
_DOTS = 2500


def draw_structure(figure: Any, view: View) -> None:
    """Draw the largest remaining residual against each signal, and its spectrum."""
    improved = view.diagnosis.improved
    output = max(view.suspects(), key=lambda o: o.gap(improved))
    shown = channel_shown(output.channel, view.system, fine=True)
    left = shown.factor * output.floor * output.residual(improved)
    line = _spectrum(left, output.frame_rate_Hz)
    panels = [(_share(signal, left), label, signal) for label, signal in _signals(view, output)]
    panels.append((line.share, "", left))
    panels.sort(key=lambda panel: -panel[0])
    grid = list(figure.subplots(2, 3).flat)
    for i, (axes, (share, label, signal)) in enumerate(zip(grid, panels, strict=False)):
        if label:
            _draw_against(axes, signal, left, label, shown)
            title = f"{100.0 * share:.0f} % of the variance explained"
        else:
            _draw_spectrum(axes, line, shown)
            title = f"{100.0 * share:.0f} % of its power at {line.frequency[line.peak]:.3g} Hz"
        axes.set_title(f"{i + 1}. {title}", fontsize=9, loc="left")
        axes.grid(alpha=0.25)
        axes.tick_params(labelsize=8)
    for axes in grid[len(panels) :]:
        axes.set_visible(False)
    what = f"{plain(output.stage)}: residual of the {shown.words}{view.source(output)}"
    gap = output.gap(improved)
    figure.suptitle(f"{what}, {gap:.3g} × its noise floor, against signals", fontsize=11)


def _draw_against(axes: Any, signal: Floats, left: Floats, label: str, unit: Shown) -> None:
    axes.plot(*_thin(signal, left), ".", color="0.7", markersize=2.0, rasterized=True)
    axes.plot(*_means(signal, left), "o-", color=look.RIVAL, markersize=3.0, linewidth=1.2)
    axes.set_xlabel(label, fontsize=9)
    axes.set_ylabel(unit.labelled("residual"), fontsize=9)


def _signals(view: View, output: Output) -> list[tuple[str, Floats]]:
    """Return the signals that a residual may depend on, each with its label."""
    record, control = view.records[output.record], view.diagnosis.part.control
    d = unit_of(control)
    found: list[tuple[str, Floats]] = []
    for name in (f"{control}_force_N", f"{control}_computed_{d}", "dynamic_pressure_Pa"):
        if name in record:
            shown = channel_shown(name, view.system)
            found.append((shown.label, shown.factor * record[name]))
    computed = f"{control}_computed_{d}"
    if computed in record:
        shown = channel_shown(computed, view.system)
        speed = shown.factor * rate_of(smoothed(record[computed]), output.frame_rate_Hz)
        found.append((f"deflection's rate δc′, {shown.unit}/s", speed))
    return [*found, ("time, s", view.time(output))]


def _binned(signal: Floats) -> tuple[Any, int]:
    edges = np.unique(np.quantile(signal, np.linspace(0.0, 1.0, _BINS + 1)))
    return np.searchsorted(edges[1:-1], signal), max(1, len(edges) - 1)


def _means(signal: Floats, left: Floats) -> tuple[Floats, Floats]:
    """Return the means of a signal and of a residual in quantile bins of the signal."""
    number, bins = _binned(signal)
    count = np.maximum(np.bincount(number, minlength=bins), 1)
    return (
        np.bincount(number, signal, minlength=bins) / count,
        np.bincount(number, left, minlength=bins) / count,
    )


def _share(signal: Floats, left: Floats) -> float:
    """Return the share of a residual's variance explained by its bin means (η²)."""
    number, _ = _binned(signal)
    means = _means(signal, left)[1][number]
    return float(np.var(means) / max(float(np.var(left)), 1e-300))


def _thin(signal: Floats, left: Floats) -> tuple[Floats, Floats]:
    every = max(1, len(left) // _DOTS)
    return signal[::every], left[::every]


@dataclass(frozen=True)
class _Spectrum:
    """Amplitude over frequency in Hz, the index of the peak, and the share of power at the peak."""

    frequency: Floats
    amplitude: Floats
    peak: int
    share: float


def _spectrum(left: Floats, frame_rate_Hz: float) -> _Spectrum:
    """Return the spectrum of a residual with a Hann window, whose main lobe is four bins wide."""
    window = np.hanning(len(left))
    lines = np.fft.rfft((left - left.mean()) * window)
    amplitude = np.asarray(2.0 * np.abs(lines) / window.sum(), dtype=np.float64)
    frequency = np.asarray(np.fft.rfftfreq(len(left), 1.0 / frame_rate_Hz), dtype=np.float64)
    peak = 1 + int(np.argmax(amplitude[1:]))
    line = amplitude[max(1, peak - 2) : peak + 3]
    share = float(np.sum(line**2) / max(float(np.sum(amplitude[1:] ** 2)), 1e-300))
    return _Spectrum(frequency, amplitude, peak, share)


def _draw_spectrum(axes: Any, found: _Spectrum, unit: Shown) -> None:
    """Draw amplitude over frequency."""
    axes.plot(found.frequency[1:], found.amplitude[1:], color=look.RIVAL, linewidth=0.9)
    at = found.frequency[found.peak]
    axes.plot(at, found.amplitude[found.peak], "o", color=look.WRONG, markersize=4)
    axes.set_xscale("log")
    axes.set_xlabel("frequency, Hz (logarithmic)", fontsize=9)
    axes.set_ylabel(unit.labelled("amplitude"), fontsize=9)
