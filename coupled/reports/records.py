"""The reports of a record, of a flight, and of a nominal rig fitted to records."""

from __future__ import annotations

import numpy as np

from coupled.authority.compare import Flight
from coupled.authority.figures import named, remarks
from coupled.display import percent
from coupled.gap.nominal import NominalFit
from coupled.plots.fits import draw_fit
from coupled.plots.histories import Figure, draw_record
from coupled.plots.saving import svg_text
from coupled.record.record import Record
from coupled.reports.page import Drawing, Provenance, Report, Section, Text, Verdict
from coupled.tables.flights import comparison_table, record_table
from coupled.tables.gaps import channels_table, numbers_table

_HISTORY = "The record over time."
_FITTED = "Each fitted over filed value, with its 95 % interval."


def record_report(record: Record, made: Provenance) -> Report:
    """Return the report of a record: its time histories, and the range of each channel."""
    sections = (
        Section("Time histories", (Drawing(svg_text(draw_record(record)), _HISTORY),)),
        Section("Channels", (record_table(record),)),
    )
    ended = record.ended_early
    said = repr(record).removeprefix("Record(").removesuffix(")")
    why = () if ended is None else (f"It ended early: {ended}.",)
    verdict = Verdict(f"{said}.", "plain" if ended is None else "bad", why)
    return Report("Record", "Record", verdict, sections, (("rows", str(len(record))),), made)


def flight_report(flight: Flight, made: Provenance) -> Report:
    """Return the report of a flight: its figures of merit, and its time histories."""
    table = comparison_table([flight])
    history = Drawing(svg_text(draw_flight(flight)), _HISTORY)
    sections = (Section("Figures", (table,)), Section("Time histories", (history,)))
    loss, run = flight.outcome.loss, flight.manoeuvre
    said = "No share of authority is computed: the flight has no held command."
    if np.isfinite(loss):
        said = f"Authority lost: {percent(loss)}; felt of the specified gradient:"
        said += f" {flight.outcome.felt_ratio:.3f}."
    ended = (f"It ended early: {flight.ended_early}.",) if flight.ended_early else ()
    verdict = Verdict(said, "bad" if ended else "plain", (*ended, *remarks([flight])))
    settings = (
        *(("rig", run.rig.name), ("control", run.control), ("configuration", named(flight))),
        ("length", f"{run.duration_s:g} s"),
        ("seed", str(run.seed)),
    )
    return Report("Flight", run.label, verdict, sections, settings, made)


def draw_flight(flight: Flight) -> Figure:
    """Return the figure of the time histories of a flight."""
    return draw_record(flight.record, f"{flight.manoeuvre.label}, {flight.configuration}")


def fit_report(found: NominalFit, made: Provenance) -> Report:
    """Return the report of a fitted rig: its parameters, and the residual of each channel."""
    sections = [
        Section("Numbers", (numbers_table(found.numbers),)),
        Section("Fit", (Drawing(svg_text(draw_fit(found)), _FITTED),)),
        Section("Channels", (channels_table(found.channels),)),
    ]
    lines = [f"Not distinguished: {one.words}." for one in found.alike]
    lines += [f"Not determined: {key}." for key in found.unknown]
    lines += [f"At its bound: {n.key}." for n in found.numbers if n.at_bound]
    if lines:
        sections.insert(1, Section("What the records do not determine", (Text(tuple(lines)),)))
    known = len(found.numbers) - len(found.unknown)
    said = f"{known} of {len(found.numbers)} numbers are determined by the records."
    verdict = Verdict(said, "bad" if found.doubts else "plain", found.doubts)
    settings = (("rig", found.rig.name), ("control", found.control))
    return Report("Fit", found.rig.name, verdict, tuple(sections), settings, made)
