"""The report of a diagnosis: what is wrong, how sure that is, and the figures that show it."""

from __future__ import annotations

from collections.abc import Iterator

from coupled.display import System, percent
from coupled.gap.findings.budget import share_of
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.power import EffectPower
from coupled.gap.findings.result import EffectResult, ParameterEstimate, StageResult
from coupled.gap.findings.shrink import ChannelShrink
from coupled.gap.findings.summary import (
    figure,
    in_units,
    plain,
    sentences,
    size_in,
    summary_in,
)
from coupled.plots.gaps import draw_diagnosis
from coupled.plots.gapview import channel_label, unit_shown
from coupled.plots.saving import svg_text
from coupled.reports.page import Drawing, Made, Mark, Report, Section, Table, Tone, Verdict

_TONES: dict[str, Tone] = {"no_gap": "good", "ambiguous": "bad", "unexplained": "bad"}
_CAPTIONS = {
    "ladder.png": "What was tried, and how much each effect gains; how the gap falls with it.",
    "stages.png": "Each stage of the chain: its residual over what noise alone leaves.",
    "signature.png": "The law of what was found, as measured, as filed, and as found.",
}


def diagnosis_report(
    whole: Diagnosis, title: str, made: Made, with_power: bool = False, system: System = "si"
) -> Report:
    """Return the report; with the least sizes that would have shown, where they are asked for."""
    tables = [_effects(whole, system), _stages(whole), _shrink(whole, system)]
    tables += [_again(whole, system), _in_flight(whole, system)]
    tables.append(_next(whole))
    if with_power:
        tables.append(_power(whole, system))
    sections = [Section(head, (table,)) for head, table in filter(None, tables)]
    drawn = draw_diagnosis(whole, system)
    figures = (Drawing(svg_text(each), _CAPTIONS[name]) for name, each in drawn.items())
    sections.append(Section("Figures", tuple(figures)))
    settings = (
        ("rig", whole.nominal.name),
        ("control", whole.control),
        ("records", f"{len(whole.records)}, {_seconds(whole):.4g} s in all"),
    )
    return Report("Diagnosis", title, _verdict(whole, system), tuple(sections), settings, made)


def _seconds(whole: Diagnosis) -> float:
    return sum(float(record.time_s[-1] - record.time_s[0]) for record in whole.records.values())


def _verdict(whole: Diagnosis, system: System) -> Verdict:
    first, *rest = sentences(summary_in(whole.summary, whole.effects, system))
    return Verdict(first, _TONES.get(whole.verdict, "plain"), tuple(rest))


def _effects(whole: Diagnosis, system: System) -> tuple[str, Table] | None:
    if not whole.effects:
        return None
    heads = ("effect", "stage", "rig file's key", "unit", "filed", "found", "95 % interval")
    rows = [row for effect in whole.effects for row in _effect_rows(effect, whole, system)]
    return "Effects found", Table((*heads, "share", "probability"), tuple(rows), words=4)


def _effect_rows(
    effect: EffectResult, whole: Diagnosis, system: System
) -> Iterator[tuple[str, ...]]:
    """Yield a row a parameter; the effect's own share and probability are on the first."""
    sure = (share_of(whole.budget, effect.stage, effect.name), f"{effect.probability:.2f}")
    for i, p in enumerate(in_units(each, system) for each in effect.parameters):
        names = ("", "") if i else (plain(effect.name), effect.stage)
        yield (*names, p.key, p.unit, *_numbers(p), *(("", "") if i else sure))
    if not effect.parameters:
        yield (plain(effect.name), effect.stage, *[""] * 5, *sure)


def _numbers(p: ParameterEstimate) -> tuple[str, str, str]:
    filed = "none" if p.filed is None else figure(p.filed)
    return filed, figure(p.found), p.interval(figure) or "not determined"


def _stages(whole: Diagnosis) -> tuple[str, Table]:
    heads = ("stage", "", "residual over floor", "noise alone up to", "with the effects")
    rows = tuple(_stage_row(stage) for stage in whole.stages)
    return "Stages of the chain", Table(heads, rows, words=2)


def _stage_row(stage: StageResult) -> tuple[str | Mark, ...]:
    if stage.gap is None:
        lacks = "lacks " + ", ".join(stage.missing)
        return stage.name, stage.why or lacks, "not judged", "", ""
    within = "within its settings" if stage.within_settings else Mark("as filed", "good")
    word = Mark("guilty", "bad") if stage.guilty else within
    numbers = (stage.gap, stage.limit, stage.left)
    return stage.name, word, *("" if n is None else f"{n:.2f}" for n in numbers)


def _shrink(whole: Diagnosis, system: System) -> tuple[str, Table] | None:
    if not whole.effects:
        return None
    heads = ("channel", "unit", "rms as filed", "with the effects", "noise", "closed")
    rows = tuple(_shrink_row(one, system) for one in whole.shrink.channels)
    caption = "The rms residual on stretches of the record that the fit has not seen"
    return "How far the gap shrinks", Table((*heads, "95 % interval"), rows, caption, words=2)


def _shrink_row(one: ChannelShrink, system: System) -> tuple[str, ...]:
    factor, unit = unit_shown(one.channel, system)
    numbers = (f"{factor * n:.3g}" for n in (one.before, one.after, one.floor))
    cells = (channel_label(one.channel), unit, *numbers)
    if one.closed is None or one.low is None or one.high is None:
        return *cells, "–", "–"
    few = "" if one.reliable else f", of {one.blocks} stretches"
    ends = f"{100 * one.low:.0f} to {100 * one.high:.0f} %{few}"
    return *cells, f"{100 * one.closed:.0f} %", ends


def _again(whole: Diagnosis, system: System) -> tuple[str, Table] | None:
    if whole.closed_loop is None:
        return None
    rows = []
    for one in whole.closed_loop:
        factor, unit = unit_shown(one.channel, system)
        numbers = (f"{factor * n:.3g}" for n in (one.before, one.after))
        rows.append((channel_label(one.channel), unit, *numbers))
    heads = ("rms distance from the record", "unit", "rig as filed", "improved rig")
    return "Flown again with the record's pilot", Table(heads, tuple(rows), words=2)


def _in_flight(whole: Diagnosis, system: System) -> tuple[str, Table] | None:
    if whole.in_flight is None:
        return None
    rows = []
    for one in whole.in_flight:
        share = percent(one.share, 0)
        for i, (name, value) in enumerate(one.changes.items()):
            factor, unit = unit_shown(name, system)
            own = f"{100 * one.of_motion[name]:.3g} %"
            first = ("", "") if i else (plain(one.name), share)
            rows.append((*first, channel_label(name), unit, f"{factor * value:.3g}", own))
    heads = ("effect", "share", "changes, rms", "unit", "without it", "of the motion")
    caption = "The improved rig flown with the record's pilot, with and without each effect"
    return "What it does to the flight", Table(heads, tuple(rows), caption, words=3)


def _next(whole: Diagnosis) -> tuple[str, Table] | None:
    if not whole.next_tests:
        return None
    rows = tuple(
        (test.text, " from ".join(map(plain, test.rivals)), f"{test.gain:.3g}")
        for test in whole.next_tests
    )
    return "What to record next", Table(("test", "distinguishes", "log-likelihood"), rows, words=2)


def _power(whole: Diagnosis, system: System) -> tuple[str, Table]:
    rows = tuple((plain(one.name), one.stage, _least(one, system)) for one in whole.power)
    head = "What these records would have shown"
    return head, Table(("effect", "stage", "from a size of"), rows, words=3)


def _least(one: EffectPower, system: System) -> str:
    if not one.judged:
        return "its stage is not judged"
    if not one.shows:
        return "no size that it may have"
    sizes = (size_in(name, value, system) for name, value in one.parameters)
    return ", ".join(sizes) or "it would show"
