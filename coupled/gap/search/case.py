"""What the search for effects works on: a rig, its outputs, and fits with the settings free."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot

import numpy as np

from coupled.gap.effects.effect import Effect, possible, touched
from coupled.gap.effects.library import LAG, STAMP
from coupled.gap.effects.settings import contact, lag_within_a_step, settings
from coupled.gap.search.contact import contact_start
from coupled.gap.search.course import Bounds, Timing, timed
from coupled.gap.search.found import Fit
from coupled.gap.signals.output import Output, stage_gaps, stage_limits
from coupled.gap.thresholds import HEARD_ANEW, SETTLE_FROM
from coupled.record.channels import ControlName
from coupled.rig.rig import Rig

Tell = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Case:
    """What the search works on: a nominal rig, and the outputs of its records.

    `refloored` gives the outputs with the floors of another rig; `timings` are of the effects that
    begin within the record, and of all that free the same numbers, with the onsets as seen.
    """

    nominal: Rig
    control: ControlName
    outputs: Sequence[Output]
    tell: Tell | None = None
    refloored: Callable[[Rig], Sequence[Output]] | None = None
    only_wide: bool = False  # the floors hold the error of a model of the healthy machine
    timings: Sequence[tuple[Effect, Timing, Bounds]] = ()

    @cached_property
    def known(self) -> dict[str, Effect]:
        """The nominal rig's settings, by the effects that free the same numbers.

        A sensor's setting that would drive an output beyond its limit, in which it is not fitted,
        is fitted to that output, too. If it is the stamp of the force, the loader may have the
        force late by itself, within one step.
        """
        filed = settings(self.nominal, self.control, self.outputs)
        found = dict(filed)
        for name, one in filed.items():
            spoiled = self._spoiled(one) if one.stage == "sensing" else ()
            if spoiled:
                found[name] = replace(one, outputs=(*one.shows_in, *spoiled))
        if found.get(STAMP) not in (None, filed.get(STAMP)):
            found[LAG] = lag_within_a_step(self.nominal, self.control)
        return found

    def _spoiled(self, setting: Effect) -> tuple[str, ...]:
        """Return the outputs within their limits that a setting drives beyond them at an end."""
        if not self._unsettled & {*setting.shows_in}:
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
        """The settings that the outputs depend on, by name: nuisances of every fit."""
        return {name: one for name, one in self.known.items() if self.is_open(one)}

    def is_open(self, effect: Effect) -> bool:
        """Tell whether the rig as filed leaves a gap in an output in which an effect shows."""
        return bool(self._unsettled & {*effect.shows_in})

    @cached_property
    def contact(self) -> tuple[Effect, ...]:
        """How far dry friction yields: nuisances beside any."""
        return contact(self.nominal, self.control)

    @cached_property
    def _unsettled(self) -> set[str]:
        """The outputs whose residual is large enough to settle anything by."""
        return {output.stage for output in self.outputs if output.gap(self.nominal) > SETTLE_FROM}

    @cached_property
    def by_shots(self) -> Case | None:
        """The case with outputs predicted by short replays; None where none has them."""
        if not any(output.shots for output in self.outputs):
            return None
        return replace(self, outputs=[output.by_shots() for output in self.outputs])

    @cached_property
    def neutral(self) -> dict[str, float]:
        """The settings as the rig file has them."""
        every = (*self.known.values(), *self.contact)
        return {one.value_key(p): p.starts[0] for one in every for p in one.free}

    def ends(self, effect: Effect) -> tuple[float, float] | None:
        """Return between which values an effect's number is a setting; None where it is none."""
        setting = self.known.get(effect.name)
        return None if setting is None else (setting.free[0].low, setting.free[0].high)

    def gaps(self, rig: Rig) -> dict[str, float]:
        """Return each stage's gap, by the floors of this rig where they are higher.

        As where a contact that yields lets noise pass that the filed friction would hold. What a
        surface stands off from the filed aircraft's trim may be where another aircraft trims.
        """
        gaps, limits = stage_gaps(self.outputs, rig), stage_limits(self.outputs)
        narrow = all(gap <= limits[stage] for stage, gap in gaps.items())
        if self.refloored is None or rig == self.nominal or narrow:
            return gaps
        made = {(one.record, one.channel): one for one in self.refloored(rig)}
        found: dict[str, float] = {}
        for one in self.outputs:
            new = made.get((one.record, one.channel), one)
            floor = max(one.floor, hypot(min(one.own, new.own), new.carried))
            gap = one.gap(rig) * one.floor / floor
            if one.stage == "surface" and rig.flight != self.nominal.flight:
                gap = min(gap, new.gap(rig))
            found[one.stage] = max(found.get(one.stage, 0.0), gap)
        return found

    def over_limit(self, rig: Rig) -> set[str]:
        """Return the outputs of which a rig leaves more than noise may."""
        limits = stage_limits(self.outputs)
        return {at for at, gap in self.gaps(rig).items() if gap > limits[at]}

    def surely_open(self, settled: Rig) -> Case:
        """Return the case in which a gap that no colour of noise explains is held to noise alone.

        What is not known of the colour of what drives a stage says whether it has a gap. Once it
        has one, what effects leave of it is judged as anywhere else.
        """
        if not any(output.unsure for output in self.outputs):
            return self
        settled_gaps, limits = stage_gaps(self.outputs, settled), stage_limits(self.outputs)
        outputs = [
            replace(one, unsure=0.0) if settled_gaps[one.stage] > limits[one.stage] else one
            for one in self.outputs
        ]
        return replace(self, outputs=outputs)

    def heard_anew(self, rig: Rig) -> Case | None:
        """Return the case with the noise that a rig's residuals have; None where none is lower.

        Noise is the same whatever the rig, and a gap adds to it what passes for coloured noise:
        the least that any rig leaves is the nearest.
        """
        if self.refloored is None:
            return None
        made = {(one.record, one.channel): one for one in self.refloored(rig)}
        anew = [made.get((one.record, one.channel), one) for one in self.outputs]
        pairs = list(zip(self.outputs, anew, strict=True))
        quieter = [_is_quieter(new, old) for old, new in pairs]
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
        """Return the case with outputs in which an effect's size goes with time."""

        def ours(outputs: Sequence[Output]) -> list[Output]:
            given = (self.nominal, self.control, effect, timing)
            return [timed(o, *given) if o.stage in effect.shows_in else o for o in outputs]

        before = self.refloored
        return replace(
            self,
            outputs=ours(self.outputs),
            refloored=None if before is None else lambda rig: ours(before(rig)),
            timings=(*self.timings, (effect, timing, seen)),
        )

    def timing(self, effect: Effect) -> tuple[Timing, Bounds] | None:
        """Return the timing of an effect that begins within the record; None of any other."""
        keys = {p.key for p in effect.parameters}
        each = (
            (timing, seen, {p.key for p in one.parameters}) for one, timing, seen in self.timings
        )
        return next(((timing, seen) for timing, seen, timed in each if timed & keys), None)

    def with_only(self, found: Fit, effects: Sequence[Effect]) -> Rig:
        """Return the rig with some of the effects that a fit found, and its nuisance parameters."""
        known = (*self.settings.values(), *self.contact)
        free = [one for one in known if one.value_key(one.free[0]) in found.values]
        rig = possible(self.nominal, self.control, (*effects, *free), found.values)
        return self.nominal if rig is None else rig

    def but_for_contact(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return fitted values without those of the contact, which a fit then seeks anew."""
        contact = {one.value_key(p) for one in self.contact for p in one.free}
        return {key: value for key, value in values.items() if key not in contact}

    def with_contact(
        self, effects: Sequence[Effect], free: Sequence[Effect], start: Mapping[str, float]
    ) -> dict[str, float]:
        """Return where a fit starts, with the contact that leaves least where none is known."""
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
            each = [output.residual(rig, wide=True) for output in ours]
            return sum(float(np.mean(one**2)) for one in each)

        found = contact_start(left, *(number.high for number in numbers))
        return known | dict(zip(keys, found, strict=True))


def _is_quieter(new: Output, old: Output) -> bool:
    """Tell whether an output's noise is less as another rig has it, of what was measured alike.

    Where the elevator stands in trim is measured by a rig: with its play it is another place, and
    may be known better.
    """
    return new.own < HEARD_ANEW * old.own and np.array_equal(new.measured, old.measured)
