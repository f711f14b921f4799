"""The survived flights of a sweep, and the boundary of survival of each configuration.

If the surface's authority decides, the boundary scales with it: that of a configuration is the
rigid one's times the share of the command that reaches its surface by the closed form, 1 − loss.
The loss is that of the mildest flight, which stays closest to its trim.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import polars as pl

from coupled.campaign.entry import SURVIVED

RIGID, LOSS = "rigid", "loss_closed_form"


@dataclass(frozen=True)
class SurvivalLimit:
    """The survival of a configuration over the values of one key.

    `shares` are (value, survived share of its flights); `boundary` is midway between the
    neighbours at which survival ends, `predicted` that of the closed form; None if there is no
    boundary, or more than one.
    """

    configuration: str
    shares: tuple[tuple[float, float], ...]
    flights: int
    survived: int
    boundary: float | None
    predicted: float | None = None


def limits(found: pl.DataFrame, key: str) -> list[SurvivalLimit]:
    """Return the limit of each configuration over a varied key with numbers."""
    made = [_limit(found, key, name) for name in found["configuration"].unique(maintain_order=True)]
    rigid = next((limit.boundary for limit in made if limit.configuration == RIGID), None)
    if rigid is None or LOSS not in found.columns:
        return made
    return [_with_prediction(found, key, limit, rigid) for limit in made]


def _limit(found: pl.DataFrame, key: str, configuration: str) -> SurvivalLimit:
    rows = found.filter(pl.col("configuration") == configuration)
    alive = rows.with_columns(pl.col(SURVIVED).fill_null(value=False).cast(pl.Float64))
    table = alive.group_by(key).agg(pl.col(SURVIVED).mean()).sort(key)
    shares = tuple(zip(table[key].to_list(), table[SURVIVED].to_list(), strict=True))
    steps = [
        0.5 * (before[0] + after[0])
        for before, after in pairwise(shares)
        if (before[1] >= 0.5) != (after[1] >= 0.5)
    ]
    survived = int(alive[SURVIVED].sum())
    boundary = steps[0] if len(steps) == 1 else None
    return SurvivalLimit(configuration, shares, len(rows), survived, boundary)


def _with_prediction(
    found: pl.DataFrame, key: str, limit: SurvivalLimit, rigid: float
) -> SurvivalLimit:
    """Add the boundary predicted by the closed form."""
    if limit.boundary is None or limit.configuration == RIGID:
        return limit
    rows = found.filter((pl.col("configuration") == limit.configuration) & pl.col(SURVIVED))
    lost = rows.sort((pl.col(key) - limit.boundary).abs())[LOSS].drop_nulls()
    if not len(lost):
        return limit
    predicted = rigid * (1.0 - float(lost[-1]))
    return replace(limit, predicted=predicted)
