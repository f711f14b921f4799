"""The report of a sweep: the varied parameters, and the distribution of the results."""

from __future__ import annotations

import numpy as np
import polars as pl

from coupled.authority.figures import kept_figure
from coupled.campaign.sweep import SweepResult
from coupled.display import System, parameter_label
from coupled.plots.results import draw_result
from coupled.plots.saving import svg_text
from coupled.reports.page import Drawing, Provenance, Report, Section, Verdict
from coupled.tables.campaign import flown_values, indices_table, spread_table, survival_table
from coupled.tables.table import Table

_LISTED = 20  # flights that ended early


def sweep_report(found: SweepResult, made: Provenance, system: System = "si") -> Report:
    """Return the report: figure, distribution, indices or boundaries, and flights ended early."""
    asked = found.plan.sweep
    sections = [
        Section("Varied", (_varied(found),)),
        Section("Distribution over the flights", (spread_table(found.table, asked.keep, system),)),
        Section("Figure", (Drawing(svg_text(draw_result(found, system)), _caption(found)),)),
    ]
    if found.limits:
        sections.insert(
            0, Section("Survival", (survival_table(found.limits, found.numeric_keys[0]),))
        )
    if found.indices:
        sections.insert(0, Section("Shares of the variance", (indices_table(found.indices),)))
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
    name = found.plan.sweep.keep[0]
    first = kept_figure(name, system)
    for configuration in found.table["configuration"].unique(maintain_order=True):
        values = flown_values(found.table, configuration, name)
        if len(values):
            low, middle, high = first.factor * np.quantile(values, [0.0, 0.5, 1.0])
            ends = f"{low:.4g} to {high:.4g}, median {middle:.4g}"
            remarks.append(f"{first.label}, {configuration}: {ends}.")
    return Verdict(said, "bad" if ended and not found.limits else "plain", tuple(remarks))


def _varied(found: SweepResult) -> Table:
    rows = []
    for key in found.plan.keys:
        column = found.table[key]
        ends = ", ".join(str(value) for value in column.unique(maintain_order=True)[:8])
        if column.dtype.is_numeric():
            values = column.cast(pl.Float64).to_numpy()
            ends = f"{np.min(values):.5g} to {np.max(values):.5g}"
        rows.append((parameter_label(key), key, ends, str(column.n_unique())))
    return Table(("parameter", "key", "from, to", "values"), tuple(rows), align="llr")


def _ended(ended: pl.DataFrame) -> Table:
    rows = tuple(
        (str(row["flight"]), row["configuration"], row["ended_early"])
        for row in ended.head(_LISTED).iter_rows(named=True)
    )
    caption = f"The first {len(rows)} of {len(ended)}" if len(ended) > len(rows) else ""
    return Table(("flight", "configuration", "why"), rows, caption, "l")


def _caption(found: SweepResult) -> str:
    if found.indices:
        return "Sobol indices of each parameter for each figure."
    if found.limits:
        return "Survived flights of each configuration, and the boundary."
    return "Each figure that varies, against the varied parameters."
