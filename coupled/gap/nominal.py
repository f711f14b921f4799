"""Fit a nominal rig to records of a healthy machine, with intervals of its parameters.

Any parameter of a rig can be free, by its key, within its valid range. The free parameters are
fitted like effects (`fit`), with the stages driven by the measured inputs. Their intervals follow
from the scatter of the score between stretches, or from the scatter of the values between records
if that is larger. If a record fits well alone but not with the others, the parameters are means of
those of each record. Parameters with nearly proportional signatures are not identifiable: for
example friction and damping, if all motion has one speed.

A parameter that the records do not determine to its own size stays as filed. If it is filed as 0
the machine is taken not to have the component, and the upper limit of its size is stated.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from coupled.errors import InputError
from coupled.gap.checks import at_rate_of, check_record, check_units, trimmed
from coupled.gap.effects.effect import (
    BY_REGRESSOR,
    Effect,
    dotted,
    entry,
    keys_of,
    possible,
    touched,
    value,
    value_of,
)
from coupled.gap.effects.library import BY_NAME, LAG
from coupled.gap.effects.linkage import SERVO
from coupled.gap.effects.settings import (
    CLOCK,
    CONTACT,
    Scales,
    contact,
    in_scale,
    is_dry,
    most_yielding,
)
from coupled.gap.freed import default_keys, freed
from coupled.gap.prepare import as_driven, in_own_trims, readers_of
from coupled.gap.search.case import Case, Tell
from coupled.gap.search.fit import fit_set
from coupled.gap.search.found import Alike, Fit, alike
from coupled.gap.signals.output import Floats, Output, Part, explained_below
from coupled.gap.stages.airframe import airframe_outputs
from coupled.gap.stages.tried import as_judged
from coupled.gap.thresholds import (
    FAR,
    LEAST_SERVO_RATIO,
    LESSER,
    NEGLIGIBLE,
    NORMAL_95,
    CLOCK_s,
)
from coupled.record.channels import ControlName, unit_of
from coupled.record.record import Record
from coupled.results import Plain, TableResult, frame_of
from coupled.rig.rig import Rig

if TYPE_CHECKING:
    import polars as pl

# A time stamp error of the grip, within the tolerance of a recorder's clocks.
LATE_GRIP = entry(
    *("linkage", "setting of the grip's stamp", ("", "")),
    value("", "loader.servo_delay_s", 0.0, CLOCK_s, 0.0, may_end=True),
)
# Parameters that imitate presliding friction if the contact is fitted as rigid.
LIKE_CONTACT = ("loader.delay_s", "loader.play_m", "loader.play_rad")
FRICTION, OFFSET = "loader.friction_N", "loader.offset_N"
BY_DIRECTION = ("loader.friction_pull_N", "loader.friction_push_N")


@dataclass(frozen=True)
class Number:
    """A fitted parameter: value in the file, fitted value, and half of its 95 % interval.

    `half` is None if the parameter is undetermined, or absent: its filed value is 0, and its 95 %
    interval includes 0. `most` is then the largest size in this interval. `least` and
    `greatest` are the bounds of a rig file, or the fit's lower one.
    """

    key: str
    filed: float
    found: float
    half: float | None
    least: float = -math.inf
    greatest: float = math.inf
    at_bound: bool = False
    most: float | None = None

    @property
    def interval(self) -> tuple[float, float] | None:
        """The 95 % interval, cut at the bounds; None if undetermined."""
        if self.half is None:
            return None
        low, high = self.found - self.half, self.found + self.half
        return max(low, self.least), min(high, self.greatest)

    @property
    def width(self) -> float:
        """Half of the interval over the parameter's size, above 1 if it is not determined.

        The size is the filed or the fitted value, whichever is larger.
        """
        if self.half is None:
            return math.inf
        return self.half / max(abs(self.filed), abs(self.found), 1e-300)

    @property
    def as_filed(self) -> Number:
        """The parameter with its filed value, since the records do not determine it."""
        most = None
        if self.filed == 0.0 and self.half is not None:
            most = abs(self.found) + self.half
        return replace(self, found=self.filed, half=None, at_bound=False, most=most)

    @property
    def words(self) -> str:
        """Why it stays as filed."""
        if self.most is None:
            return f"not determined by these records: {self.key}; it stays as filed"
        return f"not shown by these records: {self.key}; it stays 0, and is at most {self.most:.3g}"

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        low, high = self.interval or (None, None)
        known = {"filed": self.filed, "found": self.found, "low": low, "high": high}
        known |= {} if self.most is None else {"most": self.most}
        return known | ({"at_bound": True} if self.at_bound else {})


@dataclass(frozen=True)
class ChannelFit(Plain):
    """The prediction error of a channel on held-out stretches, rms in its unit.

    `before` is the error with the rig file, `after` with the fitted rig, `floor` the noise floor,
    and `moves` the standard deviation of the channel.
    """

    record: str
    channel: str
    before: float
    after: float
    floor: float
    moves: float


@dataclass(frozen=True)
class NominalFit(TableResult):
    """A nominal rig fitted to records: its parameters, and which of them are not identifiable."""

    control: ControlName
    rig: Rig
    numbers: tuple[Number, ...]
    alike: tuple[Alike, ...]
    channels: tuple[ChannelFit, ...]
    doubts: tuple[str, ...] = ()  # reasons against fitted values, a sentence each

    def __repr__(self) -> str:
        doubts = f", {len(self.doubts)} doubts" if self.doubts else ""
        known = len(self.numbers) - len(self.unknown)
        of = f"{known} of {len(self.numbers)} numbers determined"
        return f"NominalFit({self.rig.name}, {self.control}: {of}{doubts})"

    def to_polars(self) -> pl.DataFrame:
        """Return a row per parameter: key, filed and fitted value, and 95 % interval."""
        return frame_of([{"key": one.key} | one.as_dict() for one in self.numbers])

    @property
    def unknown(self) -> tuple[str, ...]:
        """The keys of parameters that stay as filed."""
        return tuple(number.key for number in self.numbers if number.half is None)

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        return {
            "control": self.control,
            "numbers": {number.key: number.as_dict() for number in self.numbers},
            "alike": [one.as_dict() for one in self.alike],
            "undetermined": list(self.unknown),
            "channels": [one.as_dict() for one in self.channels],
            "doubts": list(self.doubts),
        }


def _alike_by_direction(found: Sequence[Number], known: Sequence[Alike]) -> list[Alike]:
    """Return that an offset and friction by direction are inseparable, where one was found.

    Half the difference of friction aft and forward acts as a constant force, in motion and at rest
    (`friction`). The fit then depends on which of the two is free. An offset larger than the
    friction is not such a difference, which would be negative one way.
    """
    sizes = {one.key: one for one in found if one.half is not None}
    rubs = [key for key in (FRICTION, *BY_DIRECTION) if key in sizes]
    told = any(OFFSET in one.keys and {*rubs} & {*one.keys} for one in known)
    if not rubs or told:
        return []
    offset, aft, forward = (sizes.get(key) for key in (OFFSET, *BY_DIRECTION))
    by_direction = [one for one in (aft, forward) if one is not None]
    off = 0.0 if offset is None else abs(offset.found)
    if offset is not None:
        dry = max(sizes[key].found for key in rubs)
        if not (offset.half or 0.0) < off < dry:
            return []
    elif not by_direction or not _differ(aft, forward):
        return []
    others = [] if by_direction else [BY_DIRECTION[1]]
    return [Alike((*rubs, *others, OFFSET), "friction by direction acts as a constant force")]


def _differ(aft: Number | None, forward: Number | None) -> bool:
    """Tell whether the added frictions aft and forward differ by more than their intervals."""
    pair = [one for one in (aft, forward) if one is not None]
    more = sum(side * one.found for side, one in zip((1, -1), pair, strict=False))
    return abs(more) > math.hypot(*(one.half or 0.0 for one in pair))


def _flown_as_recorded(
    rig: Rig, records: Mapping[str, Record], keys: Sequence[str]
) -> dict[str, Rig]:
    """Return the rig of each record, with its trim if keys of its aircraft are fitted.

    An aircraft alone takes their rate too. Raises InputError if it is given no keys.
    """
    if rig.controls and not any(key.startswith("flight.") for key in keys):
        return dict.fromkeys(records, rig)
    if not keys:
        problem = 'the rig has an aircraft only: give its keys, as "flight.pitch_damping"'
        raise InputError(rig.place, "--free", problem)
    return trimmed(rig if rig.controls else at_rate_of(rig, records), records)[0]


def fit_nominal(
    rig: Rig,
    records: Mapping[str, Record],
    keys: Sequence[str] = (),
    control: ControlName = "column",
    tell: Tell | None = None,
) -> NominalFit:
    """Return a rig with the parameters of some keys fitted to records, by their files' names.

    A key is one of the control in a rig file, such as `loader.mass_kg`; the default is the usual
    keys of the stages that the records can judge. The rig's `tolerance` is half of each 95 %
    interval. A parameter that the records do not determine keeps its value and tolerance.
    Raises InputError if a record is of another rig, or if no record depends on a key.
    """
    rig = as_driven(rig, list(records.values()), control) if control in rig.controls else rig
    for file, record in records.items():
        check_units(rig, record, control, file)
    trims = _flown_as_recorded(rig, records, keys)
    filed, rig = rig, next(iter(trims.values()))
    for file, record in records.items():
        check_record(trims[file], record, control, file)
    readers = readers_of(trims, records, control)
    outputs = list[Output]()
    for reader in readers:
        outputs += reader.outputs()
        outputs += airframe_outputs(reader.rig, reader.record, reader.number)
    outputs = [output.halved(rig) for output in in_own_trims(outputs, readers)]
    if not outputs:
        problem = "holds too little to judge any stage by, so nothing can be fitted"
        raise InputError(next(iter(records)), "", problem)
    judged = {output.stage for output in outputs}
    if readers[0].moved or any(output.in_series for output in outputs):
        judged.add("linkage")
    chosen = tuple(keys) or default_keys(rig, control, judged, readers[0].moved)
    scales = Scales.of(readers) if control in rig.controls else None
    effects: list[Effect] = []
    for key in chosen:
        asked = freed(rig, control, key)
        if key in BY_REGRESSOR and not asked.free[0].nominal(rig, control):
            (asked,) = in_scale([asked], scales, rig, control)
        shown = as_judged([asked], readers, outputs)
        effects += [_with_starts(effect, outputs, rig, control) for effect in shown]
        if not touched(outputs, shown):
            lacking = sorted({n for r in readers for n in r.missing().get(asked.stage, [])})
            needs = ", ".join(lacking) or f"what judges the {asked.stage}"
            problem = f"nothing in these records depends on it; they lack {needs}"
            raise InputError(next(iter(records)), key, problem)
    shown_in = {output.stage for output in touched(outputs, effects)}
    fitter = _Fitter(rig, control, outputs, tell, 0.0 if scales is None else scales.way)
    effects, begun = fitter.with_contact_starts(effects)
    held, whole, fitted, each = fitter.fitted(effects, begun)
    numbers = dict(zip(chosen, fitted, strict=True))
    while loose := [numbers[e.name] for e in effects if numbers[e.name].width > 1.0]:
        # The least determined one stays as filed, and the others are fitted again.
        worst = max(loose, key=lambda number: number.width)
        numbers[worst.key] = worst.as_filed
        effects = [effect for effect in effects if effect.name != worst.key]
        held, _, fitted, each = fitter.fitted(effects, begun)
        numbers |= {one.key: one for one in fitted}
    found = tuple(numbers.values())
    each_alike = (one for group in whole.groups.values() for one in alike(group))
    together = [one for one in each_alike if {*one.keys} <= {*chosen}]
    together += _alike_by_direction(found, together)
    used = [output for output in outputs if output.stage in shown_in]
    files = list(records)
    known = _with_fitted(filed, control, found)
    determined = {one.key for one in found if one.half is not None}
    return NominalFit(
        control,
        known,
        found,
        tuple(together),
        tuple(_channel(output, rig, held.rig, files[output.record]) for output in used),
        (
            *_doubts_of_residual(rig, each, used),
            *_doubts_of_contact(known, control, whole),
            *_doubts_of_servo(known, control, determined, held.rig, used),
        ),
    )


def random_effects(values: Floats, errors: Floats) -> tuple[float, float, float]:
    """Return the mean of values with standard errors, its own error, and the scatter between them.

    The scatter is the standard deviation beyond these errors, by the method of moments.
    """
    weights = errors**-2.0
    mean = float(np.average(values, weights=weights))
    excess = float(weights @ (values - mean) ** 2) - (len(values) - 1)
    between = max(excess / float(weights.sum() - (weights @ weights) / weights.sum()), 0.0)
    weights = 1.0 / (errors**2 + between)
    mean = float(np.average(values, weights=weights))
    return mean, float(weights.sum()) ** -0.5, math.sqrt(between)


@dataclass(frozen=True)
class _Fitter:
    """Fits parameters of a rig to some outputs; `way` is the rms of the motion, 0 if unknown."""

    rig: Rig
    control: ControlName
    outputs: Sequence[Output]
    tell: Tell | None
    way: float

    def fitted(
        self, effects: Sequence[Effect], begun: Mapping[str, float]
    ) -> tuple[Fit, Fit, list[Number], dict[int, Fit]]:
        """Return fits to every other stretch and to all, their parameters, and each record's fit.

        `begun` are start values. The interval of a parameter is at least its scatter between the
        records, each fitted alone.
        """
        records = sorted({output.record for output in self.outputs})
        tasks = len(records) + 2
        self._say("fitting", 0, tasks)
        held = self._fit(effects, self.outputs, begun, part="fitted")
        self._say("fitting to all", 1, tasks)
        whole = self._fit(effects, self.outputs, held.values)
        if len(records) == 1:
            numbers = [self._number(one, whole, ()) for one in effects]
            return held, whole, numbers, {records[0]: whole}
        each = dict[int, Fit]()
        for i, record in enumerate(records):
            self._say(f"fitting to record {i + 1} alone", i + 2, tasks)
            ours = [output for output in self.outputs if output.record == record]
            each[record] = self._fit(effects, ours, whole.values)
        numbers = [self._number(one, whole, list(each.values())) for one in effects]
        if self._records_differ(whole, each):
            fits = list(each.values())
            numbers = [
                self._mean(one, number, fits) for one, number in zip(effects, numbers, strict=True)
            ]
        return held, whole, numbers, each

    def _records_differ(self, whole: Fit, each: Mapping[int, Fit]) -> bool:
        """Tell whether a record has a residual beyond noise only in the fit to all records."""

        def differs(output: Output) -> bool:
            gap = output.gap(whole.rig)
            alone = output.gap(each[output.record].rig)
            return gap > output.limit and alone < (1.0 - LESSER) * gap

        return any(differs(output) for output in self.outputs)

    def _mean(self, effect: Effect, number: Number, each: Sequence[Fit]) -> Number:
        """Return a parameter with the mean over records that differ, and its scatter.

        One rig for all of them would be biased in every parameter: friction that differs by a tenth
        is fitted as mass and damping. The mean is that of random effects (DerSimonian and Laird,
        Controlled Clinical Trials 7, 1986), with the interval of a further record.
        """
        name = effect.value_key(effect.free[0])
        known = [one for one in each if math.isfinite(one.high[name] - one.low[name])]
        values = np.array([one.values[name] for one in known])
        halves = np.array([0.5 * (one.high[name] - one.low[name]) for one in known])
        if number.half is None or len(known) < 2 or not halves.all():
            return number
        mean, error, scatter = random_effects(values, halves / NORMAL_95)
        half = max(NORMAL_95 * error, 2.0 * scatter)
        return replace(number, found=mean, half=half, at_bound=False)

    def _say(self, what: str, done: int, tasks: int) -> None:
        if self.tell is not None:
            self.tell(what, done, tasks)

    def _fit(
        self,
        effects: Sequence[Effect],
        outputs: Sequence[Output],
        start: Mapping[str, float] | None = None,
        part: Part = "all",
    ) -> Fit:
        """Return effects fitted to a part of some outputs, beside nuisance parameters.

        A time stamp error of the force is within the tolerance of a recorder's clocks. Without it a
        lag of a fraction of a frame is fitted as friction. A free delay of the force stands for it.
        Dry friction yields before it slips, as in a diagnosis, if the residual is a step lower for
        it. Without it the force after each reversal is fitted as mass. A contact that yields by the
        largest length of a diagnosis may yield by up to the rms of the motion. With a rigid
        contact, delay and play are fitted in place of presliding, so the fit with presliding also
        starts without delay and play.
        """
        (number,) = CLOCK.free
        timed = {number.key, BY_NAME[LAG].free[0].key}
        loader = any({*CLOCK.shows_in} & {*effect.shows_in} for effect in effects)
        beside = [CLOCK] if loader and timed.isdisjoint(keys_of(effects)) else []
        priors = {CLOCK.value_key(number): (0.0, number.high / NORMAL_95)}
        start = start or {}
        beside += self._late_grip(effects)
        case = Case(self.rig, self.control, outputs, way=self.way)
        rigid = fit_set(case, effects, beside, priors, start, part=part)
        if not (loader and self._contact(case, effects)):
            return rigid

        def yielding(case: Case) -> tuple[float, Fit]:
            return self._yielding(case, effects, beside, priors, (rigid.values, start), part)

        left, soft = yielding(case)
        if (larger := case.with_longer_contact(soft)) is not None:
            longer = yielding(larger)
            left, soft = longer if longer[0] < (1.0 - LESSER) * left else (left, soft)
        ours = touched(outputs, self._contact(case, effects))
        return soft if left < (1.0 - LESSER) * _held_out_rms(ours, rigid.rig) else rigid

    def _late_grip(self, effects: Sequence[Effect]) -> list[Effect]:
        """Return a delay of the grip within the tolerance of time stamps, beside a linkage.

        Without a servo nothing else makes δ late, and a delay of microseconds is fitted as play.
        """
        free = [p.key for effect in effects if effect.stage == "linkage" for p in effect.free]
        judged = any(output.stage == "linkage" for output in self.outputs)
        if not (free and judged) or any("servo" in key for key in free):
            return []
        none = self.rig.controls[self.control].loader.servo_frequency == 0.0
        return [LATE_GRIP] if none else []

    def _yielding(
        self,
        case: Case,
        effects: Sequence[Effect],
        beside: Sequence[Effect],
        priors: Mapping[str, tuple[float, float]],
        known: tuple[Mapping[str, float], Mapping[str, float]],
        part: Part,
    ) -> tuple[float, Fit]:
        """Return a fit with presliding, and its residual RMS on held-out stretches.

        `known` are the values of the fit with a rigid contact, and start values.
        """
        given, start = self._contact(case, effects), {**known[0], **known[1]}
        ours, free = touched(case.outputs, given), [*beside, *given]
        absent = {
            effect.value_key(p): 0.0
            for effect in effects
            for p in effect.free
            if p.key_on(self.control) in LIKE_CONTACT and p.nominal(self.rig, self.control) == 0.0
        }
        each = list[tuple[float, Fit]]()
        for values in [start, {**start, **absent}] if absent else [start]:
            begun = case.with_contact(effects, free, values)
            soft = fit_set(case, effects, free, priors, begun, part=part)
            each.append((_held_out_rms(ours, soft.rig), soft))
        return min(each, key=lambda one: one[0])

    def with_contact_starts(
        self, effects: Sequence[Effect]
    ) -> tuple[list[Effect], Mapping[str, float]]:
        """Return effects with ranges of a free stiffness of the contact, and all start values.

        The cost has local minima over it; the length of a nuisance parameter begins at the best
        point of a grid. The start is therefore that of the fit in which the contact is not free.
        """
        given = {key.format(d=unit_of(self.control)) for key in CONTACT}
        names = {e.name for e in effects if e.free[0].key_on(self.control) in given}
        if not names or not contact(self.rig, self.control):
            return list(effects), {}
        fitted = self._fit([e for e in effects if e.name not in names], self.outputs)
        loader = fitted.rig.controls[self.control].loader
        if loader.friction_stiffness == 0.0:
            return list(effects), fitted.values
        begun, ranged = dict(fitted.values), list[Effect]()
        for effect in effects:
            (number,) = effect.free
            if effect.name in names:
                start = float(value_of(fitted.rig, self.control, number.key))
                begun[effect.value_key(number)] = start
                if number.low > 0.0:
                    number = replace(number, low=start / FAR, high=start * FAR, starts=(start,))
            ranged.append(replace(effect, parameters=(number,)))
        return ranged, begun

    def _contact(self, case: Case, effects: Sequence[Effect]) -> list[Effect]:
        """Return the presliding parameters that are not free, if the fitted rig has friction."""
        begun = {effect.value_key(p): p.starts[0] for effect in effects for p in effect.free}
        rig = possible(self.rig, self.control, effects, begun)
        if rig is None or not is_dry(rig, self.control):
            return []
        free = {p.key_on(self.control) for effect in effects for p in effect.free}
        if CONTACT[0].format(d=unit_of(self.control)) in free:
            return []  # the fitted rig has it, and its share is free or as filed
        return [one for one in case.contact if one.free[0].key_on(self.control) not in free]

    def _number(self, effect: Effect, whole: Fit, each: Sequence[Fit]) -> Number:
        """Return a parameter with the wider of its interval and its scatter between records."""
        (parameter,) = effect.free
        name = effect.value_key(parameter)
        found, half = whole.values[name], 0.5 * (whole.high[name] - whole.low[name])
        if each:
            scatter = float(np.std([one.values[name] for one in each], ddof=1))
            half = max(half, 2.0 * scatter)
        if abs(found - parameter.low) < 1e-6 * parameter.starts[0]:
            found = parameter.low  # a fit at its bound stays slightly inside
        filed = float(parameter.nominal(self.rig, self.control))
        known = half if math.isfinite(half) else None
        bounds = parameter.low, parameter.accepted(self.rig, self.control)[1]
        return Number(effect.name, filed, found, known, *bounds, name in whole.at_bound)


def _doubts_of_residual(
    filed: Rig, each: Mapping[int, Fit], used: Sequence[Output]
) -> tuple[str, ...]:
    """Return doubts about channels whose residual exceeds noise in the fit to their record alone.

    Differences between records are in the intervals, and no reason for doubt.
    """
    misses = dict[str, float]()
    for output in used:
        gap = output.gap(each[output.record].rig)
        if gap > explained_below(output.gap(filed), output.limit):
            misses[output.channel] = max(gap, misses.get(output.channel, 0.0))
    return tuple(
        f"the residual of {channel} is {gap:.3g} times its noise: the machine has an effect that"
        " is not in the fit and may bias these numbers. Diagnose the records with the fitted rig"
        for channel, gap in misses.items()
    )


def _doubts_of_contact(found: Rig, control: ControlName, whole: Fit) -> tuple[str, ...]:
    """Return the doubt about friction that yields further than a diagnosis of the rig expects."""
    for effect in contact(found, control, math.inf)[:1]:
        length = whole.values.get(effect.value_key(effect.free[0]), 0.0)
        if length > most_yielding(control):
            d = unit_of(control)
            return (
                f"friction yields by {length:.3g} {d} before it slips, further than the"
                f" {most_yielding(control):g} {d} of dry contacts: for a rig with this, add"
                f" --free loader.friction_stiffness_N_per_{d}",
            )
    return ()


def _doubts_of_servo(
    found: Rig, control: ControlName, fitted: Set[str], held: Rig, used: Sequence[Output]
) -> tuple[str, ...]:
    """Return the reasons against a fitted servo: low damping, or no better prediction with it.

    `held` is the rig fitted to the stretches that are not held out. A servo that was not fitted is
    not judged.
    """
    if not {"loader.servo_frequency_Hz", "loader.servo_damping_ratio"} & fitted:
        return ()
    loader = found.controls[control].loader
    if loader.servo_frequency == 0.0:
        return ()
    reasons = []
    if loader.servo_damping_ratio < LEAST_SERVO_RATIO:
        reasons.append(
            f"a servo's damping ratio is at least {LEAST_SERVO_RATIO:g}, and this one would ring"
        )
    try:
        none = held.changed({f"controls.{control}.{SERVO}": 0.0})
    except InputError:
        pass  # the rig has other parameters of a servo
    else:
        if _held_out_rms(used, none) <= _held_out_rms(used, held) * (1.0 + NEGLIGIBLE):
            reasons.append("without a servo the held-out stretches are predicted as well")
    if not reasons:
        return ()
    return (
        f"servo_frequency_Hz = {loader.servo_frequency:.3g} with servo_damping_ratio ="
        f" {loader.servo_damping_ratio:.2g} is no servo: {'; '.join(reasons)}."
        " For a machine without a servo leave out both keys, and fit again",
    )


def _held_out_rms(used: Sequence[Output], rig: Rig) -> float:
    """Return the rms of all residuals on the held-out stretches, in noise floors."""
    left = np.concatenate([output.residual(rig, "held") for output in used])
    return float(np.sqrt(np.mean(left**2)))


def _with_starts(
    effect: Effect, outputs: Sequence[Output], rig: Rig, control: ControlName
) -> Effect:
    """Return a free parameter with starts estimated from the residuals, if there are any."""
    seen = [] if effect.seen is None else effect.seen(outputs, rig, control)
    (number,) = effect.free
    starts = tuple(one[number.name] for one in seen)
    return replace(effect, parameters=(replace(number, starts=starts),)) if starts else effect


def _with_fitted(rig: Rig, control: ControlName, numbers: Sequence[Number]) -> Rig:
    """Return the rig with the fitted values and their tolerances.

    The values that the host assumes of the loader do not change, since the records contain them.
    """
    if control not in rig.controls:
        return rig.changed({one.key: one.found for one in numbers})
    data = rig.controls[control]
    changes: dict[str, Any] = {}
    for one in numbers:
        changes[dotted(one.key, control)] = one.found
        if "basic_gradient" in one.key:
            host = f"controls.{control}.compensation.{one.key.partition('.')[2]}"
            changes[host] = data.assumed_basic_gradient
        if "breakout" in one.key:
            changes[f"controls.{control}.compensation.breakout_N"] = data.assumed_breakout
    halves = {one.key: one.half for one in numbers if one.half is not None and one.half > 0.0}
    known = (data.tolerance | halves).items()
    kept = {key: half for key, half in known if not key.startswith("flight.")}
    return rig.changed({**changes, f"controls.{control}.tolerance": kept})


def _channel(output: Output, before: Rig, after: Rig, file: str) -> ChannelFit:
    """Return the error of a channel's prediction on held-out stretches."""
    floor, moves = output.floor, float(np.std(output.measured))
    error, fitted = (_held_out_rms([output], rig) * floor for rig in (before, after))
    return ChannelFit(file, output.channel, error, fitted, floor, moves)
