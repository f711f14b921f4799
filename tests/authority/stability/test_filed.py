"""The rig's own value: marked on each map of stability, and flagged where it is unstable."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from rich.console import Console

from coupled.authority.stability.limits import Limit, StabilityLimits, filed
from coupled.authority.stability.planes import KINDS, Kind, Plane, axis
from coupled.cli.tables import print_table
from coupled.plots.stability import draw_stability
from coupled.tables.stability import limits_table
from tests.support.rigs import bench

SERVO = Limit("servo", "above", 34.4, 34.4, 2.0, 200.0, filed=18.0)


@pytest.mark.parametrize(
    ("stable", "limit", "own", "outside"),
    [
        ("above", 34.4, 18.0, True),
        ("above", 34.4, 60.0, False),
        ("below", 142.0, 8.3, False),
        ("below", 142.0, 150.0, True),
        ("below", 142.0, None, False),
        ("everywhere", None, 1.0, False),
        ("nowhere", None, 1.0, True),
    ],
)
def test_outside_is_on_the_unstable_side(
    stable: str, limit: float | None, own: float | None, outside: bool
) -> None:
    assert Limit("servo", stable, limit, limit, 2.0, 200.0, own).outside == outside


def test_the_table_flags_what_is_filed_outside() -> None:
    console = Console(width=80, record=True)
    good = replace(SERVO, filed=60.0)
    limits = [StabilityLimits("column", 2189.0, 0.2, (SERVO, good), ())]
    print_table(console, limits_table(limits, None))
    rows = [line.split() for line in console.export_text().splitlines() if "servo" in line]
    assert [row[-2:] for row in rows] == [["18", "unstable"], ["34.4", "60"]]


def flat(kind: Kind) -> Plane:
    """Return a map on which nothing grows."""
    shares, values = np.linspace(0.02, 1.2, 5), axis(kind, 6)
    cells = np.full((5, 6), -5.0)
    return Plane("column", kind, shares, values, cells, cells, shares, values, cells, ())


def heights(axes: Axes) -> list[float]:
    """Return where the lines that mark the rig's own value lie."""
    drawn = (np.asarray(line.get_ydata(), dtype=float) for line in axes.lines)
    return [float(height[0]) for height in drawn if height.size]


def test_what_is_filed_is_on_the_map_or_at_its_edge() -> None:
    rig = bench({"servo_frequency_Hz": 400.0})
    assert filed(rig, "column", "servo") == 400.0
    figure = draw_stability(rig, {"column": [flat(kind) for kind in KINDS]})
    panels = {axes.get_title().removeprefix("column, "): axes for axes in figure.axes}
    servo, frame = panels["held fast"], panels["free hand, digital product"]
    assert servo.get_ylim() == pytest.approx((2.0, 200.0))
    assert heights(servo) == pytest.approx([200.0] * 3)
    assert [text.get_text() for text in servo.texts] == ["400"]
    assert heights(frame) == pytest.approx([1000.0 / rig.frame_rate] * 2)
    for axes in figure.axes[:6]:
        assert (axes.get_yscale() == "log") == ("(logarithmic)" in axes.get_ylabel())
