"""The machine when it was well: what of a gap was always there, and is no fault.

A nominal rig never describes a machine fully. Records of the machine when it was well are
diagnosed first: with the effects found in them, the rig is what the machine was. What that leaves
of them is the model's own error; a channel's floor is then that error beside the noise, and how far
it scatters from record to record says what may be left of a machine that is as it was. That error
is no noise: a stage whose floor it raises to over a tenth of what the stage does is not judged, and
the rig is to be fitted to the healthy records first. An effect
found then may only imitate what the model lacks, and be of another size in another record: how far
its number scatters is its tolerance.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from coupled.display import unit_in
from coupled.gap.noise.smooth import smoothed
from coupled.gap.search.case import Case
from coupled.gap.search.found import Fit
from coupled.gap.search.problem import Problem
from coupled.gap.signals.output import Hides, Output, Part
from coupled.gap.thresholds import HEALTHY_ALONE, HEALTHY_SIGMAS
from coupled.rig.rig import Rig

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class ModelError:
    """What a rig leaves of a channel of the healthy machine beside noise.

    `rms` and `moves`, the channel's standard deviation, are in its unit, `rate` that of its change
    from frame to frame. `by_stretch` and `by_record` are relative standard deviations of the rms:
    of one stretch, and of one record. `misses` is by how many times its noise the rig misses a
    record at most, and 0 where no record shows more than noise.
    """

    rms: float
    moves: float
    rate: float
    by_stretch: float
    by_record: float
    misses: float = 0.0

    @classmethod
    def of(cls, outputs: Sequence[Output], rig: Rig) -> ModelError:
        """Return the error of the outputs of one channel, one a record."""
        lefts = [output.residual(rig) * output.floor for output in outputs]
        power = float(np.mean(np.concatenate(lefts) ** 2))
        noise = float(np.mean([output.floor**2 for output in outputs]))
        each = [float(np.sqrt(np.mean(left**2))) for left in lefts]
        blocks = np.concatenate(
            [_by_stretch(o, left) for o, left in zip(outputs, lefts, strict=True)]
        )
        few = HEALTHY_ALONE / math.sqrt(len(each))
        several = len(each) > 1 and power > 0.0  # a channel of the host's own may leave nothing
        scatter = float(np.std(each, ddof=1) / np.mean(each)) if several else 0.0
        return cls(
            rms=math.sqrt(max(power - noise, 0.0)),
            moves=math.sqrt(float(np.mean([np.var(output.measured) for output in outputs]))),
            rate=math.sqrt(float(np.mean([_rate(output) ** 2 for output in outputs]))),
            by_stretch=0.5 * float(np.std(blocks) / max(np.mean(blocks), 1e-300)),
            by_record=max(scatter, few),
            misses=max((o.gap(rig) for o in outputs if o.gap(rig) > o.limit), default=0.0),
        )

    def raised(self, output: Output) -> Output:
        """Return an output whose floor holds the model's error too.

        Of a larger or faster motion than the healthy machine's, the error is taken to be larger
        as much.
        """
        larger = max(1.0, float(np.std(output.measured)) / max(self.moves, 1e-300))
        larger = max(larger, _rate(output) / max(self.rate, 1e-300))
        error = self.rms * larger
        floor = math.hypot(output.floor, error)
        share = (error / floor) ** 2
        hidden = floor / max(output.does, 1e-300)
        hides = Hides(hidden, output.channel, output.channel, self.misses) if self.misses else None
        stretches = max(len(np.unique(output.stretches)), 1)
        scatter = math.hypot(self.by_stretch / math.sqrt(stretches), self.by_record)
        return replace(
            output,
            floor=floor,
            spread=math.hypot((1.0 - share) * output.spread, share * scatter),
            smoothed=(1.0 - share) * output.smoothed,
            unsure=(1.0 - share) * output.unsure,
            hides=hides,
            _known=[],
        )


def _rate(output: Output) -> float:
    """Return the standard deviation of a channel's change from frame to frame, noise taken off."""
    return float(np.std(np.diff(smoothed(output.measured))))


def tolerances(case: Case, found: Fit) -> dict[str, float]:
    """Return how far the numbers of the effects found scatter, by their keys, in their units.

    From record to record; of a single record, from half to half, and no less than a share of what
    the effect changed, since both halves are of one motion.
    """
    numbers = sorted({output.record for output in case.outputs})
    if len(numbers) > 1:
        parts = [[o for o in case.outputs if o.record == n] for n in numbers]
        fits = [Problem(replace(case, outputs=p)).fit(found.effects, found.values) for p in parts]
    else:
        halves: tuple[Part, ...] = ("fitted", "held")
        fits = [Problem(case).fit(found.effects, found.values, part=half) for half in halves]
    wide = {}
    for effect in found.effects:
        for p in effect.free:
            key, name = p.key_on(case.control), effect.value_key(p)
            if key.startswith("flight."):
                continue
            filed = float(p.nominal(case.nominal, case.control))
            each = [float(p.entered(filed, one.values[name])) for one in fits]
            least = HEALTHY_ALONE if len(numbers) == 1 else 0.0
            least *= abs(float(p.entered(filed, found.values[name])) - filed)
            scatter = max(HEALTHY_SIGMAS * float(np.std(each, ddof=1)), least)
            if scatter > 0.0:
                wide[key] = scatter
    return wide


def _by_stretch(output: Output, left: Floats) -> Floats:
    """Return the mean square of a residual on each stretch."""
    number = output.stretches
    return np.array([float(np.mean(left[number == n] ** 2)) for n in np.unique(number)])


@dataclass(frozen=True)
class Baseline:
    """The machine when it was well: its rig, what was found in it, and the model's errors.

    `files` are the records, `effects` the effects found in them, `errors` by channel.
    """

    files: tuple[str, ...]
    rig: Rig
    effects: tuple[str, ...]
    errors: Mapping[str, ModelError]

    @classmethod
    def of(cls, files: Sequence[str], case: Case, found: Fit) -> Baseline:
        """Return the baseline that records of the healthy machine give, by what fits them."""
        wide = {**found.rig.controls[case.control].tolerance, **tolerances(case, found)}
        rig = found.rig.changed({f"controls.{case.control}.tolerance": wide})
        effects = tuple(effect.name for effect in found.effects)
        names = dict.fromkeys(output.channel for output in case.outputs)
        each = {name: [one for one in case.outputs if one.channel == name] for name in names}
        errors = {name: ModelError.of(ours, rig) for name, ours in each.items()}
        return cls(tuple(files), rig, effects, errors)

    def raised(self, outputs: Sequence[Output]) -> list[Output]:
        """Return outputs with the floors of the healthy machine, where it had the channel."""
        return [
            self.errors[one.channel].raised(one) if one.channel in self.errors else one
            for one in outputs
        ]

    @property
    def missed(self) -> dict[str, ModelError]:
        """The channels in which the rig misses the healthy records by more than noise."""
        return {name: one for name, one in self.errors.items() if one.misses}

    @property
    def words(self) -> str:
        """What the records are held against."""
        count = f"{len(self.files)} records" if len(self.files) > 1 else "a record"
        found = ", ".join(name.replace("_", " ") for name in self.effects)
        had = f", which had {found}" if found else ""
        said = f"Held against the machine of {count} when it was well{had}."
        if not (missed := self.missed):
            return said
        each = ", ".join(
            f"{name} by {one.misses:.3g} times its noise (rms {one.rms:.3g} {unit_in(name)})"
            for name, one in missed.items()
        )
        them = "them" if len(self.files) > 1 else "it"
        return (
            f"{said} The rig misses {them} in {each}: a smaller change does not show there."
            f" Fit the rig to {them} first (coupled fit)."
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON."""
        errors = {
            name: {"rms": one.rms, "by_record": one.by_record, "misses": one.misses}
            for name, one in self.errors.items()
        }
        return {"records": list(self.files), "effects": list(self.effects), "errors": errors}
