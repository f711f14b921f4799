"""Reports of authority maps, of the stability of a rig, of a reading plan, and of readings."""

from __future__ import annotations

import numpy as np

from coupled.authority.authoritymap import AuthorityMap
from coupled.authority.stability.stabilitymap import Stability
from coupled.calibration.readings import Readings
from coupled.calibration.readingsplan import ReadingsPlan
from coupled.display import percent
from coupled.plots.histories import Figure
from coupled.plots.maps import draw_feel, draw_losses
from coupled.plots.raw_readings import draw_raw_readings
from coupled.plots.saving import svg_text
from coupled.plots.stability import draw_stability
from coupled.reports.page import Drawing, Provenance, Report, Section, Verdict
from coupled.tables.calibration import grids_table, plan_table, readings_table
from coupled.tables.stability import limits_table
from coupled.tables.table import Table

_LOSSES = "The share of the requested deflection that is lost, over q̄ and deflection."
_FEEL = "Stick force per g and per knot, as specified and with each correction."
_PLANES = "Growth rate of the motion over K·G_T: stable if negative."
_READINGS = "v₁ against the deflection, one colour per gradient set."


def map_report(found: AuthorityMap, made: Provenance) -> Report:
    """Return the report of the authority maps: the greatest losses, and the maps."""
    rows = []
    for maps in found.losses.values():
        for one in maps:
            there = one.loss[np.isfinite(one.loss)]
            most = percent(float(there.max())) if there.size else "–"
            rows.append((one.control, one.configuration, most))
    table = Table(("control", "configuration", "lost at most"), tuple(rows), align="llr")
    sections = [
        Section("Losses", (table, Drawing(svg_text(draw_map(found)), _LOSSES))),
    ]
    if found.feel is not None:
        drawn = Drawing(svg_text(draw_feel(found.rig.name, found.feel)), _FEEL)
        sections.append(Section("Stick force", (drawn,)))
    said = repr(found).removeprefix(f"AuthorityMap({found.rig.name}: ").removesuffix(")")
    verdict = Verdict(f"{said[0].upper()}{said[1:]}, over all configurations.")
    settings = (("rig", found.rig.name),)
    return Report("Authority map", found.rig.name, verdict, tuple(sections), settings, made)


def draw_map(found: AuthorityMap) -> Figure:
    """Return the figure of the losses."""
    return draw_losses(found.rig.name, found.losses, found.flown)


def stability_report(found: Stability, made: Provenance) -> Report:
    """Return the report of the stability of a rig: limits and maps."""
    sections = (
        Section("Limits at the stiffest gradient", (limits_table(found.limits, found.bob_weight),)),
        Section("Maps", (Drawing(svg_text(draw_planes(found)), _PLANES),)),
    )
    out = [
        f"{control.control}: {limit.kind} of {limit.filed:.3g} is unstable."
        for control in found.limits
        for limit in control.limits
        if limit.outside and limit.filed is not None
    ]
    words = "stable" if found.stable else "unstable"
    said = f"As filed, the rig is {words}."
    apart = f"{found.disagreement.words}."
    verdict = Verdict(said, "good" if found.stable else "bad", (*out, apart))
    settings = (("rig", found.rig.name),)
    return Report("Stability", found.rig.name, verdict, sections, settings, made)


def draw_planes(found: Stability) -> Figure:
    """Return the figure of the stability maps over K·G_T."""
    return draw_stability(found.rig, found.by_control)


def plan_report(found: ReadingsPlan, made: Provenance) -> Report:
    """Return the report of a plan: the readings to take, and the precision of reading grids."""
    sections = (
        Section("Readings to take", (plan_table(found),)),
        Section("Grids", (grids_table(found),)),
    )
    count, half = found.reached.readings, found.reached.half_width
    said = f"{count} readings give K to ±{percent(half)} (95 %)."
    settings = (("rig", found.rig.name), ("control", found.control))
    return Report("Plan", found.control, Verdict(said), sections, settings, made)


def readings_report(found: Readings, made: Provenance) -> Report:
    """Return the report of readings: one row each, and v₁ against the deflection."""
    sections = (
        Section("Readings", (readings_table(found),)),
        Section("Figure", (Drawing(svg_text(draw_raw_readings(found)), _READINGS),)),
    )
    said = repr(found).removeprefix("Readings(").removesuffix(")") + "."
    settings = (("readings", str(len(found.row))),)
    return Report("Readings", "Readings", Verdict(said), sections, settings, made)
