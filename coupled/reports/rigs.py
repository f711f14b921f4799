"""The reports of a rig, of JSBSim models, and of a rig exported to JSBSim."""

from __future__ import annotations

from collections.abc import Iterator

from coupled.display import percent
from coupled.errors import listed
from coupled.exporting.write import Export
from coupled.plots.rigs import draw_rig
from coupled.plots.saving import svg_text
from coupled.record.channels import unit_of
from coupled.reports.page import Drawing, Provenance, Report, Section, Text, Verdict
from coupled.rig.equations import uncompensated_loss
from coupled.rig.parameters import Control
from coupled.rig.rig import Rig
from coupled.surveying.modelsurvey import Survey
from coupled.surveying.terms import ModelTerms
from coupled.tables.flights import export_table
from coupled.tables.rigs import models_table, terms_table
from coupled.tables.table import Table

_SHOWN = "G_T over q̄, and the share lost to compliance if the host corrects nothing."


def rig_report(rig: Rig, made: Provenance) -> Report:
    """Return the report of a rig: a table of its controls, and their gradients."""
    heads = ("", *rig.controls)
    columns = [list(_numbers(name, control)) for name, control in rig.controls.items()]
    table = Table(
        heads,
        tuple((rows[0][0], *(value for _, value in rows)) for rows in zip(*columns, strict=True)),
    )
    drawn = (Drawing(svg_text(draw_rig(rig)), _SHOWN),) if rig.controls else ()
    sections = (Section("Controls", (table,)), Section("Gradients", drawn)) if drawn else ()
    aircraft = "none" if rig.flight is None else rig.flight.model
    settings = (
        ("rig", rig.name),
        ("aircraft", aircraft),
        ("frame rate", f"{rig.frame_rate:g} Hz, {rig.substeps} substeps of the rig a frame"),
    )
    bent = [name for name, control in rig.controls.items() if control.loader.bend > 0.0]
    under = f"bends under {listed(bent)}" if bent else "is rigid"
    said = f"Aircraft: {aircraft}; {rig.frame_rate:g} Hz. The structure {under}."
    return Report("Rig", rig.name, Verdict(said), sections, settings, made)


def _numbers(name: str, control: Control) -> Iterator[tuple[str, str]]:
    """Yield the main parameters of a control, each with its label and unit."""
    d, loader, host = unit_of(name), control.loader, control.compensation
    gradients = control.schedule.gradients
    yield "travel", f"±{control.travel:.4g} {d}"
    yield "mass", f"{loader.mass:.4g} kg"
    yield "damping", f"{loader.damping:.4g} N·s/{d}"
    yield "breakout", f"{loader.breakout:.4g} N"
    yield "friction", f"{loader.friction:.4g} N"
    what = "steepest gradient of the curve" if control.schedule.curved else "gradient G_T"
    yield what, f"{min(gradients):.4g} to {max(gradients):.4g} N/{d}"
    yield "bend K", f"{loader.bend:.4g} {d}/N"
    yield "  lost at most, uncorrected", percent(uncompensated_loss(loader.bend, max(gradients)))
    yield "host's K̂", f"{host.bend:.4g} {d}/N"
    words = {"deflection": host.deflection, "gradient": host.gradient}
    yield "  corrects", ", ".join(word for word, on in words.items() if on) or "nothing"


def survey_report(found: Survey, made: Provenance) -> Report:
    """Return the report of a survey of JSBSim models: one row each."""
    table = models_table(found.models)
    trimmed = [one for one in found if one.flight is not None]
    led = sum(bool(one.controls) for one in trimmed)
    said = f"{len(trimmed)} of {len(found)} trim, {led} can be flown by a rig."
    settings = (("models", str(len(found))),)
    return Report("Models", "JSBSim", Verdict(said), (Section("Models", (table,)),), settings, made)


def terms_report(found: ModelTerms, made: Provenance) -> Report:
    """Return the report of the terms of a model: one row each."""
    said = f"{len(found)} named functions; shares in {found.flown}."
    settings = (("model", found.model),)
    section = Section("Terms", (terms_table(found),))
    return Report("Terms", found.model, Verdict(said), (section,), settings, made)


def export_report(found: Export, made: Provenance) -> Report:
    """Return the report of an export: the differences of JSBSim's flights from our own."""
    sections = [Section("Flights by JSBSim alone", (export_table(found),))]
    lines = [f"Left out: {line}" for line in found.left]
    lines += [f"By the scripts only: {line}" for line in found.scripted]
    if lines:
        sections.append(Section("What the export lacks", (Text(tuple(lines)),)))
    near = "are within the limits of our own" if found.within else "are outside the limits"
    said = f"{len(found.files)} files; {len(found.beside)} flights {near}."
    settings = (("rig", found.rig.name), ("steps of the loader a run", str(found.substeps)))
    verdict = Verdict(said, "good" if found.within else "bad")
    return Report("Export", found.rig.name, verdict, tuple(sections), settings, made)
