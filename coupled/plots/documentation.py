"""Figures of a calibration and of a force documentation: SI, with inches and pounds beside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from coupled.channels import ControlName, unit_of
from coupled.files import write_whole
from coupled.plots.saving import save
from coupled.units import DEGREE_rad, INCH_m, POUND_N

if TYPE_CHECKING:
    from coupled.calibration.calibrate import Result
    from coupled.calibration.documentation import Documentation

GRAY, ORANGE, GREEN, BLUE = "0.62", "#d55e00", "#009e73", "#0072b2"
_SETS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "black", "0.5")
_MARKS = "osD^vP*X"


def _scale(control: str) -> tuple[float, str]:
    """Return the factor and unit in which a control's deflection is drawn."""
    return (100.0, "cm") if unit_of(control) == "m" else (1.0 / DEGREE_rad, "°")


def _panels(rows: int, columns: int, height: float) -> tuple[Figure, Any]:
    figure = Figure(figsize=(1.4 + 3.6 * columns, 1.1 + height * rows), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False)


def _pressure(pressure_Pa: float) -> str:
    return f"q̄ = {pressure_Pa / 1000.0:.2f} kPa"


def _title(found: Documentation, what: str) -> str:
    return f"{found.rig.name}, {found.control}: {what}"


def _with_legend(figure: Figure, axes: Any, columns: int) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, fontsize=9)


def _in_pounds(axes: Any) -> None:
    """Give an axis of newtons one in pounds on its right."""
    other = axes.secondary_yaxis("right", functions=(lambda x: x / POUND_N, lambda x: x * POUND_N))
    other.set_ylabel("lb", fontsize=8)
    other.tick_params(labelsize=7)


def _in_inches(axes: Any) -> None:
    """Give an axis of centimetres one in inches above it."""
    factor = 100.0 * INCH_m
    other = axes.secondary_xaxis("top", functions=(lambda x: x / factor, lambda x: x * factor))
    other.set_xlabel("in", fontsize=8)
    other.tick_params(labelsize=7)


def draw_forces(found: Documentation) -> Figure:
    """Draw force against true deflection at each q̄, swept both ways."""
    scale, unit = _scale(found.control)
    figure, grid = _panels(1, len(found.conditions), 3.5)
    for axes, condition in zip(grid[0], found.conditions, strict=True):
        sweeps = (
            ("specified (rigid structure)", condition.specified, GRAY, 4.5),
            ("uncompensated", condition.uncompensated, ORANGE, 1.3),
            ("compensated", condition.compensated, GREEN, 1.3),
        )
        for name, told, color, width in sweeps:
            x = scale * told.deflection
            axes.plot(x, told.force, color=color, linewidth=width, label=name)
        axes.set_title(_pressure(condition.pressure_Pa), fontsize=10)
        axes.set_xlabel(f"true deflection δ, {unit}")
        axes.grid(alpha=0.25)
        _in_pounds(axes)
        if unit == "cm":
            _in_inches(axes)
    grid[0, 0].set_ylabel("force at the grip F, N")
    figure.suptitle(_title(found, "force against deflection, slow sweep both ways"), fontsize=12)
    _with_legend(figure, grid[0, 0], 3)
    return figure


def draw_deflections(found: Documentation) -> Figure:
    """Draw computed against true deflection, and what the host's estimate lacks."""
    scale, unit = _scale(found.control)
    travel = found.rig.controls[found.control].travel
    figure, grid = _panels(1, 2, 3.7)
    left, right = grid[0]
    for condition, color in zip(found.conditions, (BLUE, ORANGE, GREEN), strict=False):
        bent = condition.compensated
        name = _pressure(condition.pressure_Pa)
        left.plot(
            scale * bent.deflection, scale * bent.computed, color=color, linewidth=1.3, label=name
        )
        sweeps = ((condition.uncompensated, "solid", "δ̂ = δc"), (bent, "dashed", "δ̂ = δc + K̂·F"))
        for told, style, estimate in sweeps:
            lacks = 100.0 * (told.deflection - told.estimate) / travel
            right.plot(
                scale * told.deflection,
                lacks,
                color=color,
                linestyle=style,
                linewidth=1.3,
                label=f"{estimate}, {name}",
            )
    ends = np.array([-1.0, 1.0]) * scale * travel
    left.plot(ends, ends, color=GRAY, linewidth=4.0, zorder=0, label="δc = δ")
    left.set_ylabel(f"computed deflection δc, {unit}")
    right.set_ylabel("δ − δ̂, % of travel")
    for axes in (left, right):
        axes.set_xlabel(f"true deflection δ, {unit}")
        axes.grid(alpha=0.25)
        axes.legend(fontsize=7, loc="best")
    right.margins(y=0.35)
    figure.suptitle(_title(found, "true against computed deflection"), fontsize=12)
    return figure


def draw_static_checks(found: Documentation) -> Figure:
    """Draw the static control check: force, and surface, within their tolerance bands."""
    from coupled.calibration.checks import SURFACE_rad, band

    scale, unit = _scale(found.control)
    data = found.rig.controls[found.control]
    rows = 1 if found.surface_rad is None else 2
    figure, grid = _panels(rows, len(found.conditions), 3.0)
    for i, condition in enumerate(found.conditions):
        axes = grid[0, i]
        for (d, f, _), name in zip(
            _legs(condition.specified), ("tolerance", "", "", ""), strict=True
        ):
            allowed = band(found.control, f)
            axes.fill_between(
                scale * d, f - allowed, f + allowed, color="0.85", linewidth=0, label=name or None
            )
        told = condition.felt
        axes.plot(scale * told.deflection, told.force, color=BLUE, linewidth=1.2, label="rig")
        x = scale * condition.specified.deflection
        axes.plot(x, condition.specified.force, "k:", linewidth=1.0, label="specified")
        axes.set_title(_verdict(found, condition.pressure_Pa, ("breakout", "force")), fontsize=9)
        if found.surface_rad is not None:
            ends = np.array([-1.0, 1.0])
            degrees = found.surface_rad / DEGREE_rad * ends
            below = grid[1, i]
            wide = SURFACE_rad / DEGREE_rad
            x = scale * data.travel * ends
            below.fill_between(x, degrees - wide, degrees + wide, color="0.85", linewidth=0)
            side = np.sign(np.dot(told.surface, told.deflection))
            moved = side * told.surface * found.surface_rad / DEGREE_rad
            below.plot(scale * told.deflection, moved, color=BLUE, linewidth=1.2)
            below.plot(x, degrees, "k:", linewidth=1.0)
            below.set_title(_verdict(found, condition.pressure_Pa, ("surface",)), fontsize=9)
        for panel in grid[:, i]:
            panel.grid(alpha=0.25)
        grid[-1, i].set_xlabel(f"true deflection δ, {unit}")
    grid[0, 0].set_ylabel("force at the grip F, N")
    if rows > 1:
        grid[1, 0].set_ylabel(f"{data.surface} from trim, °")
    title = "static control check, 14 CFR Part 60, 2.a"
    figure.suptitle(_title(found, title), fontsize=12)
    _with_legend(figure, grid[0, 0], 3)
    return figure


def _legs(told: Any) -> Any:
    from coupled.calibration.checks import legs

    return legs(told)


def _verdict(found: Documentation, pressure_Pa: float, kinds: Sequence[str]) -> str:
    """Return the q̄, and whether the checks of these kinds pass there, the least margin named."""
    ours = [
        check
        for check in found.checks
        if check.pressure_Pa == pressure_Pa and check.name.split(",")[0].split(" ")[0] in kinds
    ]
    worst = min(ours, key=lambda check: check.margin)
    word = "pass" if worst.passed else "FAIL"
    return f"{_pressure(pressure_Pa)}: {word}, least margin {100 * worst.margin:.0f} %"


def draw_releases(found: Documentation) -> Figure:
    """Draw the dynamic control check: releases, with the tolerance of crossings and overshoots."""
    from coupled.calibration.checks import swing_of

    figure, grid = _panels(2, len(found.conditions), 2.7)
    for i, condition in enumerate(found.conditions):
        for axes, (side, (now, wanted)) in zip(
            grid[:, i], condition.let_go.items(), strict=True
        ):
            swing = swing_of(wanted)
            for let_go, style in (
                (wanted, {"color": "black", "linestyle": "dotted", "label": "specified"}),
                (now, {"color": BLUE, "label": "rig"}),
            ):
                share = 100.0 * let_go.deflection / let_go.start
                axes.plot(let_go.time_s, share, linewidth=1.3, **style)
            _draw_tolerance(axes, wanted, swing)
            axes.grid(alpha=0.25)
            kinds = [c for c in found.checks if c.pressure_Pa == condition.pressure_Pa]
            kinds = [c for c in kinds if c.name.endswith(side) and c.unit in ("s", "%", "")]
            worst = min(kinds, key=lambda check: check.margin)
            word = "pass" if worst.passed else f"FAIL: {worst.name.removesuffix(', ' + side)}"
            axes.set_title(f"{_pressure(condition.pressure_Pa)}, {side}: {word}", fontsize=9)
            axes.set_xlim(0.0, _span(wanted, swing))
        grid[1, i].set_xlabel("time from the release, s")
    for axes in grid[:, 0]:
        axes.set_ylabel("δ, % of displacement")
    title = "release, 14 CFR Part 60, 2.b"
    figure.suptitle(_title(found, title), fontsize=12)
    _with_legend(figure, grid[0, 0], 4)
    return figure


def _span(wanted: Any, swing: Any) -> float:
    last = swing.crossings[min(len(swing.crossings), 5) - 1] if swing.crossings.size else 0.0
    fall = swing.fall_s if np.isfinite(swing.fall_s) else wanted.time_s[-1] / 2.0
    return float(min(max(1.5 * last, 3.0 * fall), wanted.time_s[-1]))


def _draw_tolerance(axes: Any, wanted: Any, swing: Any) -> None:
    """Draw where the rule lets the specified curve's 10 %, crossings and overshoots lie."""
    from coupled.calibration.checks import TIME_SHARE

    share = wanted.deflection / wanted.start
    begin = wanted.time_s[int(np.argmax(share <= 0.9))]
    style = {"color": ORANGE, "linewidth": 5.0, "alpha": 0.55, "solid_capstyle": "butt"}
    if not swing.peaks.size:
        low, high = (begin + swing.fall_s * (1.0 + s * TIME_SHARE) for s in (-1.0, 1.0))
        axes.plot([low, high], [10.0, 10.0], label="tolerance", **style)
        return
    for n, crossing in enumerate(swing.crossings[: len(swing.peaks) + 1]):
        if n == 1:  # half a period: the rule leaves it free
            continue
        wide = TIME_SHARE * swing.crossings[0]
        if n >= 2:
            wide += TIME_SHARE * (n - 1) * (crossing - swing.crossings[n - 2])
        at = begin + crossing
        axes.plot([at - wide, at + wide], [0.0, 0.0], label=None if n else "tolerance", **style)
    starts = np.append(swing.crossings, np.inf) + begin
    for n in range(len(swing.peaks)):
        inside = (wanted.time_s >= starts[n]) & (wanted.time_s < starts[n + 1])
        at = int(np.argmax(np.where(inside, np.abs(share), -1.0)))
        top, wide = 100.0 * share[at], 10.0 * swing.peaks[0]
        axes.plot([wanted.time_s[at]] * 2, [top - wide, top + wide], **style)


def draw_readings(found: Result, source: str) -> Figure:
    """Draw the report's figure 4: readings at each gradient with the fit, and what is left."""
    scale, unit = _scale(found.control)
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
        shown = f"{gradient:.4g} N/{unit_of(found.control)}"
        if unit == "cm":
            shown += f" ({gradient * INCH_m / POUND_N:.3g} lb/in)"
        style: dict[str, Any] = {"color": color, "marker": mark, "linestyle": "none"}
        top.plot(scale * d, readings.v1[ours], label=f"set {label}: {shown}"[:60], **style)
        reach = np.array([0.0, d[np.argmax(np.abs(d))]])
        top.plot(scale * reach, (a + b * gradient) * reach, color=color, linewidth=0.9)
        below.plot(scale * d, line.residual[ours], **style)
    below.axhline(0.0, color="black", linewidth=0.8)
    top.set_ylabel("v₁, V")
    below.set_ylabel("v₁ − fit, V")
    below.set_xlabel(f"deflection δ, {unit}")
    for axes in (top, below):
        axes.grid(alpha=0.25)
    top.legend(fontsize=8, loc="upper left")
    d_unit = unit_of(found.control)
    s1, bend = line.s1, line.bend
    text = f"S₁ = {s1.value:.5g} ± {s1.half_width:.2g} V/{d_unit}\n"
    text += f"K = {bend.value:.4g} ± {bend.half_width:.2g} {d_unit}/N"
    if unit == "cm":
        factor = POUND_N / INCH_m
        text += f"\n   = {factor * bend.value:.4f} ± {factor * bend.half_width:.4f} in/lb"
    text += f"\n{found.count} readings, ± 95 %"
    top.annotate(text, (0.98, 0.03), xycoords="axes fraction", ha="right", va="bottom", fontsize=9)
    name = source.replace("$", r"\$")
    figure.suptitle(f"{found.control}: v₁ = S₁·(δ − K·F) fitted to {name}"[:90], fontsize=12)
    return figure


def save_pages(figures: Sequence[Figure], path: Path) -> None:
    """Write figures as the pages of one PDF, whole; the same figures give the same bytes."""

    def write(part: Path) -> None:
        with PdfPages(part, metadata={"CreationDate": None}) as pages:
            for figure in figures:
                pages.savefig(figure)

    write_whole(path, write)


def draw_pages(
    documents: Sequence[Documentation],
    fits: Mapping[ControlName, tuple[Result, str] | None],
    folder: Path,
    pdf: Path,
) -> list[Path]:
    """Draw each control's pages as PNG in a folder, and all of them in one PDF."""
    pages: dict[Path, Figure] = {}
    for found in documents:
        drawn = {
            "forces": draw_forces(found),
            "deflections": draw_deflections(found),
            "static": draw_static_checks(found),
            "release": draw_releases(found),
        }
        fit = fits.get(found.control)
        if fit is not None:
            drawn["readings"] = draw_readings(*fit)
        pages |= {folder / f"{found.control}-{name}.png": page for name, page in drawn.items()}
    for path, page in pages.items():
        save(page, path)
    save_pages(list(pages.values()), pdf)
    return list(pages)
