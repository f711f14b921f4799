"""A comparison's figure: force steps where a hand feels them, and no panels of nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from coupled.authority.compare import Flight, compare
from coupled.flight.runfile import read_run
from coupled.plots.flights import draw_comparison


@pytest.fixture(scope="module")
def once() -> list[Flight]:
    """Return flights of two cases, each in one configuration only, without steps to feel."""
    case = read_run("appendix-c")[0]
    short = replace(case, duration_s=2.0, configurations=("compensated",))
    return list(compare([replace(short, label="a"), replace(short, label="b")]))


def test_without_steps_to_feel_the_cases_are_drawn(once: list[Flight]) -> None:
    figure = draw_comparison(once)
    assert {axes.get_ylabel() for axes in figure.axes} >= {"pilot's force, N", "%"}
    assert all(axes.get_legend() is None or axes.get_title() == "" for axes in figure.axes)


def test_steps_that_are_felt_have_a_panel_a_case(once: list[Flight]) -> None:
    felt = [replace(f, outcome=replace(f.outcome, force_step_N=10.0)) for f in once]
    figure = draw_comparison(felt)
    assert [axes.get_title() for axes in figure.axes] == ["a", "b"]
    assert "step of the modifying force" in figure.get_supylabel()
