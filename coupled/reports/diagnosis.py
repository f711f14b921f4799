"""The report of a diagnosis: verdict, tables and figures."""

from __future__ import annotations

from collections.abc import Iterator

from coupled.display import System
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.summary import sentences, summary_in
from coupled.plots.gaps import draw_parts
from coupled.plots.saving import svg_text
from coupled.reports.page import Drawing, Provenance, Report, Section, Verdict
from coupled.tables.gaps import (
    curve_table,
    effects_table,
    flown_again_table,
    in_flight_table,
    keys_table,
    next_tests_table,
    power_table,
    shrink_table,
    stages_table,
)
from coupled.tables.table import Table, Tone

_TONES: dict[str, Tone] = {"no_gap": "good", "ambiguous": "bad", "unexplained": "bad"}
_CAPTIONS = {
    "ladder.png": "What was tried, and how much each effect gains; how the gap falls with it.",
    "stages.png": "Each stage of the chain: its residual over its noise floor.",
    "curves.png": "Functions of one signal that describe what no effect explains; no causes.",
    "signature.png": "The law of what was found, as measured, as filed, and as found.",
}


def diagnosis_report(
    whole: Diagnosis, title: str, made: Provenance, with_power: bool = False, system: System = "si"
) -> Report:
    """Return the report; `with_power` adds the least detectable size of each effect."""
    sections = [Section(head, tables) for head, tables in _tables(whole, with_power, system)]
    for part, drawn in draw_parts(whole, system).items():
        figures = (Drawing(svg_text(each), _CAPTIONS[name]) for name, each in drawn.items())
        head = f"Figures: {part}" if len(whole.parts) > 1 else "Figures"
        sections.append(Section(head, tuple(figures)))
    settings = (
        ("rig", whole.nominal.name),
        ("controls" if whole.controls else "stage", ", ".join(whole.controls) or whole.control),
        ("records", f"{len(whole.records)}, {_seconds(whole):.4g} s in all"),
    )
    return Report("Diagnosis", title, _verdict(whole, system), tuple(sections), settings, made)


def _seconds(whole: Diagnosis) -> float:
    return sum(float(record.time_s[-1] - record.time_s[0]) for record in whole.records.values())


def _verdict(whole: Diagnosis, system: System) -> Verdict:
    first, *rest = sentences(summary_in(whole.summary, whole.effects, system))
    return Verdict(first, _TONES.get(whole.verdict, "plain"), tuple(rest))


def _tables(
    whole: Diagnosis, with_power: bool, system: System
) -> Iterator[tuple[str, tuple[Table, ...]]]:
    """Yield the heading and the tables of each section."""
    if whole.effects:
        keys = keys_table(whole.effects, system)
        yield "Effects found", (effects_table(whole.effects, whole.budget, system), keys)
    yield "Stages of the chain", (stages_table(whole.stages),)
    if whole.effects:
        yield "How far the gap shrinks", (shrink_table(whole.shrink.channels, system),)
    if whole.curves:
        shrunk = shrink_table(whole.shrunk_by_curves, system, "with the curves")
        yield "Curves", (*(curve_table(one, system) for one in whole.curves), shrunk)
    if (again := flown_again_table(whole, system)) is not None:
        yield "Flown again with the record's pilot", (again,)
    if whole.in_flight is not None:
        yield "Change of the flight", (in_flight_table(whole.in_flight, system),)
    if whole.next_tests:
        yield "What to record next", (next_tests_table(whole.next_tests),)
    if with_power:
        yield "What these records would have shown", (power_table(whole.power, system),)
