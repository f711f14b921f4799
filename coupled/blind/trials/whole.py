"""Trials of whole aircraft: column, wheel and pedals moved in one flight.

The twin has a column alone. These rigs are flown by the package's own loop, with the effects as
values of the rig file, so that the trials test the search and the noise, not the physics. The names
of effects and stages are those of a diagnosis of several controls, for example `wheel.inertia`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from coupled.blind.trials.truth import Sizes, TrueEffect, Truth
from coupled.blind.twin.conditions import Conditions
from coupled.gap.effects.effect import Effect, possible
from coupled.gap.effects.library import BY_NAME
from coupled.gap.findings.flown import fly_force
from coupled.gap.findings.result import placed
from coupled.gap.signals.output import Output
from coupled.gap.stages.airframe import airframe_outputs
from coupled.gap.stages.stages import Reader
from coupled.gap.stages.surfaces import surface_points
from coupled.gap.stages.tried import lacking_keys
from coupled.record.channels import CONTROL_NAMES, ControlName, noisy_channels
from coupled.record.record import Record
from coupled.rig.rig import Rig

Rng = np.random.Generator
SHARES = {"none": 0.1, "pair": 0.3}  # the others have a single effect
DURATION_s, RISE_s = 40.0, 0.15
PULSES_s = ((1.0, 1), (1.0, -1), (4.0, 0), (2.1, 1), (1.4, -1), (0.7, 1), (0.7, -1))


@dataclass(frozen=True)
class Whole:
    """The pool of a version with whole aircraft.

    `airframe` and `control` are effects with their three sizes, `force_N` the level of each rig's
    controls, `noise` standard deviations by the end of a channel's name.
    """

    airframe: Mapping[str, Sequence[float]]
    control: Mapping[str, Sequence[float]]
    force_N: Mapping[str, Mapping[ControlName, float]]
    noise: Mapping[str, float]

    def plans(self, rng: Rng, records: int) -> list[tuple[str, tuple[str, ...]]]:
        """Return each record's category and effects, every effect about equally often."""
        counts = {category: int(share * records) for category, share in SHARES.items()}
        counts["single"] = records - sum(counts.values())
        known = list(self.airframe)
        dealt = [known[i] for _ in range(records) for i in rng.permutation(len(known))]
        beside = [str(name) for name in rng.choice(list(self.control), records)]
        taken: Mapping[str, int] = {"none": 0, "single": 1, "pair": 2}
        made = []
        for category, count in counts.items():
            for _ in range(count):
                made.append((category, (dealt.pop(), beside.pop())[: taken[category]]))
        return [made[i] for i in rng.permutation(len(made))]

    def draw(
        self, rng: Rng, category: str, names: Sequence[str], pool: Mapping[str, Rig]
    ) -> tuple[Rig, Record, Truth]:
        """Return the nominal rig, the record and the truth of a plan, on a rig that can have it."""
        for _ in range(60):
            rig = pool[str(rng.choice(list(pool)))]
            control: ControlName = CONTROL_NAMES[int(rng.integers(len(rig.controls)))]
            put = [self._sized(rng, name, control) for name in names]
            real = _built(rig, put)
            if real is None:
                continue
            record, conditions = self._flown(rng, rig.name, real)
            if not record.manifest["ended_early"]:
                return rig, record, _truth(category, rig, real, put, record, conditions)
        raise AssertionError(f"no rig of the pool can be flown with {names}")

    def _sized(self, rng: Rng, name: str, control: ControlName) -> _Put:
        sizes = self.airframe.get(name) or self.control[name]
        return _Put(BY_NAME[name], control, float(rng.choice(list(sizes))))

    def _flown(self, rng: Rng, name: str, real: Rig) -> tuple[Record, Conditions]:
        """Return the record of a rig, with noise, and its conditions."""
        levels = {
            channel: self._noise(channel) * 2.0 ** float(rng.uniform(-1.0, 1.0))
            for channel in noisy_channels(list(real.controls), flown=True)
        }
        level = 2.0 ** float(rng.uniform(-0.5, 0.25))
        order = rng.permutation(len(real.controls))
        times = np.arange(round(DURATION_s * real.frame_rate)) / real.frame_rate
        forces = {
            control: level * self.force_N[name][control] * _pulses(times, 2.0 + 12.0 * place)
            for control, place in zip(real.controls, order.tolist(), strict=True)
        }
        seed = int(rng.integers(2**31))
        record = fly_force(real.changed({"noise": levels}), forces, seed=seed)
        return record, Conditions(DURATION_s, ("doublet", "3-2-1-1"), level, levels)

    def _noise(self, channel: str) -> float:
        ends = [end for end in self.noise if channel.endswith(end)]
        return self.noise[max(ends, key=len)]


@dataclass(frozen=True)
class _Put:
    """An effect with the value of its first parameter, and the control that has it."""

    effect: Effect
    control: ControlName
    value: float

    @property
    def owner(self) -> ControlName | None:
        return None if self.effect.stage == "airframe" else self.control

    @property
    def stage(self) -> str:
        return placed(self.effect.stage, self.owner)

    def into(self, rig: Rig) -> Rig | None:
        """Return the rig with the effect; None if it cannot have it, or if nothing changes."""
        keys = {p.key for p in self.effect.parameters}
        fixed = self.effect.stage == "surface" and surface_points(rig, self.control) is None
        if fixed or keys & lacking_keys(rig):
            return None
        given = {self.effect.value_key(self.effect.free[0]): self.value}
        real = possible(rig, self.control, [self.effect], given)
        return None if real == rig else real

    def outputs(self, rig: Rig, record: Record) -> list[Output]:
        """Return the outputs in which the effect shows."""
        if self.owner is None:
            return airframe_outputs(rig, record)
        every = Reader(rig, record, self.control, surface_points).outputs()
        return [one for one in every if one.stage in self.effect.shows_in]


def _built(rig: Rig, put: Sequence[_Put]) -> Rig | None:
    real: Rig | None = rig
    for one in put:
        real = None if real is None else one.into(real)
    return real


def _pulses(times: NDArray[np.float64], at: float) -> NDArray[np.float64]:
    """Return a doublet and a 3-2-1-1 of unit size from a time on, s."""
    force = np.zeros_like(times)
    for length, sign in PULSES_s:
        for edge, step in ((at, sign), (at + length, -sign)):
            force += step * np.clip((times - edge) / RISE_s, 0.0, 1.0)
        at += length
    return force


def _truth(
    category: str, rig: Rig, real: Rig, put: Sequence[_Put], record: Record, conditions: Conditions
) -> Truth:
    """Return the truth, with the gap of each effect's stage under the nominal and the real rig."""
    gaps, clean = dict[str, float](), dict[str, float]()
    for one in put:
        outputs = one.outputs(rig, record)
        gaps[one.stage] = max(output.gap(rig) for output in outputs)
        clean[one.stage] = max(output.gap(real) for output in outputs)
    each = tuple(gaps[one.stage] for one in put)
    ratio = min((gaps[stage] / clean[stage] for stage in gaps), default=1.0)
    return Truth(
        category,
        rig.name,
        effects=tuple(
            TrueEffect(
                placed(one.effect.name, one.owner),
                one.stage,
                {one.effect.free[0].named(one.control): one.value},
            )
            for one in put
        ),
        stages=tuple(sorted(gaps)),
        gap=gaps,
        sizes=Sizes(clean, each, ratio) if put else None,
        conditions=conditions,
    )
