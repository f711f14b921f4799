"""An expectation compared with its flight: the figure, its bounds, and the margin.

An expectation that could not be judged has a reason, and has failed.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.authority.compare import Flight
from coupled.campaign.standards import StandardFigure, judge_standard
from coupled.display import System, shown, unit_in
from coupled.flight.expectation import Expect, UnjudgedError
from coupled.record.channels import TIME

Floats = NDArray[np.float64]
Bounds = tuple[float | None, float | None]


@dataclass(frozen=True)
class Verdict:
    """The verdict on one expectation of one flight; `value` and bounds in one unit.

    `problem` is the reason why there is no figure. `quantity` is a name that ends in the unit of
    value and bounds, such as `force_N`. `at_s` is the time of the figure in the flight, None if it
    has none; `why` is the run's own reason for its bounds.
    """

    run: str
    case: str
    configuration: str
    what: str
    value: float | None
    least: float | None
    most: float | None
    problem: str = ""
    quantity: str = ""
    at_s: float | None = None
    why: str = ""

    @property
    def margin(self) -> float | None:
        """The distance of the figure from its nearest bound, in its unit; negative outside."""
        return None if self.value is None else _margin(self.value, (self.least, self.most))

    @property
    def passed(self) -> bool:
        """Whether there is a figure within its bounds."""
        return self.margin is not None and self.margin >= 0.0

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        table = {key: value for key, value in self.__dict__.items() if key != "quantity"}
        unit = unit_in(self.quantity).replace("_per_", "/")
        return {**table, "unit": unit, "margin": self.margin, "passed": self.passed}


def wanted(verdict: Verdict, system: System = "si") -> str:
    """Return the bounds with their unit, as `0.2 to 0.3 N`, `≥ 0.2 N` or `≤ 0.3 N`."""
    unit = shown(verdict.quantity, system)
    least, most = (
        None if bound is None else unit.written(bound) for bound in (verdict.least, verdict.most)
    )
    if least is not None and most is not None:
        text = f"{least} to {most}"
    elif least is not None:
        text = f"≥ {least}"
    else:
        text = "" if most is None else f"≤ {most}"
    return f"{text} {unit.unit}".strip() if text else ""


def figures(verdict: Verdict, system: System = "si") -> tuple[str, str]:
    """Return the figure and its margin, each with its unit; a dash if there is none."""
    if verdict.value is None or verdict.margin is None:
        return "–", "–"
    unit = shown(verdict.quantity, system)
    pair = (unit.written(verdict.value), unit.written(verdict.margin, 2))
    found, margin = (f"{text} {unit.unit}".strip() for text in pair)
    return found, margin


def verdict_line(verdict: Verdict, system: System = "si") -> str:
    """Return the result in one line."""
    bounds = f" (wanted {wanted(verdict, system)})" if wanted(verdict) else ""
    if verdict.value is None or verdict.margin is None:
        return verdict.problem + bounds
    found, margin = figures(verdict, system)
    return f"{found}{bounds}, margin {margin}"


def verdict_text(verdict: Verdict, system: System = "si") -> str:
    """Return a verdict for people, in lines: measured, expected, margin, time, and why."""
    found, margin = figures(verdict, system)
    head = f"{verdict.run}, {verdict.case} [{verdict.configuration}]: {verdict.what}"
    lines = [f"measured  {verdict.problem if verdict.value is None else found}"]
    lines.append(f"expected  {wanted(verdict, system) or '–'}")
    if verdict.value is not None:
        lines.append(f"margin    {margin}")
    if verdict.at_s is not None:
        lines.append(f"time      {verdict.at_s:.4g} s")
    if verdict.why:
        lines.append(f"why       {verdict.why}")
    return "\n  ".join([head, *lines])


def judge_expectation(expect: Expect, flight: Flight | None, other: Flight | None) -> Verdict:
    """Return the verdict on a flight, compared with `other` if the expectation requires it."""
    if flight is None or (expect.reference is not None and other is None):
        raise UnjudgedError("was not flown")
    figure = _figure(expect, flight, other)
    if not math.isfinite(figure.value):
        raise UnjudgedError("the flight has no such figure")
    run = flight.manoeuvre
    what = expect.words + figure.note
    bounds = (figure.least, figure.most)
    where = (run.name, run.label, flight.configuration, what)
    why = expect.why or ""
    return Verdict(
        *where, figure.value, *bounds, quantity=expect.quantity, at_s=figure.at_s, why=why
    )


def _figure(expect: Expect, flight: Flight, other: Flight | None) -> StandardFigure:
    if expect.channel is None:
        for flown in filter(None, (flight, other)):
            if flown.outcome.ended_early:
                raise UnjudgedError(f"the flight ended early: {flown.outcome.ended_early}")
    if expect.standard is not None:
        return judge_standard(expect.standard, expect.control, flight, other)
    at_s: float | None = None
    if expect.measure is not None:
        value = _measured(expect.measure, flight)
        if other is not None:
            value -= _measured(expect.measure, other)
    elif expect.reaches is not None:
        value = at_s = _time_reached(expect, flight)
    else:
        value, at_s = _channel_value(expect, flight, other)
    return StandardFigure(value, *expect.bounds, at_s=at_s)


def _measured(name: str, flight: Flight) -> float:
    value: float | None = getattr(flight.outcome, name)
    return math.nan if value is None else value


def _window(expect: Expect, flight: Flight, end_s: float) -> tuple[Floats, Floats]:
    """Return the times in s, and the channel, from `from_s` to an end."""
    assert expect.channel is not None
    record = flight.record
    rows = (record.time_s >= (expect.start or 0.0)) & (record.time_s <= end_s)
    if not rows.any():
        raise UnjudgedError("no row of the record lies there")
    return record[TIME][rows], record[expect.channel][rows]


def _refuse_early(flight: Flight, end_s: float) -> None:
    ended = flight.record.manifest["ended_early"]
    if ended and (not len(flight.record) or flight.record.time_s[-1] < end_s):
        raise UnjudgedError(f"the flight ended early: {flight.outcome.ended_early}")


def _channel_value(
    expect: Expect, flight: Flight, other: Flight | None
) -> tuple[float, float | None]:
    """Return the figure of a channel and its time; of all rows, the one closest to its bound.

    A mean has no time.
    """
    last_s = flight.manoeuvre.duration_s if expect.end is None else expect.end
    end_s = last_s if expect.at is None else expect.at
    flights = [flight] if other is None else [flight, other]
    for flown in flights:
        _refuse_early(flown, end_s)
    if expect.at is not None:
        windows = [_window(expect, flown, math.inf) for flown in flights]
        times = np.array([expect.at])
        figures = [np.interp(times, *window) for window in windows]
    else:
        windows = [_window(expect, flown, end_s) for flown in flights]
        times, figures = windows[0][0], [window[1] for window in windows]
    values = figures[0] - figures[1] if len(figures) > 1 else figures[0]
    if expect.take == "mean":
        return float(np.mean(values)), None
    ends = (int(np.argmin(values)), int(np.argmax(values)))
    row = {
        "lowest": ends[0],
        "greatest": ends[1],
        "last": -1,
        "every": min(ends, key=lambda one: _margin(float(values[one]), expect.bounds)),
    }[expect.take]
    return float(values[row]), float(times[row])


def _time_reached(expect: Expect, flight: Flight) -> float:
    """Return when the channel first reaches the level, interpolated between rows, in s."""
    assert expect.reaches is not None
    end_s = flight.manoeuvre.duration_s if expect.end is None else expect.end
    times, values = _window(expect, flight, end_s)
    over = values - expect.reaches
    met = np.flatnonzero(np.append(over[:-1] * over[1:] <= 0.0, over[-1] == 0.0))
    if not met.size:
        _refuse_early(flight, end_s)
        raise UnjudgedError(f"never reached; at last it is {values[-1]:.4g}")
    i = int(met[0])
    if over[i] == 0.0:
        return float(times[i])
    return float(times[i] + (times[i + 1] - times[i]) * over[i] / (over[i] - over[i + 1]))


def _margin(value: float, bounds: Bounds) -> float:
    least, most = bounds
    margins = [] if least is None else [value - least]
    return min(margins if most is None else [*margins, most - value])
