"""The tables of a rig, of JSBSim models, of the shipped runs, and of a logged control."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from coupled.display import System, in_system, percent
from coupled.tables.table import Mark, Row, Table

if TYPE_CHECKING:
    from coupled.surveying.benchrig import Question
    from coupled.surveying.survey import Surveyed
    from coupled.surveying.terms import ModelTerms


def models_table(models: Sequence[Surveyed]) -> Table:
    """Return where each model trims or why not, how its controls move, and its rigs."""
    heads = ("model", "trims at", "controls", "rigs")
    return Table(heads, tuple(map(_model, models)), align="l")


def _model(one: Surveyed) -> Row:
    if one.flight is None:
        return one.model, Mark(f"no: {one.why}", "bad"), "", ", ".join(one.rigs)
    held = "" if one.holds else ", does not hold"
    speed, height = one.flight.calibrated_airspeed, one.flight.altitude
    controls = ", ".join(one.controls) or "none"
    controls += "" if one.direct or not one.controls else " (by a law or lag)"
    return one.model, f"{speed:g} m/s, {height:g} m{held}", controls, ", ".join(one.rigs)


def terms_table(found: ModelTerms) -> Table:
    """Return the axis of each named function of a model, and its share of the axis."""
    rows = tuple(
        (one.term, one.axis, "" if one.share is None else percent(one.share)) for one in found
    )
    return Table(("term", "axis", "share"), rows, align="llr")


def runs_table(cards: Mapping[str, Mapping[str, Any]]) -> Table:
    """Return the rig of each run file, and the first sentence of its description."""
    rows = tuple((name, card["rig"], _sentence(card["card"])) for name, card in cards.items())
    return Table(("run", "rig", "what it shows"), rows, align="l")


def _sentence(card: str) -> str:
    """Return the first sentence of a description."""
    return " ".join(card.split()).partition(". ")[0].rstrip(".") + "."


def logged_table(
    numbers: Mapping[str, float],
    determined: Collection[str],
    questions: Mapping[str, Question],
    system: System = "si",
) -> Table:
    """Return the parameters of a control from a log, and whether the log determines each."""
    rows = []
    for name, value in numbers.items():
        question = questions[name]
        unit = in_system(question.unit, system)
        words = "determined" if name in determined else "the log does not determine it: a guess"
        if name == "travel":
            words = "the greatest in the log: a guess"
        rows.append((question.words, f"{unit.written(value)} {unit.unit}", words))
    return Table(("of the log", "value", ""), tuple(rows), align="l")
