"""The tables of a diagnosis, of diagnoses of a folder, and of a fitted nominal rig."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from coupled.display import Shown, System, drawn, in_system, percent, split_unit
from coupled.gap.findings.budget import StageBudget, share_of
from coupled.gap.findings.result import EffectResult, ParameterEstimate, StageResult, labelled
from coupled.gap.findings.summary import change, figure, in_units, labels, plain, size_in
from coupled.tables.table import NONE, Mark, Row, Table

if TYPE_CHECKING:
    from coupled.gap.batch import Row as Diagnosed
    from coupled.gap.findings.budget import ChannelShrink
    from coupled.gap.findings.curves import Curve
    from coupled.gap.findings.diagnosis import Diagnosis
    from coupled.gap.findings.flown import ChannelAgain, EffectInFlight
    from coupled.gap.findings.proposal import EffectPower, ProposedTest
    from coupled.gap.nominal import ChannelFit, Number


def diagnosis_tables(whole: Diagnosis, power: bool, system: System = "si") -> Iterator[Table]:
    """Yield the tables that a terminal prints of a diagnosis; with `power`, the least sizes too."""
    if whole.effects:
        yield effects_table(whole.effects, whole.budget, system)
    yield stages_table(whole.stages)
    yield from (curve_table(one, system) for one in whole.curves)
    if (flown := flown_again_table(whole, system)) is not None:
        yield flown
    if whole.in_flight is not None:
        yield in_flight_table(whole.in_flight, system)
    if power:
        yield power_table(whole.power, system)


def effects_table(
    effects: Sequence[EffectResult], budget: Sequence[StageBudget], system: System = "si"
) -> Table:
    """Return the parameters of each effect found, and its share of its stage's residual."""
    rows = [row for effect in effects for row in _effect(effect, budget, system)]
    rows += [
        (f"{one.stage}: {left.name}", "", "", f"{100 * left.value:.1f} %", "")
        for one in budget
        for left in (one.unexplained, one.noise)
    ]
    heads = ("effect", "filed → found", "95 % interval", "share", "prob.")
    return Table(heads, tuple(rows), align="llr", spare=("95 % interval", "prob."))


def _effect(effect: EffectResult, budget: Sequence[StageBudget], system: System) -> Iterator[Row]:
    """Yield a row for each parameter; share and probability are in the first."""
    sure = (share_of(budget, effect.place, effect.name), f"{effect.probability:.2f}")
    names = labels(effect)
    if not effect.parameters:
        yield (effect.label, "", "", *sure)
    for i, parameter in enumerate(in_units(p, system) for p in effect.parameters):
        name = f"{effect.label} {names[i]}" if i == 0 else f"  {names[i]}"
        number = (change(parameter), parameter.interval(figure))
        yield (name.rstrip(), *number, *(("", "") if i else sure))


def keys_table(effects: Sequence[EffectResult], system: System = "si") -> Table:
    """Return the keys of the rig file that the effects change: filed value, found value."""
    rows = tuple(
        (effect.key_of(p), p.unit, "none" if p.filed is None else figure(p.filed), *_found(p))
        for effect in effects
        for p in (in_units(each, system) for each in effect.parameters)
    )
    return Table(("rig file's key", "unit", "filed", "found", "95 % interval"), rows, align="llr")


def _found(parameter: ParameterEstimate) -> tuple[str, str]:
    return figure(parameter.found), parameter.interval(figure) or "not determined"


def stages_table(stages: Sequence[StageResult]) -> Table:
    """Return each stage's residual over its noise floor, before and with the effects found."""
    heads = ("stage", "residual / floor", "with the effects", "")
    return Table(heads, tuple(map(_stage, stages)), align="lrrl")


def _stage(stage: StageResult) -> Row:
    if stage.gap is None:
        lacks = "lacks " + ", ".join(stage.missing)
        return stage.name, "not judged", "", stage.why or lacks
    left = "" if stage.left is None else f"{stage.left:.2f}"
    within = "within its tolerances" if stage.within_settings else ""
    remark = Mark("faulty", "bad") if stage.guilty else within
    return stage.name, f"{stage.gap:.2f}", left, remark


def shrink_table(
    channels: Sequence[ChannelShrink], system: System = "si", by: str = "with the effects"
) -> Table:
    """Return how far the RMS residual of each channel shrinks on held-out stretches."""
    heads = ("channel", "rms as filed", by, "noise", "closed", "95 % interval")
    caption = "The rms residual on held-out stretches of the record"
    return Table(heads, tuple(_shrink(one, system) for one in channels), caption)


def _shrink(one: ChannelShrink, system: System) -> Row:
    label, unit = _channel(one.channel, system)
    numbers = (f"{unit.factor * n:.3g}" for n in (one.before, one.after, one.floor))
    if one.closed is None or one.low is None or one.high is None:
        return label, *numbers, NONE if one.closed is None else percent(one.closed, 0), NONE
    few = "" if one.reliable else f", of {one.blocks} stretches"
    ends = f"{100 * one.low:.0f} to {100 * one.high:.0f} %{few}"
    return label, *numbers, percent(one.closed, 0), ends


def curve_table(curve: Curve, system: System = "si") -> Table:
    """Return the nodes and values of a curve, with their 95 % intervals."""
    stem, of = split_unit(curve.of)
    across, up = in_system(of, system), in_system(curve.unit, system)
    rows = []
    for node, *values in zip(curve.nodes, curve.values, curve.low, curve.high, strict=True):
        value, low, high = (f"{up.factor * each:.4g}" for each in values)
        rows.append((f"{across.factor * node:.4g}", value, f"{low} to {high}"))
    heads = (f"{plain(stem)}, {across.unit}", f"{curve.key}, {up.unit}", "95 % interval")
    caption = f"A curve fitted to the {curve.stage}, without a cause; it {curve.words}"
    return Table(heads, tuple(rows), caption, align="r", spare=("95 % interval",))


def flown_again_table(whole: Diagnosis, system: System = "si") -> Table | None:
    """Return the flights with the record's pilot as a table; None if there are none."""
    flown = [one for one in (whole.closed_loop, whole.closed_loop_with_curves) if one is not None]
    if not flown:
        return None
    heads = [*(["improved"] if whole.closed_loop is not None else [])]
    heads += ["with curves"] if whole.closed_loop_with_curves is not None else []
    return closed_loop_table(flown, heads, system)


def closed_loop_table(
    flown: Sequence[Sequence[ChannelAgain]], heads: Sequence[str], system: System = "si"
) -> Table:
    """Return the RMS distance from the record of flights with the record's pilot.

    `flown` are the channels of each rig, `heads` what the rigs are called.
    """
    rows = []
    for each in zip(*flown, strict=True):
        label, unit = _channel(each[0].channel, system)
        numbers = (each[0].before, *(one.after for one in each))
        rows.append((label, *(f"{unit.factor * n:.3g}" for n in numbers)))
    first = "flown with the record's force, rms error"
    return Table((first, "rig as filed", *heads), tuple(rows))


def in_flight_table(effects: Sequence[EffectInFlight], system: System = "si") -> Table:
    """Return the change of the flight without each effect, and its share of all effects' change."""
    rows: list[Row] = []
    for one in effects:
        for i, (name, by) in enumerate(one.changes.items()):
            first = ("", "") if i else (labelled(one.name, one.control), percent(one.share, 0))
            label, unit = _channel(name, system)
            own = f"{100 * one.of_motion[name]:.3g} %"
            rows.append((*first, label, f"{unit.factor * by:.3g}", own))
    heads = ("effect in flight", "share", "channel", "rms change", "of its motion")
    return Table(heads, tuple(rows), align="lrlr", spare=("rms change", "of its motion"))


def _channel(name: str, system: System) -> tuple[str, Shown]:
    """Return a channel's name for people with its unit, and the unit."""
    unit = drawn(name, system)
    stem, own = split_unit(name)
    return (f"{plain(stem)}, {unit.unit}" if own else name), unit


def power_table(sizes: Sequence[EffectPower], system: System = "si") -> Table:
    """Return the smallest detectable size of each effect."""
    rows = tuple(
        (f"{one.control} {one.name}" if one.control else one.name, one.stage, _least(one, system))
        for one in sizes
    )
    return Table(("effect", "stage", "detectable from"), rows, align="l", spare=("stage",))


def _least(one: EffectPower, system: System) -> str:
    if not one.judged:
        return "its stage is not judged"
    if not one.shows:
        return "not at any size within its bounds"
    sizes = (size_in(name, value, system) for name, value in one.parameters)
    return ", ".join(sizes) or "detectable"


def next_tests_table(tests: Sequence[ProposedTest]) -> Table:
    """Return the tests that would distinguish competing effects, with the predicted gain."""
    rows = tuple(
        (test.text, " from ".join(map(plain, test.rivals)), f"{test.gain:.3g}") for test in tests
    )
    return Table(("test", "distinguishes", "log-likelihood"), rows, align="llr")


def batch_table(found: Sequence[Diagnosed]) -> Table:
    """Return a line for each record of a folder: verdict, effects, stages."""
    rows = tuple(
        (
            row.record,
            row.verdict + (f": {row.why}" if row.why else ""),
            ", ".join(row.effects),
            ", ".join(row.guilty),
            "" if row.closed is None else f"{row.closed:.3f}",
        )
        for row in found
    )
    heads = ("record", "verdict", "effects", "faulty", "closed")
    return Table(heads, rows, align="l", spare=("faulty", "closed"))


def numbers_table(numbers: Sequence[Number]) -> Table:
    """Return each fitted number: as filed, as found, and its 95 % interval."""
    rows = []
    for one in numbers:
        ends = "not determined" if one.most is None else f"at most {figure(one.most)}"
        if one.interval is not None:
            ends = " to ".join(figure(end) for end in one.interval)
        rows.append((one.key, figure(one.filed), figure(one.found), ends))
    heads = ("number", "filed", "found", "95 % interval")
    return Table(heads, tuple(rows), spare=("filed",))


def channels_table(channels: Sequence[ChannelFit]) -> Table:
    """Return the RMS distance of each channel from its prediction on held-out stretches."""
    rows = tuple(
        (one.channel, *(f"{n:.3g}" for n in (one.before, one.after, one.floor, one.moves)))
        for one in channels
    )
    head = "channel, rms residual on held-out stretches"
    heads = (head, "as filed", "fitted", "noise alone", "channel's rms")
    return Table(heads, rows, spare=("noise alone", "channel's rms"))
