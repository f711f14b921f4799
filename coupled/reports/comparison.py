"""The report of a comparison: the authority lost in each configuration, and the flights."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from coupled.authority.compare import Flight
from coupled.authority.figures import cases_of, flown_once, named, remarks, tabulated
from coupled.display import System
from coupled.flight.manoeuvre import Manoeuvre
from coupled.plots.flights import draw_comparison
from coupled.plots.saving import svg_text
from coupled.reports.page import Drawing, Provenance, Report, Section, Verdict
from coupled.tables.flights import comparison_table

_SHOWN = (
    "Surface command, motion, force against true deflection, and authority lost. Gray: specified."
)
_STEPS = "Steps of the modifying force from frame to frame, which the hand feels."


def comparison_report(flights: Sequence[Flight], made: Provenance, system: System = "si") -> Report:
    """Return the report: table and figure per case, or one of all if each has one flight."""
    groups, once = tabulated(flights), flown_once(cases_of(flights))
    run = flights[0].manoeuvre
    sections = [
        Section(
            "All cases" if once else case[0].outcome.case,
            (
                comparison_table(case, system),
                Drawing(svg_text(draw_comparison(case, system)), shown),
            ),
            own_page=i > 0,
        )
        for i, case in enumerate(groups)
        for shown in [_STEPS if once else _SHOWN]
    ]
    return Report(
        "Comparison",
        run.name,
        _verdict(flights, system),
        tuple(sections),
        tuple(_settings(run)),
        made,
    )


def _verdict(flights: Sequence[Flight], system: System) -> Verdict:
    """Return the authority lost and the felt gradient of each configuration over all cases."""
    lost, felt = [], []
    for configuration in dict.fromkeys(f.configuration for f in flights):
        if configuration == "rigid":
            continue
        ours = [f.outcome for f in flights if f.configuration == configuration]
        shown = named(next(f for f in flights if f.configuration == configuration))
        lost.append(f"{shown} {_span([100.0 * o.loss for o in ours], 1)} %")
        felt.append(f"{shown} {_span([o.felt_ratio for o in ours], 3)}")
    run = flights[0].manoeuvre
    said_beside = [
        f"Felt of the specified gradient: {', '.join(felt)}.",
        *remarks(flights, system),
        " ".join(run.card.split()),
    ]
    ended = [
        f"{f.outcome.case}, {f.configuration}: ended early, {f.ended_early}."
        for f in flights
        if f.ended_early
    ]
    said = f"Authority lost: {', '.join(lost)}."
    return Verdict(said, "bad" if ended else "plain", tuple(filter(None, [*ended, *said_beside])))


def _span(values: Iterable[float], decimals: int) -> str:
    """Return the least and the greatest value, or the single value if all are equal."""
    there = [value for value in values if math.isfinite(value)]
    if not there:
        return "–"
    ends = [f"{end:.{decimals}f}" for end in (min(there), max(there))]
    low, high = (end.lstrip("-") if float(end) == 0.0 else end for end in ends)
    return low if low == high else f"{low} to {high}"


def _settings(run: Manoeuvre) -> Iterable[tuple[str, str]]:
    """Yield the settings that the flights share."""
    rig = run.rig
    yield "run", run.name
    yield "rig", rig.name
    yield "aircraft", rig.flight.model if rig.flight is not None else "none, on the bench"
    yield "control", run.control
    pilots = (f"{p.title} on the {control}" for control, p in run.pilots.items())
    yield "pilot", ", ".join(pilots)
    yield "length of a flight", f"{run.duration_s:g} s"
    yield "frame rate", f"{rig.frame_rate:g} Hz, {rig.substeps} substeps of the rig a frame"
    yield "seed", str(run.seed)
