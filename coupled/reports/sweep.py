"""The report of a sweep: what was varied, how the figures lie over the flights."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.campaign.sensitivity import SobolIndex, VarianceShare
from coupled.campaign.sweep import SweepResult
from coupled.display import System, parameter_label
from coupled.plots.results import draw_result
from coupled.plots.saving import svg_text
from coupled.plots.sweepview import Shown
from coupled.reports.page import Drawing, Made, Report, Section, Table, Verdict

Floats = NDArray[np.float64]
_SHARES = {"least": 0.0, "5 %": 0.05, "median": 0.5, "95 %": 0.95, "greatest": 1.0}
_STRONGEST = 6  # parameters of a figure
_LISTED = 20  # flights that ended early


def sweep_report(found: SweepResult, made: Made, system: System = "si") -> Report:
    """Return the report: figure, distribution, indices or boundaries, and what ended early."""
    asked = found.plan.sweep
    sections = [
        Section("Varied", (_varied(found),)),
        Section("How the figures lie over the flights", (_spread(found, system),)),
        Section("Figure", (Drawing(svg_text(draw_result(found, system)), _caption(found)),)),
    ]
    if found.limits:
        sections.insert(0, Section("What is survived", (_limits(found),)))
    if found.indices:
        sections.insert(0, Section("Shares of the variance", (_indices(found),)))
    ended = found.table.filter(pl.col("ended_early") != "")
    if len(ended):
        sections.append(Section("Flights that ended early", (_ended(ended),)))
    settings = [("sweep", asked.name), ("run", asked.run), ("method", asked.method)]
    settings += [("seed", str(asked.seed)), ("flights", str(len(found.table)))]
    return Report(
        "Sweep", asked.name, _verdict(found, system), tuple(sections), tuple(settings), made
    )


def _verdict(found: SweepResult, system: System) -> Verdict:
    ended = int((found.table["ended_early"] != "").sum())
    keys = len(found.plan.keys)
    over = f"{keys} parameters" if keys > 1 else "one parameter"
    said = f"{len(found.table)} flights over {over}, {ended} ended early."
    remarks = list(found.remarks)
    for limit in found.limits:
        where = "" if limit.boundary is None else f", the boundary at {limit.boundary:.4g}"
        text = f"{limit.survived} of {limit.flights} survived{where}"
        remarks.append(f"{limit.configuration}: {text}.")
    first = Shown.of(found.plan.sweep.keep[0], system)
    for configuration, values in _values(found, first):
        if len(values):
            low, middle, high = np.quantile(values, [0.0, 0.5, 1.0])
            ends = f"{low:.4g} to {high:.4g}, median {middle:.4g}"
            remarks.append(f"{first.label}, {configuration}: {ends}.")
    return Verdict(said, "bad" if ended and not found.limits else "plain", tuple(remarks))


def _values(found: SweepResult, shown: Shown) -> Iterator[tuple[str, Floats]]:
    """Yield a figure's values of each configuration, in the label's unit."""
    flown = found.table.filter(pl.col("ended_early") == "")
    for configuration in found.table["configuration"].unique(maintain_order=True):
        rows = flown.filter(pl.col("configuration") == configuration)
        values = shown.of_rows(rows)
        yield configuration, values[np.isfinite(values)]


def _varied(found: SweepResult) -> Table:
    rows = []
    for key in found.plan.keys:
        column = found.table[key]
        ends = ", ".join(str(value) for value in column.unique(maintain_order=True)[:8])
        if column.dtype.is_numeric():
            values = column.cast(pl.Float64).to_numpy()
            ends = f"{np.min(values):.5g} to {np.max(values):.5g}"
        rows.append((parameter_label(key), key, ends, str(column.n_unique())))
    return Table(("parameter", "key", "from, to", "values"), tuple(rows), words=2)


def _spread(found: SweepResult, system: System) -> Table:
    rows = []
    for name in found.plan.sweep.keep:
        shown = Shown.of(name, system)
        for configuration, values in _values(found, shown):
            cells = ["–"] * len(_SHARES)
            if len(values):
                cells = [f"{value:.4g}" for value in np.quantile(values, list(_SHARES.values()))]
            rows.append((shown.label, configuration, *cells, str(len(values))))
    return Table(("figure", "configuration", *_SHARES, "of"), tuple(rows), words=2)


def _limits(found: SweepResult) -> Table:
    rows = []
    for limit in found.limits:
        places = (limit.boundary, limit.predicted)
        cells = ("–" if value is None else f"{value:.4g}" for value in places)
        rows.append((limit.configuration, f"{limit.survived} of {limit.flights}", *cells))
    unit = parameter_label(found.numeric_keys[0])
    return Table(("", "survived", "boundary", "by closed form"), tuple(rows), unit)


def _indices(found: SweepResult) -> Table:
    rows: list[tuple[str, ...]] = []
    groups = groupby(found.indices, key=lambda index: (index.configuration, index.figure))
    for (configuration, figure), group in groups:
        name = Shown.of(figure).label.partition(",")[0]
        ordered = sorted(group, key=lambda i: -(i.total.value if i.total else 0.0))
        rows += [(name, configuration, *_index(index)) for index in ordered[:_STRONGEST]]
    heads = ("figure", "configuration", "parameter", "alone", "95 %", "with others", "95 %")
    return Table(heads, tuple(rows), words=3)


def _index(index: SobolIndex) -> tuple[str, ...]:
    label = parameter_label(index.key).partition(",")[0]
    return label, *_share(index.first), *_share(index.total)


def _share(share: VarianceShare | None) -> tuple[str, str]:
    if share is None:
        return "–", ""
    return f"{share.value:.3f}", f"{share.low:.3f} to {share.high:.3f}"


def _ended(ended: pl.DataFrame) -> Table:
    rows = tuple(
        (str(row["flight"]), row["configuration"], row["ended_early"])
        for row in ended.head(_LISTED).iter_rows(named=True)
    )
    caption = f"The first {len(rows)} of {len(ended)}" if len(ended) > len(rows) else ""
    return Table(("flight", "configuration", "why"), rows, caption, words=3)


def _caption(found: SweepResult) -> str:
    if found.indices:
        return "What each parameter does to each figure, alone and with others."
    if found.limits:
        return "What each configuration survives, and where the boundary lies."
    return "Each figure that varies, against what was varied."
