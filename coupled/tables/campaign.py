"""The tables of a check and of a sweep."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from coupled.authority.figures import kept_figure
from coupled.campaign.verdict import figures, wanted
from coupled.display import System, parameter_label
from coupled.tables.table import NONE, Row, Table, interval, number, passed

if TYPE_CHECKING:
    from coupled.campaign.sensitivity import SobolIndex, VarianceShare
    from coupled.campaign.survival import SurvivalLimit
    from coupled.campaign.verdict import Verdict

_STRONGEST = 6  # parameters listed per figure of merit
_SHARES = {"least": 0.0, "5 %": 0.05, "median": 0.5, "95 %": 0.95, "greatest": 1.0}


def verdict_tables(verdicts: Sequence[Verdict], system: System = "si") -> Iterator[Table]:
    """Yield a table for each case of a run: its expectations, with figure, bounds and margin."""
    heads = ("", "expectation", "found", "limits", "margin")
    for (run, case), group in groupby(verdicts, key=lambda v: (v.run, v.case)):
        rows = tuple(_verdict(verdict, system) for verdict in group)
        yield Table(heads, rows, run if run == case else f"{run}: {case}", "llr")


def _verdict(verdict: Verdict, system: System) -> Row:
    what = f"{verdict.what} [{verdict.configuration}]"
    if verdict.problem:
        what += f": {verdict.problem}"
    found, margin = figures(verdict, system)
    return passed(verdict.passed), what, found, wanted(verdict, system), margin


def spread_table(found: pl.DataFrame, kept: Sequence[str], system: System = "si") -> Table:
    """Return the distribution of each figure of merit over the flights that did not end early."""
    rows: list[Row] = []
    for configuration in found["configuration"].unique(maintain_order=True):
        rows.append((configuration,))
        for name in kept:
            figure, values = kept_figure(name, system), flown_values(found, configuration, name)
            cells = [NONE] * len(_SHARES)
            if values.size:
                ends = np.quantile(values, list(_SHARES.values()))
                cells = [figure.written(float(end), 3) for end in ends]
            rows.append((figure.label, *cells, str(values.size)))
    return Table(("", *_SHARES, "of"), tuple(rows))


def flown_values(found: pl.DataFrame, configuration: str, name: str) -> NDArray[np.float64]:
    """Return a figure of merit, in SI, of the flights of a configuration that did not end early."""
    ours = (pl.col("configuration") == configuration) & (pl.col("ended_early") == "")
    values: NDArray[np.float64] = found.filter(ours)[name].drop_nulls().cast(pl.Float64).to_numpy()
    finite: NDArray[np.float64] = values[np.isfinite(values)]
    return finite


def survival_table(limits: Sequence[SurvivalLimit], key: str) -> Table:
    """Return the flights that each configuration survives over a varied key, and the boundary."""
    rows = tuple(
        (
            limit.configuration,
            f"{limit.survived} of {limit.flights}",
            number(limit.boundary),
            number(limit.predicted),
        )
        for limit in limits
    )
    return Table(("", "survived", "boundary", "by closed form"), rows, parameter_label(key))


def indices_table(indices: Sequence[SobolIndex]) -> Table:
    """Return the parameters with the largest total Sobol index of each figure."""
    rows: list[Row] = []
    groups = groupby(indices, key=lambda index: (index.configuration, index.figure))
    for (configuration, figure), group in groups:
        rows.append((f"{configuration}: {kept_figure(figure).words}",))
        ordered = sorted(group, key=lambda i: -(i.total.value if i.total else 0.0))
        for index in ordered[:_STRONGEST]:
            label = parameter_label(index.key).partition(",")[0]
            rows.append((label, *_share(index.first), *_share(index.total)))
    heads = ("shares of the variance", "alone", "95 %", "with others", "95 %")
    return Table(heads, tuple(rows))


def _share(share: VarianceShare | None) -> tuple[str, str]:
    if share is None:
        return NONE, ""
    return f"{share.value:.3f}", interval(share.low, share.high, ".3f")
