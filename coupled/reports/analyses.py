"""The reports of a rig's authority maps and stability, of a plan, and of readings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from coupled.authority.stability.limits import Limit
from coupled.authority.stability.whole import Stability
from coupled.authority.whole import AuthorityMap
from coupled.calibration.plan import Station
from coupled.calibration.planned import ReadingsPlan
from coupled.calibration.readings import Readings
from coupled.display import percent
from coupled.plots.histories import Figure
from coupled.plots.maps import draw_feel, draw_losses
from coupled.plots.saving import svg_text
from coupled.plots.stability import draw_stability
from coupled.plots.taken import draw_taken
from coupled.record.channels import unit_of
from coupled.reports.page import Cell, Drawing, Made, Mark, Report, Section, Table, Verdict

_LOSSES = "The share of the asked deflection that is lost, over q̄ and deflection."
_FEEL = "Stick force per g and per knot, as specified and with each correction."
_PLANES = "Growth of the motion over K·G_T: stable where it is negative."
_TAKEN = "v₁ against the deflection, a colour a gradient set."


def map_report(found: AuthorityMap, made: Made) -> Report:
    """Return the report of the authority maps: the greatest losses, and the maps."""
    rows = []
    for maps in found.losses.values():
        for one in maps:
            there = one.loss[np.isfinite(one.loss)]
            most = percent(float(there.max())) if there.size else "–"
            rows.append((one.control, one.configuration, most))
    table = Table(("control", "configuration", "lost at most"), tuple(rows), words=2)
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
    """Draw the losses."""
    return draw_losses(found.rig.name, found.losses, found.flown)


def stability_report(found: Stability, made: Made) -> Report:
    """Return the report of a rig's stability: limits and maps."""
    heads = ("", "stable", "simulated", "theory", "filed")
    blocks = []
    for control in found.limits:
        rows = tuple(_limit(limit) for limit in control.limits)
        unit = f"N/{unit_of(control.control)}"
        caption = f"{control.control}: {control.gradient:.4g} {unit}, K·G_T = {control.share:.3g}"
        blocks.append(Table(heads, rows, caption, words=2))
    sections = (
        Section("Limits at the stiffest gradient", tuple(blocks)),
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
    """Draw the maps over K·G_T."""
    return draw_stability(found.rig, found.by_control)


def _limit(limit: Limit) -> tuple[Cell, ...]:
    own = "–" if limit.filed is None else f"{limit.filed:.3g}"
    filed = Mark(f"{own} unstable", "bad") if limit.outside else own
    if limit.simulated is None:
        return limit.kind, limit.stable, f"({limit.least:.3g} to {limit.greatest:.3g})", "", filed
    theory = "–" if limit.theory is None else f"{limit.theory:.4g}"
    return limit.kind, limit.stable, f"{limit.simulated:.4g}", theory, filed


def plan_report(found: ReadingsPlan, made: Made) -> Report:
    """Return the report of a plan: which readings to take, and what grids would give."""
    d = unit_of(found.control)
    heads = ("gradient set", "q̄, kPa", f"G_T, N/{d}", f"δ, {d}", "F, N", "times")
    rows = tuple((*_station(station), str(count)) for station, count in found.chosen)
    sections = (
        Section("Readings to take", (Table(heads, rows),)),
        Section("Grids", (_grids(found),)),
    )
    count, half = found.reached.readings, found.reached.half_width
    said = f"{count} readings give K to ±{percent(half)} (95 %)."
    settings = (("rig", found.rig.name), ("control", found.control))
    return Report("Plan", found.control, Verdict(said), sections, settings, made)


def _station(one: Station) -> tuple[str, ...]:
    numbers = (one.gradient, one.deflection, one.force)
    return one.label, f"{one.pressure_Pa / 1000:.2f}", *(f"{number:.4g}" for number in numbers)


def _grids(found: ReadingsPlan) -> Table:
    sets, many = (sorted({size[i] for size in found.grids}) for i in (0, 1))
    rows = tuple(
        (str(few), *(percent(found.grids[few, n].half_width) for n in many)) for few in sets
    )
    caption = "K to ± (95 %), by gradient sets (rows) and deflections in each (columns)"
    return Table(("", *map(str, many)), rows, caption)


def readings_report(found: Readings, made: Made) -> Report:
    """Return the report of readings: a row each, and v₁ against the deflection."""
    heads = ("row", "gradient set", "deflection, m or rad", "F, N", "v1, V", "v3, V")
    sections = (
        Section("Readings", (Table(heads, tuple(_readings(found)), words=2),)),
        Section("Figure", (Drawing(svg_text(draw_taken(found)), _TAKEN),)),
    )
    said = repr(found).removeprefix("Readings(").removesuffix(")") + "."
    settings = (("readings", str(len(found.row))),)
    return Report("Readings", "Readings", Verdict(said), sections, settings, made)


def _readings(found: Readings) -> Iterator[tuple[str, ...]]:
    for i, row in enumerate(found.row.tolist()):
        numbers = (found.deflection[i], found.force[i], found.v1[i], found.v3[i])
        yield str(row), found.label[i], *(f"{float(n):.4g}" for n in numbers)
