"""The report of a diagnosis: what is wrong, how sure that is, and the figures that show it."""

from __future__ import annotations

from collections.abc import Iterator

from coupled.display import percent
from coupled.gap.findings.budget import share_of
from coupled.gap.findings.diagnosis import Diagnosis
from coupled.gap.findings.power import EffectPower
from coupled.gap.findings.result import EffectResult, ParameterEstimate, StageResult
from coupled.gap.findings.shrink import ChannelShrink
from coupled.gap.findings.summary import figure, in_figures, plain, sentences
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


def diagnosis_report(whole: Diagnosis, title: str, made: Made, with_power: bool = False) -> Report:
    """Return the report; with the least sizes that would have shown, where they are asked for."""
    tables = [_effects(whole), _stages(whole), _shrink(whole), _again(whole), _in_flight(whole)]
    tables.append(_next(whole))
    if with_power:
        tables.append(_power(whole))
    sections = [Section(head, (table,)) for head, table in filter(None, tables)]
    figures = (
        Drawing(svg_text(drawn), _CAPTIONS[name]) for name, drawn in draw_diagnosis(whole).items()
    )
    sections.append(Section("Figures", tuple(figures)))
    settings = (
        ("rig", whole.nominal.name),
        ("control", whole.control),
        ("records", f"{len(whole.records)}, {_seconds(whole):.4g} s in all"),
    )
    return Report("Diagnosis", title, _verdict(whole), tuple(sections), settings, made)


def _seconds(whole: Diagnosis) -> float:
    return sum(float(record.time_s[-1] - record.time_s[0]) for record in whole.records.values())


def _verdict(whole: Diagnosis) -> Verdict:
    first, *rest = sentences(whole.summary)
    return Verdict(first, _TONES.get(whole.verdict, "plain"), tuple(rest))


def _effects(whole: Diagnosis) -> tuple[str, Table] | None:
    if not whole.effects:
        return None
    heads = ("effect", "stage", "rig file's key", "unit", "filed", "found", "95 % interval")
    rows = [row for effect in whole.effects for row in _effect_rows(effect, whole)]
    return "Effects found", Table((*heads, "share", "probability"), tuple(rows), words=4)


def _effect_rows(effect: EffectResult, whole: Diagnosis) -> Iterator[tuple[str, ...]]:
    """Yield a row a parameter; the effect's own share and probability are on the first."""
    sure = (share_of(whole.budget, effect.stage, effect.name), f"{effect.probability:.2f}")
    for i, p in enumerate(effect.parameters):
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


def _shrink(whole: Diagnosis) -> tuple[str, Table] | None:
    if not whole.effects:
        return None
    heads = ("channel", "unit", "rms as filed", "with the effects", "noise", "closed")
    rows = tuple(_shrink_row(one) for one in whole.shrink.channels)
    caption = "The rms residual on stretches of the record that the fit has not seen"
    return "How far the gap shrinks", Table((*heads, "95 % interval"), rows, caption, words=2)


def _shrink_row(one: ChannelShrink) -> tuple[str, ...]:
    factor, unit = unit_shown(one.channel)
    numbers = (f"{factor * n:.3g}" for n in (one.before, one.after, one.floor))
    cells = (channel_label(one.channel), unit, *numbers)
    if one.closed is None or one.low is None or one.high is None:
        return *cells, "–", "–"
    few = "" if one.reliable else f", of {one.blocks} stretches"
    ends = f"{100 * one.low:.0f} to {100 * one.high:.0f} %{few}"
    return *cells, f"{100 * one.closed:.0f} %", ends


def _again(whole: Diagnosis) -> tuple[str, Table] | None:
    if whole.closed_loop is None:
        return None
    rows = []
    for one in whole.closed_loop:
        factor, unit = unit_shown(one.channel)
        numbers = (f"{factor * n:.3g}" for n in (one.before, one.after))
        rows.append((channel_label(one.channel), unit, *numbers))
    heads = ("rms distance from the record", "unit", "rig as filed", "improved rig")
    return "Flown again with the record's pilot", Table(heads, tuple(rows), words=2)


def _in_flight(whole: Diagnosis) -> tuple[str, Table] | None:
    if whole.in_flight is None:
        return None
    rows = []
    for one in whole.in_flight:
        share = percent(one.share, 0)
        for i, (name, value) in enumerate(one.changes.items()):
            factor, unit = unit_shown(name)
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


def _power(whole: Diagnosis) -> tuple[str, Table]:
    rows = tuple((plain(one.name), one.stage, _least(one)) for one in whole.power)
    head = "What these records would have shown"
    return head, Table(("effect", "stage", "from a size of"), rows, words=3)


def _least(one: EffectPower) -> str:
    if not one.judged:
        return "its stage is not judged"
    if not one.shows:
        return "no size that it may have"
    sizes = (f"{name} {in_figures(name, value)}" for name, value in one.parameters)
    return ", ".join(sizes) or "it would show"
