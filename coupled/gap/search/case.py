"""The input of the search for effects: a nominal rig, its outputs and nuisance parameters.

The presliding parameters of friction, length and elastic share, need a start of their own. The
positions in which a control sticks change with both parameters, so that the cost has many local
minima, and least squares stay near their start. The start is therefore the best point of a grid,
refined by a pattern search without derivatives (Hooke and Jeeves, J. ACM 8, 1961).

If the rig file has friction, its presliding parameters are nuisance parameters. Their law has the
model error of a right effect: a small share of the gap of a rigid contact may remain.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import product
from math import hypot

import numpy as np

from coupled.gap.effects.effect import Effect, possible, touched
from coupled.gap.effects.library import LAG, STAMP
from coupled.gap.effects.settings import contact, is_dry, lag_within_a_step, settings
from coupled.gap.search.course import Bounds, Timing, timed
from coupled.gap.search.found import Fit
from coupled.gap.signals.output import Floats, Output, stage_gaps, stage_limits
from coupled.gap.thresholds import ELASTIC_SHARES, LENGTHS, LESSER, MINOR, MISMATCH
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Cost = Callable[[float, float], float]  # mean square residual by a length, d, and a share


def contact_start(cost: Cost, most: float, most_elastic: float) -> tuple[float, float]:
    """Return the length, d, and elastic share of least cost, each up to its largest value."""

    @cache
    def cost_at(at: tuple[float, float]) -> float:
        return cost(*at)

    def within(length: float, share: float) -> tuple[float, float]:
        return min(max(length, 1e-3 * most), most), min(max(share, 0.0), most_elastic)

    best = min((within(x * most, s) for x, s in product(LENGTHS, ELASTIC_SHARES)), key=cost_at)
    times, more = 1.5, 0.2
    while times - 1.0 > MINOR:
        length, share = best
        longer = ((length * times, share), (length / times, share))
        softer = ((length, share + more), (length, share - more))
        # A longer contact of a larger share sticks much alike: the valley of cost is diagonal.
        along = ((length * times, share + more), (length / times, share - more))
        near = min((within(*step) for step in (*longer, *softer, *along)), key=cost_at)
        if cost_at(near) < cost_at(best):
            best = near
        else:
            times, more = times**0.5, 0.5 * more
    return best


def allowing_for_contact(output: Output, rig: Rig, control: ControlName) -> Output:
    """Return an output with the gap that errors of the presliding law may cause (`mismatch`)."""
    if output.stage != "loader" or not is_dry(rig, control) or not contact(rig, control):
        return output
    return replace(output, mismatch=MISMATCH * max(output.gap(rig) - 1.0, 0.0))


Tell = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Case:
    """A nominal rig, and the outputs of its records.

    `outputs_with_noise_of` gives the outputs with noise floors estimated with another rig. If
    `model_error_in_floors`, the floors include the error of the model of the healthy machine.
    `timings` are (effect, timing, interval of the onset) of effects that begin within the record.
    They apply to all effects that free the same parameters. `way` is the rms of the motion, d, 0 if
    unknown; `longest` is the largest presliding length if not the usual one.
    """

    nominal: Rig
    control: ControlName
    outputs: Sequence[Output]
    tell: Tell | None = None
    outputs_with_noise_of: Callable[[Rig], Sequence[Output]] | None = None
    model_error_in_floors: bool = False
    timings: Sequence[tuple[Effect, Timing, Bounds]] = ()
    way: float = 0.0
    longest: float = 0.0

    @cached_property
    def known(self) -> dict[str, Effect]:
        """The nominal rig's nuisance parameters, by the effects that free the same parameters.

        A nuisance parameter of a sensor is fitted to its own outputs. If it could drive another
        output over its limit, it is fitted to that output as well. If it is the time stamp of the
        force, a delay of the force on the loader, up to one step, is free as well.
        """
        filed = settings(self.nominal, self.control, self.outputs)
        found = dict(filed)
        for name, one in filed.items():
            spoiled = self._driven_over_limit(one) if one.stage == "sensing" else ()
            if spoiled:
                found[name] = replace(one, outputs=(*one.shows_in, *spoiled))
        if found.get(STAMP) not in (None, filed.get(STAMP)):
            found[LAG] = lag_within_a_step(self.nominal)
        return found

    def _driven_over_limit(self, setting: Effect) -> tuple[str, ...]:
        """Return the outputs that a nuisance parameter at a bound drives over their limits."""
        if not self._above_noise & {*setting.shows_in}:
            return ()
        (number,) = setting.free
        clean = [
            output
            for output in self.outputs
            if output.stage not in setting.shows_in and output.gap(self.nominal) <= output.limit
        ]
        ends = [
            possible(self.nominal, self.control, [setting], {setting.value_key(number): end})
            for end in (number.low, number.high)
        ]
        return tuple(
            dict.fromkeys(
                output.stage
                for output in clean
                if any(rig is not None and output.gap(rig) > output.limit for rig in ends)
            )
        )

    @cached_property
    def settings(self) -> dict[str, Effect]:
        """The nuisance parameters that the outputs depend on, by name; free in every fit."""
        return {name: one for name, one in self.known.items() if self.is_open(one)}

    def is_comparable(self, effect: Effect) -> bool:
        """Tell whether a fit without an effect may use the tolerance of the effect's value, if any.

        A nuisance parameter is fitted only if one of its outputs exceeds the noise. Otherwise the
        effect would be credited with what the tolerance explains.
        """
        return effect.name not in self.known or effect.name in self.settings

    def is_open(self, effect: Effect) -> bool:
        """Tell whether an output in which an effect shows has a residual above the noise."""
        return bool(self._above_noise & {*effect.shows_in})

    @cached_property
    def contact(self) -> tuple[Effect, ...]:
        """The presliding parameters, which are nuisance parameters of any dry friction."""
        return contact(self.nominal, self.control, self.longest)

    @cached_property
    def _above_noise(self) -> set[str]:
        """The outputs whose residual with the nominal rig exceeds the noise floor."""
        return {output.stage for output in self.outputs if output.gap(self.nominal) > (1.0 + MINOR)}

    @cached_property
    def by_shots(self) -> Case | None:
        """The case with outputs predicted by multiple shooting; None if no output has it."""
        if not any(output.shots for output in self.outputs):
            return None
        return replace(self, outputs=[output.by_shots() for output in self.outputs])

    @cached_property
    def neutral(self) -> dict[str, float]:
        """The nuisance parameters' values in the rig file, by "effect.parameter"."""
        every = (*self.known.values(), *self.contact)
        return {one.value_key(p): p.starts[0] for one in every for p in one.free}

    def gaps(self, rig: Rig) -> dict[str, float]:
        """Return each stage's gap, with the higher of the noise floors of the nominal and this rig.

        For example, noise moves a loader with presliding friction, but not with rigid friction. If
        the aircraft differs from the nominal one, so do its trim positions: the smaller gap counts.
        """
        gaps, limits = stage_gaps(self.outputs, rig), stage_limits(self.outputs)
        narrow = all(gap <= limits[stage] for stage, gap in gaps.items())
        if self.outputs_with_noise_of is None or rig == self.nominal or narrow:
            return gaps
        made = {(one.record, one.channel): one for one in self.outputs_with_noise_of(rig)}
        found: dict[str, float] = {}
        for one in self.outputs:
            new = made.get((one.record, one.channel), one)
            floor = max(one.floor, hypot(min(one.own, new.own), new.carried))
            gap = one.gap(rig) * one.floor / floor
            if one.stage == "surface" and rig.flight != self.nominal.flight:
                gap = min(gap, new.gap(rig))
            found[one.stage] = max(found.get(one.stage, 0.0), gap)
        return found

    def without_colour_allowance(self, root: Rig) -> Case:
        """Return the case without the allowance for unknown noise colour, where there is a gap.

        The allowance (`unsure`) decides only whether a stage has a gap with the `root` rig, without
        effects; a stage that has one is judged by the plain limit.
        """
        if not any(output.unsure for output in self.outputs):
            return self
        root_gaps, limits = stage_gaps(self.outputs, root), stage_limits(self.outputs)
        outputs = [
            replace(one, unsure=0.0) if root_gaps[one.stage] > limits[one.stage] else one
            for one in self.outputs
        ]
        return replace(self, outputs=outputs)

    def with_lower_noise(self, rig: Rig) -> Case | None:
        """Return the case with noise estimated from a rig's residuals; None if none is lower.

        A gap raises the estimate of the noise, so the lowest of all rigs is the best.
        """
        if self.outputs_with_noise_of is None:
            return None
        made = {(one.record, one.channel): one for one in self.outputs_with_noise_of(rig)}
        anew = [made.get((one.record, one.channel), one) for one in self.outputs]
        pairs = list(zip(self.outputs, anew, strict=True))
        quieter = [_has_lower_noise(new, old) for old, new in pairs]
        if not any(quieter):
            return None
        outputs = [
            replace(old, floor=new.floor, spread=new.spread, smoothed=new.smoothed, _known=[])
            if less
            else old
            for less, (old, new) in zip(quieter, pairs, strict=True)
        ]
        return replace(self, outputs=outputs)

    def timed(self, effect: Effect, timing: Timing, seen: Bounds) -> Case:
        """Return the case in whose outputs an effect has a time history; `seen`: its onset, s."""

        def ours(outputs: Sequence[Output]) -> list[Output]:
            given = (self.nominal, self.control, effect, timing)
            return [timed(o, *given) if o.stage in effect.shows_in else o for o in outputs]

        before = self.outputs_with_noise_of
        return replace(
            self,
            outputs=ours(self.outputs),
            outputs_with_noise_of=None if before is None else lambda rig: ours(before(rig)),
            timings=(*self.timings, (effect, timing, seen)),
        )

    def timing(self, effect: Effect) -> tuple[Timing, Bounds] | None:
        """Return the timing of an effect that begins within the record; None for other effects."""
        keys = {p.key for p in effect.parameters}
        each = (
            (timing, seen, {p.key for p in one.parameters}) for one, timing, seen in self.timings
        )
        return next(((timing, seen) for timing, seen, timed in each if timed & keys), None)

    def with_longer_contact(self, found: Fit) -> Case | None:
        """Return the case with presliding up to the motion, if a fit's has the largest length."""
        (length,) = self.contact[0].free if self.contact else (None,)
        if length is None or self.way <= length.high:
            return None
        fitted = found.values.get(self.contact[0].value_key(length), 0.0)
        return replace(self, longest=self.way) if fitted > (1.0 - MINOR) * length.high else None

    def with_only(self, found: Fit, effects: Sequence[Effect]) -> Rig:
        """Return the rig with some effects of a fit, and the fitted nuisance parameters."""
        known = (*self.settings.values(), *self.contact)
        free = [one for one in known if one.value_key(one.free[0]) in found.values]
        rig = possible(self.nominal, self.control, (*effects, *free), found.values)
        return self.nominal if rig is None else rig

    def actions(self, found: Fit, effect: Effect) -> list[tuple[Output, Floats, Floats]]:
        """Return the outputs on which an effect of a fit acts, its action and the residual.

        Both in noise floors. The residual is with all effects; without this one the action adds.
        """
        without = self.with_only(found, [other for other in found.effects if other is not effect])
        lefts = ((one, one.residual(found.rig)) for one in touched(self.outputs, [effect]))
        return [(one, one.residual(without) - left, left) for one, left in lefts]

    def with_contact(
        self, effects: Sequence[Effect], free: Sequence[Effect], start: Mapping[str, float]
    ) -> dict[str, float]:
        """Return start values, with presliding parameters from a grid search if none are given."""
        known = dict(start)
        if not self.contact or self.contact[0] not in free:
            return known
        numbers = [one.free[0] for one in self.contact]
        keys = [one.value_key(one.free[0]) for one in self.contact]
        if keys[0] in known:
            return known
        begun = {effect.value_key(p): p.starts[0] for effect in effects for p in effect.free}
        ours = touched(self.outputs, self.contact)

        def left(*contact: float) -> float:
            values = {**self.neutral, **begun, **start, **dict(zip(keys, contact, strict=True))}
            rig = possible(self.nominal, self.control, [*effects, *free], values)
            if rig is None:
                return np.inf
            each = [output.residual(rig, coarse=True) for output in ours]
            return sum(float(np.mean(one**2)) for one in each)

        found = contact_start(left, *(number.high for number in numbers))
        return known | dict(zip(keys, found, strict=True))


def _has_lower_noise(new: Output, old: Output) -> bool:
    """Tell whether an output's noise estimate is lower with another rig, for the same measurement.

    The measured trim position of the elevator depends on the rig.
    """
    return new.own < (1.0 - LESSER) * old.own and np.array_equal(new.measured, old.measured)
