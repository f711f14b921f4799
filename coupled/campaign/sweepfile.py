"""The keys of a sweep file."""

from __future__ import annotations

from typing import Any, Literal

from coupled.flight.expectation import Figure
from coupled.flight.manoeuvre import Configuration
from coupled.rig.parameters import PlainName
from coupled.schema import Section, quantity

MOST_FLIGHTS = 1_000_000
FIGURES: tuple[Figure, ...] = ("loss", "felt_ratio", "force_N", "peak_rate_rad_per_s")


class Vary(Section):
    """A parameter and its values: a list, or a range. `also` are further keys with its value."""

    key: str = quantity("", min_length=1, max_length=200)
    also: list[str] = []
    values: list[Any] | None = quantity("", None, min_length=1)
    low: float | None = None
    high: float | None = None
    steps: int | None = quantity("", None, ge=2, le=10_000)
    spread: Literal["even", "log"] = "even"


class Survive(Section):
    """A condition of survival: a channel within bounds, in every row."""

    channel: str = quantity("", min_length=1)
    least: float | None = None
    most: float | None = None


class SweepFile(Section):
    """The keys of a sweep file."""

    name: PlainName
    run: str = quantity("", min_length=1)
    case: str | None = None
    configurations: list[Configuration] = []
    method: Literal["grid", "sobol", "random", "sensitivity"] = "grid"
    samples: int | None = quantity("", None, ge=1, le=MOST_FLIGHTS)
    seed: int = quantity("", 0, ge=0)
    reseed: bool = False
    keep: list[Figure] = quantity("", list(FIGURES), min_length=1)
    extremes: list[str] = []
    survive: list[Survive] = []
    vary: list[Vary] = quantity("", min_length=1)
